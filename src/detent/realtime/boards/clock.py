"""A board's clock, estimated from round trips: which tick it is at a wall time.

Asked at `sent`, answered at `received`, the board read its clock somewhere between. Slow round trips say little; a
straight line through the quicker half of the last ones, old and new alike, says where the clock stands and how fast it
runs. Until two seconds have been seen its nominal frequency counts. 32 bits come back; they are extended to the nearest
whole count.

Two clocks may part: that of a process that is kept from running stands, or that of a host that is suspended. What was
seen before then says nothing any more. So each round trip is held against the one before: a crystal makes so many ticks
from one to the other, as far as they tell. One that does not fit is put aside, as it may be its own times that are
wrong; if the next one does not fit either, the estimate begins anew with that.
"""

from collections import deque
from math import ceil, floor
from typing import NamedTuple

from detent.realtime.pace import WallNs
from detent.ticks import SECOND, US, Ns

KEPT = 32  # round trips
GROUP = 4
SEEN: WallNs = 2 * SECOND  # from which on the slope is measured
APART: WallNs = 500 * US  # what two round trips may differ by beyond what their lengths say
UNMEASURED = 100  # by a hundredth of its frequency may a board run faster or slower, as far as that is not known
MEASURED = 2000  # and by so much less, behind that
WRAP = 1 << 32


class _Trip(NamedTuple):
    middle: WallNs
    length: WallNs
    tick: int


class Clock:
    """The estimate for one board. `frequency` is nominal: what the board calls a second."""

    def __init__(self, frequency: int) -> None:
        self.frequency = frequency
        self.trips: deque[_Trip] = deque(maxlen=KEPT)
        self.reached = -(1 << 62)  # the latest tick that the board itself has told: what was due by then is done
        self._wall: WallNs = 0  # the line: `_tick` at `_wall`, `_rate` ticks an ns
        self._tick = 0.0
        self._whole = 0  # ticks, apart from the fraction: floats keep 2**-20 of a tick so
        self._rate = frequency / SECOND
        self._measured = False  # the rate was, and is not what the board says
        self._doubted = False  # the last round trip did not fit
        self._told: Ns = 0

    @property
    def known(self) -> bool:
        """Whether any round trip was seen."""
        return bool(self.trips)

    @property
    def measured(self) -> float:
        """Its ticks in a second of the host."""
        return self._rate * SECOND

    def extend(self, low: int, wall: WallNs) -> int:
        """What a board says its clock is at, around `wall`, as a whole count; 32 bits of it came.

        The nearest to the estimate, but never before what the board said last: an estimate may be off by more than half
        of the 32 bits (4 s at 520 MHz), and a clock that went back would have the cell stand until it is there again.
        """
        tick = nearest(low, self.tick_at(wall))
        return max(tick, self.reached + (tick - self.reached) % WRAP)

    def note(self, tick: int, sent: WallNs, received: WallNs) -> bool:
        """A round trip; `tick` is a whole count. False: it does not fit, and is put aside until the next does not."""
        self.reached = max(self.reached, tick)
        trip = _Trip((sent + received) // 2, received - sent, tick)
        if self.trips and not self._fits(trip):
            self._doubted = not self._doubted
            if self._doubted:
                return False
            self.trips.clear()
            self._rate, self._measured = self.frequency / SECOND, False
        self._doubted = False
        self.trips.append(trip)
        self._draw()
        return True

    def _fits(self, trip: _Trip) -> bool:
        """Whether a clock that was where the last round trip found it can be where this one does."""
        last = self.trips[-1]
        span = trip.middle - last.middle
        slack = (trip.length + last.length) // 2 + APART + abs(span) // (MEASURED if self._measured else UNMEASURED)
        return abs((trip.tick - last.tick) / self._rate - span) <= slack

    def _draw(self) -> None:
        """The line through what was seen."""
        # the quicker half of every few that follow each other: old ones and new ones alike
        trips = list(self.trips)
        groups = [sorted(trips[i : i + GROUP], key=lambda trip: trip.length) for i in range(0, len(trips), GROUP)]
        slow = 2 * sorted(trip.length for trip in trips)[len(trips) // 2]
        quick = [trip for group in groups for trip in group[: -(-len(group) // 2)] if trip.length <= slow]
        zero = quick[-1]
        self._wall, self._whole = zero.middle, zero.tick
        n = len(quick)
        walls = [trip.middle - zero.middle for trip in quick]
        ticks = [trip.tick - zero.tick for trip in quick]
        if max(walls) - min(walls) >= SEEN:
            mean_wall, mean_tick = sum(walls) / n, sum(ticks) / n
            over = sum((w - mean_wall) ** 2 for w in walls)
            self._rate = sum((w - mean_wall) * (t - mean_tick) for w, t in zip(walls, ticks, strict=True)) / over
            self._tick = mean_tick - self._rate * mean_wall
            self._measured = True
        else:
            self._tick = sum(t - self._rate * w for w, t in zip(walls, ticks, strict=True)) / n

    def tick_at(self, wall: WallNs) -> int:
        """The tick at `wall`, as far as is known now."""
        return self._whole + floor(self._tick + self._rate * (wall - self._wall))

    def wall_at(self, tick: int) -> WallNs:
        """The wall time of a tick."""
        return self._wall + floor((tick - self._whole - self._tick) / self._rate)

    def ns_at(self, wall: WallNs) -> Ns:
        """The board's own nanoseconds at `wall`: they never go back, whatever is learnt."""
        self._told = max(self._told, self.tick_at(wall) * SECOND // self.frequency)
        return self._told

    def wall_at_ns(self, ns: Ns) -> WallNs:
        """The first wall time at which `ns_at` is `ns` or more, as far as is known now."""
        tick = -(-ns * self.frequency // SECOND)
        wall = self._wall + ceil((tick - self._whole - self._tick) / self._rate)
        while self.tick_at(wall) < tick:  # a float was rounded
            wall += 1
        return wall


def nearest(low: int, near: int) -> int:
    """The number with the low 32 bits of `low` that is nearest to `near`."""
    return near + ((low - near + (WRAP >> 1)) % WRAP) - (WRAP >> 1)
