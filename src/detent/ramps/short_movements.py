"""Movements too short for the whole table at its own first N, three ways; and how long each takes.

`hyperbola` and `exact` run the whole table from a larger first N, a slower member of the family of curves that the
table makes (the paper's figure 10). The paper computes that N by a hyperbola (figure 11), which must never be too
small, and is therefore often too large; the exact way takes the member whose movement is shortest. `free` cuts the
curve to the length instead: the first so many differences from the table's own first N, as a table compiled for
the length would have them. The paper's firmware cannot do that, "since under no circumstance may a ramp be changed
before it comes to an end".
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from detent.pulses.segment import Int64Array
from detent.ramps.differences import LARGEST_N, PAPER, Differences
from detent.ramps.table_movement import Movement, constant, ramped
from detent.ramps.ways import Way

NEVER = int(np.iinfo(np.int64).max)  # a movement that is not to be had
COARSE = 64  # first N's between two that are tried for the end of a family


class Ramp(NamedTuple):
    """A choice: the first N, and how many differences of the table; none means constant speed."""

    first: int
    entries: int


class Profiles(NamedTuple):
    """Some ramps at once, a column each: what is the same for a movement of any length. Read only.

    `up` is na and `up_clocks` the clock of the pulse behind it. The ramp down, from pulse nd to the end of the
    period that runs at its last load, takes `down` pulses and `down_clocks`; where nd = na it begins with the load
    that would be its first at the clock of the last load of the ramp up, and ends at `close_clocks`, `close` pulses
    behind na. Periods are clocks.
    """

    first: Int64Array
    entries: Int64Array
    up: Int64Array
    up_clocks: Int64Array
    down: Int64Array
    down_clocks: Int64Array
    close: Int64Array
    close_clocks: Int64Array
    top: Int64Array
    low: Int64Array

    def __deepcopy__(self, _: Any) -> "Profiles":
        return self

    def clocks(self, steps: int, offset: int) -> Int64Array:
        """The clock of the last pulse of a movement of `steps` with each; `NEVER` where two ramps do not fit.

        They fit if steps >= 2 na + offset, and if the table ends no later than the pulses.
        """
        spare = steps - 2 * self.up - offset  # nd - na
        left = self.up + offset  # behind nd
        far = self.up_clocks + (spare - 1) * self.top + self.down_clocks + (left - self.down) * self.low
        near = self.close_clocks + (left - self.close) * self.low
        result: Int64Array = np.where(spare > 0, far, near)
        result[(spare < 0) | (np.where(spare > 0, self.down, self.close) > left)] = NEVER
        result[self.entries == 0] = steps * int(self.low[0])
        return result


def profiles(table: Differences, ramps: Sequence[Ramp]) -> Profiles:
    """What `ramps` of a table come to; all of them have one first N, or one number of differences."""
    first, entries = (np.array(column, np.int64) for column in zip(*ramps, strict=True))
    taken = np.array(table.counts(0), np.int64)
    near = _Generators(first)
    for entry in range(1, int(entries.max()) + 1):
        near.load(entry * table.interval, first + taken[entry], entries >= entry)
    top, end = near.loaded.copy(), entries * table.interval
    up, up_clocks = near.pulses - (entries > 0), near.at.copy()
    far = _Generators(top)
    for i in range(int(entries.max())):
        n = first + taken[np.maximum(entries - 1 - i, 0)]
        far.load(i * table.interval, n, entries > i)
        near.load(end + i * table.interval, n, entries > i)
    return Profiles(first, entries, up, up_clocks, far.pulses, far.at, near.pulses - up, near.at, top + 1, first + 1)


class _Generators:
    """Rate generators side by side (see `RateGenerator`)."""

    def __init__(self, n: Int64Array) -> None:
        self.loaded, self.at, self.pulses = n.copy(), np.zeros_like(n), np.zeros_like(n)

    def load(self, clock: "Int64Array | int", n: Int64Array, chosen: npt.NDArray[np.bool_]) -> None:
        """At `clock` load `n` into the chosen ones."""
        period = self.loaded + 1
        runs = np.where(chosen & (self.at <= clock), (clock - self.at) // period + 1, 0)
        self.pulses += runs
        self.at += runs * period
        np.copyto(self.loaded, n, where=chosen)


@lru_cache(maxsize=32)
def family(table: Differences, entries: int) -> Profiles:
    """The members of the family of figure 10 with `entries` differences, by first N.

    From the table's own to the slowest that can be of use: one whose steps constant low speed does in less time.
    """
    idle = 2 * entries * table.interval // (table.first + 1)  # pulses at low speed in the time of two ramps
    coarse = range(table.first, LARGEST_N + 1, COARSE)
    slow = np.flatnonzero(2 * profiles(table, [Ramp(first, entries) for first in coarse]).up <= idle)
    last = coarse[int(slow[0])] if len(slow) else LARGEST_N
    return profiles(table, [Ramp(first, entries) for first in range(table.first, last + 1)])


@lru_cache(maxsize=32)
def cuts(table: Differences, entries: int) -> Profiles:
    """The table cut to its first 0, 1, ... up to `entries` differences."""
    return profiles(table, [Ramp(table.first, count) for count in range(entries + 1)])


class Hyperbola(NamedTuple):
    """N0 = least integer not below base + area / (m - shift), where m steps are to be had for each ramp (figure 11)."""

    base: int
    area: int
    shift: int

    def first(self, m: int) -> int:
        """The first N for ramps of at most `m` steps; `LARGEST_N` where the hyperbola has none."""
        if m <= self.shift:
            return LARGEST_N
        return min(self.base - (-self.area // (m - self.shift)), LARGEST_N)


PAPER_HYPERBOLA = Hyperbola(2870, 529_650, 10)


@lru_cache(maxsize=32)
def hyperbola(table: Differences) -> Hyperbola:
    """One that never cuts a ramp of `table`, whatever the length. For the paper's table it is a given one.

    For another the shift is 10 as well; of the bases from 0 to the table's first N, in 64 steps, the one is taken
    that gives the smallest N all in all, each with the least area that will do.
    """
    if table == PAPER:
        return PAPER_HYPERBOLA
    members = family(table, len(table.differences))
    # for ramps of m steps the first N must be one whose na is m at most: from each na on the least such N
    most = int(members.up[0])
    shift = 10
    least = max(int(members.up[-1]), shift + 1)
    needed = [(m, int(members.first[np.argmax(members.up <= m)])) for m in range(least, most + 1)]
    best: tuple[int, Hyperbola] | None = None
    for i in range(64):
        base = table.first * i // 64
        area = max(((n - base) * (m - shift) for m, n in needed), default=0)
        found = Hyperbola(base, max(area, 1), shift)
        total = sum(found.first(m) for m, _ in needed)
        if best is None or total < best[0]:
            best = total, found
    assert best is not None
    return best[1]


@lru_cache(maxsize=32)
def shortest(table: Differences, offset: int) -> int:
    """The least steps for which a member of the family beats constant low speed: below, the movement is very short."""
    members = family(table, len(table.differences))
    for steps in range(1, LARGEST_N):
        if int(members.clocks(steps, offset).min()) < steps * (table.first + 1):
            return steps
    return LARGEST_N


def choose(table: Differences, steps: int, offset: int, way: Way, entries: int) -> Ramp:
    """The ramps of a movement of `steps` with no more than `entries` differences, by `way`.

    A movement that has room for both of its ramps from the table's own first N gets them. A shorter one gets what
    `way` says, or constant low speed where that is no slower. With fewer entries than the table has (a speed
    limit) there is no hyperbola, and the exact way takes its place.
    """
    whole = Ramp(table.first, entries)
    if entries == 0 or int(_profile(table, whole).clocks(steps, offset)[0]) < NEVER:
        return whole
    if way is Way.HYPERBOLA and entries == len(table.differences):
        if steps < shortest(table, offset):
            return Ramp(table.first, 0)
        first = hyperbola(table).first((steps - offset) // 2)
        fits = np.flatnonzero(family(table, entries).clocks(steps, offset)[first - table.first :] < NEVER)
        if len(fits):  # the very first, but for an offset so small that its table would end too late
            return Ramp(first + int(fits[0]), entries)
    some = cuts(table, entries) if way is Way.FREE else family(table, entries)
    clocks = some.clocks(steps, offset)
    at = int(clocks.argmin())
    if int(clocks[at]) >= steps * (table.first + 1):
        return Ramp(table.first, 0)
    return Ramp(int(some.first[at]), int(some.entries[at]))


@lru_cache(maxsize=1024)
def _profile(table: Differences, ramp: Ramp) -> Profiles:
    return profiles(table, [ramp])


def movement(table: Differences, steps: int, offset: int, way: Way, entries: int) -> Movement:
    """The movement of `steps` that `choose` comes to."""
    ramp = choose(table, steps, offset, way, entries)
    if ramp.entries == 0:
        return constant(ramp.first, steps)
    return ramped(table, ramp.first, ramp.entries, steps, offset)
