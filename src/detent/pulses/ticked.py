"""A position accumulator on a fixed tick, its speed changing by the same amount each tick.

On every tick the speed grows by `change`, the position by the speed; a pulse falls on the tick where the
position reaches the next multiple of `unit`. All are integers, so the position after k ticks is exactly
phase + k * speed + change * k * (k + 1) / 2, and the tick of a pulse is one integer square root away.
"""

from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import isqrt

import numpy as np

from detent.pulses import arrays
from detent.pulses.segment import Immutable, Int64Array, check_range
from detent.ticks import FIXED_BITS, HALF_NS, SECOND, Fixed, Ns


@dataclass(frozen=True, slots=True)
class Ticked(Immutable):
    """`ticks` ticks of `tick` ns from `anchor` (tick k at anchor + k * tick, k = 1 .. ticks).

    `unit` is one step of the accumulator, `phase` (0 <= phase < unit) its fraction at the anchor, `speed`
    what was last added to it, `change` what is added to the speed before each addition. The number of pulses
    follows; first < i <= last of them are kept (last None: all, and the ticks after them too).

    The speed keeps within 0 .. unit: at most one pulse a tick, in one direction. For the other direction
    negate the accumulator. ValueError otherwise, naming the speed at fault.
    """

    anchor: Fixed
    tick: Fraction | int
    ticks: int
    unit: int
    phase: int
    speed: int
    change: int = 0
    first: int = 0
    last: int | None = None
    total: int = field(init=False, repr=False, compare=False)  # pulses of the whole law

    def __post_init__(self) -> None:
        if self.tick <= 0 or self.ticks < 0:
            raise ValueError(f"a ticked segment has a tick > 0 ns and ticks >= 0, not {self.tick} and {self.ticks}")
        if not 0 <= self.phase < self.unit:
            raise ValueError(f"the phase is within 0 .. unit - 1, not {self.phase} of {self.unit}")
        for speed in (self.speed, self.speed + self.change * self.ticks):
            if not 0 <= speed <= self.unit:
                raise ValueError(f"the speed keeps within 0 .. unit ({self.unit}) a tick, not {speed}: "
                                 "limit it, or split where it turns")  # fmt: skip
        object.__setattr__(self, "total", self.position(self.ticks) // self.unit)
        check_range(self.first, self.last if self.last is not None else self.total, self.total)

    def position(self, k: int) -> int:
        """The accumulator after k ticks, counted on from `phase`."""
        return self.phase + k * self.speed + self.change * (k * (k + 1) // 2)

    @property
    def steps(self) -> int:
        """How many pulses."""
        return (self.total if self.last is None else self.last) - self.first

    @property
    def begin(self) -> Fixed:
        """The anchor, or the instant of the pulse before its first."""
        return self.fixed(0)

    @property
    def end(self) -> Fixed:
        """The instant of its last tick, or of its last pulse when pulses after that are left out."""
        return self.instant(self.ticks) if self.last is None else self.fixed(self.last - self.first)

    def instant(self, k: int) -> Fixed:
        """The floor of the instant of tick k."""
        return self.anchor + ((k * self.tick.numerator) << FIXED_BITS) // self.tick.denominator

    def tick_of(self, i: int) -> int:
        """The tick on which pulse i of the whole law falls (0: none yet)."""
        if i == 0:
            return 0
        wanted, change = i * self.unit - self.phase, self.change
        if change == 0:
            return -(-wanted // self.speed)
        slope = 2 * self.speed + change
        square = slope * slope + 8 * change * wanted
        if change > 0:  # smallest k with 2 * change * k + slope >= sqrt(square)
            return -((slope - 1 - isqrt(square - 1)) // (2 * change))
        # smallest k with slope + 2 * change * k <= sqrt(square)
        return -((slope - isqrt(square)) // (2 * change))

    def fixed(self, n: int) -> Fixed:
        """The floor of the instant of pulse n (0: the beginning)."""
        return self.instant(self.tick_of(self.first + n))

    def ns(self, n: int, start: Fixed) -> Ns:
        """The ns of pulse n in a train that starts at `start`."""
        return (start + self.fixed(n) + HALF_NS) >> FIXED_BITS

    def count_before(self, limit: Fixed) -> int:
        """How many pulses come before `limit`."""
        k = ((limit - self.anchor) * self.tick.denominator - 1) // (self.tick.numerator << FIXED_BITS)
        if k <= 0:
            return 0
        i = self.position(min(k, self.ticks)) // self.unit
        last = self.total if self.last is None else self.last
        return min(i, last) - self.first if i > self.first else 0

    def progress(self, instant: Fixed) -> tuple[float, float]:
        """(steps since the beginning, steps/s): what the accumulator and the speed were at the last tick."""
        k = (instant - self.anchor) * self.tick.denominator // (self.tick.numerator << FIXED_BITS)
        k = min(max(k, 0), self.ticks)
        rate = (self.speed + self.change * k) * SECOND * self.tick.denominator / (self.unit * self.tick.numerator)
        return (self.position(k) - self.first * self.unit) / self.unit, rate

    def part(self, first: int, last: int | None) -> "Ticked":
        """The same law with only the pulses first + 1 .. last (None: also the ticks after the last)."""
        check_range(first, self.steps if last is None else last, self.steps)
        return replace(self, first=self.first + first, last=self.last if last is None else self.first + last)

    def moved(self, by: Fixed) -> "Ticked":
        """The same segment, `by` later."""
        return replace(self, anchor=self.anchor + by)

    def fill(self, out: Int64Array, first: int, start: Fixed) -> None:
        """Write the ns of the pulses first .. first + len(out) - 1."""
        done, i = 0, self.first + first
        while done < len(out):
            block = min(len(out) - done, arrays.CHUNK)
            out[done : done + block] = self._times(np.arange(i, i + block, dtype=np.int64), start)
            done, i = done + block, i + block

    def times_of(self, n: Int64Array, start: Fixed) -> Int64Array:
        """The ns of the pulses `n` (1..steps each, any order)."""
        return self._times(n + self.first, start)

    def _times(self, i: Int64Array, start: Fixed) -> Int64Array:
        """The ns of the pulses `i` of the whole law."""
        out = np.empty(len(i), np.int64)
        arrays.put_ticks(out, self._ticks_of(i), 0, self.tick.numerator, self.tick.denominator, start + self.anchor)
        return out

    def _ticks_of(self, i: Int64Array) -> Int64Array:
        """`tick_of` for many: a float64 guess, proved in integers and stepped or looked up where it is wrong."""
        if not self._fits():
            return np.fromiter((self.tick_of(n) for n in i.tolist()), np.int64, len(i))
        wanted = i * float(self.unit) - self.phase
        slope = float(2 * self.speed + self.change)
        root = np.sqrt(np.maximum(slope * slope + (8.0 * self.change) * wanted, 0.0))
        k: Int64Array = np.ceil(4.0 * wanted / (slope + root)).astype(np.int64)
        over = self._excess(k, i)  # 0 <= over < speed on tick k, for the right k
        k += over < 0
        k -= over >= self.speed + self.change * k
        over = self._excess(k, i)
        for at in np.flatnonzero((over < 0) | (over >= self.speed + self.change * k)):
            k[at] = self.tick_of(int(i[at]))
        return k

    def counts_by(self, t: Int64Array, start: Fixed) -> Int64Array:
        """How many pulses have their ns at or before each of `t` (any order)."""
        k = arrays.ticks_by(t, self.tick.numerator, self.tick.denominator, start + self.anchor)
        np.clip(k, 0, self.ticks, out=k)
        if self._fits():
            x = k.astype(np.float64)
            i = ((self.phase + x * self.speed + (0.5 * self.change) * x * (x + 1.0)) / self.unit).astype(np.int64)
            i += self._excess(k, i) // self.unit
        else:
            i = np.fromiter((self.position(n) // self.unit for n in k.tolist()), np.int64, len(k))
        last = self.total if self.last is None else self.last
        result: Int64Array = np.clip(i, self.first, last) - self.first
        return result

    def rates_by(self, t: Int64Array, start: Fixed) -> Int64Array:
        """The whole steps/s after the last tick that has its ns at or before each of `t` (any order)."""
        k = arrays.ticks_by(t, self.tick.numerator, self.tick.denominator, start + self.anchor)
        np.clip(k, 0, self.ticks, out=k)
        scale = Fraction(SECOND, self.unit) / self.tick
        speeds = self.speed + self.change * k
        if self.unit * scale.numerator < 1 << 62:
            rates: Int64Array = speeds * scale.numerator // scale.denominator
            return rates
        return np.array([speed * scale.numerator // scale.denominator for speed in speeds.tolist()], np.int64)

    def _fits(self) -> bool:
        """Whether `_excess` is exact: guesses are good to 2**-22 of the ticks, and differences stay small."""
        return self.unit * ((self.ticks >> 22) + 4) < 1 << 61

    def _excess(self, k: Int64Array, i: Int64Array) -> Int64Array:
        """The accumulator after k ticks less i units, modulo 2**64: right when it is small, as it is near i."""
        triangle = ((k + 1) >> 1) * (k | 1)  # k (k + 1) / 2
        excess: Int64Array = k * self.speed + self.phase + triangle * self.change - i * self.unit
        return excess
