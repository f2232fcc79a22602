"""The units at one port: where several share a line, each of them gets its stop, and none waits longer than it must."""

import asyncio
from itertools import count
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")


class Turn(NamedTuple):
    """The turn of one stop. Those of units that have answered last come before those that are `late`."""

    late: bool
    number: int
    come: asyncio.Event


class Party(Generic[T]):
    """Who shares a port (`units`), and whose turn it is to be stopped: a line carries one conversation at a time."""

    def __init__(self) -> None:
        self.units: list[T] = []
        self._numbers = count()
        self._asked: list[Turn] = []
        self._now: Turn | None = None

    @property
    def stopping(self) -> bool:
        """Whether a stop of any of them is not over: nobody else has a word on the line then."""
        return bool(self._asked)

    def ask(self, *, late: bool) -> Turn:
        """A stop is asked for; it waits for `come` and ends with `over`."""
        turn = Turn(late, next(self._numbers), asyncio.Event())
        self._asked.append(turn)
        # those that are asked for in the same breath are all known when the first has its turn
        asyncio.get_running_loop().call_soon(self._next)
        return turn

    def over(self, turn: Turn) -> None:
        """That stop has ended, however it did."""
        self._asked.remove(turn)
        if self._now is turn:
            self._now = None
        self._next()

    def _next(self) -> None:
        if self._now is None and self._asked:
            self._now = min(self._asked, key=lambda turn: turn[:2])
            self._now.come.set()
