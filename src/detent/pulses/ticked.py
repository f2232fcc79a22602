"""A position accumulator on a fixed tick, its speed changing by the same amount each tick.

On every tick the speed grows by `change`, the position by the speed; a pulse falls on the tick where the
position reaches the next multiple of `unit`. All are integers, so the position after k ticks is exactly
phase + k * speed + change * k * (k + 1) / 2, and the tick of a pulse is one integer square root away.
"""

from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import isqrt

from detent.pulses.segment import Immutable, check_range
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
