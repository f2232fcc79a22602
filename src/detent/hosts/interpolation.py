"""Linear interpolation with drives that know constant speeds in coarse units and take no command while they move.

Several axes go on a straight line if their speeds are in the ratio of their distances. A drive of the SUPERSIGMA takes
speeds in units of 100 half steps/s, so two speeds seldom have just that ratio. The longest axis goes the whole way in
one movement, at one speed, and never stops. Every other axis follows it in movements of its own, a little too fast or
a little too slow, one after the other: at constant speed there is no ramp between two of them, only the time that the
CCU needs to see that one has ended and to send the next.

What counts are pulses. Let the longest axis make D steps and another d < D. When it has made x of them the other must
have made y, with |y - x d/D| < 1: so pulse y may come from pulse floor((y - 1) D/d) + 1 of the longest axis on, and
before its pulse ceil(y D/d). These are the windows that the movements are fitted into, in whole clocks. Two axes of
equal distances are a whole step apart between the pulse of one and the pulse of the other; their windows are two
pulses wide, from pulse y - 1 to pulse y + 1.
"""

from bisect import bisect_left, insort
from collections.abc import Sequence
from typing import Final, NamedTuple

UNIT: Final = 100  # half steps/s
CLOCK_HZ: Final = 2_000_000  # of the rate generators: a speed is a whole number of clocks a step
LARGEST_SPEED: Final = 255
MESSAGE: Final = 500  # clocks that a command of five bytes takes on the bus, as do the two and three of a status
EXCHANGE: Final = 2 * MESSAGE  # from the question whether a movement has ended to the end of the next command
BOOKED: Final = 3 * MESSAGE  # the same, and the status of the longest axis behind it
LATE: Final = 600  # clocks that the CCU may be late with a command


class Run(NamedTuple):
    """One movement of an axis: `at` clocks behind the command of the longest axis its own has been taken."""

    at: int
    axis: int
    steps: int  # with their sign
    speed: int  # units

    @property
    def end(self) -> int:
        """The clock of its last pulse."""
        return self.at + abs(self.steps) * period(self.speed)


