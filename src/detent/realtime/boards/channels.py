"""What has been told outside of each thing that a cell does: so that, taken back, it tells only what is different."""

from collections.abc import Sequence
from typing import Generic, TypeVar

T = TypeVar("T")


class Channel(Generic[T]):
    """Items in a row, numbered from 0; the oldest are forgotten."""

    __slots__ = ("_first", "_items")

    def __init__(self) -> None:
        self._items: list[T] = []
        self._first = 0

    @property
    def count(self) -> int:
        """How many there were."""
        return self._first + len(self._items)

    def append(self, item: T) -> None:
        """One more."""
        self._items.append(item)

    def amend(self, back: int, item: T) -> None:
        """The item that was `back` items ago (1: the last) is this one."""
        self._items[-back] = item

    def since(self, count: int) -> list[T]:
        """Those from number `count` on, as far as they are kept."""
        return self._items[max(count - self._first, 0) :]

    def before(self, count: int) -> list[T]:
        """Those up to number `count` - 1, as far as they are kept."""
        return self._items[: max(count - self._first, 0)]

    def cut(self, count: int) -> list[T]:
        """Only the first `count` have happened; returned are the others."""
        place = max(count - self._first, 0)
        gone = self._items[place:]
        del self._items[place:]
        return gone

    def forget(self, count: int) -> None:
        """Nobody asks for those before number `count` - 1 any more: the last before it may still be in force."""
        gone = count - 1 - self._first
        if gone > 0:
            del self._items[:gone]
            self._first += gone


def alike(old: Sequence[T], new: Sequence[T]) -> int:
    """How many items both begin with."""
    count = 0
    for one, other in zip(old, new, strict=False):
        if one != other:
            break
        count += 1
    return count
