"""VALUE as it is typed, and the form of answers (manual, pages 22 to 24, 35, 39).

There are no frames: every character that is no part of a number is a command, and every command is answered.
"""

from collections.abc import Sequence
from enum import Enum

LARGEST = 2_147_483_647  # "a range of -2,147,483,647 through 2,147,483,647"
PROMPT = "*"
CRLF = "\r\n"

CRLF_FIRST, DELAYED = 1, 2  # the bits of V


def saturated(number: int) -> int:
    """`number`, or the end of the range of positions that it is beyond."""
    return max(-LARGEST, min(LARGEST, number))


class _Typing(Enum):
    DONE = "done"  # the next digit begins a new number
    SIGN = "sign"  # "set no value yet"
    DIGITS = "digits"


class Value:
    """The number that stands before a command, and stays for the commands behind it."""

    __slots__ = ("_number", "_sign", "_typing")

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """As after a reset: 0."""
        self._number = 0
        self._sign = 1
        self._typing = _Typing.DONE

    def take(self, character: str) -> bool:
        """Take a digit or a sign; False for any other character."""
        if character in "+-":
            self._number, self._sign, self._typing = 0, (1 if character == "+" else -1), _Typing.SIGN
            return True
        if character not in "0123456789":
            return False
        if self._typing is _Typing.DONE:
            self._number, self._sign = 0, 1
        self._typing = _Typing.DIGITS
        self._number = saturated(self._number * 10 + int(character))
        return True

    def slew(self) -> int:
        """The direction of a sign that stands alone, which S understands; 0 if there is a number."""
        if self._typing is _Typing.SIGN:
            return self._sign
        return 0

    def number(self) -> int:
        """The number for a command other than a slew: a sign alone counts as 0. It is complete then."""
        self._typing = _Typing.DONE
        return self._sign * self._number


def answer(lines: Sequence[str], verbose: int) -> str:
    """A whole answer: in the CR LF form a line feed stands before the text and behind it, else only between lines."""
    text = CRLF.join(lines)
    if verbose & CRLF_FIRST:
        return CRLF + (text + CRLF if text else "") + PROMPT
    return text + PROMPT


def undress(data: bytes) -> list[str]:
    """The lines and prompts in what a board sent."""
    text = data.decode("latin-1").replace(PROMPT, f"\n{PROMPT}\n").replace("\r", "\n")
    return [line for line in text.split("\n") if line]
