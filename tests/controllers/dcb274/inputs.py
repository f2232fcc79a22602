"""What may reach a DCB-274: commands, programs, garbage, single characters, levels; and the units themselves."""

from collections.abc import Callable

from hypothesis import strategies as st
from tests.controllers.conformance import Candidate

from detent.controllers.dcb274 import pins
from detent.controllers.dcb274.commands import TABLE
from detent.controllers.dcb274.firmware import Dcb274
from detent.lines.sin import Sin8, Sin10
from detent.ticks import MS, US, Ns
from detent.uart import Char

USUAL = [0, 0, 1, 2, 3, 5, 8, 10, 16, 20, 100, 128, 129, 160, 192, 200, 256, 1000, 1600, 2048, 8_388_607]
NUMBERS = st.sampled_from(USUAL)
ARGUMENTS = st.lists(NUMBERS | st.integers(-300, 300) | st.integers(-20_000_000, 20_000_000), max_size=3)
LETTERS = st.sampled_from([row.letter for row in TABLE])
MOVING = st.sampled_from([
    "+100", "+7", "-30", "+0", "R 0", "R -50", "M 900", "M -3000", "M 0", "M 2000", "F 1000 0", "F 500 1", "@", "W",
    "W 3", "V 9000", "I 400", "K 1 2", "K 0 0", "D 3", "H 0", "O 5",
])  # fmt: skip
PROGRAMS = st.sampled_from([
    ["P 0", "+30", "W 0", "-20", "W 1", "Z", "G 0", "P"],
    ["P 128", "k 10 8", "k 20 16", "i 30 24", "P", "P 0", "O 0", "k 5 8", "+100", "W 0", "P", "G"],
    ["P 160", "A 8", "Z", "P", "P 0", "T 10 160", "M 900", "L 2048 0", "@", "P", "G 0 1"],
    ["P 0", "+5", "J 0 3", "L 0 1", "A 16", "P 0", "G"],
    ["P 1600", "M 500", "W 5", "M -500", "P", "\x03", " "],
    ["T 15 128", "P 128", "+5", "W", "|", "P", "P 0", "+40", "W 2", "P", "G 0"],
    ["l 2"], ["l 9"], ["l 4"], ["l 16"], ["l 32"], ["S"], ["C 0"], ["C 1"], ["Z 1"], ["B 10 200"], ["w 5"], ["Q"],
])  # fmt: skip
KEYS = st.sampled_from([b"\x1b", b"\x03", b"\x0e", b"\x10", b"@", b" ", b"B ", b"\nC", b"\x08", b"\r", b"\n", b"|"])


def command() -> st.SearchStrategy[str]:
    """A command line, right or wrong."""
    made = st.builds(lambda letter, numbers: letter + " ".join(map(str, numbers)), LETTERS, ARGUMENTS)
    return st.one_of(MOVING, MOVING, made, st.text(st.characters(codec="ascii"), max_size=20))


def lines(named: bool) -> st.SearchStrategy[bytes]:
    """Command lines as a host sends them, programs, single characters and noise."""
    end = "\n" if named else "\r"
    before = "A" if named else ""

    def dressed(texts: list[str]) -> bytes:
        return "".join(f"{before}{text}{end}" for text in texts).encode("latin-1")

    return st.one_of(
        command().map(lambda text: dressed([text])),
        command().map(lambda text: dressed([text])),
        PROGRAMS.map(dressed),
        KEYS,
        st.binary(max_size=30),
    )


def frames(named: bool, gaps: tuple[Ns, ...]) -> st.SearchStrategy[list[tuple[Ns, Char]]]:
    """Lines with the pause before every character."""

    def spaced(data: bytes, gap: Ns, sound: bool) -> list[tuple[Ns, Char]]:
        return [(gap, Char(value, framing_ok=sound or value % 7 > 0)) for value in data]

    return st.builds(spaced, lines(named), st.sampled_from(gaps), st.sampled_from([True, True, True, False]))


def wired(make: Callable[[], Dcb274]) -> Callable[[], Dcb274]:
    """The same with wires on its pulse outputs."""

    def made() -> Dcb274:
        unit = make()
        unit.watch("P4")
        unit.watch("STEPS")
        return unit

    return made


PARTY = {"PARTY": 1}
INPUTS = (*pins.INPUTS, "PARTY")
_BIT = 104_167

CANDIDATES = (
    Candidate("dcb-274", Dcb274, frames(False, (0, _BIT * 10)), INPUTS, "RX"),
    Candidate("dcb-274 without times", lambda: Dcb274(line_timing=False, execution_times=False), frames(False, (0,)),
              INPUTS, "RX", gaps=st.sampled_from([0, 0, 1, 1 * MS, 40 * MS, 300 * MS]), most_per_second=500_000),
    Candidate("dcb-274 on a party line", lambda: Dcb274(PARTY, overrun=True), frames(True, (0, 22 * US)), INPUTS, "RX"),
    Candidate("dcb-274 with wires", wired(Dcb274), frames(False, (0,)), INPUTS, "RX",
              gaps=st.sampled_from([0, 1, 20 * US, 1 * MS, 40 * MS]), most_per_second=300_000),
    Candidate("dcb-274-e", lambda: Dcb274(encoder=True, p4_input=True), frames(False, (0, 1 * MS)), INPUTS, "RX"),
)  # fmt: skip

SIN_LINES = st.sampled_from(
    [b"&\r", b"A+100;AZ\r", b"9WA;9W*;XZ\r", b"\x1b", b";;\r", b"A", b"A^   0\n", b"\n", b"#\n"]
)
_SIN = (SIN_LINES | st.binary(max_size=300)).map(lambda data: [(0, Char(value)) for value in data])
SIN_CANDIDATES = tuple(
    Candidate(f"{name}, {port}", make, _SIN, ["SWITCH"], port)
    for name, make in (("sin-8", Sin8), ("sin-10", Sin10))
    for port in ("RXD", "RX")
)
