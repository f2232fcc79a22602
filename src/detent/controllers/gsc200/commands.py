"""The commands of the GS-C200 and the GS-C200S: one ordered table, read by everything that needs them.

The parser, the firmware's check of what is allowed when, the assembler, the lister, the help and the
printed reference all read `TABLE`; nothing about a command is written anywhere else. A row is what the
datasheet's "S.I.M.P.L.E. Interpreter Command and Functions" table and the entry of the command say.
The order is the order of that table, and it is the order in which rows that share a letter are tried.

A command on the wire is its letters and, straight behind them, its argument; address digit, checksum
and carriage return are the link's matter. Error codes are those of the datasheet's error table: 4 for a
command that the model does not have, 2 for an argument that is missing, not wanted or out of limits.
"""

from collections.abc import Iterator
from enum import Enum
from functools import lru_cache
from typing import Final, NamedTuple

from detent.controllers.device import CommandHelp
from detent.controllers.gsc200.arguments import Address, Argument, Condition, Direction, Number, Signed

GS_C200: Final = "gs-c200"
GS_C200S: Final = "gs-c200s"
MODELS: Final = (GS_C200, GS_C200S)
LAST_ADDRESS: Final = 118  # of 119 memory locations; "Location (x) ranges between 0 and 118"


class Op(Enum):
    """What a command does, whatever a model calls it. The value is its letter, one of its own for each."""

    ACTIVATE = "A"
    CLEAR = "C"
    DELAY = "D"
    EXECUTE = "E"
    FEEDBACK = "F"
    FORCE = "f"
    GOTO = "G"
    VELOCITY = "g"
    HOME = "H"
    INITIALIZE = "I"
    JUMP = "j"
    JUMP_IF = "jc"
    KILL = "K"
    LOOP = "L"
    MEMORY = "M"
    PROGRAM = "P"
    EXIT = "Px"
    QUERY = "Q"
    RAMP = "R"
    START_STOP = "S"
    TOP = "T"
    UNTIL = "U"
    VERIFY = "V"
    EXCHANGE = "X"
    WAIT = "W"
    ZERO = "Z"
    MOVE = "+"


class Instruction(NamedTuple):
    """A command with its argument.

    `value` is the output, input, choice, tenths of a second, position, steps (signed), rate in tens of
    steps a second, ramp steps, repetitions (0 marks the loop's start) or address; for VELOCITY and HOME
    the direction, +1 or -1. `other` is the input (1-3, or 0 for none) of VELOCITY and the value of the
    three inputs (0-7) of JUMP_IF. Both are 0 where the command has no such argument.
    """

    op: Op
    value: int = 0
    other: int = 0


class Use(NamedTuple):
    """When a command is obeyed or stored, and how it is obeyed in command mode.

    `type` is the datasheet's word for it. `idle`, `programming` and `running` say in which modes it may
    come; outside them it is answered B while running and E4 otherwise. In command mode it acts at once if
    `at_once`, else it is executed as a one-instruction program. In programming mode a row with a byte
    length is stored, any other acts.
    """

    type: str
    idle: bool
    programming: bool
    running: bool
    at_once: bool


DELAYED: Final = Use("delayed", idle=True, programming=True, running=False, at_once=False)
IN_PROGRAMS: Final = Use("delayed", idle=False, programming=True, running=False, at_once=False)
EITHER: Final = Use("delayed/immediate", idle=True, programming=True, running=False, at_once=True)
WHEN_IDLE: Final = Use("immediate", idle=True, programming=False, running=False, at_once=True)
NOT_RUNNING: Final = Use("immediate", idle=True, programming=True, running=False, at_once=True)
WHEN_STORING: Final = Use("immediate", idle=False, programming=True, running=False, at_once=True)
STOPPING: Final = Use("immediate", idle=True, programming=False, running=True, at_once=True)
ALWAYS: Final = Use("immediate", idle=True, programming=True, running=True, at_once=True)


