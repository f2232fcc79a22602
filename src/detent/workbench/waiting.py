"""What hosts are to send while the cell stands: it waits in the open, can be taken back, and goes out with the time.

A byte that is sent into a standing cell could not be taken back, and into its past it would drop what came after. So
what windows send waits here, and what programs send over the control interface.
"""

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

MOST: Final = 1000


class Waits(NamedTuple):
    """A command line to a unit, or bytes to a line."""

    number: int
    line: str
    unit: str | None  # None: bytes as they are
    text: str  # of bytes: one character each


class Waiting:
    """The queue of one cell, in its order."""

    def __init__(self, before: Iterable[Waits] = ()) -> None:
        """One that begins with what waited `before`."""
        self.queue = tuple(before)
        self._number = max((one.number for one in self.queue), default=0)

    def put(self, line: str, unit: str | None, text: str) -> None:
        """One more waits. Raises ValueError if too many do."""
        if len(self.queue) >= MOST:
            raise ValueError(f"{MOST} commands wait already; let time go on, or take some back")
        self._number += 1
        self.queue = (*self.queue, Waits(self._number, line, unit, text))

    def withdraw(self, number: int | None) -> None:
        """Take one of them back, or all."""
        self._keep(lambda one: number is not None and one.number != number)

    def drop(self, line: str) -> None:
        """Take back what waits for a line."""
        self._keep(lambda one: one.line != line)

    def out(self, send: Callable[[Waits], None]) -> None:
        """Time goes on: everything is sent, in its order and once. What is refused is raised, and the rest stays."""
        while self.queue:
            one, self.queue = self.queue[0], self.queue[1:]
            send(one)

    def _keep(self, wanted: Callable[[Waits], bool]) -> None:
        self.queue = tuple(one for one in self.queue if wanted(one))
