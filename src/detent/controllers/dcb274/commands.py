"""The commands of the SMC-27X2: one ordered table, read by everything that needs them.

The parser, the interpreter, the assembler, the lister, the help and the printed reference all read `TABLE`. A row
is what the manual's command reference says of a command (pages 33 to 58), settled where its parts contradict each
other (docs/controllers/dcb274.md). The order is the order of the reference.

A command is one letter, upper and lower case apart, and its numbers. A refused command is answered ``#``.
"""

from enum import Enum
from typing import Final, NamedTuple

from detent.controllers.dcb274 import arguments
from detent.controllers.dcb274.arguments import LEAST, MOST, Address, Name, Number, Rate
from detent.controllers.dcb274.link import NO_NAME, is_name
from detent.controllers.device import CommandHelp
from detent.ticks import MS, US, Ns

MODEL: Final = "dcb-274"
BRANCH: Final = 2048  # G: branch on the ports; L: wait in a tight loop


class Op(Enum):
    """A command. The value is its letter."""

    SOFT_STOP = "@"
    PORT = "A"
    JOG_SPEEDS = "B"
    DECAY = "b"
    CLEAR = "C"
    DIVIDE = "D"
    RETIRED = "E"
    FIND_HOME = "F"
    GO = "G"
    RESOLUTION = "H"
    INITIAL = "I"
    RESTART_TRIP = "i"
    JUMP = "J"
    RAMP = "K"
    NEXT_TRIP = "k"
    LOOP_ON_PORT = "L"
    OPTIONS = "l"
    VELOCITY = "M"
    ORIGIN = "O"
    PROGRAM = "P"
    QUERY = "Q"
    INDEX_TO = "R"
    SAVE = "S"
    TRIP = "T"
    SLEW = "V"
    WAIT = "W"
    PRE_ENERGIZE = "w"
    EXAMINE = "X"
    CURRENT = "Y"
    POSITION = "Z"
    READ_MEMORY = "["
    READ_INPUTS = "]"
    PLUS = "+"
    MINUS = "-"
    MOVING = "^"
    WRITE_MEMORY = "\\"
    TERMINATE = "|"


class Instruction(NamedTuple):
    """A command with the values of its arguments, as they are stored: speeds as timer counts."""

    op: Op
    values: tuple[int, ...] = ()


COMMON: Final[Ns] = 500 * US  # "most commands execute in less than one millisecond" (page 29), the middle
_INDEX: Final[Ns] = 7_500 * US
_SPEED: Final[Ns] = 3_500 * US
_MEMORY: Final[Ns] = 1_100 * US
_BLOCK: Final[Ns] = 60 * MS
CLEARING: Final[Ns] = 1_500 * MS  # C with 1 to 8
PORT_TEST: Final[Ns] = 2_500 * US  # L "tests the condition every 2-3ms" (page 44)


class Row(NamedTuple):
    """One command.

    `length` is what it takes in program memory, 0: it is not stored. `typed` says whether it may be typed as a
    command. An `action` waits for the completion of the one before (page 27). `time` is how long it executes.
    `needs` numbers at least must be given. `page` is the manual's.
    """

    op: Op
    arguments: tuple[Number, ...]
    length: int
    help: str
    page: int
    result: str = ""
    typed: bool = True
    action: bool = False
    time: Ns = COMMON
    needs: int = 0

    @property
    def letter(self) -> str:
        """As it is typed."""
        return self.op.value

    @property
    def stored(self) -> bool:
        """Whether program mode stores it."""
        return self.length > 0

    @property
    def words(self) -> str:
        """What its arguments are."""
        return "; ".join(argument.words for argument in self.arguments) or "none"

    @property
    def type(self) -> str:
        """The manual's words for when it may be given."""
        where = ("immediate",) * self.typed + ("program",) * self.stored
        return ", ".join(where) + (", action" if self.action else "")

    def typed_as(self) -> str:
        """Like ``J a,n``."""
        return " ".join((self.letter, ",".join("anmk"[i] for i in range(len(self.arguments))))).strip()


def _byte(what: str, high: int = 255, low: int = 0) -> Number:
    return Number(what, low, high)


_POSITION = Number("a position", LEAST, MOST, 3)
_STEPS = Number("steps", 0, 16_777_215, 3)
_SPEED_OF = Rate("steps/s", 0, 36_000, 2)
_SIGNED_SPEED = Rate("steps/s with their sign (0 stops)", -36_000, 36_000, 2)
_CELL = Number("an address", 0, 2047, 2)
_PROGRAM_BYTE = Address("an address", 0, 2047, 2)
_OUTPUTS = _byte("output flags", 63)

