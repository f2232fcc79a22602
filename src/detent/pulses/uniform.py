"""Constant speed: pulses one exact rational period apart."""

from dataclasses import dataclass, replace
from math import gcd

from detent.pulses.segment import Immutable, check_range
from detent.ticks import FIXED_BITS, HALF_NS, ONE_NS, Fixed, Ns

NS_PER_S = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Uniform(Immutable):
    """Pulse i of the law falls at anchor + i * numerator / denominator ns; kept are first < i <= last.

    `last` None: it never ends. A period that is known in `Fixed` only (an irrational speed) has the
    denominator 2**60: see :meth:`fixed_period`. ValueError for a period that is not positive.
    """

    anchor: Fixed
    numerator: int
    denominator: int
    last: int | None
    first: int = 0

    def __post_init__(self) -> None:
        if self.numerator <= 0 or self.denominator <= 0:
            raise ValueError(f"a period is positive, not {self.numerator}/{self.denominator} ns")
        check_range(self.first, self.last, None)
        common = gcd(self.numerator, self.denominator)
        if common > 1:
            object.__setattr__(self, "numerator", self.numerator // common)
            object.__setattr__(self, "denominator", self.denominator // common)

    @classmethod
    def at_rate(cls, anchor: Fixed, rate: int, steps: int | None) -> "Uniform":
        """`steps` pulses (None: endless) at `rate` steps/s, the first one period after `anchor`."""
        return cls(anchor, NS_PER_S, rate, steps)

    @classmethod
    def fixed_period(cls, anchor: Fixed, period: Fixed, steps: int | None) -> "Uniform":
        """`steps` pulses (None: endless), `period` apart, the first one period after `anchor`."""
        return cls(anchor, period, ONE_NS, steps)

    @property
    def steps(self) -> int | None:
        """How many pulses; None when it never ends."""
        return None if self.last is None else self.last - self.first

    @property
    def begin(self) -> Fixed:
        """One period before its first pulse (floor)."""
        return self.fixed(0)

    @property
    def end(self) -> Fixed | None:
        """The instant of its last pulse (floor)."""
        return None if self.last is None else self.fixed(self.last - self.first)

    def fixed(self, n: int) -> Fixed:
        """The floor of the instant of pulse n (0: the beginning)."""
        return self.anchor + (((self.first + n) * self.numerator) << FIXED_BITS) // self.denominator

    def ns(self, n: int, start: Fixed) -> Ns:
        """The ns of pulse n in a train that starts at `start`."""
        return (start + self.fixed(n) + HALF_NS) >> FIXED_BITS

    def count_before(self, limit: Fixed) -> int:
        """How many pulses come before `limit`."""
        # i * numerator / denominator < (limit - anchor) / 2**60, in integers
        i = ((limit - self.anchor) * self.denominator - 1) // (self.numerator << FIXED_BITS)
        if self.last is not None and i > self.last:
            i = self.last
        return i - self.first if i > self.first else 0

    def progress(self, instant: Fixed) -> tuple[float, float]:
        """(steps since the beginning, steps/s)."""
        elapsed = (instant - self.anchor) * self.denominator - ((self.first * self.numerator) << FIXED_BITS)
        return elapsed / (self.numerator << FIXED_BITS), NS_PER_S * self.denominator / self.numerator

    def part(self, first: int, last: int | None) -> "Uniform":
        """The same law with only the pulses first + 1 .. last (None: all that follow)."""
        check_range(first, self.steps if last is None else last, self.steps)
        return replace(self, first=self.first + first, last=self.last if last is None else self.first + last)

    def moved(self, by: Fixed) -> "Uniform":
        """The same segment, `by` later."""
        return replace(self, anchor=self.anchor + by)
