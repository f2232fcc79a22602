"""The columns of a table of pulses, as arrays with their running sums."""

import numpy as np
import numpy.typing as npt

from detent.pulses.segment import Immutable, Int64Array

LIMIT = 1 << 62


class Rows(Immutable):
    """The columns of a table with their running sums: read-only int64 arrays of one length, shared by parts.

    `counts` and `periods` are whole numbers of at least 1. ValueError for others, and for columns of different
    lengths; OverflowError for a table of 2**62 ticks or more. Rows are equal if their columns are.
    """

    __slots__ = ("counts", "periods", "pulses", "pulses_list", "ticks", "ticks_list")

    def __init__(self, counts: npt.ArrayLike, periods: npt.ArrayLike) -> None:
        self.counts, self.periods = _column(counts, "counts"), _column(periods, "periods")
        if self.counts.shape != self.periods.shape:
            raise ValueError(f"a table has as many counts as periods, not {len(self.counts)} and {len(self.periods)}")
        if float(np.dot(self.counts.astype(np.float64), self.periods.astype(np.float64))) >= LIMIT:
            raise OverflowError("the table takes more than 2**62 ticks: split it")
        # before row i: pulses[i] pulses, ticks[i] ticks; one more entry for the end
        self.pulses, self.ticks = _sums(self.counts), _sums(self.counts * self.periods)
        # bisect wants plain integers; a memoryview gives them without a second copy
        self.pulses_list, self.ticks_list = self.pulses.data, self.ticks.data

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Rows):
            return NotImplemented
        return np.array_equal(self.counts, other.counts) and np.array_equal(self.periods, other.periods)

    def __hash__(self) -> int:
        return hash((len(self.counts), self.pulses_list[-1], self.ticks_list[-1]))

    def __reduce__(self) -> tuple[object, ...]:
        return Rows, (self.counts, self.periods)


def _column(values: npt.ArrayLike, name: str) -> Int64Array:
    column = np.array(values)
    if column.size == 0:
        column = column.astype(np.int64)
    if column.ndim != 1 or column.dtype.kind not in "iu":
        raise ValueError(f"the {name} of a table are a column of integers, not {column.dtype} of shape {column.shape}")
    if column.size and (int(column.min()) < 1 or int(column.max()) >= LIMIT):
        raise ValueError(f"the {name} of a table are at least 1 and less than 2**62")
    result: Int64Array = column.astype(np.int64)
    result.flags.writeable = False
    return result


def _sums(column: Int64Array) -> Int64Array:
    sums = np.zeros(len(column) + 1, np.int64)
    np.cumsum(column, out=sums[1:])
    sums.flags.writeable = False
    return sums
