"""The op-codes of the SUPERSIGMA drive: one ordered table, read by everything that needs them.

The link takes the length of a message from it, the firmware what a command does, `detent` the words in which people
write commands, the help and the printed reference all the rest.

The paper gives the place of each byte (its table 1): number of the microcomputer, op-code, steps with the more
significant byte first, speed. It lists the functions and leaves their codes open: the codes are ours.
"""

from enum import Enum
from typing import Final, NamedTuple

from detent.controllers.device import CommandHelp

BACKWARD: Final = 0x80  # bit 7 of an op-code that moves
LARGEST_STEPS: Final = 0xFFFF
SPEED_UNIT: Final = 100  # half steps/s
LARGEST_SPEED: Final = 0xFF


class Op(Enum):
    """What a command does; the value is bits 0 to 6 of the op-code."""

    MOVE = 0x01
    CONSTANT = 0x02
    LIMIT = 0x03
    ORIGINATE = 0x04
    STATUS = 0x05
    STOP = 0x06
    EMERGENCY = 0x07


class Row(NamedTuple):
    """One op-code. `steps` and `speed` say which bytes follow it; `moves` that it is refused while moving."""

    op: Op
    word: str
    steps: bool
    speed: bool
    moves: bool
    help: str
    section: str

    @property
    def length(self) -> int:
        """Bytes of the whole message."""
        return 2 + 2 * self.steps + self.speed

    @property
    def form(self) -> str:
        """How people write it, like "constant ±steps speed"."""
        return self.word + " ±steps" * self.steps + " speed" * self.speed

    @property
    def takes(self) -> str:
        """What follows the word, in words."""
        wanted = [f"steps with their sign, 1 to {LARGEST_STEPS}"] * self.steps
        wanted += [f"a speed in units of {SPEED_UNIT} half steps/s, 1 to {LARGEST_SPEED}"] * self.speed
        return " and ".join(wanted) or "nothing"


TABLE: Final[tuple[Row, ...]] = (
    Row(Op.MOVE, "move", True, False, True, "Move, with the ramps that the length allows.", "Long movements"),
    Row(Op.CONSTANT, "constant", True, True, True, "Move at constant speed, without ramps.", "Other features"),
    Row(
        Op.LIMIT, "limit", True, True, True,
        "Move with ramps, at no more than the speed; one below where ramps begin counts as that.", "Other features",
    ),
    Row(
        Op.ORIGINATE, "originate", False, False, True,
        "Go backward until the limit switch is active, then forward until it is released.", "Origination",
    ),
    Row(Op.STATUS, "status", False, False, False, "Ask for the steps done and the flags.", "Status"),
    Row(Op.STOP, "stop", False, False, False, "Run the ramp down and stop.", "Other features"),
    Row(Op.EMERGENCY, "emergency", False, False, False, "Stop by the steepest ramp.", "Emergency braking"),
)  # fmt: skip

_BY_CODE: Final = {row.op.value: row for row in TABLE}
_BY_WORD: Final = {row.word: row for row in TABLE}

SHORTEST: Final = 2  # bytes: an unknown op-code has no others
LONGEST: Final = max(row.length for row in TABLE)


class Command(NamedTuple):
    """A message to one drive. Direction is +1 (forward) or -1; steps and speed are 0 where there are none."""

    op: Op
    direction: int = 1
    steps: int = 0
    speed: int = 0


def row(code: int) -> Row | None:
    """The row of an op-code; None if it is unknown."""
    return _BY_CODE.get(code & ~BACKWARD)


def length(code: int) -> int:
    """Bytes of a message with this op-code, number and op-code included."""
    found = row(code)
    return SHORTEST if found is None else found.length


def parse(message: bytes) -> Command | None:
    """The command in a whole message; None for an unknown op-code."""
    found = row(message[1])
    if found is None:
        return None
    direction = -1 if found.steps and message[1] & BACKWARD else 1
    steps = int.from_bytes(message[2:4], "big") if found.steps else 0
    return Command(found.op, direction, steps, message[4] if found.speed else 0)


def message(number: int, command: Command) -> bytes:
    """The bytes of a command to the drive `number`."""
    found = _BY_CODE[command.op.value]
    code = command.op.value | (BACKWARD if command.direction < 0 else 0)
    steps = command.steps.to_bytes(2, "big") if found.steps else b""
    return bytes([number, code]) + steps + (bytes([command.speed]) if found.speed else b"")


def read(text: str) -> Command:
    """The command that people write like "move -400" or "constant +1000 6". ValueError with a remedy."""
    words = text.lower().split()
    found = _BY_WORD.get(words[0]) if words else None
    if found is None:
        raise ValueError(f"{text!r} is no command; write {', '.join(row.form for row in TABLE)}, or bytes in hex")
    try:
        numbers = [int(word) for word in words[1:]]
    except ValueError:
        numbers = []
    if len(numbers) != found.steps + found.speed or len(words) != len(numbers) + 1:
        raise ValueError(f"{found.word} takes {found.takes}, not {' '.join(words[1:]) or 'nothing'}")
    steps = numbers.pop(0) if found.steps else 0
    speed = numbers.pop() if found.speed else 0
    if abs(steps) > LARGEST_STEPS or not 0 <= speed <= LARGEST_SPEED:
        raise ValueError(f"{found.word} takes {found.takes}, not {' '.join(words[1:])}")
    return Command(found.op, -1 if steps < 0 else 1, abs(steps), speed)


def spell(command: Command) -> str:
    """The command as people write it."""
    found = _BY_CODE[command.op.value]
    steps = f" {command.direction * command.steps:+d}" if found.steps else ""
    return found.word + steps + (f" {command.speed}" if found.speed else "")


def reference() -> list[CommandHelp]:
    """The table as people read it."""
    return [
        CommandHelp(
            row.form,
            row.takes,
            0,
            f"op-code {row.op.value:02X}h" + (f", {row.op.value | BACKWARD:02X}h backward" if row.steps else "")
            + f", {row.length} bytes",
            "at rest" if row.moves else "always",
            row.help,
            row.section,
        )
        for row in TABLE
    ]  # fmt: skip