class Row(NamedTuple):
    """One command of one model or of both.

    `spellings` are the letters as on the wire, first the ones that Q lists; the signs that open a move
    belong to its argument as well. `length` is what the command takes in program memory, in bytes, 0 if
    these models do not store it. `heading` is the entry of the datasheet's command description.
    """

    op: Op
    spellings: tuple[str, ...]
    argument: Argument
    length: int
    use: Use
    help: str
    heading: str
    models: tuple[str, ...] = MODELS

    @property
    def stored(self) -> bool:
        """Whether programming mode stores it."""
        return self.length > 0

    def stores(self, model: str) -> bool:
        """Whether programming mode of `model` stores it."""
        return self.stored and model in self.models

    @property
    def idle(self) -> bool:
        """Whether it is obeyed in command mode."""
        return self.use.idle

    @property
    def programming(self) -> bool:
        """Whether it is stored or obeyed in programming mode."""
        return self.use.programming

    @property
    def running(self) -> bool:
        """Whether it is obeyed while a program, a move or homing is under way."""
        return self.use.running

    @property
    def at_once(self) -> bool:
        """Whether it acts at once in command mode, rather than as a one-instruction program."""
        return self.use.at_once

    @property
    def letters(self) -> str:
        """What Q prints before the argument."""
        return "" if self.op is Op.MOVE else self.spellings[0]

    @property
    def name(self) -> str:
        """What to call it in a sentence: its letters, ± for a move."""
        return self.letters or "±"

    @property
    def forms(self) -> tuple[str, ...]:
        """The ways to write it, like ("Gs", "Gsx"); the datasheet counts each as a command."""
        return tuple(self.letters + form for form in self.argument.forms)

    @property
    def section(self) -> str:
        """Where the datasheet describes it."""
        return f"command description, {self.heading}"

    def after(self, spelling: str, text: str) -> str:
        """The argument in a command `text` that begins with `spelling`."""
        return text if self.op is Op.MOVE else text[len(spelling) :]


_OUTPUT = Number(("x",), "an output", 1, 3)
_INPUT = Number(("x",), "an input", 1, 3)
_RATE = Number(("xxxx",), "a rate in tens of steps a second", 1, 1000)
_VELOCITY = Direction(("s", "sx"), "a direction, + or -, and if wanted an input, 1 to 3", inputs=3)
_RESET = Number(("x",), "1 (position), 2 (outputs) or 3 (both)", 1, 3)
_NOTHING = Argument()

