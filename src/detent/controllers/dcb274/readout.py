"""Z 1: the position is printed when it has changed and the line is free (page 53)."""

from detent.controllers.dcb274.motion import Motion
from detent.controllers.dcb274.settings import Settings
from detent.controllers.dcb274.work import position
from detent.ticks import NEVER, Ns, instants
from detent.uart import Transmitter


class Readout:
    """What was printed last, and when it is looked at again: `deadline`, NEVER while it is off."""

    INSTANTS = instants(deadline=0)

    def __init__(self, motion: Motion, settings: Settings) -> None:
        self._motion, self._settings = motion, settings
        self.reset()

    def reset(self) -> None:
        """Position 0 counts as printed."""
        self._printed = 0
        self.deadline: Ns = NEVER

    def look(self, line: Transmitter, now: Ns, *, single: bool) -> None:
        """Print a changed position where `line` is free; in `single` mode only."""
        self.deadline = NEVER
        if not self._settings.readout or not single:
            return
        if line.busy_until > now:
            self.deadline = line.busy_until
            return
        at = self._motion.position(now)
        if at != self._printed:
            self._printed = at
            line.send(f"{position(at)}\r".encode("latin-1"), now)
        self.deadline = max(line.busy_until, self._motion.next_change(now))
