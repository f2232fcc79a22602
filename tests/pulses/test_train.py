"""Trains of many segments: every query against every other, and every way of making a train from another."""

import copy
import pickle
import sys
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.pulses import Accelerating, State, Table, Ticked, Train, Uniform, arrays
from detent.ticks import HALF_NS, ONE_NS, SECOND, to_fixed

starts = st.one_of(st.just(0), st.integers(0, 10**9).map(to_fixed), st.integers(0, 10**30))


@st.composite
def segments(draw, begin):
    """One segment of any law, from `begin` on, of about 40 pulses at most."""
    kind = draw(st.sampled_from(["uniform", "up", "down", "table", "ticked"]))
    if kind == "uniform":
        return Uniform(begin, draw(st.integers(100, 10**9)), draw(st.integers(1, 100)), draw(st.integers(1, 40)))
    if kind in ("up", "down"):
        slow = draw(st.fractions(0, 10**5, max_denominator=20))
        gain = draw(st.fractions(1, 10**7, max_denominator=20))
        low, steps = draw(st.integers(0, 10)), draw(st.integers(1, 40))
        if kind == "down":
            return Accelerating.down_from(begin, slow, gain, low + steps).part(0, steps)
        ramp = Accelerating(0, slow, gain, low, low + steps)
        return ramp.moved(begin - ramp.begin)
    if kind == "table":
        rows = draw(st.lists(st.tuples(st.integers(1, 9), st.integers(1, 999)), min_size=1, max_size=5))
        return Table.of(begin, draw(st.sampled_from([500, 8036, Fraction(1001, 3)])), *zip(*rows, strict=True))
    unit, ticks = 1000, draw(st.integers(1, 60))
    speeds = draw(st.integers(0, unit)), draw(st.integers(0, unit))
    change = int((speeds[1] - speeds[0]) / ticks)
    return Ticked(begin, 16_000, ticks, unit, draw(st.integers(0, unit - 1)), speeds[0], change)


@st.composite
def trains(draw, most=6):
    made, now = [], 0
    for _ in range(draw(st.integers(0, most))):
        made.append(draw(segments(now + draw(st.sampled_from([0, 0, 1, 12345, ONE_NS * 1000])))))
        now = made[-1].end
    return Train(made, draw(starts))


def all_times(train: Train) -> list[int]:
    return [train.time_of(n) for n in range(1, train.steps + 1)]


def near(train: Train) -> list[int]:
    """The times at which something could go wrong."""
    return sorted(
        {t + d for t in [train.time_of(0), *all_times(train)] for d in (-1, 0, 1)} | {-5, train.time_of(0) + 10**13}
    )


@given(trains())
def test_steps_by_is_the_inverse_of_time_of(train: Train):
    times = all_times(train)
    assert all(a <= b for a, b in pairwise(times))
    for t in near(train):
        assert train.steps_by(t) == sum(time <= t for time in times)


@given(trains())
def test_arrays_give_what_scalars_give(train: Train):
    times = all_times(train)
    assert train.times().tolist() == times
    assert np.concatenate([np.zeros(0, int), *(chunk.copy() for chunk in train.chunks(7))]).tolist() == times
    n = np.arange(train.steps + 1)[::-1]
    assert train.times_of(n).tolist() == [*times[::-1], train.time_of(0)]
    asked = near(train)[::-1]
    assert train.counts_by(np.array(asked)).tolist() == [train.steps_by(t) for t in asked]


@given(trains(), st.data())
def test_a_slice_of_the_times_is_a_slice(train: Train, data):
    first = data.draw(st.integers(1, train.steps + 1))
    last = data.draw(st.integers(first - 1, train.steps))
    out = np.empty(last - first + 1, np.int64)
    assert train.times(first, last, out) is out
    assert out.tolist() == all_times(train)[first - 1 : last]


