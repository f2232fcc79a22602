"""The kinds of argument a GS-C command takes: how each is read, checked and written.

The command table (`commands`) says which command takes which, with what range. Reading takes the ASCII
figures, signs and commas of the datasheet's own formats ("s = sign + or -, x = figure 1 to 3, ...") and
nothing else; leading zeros are fine.
"""

import re
from dataclasses import dataclass
from typing import ClassVar


def _integer(digits: str) -> int:
    """The number that ASCII `digits` spell; a number of ten figures or more is only "too large"."""
    significant = digits.lstrip("0")
    return int(significant or "0") if len(significant) < 10 else 10**10


@dataclass(frozen=True, slots=True)
class Argument:
    """What stands behind the letters of a command: this one, nothing.

    `forms` are the datasheet's ways to write it (figures as x, sign as s), each counted as a command of
    its own in the datasheet's 25 and 29. `address` says that `value` is an address of program memory;
    it is then the last part of the argument.
    """

    forms: tuple[str, ...] = ("",)
    address: ClassVar[bool] = False
    shape: ClassVar[re.Pattern[str]] = re.compile("")

    @property
    def words(self) -> str:
        """What is expected, to be read behind "takes"."""
        return "no argument"

    def read(self, text: str) -> tuple[int, int] | None:
        """`value` and `other` of an argument as on the wire; None if it is not one or out of range."""
        match = self.shape.fullmatch(text)
        if match is None:
            return None
        value, other = self.numbers(*match.groups())
        return (value, other) if self.admits(value, other) else None

    def numbers(self, *parts: str) -> tuple[int, int]:
        """`value` and `other` of the groups of `shape`, not yet checked."""
        return 0, 0

    def admits(self, value: int, other: int) -> bool:
        """Whether the two numbers are in range."""
        return (value, other) == (0, 0)

    def write(self, value: int, other: int) -> str:
        """The argument as Q lists it: no leading zeros, signs where the model prints them."""
        return ""


@dataclass(frozen=True, slots=True)
class Number(Argument):
    """An unsigned number of `low` to `high`, `what` in words. `zero` is a letter that may stand for 0."""

    what: str = ""
    low: int = 0
    high: int = 0
    zero: str = ""
    shape: ClassVar[re.Pattern[str]] = re.compile("([0-9]+|o)")

    @property
    def words(self) -> str:
        """Like "an input, 1 to 3"; words that begin with the numbers are enough by themselves."""
        return self.what if self.what[0].isdigit() else f"{self.what}, {self.low} to {self.high}"

    def numbers(self, *parts: str) -> tuple[int, int]:
        """The number; a letter that is not this argument's zero is out of every range."""
        if parts[0] == "o":
            return (0 if self.zero == "o" else -1), 0
        return _integer(parts[0]), 0

    def admits(self, value: int, other: int) -> bool:
        """Whether `value` is in range and `other` unused."""
        return self.low <= value <= self.high and other == 0

    def write(self, value: int, other: int) -> str:
        """Plain figures."""
        return str(value)


@dataclass(frozen=True, slots=True)
class Address(Number):
    """A number that is an address of program memory."""

    address: ClassVar[bool] = True


@dataclass(frozen=True, slots=True)
class Signed(Argument):
    """A signed number of `low` to `high`; without its sign it counts as plus, unless `sign_needed`."""

    what: str = ""
    low: int = 0
    high: int = 0
    sign_needed: bool = False
    zero_allowed: bool = True
    shape: ClassVar[re.Pattern[str]] = re.compile("([+-]?)([0-9]+)")

    @property
    def words(self) -> str:
        """Like "a position with its sign, -8388608 to +8388607"."""
        least = "" if self.zero_allowed else " and not 0"
        return f"{self.what}, {self.low:+d} to {self.high:+d}{least}"

    def read(self, text: str) -> tuple[int, int] | None:
        """As every argument, once the sign is there or not needed."""
        if self.sign_needed and text[:1] not in ("+", "-"):
            return None
        return Argument.read(self, text)

    def numbers(self, *parts: str) -> tuple[int, int]:
        """The signed number."""
        sign, digits = parts
        return (-_integer(digits) if sign == "-" else _integer(digits)), 0

    def admits(self, value: int, other: int) -> bool:
        """Whether `value` is in range and `other` unused."""
        return self.low <= value <= self.high and (value != 0 or self.zero_allowed) and other == 0

    def write(self, value: int, other: int) -> str:
        """The number with its sign; zero is +0."""
        return f"{value:+d}"


@dataclass(frozen=True, slots=True)
class Direction(Argument):
    """A sign, which may be left out for plus if `optional`; behind it an input, 1 to `inputs`, or none."""

    what: str = ""
    optional: bool = False
    inputs: int = 0
    shape: ClassVar[re.Pattern[str]] = re.compile("([+-]?)([0-9]*)")

    @property
    def words(self) -> str:
        """Like "a direction, + or -"."""
        return self.what

    def numbers(self, *parts: str) -> tuple[int, int]:
        """Direction (0 if it is missing and may not be) and input (-1 if it is written as zero)."""
        sign, digits = parts
        direction = {"+": 1, "-": -1, "": 1 if self.optional else 0}[sign]
        return direction, (_integer(digits) or -1) if digits else 0

    def admits(self, value: int, other: int) -> bool:
        """Whether there is a direction, and no input or one that exists."""
        return value in (1, -1) and 0 <= other <= self.inputs

    def write(self, value: int, other: int) -> str:
        """The sign, and the input if there is one."""
        return ("+" if value > 0 else "-") + (str(other) if other else "")


@dataclass(frozen=True, slots=True)
class Condition(Argument):
    """The value of the three inputs, a comma and an address: 0 to `states`, 0 to `high`."""

    states: int = 0
    high: int = 0
    address: ClassVar[bool] = True
    shape: ClassVar[re.Pattern[str]] = re.compile("([0-9]+),([0-9]+)")

    @property
    def words(self) -> str:
        """Both parts in words."""
        return f"the value of the inputs, 0 to {self.states}, a comma and an address, 0 to {self.high}"

    def numbers(self, *parts: str) -> tuple[int, int]:
        """Address and condition: the condition is written first (entry jcv,y, its example jc0,40)."""
        return _integer(parts[1]), _integer(parts[0])

    def admits(self, value: int, other: int) -> bool:
        """Whether both are in range."""
        return 0 <= value <= self.high and 0 <= other <= self.states

    def write(self, value: int, other: int) -> str:
        """Condition first."""
        return f"{other},{value}"
