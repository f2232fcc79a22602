"""A line as a person types it, and what the unit says to it: what `detent send` and `detent terminal` do.

The driver adds what the protocol demands: checksum and CR, the echo of each character, the name of an axis. What is
answered comes back as it was said, with its meaning where the manual gives one.
"""

import re
from collections.abc import Callable, Mapping
from functools import singledispatch
from typing import Final, NamedTuple, TypeAlias

from detent.hosts.dcb274 import Dcb274
from detent.hosts.dcb274.answers import MOVING, Inputs, JogInputs, Ports
from detent.hosts.dcb274.ranges import LARGEST_ADDRESS
from detent.hosts.errors import BadAnswer, MotionFailed, NoAnswer, Refused, Spoken
from detent.hosts.exchange import Ask, Clear, Driver, Rest, Steps
from detent.hosts.genstepper import Action, GenStepper, Reports
from detent.hosts.genstepper.commands import RESET_SECONDS, STEP_MODES
from detent.hosts.gsc200 import GsC200
from detent.hosts.gsc200.commands import EEPROM_SECONDS
from detent.hosts.gsc200.dialogue import ERRORS, Again
from detent.hosts.interpolation import UNIT
from detent.hosts.microbus import Report
from detent.hosts.supersigma import LOW, Supersigma

MOTION: Final = 60.0  # seconds that a motion may take that is waited for, unless the caller says more
QUIET: Final = 0.3  # seconds without a word from a program, after which it is looked whether it runs still
ANYTHING: Final = re.compile(r"(?s).+")
SLOWEST_FRAME: Final = 12 * 11 / 110  # seconds: the longest answer of a GS-C200 at 110 baud


class Said(NamedTuple):
    """The lines that were answered, as they came; what they mean; whether the unit said no, or ignored a command.

    `meanings` are those of single lines of `answers`, "" for one without, or nothing.
    """

    answers: tuple[str, ...]
    meaning: str = ""
    refused: bool = False
    meanings: tuple[str, ...] = ()


Heard: TypeAlias = Callable[[str], object]
"""Is given each line that a unit prints while something is waited for, as it comes."""


def unheard(line: str) -> None:
    """Nobody looks at what is printed meanwhile."""


@singledispatch
def say(driver: Driver, line: str, seconds: float = MOTION, heard: Heard = unheard) -> Steps[Said]:
    """Say one line to the unit of `driver`; what it said. Raises DriverError, and ValueError for what is no line.

    What the line waits for, the end of a motion, may take so many `seconds`; lines that a program prints meanwhile go
    to `heard`. A program that it starts is not waited for: see `listen`.
    """
    raise NotImplementedError(f"nobody knows how a line is typed to {driver.title}")
    yield


def listen(driver: Driver, seconds: float, heard: Heard, enough: Callable[[], bool] = lambda: False) -> Steps[str]:
    """Pass on what a program that a line has started prints, as it comes, until it ends; what became of it, in words.

    At once, with "", where none runs that could print: only a DCB-274 in single mode has such. After so many
    `seconds`, or when it is `enough`, it is left running.
    """
    if not isinstance(driver, Dcb274) or not driver.runs_a_program or enough():
        return ""
    began = None
    while True:
        now = (yield Rest(0.0)).at
        yield from driver.overhear(QUIET)
        lines = driver.printed()
        if not lines:  # it may have ended: that is asked for
            yield from driver.moving()
            lines = driver.printed()
        for line in lines:
            heard(line)
        if not driver.runs_a_program:
            return "the program has ended"
        began = now if began is None else began
        if now - began > seconds or enough():
            return "the program still runs; ESC ends it, @ slows down"


def cuts_in(driver: Driver, line: str) -> bool:
    """Whether a line is for a program that runs, and does not wait for its end."""
    return isinstance(driver, Dcb274) and line.strip().upper() in _SINGLE


def leave(driver: Driver) -> Steps[str]:
    """Out of program mode, if what was said has led there, so that nothing is left half open; what was done, in words.

    A GS-C200 can only be told of: E leads out, and starts the program.
    """
    if isinstance(driver, Dcb274) and driver.programming:
        yield from driver.command("P")
        driver.programming = False
        return "program mode was ended (P)"
    if isinstance(driver, GsC200) and driver.programming:
        if not driver.signed:
            return "it is in programming mode still: E leaves it, and starts the program; or switch it off and on"
        yield from driver.leave_programming()
        return "programming mode was left (Px), the program is not started"
    return ""


def raw(data: bytes, seconds: float) -> Steps[bytes]:
    """Send bytes as they are; everything that comes within so many seconds."""
    yield Clear()
    answer = yield Ask(data, lambda came: None, seconds)
    return answer.data


# -- GS-C200 ---------------------------------------------------------------------------------------------------


