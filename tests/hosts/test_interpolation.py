"""Linear interpolation: every pulse within a step of the line (Cassinis, "The problem")."""

from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.hosts.interpolation import BOOKED, CLOCK_HZ, EXCHANGE, LATE, MESSAGE, Run, line, order_of, period, together

DISTANCES = st.lists(st.integers(-2500, 2500), min_size=1, max_size=5)


def pulses(runs: Sequence[Run], axis: int, late: int) -> list[int]:
    """The clocks of the pulses of an axis, if every command but the first ones is `late`."""
    found: list[int] = []
    for run in runs:
        if run.axis == axis:
            begin = run.at + (late if found else 0)
            found += [begin + step * period(run.speed) for step in range(1, abs(run.steps) + 1)]
    return found


def check(distances: Sequence[int], fastest: int, late: int) -> None:
    """Against whole numbers: at no pulse of any axis is another as far as a step from the line."""
    runs = line(distances, fastest)
    assert [sum(run.steps for run in runs if run.axis == axis) for axis in range(len(distances))] == list(distances)
    assert all(1 <= run.speed <= fastest for run in runs)
    order = order_of(distances)
    if not order:
        assert not runs
        return
    lead = pulses(runs, order[0], 0)
    far = abs(distances[order[0]])
    for axis in order[1:]:
        own = pulses(runs, axis, late)
        assert own == sorted(own)
        most = abs(distances[axis])
        events = sorted([(at, 0) for at in lead] + [(at, 1) for at in own])
        made = [0, 0]
        for at, which in events:
            made[which] += 1
            off = abs(made[1] * far - made[0] * most)
            assert off < far or (most == far and off == far), f"axis {axis} is {off}/{far} steps off at {at}"


def check_bus(distances: Sequence[int], fastest: int) -> None:
    """No command is sent before the one before of its axis has ended, nor two at a time."""
    runs = line(distances, fastest)
    axes = len(order_of(distances))
    first = [run for place, run in enumerate(runs[:axes]) if run.at == place * MESSAGE]
    ends = {run.axis: run.end for run in first}
    busy = (len(first) - 1) * MESSAGE - BOOKED + EXCHANGE
    for run in runs[len(first) :]:
        assert run.at - EXCHANGE >= ends.get(run.axis, 0) + (LATE if run.axis in ends else 0)
        assert run.at >= busy + BOOKED
        busy = run.at
        ends[run.axis] = run.end


@given(DISTANCES, st.integers(1, 12), st.sampled_from([0, 0, LATE]))
@settings(max_examples=examples(120))
def test_no_axis_is_ever_a_step_off_the_line_in_pulses(distances: list[int], fastest: int, late: int) -> None:
    check(distances, fastest, late)
    check_bus(distances, fastest)


@pytest.mark.slow
@given(DISTANCES, st.integers(1, 255), st.sampled_from([0, 0, LATE]))
@settings(max_examples=10_000)
def test_no_axis_is_ever_a_step_off_the_line_in_pulses_at_length(distances: list[int], fastest: int, late: int) -> None:
    check(distances, fastest, late)
    check_bus(distances, fastest)


@pytest.mark.parametrize(
    "distances", [(12345, 6789, -321), (5000, 3217, -1234), (401, 399, 7), (1000, 999), (3000, -2000, 1000), (9, 9, 8)]
)
def test_the_longest_axis_goes_at_its_speed_all_the_way(distances: tuple[int, ...]) -> None:
    runs = line(distances, 6)
    assert runs[0] == Run(0, 0, distances[0], 6)
    assert [run.axis for run in runs].count(0) == 1
    assert max(run.end for run in runs) <= runs[0].end + 2 * MESSAGE
    check(distances, 6, 0)


def test_at_a_speed_at_which_the_others_cannot_follow_the_longest_axis_goes_slower() -> None:
    runs = line((5000, 3217), 20)
    assert 12 <= runs[0].speed < 20
    check((5000, 3217), 20, 0)


def test_nothing_to_do_makes_no_movement_and_one_axis_makes_one() -> None:
    assert line((), 6) == line((0, 0), 6) == []
    assert line((-700,), 6) == [Run(0, 0, -700, 6)]


def test_a_speed_that_no_drive_has_is_refused() -> None:
    for speed in (0, 256):
        with pytest.raises(ValueError, match="a speed is 1 to 255 times 100 half steps/s"):
            line((1, 2), speed)


@pytest.mark.parametrize(
    ("distances", "speed"),
    [((700, -700), 39), ((700, 0, 700, 700), 19), ((700,), 255), ((700, 699), 0), ((5,) * 7, 6), ((), 0)],
)
def test_axes_of_equal_distances_may_have_ramps_up_to_a_step_in_a_message(
    distances: tuple[int, ...], speed: int
) -> None:
    assert together(distances, 255) == speed
    moving = sum(map(bool, distances))
    assert not speed or period(speed) > (moving - 1) * MESSAGE or speed * 100 < CLOCK_HZ
