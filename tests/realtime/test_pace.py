from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.realtime.ticking import Wall

from detent.realtime.pace import LATEST, Lateness, Pace
from detent.ticks import NEVER

HOUR = 3_600_000_000_000


@given(st.fractions(Fraction(1, 1000), 1000), st.integers(0, 10**18), st.integers(0, 10**15))
def test_due_is_the_first_instant_at_which_the_cell_has_come_so_far(factor: Fraction, at: int, origin: int) -> None:
    pace = Pace(factor, origin=origin, clock=Wall())
    due = pace.due(origin + at)
    assert due is not None
    assert pace.at(due) >= origin + at
    assert pace.at(due - 1) < origin + at


def test_a_year_at_a_third_of_real_time_is_exact() -> None:
    wall = Wall()
    pace = Pace(Fraction(1, 3), origin=5, clock=wall)
    assert pace.at(wall.now + 3 * 24 * 365 * HOUR) == 5 + 24 * 365 * HOUR


def test_a_tenth_means_a_tenth() -> None:
    assert Pace(0.1, clock=Wall()).factor == Fraction(1, 10)


@pytest.mark.parametrize("factor", [0, -1, -0.5, float("nan"), float("inf")])
def test_time_does_not_stand_still_or_go_back(factor: float) -> None:
    with pytest.raises(ValueError, match="is no pace; it takes a number above 0"):
        Pace(factor, clock=Wall())


@pytest.mark.parametrize("factor", [1e-10, 1e30, 1e300, Fraction(1, 10**12)])
def test_a_pace_beyond_all_use_is_refused(factor: float) -> None:
    with pytest.raises(ValueError, match="out of reach; it takes 1e-09 to 1e\\+09, 1 is real time"):
        Pace(factor)
    with pytest.raises(ValueError, match="out of reach"):
        Pace().change(factor, 0)


def test_time_ends_before_deadlines_that_never_come() -> None:
    clock = iter([0, 10**40])
    pace = Pace(10**9, clock=lambda: next(clock))
    assert pace.at(pace.clock()) == LATEST < NEVER


def test_a_restarted_clock_forgets_the_time_before() -> None:
    wall = Wall()
    pace = Pace(2, clock=wall)
    wall.now += HOUR
    pace.restart(1_000)
    assert pace.at(wall.now) == 1_000
    assert pace.at(wall.now + 5) == 1_010


def test_a_held_clock_stands_and_goes_on_where_it_stood() -> None:
    wall = Wall()
    pace = Pace(2, clock=wall)
    wall.now += 100
    pace.hold(200)
    wall.now += HOUR
    assert pace.at(wall.now) == 200
    assert pace.due(200) == wall.now - HOUR
    assert pace.due(201) is None
    pace.go(200)
    assert pace.at(wall.now + 7) == 214


def test_a_free_clock_lets_everything_be_due_and_goes_back_to_a_pace() -> None:
    wall = Wall()
    pace = Pace(3, clock=wall)
    pace.change(None, 50)
    assert pace.at(wall.now) == NEVER
    assert pace.due(10**18) == wall.now
    pace.hold(60)
    assert (pace.at(wall.now), pace.due(70)) == (60, None)
    pace.go(60)
    pace.change(0.5, 80)
    assert not pace.free
    assert pace.at(wall.now + 10) == 85


def test_a_pace_that_would_not_go_forward_changes_nothing() -> None:
    pace = Pace(3, clock=Wall())
    with pytest.raises(ValueError, match="is no pace"):
        pace.change(0, 5)
    assert pace.factor == 3
    assert pace.at(pace.clock()) == 0


@given(st.lists(st.integers(0, 1 << 45), min_size=1, max_size=200), st.integers(1, 100))
def test_a_percentile_is_never_too_low_and_at_most_a_sixteenth_too_high(values: list[int], percent: int) -> None:
    lateness = Lateness()
    for value in values:
        lateness.note(value)
    exact = sorted(values)[-(-len(values) * percent // 100) - 1]
    found = lateness.percentile(percent)
    if exact <= 1 << 40:
        assert exact <= found <= exact + exact // 16
    assert lateness.most == max(values)
    assert lateness.count == len(values)


def test_a_deadline_served_early_counts_as_on_time() -> None:
    lateness = Lateness()
    lateness.note(-5)
    assert lateness.summary() == (1, 0, 0, 0)


def test_lateness_reads_as_one_line() -> None:
    lateness = Lateness()
    assert str(lateness.summary()) == "no deadlines"
    for _ in range(100):
        lateness.note(15)
    lateness.note(2_500_000)
    assert str(lateness.summary()) == (
        "101 deadlines, late by 0.000 ms (half of them), 0.000 ms (99 %), 2.500 ms (all)"
    )