TABLE: Final[tuple[Row, ...]] = (
    Row(Op.SOFT_STOP, (), 1, "Soft stop: decelerate and stop.", 33),
    Row(Op.PORT, (_byte("output flags 8 and 16, or 129 to read", 129),), 2, "Set the outputs, or read the ports.", 34,
        result="with 129: the ports"),
    Row(Op.JOG_SPEEDS, (_byte("slow, times 30 full steps/s"), _byte("fast, times 30 full steps/s")), 3,
        "Set the jog speeds; 0 disables.", 36),
    Row(Op.DECAY, (_byte("a threshold"),), 2, "Set the speed at which slow decay becomes fast.", 36),
    Row(Op.CLEAR, (_byte("0 (reload), 1 (factory values) or 2 to 8 (a page)", 8),), 0,
        "Reload the parameters, write factory values, or clear a page of NV memory.", 37, result="the version",
        time=_BLOCK),
    Row(Op.DIVIDE, (_byte("a divisor", low=1),), 2, "Divide all speeds.", 37),
    Row(Op.RETIRED, (_byte("anything"),), 2, "Nothing: retired, see Y.", 37),
    Row(Op.FIND_HOME, (_SPEED_OF, _byte("0 (minus) or 1 (plus)", 1)), 3, "Find the home switch.", 38, action=True),
    Row(Op.GO, (Address("an address (2048 branches on the ports)", 0, BRANCH, 2), _byte("trace", 1)), 3,
        "Execute the program from an address.", 38, action=True),
    Row(Op.RESOLUTION, (_byte("a table", 5),), 2, "Set the step resolution.", 40, action=True),
    Row(Op.INITIAL, (_SPEED_OF,), 3, "Set the initial velocity.", 40, time=_SPEED),
    Row(Op.RESTART_TRIP, (_POSITION, _OUTPUTS), 5,
        "As k, and set the position to 0 and the special trip counter to 128.", 41, typed=False),
    Row(Op.JUMP, (_PROGRAM_BYTE, _byte("times")), 4, "Jump to an address so many times; then go on.", 41,
        typed=False),
    Row(Op.RAMP, (_byte("steps at each speed up"), _byte("steps at each speed down")), 3, "Set the ramp slopes.", 41,
        needs=2),
    Row(Op.NEXT_TRIP, (_POSITION, _OUTPUTS), 5, "Set the outputs now, and the position of the next special trip.", 42,
        typed=False),
    Row(Op.LOOP_ON_PORT, (Address("an address (2048 waits here)", 0, BRANCH, 2),
                          _byte("twice (port - 1), 1 more for high", 9)), 4,
        "Jump to an address unless a port is low or high.", 44, typed=False, time=PORT_TEST),
    Row(Op.OPTIONS, (_byte("option flags, 128 reads them"),), 2, "Set the hardware options.", 44,
        result="with 128: the flags"),
    Row(Op.VELOCITY, (_SIGNED_SPEED,), 3, "Move at a constant velocity.", 46, action=True),
    Row(Op.ORIGIN, (_POSITION,), 4, "Set the position counter.", 47),
    Row(Op.PROGRAM, (_PROGRAM_BYTE,), 0, "Begin program mode at an address, or end it.", 47),
    Row(Op.QUERY, (_CELL,), 0, "List the program from an address (single mode).", 48, result="the program"),
    Row(Op.INDEX_TO, (_POSITION,), 4, "Move to a position.", 48, action=True, time=_INDEX),
    Row(Op.SAVE, (), 0, "Save the parameters and the program at 128-191 to NV memory.", 49, time=_BLOCK),
    Row(Op.TRIP, (_POSITION, Address("an address (0 turns it off)", 0, 255)), 5,
        "Call a routine of the running program at a position.", 49),
    Row(Op.SLEW, (_SPEED_OF,), 3, "Set the slew velocity.", 50, time=_SPEED),
    Row(Op.WAIT, (Number("units of 10 ms", 0, 65_535, 2),), 3,
        "Wait until an index or homing is complete, then so long.", 51),
    Row(Op.PRE_ENERGIZE, (_byte("units of 10 ms"),), 2, "Set the time from run current to the first step.", 51),
    Row(Op.EXAMINE, (), 0, "Print the settings; 26, the model, in party line.", 52, result="the settings"),
    Row(Op.CURRENT, (_byte("hold, percent of 4 A", 100), _byte("run, percent of 4 A", 100)), 3,
        "Set the hold and run currents.", 52),
    Row(Op.POSITION, (_byte("readout at every change, single mode", 1),), 2, "Print the position.", 53,
        result="the position"),
    Row(Op.READ_MEMORY, (_CELL, _byte("bytes")), 0, "Read NV memory.", 54, result="the bytes", time=_MEMORY),
    Row(Op.READ_INPUTS, (_byte("0 or 1", 1),), 2, "Read limits, home and ports, or the jog inputs.", 54,
        result="the inputs", time=_MEMORY),
    Row(Op.PLUS, (_STEPS,), 4, "Move in plus direction.", 55, action=True, time=_INDEX),
    Row(Op.MINUS, (_STEPS,), 4, "Move in minus direction.", 55, action=True, time=_INDEX),
    Row(Op.MOVING, (), 1, "Print the moving status: 0 at rest, 1 indexing or homing, 3 constant speed.", 56,
        result="the status"),
    Row(Op.WRITE_MEMORY, (_CELL, _byte("a byte")), 0, "Write a byte of NV memory.", 56, time=_MEMORY),
    Row(Op.TERMINATE, (Name("the name of an axis", 0x21, 0x7E),), 2, "Terminate the program of one axis.", 57),
)  # fmt: skip