TABLE: Final[tuple[Row, ...]] = (
    Row(Op.ACTIVATE, ("A",), _OUTPUT, 2, DELAYED, "Set a user output to one.", "Ax"),
    Row(Op.CLEAR, ("C",), _OUTPUT, 2, DELAYED, "Clear a user output to zero.", "Cx"),
    Row(
        Op.DELAY, ("D",), Number(("xxx",), "tenths of a second", 1, 255), 2, DELAYED,
        "Wait the given tenths of a second.", "Dvvv",
    ),
    Row(
        Op.EXECUTE, ("E",), _NOTHING, 0, NOT_RUNNING,
        "Start the program in memory; ends programming mode too.", "E",
    ),
    Row(Op.FEEDBACK, ("F",), _NOTHING, 0, ALWAYS, "Ask for the status: B busy, R ready.", "F"),
    Row(
        Op.FORCE, ("f",),
        Signed(("sxxxxxxx",), "a position with its sign", -(2**23), 2**23 - 1, sign_needed=True),
        4, EITHER, "Preset the position counter.", "fsxxxxxx", (GS_C200S,),
    ),
    Row(
        Op.GOTO, ("G",), Number(("xxxxxxx",), "a position", 0, 9_999_999), 4, DELAYED,
        "Go to a position.", "Gxxxxxxx", (GS_C200,),
    ),
    Row(
        Op.GOTO, ("G",), Signed(("sxxxxxxx",), "a position", -(2**23), 2**23 - 1), 4, DELAYED,
        "Go to a position.", "Gsxxxxxx", (GS_C200S,),
    ),
    Row(
        Op.VELOCITY, ("G",), _VELOCITY, 4, DELAYED,
        "Move on in a direction until Z or K, or until the named input is zero.", "Gs, Gsx", (GS_C200,),
    ),
    Row(
        Op.VELOCITY, ("g",), _VELOCITY, 4, DELAYED,
        "Move on in a direction until Z or K, or until the named input is zero.", "gs, gsx", (GS_C200S,),
    ),
    Row(
        Op.HOME, ("H",), Direction(("s",), "a direction, + (also if left out) or -", optional=True),
        0, WHEN_IDLE, "Find home: to the end of travel, then back until HOME is zero.", "Hs",
    ),
    Row(
        Op.INITIALIZE, ("I",), _RESET, 0, WHEN_IDLE,
        "Clear the position counter, the user outputs, or both.", "Ix", (GS_C200,),
    ),
    Row(
        Op.INITIALIZE, ("I",), _RESET, 2, EITHER,
        "Clear the position counter, the user outputs, or both.", "Ix", (GS_C200S,),
    ),
    Row(
        Op.JUMP, ("j", "J"), Address(("xxx",), "an address", 0, LAST_ADDRESS), 2, IN_PROGRAMS,
        "Jump to a memory location.", "ju", (GS_C200S,),
    ),
    Row(
        Op.JUMP_IF, ("jc", "Jc"), Condition(("y,xxx",), 7, LAST_ADDRESS), 2, IN_PROGRAMS,
        "Jump to a memory location if the inputs have the given value.", "jcv,y", (GS_C200S,),
    ),
    Row(Op.KILL, ("K",), _NOTHING, 0, STOPPING, "Stop at once and end the program.", "K"),
    Row(
        Op.LOOP, ("L",), Number(("0", "xxx"), "the repetitions, or 0 (mark)", 0, 255, "o"), 2, IN_PROGRAMS,
        "L0 marks the start of a loop; Ln runs it n times in all.", "Lo, Lxxx",
    ),
    Row(Op.MEMORY, ("M",), _NOTHING, 0, NOT_RUNNING, "Save the program to EEPROM.", "M"),
    Row(
        Op.PROGRAM, ("P",), _NOTHING, 0, WHEN_IDLE,
        "Clear the program and enter programming mode.", "P", (GS_C200,),
    ),
    Row(
        Op.PROGRAM, ("Po", "P0"), _NOTHING, 0, WHEN_IDLE,
        "Clear the program and enter programming mode.", "Po", (GS_C200S,),
    ),
    Row(Op.EXIT, ("Px",), _NOTHING, 0, WHEN_STORING, "Leave programming mode.", "Px", (GS_C200S,)),
    Row(Op.QUERY, ("Q",), _NOTHING, 0, NOT_RUNNING, "List the program; END closes the list.", "Q"),
    Row(
        Op.RAMP, ("R",), Number(("xxx",), "steps", 1, 999), 4, DELAYED,
        "Set the length of the ramps.", "Rvvv",
    ),
    Row(Op.START_STOP, ("S",), _RATE, 4, DELAYED, "Set the start-stop speed.", "Svvv"),
    Row(Op.TOP, ("T",), _RATE, 4, DELAYED, "Set the slew speed.", "Tvvv"),
    Row(
        Op.UNTIL, ("U",), _INPUT, 2, IN_PROGRAMS,
        "Start the program again while the input is one.", "Ux",
    ),
    Row(
        Op.VERIFY, ("V",), Number(("x",), "1 (position) or 2 (inputs and outputs)", 1, 2), 0, NOT_RUNNING,
        "Read back the position, or the user inputs and outputs.", "Vx",
    ),
    Row(Op.EXCHANGE, ("X",), _NOTHING, 0, WHEN_IDLE, "Fetch the program from EEPROM.", "X"),
    Row(Op.WAIT, ("W",), _INPUT, 2, DELAYED, "Wait until an input is one.", "Wx"),
    Row(Op.ZERO, ("Z",), _NOTHING, 0, STOPPING, "Ramp down and end the program.", "Z"),
    Row(
        Op.MOVE, ("+", "-"),
        Signed(("sxxxxxx",), "steps with their sign", -999_999, 999_999, True, zero_allowed=False),
        4, DELAYED, "Move by a number of steps.", "±xxxxxx",
    ),
)  # fmt: skip

_ROWS: Final = {model: tuple(row for row in TABLE if model in row.models) for model in MODELS}
_BY_OP: Final = {model: {row.op: row for row in _ROWS[model]} for model in MODELS}
_LENGTHS: Final = {op: max(row.length for row in TABLE if row.op is op) for op in Op}
_SPELLINGS: Final = sorted({spelling for row in TABLE for spelling in row.spellings}, key=len, reverse=True)