@say.register
def _(driver: GsC200, line: str, seconds: float = MOTION, heard: Heard = unheard) -> Steps[Said]:
    line = line.strip()
    if not line or not line.isascii() or not line.isprintable():
        raise ValueError(f"{line!r} is no command line: type a command like F, V1 or +100")
    more = EEPROM_SECONDS if line[0] == "M" else 0.0
    text: str | None = yield from driver.say(line, ANYTHING, Again.NEVER, more)
    answers = []
    while text is not None:
        answers.append(text)
        if line != "Q" or text in ("END", "B", *ERRORS):
            return Said(tuple(answers), _meaning(line, text), text[:2] in ERRORS or (text == "B" and line != "F"))
        answer = yield Ask(b"", driver.frames.end, driver.patience + SLOWEST_FRAME)  # a listing: a frame a line
        text = driver.frames.text(answer.data) if answer.whole else None
    raise BadAnswer(driver.title, "its list of the program was damaged", Spoken(driver.frames.frame(line), answer.data))


def _meaning(line: str, text: str) -> str:
    """The datasheet's words for an answer."""
    if text[:2] in ERRORS:
        return ERRORS[text[:2]] + ("; it answers with a checksum, so it wants one" if text[2:] else "")
    if line.startswith("V2") and re.fullmatch(r"V[0-7][0-7]", text):
        levels = ((kind, int(figure)) for kind, figure in zip(("UI", "UO"), text[1:], strict=True))
        return ", ".join(f"{kind}{n + 1}={value >> n & 1}" for kind, value in levels for n in range(3))
    if line.startswith("V1") and re.fullmatch(r"V[+-]?\d+", text):
        return f"position {int(text[1:])}"
    return _WORDS.get(text, "")


_WORDS: Final = {"Y": "done, stored or begun", "B": "busy: a program, a command or a move goes on", "R": "ready"}


# -- GenStepper ------------------------------------------------------------------------------------------------


@say.register
def _(driver: GenStepper, line: str, seconds: float = MOTION, heard: Heard = unheard) -> Steps[Said]:
    """Command by command, each when the prompt of the last has come: a new character drops what was not sent yet.

    A board answers what it does not know as it answers what it does: commands that it ignores are told from the
    manual (pages 22 to 44).
    """
    if not line.strip() or not line.isascii() or not line.isprintable():
        raise ValueError(f"{line!r} is no command line: type commands like -1? or X1000GI")
    answers: list[str] = []
    ignored: list[str] = []
    value = 0  # of the last number, which all commands behind it have (page 24)
    for command in re.findall(r"[-+\d]*[^-+\d]|[-+\d]+$", line.rstrip()):
        if command[-1] in "+-0123456789":
            command += " "  # a number alone is not answered; space is a command without an effect
        number = re.match(r"[-+]?\d+", command)
        value = int(number[0]) if number else value
        ignored += _ignored(command, value)
        more = seconds if command[-1] in "Ii" else RESET_SECONDS if command[-1] == "!" else 0.0
        try:
            found = yield from driver.exchange(command, re.compile(rb"(?s)(.*?)\*"), more=more)
        except NoAnswer:
            if command[-1] in "Ii":
                raise MotionFailed(driver.title, f"does not say within {seconds:g} s that it is idle") from None
            raise
        answers += [text for one in found[1].decode("latin-1").split("\n") if (text := one.strip())]
    meanings = tuple(_reported(answer) for answer in answers)
    what = "; ".join(ignored) or ("" if answers else "done")
    return Said((*answers, "*"), what, bool(ignored), (*meanings, ""))


def _ignored(command: str, value: int) -> list[str]:
    """What the board does not do of a command with the VALUE that it has, in words."""
    letter = command[-1].upper()
    if letter in " ,":
        return []
    if letter not in _LETTERS:
        return [f"ignored: {command[-1]} is no command"]
    if letter in _TAKES and value not in _TAKES[letter]:
        numbers = _TAKES[letter]
        return [f"ignored: {letter} takes {numbers[0]} to {numbers[-1]}, not {value}"]
    return []


_LETTERS: Final = "ABEGHIKLMOPRSTVWXYZ!=?"
_TAKES: Final = {"H": range(2), "M": range(2), "O": STEP_MODES, "W": range(3)}  # pages 28, 30, 36


def _reported(text: str) -> str:
    """What a line of a report says: ``X,-2,132`` is the speed of X (pages 39 to 43)."""
    found = re.fullmatch(r"([XY]),(-?\d+),([-\d,]+)", text)
    if found is None:
        return ""
    motor, number, values = found[1], int(found[2]), found[3].split(",")
    names = [name.replace("_", " ") for name in Reports._fields]
    if number == 0 and len(values) == len(names):
        told = zip(names, values, strict=True)
    elif -len(names) <= number < 0 and len(values) == 1:
        told = zip([names[-number - 1]], values, strict=True)
    else:
        return ""
    return f"{motor}: " + ", ".join(f"{name} {_action(value) if name == 'action' else value}" for name, value in told)


def _action(value: str) -> str:
    try:
        return Action(int(value)).name.lower().replace("_", " ")
    except ValueError:
        return value


# -- DCB-274 ---------------------------------------------------------------------------------------------------


