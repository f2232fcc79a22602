"""How the numbers of a command are written, checked and listed (manual, pages 22 and 33).

Between numbers stands a space or a comma; a space before the first is optional. Leading zeros, an explicit plus,
decimals (the fraction is dropped) and a semicolon at the end are fine, and numbers too many are ignored. A number
that is missing is 0, except where the command needs all of its own.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

from detent.controllers.dcb274.link import NO_NAME, is_name
from detent.ramps.timer_table import LEAST_COUNT, count_of, rate_of

LEAST, MOST = -8_388_607, 8_388_607  # positions
_NUMBER = re.compile(r"([+-]?)([0-9]*)(?:\.[0-9]*)?")
_BETWEEN = re.compile(r" *, *| +")
_TOO_LONG = 10  # figures; such a number is out of every range


class Number(NamedTuple):
    """One argument: `what` it is in words, `low` to `high`. `width` is its place in the instruction, in bytes."""

    what: str
    low: int
    high: int
    width: int = 1

    @property
    def words(self) -> str:
        """Like "a position, -8388607 to 8388607"; words that begin with the numbers are enough by themselves."""
        return self.what if self.what[0].isdigit() else f"{self.what}, {self.low} to {self.high}"

    def read(self, number: int) -> int | None:
        """The value that is stored for what was typed; None if it is out of range."""
        return number if self.low <= number <= self.high else None

    def write(self, value: int) -> str:
        """A stored value as Q lists it."""
        return str(value)

    def pack(self, value: int) -> bytes:
        """A stored value in memory: little-endian, two's complement."""
        return (value & ((1 << 8 * self.width) - 1)).to_bytes(self.width, "little")

    def unpack(self, data: bytes) -> int | None:
        """The stored value in memory; None for bytes that `pack` does not give."""
        value = int.from_bytes(data, "little", signed=self.low < 0)
        return value if self.low <= value <= self.high else None


class Rate(Number):
    """A speed in steps/s, kept as the timer's count (0: stop, where `signed`). Never refused for its size."""

    __slots__ = ()

    @property
    def signed(self) -> bool:
        """Whether it has a direction, and may be 0."""
        return self.low < 0

    @property
    def words(self) -> str:
        """The manual's range; what lies outside is limited."""
        return f"{self.what}, {'±' if self.signed else ''}40 to 36000 (limited to 40, at most 41480)"

    def read(self, number: int) -> int | None:
        """The count, negative for the minus direction."""
        if number == 0:
            return 0 if self.signed else None
        if number < 0:
            return -count_of(-number) if self.signed else None
        return count_of(number)

    def write(self, value: int) -> str:
        """The real rate, as X prints it."""
        if value == 0:
            return "0"
        return str(rate_of(value)) if value > 0 else str(-rate_of(-value))

    def pack(self, value: int) -> bytes:
        """The count, with the direction in bit 15."""
        return (abs(value) | (value < 0) << 15).to_bytes(2, "little")

    def unpack(self, data: bytes) -> int | None:
        """The count, whatever somebody wrote there with a raw write: 1 and 2 mean the least."""
        word = int.from_bytes(data, "little")
        value = word & 0x7FFF
        if value == 0 or (word >> 15 and not self.signed):
            return 0 if self.signed else None
        value = max(value, LEAST_COUNT)
        return -value if word >> 15 else value


class Address(Number):
    """A byte address of program memory, or `special` (2048). The parameter cells 193-255 are refused."""

    __slots__ = ()

    def read(self, number: int) -> int | None:
        """The address, unless a program may not stand there."""
        return number if self.low <= number <= self.high and not 193 <= number <= 255 else None

    @property
    def words(self) -> str:
        """With the hole in it."""
        if self.high < 256:
            return f"{self.what}, 0 to 192"
        return f"{self.what}, 0 to 192 or 256 to {self.high}"

    def unpack(self, data: bytes) -> int | None:
        """The address, unless a program may not stand there."""
        return self.read(int.from_bytes(data, "little"))


class Name(Number):
    """The name of an axis behind ``|``, as `link.is_name` has it; `NO_NAME` is the axis itself."""

    __slots__ = ()

    @property
    def words(self) -> str:
        """What may stand there."""
        return f"{self.what}; none is the axis itself"

    def read(self, number: int) -> int | None:
        """The name, if it is one."""
        return number if number == NO_NAME or is_name(number) else None

    def write(self, value: int) -> str:
        """The character; nothing for the axis itself."""
        return chr(value) if value != NO_NAME else ""

    def unpack(self, data: bytes) -> int | None:
        """The name, if it is one."""
        return self.read(data[0])


def split(text: str) -> list[int] | None:
    """The numbers in what stands behind the letter of a command; None if it is something else."""
    text = text.strip(" ")
    while text.endswith(";"):
        text = text[:-1].rstrip(" ")
    if not text:
        return []
    numbers = []
    for part in _BETWEEN.split(text):
        match = _NUMBER.fullmatch(part)
        if match is None or part in ("+", "-", ".", "+.", "-."):
            return None
        sign, digits = match.groups()
        digits = digits.lstrip("0")
        size = int(digits or "0") if len(digits) < _TOO_LONG else 10**_TOO_LONG
        numbers.append(-size if sign == "-" else size)
    return numbers


def read(arguments: Sequence[Number], numbers: Sequence[int]) -> tuple[int, ...] | None:
    """The stored values of typed numbers; None if one is out of range. Missing ones are 0."""
    values = []
    for position, argument in enumerate(arguments):
        value = argument.read(numbers[position] if position < len(numbers) else 0)
        if value is None:
            return None
        values.append(value)
    return tuple(values)
