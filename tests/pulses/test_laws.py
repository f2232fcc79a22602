"""Each law against arithmetic of its own: fractions, squares of integers, loops over ticks."""

from bisect import bisect_right
from fractions import Fraction
from itertools import accumulate

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from detent.pulses import Accelerating, Table, Ticked, Train, Uniform
from detent.ticks import HALF_NS, ONE_NS, to_fixed

HALF = Fraction(1, 2)
starts = st.integers(0, 10**30)
rates = st.fractions(min_value=Fraction(1, 1000), max_value=10**6, max_denominator=1000)


def is_rounded(t: int, truth: Fraction) -> bool:
    return t - HALF <= truth < t + HALF


def reaches(y: Fraction, slow: Fraction, gain: Fraction, x: int) -> bool:
    """Whether 1e9 * (sqrt(slow**2 + gain x) - slow) * 2 / gain >= y ns, by squaring only."""
    return y <= 0 or slow**2 + gain * x >= (y * gain / 2 / 10**9 + slow) ** 2


def exceeds(y: Fraction, slow: Fraction, gain: Fraction, x: int) -> bool:
    return y < 0 or slow**2 + gain * x > (y * gain / 2 / 10**9 + slow) ** 2


def ramp_time_is_within(low: Fraction, high: Fraction, anchor: Fraction, law: Accelerating, x: int) -> bool:
    """Whether low <= the time x steps from the slow end < high."""
    slow, gain = Fraction(law.slow), Fraction(law.gain)
    if law.up:
        return reaches(low - anchor, slow, gain, x) and not reaches(high - anchor, slow, gain, x)
    return not exceeds(anchor - low, slow, gain, x) and exceeds(anchor - high, slow, gain, x)


def ramp_time_is_rounded(t: int, anchor: Fraction, law: Accelerating, x: int) -> bool:
    return ramp_time_is_within(t - HALF, t + HALF, anchor, law, x)


def check_inverse(train: Train, n: int) -> None:
    """steps_by is the inverse of time_of, and one ns earlier it is not there yet."""
    t = train.time_of(n)
    by = train.steps_by(t)
    assert by >= n
    assert by == train.steps or train.time_of(by + 1) > t
    assert train.steps_by(t - 1) < n


# Constant speed


@given(st.integers(1, 10**12), st.integers(1, 10**6), st.integers(1, 10**12), starts)
def test_a_uniform_pulse_is_the_rounded_multiple_of_its_period(numerator: int, denominator: int, n: int, start: int):
    train = Train((Uniform(0, numerator, denominator, None),), start)
    assert is_rounded(train.time_of(n), Fraction(start, ONE_NS) + Fraction(n * numerator, denominator))
    if numerator >= denominator:
        check_inverse(train, n)


def test_a_uniform_tie_goes_up():
    train = Train((Uniform(0, 5, 2, 4),))
    assert train.times().tolist() == [3, 5, 8, 10]
    assert [train.time_of(n) for n in range(5)] == [0, 3, 5, 8, 10]
    assert [train.steps_by(t) for t in (2, 3, 4, 5, 7, 8)] == [0, 1, 1, 2, 2, 3]


def test_a_uniform_tie_from_a_start_between_nanoseconds_goes_up():
    train = Train((Uniform(0, 10, 1, 3),), HALF_NS)
    assert train.times().tolist() == [11, 21, 31]
    assert train.shifted(-1).times().tolist() == [10, 20, 30]


@given(st.integers(1, 10**30), st.integers(1, 10**9), starts)
def test_a_period_in_fixed_point_is_exact(period: int, n: int, start: int):
    train = Train((Uniform.fixed_period(0, period, None),), start)
    assert train.fixed_time(n) == start + n * period


# Ramps


