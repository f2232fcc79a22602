"""Messages on the MICROBUS (the paper's table 1): number of the drive, op-code, and what the op-code wants.

Every drive sees every byte, so each must know how long the messages to the others are. There are no marks between
messages: one byte too many, or a message that is never finished, would shift all that follow, and a question for status
would become a move. So what has come of a message is dropped when no byte has come for `SILENCE`, or when the CCU lets
go of the bus (our assumption; the paper's protocol "is given [1,3]").
"""

from typing import NamedTuple

from detent.controllers.supersigma import commands
from detent.ticks import MS, NEVER, Ns, instants
from detent.uart import Char

ANSWER_LENGTH = 3
SILENCE: Ns = 100 * MS
"""Longer than any pause that adapters and networks make within a message: 16 ms of a USB adapter, 40 ms of TCP."""


class Flag(NamedTuple):
    """A bit of the third byte of an answer."""

    bit: int
    word: str
    help: str


MOVING = Flag(0x01, "moving", "the motor moves")
END_OF_RAIL = Flag(0x02, "end of rail", "the end of the rail was met")
EXCESSIVE_FORCE = Flag(0x04, "excessive force", "there was excessive force")
ORIGINATED = Flag(0x08, "originated", "the origin has been found")
REFUSED = Flag(0x10, "refused", "a command was refused")
FLAGS: tuple[Flag, ...] = (MOVING, END_OF_RAIL, EXCESSIVE_FORCE, ORIGINATED, REFUSED)
ATTENTION = END_OF_RAIL.bit | EXCESSIVE_FORCE.bit | REFUSED.bit


class Link:
    """Collects bytes into the messages for one drive, and makes its answers. `deadline`: when to call `drop`."""

    __slots__ = ("_bytes", "deadline", "number")
    INSTANTS = instants(deadline=0)

    def __init__(self, number: int) -> None:
        self.number = number
        self._bytes = bytearray()
        self.deadline: Ns = NEVER

    def feed(self, char: Char, now: Ns) -> bytes | None:
        """Take one byte of the CCU; return the message it completes, if that is for this drive."""
        collected = self._bytes
        collected.append(char.value & 0xFF)
        if len(collected) < commands.SHORTEST or len(collected) < commands.length(collected[1]):
            self.deadline = now + SILENCE
            return None
        message = self._take()
        return message if message[0] == self.number else None

    def drop(self) -> bytes:
        """Forget what has come of a message; return that, if it is for this drive."""
        message = self._take()
        return message if message[:1] == bytes([self.number]) else b""

    def _take(self) -> bytes:
        message = bytes(self._bytes)
        self._bytes.clear()
        self.deadline = NEVER
        return message

    def frame(self, text: str) -> bytes:
        """The message to this drive that `text` says: a command in words, or its bytes in hex. ValueError."""
        try:
            raw = bytes.fromhex(text)
        except ValueError:
            raw = b""
        return bytes([self.number]) + raw if raw else commands.message(self.number, commands.read(text))


def answer(steps: int, flags: int) -> bytes:
    """The answer to status: the steps done, modulo 65 536, and the flags."""
    return (steps & 0xFFFF).to_bytes(2, "big") + bytes([flags])


def answers(data: bytes) -> list[str]:
    """The answers in what a drive sent, in words: "1200 steps, moving". Bytes of no whole answer stay bytes."""
    whole = len(data) - len(data) % ANSWER_LENGTH
    found = []
    for at in range(0, whole, ANSWER_LENGTH):
        flags = [flag.word for flag in FLAGS if data[at + 2] & flag.bit]
        found.append(", ".join([f"{int.from_bytes(data[at : at + 2], 'big')} steps", *flags]))
    if data[whole:]:
        found.append(data[whole:].hex(" "))
    return found


def answered(text: str) -> bool:
    """Whether a drive answers the command that `text` says (see `Link.frame`)."""
    try:
        command = commands.parse(Link(0).frame(text).ljust(commands.LONGEST, b"\0"))  # hex may be too short
    except ValueError:
        return False
    return command is not None and command.op is commands.Op.STATUS
