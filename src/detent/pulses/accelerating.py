"""Constant acceleration over steps: v**2 = s**2 + 2 a x, x steps from the slow end.

The time of a pulse needs one square root: t(x) = (sqrt(s**2 + 2 a x) - s) / a. With s and 2a rational this
is (sqrt(P x + Q**2) - Q) / D in units of 2**-60 ns, P, Q, D integers, so that its floor and its ceiling are
one integer root away, and the inverse needs no root at all.
"""

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from math import floor, isqrt, sqrt
from operator import attrgetter

from detent.pulses.segment import GUARD, Immutable, check_range
from detent.ticks import FIXED_BITS, HALF_NS, ONE_NS, SECOND, Fixed, Ns

FIXED_PER_S: Fixed = SECOND * ONE_NS
BELOW_NS: Fixed = ONE_NS - 1
NS_PER_FIXED = 2.0**-FIXED_BITS
TINY = 1e-300  # ns: instead of a standstill's 0, where the quotient is 0 / 0


@dataclass(frozen=True, slots=True)
class Accelerating(Immutable):
    """Between `low` and `high` steps from the slow end, where the speed is `slow` steps/s.

    `gain` is 2a: what each step adds to the square of the speed, (steps/s)**2. `up`: it speeds up from the
    instant `anchor` at the slow end, with pulses at x = low + 1 .. high. Not `up`: it slows down to reach the
    slow end at `anchor`, with pulses at x = high - 1 .. low. ValueError unless slow >= 0, gain > 0.
    """

    anchor: Fixed
    slow: Fraction | int
    gain: Fraction | int
    low: int
    high: int
    up: bool = True
    root_gain: int = field(init=False, repr=False, compare=False)  # P
    slow_root: int = field(init=False, repr=False, compare=False)  # Q
    divisor: int = field(init=False, repr=False, compare=False)  # D
    # the same as floats, in ns: t(x) = sqrt(gain_ns * x + slow_ns**2) - slow_ns
    gain_ns: float = field(init=False, repr=False, compare=False)
    slow_ns: float = field(init=False, repr=False, compare=False)
    square_ns: float = field(init=False, repr=False, compare=False)  # slow_ns**2
    # the instants `low` (up) or `high` (down) steps from the slow end, and of the last pulse (floors)
    begin: Fixed = field(init=False, repr=False, compare=False)
    end: Fixed = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.slow < 0 or self.gain <= 0:
            raise ValueError(f"a ramp has a slow speed >= 0 and a gain > 0, not {self.slow} and {self.gain}")
        if not 0 <= self.low <= self.high:
            raise ValueError(f"a ramp has 0 <= low <= high, not {self.low} and {self.high}")
        slow, gain = self.slow, self.gain
        made = _constants(slow.numerator, slow.denominator, gain.numerator, gain.denominator)
        for put, value in zip(_PUT_DERIVED, made, strict=True):
            put(self, value)
        _PUT_BEGIN(self, self.fixed(0))
        _PUT_END(self, self.fixed(self.high - self.low))

    @classmethod
    def down_from(cls, begin: Fixed, slow: Fraction | int, gain: Fraction | int, steps: int) -> "Accelerating":
        """The ramp down of `steps` pulses to the speed `slow` that comes into force at the instant `begin`.

        The anchor is rounded up, so that the floor of the first instant is `begin` itself.
        """
        p, q, d, *_ = _constants(slow.numerator, slow.denominator, gain.numerator, gain.denominator)
        root = isqrt(p * steps + q * q - 1) + 1 if steps else q
        return cls(begin - (q - root) // d, slow, gain, 0, steps, up=False)

    @property
    def steps(self) -> int:
        """How many pulses."""
        return self.high - self.low

    def fixed(self, n: int) -> Fixed:
        """The floor of the instant of pulse n (0: the beginning)."""
        slow_root = self.slow_root
        if self.up:
            root = isqrt(self.root_gain * (self.low + n) + slow_root * slow_root)
            return self.anchor + (root - slow_root) // self.divisor
        # floor(-y) = -ceil(y): the root upwards
        root = isqrt(self.root_gain * (self.high - n) + slow_root * slow_root - 1) + 1 if self.high > n else slow_root
        return self.anchor + (slow_root - root) // self.divisor

    def ns(self, n: int, start: Fixed) -> Ns:
        """The ns of pulse n in a train that starts at `start`: by float64 unless that comes close to a tie."""
        base = start + self.anchor + HALF_NS
        slow, up = self.slow_ns, self.up
        square = self.gain_ns * (self.low + n if up else self.high - n)
        away = square / (sqrt(square + self.square_ns) + slow)
        estimate = (base & BELOW_NS) * NS_PER_FIXED + (away if up else -away)
        whole = floor(estimate)
        guard = GUARD * (away + 2.0)
        if guard < estimate - whole < 1.0 - guard:
            return (base >> FIXED_BITS) + whole
        return (start + self.fixed(n) + HALF_NS) >> FIXED_BITS

    def count_before(self, limit: Fixed) -> int:
        """How many pulses come before `limit`: by float64 unless one comes close to it."""
        away = (limit - self.anchor) * NS_PER_FIXED
        if not self.up:
            away = -away
        if away <= 0.0:
            return 0 if self.up else self._count_before(limit)
        x = away * (away + 2.0 * self.slow_ns) / self.gain_ns
        whole = int(x)
        guard = GUARD * (x + 1.0)
        if not guard < x - whole < 1.0 - guard:
            return self._count_before(limit)
        if self.up:
            return min(whole, self.high) - self.low if whole > self.low else 0
        whole += 1
        return self.high - max(whole, self.low) if whole < self.high else 0

    def _count_before(self, limit: Fixed) -> int:
        # (sqrt(P x + Q**2) - Q) / D < y  is  P x < y D (y D + 2 Q)  for y > 0
        y = (limit - self.anchor) * self.divisor
        if self.up:
            if y <= 0:
                return 0
            x = (y * (y + 2 * self.slow_root) - 1) // self.root_gain
            return min(x, self.high) - self.low if x > self.low else 0
        if y > 0:
            return self.high - self.low
        x = y * (y - 2 * self.slow_root) // self.root_gain + 1
        return self.high - max(x, self.low) if x < self.high else 0

    def progress(self, instant: Fixed) -> tuple[float, float]:
        """(steps since the beginning, steps/s)."""
        away = abs(instant - self.anchor) * NS_PER_FIXED
        x = away * (away + 2.0 * self.slow_ns) / self.gain_ns
        rate = 2e9 * (away + self.slow_ns) / self.gain_ns
        return (x - self.low if self.up else self.high - x), rate

    def part(self, first: int, last: int | None) -> "Accelerating":
        """The same law with only the pulses first + 1 .. last (None: all that follow)."""
        last = self.steps if last is None else last
        check_range(first, last, self.steps)
        if self.up:
            return replace(self, low=self.low + first, high=self.low + last)
        return replace(self, low=self.high - last, high=self.high - first)

    def moved(self, by: Fixed) -> "Accelerating":
        """The same segment, `by` later."""
        moved: Accelerating = object.__new__(Accelerating)
        for get, put in _COPIED:
            put(moved, get(self))
        _PUT_ANCHOR(moved, self.anchor + by)
        _PUT_BEGIN(moved, self.begin + by)
        _PUT_END(moved, self.end + by)
        return moved


_DERIVED = ("root_gain", "slow_root", "divisor", "gain_ns", "slow_ns", "square_ns")
_SLOTS = vars(Accelerating)
_PUT_DERIVED = tuple(_SLOTS[name].__set__ for name in _DERIVED)
_PUT_ANCHOR, _PUT_BEGIN, _PUT_END = (_SLOTS[name].__set__ for name in ("anchor", "begin", "end"))
_COPIED = tuple((attrgetter(name), _SLOTS[name].__set__) for name in ("slow", "gain", "low", "high", "up", *_DERIVED))


@lru_cache(maxsize=256)
def _constants(s: int, r: int, p: int, q: int) -> tuple[int, int, int, float, float, float]:
    """The derived fields of a ramp with slow speed s/r and gain p/q; the few ramps of a program come again."""
    twice, divisor = 2 * FIXED_PER_S * q, p * r
    root_gain, slow_root = twice * twice * p * r * r // q, twice * s
    scale = divisor << FIXED_BITS
    slow_ns = max(slow_root / scale, TINY)
    return root_gain, slow_root, divisor, root_gain / (scale * scale), slow_ns, slow_ns**2