@say.register
def _(driver: Dcb274, line: str, seconds: float = MOTION, heard: Heard = unheard) -> Steps[Said]:
    """A line; ESC, ^C, ^P and ^N NAME in letters stand for the single characters. Q of single mode reads on."""
    text = line.strip()
    if not text.isascii() or not text.isprintable():
        raise ValueError(f"{line!r} is no command line: type a command like X or +1000, or ESC, ^C, ^P, ^N NAME")
    try:
        return (yield from _dcb274(driver, text, seconds, heard))
    except Refused as error:
        return Said((error.code,), error.what, refused=True)


def _dcb274(driver: Dcb274, text: str, seconds: float, heard: Heard) -> Steps[Said]:
    if text.upper() in _SINGLE:
        what, meaning = _SINGLE[text.upper()]
        yield from getattr(driver, what)()
        return Said((), meaning)
    if text.startswith("^N"):
        yield from driver.store_name(text[2:].strip())
        return Said((), "named, for good")
    listing = re.fullmatch(r"Q ?(\d*)", text)
    if listing and driver.mode == "single" and not driver.programming:
        found = yield from driver.listing(int(listing[1] or 0))
        return Said((*map(str, found.lines), str(found.end)), "" if found.lines else "no program there")
    begun = re.fullmatch(r"G ?(\d*)(?: ([01]))?", text)
    if begun and driver.mode == "single" and not driver.programming:
        place = int(begun[1] or 0)
        if begun[2] == "1":
            yield from driver.trace(place, 0.0)
        elif 0 <= place <= LARGEST_ADDRESS + 1 and not 192 < place < 256:
            yield from driver.go(place)
        else:
            yield from driver.command(text, seconds)  # which is refused, in the unit's own way
        for line in driver.printed():
            heard(line)
        return Said((), "started")
    answer = yield from driver.command(text, seconds)
    if re.fullmatch(r"P ?\d*", text):
        driver.programming = not driver.in_program_mode  # the P that ends it ignores its address
    return Said((answer,) if answer.strip() else (), _answered(text, answer.strip()) if answer.strip() else "done")


def _answered(text: str, answer: str) -> str:
    """The manual's words for what a line was answered (pages 35, 53, 54 and 56)."""
    asked = re.fullmatch(r"(?P<what>[Z^\]A]) *(?P<of>\d*)", text)
    if asked is None or not re.fullmatch(r"-?\d+", answer):
        return ""
    value = int(answer)
    match asked["what"], asked["of"]:
        case "Z", _:
            return f"position {value}"
        case "^", "":
            return MOVING.get(value, "")
        case "]", "1":
            return _active(JogInputs.of(value)._asdict())
        case "]", _:
            return _active(Inputs.of(value)._asdict())
        case "A", "129":
            return _active(Ports.of(value)._asdict())
    return ""


def _active(flags: Mapping[str, bool]) -> str:
    return "active: " + (", ".join(name.replace("_", " ") for name, on in flags.items() if on) or "none")


_SINGLE: Final = {
    "ESC": ("abort", "everything stopped at once"),
    "@": ("stop", "slowing down"),
    "^C": ("reset", "reset"),
    "^P": ("party_line", "reset, on a party line now"),
}


# -- SUPERSIGMA ------------------------------------------------------------------------------------------------


@say.register
def _(driver: Supersigma, line: str, seconds: float = MOTION, heard: Heard = unheard) -> Steps[Said]:
    """The words of docs/controllers/supersigma.md; speeds are in units of 100 half steps/s, as on the bus."""
    words = line.split()
    match words[:1], [_whole(word) for word in words[1:]]:
        case ["move"], [steps]:
            yield from driver.move(steps)
        case ["limit"], [steps, speed]:
            yield from driver.limited(steps, speed * UNIT)
            if speed * UNIT < LOW:
                meaning = (
                    f"sent; {speed * UNIT} half steps/s is below {LOW}, where the ramps of the paper's table begin"
                )
                return Said((), f"{meaning}: it goes at {LOW}; status tells what comes of it")
        case ["constant"], [steps, speed]:
            yield from driver.constant(steps, speed * UNIT)
        case ["originate"], []:
            yield from driver.originate()
        case ["stop"], []:
            yield from driver.stop()
        case ["emergency"], []:
            yield from driver.halt()
        case ["status"], []:
            return _told((yield from driver.status()))
        case _:
            raise ValueError(
                f"{line!r}: type move STEPS, limit STEPS SPEED, constant STEPS SPEED, originate, status, stop or "
                "emergency, SPEED in units of 100 half steps/s"
            )
    return Said((), "sent; status tells what comes of it")


def _told(report: Report) -> Said:
    flags = ("moving", "end_of_rail", "excessive_force", "originated", "refused")
    words = [name.replace("_", " ") for name in flags if getattr(report, name)]
    return Said((f"{report.steps} steps", *words), "" if words else "at rest")


def _whole(word: str) -> int:
    try:
        return int(word)
    except ValueError:
        raise ValueError(f"{word!r} is no whole number") from None
