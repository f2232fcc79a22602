"""A cell that is served and cannot go on: it stops with a report, and what serves it does not."""

from collections.abc import Callable, Sequence

from detent.realtime.loop import Served, ServedLine
from detent.ticks import Ns
from detent.uart import Chars


class Guarded:
    """The cell as the loop serves it, until it raises something. From then on it stands, and says why."""

    def __init__(self, cell: Served, on_stop: Callable[[str], None] = lambda why: None) -> None:
        self._cell, self._on_stop = cell, on_stop
        self.stopped = ""  # why, in a line

    @property
    def now(self) -> Ns:
        """Its time."""
        return self._cell.now

    @property
    def lines(self) -> Sequence[ServedLine]:
        """Its lines."""
        return self._cell.lines

    def next_event(self) -> Ns | None:
        """When something happens next by itself: never, where it has stopped."""
        return None if self.stopped else self._cell.next_event()

    def run_to(self, until: Ns) -> None:
        """Let everything happen up to `until`."""
        if not self.stopped:
            try:
                self._cell.run_to(until)
            except Exception as error:  # whatever it is, it is the cell's, and others are served here too
                self.stop(error)

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends something; a cell that has stopped hears nothing."""
        if not self.stopped:
            try:
                self._cell.send(line, data)
            except Exception as error:
                self.stop(error)

    def stop(self, error: Exception) -> None:
        """It cannot go on."""
        if self.stopped:
            return
        kind = "" if isinstance(error, (RuntimeError, ValueError)) and str(error) else f"{type(error).__name__}: "
        self.stopped = f"the cell has stopped at {self.now / 1e9:.6f} s: {kind}{error}"
        self._on_stop(self.stopped)