class CommandError(Exception):
    """A command that the module turns down: `code` as in E<code> (2 or 4), `reason` in words."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(f"E{code}: {reason}")
        self.code = code
        self.reason = reason


def rows(model: str) -> tuple[Row, ...]:
    """The commands of `model` in the order of the datasheet's table. ValueError for another model."""
    try:
        return _ROWS[model]
    except KeyError:
        raise ValueError(f"no model {model!r} speaks this language; choose {' or '.join(MODELS)}") from None


def reference(model: str) -> list[CommandHelp]:
    """The table as people read it."""
    return [
        CommandHelp(
            " ".join(row.forms),
            row.argument.words,
            row.length,
            row.use.type,
            ", ".join(mode for mode in ("idle", "programming", "running") if getattr(row, mode)),
            row.help,
            row.section,
        )
        for row in rows(model)
    ]


def row(model: str, op: Op) -> Row:
    """The row of `op` for `model`. ValueError if the model has no such command."""
    try:
        return _BY_OP[model][op]
    except KeyError:
        rows(model)
        raise ValueError(f"the {model.upper()} has no command {op.name}") from None


def length(instruction: Instruction) -> int:
    """Bytes that the instruction takes in program memory (function table, "Byte Length"); 0: never stored."""
    return _LENGTHS[instruction.op]


def spell(model: str, instruction: Instruction) -> str:
    """The instruction as Q lists it. ValueError if `model` has no such command."""
    found = row(model, instruction.op)
    return found.letters + found.argument.write(instruction.value, instruction.other)


def letters(text: str) -> str:
    """The longest letters of any model's command with which `text` begins; empty if it begins with none."""
    return next((spelling for spelling in _SPELLINGS if text.startswith(spelling)), "")


def spelled(model: str, spelling: str) -> tuple[Row, ...]:
    """The rows of `model` with these letters, in the order in which they are tried."""
    return tuple(row for row in rows(model) if spelling in row.spellings)


def takes(model: str, spelling: str) -> str:
    """What the command with these letters takes, in words: "A takes an output, 1 to 3"."""
    return f"{spelling} takes " + "; or ".join(row.argument.words for row in spelled(model, spelling))


@lru_cache(maxsize=1024)  # hosts say the same few things again and again
def parse(model: str, text: str) -> Instruction:
    """The instruction in a command as it comes on the wire, without address, checksum and CR.

    Raises CommandError, and nothing else, whatever `text` is: code 4 if `model` has no such command, code
    2 if its argument is missing, not wanted, not a number or out of range.
    """
    found = _read(model, text)
    if found is not None:
        return found
    spelling = letters(text)
    meant = next(_corrections(model, text), None)
    hint = f"; did you mean {meant}?" if meant else ""
    candidates = spelled(model, spelling)
    if candidates:
        argument = candidates[0].after(spelling, text)
        problem = f", not {_quoted(argument)}" if argument else ", and there is none"
        raise CommandError(2, takes(model, spelling) + problem + hint)
    if not text:
        raise CommandError(4, "there is no command in the frame")
    if not spelling:
        raise CommandError(4, f"{_quoted(text)} is no command of the {model.upper()}{hint}")
    owner = " or ".join(other.upper() for other in MODELS if spelled(other, spelling))
    raise CommandError(4, f"{spelling} is a command of the {owner}, not of the {model.upper()}{hint}")


def _read(model: str, text: str) -> Instruction | None:
    """The instruction, or None for anything that is none."""
    spelling = letters(text)
    for candidate in spelled(model, spelling):
        numbers = candidate.argument.read(candidate.after(spelling, text))
        if numbers is not None:
            return Instruction(candidate.op, *numbers)
    return None


def _corrections(model: str, text: str) -> Iterator[str]:
    """Commands of `model` that `text` may stand for: in other case, other model's letters, no sign."""
    text = text.strip()[:20]
    variants = (text, text[:1].swapcase() + text[1:], text.lower(), text.replace(" ", ""), "+" + text)
    for variant in variants:
        for language in (model, *MODELS):
            found = _read(language, variant)
            if found is None or found.op not in _BY_OP[model]:
                continue
            if _BY_OP[model][found.op].argument.admits(found.value, found.other):
                yield spell(model, found)


def _quoted(text: str) -> str:
    """`text` in quotes with control characters made visible, cut to what fits a message."""
    return repr(text if len(text) <= 20 else text[:20] + "...")