@given(trains(), st.data())
def test_head_and_tail_keep_every_pulse_at_its_instant(train: Train, data):
    n = data.draw(st.integers(0, train.steps))
    head, tail = train.head(n), train.tail(n)
    assert (head.steps, tail.steps) == (n, train.steps - n)
    assert head.start == train.start
    assert tail.start == train.fixed_time(n)
    assert [head.fixed_time(k) for k in range(n + 1)] == [train.fixed_time(k) for k in range(n + 1)]
    assert [tail.fixed_time(k) for k in range(tail.steps + 1)] == [
        train.fixed_time(n + k) for k in range(tail.steps + 1)
    ]
    assert head.times().tolist() + tail.times().tolist() == train.times().tolist()
    again = data.draw(st.integers(0, tail.steps))
    assert tail.tail(again).times().tolist() == train.times(n + again + 1).tolist()
    for t in near(train):
        if t > train.time_of(n):
            assert tail.steps_by(t) == train.steps_by(t) - n


@given(trains(), st.integers(-(10**20), 10**20))
def test_a_moved_train_keeps_its_intervals(train: Train, by: int):
    moved = train.shifted(by)
    assert moved.start == train.start + by
    assert moved.steps == train.steps
    assert moved.segments is train.segments
    assert [moved.fixed_time(n) - by for n in range(train.steps + 1)] == [
        train.fixed_time(n) for n in range(train.steps + 1)
    ]
    assert moved.shifted(-by) == train
    assert train.at(train.start) == train
    whole = train.shifted(to_fixed(by))
    assert [t - by for t in all_times(whole)] == all_times(train)


@given(trains())
def test_a_copy_is_the_train_itself(train: Train):
    assert copy.copy(train) is train
    assert copy.deepcopy(train) is train
    assert all(copy.deepcopy(segment) is segment for segment in train.segments)
    assert hash(train) == hash(train.shifted(0))
    if not any(isinstance(segment, Table) for segment in train.segments):
        assert pickle.loads(pickle.dumps(train)) == train


@given(trains())
def test_the_state_agrees_with_the_pulses(train: Train):
    for t in near(train):
        state = train.state_at(t)
        assert state.steps == train.steps_by(t)
        assert 0.0 <= state.phase < 1.0
        assert state.rate >= 0.0


def test_the_state_of_a_ramp_is_its_speed_and_place():
    train = Train((Accelerating(0, 100, 2000, 0, 1000),), to_fixed(5 * SECOND))
    # 0.2 s: v = s + a t = 100 + 200, x = 100 * 0.2 + 1000 / 2 * 0.04
    state = train.state_at(5_200_000_001)
    assert state.steps == 40
    assert state.phase == pytest.approx(0, abs=1e-6)
    assert state.rate == pytest.approx(300)
    assert train.state_at(5 * SECOND - 1) == State(0, 0.0, 0.0)
    assert train.state_at(train.time_of(1000)) == State(1000, 0.0, 0.0)


def test_the_state_in_a_table_is_that_of_its_row():
    train = Train((Table.of(0, 500, [2, 2], [1000, 2000]),))
    assert train.state_at(750_000) == State(1, 0.5, 2000.0)
    assert train.state_at(1_000_000) == State(2, 0.0, 1000.0)
    assert train.state_at(1_500_000) == State(2, 0.5, 1000.0)


def test_the_state_of_a_ticked_segment_is_its_accumulator_and_speed():
    train = Train((Ticked(0, 16_000, 100, 1000, 0, 0, 5),))
    state = train.state_at(20 * 16_000 + 7)
    assert state.steps == 1
    assert state.phase == pytest.approx(0.05)
    assert state.rate == pytest.approx(100 / 1000 * 62500)