ROWS: Final = {row.op: row for row in TABLE}
LETTERS: Final = {row.letter: row for row in TABLE}

INTERRUPTS: Final = (
    CommandHelp("ESC", "none", 0, "single character", "always", "Abort everything, without deceleration.", "page 33"),
    CommandHelp("@", "none", 0, "single character", "running, pending", "Soft stop; ends the program.", "page 33"),
    CommandHelp("^C", "none", 0, "single character", "always", "Reset.", "page 34"),
    CommandHelp("^N", "the name", 0, "single character", "idle", "Name the axis, at once and for good.", "page 57"),
    CommandHelp("^P", "none", 0, "single character", "always", "Reset, then party line mode.", "page 58"),
)


class Refusal(Exception):
    """A command line that is answered ``#``; the text says why."""


def reference() -> list[CommandHelp]:
    """The table as people read it, with the single-character commands behind it."""
    rows = [
        CommandHelp(
            row.typed_as(), row.words, row.length, row.type,
            ", ".join(("idle",) * row.typed + ("program",) * row.stored), row.help, f"page {row.page}",
        )
        for row in TABLE
    ]  # fmt: skip
    return [*rows, *INTERRUPTS]


def parse(text: str) -> Instruction:
    """The command in a line, without its terminator. Raises Refusal, and nothing else, whatever `text` is."""
    text = text.strip(" ")
    if not text:
        raise Refusal("there is no command")
    row = LETTERS.get(text[0])
    if row is None:
        raise Refusal(f"{text[0]!r} is no command")
    if row.op is Op.TERMINATE:
        return Instruction(row.op, _name(text[1:]))
    numbers = arguments.split(text[1:])
    if numbers is None:
        raise Refusal(f"{row.letter} takes numbers, not {text[1:20]!r}")
    if len(numbers) < row.needs:
        raise Refusal(f"{row.letter} needs {row.needs} numbers")
    if row.op is Op.RETIRED:
        numbers = [min(max(number, 0), 255) for number in numbers]
    values = arguments.read(row.arguments, numbers)
    if values is None:
        raise Refusal(f"{row.letter} takes {row.words}, not {text[1:20].strip()!r}")
    return Instruction(row.op, values)


def _name(text: str) -> tuple[int, ...]:
    """The name behind `|`; none: the axis itself."""
    text = text.strip(" ").removesuffix(";")
    if len(text) > 1 or (text and not is_name(ord(text))):
        raise Refusal(f"| takes the name of an axis, not {text[:20]!r}")
    return (ord(text),) if text else (NO_NAME,)


def spell(instruction: Instruction) -> str:
    """The instruction as Q lists it: letter and values, blanks between."""
    row = ROWS[instruction.op]
    values = [argument.write(value) for argument, value in zip(row.arguments, instruction.values, strict=True)]
    return " ".join((row.letter, *values)).rstrip(" ")
