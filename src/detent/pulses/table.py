"""Pulses from a table: rows of so many pulses, each so many whole ticks of a clock apart."""

from bisect import bisect_left
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING

from detent.pulses.segment import Immutable, check_range
from detent.ticks import FIXED_BITS, HALF_NS, SECOND, Fixed, Ns

if TYPE_CHECKING:
    import numpy.typing as npt

    from detent.pulses.rows import Rows


@dataclass(frozen=True, slots=True)
class Table(Immutable):
    """Row after row from `anchor`: counts[i] pulses, each periods[i] ticks of `tick` ns after the one before.

    Of its pulses first < i <= last are kept (None: all). ValueError for a tick that is not positive.
    """

    anchor: Fixed
    tick: Fraction | int
    rows: "Rows"
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
    def of(cls, anchor: Fixed, tick: Fraction | int, counts: "npt.ArrayLike", periods: "npt.ArrayLike") -> "Table":
        """The table with these columns (sequences or integer arrays; see :class:`~detent.pulses.rows.Rows`)."""
        from detent.pulses.rows import Rows

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
