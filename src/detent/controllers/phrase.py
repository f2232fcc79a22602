"""What is said on a serial line, byte by byte in words: for terminals, and for people who learn a protocol.

A controller's `phrases` reads frames by the same tables as its firmware. It judges only what can be seen on the line:
whether a command may come now is the controller's answer to tell.
"""

from collections.abc import Iterable
from typing import NamedTuple, Protocol


class Piece(NamedTuple):
    """So many bytes of a phrase that belong together.

    The kind is address, command, argument, checksum, end, answer, echo, error or unknown.
    """

    length: int
    kind: str
    meaning: str


class Phrase(NamedTuple):
    """A frame: its pieces, in order, what the whole of it says, and whether it is an error or tells of one."""

    pieces: tuple[Piece, ...]
    note: str
    wrong: bool = False


class Phrases(Protocol):
    """The phrases of one protocol."""

    def whole(self, data: bytes, to_unit: bool) -> bool:
        """Whether `data`, said to a unit or by one, is a whole frame."""

    def read(self, data: bytes, to_unit: bool, asked: bytes = b"") -> Phrase:
        """What a whole frame, or what has come of it, says; of an answer, to what was `asked` last on the line."""


def named_bits(value: int, names: Iterable[tuple[int, str]]) -> str:
    """The bits that `names` gives a name, as a person reads them: those that are set, or none."""
    return ", ".join(name for bit, name in names if value & bit) or "none"


class Lines:
    """Lines of text that end with CR or LF, those of a unit with CR LF; of whom nothing more is known."""

    def whole(self, data: bytes, to_unit: bool) -> bool:
        """At LF, and towards the unit at CR."""
        return data[-1:] == b"\n" or (to_unit and data[-1:] == b"\r")

    def read(self, data: bytes, to_unit: bool, asked: bytes = b"") -> Phrase:
        """The text as it is."""
        text = data.rstrip(b"\r\n")
        pieces = (
            Piece(len(text), "argument" if to_unit else "answer", "text"),
            Piece(len(data) - len(text), "end", "end of the line"),
        )
        return Phrase(tuple(piece for piece in pieces if piece.length), "")
