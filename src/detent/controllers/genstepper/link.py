"""VALUE as it is typed, and the form of answers (manual, pages 22 to 24, 35, 39).

There are no frames: every character that is no part of a number is a command, and every command is answered.
"""

from collections.abc import Sequence

LARGEST = 2_147_483_647  # "a range of -2,147,483,647 through 2,147,483,647"
PROMPT = "*"
CRLF = "\r\n"

CRLF_FIRST, DELAYED = 1, 2  # the bits of V


def saturated(number: int) -> int:
    """`number`, or the end of the range of positions that it is beyond."""
    return max(-LARGEST, min(LARGEST, number))


class Value:
    """The number that stands before a command, and stays for the commands behind it."""

    __slots__ = ("_alone", "_number", "_sign", "_typing")

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """As after a reset: 0."""
        self._number = 0
        self._sign = 1
        self._typing = False  # the next digit belongs to this number
        self._alone = False  # it is a sign alone: "set no value yet", for every S until another number comes

    def take(self, character: str) -> bool:
        """Take a digit or a sign; False for any other character."""
        if character in "+-":
            self._number, self._sign, self._typing, self._alone = 0, (1 if character == "+" else -1), True, True
            return True
        if character not in "0123456789":
            return False
        if not self._typing:
            self._number, self._sign, self._typing = 0, 1, True
        self._alone = False
        self._number = saturated(self._number * 10 + int(character))
        return True

    def slew(self) -> int:
        """For S: the direction of a sign that stands alone; 0 if there is a number."""
        self._typing = False
        return self._sign if self._alone else 0

    def number(self) -> int:
        """For any other command: the number; a sign alone counts as 0.

        It is not lost by that: "the current value remains unchanged between commands" (page 22).
        """
        self._typing = False
        return self._sign * self._number


def answer(lines: Sequence[str], verbose: int) -> str:
    """A whole answer: in the CR LF form a line feed stands before the text and behind it, else only between lines."""
    text = CRLF.join(lines)
    if verbose & CRLF_FIRST:
        return CRLF + (text + CRLF if text else "") + PROMPT
    return text + PROMPT


def unframe(data: bytes) -> list[str]:
    """The lines and prompts in what a board sent."""
    text = data.decode("latin-1").replace(PROMPT, f"\n{PROMPT}\n").replace("\r", "\n")
    return [line for line in text.split("\n") if line]
