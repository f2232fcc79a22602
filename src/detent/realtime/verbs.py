"""The verbs by which a cell that is served is looked at and meddled with: one table, and how arguments are read.

`realtime.control` does what the verbs say. The HTTP interface, the command line, the workbench and the reference page
read this table. Arguments are given by name, as JSON has them or as they are typed: ``0.02``, ``"20 ms"``.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple, TypeAlias

from detent.nearest import did_you_mean
from detent.one_line import one_line
from detent.ticks import SECOND, parse_duration

SHORT_WAIT: Final = 60.0  # seconds of the wall clock that what waits waits, unless it is said otherwise
GRACE: Final = 10.0  # seconds in which the loop begins what it is asked
LONGEST_WAIT: Final = 24 * 3600 * SECOND  # clocks of operating systems do not count as far as ours

Json: TypeAlias = "str | int | float | bool | Sequence[Json] | Mapping[str, Json] | None"
Answer: TypeAlias = dict[str, Json]


class AskedWrongly(ValueError):
    """A request that makes no sense: what is wrong and, in `remedy`, what to do."""

    def __init__(self, what: str, remedy: str = "") -> None:
        self.what, self.remedy = one_line(what), one_line(remedy)
        super().__init__(f"{self.what}; {self.remedy}" if remedy else self.what)

    @classmethod
    def of(cls, error: Exception) -> "AskedWrongly":
        """The same of an error whose text is ``what; remedy`` or ``what: remedy``."""
        text = str(error.args[0]) if error.args else str(error)
        for separator in ("; ", ": "):
            what, found, remedy = text.partition(separator)
            if found:
                return cls(what, remedy)
        return cls(text)


def unknown(kind: str, name: str, known: Sequence[str]) -> AskedWrongly:
    """The error for a name that is not among the known ones."""
    return AskedWrongly(f"no {kind} {name!r}", f"{did_you_mean(name, known)}there are: {', '.join(known) or 'none'}")


class Kind(NamedTuple):
    """A kind of argument: what it takes, in words; its reader, which raises ValueError or TypeError; a JSON schema."""

    takes: str
    read: Callable[[object], object]
    schema: Mapping[str, Json]


def _text(value: object) -> str:
    if not isinstance(value, (str, int)) or isinstance(value, bool):
        raise ValueError(value)
    return str(value)


def _count(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, (str, int)):
        raise ValueError(value)
    return int(value)


def _natural(value: object) -> int:
    if (count := _count(value)) < 0:
        raise ValueError(value)
    return count


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise ValueError(value)
    return float(value)


def _level(value: object) -> int:
    levels: dict[str, int] = {"0": 0, "low": 0, "1": 1, "high": 1}
    if isinstance(value, bool):
        raise ValueError(value)
    return levels[str(value).strip().lower()]


def _flag(value: object) -> bool:
    flags = {"true": True, "on": True, "yes": True, "1": True, "false": False, "off": False, "no": False, "0": False}
    return flags[str(value).strip().lower()]


def _time(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise ValueError(value)
    return parse_duration(value)


def _patience(value: object) -> int:
    if (patience := _time(value)) > LONGEST_WAIT:
        raise ValueError(value)
    return patience


def _pace(value: object) -> float | None:
    return None if value is None or str(value).strip().lower() in ("free", "null", "none") else _number(value)


_NUMBER_OR_TEXT: Final[Mapping[str, Json]] = {"oneOf": [{"type": "number"}, {"type": "string"}]}

TEXT: Final = Kind("text", _text, {"type": "string"})
COUNT: Final = Kind("a whole number", _count, {"type": "integer"})
NATURAL: Final = Kind("a whole number from 0 on", _natural, {"type": "integer", "minimum": 0})
NUMBER: Final = Kind("a number", _number, {"type": "number"})
LEVEL: Final = Kind("0, 1, low or high", _level, {"enum": [0, 1, "low", "high"]})
FLAG: Final = Kind("true or false", _flag, {"type": "boolean"})
TIME: Final = Kind('seconds, or a time like "20 ms"', _time, _NUMBER_OR_TEXT)
PATIENCE: Final = Kind('seconds, at most a day of them, or a time like "20 ms"', _patience, _NUMBER_OR_TEXT)
PACE: Final = Kind('a number above 0, or "free"', _pace, {"oneOf": [{"type": "number"}, {"const": "free"}]})


class Parameter(NamedTuple):
    """An argument of a verb. `rest`: it takes what is left, as one text with blanks between."""

    name: str
    kind: Kind
    help: str
    required: bool = False
    rest: bool = False


class Verb(NamedTuple):
    """A verb. One that `changes` nothing may be asked with GET; the first `placed` arguments go without their names."""

    name: str
    help: str
    parameters: tuple[Parameter, ...] = ()
    changes: bool = True
    placed: int = 99

    @property
    def waits(self) -> bool:
        """Whether its answer may be long in coming."""
        return TIMEOUT in self.parameters

    def patience(self, given: Mapping[str, object]) -> float:
        """How many seconds of the wall clock an answer to these arguments may take. Raises AskedWrongly."""
        if not self.waits:
            return GRACE
        timeout = self.read(given).get("timeout")
        return timeout / SECOND if isinstance(timeout, int) else SHORT_WAIT

    def read(self, given: Mapping[str, object]) -> dict[str, object]:
        """The arguments by name; those not given are left out. Raises AskedWrongly."""
        by_name = {parameter.name: parameter for parameter in self.parameters}
        found: dict[str, object] = {}
        for name, value in given.items():
            if name not in by_name:
                if not by_name:
                    raise AskedWrongly(f"{self.name} takes no arguments", f"leave out {name}")
                raise unknown(f"argument of {self.name}", name, tuple(by_name))
            kind = by_name[name].kind
            try:
                found[name] = kind.read(value)
            except (ValueError, TypeError, KeyError, OverflowError):
                raise AskedWrongly(f"{self.name}: {name} cannot be {value!r}", f"it takes {kind.takes}") from None
        for parameter in self.parameters:
            if parameter.required and parameter.name not in found:
                raise AskedWrongly(
                    f"{self.name}: {parameter.name} is missing", f"it takes {parameter.kind.takes}: {parameter.help}"
                )
        return found


UNIT: Final = Parameter("unit", TEXT, "a unit; may be left out where there is only one")
PIN: Final = Parameter("pin", TEXT, "UNIT.PIN, or PIN where there is only one unit", True)
TIMEOUT: Final = Parameter("timeout", PATIENCE, "of the wall clock; 60 s unless it is said otherwise")
SEED: Final = Parameter("seed", COUNT, "another seed strikes other characters; 0 unless it is said otherwise")

VERBS: Final[Mapping[str, Verb]] = {
    verb.name: verb
    for verb in (
        Verb("state", "Everything: time, units, lines, switches, motors, faults, recent events.", changes=False),
        Verb("pins", "The pins of a unit, or of all, with their levels.", (UNIT,), changes=False),
        Verb("set", "Give an input a level, by hand. It stays until its own wire changes, or release.",
             (PIN, Parameter("level", LEVEL, "the level", True))),
        Verb("release", "Leave an input that was set to its wire again.", (PIN,)),
        Verb("switch", "Put a switch of the cell to a level.",
             (Parameter("switch", TEXT, "a switch", True), Parameter("level", LEVEL, "the level", True))),
        Verb("power", "Switch the supply of a unit.", (Parameter("on", FLAG, "on or off", True), UNIT)),
        Verb("pause", "Let the cell time stand. What clients send waits."),
        Verb("resume", "Let the cell time go on."),
        Verb("present", "Of a workbench that looks into the past: the cell stands at its present again."),
        Verb("step", "While it stands: everything of the next eventful instant, or of a time; it stands again behind.",
             (Parameter("time", TIME, "how long the cell goes on, as fast as it can; one event without it"), TIMEOUT)),
        Verb("run-for", "Let the cell go on for a time, at its pace; then it stands. Answers when it does.",
             (Parameter("time", TIME, "of the cell", True), TIMEOUT)),
        Verb("pace", "How many times as fast as real time the cell goes; free: as fast as it can.",
             (Parameter("pace", PACE, "a factor, or free", True),)),
        Verb("type", "The host of a unit sends it a command line; address, checksum and end are added.",
             (Parameter("text", TEXT, "the command line", True, rest=True), UNIT), placed=1),
        Verb("send", "The host of a line sends characters as they are.",
             (Parameter("data", TEXT, "characters; \\r, \\n and \\x1b are written so", True, rest=True),
              Parameter("line", TEXT, "a line; may be left out where there is only one")), placed=1),
        Verb("clear", "What waits to be sent on a line is dropped. A character that has begun ends.",
             (Parameter("line", TEXT, "a line; may be left out where there is only one"),)),
        Verb("wait", "Answer when everything that is named is so at once: a state, a position, a level, a time.",
             (UNIT,
              Parameter("state", TEXT, "what the unit does: a word, or several with commas"),
              Parameter("position", COUNT, "where its axis is; a pulse that passes there is enough"),
              Parameter("axis", TEXT, "the axis that is meant; the first without it"),
              Parameter("pin", TEXT, "UNIT.PIN, or PIN of the unit"),
              Parameter("level", LEVEL, "what the pin is at; low without it"),
              Parameter("time", TIME, "of the cell, from its start"),
              Parameter("resume", FLAG, "if the cell time stands, let it go on for this"),
              Parameter("pause", FLAG, "let the cell time stand at that very instant"),
              TIMEOUT), placed=0),
        Verb("journal", "What was done to the cell from outside, with the times: the newest.",
             (Parameter("last", NATURAL, "how many; 100 unless it is said otherwise"),), changes=False),
        Verb("faults", "The faults that there are, and what they have done so far.", changes=False),
        Verb("fault", "Something breaks, for a time or until mend.",
             (Parameter("where", TEXT, "a line, a unit (also for its line), a switch, or UNIT.PIN", True),
              Parameter("kind", TEXT, "what breaks", True),
              Parameter("for", TIME, "how long; until mend without it"),
              Parameter("towards", TEXT, "units, host or both: the characters that a fault of a line meets"),
              Parameter("rate", NUMBER, "the share of the characters that is struck, 0 to 1"),
              Parameter("nth", NATURAL, "the one character that is struck, counted from 1 from now on, each way"),
              Parameter("bit", TEXT, "the bit that is wrong: 0 to 7, parity or framing; drawn each time without it"),
              Parameter("by", TIME, "how much later characters come"),
              Parameter("level", LEVEL, "where a switch or an input is stuck"),
              Parameter("times", NATURAL, "how many writes fail; all without it"),
              SEED), placed=2),
        Verb("mend", "A fault is mended, if it is not over already; all of them without a number.",
             (Parameter("fault", NATURAL, "its number"),)),
        Verb("stop", "Emergency stop of real pins: every board stops at once, and no axis moves until recover."),
        Verb("recover", "Real pins that stand go on from where the boards have counted their motors."),
        Verb("board", "How real pins stand: axes, counts, slips, lead and lag, what would stop them; their boards.",
             changes=False),
    )
}  # fmt: skip
"""Every verb by name, in the order in which they are shown."""


class FaultKind(NamedTuple):
    """A kind of fault: where it can be, the arguments that it takes beside where, kind and for, and what it is."""

    name: str
    where: str
    takes: tuple[str, ...]
    help: str


FAULTS: Final[Mapping[str, FaultKind]] = {
    kind.name: kind
    for kind in (
        FaultKind("bit-errors", "line", ("rate", "nth", "towards", "bit", "seed"), "one bit of a character is wrong"),
        FaultKind("lost", "line", ("rate", "nth", "towards", "seed"), "a character does not arrive"),
        FaultKind("delay", "line", ("by", "towards"), "characters come later; those to the host, unless it is said"),
        FaultKind("cable-out", "line", ("towards",), "nothing arrives"),
        FaultKind("stuck", "switch or UNIT.PIN", ("level",), "a contact or an input stays at a level"),
        FaultKind("eeprom", "unit", ("times",), "writing the non-volatile memory fails"),
        FaultKind("dip", "unit", (), "the supply is gone for a time"),
    )
}
"""Every kind of fault by name."""


def verb(name: str) -> Verb:
    """The verb of that name. Raises AskedWrongly."""
    if name not in VERBS:
        raise unknown("verb", name, tuple(VERBS))
    return VERBS[name]