def period(speed: int) -> int:
    """Clocks a step at `speed` units: N + 1 with N = INT(2e6/V - 1 + 0.5) (Cassinis, equation 2)."""
    return (2 * CLOCK_HZ // UNIT + speed) // (2 * speed)


def order_of(distances: Sequence[int]) -> list[int]:
    """The axes that move, longest distance first."""
    return sorted((axis for axis, steps in enumerate(distances) if steps), key=lambda axis: -abs(distances[axis]))


def together(distances: Sequence[int], speed: int) -> int:
    """The speed, in units and no more than `speed`, to which axes of equal distances may go up with their ramps.

    Their movements are the same, one `MESSAGE` after the other, and no step may come to lie between two others. 0 for
    distances that are not equal: with ramps, speeds are in no ratio.
    """
    moving = [abs(steps) for steps in distances if steps]
    if len(set(moving)) != 1:
        return 0
    apart = max((len(moving) - 1) * MESSAGE, 1)
    return min(speed, (CLOCK_HZ - 1) // (apart * UNIT))


def line(distances: Sequence[int], fastest: int) -> list[Run]:
    """The movements of a straight line by `distances` (signed steps), none above `fastest` units, in order of time.

    The first is that of the longest axis, at 0; those that follow it at every `MESSAGE` clocks go out with it. It is as
    fast as the others can follow. ValueError for a speed that no drive has.
    """
    if not 1 <= fastest <= LARGEST_SPEED:
        raise ValueError(f"a speed is 1 to {LARGEST_SPEED} times {UNIT} half steps/s, not {fastest}")
    order = order_of(distances)
    if not order:
        return []
    for speed in range(fastest, 0, -1):
        runs = _with_lead(distances, order, speed, fastest)
        if runs is not None:
            return sorted(runs)
    raise AssertionError(f"no axis can follow another at {UNIT} half steps/s")


def _with_lead(distances: Sequence[int], order: list[int], speed: int, fastest: int) -> list[Run] | None:
    """The line with the longest axis at `speed`; None if another cannot follow."""
    lead = order[0]
    runs = [Run(0, lead, distances[lead], speed)]
    booked: list[int] = []  # when the bus is busy with commands: the ends of these, in order
    begun = (len(order) - 1) * MESSAGE + EXCHANGE
    for place, axis in enumerate(order[1:], 1):
        follower = _Follower(abs(distances[lead]), abs(distances[axis]), speed, fastest, booked, begun)
        found = follower.runs(place * MESSAGE)
        if found is None:
            return None
        sign = 1 if distances[axis] > 0 else -1
        runs += [Run(at, axis, sign * steps, own) for at, steps, own in found]
    return runs


class _Follower:
    """An axis of `steps` steps that follows the longest, of `far` steps at `speed` units."""

    def __init__(self, far: int, steps: int, speed: int, fastest: int, booked: list[int], begun: int) -> None:
        self.far, self.steps, self.lead, self.booked = far, steps, period(speed), booked
        self.quickest = period(fastest)
        self.begun = begun  # the clock from which on the bus is free of the commands that begin the line
        wanted = speed * steps / far
        near = range(max(int(wanted) - 1, 1), min(int(wanted) + 3, fastest) + 1)
        self.speeds = sorted({*near, fastest}, key=lambda own: abs(own - wanted))

    def runs(self, first: int) -> list[tuple[int, int, int]] | None:
        """When each movement is commanded, its steps, its speed; the first at `first`. None: it cannot follow."""
        found: list[tuple[int, int, int]] = []
        done, earliest = 0, first
        while done < self.steps:
            choices = [(*self.longest(done, earliest, period(own), fixed=not done), own) for own in self.speeds]
            most = max(choices, key=lambda choice: choice[0])
            steps, at, own = most
            if not steps:
                return None
            if done:
                insort(self.booked, at)
            found.append((at, steps, own))
            done += steps
            earliest = at + steps * period(own) + LATE + EXCHANGE
        return found

    def longest(self, done: int, earliest: int, clocks: int, *, fixed: bool) -> tuple[int, int]:
        """The most steps, `clocks` apart, behind the first `done`, and when they are commanded; 0 if there are none."""
        low, high = earliest, 1 << 62
        starts: list[int] = []
        for step in range(1, self.steps - done + 1):
            low = max(low, self.opens(done + step) - step * clocks)
            high = min(high, self.closes(done + step) - step * clocks)
            start = low if fixed else self.free(low)
            if start + LATE > high or (fixed and start > earliest):
                break
            starts.append(start)
        while starts:
            steps, start = len(starts), starts[-1]
            if done + steps == self.steps or self.may_follow(done + steps, start + steps * clocks):
                return steps, start
            starts.pop()
        return 0, 0

    def may_follow(self, done: int, end: int) -> bool:
        """Whether a movement that ends then leaves time for the next."""
        return self.free(end + LATE + EXCHANGE) + LATE + self.quickest <= self.closes(done + 1)

    def opens(self, step: int) -> int:
        """The first clock at which a step may come: behind the pulse of the longest axis that makes room for it."""
        return ((step - 1) * self.far // self.steps + (self.far > self.steps)) * self.lead + 1

    def closes(self, step: int) -> int:
        """The last clock at which a step may come: before the pulse of the longest axis that it must not miss."""
        return (-(-step * self.far // self.steps) + (self.far == self.steps)) * self.lead - 1

    def free(self, at: int) -> int:
        """The first clock from `at` on at which a command can end: the bus is free for it and what goes with it."""
        at = max(at, self.begun)
        place = bisect_left(self.booked, at - BOOKED + 1)
        while place < len(self.booked) and self.booked[place] < at + BOOKED:
            at = self.booked[place] + BOOKED
            place += 1
        return at
