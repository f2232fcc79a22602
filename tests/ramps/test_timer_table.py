"""The timer model and the ramp table of the DCB-274, as docs/controllers/dcb274.md settles them."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.pulses import Train
from detent.ramps.timer_table import (
    LEAST_COUNT,
    TABLE,
    TICK,
    Speeds,
    change,
    count_of,
    index,
    ladder,
    period_after,
    rate_of,
)  # fmt: skip
from detent.ticks import SECOND, to_fixed

DEFAULT = Speeds(count_of(800), count_of(10_000), 5, 5, 1)
SPEEDS = st.builds(
    Speeds, *[st.integers(40, 50_000).map(count_of)] * 2, *[st.integers(0, 255)] * 2, st.integers(1, 255)
)


def periods(train: Train) -> list[int]:
    """Ticks from pulse to pulse, the first one from the start."""
    times = [0, *train.times().tolist()]
    gaps = [(after - before) for before, after in pairwise(times)]
    assert all(gap % TICK == 0 for gap in gaps)
    return [gap // TICK for gap in gaps]


@pytest.mark.parametrize(
    ("rate", "printed"), [(800, 802), (10_000, 10_370), (40, 40), (31_111, 41_480), (36_000, 41_480)]
)
def test_the_timer_prints_the_rates_of_pages_22_and_65(rate: int, printed: int) -> None:
    assert rate_of(count_of(rate)) == printed


def test_the_ceiling_is_reached_from_31111_on_and_less_than_40_is_40() -> None:
    assert count_of(31_110) == LEAST_COUNT + 1
    assert count_of(31_111) == LEAST_COUNT
    assert count_of(1) == count_of(40)


@given(st.integers(40, 60_000))
def test_the_count_is_the_floor_and_the_printed_rate_gives_it_again(rate: int) -> None:
    count = count_of(rate)
    assert count == max(SECOND // (8036 * rate), 3)
    assert count_of(rate_of(count)) == count


def test_the_table_is_1095_4_times_the_square_root() -> None:
    for i, count in enumerate(TABLE, 1):
        assert count == int(SECOND / (TICK * 1095.4 * i**0.5))


def test_a_ramp_makes_k_steps_at_the_initial_speed_and_at_each_entry_above_it() -> None:
    found = periods(index(DEFAULT, 2000).train)
    rungs = [155, *(count for count in TABLE if 12 < count < 155)]
    up = [count for count in rungs for _ in range(5)]
    assert found[: len(up)] == up
    assert found[-len(up) :] == up[::-1]
    assert set(found[len(up) : -len(up)]) == {12}


def test_up_and_down_have_their_own_k() -> None:
    move = index(DEFAULT._replace(up=50, down=5), 100_000)
    assert (move.up, move.down) == (77 * 50, 77 * 5)


def test_k_0_has_no_ramp_and_a_low_slew_speed_none_either() -> None:
    assert set(periods(index(DEFAULT._replace(up=0, down=0), 50).train)) == {12}
    assert set(periods(index(DEFAULT._replace(slew=1000), 50).train)) == {1000}


@pytest.mark.parametrize(("steps", "peak"), [(1, 155), (19, 155), (20, 113), (29, 113), (30, 80)])
def test_a_short_move_peaks_at_the_highest_entry_whose_steps_fit(steps: int, peak: int) -> None:
    found = periods(index(DEFAULT, steps).train)
    assert min(found) == peak
    assert len(found) == steps


def test_d_multiplies_every_period() -> None:
    one, seven = index(DEFAULT, 1500).train, index(DEFAULT._replace(divide=7), 1500).train
    assert [7 * period for period in periods(one)] == periods(seven)


@given(SPEEDS, st.integers(1, 16_777_215))
def test_every_move_has_its_steps_and_is_at_most_five_segments(speeds: Speeds, steps: int) -> None:
    move = index(speeds, steps)
    assert move.train.steps == steps
    assert len(move.train.segments) <= 3
    assert move.up + move.down <= steps
    if move.up:
        assert period_after(move.train, 0) == speeds.initial * speeds.divide


@given(SPEEDS, st.none() | st.integers(3, 9000), st.none() | st.integers(3, 9000))
def test_a_change_goes_only_through_speeds_between(speeds: Speeds, now: int | None, then: int | None) -> None:
    if now is None and then is None:
        return
    found = change(to_fixed(5), speeds, now, then)
    train = Train(found.segments, 0)
    steps = min(found.ramp, 3000)
    times = [5, *(train.time_of(n) for n in range(1, steps + 1))]
    gaps = [(after - before) // TICK for before, after in pairwise(times)]
    rungs = ladder(speeds.initial, speeds.divide).periods
    slow = max(rungs[0] + 1 if one is None else one for one in (now, then))
    fast = min(one for one in (now, then) if one is not None)
    assert all(gap in rungs and fast < gap < slow for gap in gaps)
    assert gaps == sorted(gaps, reverse=now is None or (then is not None and then <= now))
    assert (train.steps is None) == (then is not None)
