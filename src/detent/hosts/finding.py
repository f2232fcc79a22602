"""Looking for controllers on a line of which nothing is known, by questions that harm none of them.

Whoever is there hears every question, in its own format. So the order is this, and a later question is asked only
where the earlier ones found nobody:

1. **SPACE**, 8N1 at the rates of the DCB-274 and of GenStepper, the fastest first. GenStepper answers it with its
   prompt and does nothing (page 24: space is a command without an effect). A DCB-274 in single mode signs on, or
   echoes it (page 22). At any other of these rates it is heard as 00h, 80h or F8h to FFh, which are no command, no
   name and no digit. What may stand in the line that it joins is taken back by BS before CR is sent: a CR alone
   could carry out what somebody had begun to type.
2. **F and CR**, without and with each address, 7O2 at the rates of the GS-C200, the fastest first. F is an order to
   find home on a DCB-274 in single mode, and letters are commands of GenStepper: neither is there by now. On a party
   line nothing is carried out that has no LF. No checksum is sent: a module that wants one answers E1, and is then
   asked with one. Behind what somebody had begun to type, F spoils it. One thing F does: it fetches the error that
   a program has left behind, which is told once; it is part of what is found.
3. **LF and a name**, for each name that an axis on a DCB-274 party line can have, at its rates. Only the named axis
   answers, and nothing else happens (page 26). Letters are commands of GenStepper, and LF and a name would begin a
   daisy chain at a DCB-274 that waits for its sign-on (page 23): both would have answered SPACE. Before the first
   name, more than a line can hold spoils what may have stood there.
4. **status** of each drive of a SUPERSIGMA, if it is asked for by name, behind a silence, and then nothing else: its
   messages have no marks between them, so a drive that waits for the rest of one would take the question for it.

Never asked: ``&`` of the SIN-10, which resets every axis; V1 before it is known who answers, which is a velocity
to a DCB-274. A daisy chain without names is signed on as if it were one axis: switch it off and on to name it then.
"""

import re
from collections.abc import Callable, Generator, Iterable, Sequence
from typing import Final, NamedTuple, TypeAlias

from detent.hosts.dcb274.handshake import BS, LF, SINGLE_LONGEST, NotListening
from detent.hosts.dcb274.names import is_name
from detent.hosts.dcb274.party_line import SPOIL, PartyLine
from detent.hosts.dcb274.single_mode import SingleMode
from detent.hosts.errors import DriverError, Refused
from detent.hosts.exchange import Answer, Ask, Clear, Pause, Progress, Rest, length, until
from detent.hosts.gsc200.frames import Frames
from detent.hosts.microbus import ANSWER, SILENCE, STATUS
from detent.ticks import SECOND
from detent.uart import Format

DCB_274 = tuple(Format(baud) for baud in (460_800, 38_400, 19_200, 9_600))  # jumpers B1 and B2 (page 12)
GENSTEPPER = tuple(Format(baud) for baud in (9_600, 4_800, 2_400, 1_200, 600))  # as ordered; a quarter with DUALBAUD
GS_C200 = tuple(Format(baud, 7, "odd", 2) for baud in (9_600, 4_800, 2_400, 1_200, 600, 300, 150, 110))
SUPERSIGMA = (Format(200_000),)  # a MICROBUS as a stream of bytes

FORMATS: Final[dict[str, tuple[Format, ...]]] = {
    "dcb-274": DCB_274,
    "bs0610": GENSTEPPER,
    "gs-c200": GS_C200,
    "supersigma": SUPERSIGMA,
}
"""The families that can be looked for, by the model that stands for each, and the formats that each can have."""

USUAL = ("dcb-274", "bs0610", "gs-c200")
NAMES = "".join(chr(value) for value in range(0x21, 0x7F) if is_name(chr(value)))
ADDRESSES = (None, 1, 2, 3, 4, 5, 6, 7)
DRIVES = range(256)
SPACES = 2  # the first character behind a while may be lost
PATIENCE = 0.05  # seconds that a controller, an adapter and this computer may take to begin an answer
STATE = r"[RB]|E[356]"  # what F is answered: ready, busy, an error that a program left behind


class Tune(NamedTuple):
    """Go on in another format."""

    form: Format


class Found(NamedTuple):
    """A controller: its model, the format in which it answered, what its driver must be told, and what it said."""

    model: str
    form: Format
    options: dict[str, object]
    says: str


Move: TypeAlias = Ask | Pause | Rest | Clear | Progress | Tune
Search: TypeAlias = Generator[Move, Answer, list[Found]]


