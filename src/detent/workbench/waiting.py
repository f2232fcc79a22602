"""What windows send while the cell stands: it waits in the open, can be taken back, and goes out when time goes on.

A byte that is sent into a standing cell could not be taken back, and into its past it would drop what came after.
"""

from typing import TYPE_CHECKING, NamedTuple

from detent.workbench.live import Live, Value

if TYPE_CHECKING:
    from detent.workbench.client import Bench

MOST = 1000


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
        self._tell()

    async def type(self, unit: str, text: str) -> None:
        """Send a unit a command line, or keep it until time goes on. Raises what the bench does."""
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
        """Time goes on: everything is sent, in its order. What is refused is told, and the rest stays."""
        while self._queue:
            one = self._queue[0]
            try:
                if one.unit is None:
                    await self._bench.send(one.line, one.text.encode("latin-1"))
                else:
                    await self._bench.type(one.unit, one.text)
            finally:
                self._queue = [other for other in self._queue if other.number != one.number]
                self._tell()

    def _put(self, line: str, unit: str | None, text: str) -> None:
        if len(self._queue) >= MOST:
            raise ValueError(f"{MOST} commands wait already; let time go on, or take some back")
        self._number += 1
        self._queue.append(Waits(self._number, line, unit, text))
        self._tell()

    def _tell(self) -> None:
        shown: list[Value] = [[one.number, one.line, one.unit, one.text] for one in self._queue]
        self._live.put({"queue": shown})
