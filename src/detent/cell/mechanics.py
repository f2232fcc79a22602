"""The mechanics of a cell: a motor with its drive and load on the pulses of a unit, and what its rotor moves.

It follows the trains of a unit (or a wire with step pulses) and computes the rotor only as far as somebody must know:
when a contact on its axis, a step detector or an encoder is wired, it looks ahead for the crossing and asks to be
woken there; otherwise it costs nothing until it is asked where it is. What it computes depends on the pulses and on
the current alone, not on when it was asked: a look ahead that proves wrong, because a motion changed its mind, is
thrown away.
"""

from collections.abc import Sequence
from copy import copy, deepcopy
from math import ceil, floor, inf
from typing import Any, NamedTuple

import numpy as np

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.recording import Log
from detent.controllers.device import Output
from detent.motors import kernel
from detent.motors.drive import FAST, SLOW
from detent.motors.excitation import NOTHING, Changes, Sequencer, at_once
from detent.motors.rotor import Floats, Rig, Rotor
from detent.pins import HIGH, LOW, Level, Pin, PinDriver, PinKind
from detent.ticks import MS, NEVER, US, Ns
from detent.uart import Char

SLICE: Ns = 20 * MS  # a rotor is asked so often whether it has come to rest, and looked ahead so far
LONGEST_SWING: Ns = 1000 * MS  # behind the last pulse; a rotor that swings on (nothing damps it) is then taken to rest
STILL = 1e-3  # rad/s: slower is at rest
SAMPLE: Ns = 50 * US  # of the trace
CHUNK = 1 << 14  # pulses in one go

PINS: tuple[Pin, ...] = (
    Pin("MOV", None, PinKind.INPUT, "drive: 0 takes the current to rest (of a GS-C200)"),
    Pin("RAMP", None, PinKind.INPUT, "drive: 0 takes the current from ramp to slew"),
    Pin("ENABLE", None, PinKind.INPUT, "drive: 0 switches the windings off"),
    Pin("DECAY", None, PinKind.INPUT, "drive: 1 slow decay, 0 fast; not wired: as the drive is set"),
    Pin("HALF", None, PinKind.INPUT, "drive: 1 each pulse one place of the sequence, 0 two (full steps)"),
    Pin("CLOCK", None, PinKind.INPUT, "drive without a unit: a falling edge is a step"),
    Pin("DIR", None, PinKind.INPUT, "drive without a unit: 1 = plus"),
    Pin("DONE", None, PinKind.OUTPUT, "step detector: 1 while the rotor has made every step it was asked for"),
    Pin("X", None, PinKind.OUTPUT, "encoder on the rotor, a quarter cycle a step, ahead of Y in the direction plus"),
    Pin("Y", None, PinKind.OUTPUT, "encoder on the rotor"),
)
_QUADRATURE = ((LOW, LOW), (HIGH, LOW), (HIGH, HIGH), (LOW, HIGH))


class Contact(NamedTuple):
    """A switch on the axis: at `inside` while the rotor is between `low` and `high`, in steps (or for ever)."""

    name: str
    low: float
    high: float
    inside: Level

    @property
    def pin(self) -> Pin:
        """Its contact, as a pin of the mechanics."""
        return Pin(self.name, None, PinKind.OUTPUT, "contact on the axis")

    def side(self, place: float) -> int:
        """Where the rotor is: -1 below, 0 within, 1 above."""
        return -1 if place < self.low else 1 if place > self.high else 0

    def level(self, side: int) -> Level:
        """The level of the contact there."""
        return HIGH + LOW - self.inside if side else self.inside

    def __deepcopy__(self, _: object) -> "Contact":
        return self


class Detector(NamedTuple):
    """The step detector: a step is made when the rotor is less than `window` steps short of it; told `delay` later."""

    window: float = 0.5
    delay: Ns = 1 * US

    def __deepcopy__(self, _: object) -> "Detector":
        return self


DETECTOR = Detector()


