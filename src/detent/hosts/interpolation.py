"""Linear interpolation with drives that know constant speeds in coarse units and start one after the other.

Several axes go straight from one point to another if their speeds are in the ratio of their distances. A drive of
the SUPERSIGMA takes speeds in units of 100 half steps/s, so two speeds seldom have just that ratio: the line is cut
into legs, each from one point of the grid nearest to the line to another, and as long as its speeds allow. What
counts is where an axis is when the longest axis is somewhere: it must be less than a step from the line.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

UNIT = 100  # half steps/s
CLOCK_HZ = 2_000_000  # of the rate generators: a speed is a whole number of clocks a step
LARGEST_SPEED = 255
MESSAGE_SECONDS = 250e-6  # between the starts of two drives: five bytes on the MICROBUS
TOLERANCE = 0.98  # steps


class Leg(NamedTuple):
    """One piece of a line: for each axis its steps, with their sign, and its speed in units (0 if it rests)."""

    steps: tuple[int, ...]
    speeds: tuple[int, ...]

    @property
    def seconds(self) -> float:
        """How long the longest of its movements takes."""
        return (
            max(abs(steps) * period(speed) for steps, speed in zip(self.steps, self.speeds, strict=True) if speed)
            / CLOCK_HZ
        )


def period(speed: int) -> int:
    """Clocks a step at `speed` units: N + 1 with N = INT(2e6/V - 1 + 0.5) (Cassinis, equation 2)."""
    return (2 * CLOCK_HZ // UNIT + speed) // (2 * speed)


def legs(distances: Sequence[int], fastest: int, message: float = MESSAGE_SECONDS) -> Iterator[Leg]:
    """The legs of a straight line by `distances` (signed steps) at no more than `fastest` units on the longest axis.

    Commands of a leg go out longest distance first, `message` seconds apart. ValueError for a speed that no drive has.
    """
    if not 1 <= fastest <= LARGEST_SPEED:
        raise ValueError(f"a speed is 1 to {LARGEST_SPEED} times {UNIT} half steps/s, not {fastest}")
    order = order_of(distances)
    lengths = [abs(distances[axis]) for axis in order]
    at = [0] * len(lengths)
    while lengths and at[0] < lengths[0]:
        leg = _next_leg(lengths, at, fastest, message * CLOCK_HZ)
        steps, speeds = [0] * len(order), [0] * len(order)
        for place, axis in enumerate(order):
            count, speeds[axis] = leg[place]
            steps[axis] = count if distances[axis] > 0 else -count
            at[place] += count
        yield Leg(tuple(steps), tuple(speeds))


def order_of(distances: Sequence[int]) -> list[int]:
    """The axes in the order in which they are started: longest distance first."""
    return sorted(range(len(distances)), key=lambda axis: -abs(distances[axis]))


def _next_leg(lengths: list[int], at: list[int], fastest: int, message: float) -> list[tuple[int, int]]:
    """Steps and speed of each axis, longest first, for the longest leg at the highest speed that keeps to the line."""
    left = lengths[0] - at[0]
    for most, speed in sorted(((_reach(lengths, speed, left), speed) for speed in range(1, fastest + 1)), reverse=True):
        for length in range(most, 0, -1):
            found = _leg(lengths, at, length, speed, message)
            if found is not None:
                return found
    # one step of all that have to go, at one speed, is as near to the line as the grid is
    return [(_target(lengths, place, at[0] + 1) - at[place], fastest) for place in range(len(lengths))]


def _reach(lengths: list[int], speed: int, left: int) -> int:
    """Steps of the longest axis at `speed` behind which some other must have left the line."""
    most = left
    for length in lengths[1:]:
        slope = length / lengths[0]
        drift = (
            min(abs(period(speed) / period(other) - slope) for other in range(1, LARGEST_SPEED + 1)) if length else 0
        )
        if drift:
            most = min(most, max(int(2 / drift), int(2 / slope)) + 1)
    return most


def _target(lengths: list[int], place: int, first: int) -> int:
    """The step of an axis nearest to the line when the longest axis is at step `first`."""
    return (2 * first * lengths[place] + lengths[0]) // (2 * lengths[0])


def _leg(lengths: list[int], at: list[int], length: int, speed: int, message: float) -> list[tuple[int, int]] | None:
    """The leg of `length` steps of the longest axis; None if an axis leaves the line by a step."""
    clocks = length * period(speed)
    found = [(length, speed)]
    delay = 0.0
    for place in range(1, len(lengths)):
        steps = _target(lengths, place, at[0] + length) - at[place]
        if not steps:
            found.append((0, 0))
            continue
        delay += message
        # the speed that ends with the longest axis, or the next: neither may be quicker than that axis
        wanted = CLOCK_HZ / UNIT * steps / max(clocks - delay, 1.0)
        fit = [s for s in (int(wanted), int(wanted) + 1) if 1 <= s <= speed] or [min(max(int(wanted), 1), speed)]
        errors = {s: _error(lengths, at, place, length, speed, steps, s, delay) for s in fit}
        best = min(fit, key=errors.__getitem__)
        if errors[best] > TOLERANCE:
            return None
        found.append((steps, best))
    return found


def _error(
    lengths: list[int], at: list[int], place: int, length: int, speed: int, steps: int, own: int, delay: float
) -> float:
    """The largest distance from the line, in steps of the axis, as both go on evenly from step to step."""
    slope = lengths[place] / lengths[0]
    first, then = period(speed), period(own)
    worst = 0.0
    for clock in (0.0, delay, delay + steps * then, float(length * first)):
        done = min(max(clock - delay, 0.0) / then, steps)
        worst = max(worst, abs(at[place] + done - slope * (at[0] + min(clock / first, length))))
    return worst
