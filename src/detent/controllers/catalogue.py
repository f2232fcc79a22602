"""The models by name: what they are, their pins, straps and options, and how to make one.

The command line, the cell files, the help and the reference pages read `MODELS`.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from detent.assembler import Language
from detent.controllers.dcb274 import commands as dcb274_commands
from detent.controllers.dcb274 import link as dcb274_link
from detent.controllers.dcb274 import pins as dcb274_pins
from detent.controllers.dcb274 import program as dcb274_program
from detent.controllers.dcb274.firmware import Dcb274
from detent.controllers.dcb274.phrases import Phrases as Dcb274Phrases
from detent.controllers.device import CommandHelp, Controller
from detent.controllers.genstepper import commands as genstepper_commands
from detent.controllers.genstepper import pins as genstepper_pins
from detent.controllers.genstepper import supply as genstepper_supply
from detent.controllers.genstepper.firmware import GenStepper
from detent.controllers.genstepper.phrases import Phrases as GenStepperPhrases
from detent.controllers.gsc200 import commands as gsc200_commands
from detent.controllers.gsc200 import pins as gsc200_pins
from detent.controllers.gsc200 import program as gsc200_program
from detent.controllers.gsc200.firmware import GsC200
from detent.controllers.gsc200.phrases import Phrases as GsC200Phrases
from detent.controllers.phrase import Lines, Phrases
from detent.controllers.supersigma import commands as supersigma_commands
from detent.controllers.supersigma import link as supersigma_link
from detent.controllers.supersigma import pins as supersigma_pins
from detent.controllers.supersigma.firmware import Supersigma
from detent.controllers.supersigma.phrases import Phrases as SupersigmaPhrases
from detent.controllers.supersigma.program import LEAST_OFFSET
from detent.nearest import CUTOFF, did_you_mean
from detent.pins import Level, Pin
from detent.ramps import differences
from detent.ramps.ways import Way
from detent.ticks import US, parse_duration

CURRENT_STRAPS = frozenset({*genstepper_pins.HALF_JUMPERS, "FUL", "R1K"})
"""Straps that choose a motor's current: S1K halves it and R1K doubles it, so none is a guess for another."""


class CatalogueError(ValueError):
    """A model, strap or option that does not exist, or a value it does not take; the text has the remedy."""


class Option(NamedTuple):
    """A choice that no pin of the real thing makes: how it is written, what it means, what it is by default."""

    name: str
    keyword: str  # of the model's `make`
    read: Callable[[str], Any]  # raises ValueError
    takes: str
    default: str
    help: str


class Limits(NamedTuple):
    """What the manual allows: the supply in V, least and most, and the load of each supply output in A.

    The same for motors that hang on the controller itself: their supply, and the current of a winding as it is made.
    """

    supply: tuple[float, float] = (0.0, float("inf"))
    loads: Mapping[str, float] = {}
    motor_supply: tuple[float, float] = (0.0, float("inf"))
    winding: Callable[[Any], float] = lambda controller: float("inf")


NO_LIMITS = Limits()


class Model(NamedTuple):
    """One model of the catalogue."""

    name: str
    title: str
    manual: str
    pins: tuple[Pin, ...]
    straps: Mapping[str, Level]
    options: tuple[Option, ...]
    make: Callable[..., Controller]
    language: Callable[[], Language[Any]] | None  # None: it holds no programs
    commands: Callable[[], Sequence[CommandHelp]]
    strap_line: Callable[[Sequence[tuple[str, Mapping[str, Level]]]], list[dict[str, Level]]]
    line: str = "serial"  # the kind of line it sits on
    told_apart_by: str = ""  # the option, an attribute of the controller too, in which units of one line must differ
    answered: Callable[[str], bool] = lambda text: True  # whether a host gets an answer to a command line
    limits: Limits = NO_LIMITS
    echoes: bool = False  # whether a unit sends back what its host types
    by_hand: str = ""  # a line for people who type to it on a terminal
    saves: str = ""  # the command line that keeps program memory without supply; "" where none does
    phrases: Callable[[Mapping[str, Level]], Phrases] = lambda straps: Lines()  # what is said on its line, in words


