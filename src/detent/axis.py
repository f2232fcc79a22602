"""One motor's motion: where the shaft is, which train moves it, when it must be asked again.

The axis costs nothing between the moments at which something changes. Its owner names those moments as
*marks*, numbers of pulses (end of a ramp, a trip point; the last pulse is always one), and is woken at
their times. Only where a wire carries the pulses to another device is every pulse a moment of its own.

The shaft counts every pulse ever given, + for direction +1. A controller's position counter is the shaft
less an origin of the controller's own.
"""

from enum import Enum
from typing import NamedTuple, Protocol, TypeAlias

from detent.pulses import Train
from detent.ticks import NEVER, Ns, instants, to_fixed

Marks: TypeAlias = tuple[int, ...]


class MotionStarted(NamedTuple):
    """From pulse `first` on, the motor gets the pulses of `train` in `direction` (+1 or -1).

    Told at the start of a move (`first` is 1), whenever a running move changes its mind, and when a held
    pulse is let go. Pulses before `first` were given by the trains before it. `shaft` is the motor's place
    at pulse 0 of this motion, so that pulse n ends at shaft + direction * n. `axis` is the motor's name where
    a controller has several.
    """

    at: Ns
    train: Train
    first: int
    direction: int
    shaft: int
    axis: str = ""


class MotionCut(NamedTuple):
    """The train in force stops, perhaps only for a while, after pulse `last`, before its own end."""

    at: Ns
    last: int
    axis: str = ""


class MotionEnded(NamedTuple):
    """The train in force has given its last pulse, `last`, at `at`."""

    at: Ns
    last: int
    axis: str = ""


class Displaced(NamedTuple):
    """The shaft, at rest, was found at `shaft`, and not where its pulses had commanded it to."""

    at: Ns
    shaft: int
    axis: str = ""


class Outbox(Protocol):
    """Where an axis tells what it does: the owner's list of outputs."""

    def append(self, item: MotionStarted | MotionCut | MotionEnded | Displaced, /) -> None:
        """Take the next output."""


class Moment(Enum):
    """What :meth:`Axis.advance` came upon."""

    PULSE = "pulse"  # a pulse that a wire carries, and no mark
    MARK = "mark"  # the pulse of a mark
    END = "end"  # the last pulse
    HELD = "held"  # a pulse fell due while the gate was shut, and waits


class Leeway:
    """How far a position could be elsewhere without making a difference to what its controller did, since `anew`.

    Up to `back` steps below, or `forth` above, every question about it would have been answered as it was.
    """

    __slots__ = ("back", "forth")

    def __init__(self) -> None:
        self.anew()

    def anew(self) -> None:
        """Nobody has asked."""
        self.back = self.forth = NEVER

    def exactly(self) -> None:
        """Somebody has asked where it is."""
        self.back = self.forth = 0

    def within(self, position: int, low: int, high: int) -> None:
        """Somebody has asked whether `position`, which it is, lies within a range."""
        self.back, self.forth = min(self.back, position - low), min(self.forth, high - position)


