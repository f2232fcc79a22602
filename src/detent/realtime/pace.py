"""The wall clock and the cell's clock: one maps to the other, and how late the cell was is counted.

The map is one fraction from one origin, in integers: nothing is added up, so a day of serving is as exact as
its first millisecond. `WallNs` are nanoseconds of a monotonic clock.
"""

import math
import time
from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple, TypeAlias

from detent.ticks import NEVER, Ns

WallNs: TypeAlias = int
Clock: TypeAlias = Callable[[], WallNs]

SLOWEST, FASTEST = Fraction(1, 10**9), 10**9  # of paces: a second in 30 years, and the other way round
LATEST: Ns = NEVER >> 1  # where the time of a cell stands, however fast it went: everything due is before NEVER

_STEPS = 16  # classes of lateness in each doubling: a percentile is at most 1/16 too high
_LARGEST = 1 << 40  # 18 minutes; later than that is counted as that, `most` still tells the truth


class Pace:
    """Cell time runs `factor` times as fast as the clock, from `origin` at the moment this is made.

    It can be `held`: then the cell time stands. It can be `free`: then a cell does what it has to do as fast as it
    can, and its time stands while it has nothing to do. `factor` is the one that counts when it is neither.
    """

    def __init__(self, factor: Fraction | float = 1, *, origin: Ns = 0, clock: Clock = time.monotonic_ns) -> None:
        check_pace(factor)
        self.clock = clock
        self.held = False
        self.free = False
        self.lateness = Lateness()
        self._origin = origin
        self._began: WallNs = clock()
        self._set(factor)

    def _set(self, factor: Fraction | float) -> None:
        # the decimal that was written, not its binary neighbour: 0.1 is one tenth
        self.factor = exact = factor if isinstance(factor, Fraction) else Fraction(repr(factor))
        self._multiply, self._divide = exact.numerator, exact.denominator

    def restart(self, origin: Ns) -> None:
        """The cell time is `origin` now."""
        self._origin, self._began = origin, self.clock()

    def hold(self, now: Ns) -> None:
        """The cell time stands at `now` until `go`."""
        self.held = True
        self.restart(now)

    def go(self, now: Ns) -> None:
        """The cell time goes on from `now`."""
        self.held = False
        self.restart(now)

    def change(self, factor: Fraction | float | None, now: Ns) -> None:
        """From the cell time `now` on it runs at `factor`; None: free. Raises ValueError."""
        if factor is not None:
            check_pace(factor)
            self._set(factor)
        self.free = factor is None
        self.restart(now)

    def at(self, wall: WallNs) -> Ns:
        """The cell time at `wall`; without an end if it is free."""
        if self.held:
            return self._origin
        if self.free:
            return NEVER
        return min(self._origin + (wall - self._began) * self._multiply // self._divide, LATEST)

    def due(self, at: Ns) -> WallNs | None:
        """The first wall time at which the cell time is at least `at`; None: not before it is told to go on."""
        if self.free:
            return None if self.held else self._began
        if self.held and at > self._origin:
            return None
        return self._began - (self._origin - at) * self._divide // self._multiply


def check_pace(factor: Fraction | float) -> None:
    """ValueError for what is no pace, or out of reach."""
    if not 0 < factor < math.inf:
        raise ValueError(f"{factor} is no pace; it takes a number above 0, 1 is real time")
    if not SLOWEST <= factor <= FASTEST:
        raise ValueError(
            f"pace {float(factor):g} is out of reach; it takes {float(SLOWEST):g} to {float(FASTEST):g}, 1 is real time"
        )


class LatenessSummary(NamedTuple):
    """How late deadlines were served, in nanoseconds of the wall clock."""

    deadlines: int
    p50: WallNs
    p99: WallNs
    most: WallNs

    def __str__(self) -> str:
        """One line for people."""
        if not self.deadlines:
            return "no deadlines"
        p50, p99, most = (f"{value / 1e6:.3f}" for value in self[1:])
        return f"{self.deadlines} deadlines, late by {p50} ms (half of them), {p99} ms (99 %), {most} ms (all)"


class Lateness:
    """Counts by class of lateness; takes the same room however long it counts."""

    __slots__ = ("_classes", "count", "most")

    def __init__(self) -> None:
        self.count = 0
        self.most: WallNs = 0
        self._classes = [0] * (_class_of(_LARGEST) + 1)

    def note(self, late: WallNs) -> None:
        """A deadline was served `late` after it was due."""
        self.count += 1
        if late > self.most:
            self.most = late
        self._classes[_class_of(min(max(late, 0), _LARGEST))] += 1

    def percentile(self, percent: int) -> WallNs:
        """So many percent of the deadlines were at most this late (up to 1/16 too high, never too low)."""
        wanted = -(-self.count * percent // 100)
        counted = 0
        for index, number in enumerate(self._classes):
            counted += number
            if counted >= wanted:
                return min(_highest_of(index), self.most)
        return self.most

    def summary(self) -> LatenessSummary:
        """Everything counted so far."""
        return LatenessSummary(self.count, self.percentile(50), self.percentile(99), self.most)


def _class_of(late: WallNs) -> int:
    """The class of a lateness: exact below 16 ns, then 16 classes for each doubling."""
    shift = max(late.bit_length() - 5, 0)
    return _STEPS * shift + (late >> shift)


def _highest_of(index: int) -> WallNs:
    """The largest lateness of a class."""
    shift = max(index // _STEPS - 1, 0)
    return ((index - _STEPS * shift + 1) << shift) - 1
