"""Linear interpolation: legs that keep to the line by less than a step (Cassinis, "The problem")."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from detent.hosts.interpolation import CLOCK_HZ, MESSAGE_SECONDS, Leg, legs, order_of, period

FASTEST = 6


def deviation(distances: tuple[int, ...], found: list[Leg]) -> float:
    """The largest distance of any axis from the line, in its own steps, as all go on evenly; sampled at every step."""
    worst = 0.0
    at = [0] * len(distances)
    for leg in found:
        worst = max(worst, within(distances, at, leg))
        at = [a + steps for a, steps in zip(at, leg.steps, strict=True)]
    assert tuple(at) == distances
    return worst


def within(distances: tuple[int, ...], at: list[int], leg: Leg) -> float:
    order = order_of(distances)
    going = [axis for axis in order if leg.steps[axis]]
    delays = {axis: place * MESSAGE_SECONDS * CLOCK_HZ for place, axis in enumerate(going)}

    def place(axis: int, clock: float) -> float:
        if axis not in delays:
            return at[axis]
        done = min(max(clock - delays[axis], 0) / period(leg.speeds[axis]), abs(leg.steps[axis]))
        return at[axis] + (done if leg.steps[axis] > 0 else -done)

    worst = 0.0
    for axis in going:
        for step in range(abs(leg.steps[axis]) + 1):
            clock = delays[axis] + step * period(leg.speeds[axis])
            lead = place(order[0], clock)
            for other in order:
                worst = max(worst, abs(place(other, clock) - lead * distances[other] / distances[order[0]]))
    return worst


DISTANCE = st.integers(-400, 400).filter(bool)


@settings(deadline=None, max_examples=150)
@given(st.lists(DISTANCE, min_size=2, max_size=4), st.integers(1, FASTEST))
def test_no_axis_is_ever_a_step_away_from_the_line(distances: list[int], fastest: int) -> None:
    found = list(legs(distances, fastest))
    assert deviation(tuple(distances), found) < 1
    assert all(0 <= speed <= fastest for leg in found for speed in leg.speeds)


def test_speeds_in_the_very_ratio_of_the_distances_make_one_leg() -> None:
    assert list(legs((3000, -2000, 1000), 6)) == [Leg((3000, -2000, 1000), (6, 4, 2))]
    assert list(legs((1000, 1000), 6)) == [Leg((1000, 1000), (6, 6))]


def test_all_axes_arrive_together_to_less_than_a_step_of_the_slower() -> None:
    for distances in ((5000, 3217), (401, 399), (77, 65), (1000, 501)):
        *_, leg = legs(distances, 6)
        fast, slow = (steps * period(speed) for steps, speed in zip(leg.steps, leg.speeds, strict=True))
        assert abs(fast - (MESSAGE_SECONDS * CLOCK_HZ + slow)) < period(leg.speeds[1])


def test_nothing_to_do_makes_no_leg_and_one_axis_makes_one() -> None:
    assert list(legs((), 6)) == []
    assert list(legs((-700,), 6)) == [Leg((-700,), (6,))]


def test_a_speed_that_no_drive_has_is_refused() -> None:
    for speed in (0, 256):
        with pytest.raises(ValueError, match="a speed is 1 to 255 times 100 half steps/s"):
            list(legs((1, 2), speed))