class Axis:
    """The motion of one motor. `deadline` says when to call `advance`; it is `NEVER` at rest."""

    INSTANTS = instants(deadline=0, train=NEVER)
    PLACES = ("shaft",)
    COUNTS = ("pulses",)

    __slots__ = ("_due", "_held", "_marks", "_open", "_out", "deadline", "direction", "every_pulse",
                 "name", "pulses", "shaft", "train")  # fmt: skip

    def __init__(self, out: Outbox, shaft: int = 0, name: str = "") -> None:
        self.shaft = shaft  # at pulse 0 of the motion under way, or at rest
        self.pulses = 0  # given by all motions before this one
        self.direction = 1
        self.train: Train | None = None
        self.deadline: Ns = NEVER
        self.every_pulse = False
        self.name = name  # where a controller has several
        self._out = out
        self._marks: Marks = ()  # still to come, the last pulse included
        self._due = 0  # the pulse `deadline` stands for, unless that is a mark
        self._open = True
        self._held = False  # the pulse `_due` waits for the gate

    @property
    def moving(self) -> bool:
        """Whether a train is under way, held or not."""
        return self.train is not None

    @property
    def stepping(self) -> bool:
        """Whether its next pulse comes by itself: a train is under way, and the gate is open."""
        return self.train is not None and self._open

    def given(self, now: Ns) -> int:
        """How many pulses this motion has given up to and including `now`."""
        if self.train is None:
            return 0
        return self._due - 1 if self._held else self.train.steps_by(now)

    def shaft_at(self, now: Ns) -> int:
        """Where the shaft is commanded to be, in steps."""
        return self.shaft + self.direction * self.given(now)

    def pulses_at(self, now: Ns) -> int:
        """How many pulses were given since the axis was made."""
        return self.pulses + self.given(now)

    def start(self, train: Train, direction: int, marks: Marks, now: Ns) -> None:
        """Begin `train`, which has at least one step. `marks` rise strictly."""
        if self.train is not None:
            raise RuntimeError("the axis is moving: `replan` or `cut` it first")
        self.train, self.direction = train, direction
        self._marks = _with_last(marks, train)
        self._held = False
        self._out.append(MotionStarted(now, train, 1, direction, self.shaft, self.name))
        self._plan(1)

    def replan(self, train: Train, marks: Marks, now: Ns) -> None:
        """Change the mind of a motion. `train` must give the pulses already sent at the same times."""
        given = self.given(now)
        self.train = train
        self._marks = tuple(mark for mark in _with_last(marks, train) if mark > given)
        if not self._held:
            self._out.append(MotionStarted(now, train, given + 1, self.direction, self.shaft, self.name))
            self._plan(given + 1)

    def remark(self, marks: Marks, now: Ns) -> None:
        """Be woken at other pulses of the motion under way. Marks that have been passed are dropped."""
        assert self.train is not None
        given = self.given(now)
        self._marks = tuple(mark for mark in _with_last(marks, self.train) if mark > given)
        if not self._held:
            self._plan(given + 1)

    def cut(self, now: Ns) -> None:
        """Stop the pulses at once."""
        given = self.given(now)
        if not self._held:
            self._out.append(MotionCut(now, given, self.name))
        self._rest(given)

    def displace(self, by: int, now: Ns) -> None:
        """The shaft is found `by` steps from where it was commanded to. RuntimeError while pulses come.

        At rest, or held: then the pulses that are left come from there.
        """
        if self.train is not None and not self._held:
            raise RuntimeError("the axis is moving: `cut` it first")
        self.shaft += by
        self._out.append(Displaced(now, self.shaft_at(now), self.name))

    def gate(self, is_open: bool, now: Ns) -> None:
        """Shut or open the gate. A pulse that falls due while it is shut is held, and given when it opens.

        Later intervals count from there: the rest of the train moves with the held pulse.
        """
        self._open = is_open
        if self.train is None:
            return
        if not is_open:
            if not self._held:
                self._plan(self.train.steps_by(now) + 1)
        elif self._held:
            self._held = False
            self.train = self.train.shifted(to_fixed(now) - self.train.fixed_time(self._due))
            self._out.append(MotionStarted(now, self.train, self._due, self.direction, self.shaft, self.name))
            self._plan(self._due)
        else:
            self._plan(self.train.steps_by(now) + 1)

    def advance(self, at: Ns) -> tuple[Moment, int]:
        """Deal with the deadline `at`; return what it was and the number of its pulse."""
        train = self.train
        if train is None:
            raise RuntimeError("an axis at rest has no deadline: ask `deadline` before `advance`")
        if not self._open:
            self._held, self.deadline = True, NEVER
            self._out.append(MotionCut(at, self._due - 1, self.name))
            return Moment.HELD, self._due
        marks = self._marks
        if self.every_pulse and (not marks or self._due < marks[0]):
            pulse = self._due
            self._plan(pulse + 1)
            return Moment.PULSE, pulse
        pulse = marks[0]
        self._marks = marks[1:]
        if pulse == train.steps:
            self._out.append(MotionEnded(at, pulse, self.name))
            self._rest(pulse)
            return Moment.END, pulse
        self._plan(pulse + 1)
        return Moment.MARK, pulse

    def _plan(self, due: int) -> None:
        """Set the deadline, when `due` is the next pulse to come."""
        assert self.train is not None
        if self.every_pulse or not self._open:
            self._due = due
            self.deadline = self.train.time_of(due)
        else:
            self.deadline = self.train.time_of(self._marks[0]) if self._marks else NEVER

    def _rest(self, given: int) -> None:
        self.shaft += self.direction * given
        self.pulses += given
        self.train = None
        self.deadline = NEVER
        self._marks = ()
        self._held = False


def _with_last(marks: Marks, train: Train) -> Marks:
    """`marks` within the train, and its last pulse if it has one."""
    if train.steps is None:
        return marks
    return (*(mark for mark in marks if mark < train.steps), train.steps)
