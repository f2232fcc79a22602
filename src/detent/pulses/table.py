"""Pulses from a table: rows of so many pulses, each so many whole ticks of a clock apart."""

from bisect import bisect_left
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from detent.pulses import arrays
from detent.pulses.segment import Immutable, Int64Array, check_range
from detent.ticks import FIXED_BITS, HALF_NS, SECOND, Fixed, Ns

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


@dataclass(frozen=True, slots=True)
class Table(Immutable):
    """Row after row from `anchor`: counts[i] pulses, each periods[i] ticks of `tick` ns after the one before.

    Of its pulses first < i <= last are kept (None: all). ValueError for a tick that is not positive.
    """

    anchor: Fixed
    tick: Fraction | int
    rows: Rows
    first: int = 0
    last: int = field(default=-1)

    def __post_init__(self) -> None:
        if self.tick <= 0:
            raise ValueError(f"a clock tick is positive, not {self.tick} ns")
        total = int(self.rows.pulses[-1])
        if self.last == -1:
            object.__setattr__(self, "last", total)
        check_range(self.first, self.last, total)

    @classmethod
    def of(cls, anchor: Fixed, tick: Fraction | int, counts: npt.ArrayLike, periods: npt.ArrayLike) -> "Table":
        """The table with these columns (sequences or integer arrays; see :class:`Rows`)."""
        return cls(anchor, tick, Rows(counts, periods))

    @property
    def steps(self) -> int:
        """How many pulses."""
        return self.last - self.first

    @property
    def begin(self) -> Fixed:
        """The instant of the pulse before its first, or the anchor."""
        return self.fixed(0)

    @property
    def end(self) -> Fixed:
        """The instant of its last pulse."""
        return self.fixed(self.last - self.first)

    def fixed(self, n: int) -> Fixed:
        """The floor of the instant of pulse n (0: the beginning)."""
        i, rows = self.first + n, self.rows
        if i == 0:
            return self.anchor
        row = bisect_left(rows.pulses_list, i) - 1
        ticks = int(rows.ticks_list[row]) + (i - rows.pulses_list[row]) * int(rows.periods[row])
        return self.anchor + ((ticks * self.tick.numerator) << FIXED_BITS) // self.tick.denominator

    def ns(self, n: int, start: Fixed) -> Ns:
        """The ns of pulse n in a train that starts at `start`."""
        return (start + self.fixed(n) + HALF_NS) >> FIXED_BITS

    def count_before(self, limit: Fixed) -> int:
        """How many pulses come before `limit`."""
        # the last whole tick that is truly before the limit
        ticks = ((limit - self.anchor) * self.tick.denominator - 1) // (self.tick.numerator << FIXED_BITS)
        i = self._pulses_by_tick(ticks)
        return min(i, self.last) - self.first if i > self.first else 0

    def _pulses_by_tick(self, ticks: int) -> int:
        rows = self.rows
        if ticks <= 0:
            return 0
        if ticks >= rows.ticks_list[-1]:
            return int(rows.pulses_list[-1])
        row = bisect_left(rows.ticks_list, ticks + 1) - 1
        return int(rows.pulses_list[row]) + (ticks - rows.ticks_list[row]) // int(rows.periods[row])

    def progress(self, instant: Fixed) -> tuple[float, float]:
        """(steps since the beginning, steps/s by the row in force)."""
        rows, tick = self.rows, self.tick
        if not len(rows.counts):
            return 0.0, 0.0
        elapsed = (instant - self.anchor) * tick.denominator
        unit = tick.numerator << FIXED_BITS
        row = min(bisect_left(rows.ticks_list, elapsed // unit + 1), len(rows.counts)) - 1
        period = int(rows.periods[row])
        inside = (elapsed - rows.ticks_list[row] * unit) / (period * unit)
        rate = SECOND * tick.denominator / (period * tick.numerator)
        return rows.pulses_list[row] - self.first + inside, rate

    def part(self, first: int, last: int | None) -> "Table":
        """The same table with only the pulses first + 1 .. last (None: all that follow)."""
        last = self.steps if last is None else last
        check_range(first, last, self.steps)
        return replace(self, first=self.first + first, last=self.first + last)

    def moved(self, by: Fixed) -> "Table":
        """The same segment, `by` later."""
        return replace(self, anchor=self.anchor + by)

    def fill(self, out: Int64Array, first: int, start: Fixed) -> None:
        """Write the ns of the pulses first .. first + len(out) - 1."""
        rows, anchor, done, i = self.rows, start + self.anchor, 0, self.first + first
        row = bisect_left(rows.pulses_list, i) - 1
        while done < len(out):
            stop = min(row + arrays.CHUNK // 8, len(rows.counts))
            block = min(len(out) - done, arrays.CHUNK, int(rows.pulses_list[stop]) - i + 1)
            self._fill_block(out[done : done + block], i, row, anchor)
            done, i = done + block, i + block
            row = bisect_left(rows.pulses_list, i) - 1

    def _fill_block(self, out: Int64Array, i: int, row: int, anchor: Fixed) -> None:
        """Write the ns of the pulses i .. i + len(out) - 1 of the whole table; `row` has pulse i."""
        rows, last = self.rows, i + len(out) - 1
        stop = bisect_left(rows.pulses_list, last)
        base = int(rows.ticks_list[row]) + (i - 1 - rows.pulses_list[row]) * int(rows.periods[row])
        counts = rows.counts[row:stop].copy()
        counts[0] = rows.pulses_list[row + 1] - i + 1
        counts[-1] -= rows.pulses_list[stop] - last
        ticks = np.repeat(rows.periods[row:stop], counts)
        np.cumsum(ticks, out=ticks)
        arrays.put_ticks(out, ticks, base, self.tick.numerator, self.tick.denominator, anchor)

    def times_of(self, n: Int64Array, start: Fixed) -> Int64Array:
        """The ns of the pulses `n` (1..steps each, any order)."""
        rows, i = self.rows, n + self.first
        row = np.searchsorted(rows.pulses, i) - 1
        ticks = (i - rows.pulses[row]) * rows.periods[row] + rows.ticks[row]
        out = np.empty(len(n), np.int64)
        arrays.put_ticks(out, ticks, 0, self.tick.numerator, self.tick.denominator, start + self.anchor)
        return out

    def counts_by(self, t: Int64Array, start: Fixed) -> Int64Array:
        """How many pulses have their ns at or before each of `t` (any order)."""
        rows = self.rows
        ticks = arrays.ticks_by(t, self.tick.numerator, self.tick.denominator, start + self.anchor)
        np.clip(ticks, 0, rows.ticks_list[-1], out=ticks)
        if not len(rows.counts):
            return np.zeros(len(t), np.int64)
        row = np.minimum(np.searchsorted(rows.ticks, ticks, side="right"), len(rows.counts)) - 1
        i = (ticks - rows.ticks[row]) // rows.periods[row] + rows.pulses[row]
        result: Int64Array = np.clip(i, self.first, self.last) - self.first
        return result