@given(rates, rates, st.integers(0, 10**9), st.integers(1, 2 * 10**9), st.booleans(), starts, st.data())
def test_a_ramp_pulse_is_the_rounded_root(slow, gain, low, steps, up, start, data):
    ramp = Accelerating(to_fixed(10**20), slow, gain, low, low + steps, up)
    train = Train((ramp,), start)
    for n in (1, steps, data.draw(st.integers(1, steps))):
        x = low + n if up else low + steps - n
        anchor = Fraction(start, ONE_NS) + 10**20
        assert ramp_time_is_rounded(train.time_of(n), anchor, ramp, x)
        floor = train.fixed_time(n)
        assert ramp_time_is_within(Fraction(floor, ONE_NS), Fraction(floor + 1, ONE_NS), anchor, ramp, x)
        check_inverse(train, n)


def test_a_ramp_from_standstill_with_square_roots_that_are_whole_lands_on_ties():
    # t(x) = 2 sqrt(x / gain): with gain = 16e18 a quarter of 2 sqrt(x) ns, a tie whenever sqrt(x) is odd
    up = Accelerating(0, 0, 16 * 10**18, 0, 100)
    train = Train((up,))
    for root in range(1, 11):
        assert train.time_of(root * root) == (root + 1) // 2, root
    down = Accelerating(to_fixed(5), 0, 16 * 10**18, 0, 100, up=False)
    slowing = Train((down,))
    for root in range(10):  # 5 - root / 2, ties up
        assert slowing.time_of(100 - root * root) == 5 - root // 2, root
    assert train.times().tolist() == [train.time_of(n) for n in range(1, 101)]
    assert slowing.times().tolist() == [slowing.time_of(n) for n in range(1, 101)]
    assert train.counts_by(np.arange(-1, 8)).tolist() == [train.steps_by(t) for t in range(-1, 8)]
    assert slowing.counts_by(np.arange(-1, 8)).tolist() == [slowing.steps_by(t) for t in range(-1, 8)]