def test_in_a_gap_nothing_moves():
    train = Train((Uniform.at_rate(0, 1000, 3), Uniform.at_rate(to_fixed(SECOND), 1000, 3)))
    assert train.times().tolist() == [1_000_000, 2_000_000, 3_000_000, 1_001_000_000, 1_002_000_000, 1_003_000_000]
    assert train.state_at(SECOND // 2) == State(3, 0.0, 0.0)
    assert train.state_at(SECOND + 500_000) == State(3, 0.5, 1000.0)


def test_ticks_without_a_pulse_count_as_time():
    slow = Ticked(0, 16_000, 10, 1000, 0, 10)
    train = Train((slow, slow.moved(to_fixed(160_000)), Ticked(to_fixed(320_000), 16_000, 5, 1000, 999, 10)))
    assert train.steps == 1
    assert train.time_of(1) == 336_000
    assert train.steps_by(335_999) == 0
    assert train.tail(1).steps == 0
    assert train.times_of(np.array([0, 1])).tolist() == [0, 336_000]


def test_an_open_ended_train_goes_on():
    train = Train((Uniform.at_rate(0, 3, None),), to_fixed(7))
    assert train.steps is None
    assert train.duration is None
    assert train.time_of(3 * 10**12) == 10**12 * SECOND + 7
    assert train.steps_by(10**12 * SECOND + 7) == 3 * 10**12
    assert train.times(4, 6).tolist() == [1_333_333_340, 1_666_666_674, 2_000_000_007]
    assert train.tail(10).time_of(2) == train.time_of(12)
    assert train.head(5).steps == 5
    assert train.counts_by(np.array([6, 7, 10**18])).tolist() == [0, 0, train.steps_by(10**18)]
    with pytest.raises(ValueError, match="open-ended"):
        train.times()
    with pytest.raises(ValueError, match="open-ended"):
        list(train.chunks())
    with pytest.raises(ValueError, match="only the last"):
        Train((*train.segments, Uniform(0, 1, 1, 1)))


def test_questions_about_pulses_that_are_not_there_are_refused():
    train = Train((Uniform.at_rate(0, 10, 5),))
    for ask in (train.time_of, train.fixed_time, train.head, train.tail):
        for n in (-1, 6):
            with pytest.raises(IndexError, match=f"no pulse {n}: the train has 5 steps"):
                ask(n)
    with pytest.raises(IndexError, match="no pulse 0"):
        train.times(0)
    with pytest.raises(IndexError, match="no pulse 6"):
        train.times(1, 6)
    with pytest.raises(IndexError, match="no pulse 6"):
        train.times_of(np.array([6]))
    with pytest.raises(ValueError, match="out is for 5 pulses"):
        train.times(out=np.empty(4, np.int64))
    with pytest.raises(TypeError, match="whole numbers"):
        train.times_of(np.array([1.0]))
    with pytest.raises(TypeError, match="whole ns"):
        train.counts_by(np.array([1.0]))
    with pytest.raises(ValueError, match="at least one pulse"):
        list(train.chunks(0))
    with pytest.raises(AttributeError, match="immutable"):
        train.start = 5
    with pytest.raises(ValueError, match="before the end"):
        Train((*train.segments, Uniform.at_rate(0, 10, 5)))
    with pytest.raises(ValueError, match="before the end"):
        Train((Uniform.at_rate(-1, 10, 5),))


def test_an_empty_train_is_only_its_start():
    train = Train((), to_fixed(9) + HALF_NS)
    assert (train.steps, train.duration, train.time_of(0)) == (0, 0, 10)
    assert train.times().tolist() == []
    assert train.times_of(np.array([0, 0])).tolist() == [10, 10]
    assert train.counts_by(np.array([0, 99])).tolist() == [0, 0]
    assert train.steps_by(99) == 0
    assert train.state_at(99) == State(0, 0.0, 0.0)
    assert train.head(0) == train
    assert train.tail(0) is train


def test_beyond_292_years_scalars_go_on_and_arrays_refuse():
    train = Train((Uniform(0, 1 << 62, 1, 3),))
    assert train.time_of(3) == 3 << 62
    assert train.steps_by(2 << 62) == 2
    with pytest.raises(OverflowError, match="pulse 3"):
        train.times()
    with pytest.raises(OverflowError, match="pulse 3"):
        train.times_of(np.array([3]))
    assert train.times(1, 1).tolist() == [1 << 62]
    late = Train((Uniform.at_rate(0, 1, 3),), to_fixed(1 << 70))
    assert late.steps_by((1 << 70) + SECOND) == 1
    with pytest.raises(OverflowError):
        late.times()
    with pytest.raises(OverflowError, match="use steps_by"):
        late.counts_by(np.array([1]))


@given(st.integers(2**53, 2**62), st.data())
@settings(max_examples=examples(30))
def test_beyond_104_days_every_pulse_is_still_exact(begin: int, data):
    """float64 has no room for these nanoseconds: neither late starts nor long segments may feel it."""
    long = Uniform(0, 10**7 + 1, 3, 3 * 10**9)
    ramp = Accelerating.down_from(long.end, Fraction(1, 3), 50, 10**5)
    train = Train((long, ramp), to_fixed(begin) + data.draw(st.integers(0, ONE_NS)))
    n = sorted(data.draw(st.lists(st.integers(1, train.steps), min_size=1, max_size=20)))
    assert train.times_of(np.array(n)).tolist() == [train.time_of(k) for k in n]
    times = [train.time_of(k) + d for k in n for d in (-1, 0)]
    assert train.counts_by(np.array(times)).tolist() == [train.steps_by(t) for t in times]
    first = data.draw(st.integers(1, train.steps - 1000))
    assert train.times(first, first + 999).tolist() == [train.time_of(k) for k in range(first, first + 1000)]


def test_a_train_of_many_segments_answers_in_arrays_as_pulse_by_pulse():
    made, now = [], 0
    for i in range(6000):
        match i % 4:
            case 0:
                made.append(Uniform(now, 10**6 + i, 3, 5))
            case 1:
                ramp = Accelerating(0, 100, Fraction(10**6, 7), i % 5, i % 5 + 4)
                made.append(ramp.moved(now - ramp.begin))
            case 2:
                made.append(Accelerating.down_from(now, Fraction(i, 6), 10**4, 3))
            case 3:
                made.append(Ticked(now, 16_000, 40, 1000, 0, 100))
        now = made[-1].end
    train = Train(made, to_fixed(10**9) + HALF_NS - 1)
    times = all_times(train)
    assert train.times().tolist() == times
    assert train.times(333, 9999).tolist() == times[332:9999]
    n = np.arange(train.steps) * 7919 % (train.steps + 1)
    assert train.times_of(n).tolist() == [([train.time_of(0), *times])[k] for k in n.tolist()]
    t = np.array(times)[n - 1] - n % 2
    assert train.counts_by(t).tolist() == [train.steps_by(k) for k in t.tolist()]


@pytest.mark.parametrize("law", [
    Accelerating(0, 0, 40_000, 0, 300_000),
    Accelerating(to_fixed(10**14) + 777, 0, 40_000, 0, 300_000, up=False),
    Accelerating(123, 3, 40, 0, 300_000),  # many ties
    Accelerating(HALF_NS, 1, Fraction(1, 10**4), 0, 300_000),  # slow: the form with the division, short chunks
    Accelerating(to_fixed(10**18) + HALF_NS, 1, Fraction(1, 10**4), 0, 300_000, up=False),
    Accelerating(0, Fraction(1, 10**3), Fraction(1, 10**12), 0, 20_000),  # half a year: almost no float left
    Accelerating(0, 9999, Fraction(1, 10**9), 10**9, 10**9 + 300_000),  # hardly a ramp at all
])  # fmt: skip
def test_numpy_and_numba_and_the_exact_law_give_the_same_times(law):
    pytest.importorskip("numba")
    train = Train((law,))
    try:
        arrays.use("numpy")
        by_numpy = train.times()
        arrays.use("numba")
        by_numba = train.times()
    finally:
        arrays.use("auto")
    assert (by_numpy == by_numba).all()
    some = [*range(1, 3000), *range(3000, train.steps, 97), *range(train.steps - 300, train.steps + 1)]
    assert by_numpy[np.array(some) - 1].tolist() == [(law.fixed(n) + HALF_NS) // ONE_NS for n in some]


@given(st.integers(1, 9 * 10**9), st.integers(1, 10**7), st.integers(0, 10**9), st.integers(0, 2 * ONE_NS))
@settings(max_examples=examples(60))
def test_long_runs_at_constant_speed_are_exact_in_arrays(numerator, denominator, first, start):
    train = Train((Uniform(0, numerator, denominator, None),), start)
    times = train.times(first + 1, first + 40_000)
    some = [*range(1, 40_000, 611), 40_000]
    assert [int(times[n - 1]) for n in some] == [train.time_of(first + n) for n in some]


def test_a_period_in_fixed_point_is_exact_in_arrays():
    train = Train((Uniform.fixed_period(5, 12_345 * ONE_NS + 987_654_321, 50_000),))
    assert train.times().tolist() == all_times(train)


def test_a_path_that_is_not_installed_is_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    assert not arrays.goes_to_numba(10**9)
    with pytest.raises(ImportError, match="needs numba, which is not installed"):
        arrays.use("numba")
