"""GenStepper's law: speed and position accumulate on a tick of 16 us (BS0610 manual, pages 20, 31, 32).

On every tick the speed changes by P / 62 500 microsteps/s (or not), then the position grows by speed / 62 500; a
step falls on the tick on which the whole part of the position changes. In integers: speeds in 1 / 62 500
microsteps/s, so that P is what a tick adds, and the position in 1 / 62 500**2 of a microstep. Distances count in the
direction of the motion.

A motion is one `Ticked` segment a phase: a ramp of a thousand million steps costs what one of ten costs.
"""

from bisect import bisect_left
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

from detent.pulses import Ticked, Train
from detent.ticks import SECOND, Fixed, Ns, to_fixed

UPDATES = 62_500  # ticks a second, and the highest rate
TICK: Ns = SECOND // UPDATES
UNIT = UPDATES * UPDATES  # of the position accumulator: one microstep


class Point(NamedTuple):
    """The accumulators after a tick: whole steps, what is left of the next (0 .. UNIT - 1), the speed."""

    steps: int
    phase: int
    speed: int  # in 1 / 62 500 microsteps/s

    @property
    def rate(self) -> int:
        """The speed in whole microsteps/s."""
        return self.speed // UPDATES


class Plan(NamedTuple):
    """A motion from tick 0 on, its phases as segments of a train that starts at 0.

    It is over after tick `ticks`. `rises` is the last tick that may speed up, `falls` the last tick before the
    speed falls for the stop (`ticks` where it never does).
    """

    train: Train
    begin: Point
    begins: tuple[int, ...]  # the tick behind which each segment begins
    ticks: int
    rises: int
    falls: int

    @property
    def steps(self) -> int:
        """How many steps."""
        steps = self.train.steps
        assert steps is not None
        return steps

    def point(self, tick: int) -> Point:
        """The accumulators after `tick` ticks."""
        tick = min(tick, self.ticks)
        if tick <= 0:
            return self.begin
        index = bisect_left(self.begins, tick) - 1
        segment = self.train.segments[index]
        assert isinstance(segment, Ticked)
        local = tick - self.begins[index]
        before = sum(part.steps or 0 for part in self.train.segments[:index])
        steps, phase = divmod(segment.position(local), UNIT)
        return Point(before + steps, phase, segment.speed + segment.change * local)


class _Phases:
    """Phases one after the other, up to `goal` steps at most."""

    def __init__(self, phase: int, speed: int, goal: int | None) -> None:
        self.begin = Point(0, phase, speed)
        self.segments: list[Ticked] = []
        self.begins: list[int] = []
        self.ticks = 0
        self.phase, self.speed = phase, speed
        self.left = goal  # steps
        self.done = goal is not None and goal <= 0

    def add(self, ticks: int, speed: int, change: int = 0) -> None:
        """`ticks` ticks that each add `change` to the speed, which begins at `speed`."""
        if ticks <= 0 or self.done:
            return
        segment = Ticked(_instant(self.ticks), TICK, ticks, UNIT, self.phase, speed, change)
        if self.left is not None and segment.total >= self.left:
            ticks, self.done = segment.tick_of(self.left), True
            segment = Ticked(_instant(self.ticks), TICK, ticks, UNIT, self.phase, speed, change)
        self.begins.append(self.ticks)
        self.segments.append(segment)
        self.ticks += ticks
        self.phase = segment.position(ticks) % UNIT
        self.speed = speed + change * ticks
        if self.left is not None:
            self.left -= segment.total

    def finish(self, speed: int) -> None:
        """Go on at `speed` up to the goal."""
        if self.left is None or self.done:
            return
        self.add(-((self.phase - self.left * UNIT) // speed), speed)

    def ramp(self, speed: int, slope: int) -> None:
        """Whole ticks of `slope` towards `speed`. The tick that would overshoot belongs to what follows."""
        change = slope if speed > self.speed else -slope
        self.add(abs(speed - self.speed) // slope, self.speed, change)

    def plan(self, rises: int, falls: int) -> Plan:
        """All of it."""
        train = Train(self.segments)
        return Plan(train, self.begin, tuple(self.begins), self.ticks, min(rises, self.ticks), min(falls, self.ticks))


def _instant(tick: int) -> Fixed:
    return to_fixed(tick * TICK)


@lru_cache(maxsize=1024)
def toward(
    steps: int, phase: int, speed: int, run: int, slope: int, keep: int, braking_slope: int, *, braking: bool = False
) -> Plan:
    """To the step number `steps` from accumulators `phase` and `speed`, at `run` once the ramps allow it.

    Rates and slopes are in microsteps/s (/s). On each tick the distance that is left is compared with
    (v**2 - keep**2) / (2 * braking_slope); from the tick on which it is no longer greater (`braking`: from the
    start) the speed falls by `slope`, not below `keep`. It ends on the tick of the last step, whatever the
    speed then is. A speed that is not below `run` at the start stays as it is.
    """
    phases = _Phases(phase, speed, steps)
    kept, wanted = keep * UPDATES, max(run * UPDATES, speed)
    rises = falls = -1
    if not braking:
        least = 2 * braking_slope
        enough = least * steps * UNIT + kept * kept  # it brakes once least * position + speed**2 has reached this

        def brakes_after(tick: int) -> bool:
            """Whether the comparison after so many ticks of the up ramp finds the distance too short."""
            position = phase + tick * speed + slope * (tick * (tick + 1) // 2)
            return least * position + (speed + slope * tick) ** 2 >= enough

        up = (wanted - speed) // slope
        rises = falls = first_true(brakes_after, up + 1)
        phases.add(min(rises, up), speed, slope)
        if rises > up:  # the full speed is reached; a last, smaller gain belongs to the first tick at it
            rises = up + (speed + slope * up < wanted)
            position = phase + up * speed + slope * (up * (up + 1) // 2)
            steady = max(-((least * position + wanted * wanted - enough) // (least * wanted)), 1)
            phases.add(steady, wanted)
            falls = up + steady
    if phases.speed > kept:
        phases.ramp(kept, slope)
        phases.finish(kept)
    else:
        phases.finish(phases.speed)
    return phases.plan(rises, falls)


@lru_cache(maxsize=1024)
def stopping(phase: int, speed: int, slope: int, keep: int, room: int) -> Plan:
    """Down from `speed` by `slope` to `keep`, where the motion is over; after `room` steps at the latest."""
    phases = _Phases(phase, speed, room)
    kept = keep * UPDATES
    if speed > kept:
        phases.ramp(kept, slope)
        if phases.speed > kept:
            phases.add(1, kept)
    return phases.plan(0, 0)


@lru_cache(maxsize=1024)
def slewing(phase: int, speed: int, run: int, slope: int, room: int) -> Plan:
    """Up or down to `run` and on, for `room` steps."""
    phases = _Phases(phase, speed, room)
    wanted = run * UPDATES
    phases.ramp(wanted, slope)
    rises = phases.ticks
    if not phases.done:
        rises += phases.speed < wanted
        phases.finish(wanted)
    return phases.plan(rises, phases.ticks)


def first_true(holds: Callable[[int], bool], count: int) -> int:
    """The first of 0 .. count - 1 from which on `holds`, `count` if it never does."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if holds(middle):
            high = middle
        else:
            low = middle + 1
    return low
