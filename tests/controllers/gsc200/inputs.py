"""What may reach a GS-C200: commands, programs, garbage, damaged characters, levels; and the modules themselves."""

from collections.abc import Callable

from hypothesis import strategies as st
from tests.controllers.conformance import Candidate

from detent.controllers.gsc200.firmware import GsC200
from detent.ticks import MS, US, Ns
from detent.uart import Char

INPUTS = ("UI1", "UI2", "UI3", "ENABLE", "HOME", "EOT")
USER_PINS = st.sampled_from("123")


def _number(low: int, high: int) -> st.SearchStrategy[str]:
    """Numbers, more often small ones and the ends."""
    ends = st.sampled_from([low, low + 1, high])
    return (ends | st.integers(low, min(high, low + 30)) | st.integers(low, high)).map(str)


def _signed(high: int) -> st.SearchStrategy[str]:
    return st.builds(str.__add__, st.sampled_from("+-"), _number(1, high))


def _with(letters: str, argument: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return argument.map(letters.__add__)


def stored(model: str, fastest: int = 1000, longest: int = 999_999) -> st.SearchStrategy[str]:
    """Commands that programs are made of."""
    common = [
        _with("A", USER_PINS),
        _with("C", USER_PINS),
        _with("D", st.sampled_from(["1", "2", "255"])),
        _with("L", st.sampled_from(["0", "1", "2", "3", "255"])),
        _with("R", _number(1, 999)),
        _with("S", _number(1, fastest)),
        _with("T", _number(1, fastest)),
        _with("U", USER_PINS),
        _with("W", USER_PINS),
        _signed(longest),
        _signed(40),
    ]
    if model == "gs-c200":
        own = [
            _with("G", st.sampled_from(["0", "5", "100"]) | _number(0, 10 * longest)),
            st.sampled_from(["G+", "G-", "G+1", "G-2", "G+3"]),
        ]
    else:
        own = [
            _with("G", _signed(8_388_607) | _signed(100)),
            st.sampled_from(["g+", "g-", "g+1", "g-2", "g+3"]),
            _with("f", _signed(8_388_607)),
            st.sampled_from(["I1", "I2", "I3"]),
            _with("j", _number(0, 118)),
            st.builds("jc{},{}".format, st.integers(0, 7), st.integers(0, 40)),
        ]
    return st.one_of(*common, *own)


def commands(model: str, fastest: int = 1000, longest: int = 999_999) -> st.SearchStrategy[str]:
    """Commands of the model, allowed now or not."""
    immediate = ["E", "F", "H", "H+", "H-", "I1", "I2", "I3", "K", "M", "Q", "V1", "V2", "X", "Z", "Z", "K", "F"]
    immediate += ["P"] if model == "gs-c200" else ["Po", "P0", "Px"]
    return st.sampled_from(immediate) | stored(model, fastest, longest)


def programs(model: str, fastest: int = 1000, longest: int = 999_999) -> st.SearchStrategy[list[str]]:
    """A program as it is entered and started."""
    enter = "P" if model == "gs-c200" else "Po"
    body = st.lists(stored(model, fastest, longest), min_size=1, max_size=8)
    return st.builds(lambda steps, end: [enter, *steps, *end], body, st.sampled_from([["E"], ["M", "E"], []]))


NONSENSE = st.sampled_from(["", "Y9", "a", "A9", "+0", "f5", "L", "G", "K1", "jc", "AAAAAAAAAAAAAAAAA", "S 1", "1F"])


def _typed(frame: Callable[[str], bytes], texts: list[str], pause: Ns) -> list[tuple[Ns, Char]]:
    return [(pause, Char(value)) for text in texts for value in frame(text)]


def _garbage(values: bytes, damaged: list[int], pause: Ns) -> list[tuple[Ns, Char]]:
    return [
        (pause, Char(value & 0x7F, parity_ok=value < 0x80, framing_ok=index not in damaged))
        for index, value in enumerate(values)
    ]


PAUSES = st.sampled_from([0, 1_145_833, 1_145_834])  # all at once, or at 9600 baud


def frames(module: GsC200, fastest: int = 1000, longest: int = 999_999) -> st.SearchStrategy[list[tuple[Ns, Char]]]:
    """What a host sends to `module`, as characters with pauses."""
    model = module.model
    texts = st.one_of(
        commands(model, fastest, longest).map(lambda text: [text]),
        programs(model, fastest, longest),
        NONSENSE.map(lambda text: [text]),
    )
    sound = st.builds(lambda lines, pause: _typed(module.frame, lines, pause), texts, PAUSES)
    raw = st.binary(max_size=20) | st.text("\r\nAFZ1+", max_size=12).map(str.encode)
    garbage = st.builds(_garbage, raw, st.lists(st.integers(0, 19), max_size=1), PAUSES)
    return st.one_of(sound, sound, sound, garbage)


def _candidate(name: str, model: str, straps: dict[str, int], *, watched: bool = False, **options: object) -> Candidate:
    def make() -> GsC200:
        module = GsC200(model, straps, **options)  # type: ignore[arg-type]
        if watched:
            for pin in module.pulse_output.clocks:
                module.watch(pin)
        return module

    pins = (*INPUTS, "CHS", "REC", "SEL1", "RXD", "BR0")
    if watched:  # every pulse is a deadline: keep the moves short
        short = st.sampled_from([0, 0, 1, 1700, 1 * MS]) | st.integers(0, 40 * MS)
        return Candidate(name, make, frames(make(), 100, 200), pins, "RXD", short)
    return Candidate(name, make, frames(make()), pins, "RXD")


CANDIDATES = (
    _candidate("gs-c200", "gs-c200", {}),
    _candidate("gs-c200s", "gs-c200s", {}),
    _candidate("gs-c200 without checksums or line timing", "gs-c200", {"CHS": 0}, line_timing=False),
    _candidate("gs-c200s address 5, short instructions", "gs-c200s", {"SEL2": 0, "SEL0": 0}, instruction_time=20 * US),
    _candidate("gs-c200 V2.1, stand-alone", "gs-c200", {"REC": 0}, revision=(2, 1)),
    _candidate("gs-c200s with a wire on CLOCK", "gs-c200s", {"CHS": 0}, watched=True, line_timing=False),
    _candidate("gs-c200 with a wire on CW and CCW", "gs-c200", {}, watched=True, separate_clocks=True),
)
