"""What a cell reaches for outside: a place for what units keep without supply, and who wants to know what is typed."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

Store: TypeAlias = Callable[[str, bytes], bool]
"""Write the non-volatile image of a unit; say whether that succeeded."""

Typed: TypeAlias = Callable[[str, str], None]
"""A host is about to send the unit this command line, now."""


class Outside(NamedTuple):
    """What a cell reaches for outside: its copies reach for the same."""

    store: Store
    typed: Typed

    def __deepcopy__(self, _: object) -> "Outside":
        return self


def no_store(unit: str, image: bytes) -> bool:
    """Images stay in the units' own memory: what a cell does that nobody gave a place for files."""
    return True


def nobody_asks(unit: str, text: str) -> None:
    """Nobody wants to know what is typed."""
