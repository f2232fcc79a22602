"""A line of a cell as a host driver's port: bytes written and read, and waiting, in the cell's virtual time."""

from contextlib import AbstractContextManager, nullcontext

from detent.cell.cell import Cell
from detent.ticks import SECOND


class HostPort:
    """The host's end of line number `line` of `cell`. `wait` lets virtual time pass."""

    def __init__(self, cell: Cell, line: int = 0) -> None:
        self.cell, self.line = cell, line
        self._heard = bytearray()

    def write(self, data: bytes) -> int:
        """Send `data` behind what is still being sent."""
        self.cell.send(self.line, data)
        return len(data)

    def receive(self, timeout: float) -> bytes:
        """What has reached the host, as soon as that is something, within `timeout` seconds behind what is sent."""
        line = self.cell.lines[self.line]
        until = max(self.cell.now, line.host_busy_until) + round(timeout * SECOND)
        while True:
            self._heard += bytes(heard.char.value for heard in line.take())
            at = self.cell.next_event()
            if self._heard or at is None or at > until:
                break
            self.cell.step()
        if not self._heard:
            self.cell.run_to(until)
        data = bytes(self._heard)
        self._heard.clear()
        return data

    def keep(self, data: bytes) -> None:
        """`data` comes first at the next `receive`."""
        self._heard[:0] = data

    def clock(self) -> float:
        """Seconds of the cell."""
        return self.cell.now / SECOND

    def turn(self) -> AbstractContextManager[object]:
        """Nobody else is there."""
        return nullcontext()

    def close(self) -> None:
        """Nothing is held."""

    def wait(self, seconds: float) -> None:
        """Let so many seconds pass, from the end of what is being sent."""
        begin = max(self.cell.now, self.cell.lines[self.line].host_busy_until)
        self.cell.run_to(begin + round(seconds * SECOND))
