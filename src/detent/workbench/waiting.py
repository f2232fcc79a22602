"""What windows send while the cell stands: it waits in the open, can be taken back, and goes out when time goes on.

A byte that is sent into a standing cell could not be taken back, and into its past it would drop what came after.
"""

import asyncio
from typing import TYPE_CHECKING, Final, NamedTuple

from detent.workbench.live import Live, Value
from detent.workbench.words import check_typed

if TYPE_CHECKING:
    from detent.workbench.client import Bench

MOST = 1000
REFUSED: Final = (ValueError, KeyError, RuntimeError)  # what a bench raises for a command that it does not take


class Waits(NamedTuple):
    """A command line to a unit, or bytes to a line."""

    number: int
    line: str
    unit: str | None  # None: bytes as they are
    text: str  # of bytes: one character each


class Waiting:
    """The queue of one bench, shown in `live` (``queue``)."""

    def __init__(self, bench: "Bench", live: Live) -> None:
        self._bench, self._live = bench, live
        self._queue: list[Waits] = []
        self._number = 0
        self._sending: asyncio.Task[None] | None = None
        self._tell()
        bench.on_change(self._see)

    async def type(self, unit: str, text: str) -> None:
        """Send a unit a command line, or keep it until time goes on. Raises what the bench does."""
        check_typed(text)
        if self._sends_now():
            await self._bench.type(unit, text)
            return
        line = self._bench.picture.units[unit].line
        if line is None:
            raise ValueError(f"{unit} has no line")
        if (host := self._bench.picture.lines[line].host) is not None:
            raise ValueError(f"{host} is the host of line {line}: send to {host}")
        self._put(line, unit, text)

    async def send(self, line: str, data: bytes) -> None:
        """Send bytes to a line, or keep them until time goes on."""
        if self._sends_now():
            await self._bench.send(line, data)
            return
        if line not in self._bench.picture.lines:
            raise ValueError(f"there is no line {line!r}")
        self._put(line, None, data.decode("latin-1"))

    def _sends_now(self) -> bool:
        """A machine's time always goes on: what is typed while somebody looks back must not move it later."""
        state = self._bench.state
        return not state.held or state.real is not None

    def withdraw(self, number: int | None) -> None:
        """Take one of them back, or all."""
        self._queue = [one for one in self._queue if number is not None and one.number != number]
        self._tell()

    async def out(self) -> None:
        """Time goes on: everything is sent, in its order and once. What is refused is told, and the rest stays."""
        while self._queue:
            await self._send(self._first())

    def _first(self) -> Waits:
        """The one that is to be sent, which waits no more."""
        one = self._queue.pop(0)
        self._tell()
        return one

    async def _send(self, one: Waits) -> None:
        if one.unit is None:
            await self._bench.send(one.line, one.text.encode("latin-1"))
        else:
            await self._bench.type(one.unit, one.text)

    def _see(self) -> None:
        """Time may have gone on without a word, or a command may have come to wait while it was told to."""
        if self._queue and self._sends_now() and self._sending is None:
            self._sending = asyncio.create_task(self._out())

    async def _out(self) -> None:
        try:
            while self._queue and self._sends_now():
                one = self._first()
                try:
                    await self._send(one)
                except REFUSED as error:
                    self._live.put({"turneddown": f"{one.text}: {error}"})
        finally:
            self._sending = None

    def _put(self, line: str, unit: str | None, text: str) -> None:
        if len(self._queue) >= MOST:
            raise ValueError(f"{MOST} commands wait already; let time go on, or take some back")
        self._number += 1
        self._queue.append(Waits(self._number, line, unit, text))
        self._tell()

    def _tell(self) -> None:
        shown: list[Value] = [[one.number, one.line, one.unit, one.text] for one in self._queue]
        self._live.put({"queue": shown})
