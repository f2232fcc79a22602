"""The serial commands of GenStepper 2.18: one ordered table, read by everything that needs them.

The firmware's dispatch, the help and the printed reference all read `TABLE`. A command is one character, upper
or lower case, with the VALUE typed before it; there is no terminator. `pages` are the manual's.
"""

from collections.abc import Sequence
from enum import Enum
from typing import Final, NamedTuple

from detent.controllers.device import CommandHelp


class Op(Enum):
    """What a command does; the value is its character."""

    AUTO = "A"
    BOTH = "B"
    DIRECT = "E"
    GO = "G"
    HALF = "H"
    IDLE = "I"
    KEEP = "K"
    LATCHES = "L"
    MARK = "M"
    MODE = "O"
    SLOPE = "P"
    RATE = "R"
    SLEW = "S"
    LIMITS = "T"
    VERBOSE = "V"
    WINDINGS = "W"
    X = "X"
    Y = "Y"
    STOP = "Z"
    RESET = "!"
    SET = "="
    REPORT = "?"


class Scope(Enum):
    """What a command is about."""

    BOARD = "board"  # whatever motors are selected
    MOTORS = "motors"  # that are selected
    CHOICE = "choice"  # of motors


class Row(NamedTuple):
    """One command. `value` says what VALUE means to it, "" if it uses none.

    `blinds` are the commands that make E mode miss the edges of up to 16 us (page 47).
    """

    op: Op
    value: str
    scope: Scope
    help: str
    pages: str
    blinds: bool = False

    @property
    def character(self) -> str:
        """What is typed."""
        return self.op.value


TABLE: Final[tuple[Row, ...]] = (
    Row(Op.LATCHES, "", Scope.BOARD, "Report and clear what was latched: 1 Y-, 2 Y+, 4 X-, 8 X+, 16 reset.", "29-30"),
    Row(Op.VERBOSE, "bits", Scope.BOARD, "1: CR LF before and behind the text of an answer; 2: later, slower.", "35"),
    Row(Op.RESET, "1/64 steps, 1-64", Scope.BOARD, "Reset, with a microstep of so many 1/64 steps (0: 1/16); it "
        "is deaf for 250 ms.", "37", blinds=True),
    Row(Op.REPORT, "report or memory", Scope.MOTORS, "Report: -1 to -12, 0 for -1 to -11, 1-255 memory.", "39-44"),
    Row(Op.AUTO, "microsteps/s", Scope.BOARD, "Full steps, full power while rate / 256 is above VALUE / 256.", "24"),
    Row(Op.DIRECT, "bits", Scope.BOARD, "Steps by pulses on the slew inputs: 1 a line each way, 2 step and direction, "
        "+4 currents by limit inputs, +16 Y- +32 Y+ +64 X- +128 X+ inverted; 0 ends it.", "25-26, 46-47"),
    Row(Op.HALF, "0 or 1", Scope.BOARD, "1: half power; 0: full power.", "28", blinds=True),
    Row(Op.MODE, "0-3", Scope.MOTORS, "Step mode: 0 one winding, 1 half step, 2 two windings, 3 microstep.", "30-31",
        blinds=True),
    Row(Op.LIMITS, "bits", Scope.BOARD, "Limits: 1 Y-, 2 Y+, 4 X-, 8 X+ blocked; times 16: active when high.", "34"),
    Row(Op.WINDINGS, "0-2", Scope.MOTORS, "Windings when idle: 0 off, 1 on, 2 half power.", "36", blinds=True),
    Row(Op.BOTH, "", Scope.CHOICE, "Both motors take the commands that follow.", "24"),
    Row(Op.X, "", Scope.CHOICE, "Motor X takes the commands that follow.", "36"),
    Row(Op.Y, "", Scope.CHOICE, "Motor Y takes the commands that follow.", "36"),
    Row(Op.KEEP, "microsteps/s", Scope.MOTORS, "Stop OK rate: motion starts and stops at it (0: 80).", "29"),
    Row(Op.SLOPE, "microsteps/s/s", Scope.MOTORS, "Slope of the ramps (0: 8000).", "31", blinds=True),
    Row(Op.RATE, "microsteps/s", Scope.MOTORS, "Run rate (0: 400).", "32", blinds=True),
    Row(Op.GO, "position", Scope.MOTORS, "Go to a position.", "27", blinds=True),
    Row(Op.IDLE, "", Scope.MOTORS, "Answer when the motors are idle.", "29", blinds=True),
    Row(Op.MARK, "0 or 1", Scope.MOTORS, "0: mark the position; 1: go to the marked one.", "30", blinds=True),
    Row(Op.SLEW, "sign, or microsteps", Scope.MOTORS, "With a sign alone slew, with a number go so far.", "33",
        blinds=True),
    Row(Op.STOP, "", Scope.MOTORS, "Stop through the ramp.", "36", blinds=True),
    Row(Op.SET, "position", Scope.MOTORS, "Call the present position VALUE, then stop.", "38", blinds=True),
)  # fmt: skip

_BY_CHARACTER: Final = {character: row for row in TABLE for character in (row.character, row.character.lower())}

LITTLE_SAID: Final = " \r\n,"  # not commands, but typed between them: nobody needs to be told


def row(character: str) -> Row | None:
    """The command of a character; None for one that is ignored and answered."""
    return _BY_CHARACTER.get(character)


def reference(model: str) -> Sequence[CommandHelp]:
    """The table as people read it: numbers first, as they make the VALUE of all commands."""
    numbers = (
        CommandHelp("0-9", "", 0, "number", "always", "Digits of VALUE, for all commands that follow.", "page 24"),
        CommandHelp("+ -", "", 0, "number", "always", "Sign of a new VALUE; alone before S: slew that way.", "page 24"),
    )
    rows = [
        CommandHelp(
            found.character, found.value, 0, found.scope.value,
            "always; blinds E" if found.blinds else "always",
            found.help, f"page{'s' if '-' in found.pages else ''} {found.pages}",
        )
        for found in TABLE
    ]  # fmt: skip
    return (*numbers, *rows)


class Report(NamedTuple):
    """A row of the reports of `?`."""

    number: int
    what: str


REPORTS: Final[tuple[Report, ...]] = (
    Report(-1, "current location"),
    Report(-2, "current speed"),
    Report(-3, "current slope"),
    Report(-4, "target position"),
    Report(-5, "target speed"),
    Report(-6, "windings: 0 off, 1 on"),
    Report(-7, "windings when stopped: 0 off, 1 on"),
    Report(-8, "step action"),
    Report(-9, "step mode, +4 with double current"),
    Report(-10, "run rate"),
    Report(-11, "stop OK rate"),
)
VERSION: Final = -12
STEP_ACTION: Final = -8  # tells one of `ACTIONS`

ACTIONS: Final = (
    "idle", "ramping up", "at speed", "slowing", "slewing", "quick stop", "reversing", "stopping for a new go",
    "single shot, or limit seen",
)  # fmt: skip

MEMORY: Final[tuple[tuple[int, str], ...]] = (
    (5, "limits: LY- 1, LY+ 2, LX- 4, LX+ 8, as they are at the pins"),
    (6, "TTL: Y- 1, Y+ 2, X- 4, X+ 8, NXT 16, RDY 32, SI 64, SO 128"),
    (7, "windings: X in the low four bits, Y in the high ones, WB2 WB1 WA2 WA1"),
    (61, "rotor of Y in 1/64 steps, modulo 256"),
    (125, "rotor of X in 1/64 steps, modulo 256"),
    (252, "auto full step rate / 256"),
    (253, "microstep in 1/64 steps"),
)