class Course:
    """A rotor, the drive's memory, and the pulses that are to come: whatever changes as time goes on."""

    __slots__ = ("anchor", "direction", "frozen", "last", "next", "rotor", "sequencer", "train")

    def __init__(self, rotor: Rotor, sequencer: Sequencer) -> None:
        self.rotor, self.sequencer = rotor, sequencer
        self.train: Any = None
        self.next, self.last, self.direction = 1, 0, 1  # pulses next .. last are to come
        self.anchor: Ns = rotor.now  # the last change of excitation
        self.frozen = True  # at rest, and not computed until something happens

    def twin(self) -> "Course":
        """A copy that goes its own way."""
        made = copy(self)
        made.rotor = self.rotor.__deepcopy__({})
        made.sequencer = copy(self.sequencer)
        return made

    def __deepcopy__(self, _: object) -> "Course":
        return self.twin()

    def next_change(self) -> Ns:
        """When the next pulse falls, or the drive changes something by itself."""
        pulse = self.train.time_of(self.next) if self.next <= self.last else NEVER
        return int(min(pulse, self.sequencer.slows_at, self.sequencer.holds_at))

    def go(self, until: Ns, low: float = -inf, high: float = inf, trace: "Log[Floats] | None" = None) -> bool:
        """Go on to `until`, changes of that instant included. True, somewhere before, if the rotor reaches an angle."""
        while (at := self.next_change()) <= until:
            if self._wait(at, low, high, trace):
                return True
            if self._run(self._due(at, until), low, high, trace):
                return True
        return self._wait(until, low, high, trace)

    def change(self, changes: Changes, trace: "Log[Floats] | None") -> None:
        """The excitation changes, now, for another reason than a pulse."""
        self._run(changes, -inf, inf, trace)

    def _due(self, at: Ns, until: Ns) -> Changes:
        """What changes at `at`, and the pulses that follow it closely."""
        if self.next > self.last or self.train.time_of(self.next) > at:
            return self.sequencer.up_to(at)
        end = min(self.train.steps_by(until), self.last, self.next + CHUNK - 1)
        times = self.train.times(self.next, end)
        apart = np.flatnonzero(np.diff(times) > SLICE)
        if len(apart):
            times = times[: int(apart[0]) + 1]
        self.next += len(times)
        return self.sequencer.pulses(times, self.direction)

    def _run(self, changes: Changes, low: float, high: float, trace: "Log[Floats] | None") -> bool:
        if self.frozen:
            begin = max(self.rotor.now, int(changes.times[0]))
            if trace is not None:
                trace.append(_row(self.rotor, begin))
            self.rotor.n[kernel.NOW] = begin
            self.frozen = False
        self.anchor = int(changes.times[-1])
        return self._compute(changes, self.anchor, low, high, trace)

    def _wait(self, until: Ns, low: float, high: float, trace: "Log[Floats] | None") -> bool:
        """No change before `until`: slice after slice, until the rotor is at rest."""
        slice_ = SLICE // self.rotor.rig.substep * self.rotor.rig.substep  # its ends are ends of substeps
        while not self.frozen and self.rotor.now < until:
            boundary = self.anchor + ((self.rotor.now - self.anchor) // slice_ + 1) * slice_
            if self._compute(NOTHING, min(boundary, until), low, high, trace):
                return True
            if self.rotor.now < boundary:
                break  # what is left before `until` is less than a substep
            still = abs(self.rotor.speed) < STILL and abs(float(self.rotor.s[kernel.ACC])) < STILL * 1e3
            if still or boundary - self.anchor >= LONGEST_SWING:
                self.frozen = True
                self.rotor.s[kernel.W] = self.rotor.s[kernel.ACC] = 0.0
        return False

    def _compute(self, changes: Changes, until: Ns, low: float, high: float, trace: "Log[Floats] | None") -> bool:
        rows = None
        if trace is not None:
            self.rotor.n[kernel.TRACED] = 0
            rows = np.empty(((until - self.rotor.now) // SAMPLE + 2, kernel.COLUMNS))
        code = self.rotor.run(changes, until, low, high, rows)
        if trace is not None and rows is not None and (done := int(self.rotor.n[kernel.TRACED])):
            trace.append(rows[:done])
        return code == kernel.CROSSED


class Mechanics:
    """A motor, its drive and its load in a cell; `follow` tells it what the axis of its unit does."""

    def __init__(
        self,
        rig: Rig,
        *,
        axis: str = "",
        shaft: float = 0.0,
        reverse: bool = False,
        contacts: Sequence[Contact] = (),
        detector: Detector = DETECTOR,
        record: bool = False,
    ) -> None:
        self.rig, self.axis, self.detector = rig, axis, detector
        self.contacts = tuple(contacts)
        self.pins: Sequence[Pin] = (*PINS, *(contact.pin for contact in self.contacts))
        self.shaft, self.sign = shaft, -1 if reverse else 1
        self.trace: Log[Floats] | None = Log() if record else None
        sequencer = Sequencer(rig.drive)
        rotor = Rotor(rig, sequencer, 0, SAMPLE)
        self._course = Course(rotor, sequencer)
        self._first = _row(rotor, 0)  # of the trace
        self._ahead: Course | None = None  # as far as a look ahead has come without finding anything
        self._watched: set[str] = set()
        self._inputs: dict[str, Level] = {pin.name: HIGH for pin in PINS if pin.kind.reads}
        self._out: list[Output] = []
        self._driver = PinDriver(self._out)
        self._sides = [contact.side(self.place_of(rotor.angle)) for contact in self.contacts]
        self._quarter = floor(self.place_of(rotor.angle) + 0.5)  # of the encoder
        self._wanted: float | None = None  # where DONE waits for the rotor, el. rad
        self._checked = 0  # pulses of the train that the detector has seen
        self._crossing: Ns = NEVER
        self._edge = (0.0, True)  # the angle that is reached then, and whether from below
        self._horizon: Ns = NEVER
        self.deadline: Ns = NEVER
        self._powered = False

    # -- where it is ---------------------------------------------------------------------------------------

    def place_of(self, angle: Any) -> Any:
        """The place on the axis, in steps, of an electrical angle (or an array of them)."""
        winding = self.rig.drive.winding
        return self.shaft + self.sign * (angle - winding.offset) / winding.pitch

    def angle_of(self, place: float) -> float:
        """The electrical angle of a place on the axis."""
        winding = self.rig.drive.winding
        return winding.offset + self.sign * (place - self.shaft) * winding.pitch

    def rotor_at(self, now: Ns) -> Rotor:
        """The rotor at `now`, everything of that instant included."""
        course = self._course.twin()
        course.go(now)
        if not course.frozen and course.rotor.now < now:
            same = course.sequencer
            course.rotor.run(at_once(now, same.place, same.level, same.row, same.mode), now)
        return course.rotor

    def place(self, now: Ns) -> float:
        """Where the rotor is at `now`, in steps."""
        return float(self.place_of(self.rotor_at(now).angle))

    def command(self, now: Ns) -> float:
        """Where the pulses want it, in steps."""
        course = self._course.twin()
        course.go(now)
        return self.shaft + self.sign * course.sequencer.place

    def traced(self, now: Ns) -> Floats:
        """Everything that was sampled up to `now` (columns as in `kernel`). Only of a cell that records."""
        log = deepcopy(self.trace)
        assert log is not None
        course = self._course.twin()
        course.go(now, trace=log)
        rows = [self._first, *log, _row(course.rotor, now)]
        return np.concatenate(rows)

    # -- the contract of a device ----------------------------------------------------------------------------

    def power(self, on: bool, now: Ns) -> None:
        """At the start of a cell: tell every level."""
        if on:
            self._powered = True
            for contact, side in zip(self.contacts, self._sides, strict=True):
                self._driver.set(contact.name, contact.level(side), now)
            self._driver.set("DONE", HIGH, now)
            self._tell_quarter(now)
            self._plan(now)

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> None:
        """It has no serial port."""

    def stored(self, ok: bool, now: Ns) -> None:
        """It stores nothing."""

    def watch(self, pin: str) -> None:
        """A wire leads from this output: its changes must be known when they happen."""
        self._watched.add(pin)

    def wired(self, pin: str) -> None:
        """A wire leads to this input: it is what the wire says, not what the drive is set to."""
        if pin == "DECAY":
            self._course.sequencer.set_mode(SLOW)  # a wire rests at 1

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """An input of the drive changes."""
        self.advance(now)
        if self._inputs.get(pin) == level:
            return
        self._inputs[pin] = level
        course, sequencer = self._course, self._course.sequencer
        if pin == "CLOCK" and level == LOW:
            course.go(now, trace=self.trace)
            direction = self.sign if self._inputs["DIR"] == HIGH else -self.sign
            course.direction = direction
            course.change(sequencer.pulses(np.array([now]), direction), self.trace)
            self._plan(now)
        elif pin == "DECAY":
            self._set_decay(level, now)
        elif pin == "HALF":
            self._go_before(now)
            sequencer.stride = 1 if level == HIGH else 2
            self._plan(now)
        elif pin in ("MOV", "RAMP", "ENABLE"):
            self._go_before(now)
            sequencer.on = self._inputs["ENABLE"] == HIGH
            course.change(sequencer.set_level(self._level(), now), self.trace)
            self._plan(now)

    def follow(self, motion: MotionStarted | MotionCut | MotionEnded) -> None:
        """The axis starts, stops or changes its mind."""
        if motion.axis != self.axis:
            return
        course = self._course
        if isinstance(motion, MotionStarted):
            course.last = min(course.last, motion.first - 1)
            course.go(motion.at, trace=self.trace)
            steps = motion.train.steps
            course.train, course.next = motion.train, motion.first
            course.last = NEVER if steps is None else steps
            course.direction = self.sign * motion.direction
            self._checked = motion.first - 1
        else:
            course.last = min(course.last, motion.last)
            course.go(motion.at, trace=self.trace)
            self._checked = min(self._checked, course.last)
        self._plan(motion.at)

    def next_deadline(self) -> Ns | None:
        """When a contact changes, or a look ahead must go on."""
        return None if self.deadline >= NEVER else self.deadline

    def advance(self, now: Ns) -> None:
        """A contact changes, the rotor has made its step, or nothing has happened in the time looked ahead."""
        if self.deadline > now:
            return
        if self._crossing <= now:
            self._go_before(now)
            self._crossed(now)
            self._plan(now)
        elif self._check_due() <= now:
            self._check(now)
        else:
            if self._ahead is not None and self.trace is None:
                self._course = self._ahead
            else:
                self._go_before(now)
            self._plan(now)

    def drain(self) -> list[Output]:
        """What its outputs did."""
        out = self._out.copy()
        self._out.clear()
        return out

    # -- inside ----------------------------------------------------------------------------------------------

    def _level(self) -> float:
        currents, inputs = self.rig.drive.currents, self._inputs
        if inputs["ENABLE"] == LOW:
            return 0.0
        if currents.after:
            return self._course.sequencer.own_level
        if inputs["RAMP"] == HIGH and inputs["MOV"] == HIGH:
            return currents.ramp
        return currents.slew if inputs["MOV"] == HIGH else currents.rest

    def _set_decay(self, level: Level, now: Ns) -> None:
        sequencer = self._course.sequencer
        mode = SLOW if level == HIGH else FAST
        if sequencer.mode != mode:
            self._go_before(now)
            sequencer.set_mode(mode)
            self._course.change(at_once(now, sequencer.place, sequencer.level, sequencer.row, mode), self.trace)
            self._plan(now)

    def _go_before(self, now: Ns) -> None:
        """Go on to `now`, without the pulses of this instant: it is not yet told whether they are given."""
        course = self._course
        last = course.last
        if course.next <= last and course.train.time_of(course.next) <= now:
            course.last = min(last, int(course.train.steps_by(now - 1)))
        course.go(now, trace=self.trace)
        course.last = last

    def _edges(self) -> list[tuple[float, int]]:
        """The angles at which something changes: up (1) or down (-1)."""
        edges = []
        for contact, side in zip(self.contacts, self._sides, strict=True):
            if contact.name in self._watched:
                edges += [(contact.low, 1)] if side < 0 else [(contact.high, -1)] if side > 0 else [
                    (contact.low, -1), (contact.high, 1)]  # fmt: skip
        if self._watched & {"X", "Y"}:
            edges += [(self._quarter - 0.5, -1), (self._quarter + 0.5, 1)]
        found = [(self.angle_of(place), way * self.sign) for place, way in edges if abs(place) < inf]
        if self._wanted is not None:
            found.append((self._wanted, 1 if self._waits_upward else -1))
        return found

    @property
    def _waits_upward(self) -> bool:
        return self._course.direction > 0

    def _limits(self) -> tuple[float, float]:
        edges = self._edges()
        return (max((angle for angle, way in edges if way < 0), default=-inf),
                min((angle for angle, way in edges if way > 0), default=inf))  # fmt: skip

    def _plan(self, now: Ns) -> None:
        """Look ahead, as far as it is worth it."""
        self._crossing = self._horizon = NEVER
        self._ahead = None
        low, high = self._limits()
        idle = self._course.frozen and self._course.next_change() >= NEVER
        if self._powered and (low > -inf or high < inf) and not idle:
            ahead = self._course.twin()
            horizon = now + SLICE
            if ahead.go(horizon, low, high):
                up = float(ahead.rotor.s[kernel.X_NEXT]) >= high
                self._edge = (high if up else low), up
                self._crossing = max(_crossing_time(ahead.rotor, *self._edge), now)
            else:
                self._horizon, self._ahead = horizon, ahead
        self._replan()

    def _replan(self) -> None:
        self.deadline = min(self._crossing, self._horizon, self._check_due())

    def _crossed(self, now: Ns) -> None:
        """The rotor has reached an edge: the one it was looked ahead for, and any other at the same place."""
        edge, up = self._edge
        for k, contact in enumerate(self.contacts):
            for place, way in ((contact.low, 1), (contact.high, -1)):
                if abs(place) < inf and self.angle_of(place) == edge:
                    rises = up == (self.sign > 0)
                    side = (0 if rises else -1) if way == 1 else (1 if rises else 0)
                    if side != self._sides[k]:
                        self._sides[k] = side
                        self._driver.set(contact.name, contact.level(side), now)
        if self._watched & {"X", "Y"}:
            for offset in (-0.5, 0.5):
                if self.angle_of(self._quarter + offset) == edge:
                    self._quarter += 1 if offset > 0 else -1
                    self._tell_quarter(now)
                    break
        if self._wanted is not None and self._wanted == edge:
            self._wanted = None
            self._driver.set("DONE", HIGH, now)

    def _tell_quarter(self, now: Ns) -> None:
        x, y = _QUADRATURE[self._quarter % 4]
        self._driver.set("X", x, now)
        self._driver.set("Y", y, now)

    # -- the step detector -----------------------------------------------------------------------------------

    def _check_due(self) -> Ns:
        """When the detector looks at the next pulse."""
        course = self._course
        if "DONE" not in self._watched or course.train is None or self._checked >= course.last:
            return NEVER
        return int(course.train.time_of(self._checked + 1)) + self.detector.delay

    def _check(self, now: Ns) -> None:
        """A pulse has been given: see whether the rotor has made the step already."""
        self._go_before(now)
        course = self._course
        self._checked += 1
        winding = self.rig.drive.winding
        wanted = winding.angle(course.sequencer.place) - course.direction * self.detector.window * winding.pitch
        behind = course.direction * (wanted - course.rotor.angle)
        before, self._wanted = self._wanted, wanted if behind > 0 else None
        self._driver.set("DONE", HIGH if self._wanted is None else LOW, now)
        if self._wanted == before:
            self._replan()
        else:
            self._plan(now)


def _crossing_time(rotor: Rotor, edge: float, up: bool) -> Ns:
    """When, within the substep that `advance` stopped before, the rotor reaches the edge: the first ns behind it."""
    s = rotor.s
    x0, w0, acc = float(s[kernel.X]), float(s[kernel.W]), float(s[kernel.ACC_NEXT])
    first, last = 0.0, int(rotor.n[kernel.STEP]) * 1e-9
    for _ in range(60):
        middle = (first + last) / 2
        x = x0 + rotor.rig.motor.teeth * middle * (w0 + 0.5 * acc * middle)
        if (x >= edge) if up else (x <= edge):
            last = middle
        else:
            first = middle
    return rotor.now + ceil(last * 1e9)


def _row(rotor: Rotor, at: Ns) -> Floats:
    """A row of the trace: the state as it is, said to be that of `at`."""
    s = rotor.s
    phi = rotor.rig.drive.winding.angle(int(rotor.n[kernel.PLACE]))
    return np.array([[at, s[kernel.X], s[kernel.W], s[kernel.IA], s[kernel.IB], phi]], np.float64)
