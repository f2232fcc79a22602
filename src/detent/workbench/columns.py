"""Growing columns of numbers, each entry with the number of its batch, so that the past can be cut off."""

import numpy as np
import numpy.typing as npt

from detent.pulses.segment import Int64Array
from detent.ticks import Ns

_FIRST = 64


class Changes:
    """Times and values of something that changes in steps. `initial` is its value before the first time."""

    __slots__ = ("_batches", "_size", "_times", "_values", "initial")

    def __init__(self, initial: float) -> None:
        self.initial = initial
        self._times = np.empty(_FIRST, np.int64)
        self._values = np.empty(_FIRST, np.float64)
        self._batches = np.empty(_FIRST, np.int64)
        self._size = 0

    def __len__(self) -> int:
        return self._size

    @property
    def times(self) -> Int64Array:
        """When it changed, ns, in order."""
        return self._times[: self._size]

    @property
    def values(self) -> npt.NDArray[np.float64]:
        """To what."""
        return self._values[: self._size]

    def add(self, at: Ns, value: float, batch: int) -> None:
        """It changes; what was to come behind `at`, as of a character that is cut short, does not."""
        size = self._size
        if size and self._times[size - 1] > at:
            size = self._size = int(np.searchsorted(self.times, at, side="right"))
        if size == len(self._times):
            self._grow(1)
        self._times[size], self._values[size], self._batches[size] = at, value, batch
        self._size = size + 1

    def extend(self, times: Int64Array, values: npt.NDArray[np.uint8], batches: Int64Array) -> None:
        """It changes several times, in order."""
        size, end = self._size, self._size + len(times)
        if end > len(self._times):
            self._grow(len(times))
        self._times[size:end], self._values[size:end], self._batches[size:end] = times, values, batches
        self._size = end

    def cut(self, batch: int) -> None:
        """What batches from this one on brought has not happened."""
        self._size = int(np.searchsorted(self._batches[: self._size], batch))

    def drop(self, batch: int) -> None:
        """Forget what batches before this one brought; its value then is `initial` now."""
        gone = int(np.searchsorted(self._batches[: self._size], batch))
        if gone:
            self.initial = float(self._values[gone - 1])
            for column in (self._times, self._values, self._batches):
                column[: self._size - gone] = column[gone : self._size].copy()
            self._size -= gone

    def value_at(self, at: Ns) -> float:
        """Its value at a time, changes of that instant included."""
        index = int(np.searchsorted(self.times, at, side="right"))
        return float(self._values[index - 1]) if index else self.initial

    def _grow(self, more: int) -> None:
        room = max(2 * len(self._times), self._size + more)
        self._times = np.resize(self._times, room)
        self._values = np.resize(self._values, room)
        self._batches = np.resize(self._batches, room)


class Rows:
    """Rows of numbers, the first of each a time in ns, in order; the oldest are forgotten when there are too many."""

    __slots__ = ("_rows", "_size", "most")

    def __init__(self, columns: int, most: int) -> None:
        self._rows = np.empty((_FIRST, columns))
        self._size = 0
        self.most = most

    @property
    def rows(self) -> npt.NDArray[np.float64]:
        """All of them."""
        return self._rows[: self._size]

    def extend(self, rows: npt.NDArray[np.float64]) -> None:
        """Add some."""
        if self._size + len(rows) > self.most:
            kept = self._rows[self._size - min(self._size, self.most // 2) : self._size].copy()
            self._rows[: len(kept)] = kept
            self._size = len(kept)
        end = self._size + len(rows)
        if end > len(self._rows):
            self._rows = np.concatenate((self.rows, np.empty((max(end, self._size), self._rows.shape[1]))))
        self._rows[self._size : end] = rows
        self._size = end

    def cut(self, at: Ns) -> None:
        """What lies behind `at` has not happened."""
        self._size = int(np.searchsorted(self._rows[: self._size, 0], at, side="right"))