class Pass(NamedTuple):
    """A kind of question, asked in one format: so many, each taking so many seconds where nobody answers."""

    kind: str
    form: Format
    questions: int
    seconds: float
    rate: str  # as people read it; nothing where the line has none


def plan(
    models: Sequence[str] = USUAL,
    *,
    rates: Iterable[int] | None = None,
    formless: bool = False,
    patience: float = PATIENCE,
) -> list[Pass]:
    """The passes of a search for `models` (names of `FORMATS`), at `rates` alone if they are given.

    A line without a format, a pseudo-terminal or TCP, hears everything at any rate: each question is asked once, with
    the time that the slowest rate takes. Raises ValueError for what cannot be looked for.
    """
    for model in models:
        if model not in FORMATS:
            raise ValueError(f"{model} cannot be looked for; {', '.join(FORMATS)} can")
    if "supersigma" in models and len(models) > 1:
        raise ValueError("a SUPERSIGMA is looked for alone: what is asked of others could be half a message to it")
    wanted = None if rates is None else set(rates)
    known = {form.baud for model in models for form in FORMATS[model]}
    if wanted is not None and not wanted & known:
        raise ValueError(f"none of these controllers talks at {', '.join(map(str, sorted(wanted)))} baud")

    def formats(*families: str) -> list[Format]:
        forms = {form for family in families if family in models for form in FORMATS[family]}
        chosen = sorted(forms, key=lambda form: -form.baud)
        if formless:
            return chosen[-1:]
        return [form for form in chosen if wanted is None or form.baud in wanted]

    def passes(kind: str, forms: list[Format], questions: int, characters: int) -> list[Pass]:
        return [
            Pass(
                kind,
                form,
                questions,
                patience + characters * form.duration() / SECOND,
                "" if formless else f" at {form}",
            )
            for form in forms
        ]

    return [
        *passes("space", formats("dcb-274", "bs0610"), SPACES, 5),
        *passes("frames", formats("gs-c200"), len(ADDRESSES), 7),
        *passes("names", formats("dcb-274"), len(NAMES), 3),
        *passes("status", formats("supersigma"), len(DRIVES), 5),
    ]


def search(passes: Sequence[Pass]) -> Search:
    """Ask; what was found. Its `Progress` counts milliseconds, of as many as it takes where nobody answers."""
    asked = _Asked(passes)
    for one in passes:
        yield Tune(one.form)
        match one.kind:
            case "space":
                found = yield from _space(one, asked)
            case "names":
                found = yield from _names(one, asked)
            case "frames":
                found = yield from _frames(one, asked)
            case _:
                found = yield from _status(one, asked)
        if found:
            return found
    return []


class _Asked:
    """How far a search is."""

    def __init__(self, passes: Sequence[Pass]) -> None:
        self._total = round(sum(one.questions * one.seconds for one in passes) * 1e3)
        self._done = 0.0

    def next(self, one: Pass, what: str) -> Progress:
        """The next question of a pass is about to be asked."""
        at = round(self._done * 1e3)
        self._done += one.seconds
        return Progress(at, self._total, f"{what}{one.rate}")


# -- SPACE -----------------------------------------------------------------------------------------------------


def _space(one: Pass, asked: _Asked) -> Search:
    for _ in range(SPACES):
        yield asked.next(one, "SPACE")
        yield Clear()
        answer = yield Ask(b" ", _greeted, one.seconds)
        if answer.data.rstrip().endswith(b"*"):
            return [(yield from _genstepper(one))]
        signed_on = re.search(rb"AMS|SMC-27", answer.data) is not None
        if signed_on or answer.data == b" ":
            return (yield from _dcb274(one, signed_on))
    return []


def _greeted(data: bytes) -> int | None:
    """A prompt, a whole line, or the echo of SPACE."""
    return len(data) if data == b" " or b"*" in data or re.search(rb"\S[^\n]*\r\n", data) else None


def _genstepper(one: Pass) -> Generator[Move, Answer, Found]:
    """Its sign-on, by report -12 (page 39); VALUE is 0 again behind it, which moves nothing."""
    answer = yield Ask(b"-12?", _reported, one.seconds + 200 * _character(one))
    lines = [line.strip() for line in answer.data.decode("latin-1").split("\n")]
    yield Ask(b"0 ", until(b"*"), one.seconds)
    told = [line for line in lines if line.strip("* ")]
    return Found("bs0610", one.form, {}, told[0] if told else "prompts, and tells no version")


def _reported(data: bytes) -> int | None:
    """Text and a prompt; a prompt alone may be that of an earlier character."""
    found = re.search(rb"[^\s*][^*]*\*", data)
    return found.end() if found else None


