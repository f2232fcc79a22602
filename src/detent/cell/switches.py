"""Switches of a cell: set by hand or by the script, or closed by an axis at a position or over a range.

A switch that sits on an axis changes at the exact pulse: it asks the train when its edge is crossed, and costs
nothing in between.
"""

from collections.abc import Sequence

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.controllers.device import DriveSet, Output, Powered, StageSet
from detent.pins import HIGH, LOW, Level, Pin, PinKind, PinSet
from detent.ticks import NEVER, Ns, instants
from detent.uart import Char

CONTACT = "OUT"


class Switch:
    """A contact that somebody sets (`set_pin("SET", level)`): a panel switch, a level from outside."""

    INSTANTS = instants(deadline=0)
    pins: Sequence[Pin] = (Pin(CONTACT, None, PinKind.OUTPUT, "the contact"),)

    def __init__(self, level: Level) -> None:
        self.level = level
        self.deadline: Ns = NEVER
        self._out: list[Output] = []

    def power(self, on: bool, now: Ns) -> None:
        """A contact has no supply; at the start of a cell it tells its level."""
        if on:
            self._out.append(PinSet(now, CONTACT, self.level))

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> None:
        """A contact has no serial port."""

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """Put the switch to `level`."""
        self._change(level, now)

    def stored(self, ok: bool, now: Ns) -> None:
        """A contact stores nothing."""

    def next_deadline(self) -> Ns | None:
        """When it changes by itself."""
        return None if self.deadline >= NEVER else self.deadline

    def advance(self, now: Ns) -> None:
        """Nothing is ever due on a switch that is set by hand."""

    def drain(self) -> list[Output]:
        """Its changes of level."""
        out, self._out = self._out, []
        return out

    def watch(self, pin: str) -> None:
        """A contact gives no pulses."""

    def _change(self, level: Level, now: Ns) -> None:
        if level != self.level:
            self.level = level
            self._out.append(PinSet(now, CONTACT, level))


class AxisSwitch(Switch):
    """A contact on an axis: at `inside` while the shaft is between `low` and `high` steps, both included.

    None for an end means that the range goes on without end there.
    """

    def __init__(self, low: int | None, high: int | None, inside: Level, shaft: int = 0, axis: str = "") -> None:
        self._low, self._high, self._inside, self._axis = low, high, inside, axis
        self._motion: MotionStarted | None = None
        self._shaft = shaft  # where the motion before this one ended
        self._pulse = 0  # the one at which the level changes next
        super().__init__(self._level_at(shaft))

    def follow(self, motion: MotionStarted | MotionCut | MotionEnded) -> None:
        """The axis starts, stops or changes its mind. What the pulses given so far have crossed comes first."""
        if motion.axis != self._axis:
            return
        last = motion.first - 1 if isinstance(motion, MotionStarted) else motion.last
        while self.deadline <= motion.at and self._pulse <= last:
            self._cross()
        if isinstance(motion, MotionStarted):
            self._motion = motion
            self._plan(motion, motion.first)
        else:
            if self._motion is not None:
                self._shaft = self._motion.shaft + self._motion.direction * motion.last
            self._motion, self.deadline = None, NEVER

    def heed(self, told: DriveSet | StageSet | Powered) -> None:
        """It counts pulses: the windings are nothing to it."""

    @property
    def range(self) -> tuple[int | None, int | None]:
        """First and last step at which it has its level inside."""
        return self._low, self._high

    def move_contact(self, name: str, low: float | None, high: float | None, now: Ns) -> None:
        """Put it elsewhere: whole steps. ValueError for others, and for an end before the beginning."""
        if any(place is not None and place % 1 != 0 for place in (low, high)):  # nor infinity, nor NaN
            raise ValueError(f"switch {name} is placed in whole steps")
        if low is None and high is None:
            raise ValueError(f"switch {name} needs a place: an end at least")
        if low is not None and high is not None and low > high:
            raise ValueError(f"switch {name} ends at {high:g}, before it begins at {low:g}: exchange them")
        self._low, self._high = None if low is None else int(low), None if high is None else int(high)
        motion, shaft, given = self._motion, self._shaft, 0
        if motion is not None:
            given = max(motion.train.steps_by(now), motion.first - 1)
            shaft = motion.shaft + motion.direction * given
        self._change(self._level_at(shaft), now)
        if motion is not None:
            self._plan(motion, given + 1)

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """A hand may hold the contact; the axis moves it on at its next edge."""
        self._change(level, now)

    def advance(self, now: Ns) -> None:
        """The shaft crosses an edge."""
        while self.deadline <= now:
            self._cross()

    def _cross(self) -> None:
        motion, pulse = self._motion, self._pulse
        assert motion is not None
        self._change(self._level_at(motion.shaft + motion.direction * pulse), self.deadline)
        self._plan(motion, pulse + 1)

    def _level_at(self, shaft: int) -> Level:
        within = (self._low is None or shaft >= self._low) and (self._high is None or shaft <= self._high)
        return self._inside if within else HIGH + LOW - self._inside

    def _plan(self, motion: MotionStarted, first: int) -> None:
        """Find the first pulse from `first` on that enters or leaves the range."""
        edges = []
        if motion.direction > 0:
            if self._low is not None:
                edges.append(self._low)
            if self._high is not None:
                edges.append(self._high + 1)
        else:
            if self._high is not None:
                edges.append(self._high)
            if self._low is not None:
                edges.append(self._low - 1)
        steps = motion.train.steps
        pulses = [(edge - motion.shaft) * motion.direction for edge in edges]
        ahead = [pulse for pulse in pulses if pulse >= first and (steps is None or pulse <= steps)]
        self._pulse = min(ahead, default=0)
        self.deadline = motion.train.time_of(self._pulse) if ahead else NEVER
