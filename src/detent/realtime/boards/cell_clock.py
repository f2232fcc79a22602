"""The clock of a cell that is driven: its master board's, joined on where that is away or comes back as another."""

from collections.abc import Callable

from detent.realtime.boards.board import State
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.clock import Clock
from detent.realtime.pace import Pace, WallNs
from detent.ticks import Ns


class CellClock:
    """`offset` is what it says at cell time 0, `shift` how far it is from the master's time."""

    def __init__(self, boards: Boards, wall: Callable[[], WallNs]) -> None:
        self._boards, self._wall = boards, wall
        self.offset: Ns = 0
        self.shift: Ns = 0
        self._clock: Clock | None = None  # of the master, as it was last looked at
        self._known: tuple[WallNs, Ns] = (wall(), 0)  # the last time that the master told

    def now(self) -> Ns:
        """The time of the master board, for the pace of the cell; without it, the host's from there on.

        A board that comes back counts from elsewhere: its time is joined on to the one that went on meanwhile.
        """
        wall, master = self._wall(), self._boards.master
        now = self._known[1] + wall - self._known[0]
        if master.state in (State.READY, State.SHUT_DOWN):
            if master.core.clock is not self._clock:
                raw = self._boards.ns_at(wall)
                if self._clock is not None:
                    self.shift = now - raw
                    self._boards.align(now - self.offset, raw)
                self._clock = master.core.clock
            now = self._boards.ns_at(wall) + self.shift
            self._known = wall, now
        return now

    def align(self, pace: Pace, cell: Ns) -> None:
        """The cell, at `cell`, is at its present."""
        pace.restart(cell)
        began = pace.due(cell)
        assert began is not None
        self.offset = began - cell
        self._boards.align(cell, began - self.shift)

    def join(self) -> None:
        """A board is ready again: its present is the cell's."""
        now = self.now()
        self._boards.align(now - self.offset, now - self.shift)
