"""A cell that is served and cannot go on: it stops with a report, and what serves it does not."""

from collections.abc import Callable, Sequence

from detent.realtime.loop import Companion, Served, ServedLine
from detent.realtime.pace import WallNs
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


class GuardedCompanion:
    """What is served along with a cell, its boards, say: where it raises something, the cell stops in the same way.

    It is served on all the same, as a board may have to be told once more to stop.
    """

    def __init__(self, companion: Companion, guarded: Guarded) -> None:
        self._companion, self._guarded = companion, guarded

    def reading(self) -> Sequence[int]:
        """Descriptors that may have something to read."""
        return self._companion.reading()

    def writing(self) -> Sequence[int]:
        """Descriptors that wait for room."""
        return self._companion.writing()

    def deadline(self) -> WallNs | None:
        """When `serve` is to be called at the latest."""
        try:
            return self._companion.deadline()
        except Exception as error:  # whatever it is, here and below: nobody knows any more what the motors do
            self._guarded.stop(error)
            return None

    def receive(self, descriptor: int) -> None:
        """Something can be read."""
        try:
            self._companion.receive(descriptor)
        except Exception as error:
            self._guarded.stop(error)

    def flush(self, descriptor: int) -> None:
        """Something can be written."""
        try:
            self._companion.flush(descriptor)
        except Exception as error:
            self._guarded.stop(error)

    def serve(self) -> None:
        """The cell is at its present, and what could be read was: called once in each wake-up."""
        try:
            self._companion.serve()
        except Exception as error:
            self._guarded.stop(error)
