"""The ramp of the GS-C200: spec/gsc200.md, "Moves" and "Z"."""

from fractions import Fraction
from math import isqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.pulses import Accelerating, Uniform
from detent.ramps.constant_acceleration import move
from detent.ticks import ONE_NS, SECOND

speeds = st.integers(1, 1000).map(lambda tens: 10 * tens)
ramps = st.integers(1, 999)
steps_or_none = st.one_of(st.none(), st.integers(1, 4000), st.integers(1, 16_777_215))
starts = st.integers(0, 10**30)


def root(value: Fraction) -> Fraction:
    """The square root, within 2**-200 below."""
    scale = 1 << 400
    return Fraction(isqrt(value.numerator * scale // value.denominator), 1 << 200)


def ramp_time(slow: int, gain: Fraction, x: int) -> Fraction:
    """Seconds from the slow end over x steps of constant acceleration."""
    return 2 * (root(slow * slow + gain * x) - slow) / gain


@given(speeds, speeds, ramps, st.integers(1, 3000), starts)
@settings(max_examples=examples(60))
def test_every_pulse_is_within_half_a_nanosecond_of_the_law(start_stop, slew, ramp, steps, start):
    train = move(start_stop, slew, ramp, steps).train.at(start)
    assert train.steps == steps
    gain = Fraction(slew * slew - start_stop * start_stop, ramp)
    up = 0 if slew <= start_stop else min(ramp, steps // 2)
    top = slew if up == ramp or slew <= start_stop else root(start_stop * start_stop + gain * up)
    up_time = ramp_time(start_stop, gain, up) if up else Fraction(0)
    flat = steps - 2 * up
    # instants are kept to 2**-60 ns, three of them in a move, and the roots here to 2**-200
    slack = Fraction(3 + flat, ONE_NS) if up and up < ramp else Fraction(4, ONE_NS)
    times = train.times().tolist()
    for n in {1, 2, up, up + 1, steps - up, steps - up + 1, steps, *range(1, steps, 37)} & set(range(1, steps + 1)):
        if n <= up:
            seconds = ramp_time(start_stop, gain, n)
        elif n <= steps - up:
            seconds = up_time + (n - up) / Fraction(top)
        else:
            seconds = 2 * up_time + flat / Fraction(top) - ramp_time(start_stop, gain, steps - n)
        assert abs(times[n - 1] - Fraction(start, ONE_NS) - seconds * SECOND) <= Fraction(1, 2) + slack
        assert train.time_of(n) == times[n - 1]


@given(speeds, speeds, ramps, steps_or_none, starts, st.data())
def test_a_move_that_is_stopped_keeps_the_pulses_it_has_sent(start_stop, slew, ramp, steps, start, data):
    planned = move(start_stop, slew, ramp, steps)
    train = planned.train.at(start)
    if not planned.up:
        return
    n = data.draw(st.integers(0, min(2 * ramp + 50, 5000) if steps is None else steps - 1))
    if n < planned.up:
        shorter = 2 * (n + 1)
    elif steps is None or n < steps - planned.down:
        shorter = n + 1 + ramp
    else:
        return
    shorter = shorter if steps is None else min(steps, shorter)
    stopped = move(start_stop, slew, ramp, shorter).train.at(start)
    for k in {0, 1, n // 2, n - 1, n, n + 1} & set(range(n + 2)):
        assert stopped.fixed_time(k) == train.fixed_time(k)
        assert stopped.time_of(k) == train.time_of(k)
    sent = n + 1
    if sent <= 5000:
        assert (stopped.times(1, sent) == train.times(1, sent)).all()


@given(speeds, speeds, st.integers(1, 60), st.integers(1, 200))
def test_every_stop_of_a_small_move_keeps_the_pulses_it_has_sent(start_stop, slew, ramp, steps):
    planned = move(start_stop, slew, ramp, steps)
    times = planned.train.times().tolist()
    for n in range(steps - planned.down):
        shorter = 2 * (n + 1) if n < planned.up else n + 1 + ramp
        if planned.up:
            stopped = move(start_stop, slew, ramp, min(steps, shorter))
            assert stopped.train.times(1, n + 1).tolist() == times[: n + 1]


@given(speeds, speeds, ramps, st.integers(1, 5000))
def test_the_ramps_are_mirror_images(start_stop, slew, ramp, steps):
    planned = move(start_stop, slew, ramp, steps)
    train = planned.train
    end = train.fixed_time(steps)
    assert planned.up == planned.down
    for n in {0, 1, planned.up} & set(range(planned.up + 1)):
        assert abs((end - train.fixed_time(steps - n)) - train.fixed_time(n)) <= 3


def test_a_long_move_has_both_ramps_whole():
    planned = move(100, 1000, 50, 1000)
    up, flat, down = planned.train.segments
    assert isinstance(up, Accelerating)
    assert isinstance(flat, Uniform)
    assert isinstance(down, Accelerating)
    assert (up.steps, flat.steps, down.steps) == (50, 900, 50)
    assert (planned.up, planned.down) == (50, 50)
    assert planned.train.start == 0


@pytest.mark.parametrize(
    ("steps", "parts"), [(99, (49, 1, 49)), (100, (50, 50)), (101, (50, 1, 50)), (2, (1, 1)), (1, (1,)), (3, (1, 1, 1))]
)
def test_a_short_move_reverses_its_ramp_half_way(steps, parts):
    planned = move(100, 1000, 50, steps)
    assert tuple(segment.steps for segment in planned.train.segments) == parts
    assert planned.up == planned.down == min(50, steps // 2)


def test_the_odd_step_of_a_short_move_has_the_peak_speed():
    # v**2 = 100**2 + 30000 n: after 8 steps of 9 + 8 it is 500 steps/s
    planned = move(100, 1000, 33, 17)
    train = planned.train
    assert train.fixed_time(9) - train.fixed_time(8) == 2_000_000 * ONE_NS


def test_a_single_step_takes_one_interval_at_the_start_stop_speed():
    planned = move(300, 1000, 50, 1)
    assert planned.train.times().tolist() == [3_333_333]
    assert (planned.up, planned.down) == (0, 0)


def test_no_step_is_no_train():
    assert move(100, 1000, 50, 0).train.steps == 0
    assert move(100, 1000, 50, 0).train.duration == 0


@pytest.mark.parametrize("start_stop", [1000, 2000])
@pytest.mark.parametrize("steps", [1, 10, None])
def test_a_slew_no_higher_than_the_start_stop_speed_has_no_ramp(start_stop, steps):
    planned = move(start_stop, 1000, 50, steps)
    assert (planned.up, planned.down) == (0, 0)
    assert planned.train.steps == steps
    assert planned.train.time_of(1) == 1_000_000


def test_a_move_without_end_ramps_up_and_goes_on():
    planned = move(100, 1000, 50, None)
    train = planned.train
    assert (train.steps, planned.up, planned.down) == (None, 50, 0)
    assert train.fixed_time(51 + 10**6) - train.fixed_time(50) == (10**6 + 1) * 1_000_000 * ONE_NS


def test_moves_of_one_kind_are_planned_once():
    assert move(100, 1000, 50, 777) is move(100, 1000, 50, 777)


@pytest.mark.parametrize("wrong", [(0, 1, 1, 1), (1, 0, 1, 1), (1, 1, 0, 1), (1, 1, 1, -1)])
def test_a_move_that_makes_no_sense_is_refused(wrong):
    with pytest.raises(ValueError, match="a move has"):
        move(*wrong)


def test_a_ramp_that_ends_half_way_between_two_nanoseconds_ends_at_the_later() -> None:
    # 43 steps from 2080 to 8160 steps/s take 86 / 10 240 s = 8 398 437.5 ns, exactly
    assert move(2080, 8160, 43, None).train.time_of(43) == 8_398_438