def _dcb274(one: Pass, signed_on: bool) -> Search:
    """What X prints (page 52), in a line that BS has emptied (page 22); nothing for a line that only echoes."""
    for _ in range(0 if signed_on else SINGLE_LONGEST + 1):
        answer = yield Ask(BS, length(1), one.seconds)
        if answer.data != BS:
            break
    settings = ""
    try:
        settings = yield from SingleMode(one.seconds).line("X", 1.0)
    except Refused:
        settings = "in program mode"
    except DriverError:
        if not signed_on:
            return []  # a ring, or a plug that sends back what it hears
    return [Found("dcb-274", one.form, {}, settings.strip() or "signed on")]


# -- F and CR --------------------------------------------------------------------------------------------------


def _frames(one: Pass, asked: _Asked) -> Search:
    found = []
    for address in ADDRESSES:
        yield asked.next(one, "point to point" if address is None else f"address {address}")
        module = yield from _gsc200(one, address)
        if module is not None:
            found.append(module)
            if address is None:
                break  # a line of one module
    return found


def _gsc200(one: Pass, address: int | None) -> Generator[Move, Answer, Found | None]:
    """A module, if anything answers: the first answer may be to what stood in the line before."""
    plain = Frames(address, checksums=False)
    for frames in (plain, plain, Frames(address), Frames(address, ored=False)):
        answer = yield from _framed(one, frames, "F")
        if not answer.whole:
            return None
        state = frames.text(answer.data)
        if state is not None and re.fullmatch(STATE, state):
            counter = yield from _framed(one, frames, "V1", 12 * _character(one))
            position = frames.text(counter.data) if counter.whole else None
            return _module(one.form, frames, state, position or "")
    return None


def _framed(one: Pass, frames: Frames, command: str, more: float = 0.0) -> Generator[Move, Answer, Answer]:
    yield Clear()
    return (yield Ask(frames.frame(command), frames.end, one.seconds + more))


def _module(form: Format, frames: Frames, state: str, position: str) -> Found:
    options: dict[str, object] = {}
    if frames.address is not None:
        options["address"] = frames.address
    if not frames.checksums:
        options["checksums"] = False
    elif not frames.ored:
        options["revision"] = "2.1"
    signed = position[1:2] in ("+", "-")  # the counter of a GS-C200S always has one
    says = {"R": "ready", "B": "busy"}.get(state, f"ready, and a program had ended with {state}")
    if re.fullmatch(r"V[+-]?\d+", position):
        says += f", at {int(position[1:])}"
    return Found("gs-c200s" if signed else "gs-c200", form, options, says)


# -- LF and a name ---------------------------------------------------------------------------------------------


def _names(one: Pass, asked: _Asked) -> Search:
    found = []
    yield Ask(SPOIL)
    for name in NAMES:
        yield asked.next(one, f"name {name}")
        yield Clear()
        entered = LF + name.encode()
        answer = yield Ask(entered, _ends_in(name.encode()), one.seconds)
        if not answer.whole:
            continue
        yield Ask(LF, until(LF), one.seconds)
        try:
            # a ring sends back what it hears: data alone proves that the axis is there
            moving = yield from PartyLine(name, one.seconds).line("^", 1.0)
        except NotListening:  # it has echoed its name, and nothing behind that
            found.append(Found("dcb-274", one.form, {"mode": "party", "name": name}, "runs a program, or jogs"))
            continue
        except DriverError:
            moving = ""
        if moving.strip():
            state = "at rest" if moving.strip() == "0" else "moving"
            found.append(Found("dcb-274", one.form, {"mode": "party", "name": name}, state))
    yield Ask(LF)
    return found


def _ends_in(end: bytes) -> Callable[[bytes], int | None]:
    """Complete once everything that came ends so."""
    return lambda data: len(data) if data.endswith(end) else None


# -- status ----------------------------------------------------------------------------------------------------


def _status(one: Pass, asked: _Asked) -> Search:
    found = []
    yield Pause(SILENCE)  # a drive forgets half a message
    for number in DRIVES:
        yield asked.next(one, f"drive {number}")
        yield Clear()
        answer = yield Ask(bytes((number, STATUS)), length(ANSWER), one.seconds)
        if answer.whole:
            steps, moving = int.from_bytes(answer.data[:2], "big"), answer.data[2] & 1
            says = f"{'moving' if moving else 'at rest'}, {steps} steps in its last movement"
            found.append(Found("supersigma", one.form, {"drive": number}, says))
    return found


def _character(one: Pass) -> float:
    return one.form.duration() / SECOND
