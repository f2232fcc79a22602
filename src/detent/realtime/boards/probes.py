"""Round trips that tell what a board's clock says: some before anything is scheduled, then one about every second."""

from collections.abc import Callable

from detent.realtime.boards.core import Core
from detent.realtime.boards.dictionary import Message
from detent.realtime.pace import WallNs
from detent.ticks import MS

FIRST = 10  # round trips before anything is scheduled
EVERY: WallNs = 985 * MS  # afterwards; not a whole second, which other things may keep too
PATIENCE = 60  # times that it is asked again, 40 ms apart: then the board is lost


class Probes:
    """The questions after one board's clock. `at`: when the next is due; None before `begin`."""

    def __init__(self, core: Core) -> None:
        self.at: WallNs | None = None
        self._core = core
        self._sent: WallNs = 0
        self._left = 0
        self._then: Callable[[WallNs], None] = lambda wall: None

    def clear(self) -> None:
        """The board is to be asked for everything anew."""
        self.at = None

    def begin(self, wall: WallNs, then: Callable[[WallNs], None]) -> None:
        """Ask how long it has been running, and the first few times what its clock says; `then` it is known."""
        self._then = then
        self._core.ask("get_uptime", "uptime", self._uptime, wall)

    def again(self, wall: WallNs, then: Callable[[WallNs], None]) -> None:
        """Ask a few times more; `then` it is known where the clock stands, whatever happened meanwhile."""
        self._then, self._left = then, FIRST
        self.ask(wall)

    def break_off(self) -> None:
        """Nobody waits any more until the clock is known; it is asked for from time to time as before."""
        self._left = 0

    def _uptime(self, message: Message, wall: WallNs) -> None:
        whole = (message.number("high") & 0xFFFFFFFF) << 32 | message.number("clock") & 0xFFFFFFFF
        self._core.clock.note(whole, wall, wall)
        self._core.clock.trips.clear()  # it served to extend the next ones
        self._left = FIRST
        self.ask(wall)

    def ask(self, wall: WallNs) -> None:
        """Ask for the clock."""
        core = self._core
        self.at = wall + EVERY
        if core.asking("clock", -1):
            return  # it has not answered yet
        self._sent = wall
        core.ask("get_clock", "clock", self._clocked, wall, times=PATIENCE)
        core.link.flush(wall)

    def _clocked(self, message: Message, wall: WallNs) -> None:
        core = self._core
        tick = core.clock.extend(message.number("clock"), wall)
        if not core.clock.note(tick, self._sent, wall):
            self.ask(wall)  # the next one says which of them was wrong
        elif self._left:
            self._left -= 1
            if self._left:
                self.ask(wall)
            else:
                self._then(wall)
