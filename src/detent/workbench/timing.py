"""How fast a cell goes, and how late its deadlines are served: measured once a second."""

from detent.realtime.pace import Pace, WallNs
from detent.ticks import SECOND, Ns
from detent.workbench.messages import Lateness


class Timing:
    """`faster`: its time by real time; `lateness` of its deadlines since the pace was chosen."""

    def __init__(self) -> None:
        self.faster = 0.0
        self.lateness = Lateness(0, 0, 0)
        self._wall: WallNs = 0  # of the last look
        self._before: Ns = 0  # the cell's time then

    def look(self, wall: WallNs, now: Ns, pace: Pace) -> None:
        """To be called often: the cell is at `now`."""
        passed = wall - self._wall
        if passed < SECOND:
            return
        self.faster = max(now - self._before, 0) / passed if self._wall else 0.0
        self._wall, self._before = wall, now
        late = pace.lateness.summary()
        self.lateness = Lateness(late.p50, late.p99, late.most)
