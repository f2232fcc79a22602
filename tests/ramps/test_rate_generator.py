"""The rate generator against the same, clock by clock (Cassinis, equation 1 and "Firmware")."""

from hypothesis import given
from hypothesis import strategies as st
from tests.ramps import clockwork

from detent.ramps.rate_generator import RateGenerator

LOADS = st.lists(st.tuples(st.integers(0, 40), st.integers(1, 30)), max_size=12)


@given(st.integers(1, 30), LOADS, st.integers(0, 20))
def test_pulses_come_as_they_do_clock_by_clock(first: int, gaps: list[tuple[int, int]], more: int) -> None:
    generator, loads, clock = RateGenerator(first), [], 0
    for gap, n in gaps:
        clock += gap
        loads.append((clock, n))
        generator.load(clock, n)
    generator.run_to(generator.pulses + more + 1)
    expected = clockwork.pulses(first, loads, generator.at)
    assert [each // 500 for each in map(int, _times(generator))] == expected
    assert generator.pulses == len(expected)


def _times(generator: RateGenerator) -> list[int]:
    table = generator.table()
    return [table.ns(n, 0) for n in range(1, table.steps + 1)]


def test_the_first_pulse_comes_n_plus_1_clocks_after_the_start() -> None:
    generator = RateGenerator(3076)
    generator.run_to(1)
    assert generator.at == 3077


def test_a_new_count_takes_effect_when_the_running_period_ends_and_the_last_of_two_wins() -> None:
    generator = RateGenerator(99)
    generator.load(120, 49)
    generator.load(180, 9)
    generator.run_to(4)
    assert generator.rows == [(2, 100), (2, 10)]


def test_of_a_pulse_and_a_load_on_one_clock_the_pulse_is_first() -> None:
    generator = RateGenerator(99)
    generator.load(100, 9)
    generator.run_to(3)
    assert generator.rows == [(2, 100), (1, 10)]
