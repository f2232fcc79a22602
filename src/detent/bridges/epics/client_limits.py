"""What all clients of Channel Access together may hold. Whoever holds most leaves first: it may come again."""

from collections.abc import Callable, Iterable
from typing import Any, Final, Protocol

CLIENTS: Final = 256  # at once
HELD: Final = 50_000  # channels and monitors of all of them
WATCHED: Final = 1_000  # monitors of one field: all are told what is new before anybody else is heard


class Holder(Protocol):
    """A client's connection."""

    heard: float
    """When it said something last."""

    @property
    def held(self) -> int:
        """How many channels and monitors it has."""

    def watching(self, field: Any) -> int:
        """How many monitors of a field it has."""


class ClientLimits:
    """Counts what `holders` hold, exactly only where it may be too much."""

    def __init__(self, holders: Iterable[Any]) -> None:
        self._holders = holders  # a live set of Holder
        self._held = 0  # at most so much is held
        self._watched: dict[int, int] = {}  # field by id: at most so many watch it

    def too_silent(self) -> Any | None:
        """Who has to leave before one more comes."""
        holders = list(self._holders)
        return min(holders, key=lambda holder: holder.heard) if len(holders) >= CLIENTS else None

    def too_many(self, field: Any | None) -> tuple[Any, str] | None:
        """A channel was made, or a monitor of `field`: who has to leave, and why."""
        if field is not None:
            at_most = self._watched.get(id(field), 0) + 1
            if at_most > WATCHED:
                at_most, largest = self._count(lambda holder: holder.watching(field))
                if at_most > WATCHED:
                    return largest, f"more than {WATCHED} monitors of one field"
            self._watched[id(field)] = at_most
        self._held += 1
        if self._held > HELD:
            self._held, largest = self._count(lambda holder: holder.held)
            if self._held > HELD:
                return largest, f"more than {HELD} channels and monitors of all clients"
        return None

    def _count(self, number: Callable[[Any], int]) -> tuple[int, Any]:
        counted = [(number(holder), holder) for holder in self._holders]
        return sum(count for count, _ in counted), max(counted, key=lambda one: one[0])[1]
