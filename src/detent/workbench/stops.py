"""What was asked before a stop is not done behind it, wherever it has waited meanwhile.

Stops are counted. A window says with each call which of them it knew when a hand acted; what the call begins (a job, a
script, a connection) takes that along, and asks `Stops.check` at the last instant before it moves something.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final, NamedTuple

from detent.ticks import MS

UNITS: Final = "units"
"""All real units, those that nobody has connected to yet too."""
BOARDS: Final = "boards"
"""The boards that the cell drives."""


class Overtaken(RuntimeError):
    """A stop came behind what was asked."""


class Asked(NamedTuple):
    """Who asks: the number of the last stop that he knew then; what is told the number of a stop that he asks for."""

    known: int
    stopped: Callable[[int], None] | None = None


_asked: ContextVar[Asked | None] = ContextVar("asked", default=None)


@contextmanager
def asked_by(who: Asked) -> Iterator[None]:
    """Whatever is begun within this is asked by `who`; tasks too, for as long as they last."""
    token = _asked.set(who)
    try:
        yield
    finally:
        _asked.reset(token)


class Stops:
    """The stops so far: how many, and the last one of whom."""

    def __init__(self, tell: Callable[[int], None] = lambda count: None) -> None:
        """`tell` hears the number of each. They begin where those of a server before this one cannot have come to."""
        self.count = time.monotonic_ns() // MS
        self._last: dict[str, int] = {}
        self._tell = tell

    def stop(self, *names: str) -> None:
        """These are stopped, now."""
        self.count += 1
        self._last |= dict.fromkeys(names, self.count)
        who = _asked.get()
        if who is not None and who.stopped is not None:
            who.stopped(self.count)
        self._tell(self.count)

    def check(self, *names: str) -> None:
        """Raises Overtaken where one of these was stopped behind what is asked here. What no window asks is never."""
        who = _asked.get()
        if who is not None and any(self._last.get(name, 0) > who.known for name in names):
            raise Overtaken("STOP came behind it: it is not done, nor is anything of it that was left; ask again")