def unknown(kind: str, name: str, known: Sequence[str], *, guess: bool = True) -> CatalogueError:
    """The error for a name that is not among the known ones, with the likeliest of them.

    Without `guess` only another case of it is suggested.
    """
    hint = did_you_mean(name, known, CUTOFF if guess else 1)
    return CatalogueError(f"no {kind} {name!r}; {hint}there are: {', '.join(known)}")


def model(name: str) -> Model:
    """The model of that name. Raises CatalogueError."""
    try:
        return MODELS[name]
    except KeyError:
        raise unknown("model", name, tuple(MODELS)) from None


def language(name: str) -> Language[Any]:
    """The language of a model's programs. Raises CatalogueError."""
    found = model(name)
    if found.language is None:
        speak = [other.name for other in MODELS.values() if other.language is not None]
        raise CatalogueError(f"a {name} holds no programs; models that do: {', '.join(speak)}")
    return found.language()


class Configurable(Protocol):
    """Whatever has straps and options: a model, or a part of a cell that is no controller."""

    @property
    def name(self) -> str:
        """Its model name."""

    @property
    def pins(self) -> tuple[Pin, ...]:
        """Its pin table."""

    @property
    def straps(self) -> Mapping[str, Level]:
        """Its straps and their defaults."""

    @property
    def options(self) -> tuple[Option, ...]:
        """Its options."""


def strap_level(found: Configurable, pin: str, value: object) -> Level:
    """The level that `value` (0, 1, low, high, open) gives to a strap. Raises CatalogueError."""
    if pin not in found.straps:
        guess = pin.upper() not in CURRENT_STRAPS and not CURRENT_STRAPS & found.straps.keys()
        raise unknown(f"strap of the {found.name}", pin, tuple(found.straps), guess=guess)
    text = str(value).strip().lower()
    levels = {"0": 0, "low": 0, "1": 1, "high": 1}
    if text == "open":
        return _pin(found, pin).rest
    if isinstance(value, bool) or text not in levels:
        raise CatalogueError(f"strap {pin} cannot be {value!r}; it takes low (0), high (1) or open")
    return levels[text]


def option_values(found: Configurable, chosen: Mapping[str, object]) -> dict[str, Any]:
    """Keyword arguments for `make` from options as they are written. Raises CatalogueError."""
    known = {option.name: option for option in found.options}
    values = {}
    for name, written in chosen.items():
        if name not in known:
            raise unknown(f"option of the {found.name}", name, tuple(known))
        option = known[name]
        try:
            values[option.keyword] = option.read(str(written))
        except ValueError:
            raise CatalogueError(f"option {name} cannot be {written!r}; it takes {option.takes}") from None
    return values


def _pin(found: Configurable, name: str) -> Pin:
    return next(pin for pin in found.pins if pin.name == name)


def _instruction_time(text: str) -> int:
    duration = parse_duration(text)
    if duration < US:
        raise ValueError("too short")
    return duration


def _revision(text: str) -> tuple[int, int]:
    major, _, minor = text.strip().removeprefix("V").removeprefix("v").partition(".")
    return int(major), int(minor)


def _choice(**meanings: Any) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        try:
            return meanings[text.strip().lower()]
        except KeyError:
            raise ValueError(text) from None

    return read


_GSC200_OPTIONS = (
    Option(
        "instruction_time", "instruction_time", _instruction_time, "a duration of at least 1 us", "1 ms",
        "time that each instruction takes beside what it does",
    ),
    Option(
        "clock", "separate_clocks", _choice(direction=False, separate=True), "direction or separate", "direction",
        "step output: CLOCK with DIR, or besides them a clock for each direction (CW, CCW; figure 10)",
    ),
)  # fmt: skip
_GSC200_REVISION = Option(
    "revision", "revision", _revision, "a revision like 2.1 or 2.2", "2.2",
    "firmware revision: up to 2.1 the checksum is not ORed with 10h",
)  # fmt: skip


