"""Movements through a table of differences: exactly ns pulses, no ramp cut (Cassinis, "Long movements")."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples
from tests.ramps import clockwork

from detent.ramps.differences import PAPER
from detent.ramps.short_movements import movement
from detent.ramps.table_movement import Movement, braked, constant, ramped
from detent.ramps.ways import Way

LOW = 3077  # clocks of the low speed
ALL_ENTRIES = 232


def clocks(made: Movement) -> list[int]:
    times = made.train.times()
    assert not (times % 500).any()
    return [int(each) // 500 for each in times]


def check_ended(made: Movement, steps: int) -> None:
    """Exactly `steps` pulses, and the table has ended when the last comes."""
    assert made.train.steps == made.steps == steps
    assert made.train.time_of(steps) == made.clocks * 500
    if made.loads:
        assert made.loads[-1].entry == 0
        assert made.loads[-1].clock <= made.clocks


@pytest.mark.parametrize(
    ("first", "steps"), [(3076, 5144), (3076, 5145), (3076, 5500), (3176, 3346), (3176, 3400), (5076, 510), (6020, 400)]
)
def test_the_pulses_come_as_the_papers_steps_a_to_g_give_them_clock_by_clock(first: int, steps: int) -> None:
    assert clocks(ramped(PAPER, first, ALL_ENTRIES, steps, 10)) == clockwork.movement(PAPER.differences, first, steps)


@pytest.mark.parametrize(
    ("first", "up"), [(3076, 2567), (3176, 1668), (3576, 735), (4076, 443), (5076, 250), (6020, 178)]
)
def test_the_family_of_figure_10_has_these_ramps(first: int, up: int) -> None:
    assert ramped(PAPER, first, ALL_ENTRIES, 6000, 10).up == up


def test_the_shortest_long_movement_has_5144_half_steps_which_are_about_2600_steps() -> None:
    made = ramped(PAPER, 3076, ALL_ENTRIES, 5144, 10)
    assert (made.up, made.down) == (2567, 2567)
    assert 5144 / 2 == 2572
    with pytest.raises(ValueError, match="5143 steps are too few for two ramps of 2567 and the offset 10"):
        ramped(PAPER, 3076, ALL_ENTRIES, 5143, 10)


def test_with_less_than_4_in_reserve_a_table_would_end_after_the_pulses() -> None:
    check_ended(ramped(PAPER, 3076, ALL_ENTRIES, 6000, 4), 6000)
    with pytest.raises(ValueError, match="the table ends at pulse 6001 of 6000: the offset 3 is too small"):
        ramped(PAPER, 3076, ALL_ENTRIES, 6000, 3)


def test_every_ramp_of_a_long_movement_takes_its_232_loads_of_1_29_ms() -> None:
    made = ramped(PAPER, 3076, ALL_ENTRIES, 8000, 10)
    up, down = made.loads[:ALL_ENTRIES], made.loads[ALL_ENTRIES:]
    assert [load.clock for load in up] == [2580 * i for i in range(1, 233)]
    assert [load.clock - down[0].clock for load in down] == [2580 * i for i in range(232)]
    assert down[0].clock * 500 == made.train.time_of(made.down)
    assert [load.entry for load in up + down] == [*range(1, 233), *range(231, -1, -1)]


SHORT, LONG = random.Random(8748).sample(range(1, 5144), 60), random.Random(8253).sample(range(5144, 65_536), 25)
EDGES = (1, 2, 3, 9, 10, 11, 12, 24, 400, 403, 404, 405, 5143, 5144, 5145, 65_534, 65_535)
SAMPLE = sorted({*EDGES, *SHORT, *LONG})


@pytest.mark.parametrize("way", Way)
@pytest.mark.parametrize("offset", [4, 10, 37])
def test_a_movement_has_exactly_its_pulses_and_ends_after_its_table(way: Way, offset: int) -> None:
    for steps in SAMPLE:
        check_ended(movement(PAPER, steps, offset, way, ALL_ENTRIES), steps)


@pytest.mark.slow
@pytest.mark.parametrize("way", Way)
@pytest.mark.parametrize("offset", [4, 10])
def test_every_short_movement_has_exactly_its_pulses_and_ends_after_its_table(way: Way, offset: int) -> None:
    for steps in range(1, 5144):
        check_ended(movement(PAPER, steps, offset, way, ALL_ENTRIES), steps)


@pytest.mark.slow
def test_every_long_movement_has_exactly_its_pulses_and_ends_after_its_table() -> None:
    for steps in range(5144, 65_536):
        check_ended(movement(PAPER, steps, 10, Way.HYPERBOLA, ALL_ENTRIES), steps)


@pytest.mark.parametrize("entries", [0, 1, 2, 31, 100, 166, 231])
def test_so_does_one_with_a_speed_limit_which_it_keeps(entries: int) -> None:
    fastest = PAPER.counts()[entries] + 1
    for way in Way:
        for steps in SAMPLE[::5]:
            made = movement(PAPER, steps, 10, way, entries)
            check_ended(made, steps)
            assert min(int(p) for s in made.train.segments for p in s.rows.periods) >= fastest


MOVEMENTS = st.one_of(
    st.builds(lambda n, way: movement(PAPER, n, 10, way, ALL_ENTRIES), st.integers(1, 7000), st.sampled_from(Way)),
    st.builds(lambda n, e: movement(PAPER, n, 10, Way.EXACT, e), st.integers(1, 7000), st.sampled_from([1, 50, 150])),
    st.builds(constant, st.integers(100, 9000), st.integers(1, 1000)),
)


@settings(deadline=None, max_examples=examples(150))
@given(MOVEMENTS, st.floats(0, 1), st.sampled_from([645, 2580, 1]), st.floats(0, 1), st.sampled_from([645, 2580]))
def test_a_braked_movement_keeps_its_past_and_ends_at_low_speed(
    made: Movement, part: float, interval: int, again: float, second: int
) -> None:
    for at, every in ((int(made.clocks * part), interval), (int(made.clocks * (part + again)), second)):
        if at >= made.clocks:
            return
        shorter = braked(made, at, every)
        assert 1 <= shorter.steps <= made.steps
        before = [clock for clock in clocks(made) if clock <= at]
        assert clocks(shorter)[: len(before)] == before
        assert shorter.steps > len(before)
        low = shorter.counts[0] + 1
        if shorter is not made:
            assert shorter.clocks <= made.clocks
            assert int(shorter.train.segments[-1].rows.periods[-1]) == low
            assert all(load.entry >= 0 for load in shorter.loads)
            check_ended(shorter, shorter.steps)
        made = shorter


def test_movements_that_are_planned_apart_are_equal() -> None:
    one = ramped(PAPER, 3076, ALL_ENTRIES, 20_000, 10)
    ramped.cache_clear()
    other = ramped(PAPER, 3076, ALL_ENTRIES, 20_000, 10)
    assert one.train.segments[0] is not other.train.segments[0]
    assert one == other
    assert hash(one.train) == hash(other.train)
    assert one != ramped(PAPER, 3076, ALL_ENTRIES, 20_001, 10)


def test_braking_runs_the_table_back_from_the_present_entry() -> None:
    made = ramped(PAPER, 3076, ALL_ENTRIES, 20_000, 10)
    shorter = braked(made, 100 * 2580, 645)
    assert [load.entry for load in shorter.loads] == [*range(1, 101), *range(99, -1, -1)]
    assert [load.clock - 258_000 for load in shorter.loads[100:]] == [645 * i for i in range(100)]


def test_a_stop_leaves_a_ramp_down_as_it_is_and_an_emergency_makes_it_steeper() -> None:
    made = ramped(PAPER, 3076, ALL_ENTRIES, 20_000, 10)
    at = made.loads[300].clock + 7
    stopped, emergency = braked(made, at, 2580), braked(made, at, 645)
    assert stopped.loads == made.loads
    assert stopped.steps < made.steps  # without the steps at low speed behind the ramp
    assert emergency.clocks < stopped.clocks
    assert braked(stopped, at, 645).loads == emergency.loads
    assert braked(emergency, at + 700, 2580).loads == emergency.loads


def test_braking_at_top_speed_takes_a_quarter_of_the_ramp() -> None:
    made = ramped(PAPER, 3076, ALL_ENTRIES, 20_000, 10)
    at = 1_000_000
    given = sum(clock <= at for clock in clocks(made))
    stop, emergency = (braked(made, at, interval).steps - given for interval in (2580, 645))
    assert stop == pytest.approx(2567, abs=5)
    assert emergency == pytest.approx(2567 / 4, abs=5)
