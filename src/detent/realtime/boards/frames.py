"""Blocks on the wire: length, sequence, payload, checksum, and an end mark; integers of variable length.

A block is `length (5..64), 0x10 | sequence (0..15), payload, checksum high, checksum low, 0x7e`; the length counts all
of it. The checksum is CRC-16/MCRF4XX (of "123456789": 6F91h) of length, sequence and payload. A board answers with
blocks of the same form; one without payload is an acknowledgement of everything before its sequence number.
"""

from typing import NamedTuple

SMALLEST = 5
LARGEST = 64
ROOM = LARGEST - SMALLEST  # bytes of payload in one block
END = 0x7E
DESTINATION = 0x10
SEQUENCES = 16


class FrameError(ValueError):
    """A payload that is no sequence of messages."""


class Block(NamedTuple):
    """A block that came whole: its sequence number, 0..15, and what is in it."""

    sequence: int
    payload: bytes


def _table() -> tuple[int, ...]:
    table = []
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
        table.append(value)
    return tuple(table)


_TABLE = _table()


def checksum(data: bytes) -> int:
    """CRC-16/MCRF4XX of `data`."""
    value = 0xFFFF
    for byte in data:
        value = value >> 8 ^ _TABLE[(value ^ byte) & 0xFF]
    return value


def block(sequence: int, payload: bytes) -> bytes:
    """The bytes of a block. ValueError for more than `ROOM` bytes of payload."""
    if len(payload) > ROOM:
        raise ValueError(f"a block carries at most {ROOM} bytes, not {len(payload)}")
    head = bytes((len(payload) + SMALLEST, DESTINATION | sequence & 0xF)) + payload
    check = checksum(head)
    return head + bytes((check >> 8, check & 0xFF, END))


def integer(value: int) -> bytes:
    """`value` as 1 to 5 bytes of seven bits, most significant first; -2**31 <= value < 2**32."""
    value = (value + 0x80000000 & 0xFFFFFFFF) - 0x80000000
    out = [value & 0x7F]
    low, high = -(1 << 5), 3 << 5
    while not low <= value < high:
        out.append(value >> 7 * len(out) & 0x7F | 0x80)
        low, high = low << 7, high << 7
        if len(out) == 5:
            break
    return bytes(reversed(out))


def read_integer(data: bytes, at: int) -> tuple[int, int]:
    """(a signed integer, the index behind it) of the bytes from `at` on. FrameError where they end too early."""
    try:
        byte = data[at]
        value = byte & 0x7F
        if byte & 0x60 == 0x60:
            value -= 0x80
        while byte & 0x80:
            at += 1
            byte = data[at]
            value = value << 7 | byte & 0x7F
    except IndexError:
        raise FrameError("the block ends within an integer") from None
    return (value + 0x80000000 & 0xFFFFFFFF) - 0x80000000, at + 1


class Reader:
    """Finds blocks in a stream of bytes; what is damaged is passed over up to the next end mark, and counted.

    One whose length is damaged is waited for no longer than until another has come whole behind it. A `patient` reader
    waits for as many bytes as the length says, whatever they are; the firmware is one.
    """

    __slots__ = ("_data", "_lost", "_patient", "damaged")

    def __init__(self, *, patient: bool = False) -> None:
        self._patient = patient
        self._data = bytearray()
        self._lost = False  # looking for an end mark
        self.damaged = 0

    def feed(self, data: bytes) -> list[Block]:
        """The blocks that are whole with `data`, in order."""
        waiting = self._data
        waiting += data
        found = []
        at = 0
        while at < len(waiting):
            if self._lost:
                end = waiting.find(END, at)
                if end < 0:
                    at = len(waiting)
                    break
                at, self._lost = end + 1, False
                continue
            length = waiting[at]
            if length == END:  # end marks between blocks mean nothing
                at += 1
                continue
            if not SMALLEST <= length <= LARGEST:
                self._give_up()
                continue
            if len(waiting) - at < length:
                # a damaged length would wait for long: the second byte tells, or a whole block that has come behind it
                if (len(waiting) - at > 1 and waiting[at + 1] & 0xF0 != DESTINATION) or self._whole_behind(at):
                    self._give_up()
                    continue
                break
            whole = self._whole(at)
            if whole is None:
                self._give_up()
                continue
            found.append(whole)
            at += length
        del waiting[:at]
        return found

    def _whole(self, at: int) -> Block | None:
        """The block that stands there, if one does and all of it has come."""
        body = bytes(self._data[at : at + self._data[at]])
        if len(body) != body[0] or not SMALLEST <= len(body) <= LARGEST or body[1] & 0xF0 != DESTINATION:
            return None
        if body[-1] != END or checksum(body[:-3]) != body[-3] << 8 | body[-2]:
            return None
        return Block(body[1] & 0xF, body[2:-3])

    def _whole_behind(self, at: int) -> bool:
        """Whether a block has come whole behind an end mark behind `at`."""
        data = self._data
        end = -1 if self._patient else data.find(END, at)
        while 0 <= end < len(data) - SMALLEST:
            if self._whole(end + 1) is not None:
                return True
            end = data.find(END, end + 1)
        return False

    def _give_up(self) -> None:
        self.damaged += 1
        self._lost = True
