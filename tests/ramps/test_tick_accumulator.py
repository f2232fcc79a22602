"""The 16 us law in closed form against a loop that does what the firmware does, tick by tick (manual, page 32)."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.ramps.tick_accumulator import TICK, UNIT, UPDATES, Plan, Point, first_true, slewing, stopping, toward

rates = st.one_of(st.integers(1, 62_500), st.integers(1, 40), st.just(62_500))
steep = st.one_of(st.integers(3_000, 62_500), st.integers(40_000, 62_500))
phases = st.one_of(st.just(0), st.integers(0, UNIT - 1))
LONG = 60_000  # ticks that a loop may take here; longer moves differ by nothing but their numbers


class Loop:
    """The firmware's update routine."""

    def __init__(self, phase: int, speed: int) -> None:
        self.position, self.speed = phase, speed
        self.pulses: list[int] = []
        self.points = [Point(0, phase, speed)]

    def tick(self, speed: int) -> None:
        before = self.position // UNIT
        self.speed = speed
        self.position += speed
        if self.position // UNIT != before:
            self.pulses.append(len(self.points) * TICK)
        self.points.append(Point(self.position // UNIT, self.position % UNIT, speed))

    @property
    def steps(self) -> int:
        return self.position // UNIT


def loop_toward(steps, phase, speed, run, slope, keep, braking_slope, braking=False):
    loop = Loop(phase, speed)
    kept, wanted = keep * UPDATES, run * UPDATES
    rises = falls = None
    while loop.steps < steps and len(loop.points) <= LONG:
        v = loop.speed
        if not braking and 2 * braking_slope * (steps * UNIT - loop.position) <= v * v - kept * kept:
            braking = True
        if braking:
            falls = len(loop.points) - 1 if falls is None else falls
            loop.tick(max(v - slope, kept) if v > kept else v)
        else:
            if v < wanted:
                rises = len(loop.points)
            loop.tick(min(v + slope, wanted) if v < wanted else v)
    return loop, rises or 0, len(loop.points) - 1 if falls is None else falls


def loop_stopping(phase, speed, slope, keep, room):
    loop = Loop(phase, speed)
    while loop.speed > keep * UPDATES and loop.steps < room:
        loop.tick(max(loop.speed - slope, keep * UPDATES))
    return loop


def loop_slewing(phase, speed, run, slope, room):
    loop = Loop(phase, speed)
    wanted = run * UPDATES
    while loop.steps < room and len(loop.points) <= LONG:
        v = loop.speed
        loop.tick(min(v + slope, wanted) if v < wanted else max(v - slope, wanted))
    return loop


def agrees(plan: Plan, loop: Loop) -> None:
    assert plan.ticks == len(loop.points) - 1
    assert plan.train.times().tolist() == loop.pulses
    for tick in {0, 1, plan.ticks // 2, plan.ticks // 3, plan.rises, plan.falls, plan.ticks, *plan.begins}:
        if 0 <= tick <= plan.ticks:
            assert plan.point(tick) == loop.points[tick], tick


@settings(max_examples=examples(150), deadline=None)
@given(st.integers(0, 400), phases, rates, rates, steep, steep)
def test_a_move_from_rest_is_the_firmwares_loop(steps, phase, keep, run, slope, braking_slope):
    speed = min(keep, run) * UPDATES
    args = (steps, phase, speed, run, slope, keep, braking_slope)
    plan = toward(*args)
    if plan.ticks >= LONG:
        return
    loop, rises, falls = loop_toward(*args)
    agrees(plan, loop)
    assert plan.steps == steps
    if steps:
        assert (plan.rises, plan.falls) == (rises, falls)


@settings(max_examples=examples(150), deadline=None)
@given(st.integers(0, 300), phases, st.integers(0, 10**9), rates, rates, steep, steep, st.booleans())
def test_a_move_whose_slope_changes_on_the_way_is_the_firmwares_loop(
    steps, phase, extra, run, keep, slope, braking_slope, braking
):
    if run < keep:
        return
    speed = keep * UPDATES + extra % max((run - keep) * UPDATES, 1)
    args = (steps, phase, speed, run, slope, keep, braking_slope)
    plan = toward(*args, braking=braking)
    if plan.ticks < LONG:
        agrees(plan, loop_toward(*args, braking)[0])


@settings(max_examples=examples(150), deadline=None)
@given(phases, st.integers(1, 62_500 * UPDATES), steep, rates, st.one_of(st.integers(0, 5), st.just(10**9)))
def test_a_stop_is_the_firmwares_loop(phase, speed, slope, keep, room):
    agrees(stopping(phase, speed, slope, keep, room), loop_stopping(phase, speed, slope, keep, room))


@settings(max_examples=examples(100), deadline=None)
@given(phases, st.integers(1, 62_500 * UPDATES), rates, steep, st.integers(0, 300))
def test_a_slew_is_the_firmwares_loop(phase, speed, run, slope, room):
    plan = slewing(phase, speed, run, slope, room)
    if plan.ticks < LONG:
        agrees(plan, loop_slewing(phase, speed, run, slope, room))


def test_the_extreme_of_page_20_takes_62500_seconds_and_1953125000_microsteps_in_a_handful_of_segments():
    plan = stopping(0, 62_500 * UPDATES, 1, 1, 2**31)
    assert len(plan.train.segments) <= 2
    assert plan.ticks * TICK == 62_499 * 10**9
    # the manual's v**2 / 2 is 1 953 125 000; the stop rate of 1 is left out of it
    ticks = 62_499 * 62_500
    assert plan.steps == (ticks * UNIT - ticks * (ticks + 1) // 2) // UNIT == 1_953_124_999
    whole = toward(2_000_000_000, 0, UPDATES, 62_500, 1, 1, 1)
    assert len(whole.train.segments) <= 4
    assert whole.train.time_of(whole.steps) == whole.ticks * TICK


def test_the_search_finds_the_first_place_from_which_on_it_holds():
    assert [first_true(lambda k, n=n: k >= n, 5) for n in range(7)] == [0, 1, 2, 3, 4, 5, 5]


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_the_first_step_of_a_move_from_rest_falls_on_the_tick_that_completes_a_microstep(steps):
    plan = toward(steps, 0, 80 * UPDATES, 80, 8000, 80, 8000)  # constant: 62 500 / 80 = 781.25 ticks a step
    assert [plan.train.time_of(n) // TICK for n in range(1, steps + 1)] == [782, 1563, 2344][:steps]