@pytest.mark.parametrize("up", [True, False])
@pytest.mark.parametrize("offset", [-1, 0, 1])
def test_a_long_ramp_full_of_ties_is_exact_in_arrays_too(up, offset):
    # slow 3, gain 40: v = sqrt(9 + 40 x) is whole for many x, and t = (v - 3) * 5e7 ns is then a whole ns;
    # an anchor of half a ns, and one unit of 2**-60 ns on either side, put these on ties and next to them
    steps = 60_000
    law = Accelerating(to_fixed(10**12) + HALF_NS + offset, 3, 40, 0, steps, up)
    train = Train((law,), 0)
    times = train.times()
    some = {n for v in range(3, 1600) if (v * v - 9) % 40 == 0
            for n in ((v * v - 9) // 40, steps - (v * v - 9) // 40) if 1 <= n <= steps}  # fmt: skip
    assert len(some) > 300
    for n in some:
        assert times[n - 1] == train.time_of(n)
        x = n if up else steps - n
        anchor = 10**12 + HALF + Fraction(offset, ONE_NS)
        assert ramp_time_is_rounded(train.time_of(n), anchor, law, x)


def test_a_ramp_down_begins_exactly_where_it_is_told_to():
    begin = to_fixed(777) + 12345
    ramp = Accelerating.down_from(begin, 10, Fraction(10**6, 7), 1000)
    assert ramp.begin == begin
    assert ramp.steps == 1000
    assert Accelerating.down_from(begin, 10, 10**6, 0).end == begin


def test_a_ramp_of_two_thousand_million_steps_is_exact():
    steps = 2 * 10**9
    law = Accelerating(0, 1, Fraction(9, 10), 0, steps)
    train = Train((law,))
    for n in (1, 2, 10**9, steps - 1, steps):
        assert ramp_time_is_rounded(train.time_of(n), Fraction(0), law, n)
        check_inverse(train, n)
    assert train.times(steps - 40_000, steps).tolist()[::777] == [
        train.time_of(n) for n in range(steps - 40_000, steps + 1, 777)
    ]


# Tables

tables = st.lists(st.tuples(st.integers(1, 40), st.integers(1, 10**6)), min_size=1, max_size=30)
clock_ticks = st.one_of(st.integers(1, 10**5), st.fractions(Fraction(1, 100), 10**5, max_denominator=10**4))


@given(tables, clock_ticks, starts)
def test_a_table_is_its_rows_summed_up(rows, tick, start):
    counts, periods = zip(*rows, strict=True)
    train = Train((Table.of(0, tick, counts, periods),), start)
    expected = list(accumulate(period for count, period in rows for _ in range(count)))
    assert train.steps == len(expected)
    times = [train.time_of(n) for n in range(1, len(expected) + 1)]
    for n, ticks in enumerate(expected):
        assert is_rounded(times[n], Fraction(start, ONE_NS) + ticks * Fraction(tick))
    assert train.times().tolist() == times
    assert train.times_of(np.arange(1, len(times) + 1)).tolist() == times
    asked = sorted({t + d for t in times for d in (-1, 0, 1)})
    assert [train.steps_by(t) for t in asked] == [bisect_right(times, t) for t in asked]
    assert train.counts_by(np.array(asked)).tolist() == [bisect_right(times, t) for t in asked]


def test_a_table_of_a_million_rows_is_exact():
    rows = np.arange(1_000_000)
    counts, periods = rows % 3 + 1, 1000 + rows % 977
    train = Train((Table.of(0, 8036, counts, periods),))
    ticks = np.cumsum(np.repeat(periods, counts))
    assert train.steps == len(ticks)
    assert (train.times() == ticks * 8036).all()
    assert train.time_of(1_234_567) == int(ticks[1_234_566]) * 8036
    assert train.steps_by(train.time_of(1_234_567) - 1) == 1_234_566
    assert (train.times(1_000_003, 1_900_000) == ticks[1_000_002:1_900_000] * 8036).all()


@pytest.mark.parametrize(("counts", "periods"), [([0], [1]), ([1], [0]), ([1, 2], [1]), ([1.5], [1]), ([[1]], [[1]])])
def test_a_table_that_makes_no_sense_is_refused(counts, periods):
    with pytest.raises(ValueError, match="table"):
        Table.of(0, 500, counts, periods)


def test_a_table_too_long_for_int64_is_refused():
    with pytest.raises(OverflowError, match="split"):
        Table.of(0, 500, [1 << 40], [1 << 40])


# Ticks


def tick_by_tick(ticks: int, unit: int, phase: int, speed: int, change: int) -> list[int]:
    """The ticks on which a pulse falls, done as the firmware does."""
    fired, position = [], phase
    for tick in range(1, ticks + 1):
        speed += change
        before = position // unit
        position += speed
        fired += [tick] * (position // unit - before)
    return fired


@given(
    st.integers(0, 300), st.integers(1, 10**5), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), clock_ticks, starts
)
def test_a_ticked_segment_fires_where_the_accumulator_does(ticks, unit, phase, slow, fast, tick, start):
    phase, slow, fast = int(phase * (unit - 1)), int(slow * unit), int(fast * unit)
    change = int((fast - slow) / max(ticks, 1))
    segment = Ticked(0, tick, ticks, unit, phase, slow, change)
    train = Train((segment,), start)
    fired = tick_by_tick(ticks, unit, phase, slow, change)
    assert train.steps == len(fired)
    times = [train.time_of(n) for n in range(1, len(fired) + 1)]
    for n, k in enumerate(fired):
        assert is_rounded(times[n], Fraction(start, ONE_NS) + k * Fraction(tick))
    assert train.times().tolist() == times
    assert train.times_of(np.arange(1, len(times) + 1)).tolist() == times
    asked = sorted({t + d for t in times for d in (-1, 0, 1)})
    assert [train.steps_by(t) for t in asked] == [bisect_right(times, t) for t in asked]
    assert train.counts_by(np.array(asked, np.int64)).tolist() == [bisect_right(times, t) for t in asked]


@pytest.mark.parametrize(
    ("speed", "change", "pulses"),
    [(62500 * 31250, 0, 1_953_125_000), (0, 1, 1_953_124_999), (3_906_250_000, -1, 1_953_125_000)],
)
def test_a_ticked_segment_of_62500_seconds_is_exact(speed, change, pulses):
    # a tick of 16 us, speeds in 1/62500 steps/s, positions in 1/62500**2 steps
    unit, ticks = 62500**2, 62500**2
    segment = Ticked(0, 16_000, ticks, unit, 0, speed, change)
    train = Train((segment,))
    assert abs(train.steps - pulses) <= 1
    asked = np.linspace(1, train.steps, 5000).astype(np.int64)
    batch = train.times_of(asked)
    for n, t in zip(asked.tolist(), batch.tolist(), strict=True):
        k, off = divmod(t, 16_000)
        assert off == 0
        assert segment.position(k - 1) < n * unit <= segment.position(k)
        assert train.time_of(n) == t
    assert (train.counts_by(batch) == asked).all()
    assert (train.counts_by(batch - 1) == asked - 1).all()
    assert train.times(train.steps - 20_000)[::500].tolist() == [
        train.time_of(n) for n in range(train.steps - 20_000, train.steps + 1, 500)
    ]


def test_huge_accumulators_are_exact_in_arrays():
    unit = 10**30
    train = Train((Ticked(0, 16_000, 10_000, unit, unit // 3, unit // 7, unit // 10**5),))
    times = [train.time_of(n) for n in range(1, train.steps + 1)]
    assert train.times().tolist() == times
    assert (train.counts_by(np.array(times)) == np.arange(1, train.steps + 1)).all()


@pytest.mark.parametrize(("speed", "change"), [(-1, 0), (0, -1), (101, 0), (90, 2), (5, -1)])
def test_a_speed_that_turns_or_is_over_a_pulse_a_tick_is_refused(speed, change):
    with pytest.raises(ValueError, match="speed keeps within"):
        Ticked(0, 16_000, 10, 100, 0, speed, change)


@given(st.integers(1, 10**6))
def test_one_pulse_a_tick_is_the_most(unit):
    train = Train((Ticked(0, 16_000, 50, unit, unit - 1, unit, 0),))
    assert train.times().tolist() == [16_000 * k for k in range(1, 51)]


@pytest.mark.parametrize("make", [
    lambda: Uniform(0, 0, 1, 5), lambda: Uniform(0, 1, 1, -1), lambda: Uniform(0, 1, -1, 5),
    lambda: Accelerating(0, -1, 1, 0, 5), lambda: Accelerating(0, 1, 0, 0, 5), lambda: Accelerating(0, 1, 1, 6, 5),
    lambda: Table.of(0, 0, [1], [1]), lambda: Ticked(0, 0, 5, 5, 0, 1), lambda: Ticked(0, 1, 5, 5, 5, 1),
    lambda: Ticked(0, 1, -5, 5, 0, 1), lambda: Uniform(0, 1, 1, 5).part(2, 6), lambda: Uniform(0, 1, 1, 5).part(3, 2),
])  # fmt: skip
def test_laws_that_make_no_sense_are_refused(make):
    with pytest.raises(ValueError):  # noqa: PT011 - every one has its own text
        make()


@given(st.integers(1, 10**6), st.integers(1, 1000))
def test_progress_says_where_the_law_is(rate, n):
    """Half way to the next pulse the phase of a constant speed is half."""
    assume(n > 0)
    train = Train((Uniform.at_rate(0, rate, 2000),))
    t = (train.time_of(n) + train.time_of(n + 1)) // 2
    state = train.state_at(t)
    assert state.steps == n
    assert state.phase == pytest.approx(0.5, abs=rate / 5e8)
    assert state.rate == pytest.approx(rate)