def _whole(low: int, high: int) -> Callable[[str], int]:
    """Reads a whole number from `low` to `high`."""

    def read(text: str) -> int:
        value = int(text)
        if not low <= value <= high:
            raise ValueError(text)
        return value

    return read


_SUPERSIGMA_OPTIONS = (
    Option("number", "number", _whole(0, 255), "a number, 0 to 255", "1", "number of the drive on its MICROBUS"),
    Option(
        "short", "short", _choice(**{way.value: way for way in Way}), "hyperbola, exact or free", "hyperbola",
        "ramps of short movements: by the paper's hyperbola, the best of its family, or a curve cut to the length",
    ),
    Option(
        "offset", "offset", _whole(LEAST_OFFSET, 1000), f"half steps, {LEAST_OFFSET} to 1000", "10",
        "half steps that a movement keeps in reserve for low speed behind its ramp",
    ),
    Option(
        "braking", "braking", _whole(1, 100), "a whole number, 1 to 100", "4",
        "in an emergency the loads of the ramp come so many times as often",
    ),
    Option(
        "table", "table", differences.parse, "the line that detent table --option prints", "the paper's",
        "the table of differences in its EPROM",
    ),
)  # fmt: skip


def _gsc200(name: str, options: tuple[Option, ...]) -> Model:
    return Model(
        name,
        f"SGS-THOMSON {name.upper()} intelligent stepper motor controller",
        "docs/controllers/gsc200.md",
        gsc200_pins.PINS,
        gsc200_pins.DEFAULT_STRAPS,
        options,
        lambda straps, **keywords: GsC200(name, straps, **keywords),
        lambda: gsc200_program.language(name),
        lambda: gsc200_commands.reference(name),
        gsc200_pins.strap_line,
        limits=Limits(gsc200_pins.SUPPLY_V, gsc200_pins.LOADS_A),
        by_hand="To type by hand, strap the checksum off: CHS=low. Lines end with CR (Ctrl-M, or Enter in picocom).\n"
        "picocom needs --echo --imap crcrlf as well: nothing is echoed, and answers end with CR alone.",
        saves=gsc200_commands.Op.MEMORY.value,
        phrases=lambda straps: GsC200Phrases(name, straps),
    )


def _within(low: int, high: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        number = int(text)
        if not low <= number <= high:
            raise ValueError(text)
        return number

    return read


_YES_NO = _choice(no=False, yes=True, false=False, true=True)
_RATE = _within(1, 62_500)
_BAUD = _choice(**{"2400": 2400, "4800": 4800, "9600": 9600})
_GENSTEPPER_OPTIONS = (
    Option("step_size", "step_size", _within(1, 64), "1 to 64", "4", "microstep after power-on, 1/64 of a full step"),
    Option("stop_rate", "stop_rate", _RATE, "1 to 62500", "80", "stop OK rate (K) after a reset, microsteps/s"),
    Option("ramp", "ramp", _RATE, "1 to 62500", "8000", "ramp rate (P) after a reset, microsteps/s/s"),
    Option("run_rate", "run_rate", _RATE, "1 to 62500", "800", "run rate (R) after a reset, microsteps/s"),
    Option("auto_rate", "auto_rate", _within(0, 62_500), "0 to 62500", "3072", "auto full step rate (A) after a reset"),
    Option("auto_mode", "auto_mode", _within(0, 3), "0 to 3, as O", "2", "step mode above the auto full step rate"),
    Option("high_power", "high_power", _within(0, 1), "0 (full) or 1 (half)", "0", "H without the half power jumper"),
    Option("low_power", "low_power", _within(0, 1), "0 (full) or 1 (half)", "1", "H with the half power jumper"),
    Option("idle_windings", "idle_windings", _within(0, 2), "0 to 2, as W", "0", "windings when idle after a reset"),
    Option("hard_stop", "hard_stop", _YES_NO, "yes or no", "no", "limit switches stop at once"),
    Option("e_mode", "e_mode", _within(0, 255), "0 to 255, as E", "0", "direct pulse control after a reset"),
    Option("double_current", "double_current", _YES_NO, "yes or no", "no", "one motor on both connectors, without R1K"),
    Option("slew_inputs", "slew_inputs", _YES_NO, "yes or no (NOSLEW)", "yes", "the slew inputs slew"),
    Option("dual_baud", "dual_baud", _YES_NO, "yes or no (DUALBAUD)", "no", "the S1K jumper quarters the baud rate"),
    Option("baud", "baud", _BAUD, "2400, 4800 or 9600", "9600", "rate of the line"),
)  # fmt: skip


def _genstepper(name: str, port: str) -> Model:
    return Model(
        name,
        f"Peter Norberg Consulting {name.upper()}, two motors, {port}, GenStepper 2.18",
        "docs/controllers/genstepper.md",
        genstepper_pins.PINS[name],
        genstepper_pins.DEFAULT_STRAPS[name],
        _GENSTEPPER_OPTIONS,
        lambda straps, **keywords: GenStepper(name, straps, **keywords),
        None,
        lambda: genstepper_commands.reference(name),
        lambda units: genstepper_pins.strap_line(name, units),
        limits=Limits(
            genstepper_supply.MOTOR_VOLTS,
            motor_supply=genstepper_supply.MOTOR_VOLTS,
            winding=lambda board: float(board.most_current),
        ),
        phrases=lambda straps: GenStepperPhrases(),
    )


def _axis_name(text: str) -> str:
    if len(text) != 1 or not dcb274_link.is_name(ord(text)):
        raise ValueError(text)
    return text


_DCB274_OPTIONS = (
    Option(
        "name", "name", _axis_name, "one character; not SPACE [ \\ ] ^ _ ` or @", "A",
        "name of the axis in a new NV memory",
    ),
    Option(
        "execution_times", "execution_times", _choice(on=True, off=False), "on or off", "on",
        "commands take the times of page 29, and each byte of NV memory 1 ms to fetch",
    ),
    Option(
        "overrun", "overrun", _choice(on=True, off=False), "on or off", "off",
        "a character is lost that comes, in bit time, before the last was read (page 25)",
    ),
    Option(
        "inputs", "encoder", _choice(step=False, encoder=True), "step or encoder", "step",
        "what STEP and DIR are: step and direction, or the phases of an encoder (DCB-274-E)",
    ),
    Option(
        "port4", "p4_input", _choice(output=False, input=True), "output or input", "output",
        "jumpers JP1 and JP2 of port 4",
    ),
)  # fmt: skip


MODELS: dict[str, Model] = {
    "gs-c200": _gsc200("gs-c200", (*_GSC200_OPTIONS, _GSC200_REVISION)),
    "gs-c200s": _gsc200("gs-c200s", _GSC200_OPTIONS),
    "supersigma": Model(
        "supersigma",
        "SUPERSIGMA microcomputer stepping motor drive (8748 and 8253)",
        "docs/controllers/supersigma.md",
        supersigma_pins.PINS,
        supersigma_pins.DEFAULT_STRAPS,
        _SUPERSIGMA_OPTIONS,
        Supersigma,
        None,
        supersigma_commands.reference,
        supersigma_pins.strap_line,
        line="microbus",
        told_apart_by="number",
        answered=supersigma_link.answered,
        phrases=lambda straps: SupersigmaPhrases(),
    ),
    "dcb-274": Model(
        "dcb-274",
        "Advanced Micro Systems DCB-274 stepper motor driver/controller with SMC-27X2",
        "docs/controllers/dcb274.md",
        dcb274_pins.PINS,
        dcb274_pins.DEFAULT_STRAPS,
        _DCB274_OPTIONS,
        Dcb274,
        dcb274_program.language,
        dcb274_commands.reference,
        dcb274_pins.strap_line,
        echoes=True,
        saves=dcb274_commands.Op.SAVE.value,
        phrases=lambda straps: Dcb274Phrases(),
    ),
    "bs0610": _genstepper("bs0610", "RS-232"),
    "bs0710": _genstepper("bs0710", "USB"),
}
