"""The mechanics of a cell: a motor with its drive and load on the pulses of a unit, and what its rotor moves.

It follows the trains of a unit (or a wire with step pulses) and computes the rotor only as far as somebody must know:
when a contact on its axis, a step detector or an encoder is wired, it looks ahead for the crossing and asks to be
woken there; otherwise it costs nothing until it is asked where it is. What it computes depends on the pulses and on
the current alone, not on when it was asked: a look ahead that proves wrong, because a motion changed its mind, is
thrown away.
"""

from collections.abc import Sequence
from copy import deepcopy
from math import floor, inf, pi
from typing import Any, NamedTuple

import numpy as np

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.contacts import DETECTOR, PINS, QUADRATURE, Contact, Detector, Edge
from detent.cell.course import SAMPLE, SLICE, Course, crossing_time, row_of
from detent.cell.power import Power
from detent.cell.recording import Log
from detent.controllers.device import DriveSet, Output, Powered, StageSet
from detent.motors import kernel
from detent.motors.drive import FAST, SLOW
from detent.motors.excitation import Sequencer, at_once
from detent.motors.motor import MotorError
from detent.motors.rotor import Floats, Rig, Rotor, load_kernel
from detent.pins import HIGH, LOW, Level, Pin, PinDriver
from detent.ticks import NEVER, Ns
from detent.uart import Char


class _Wait(NamedTuple):
    """Somebody waits for the rotor to reach `angle` of an edge, from below (`up`) or from above."""

    angle: float
    up: bool
    contact: int = -1  # that then is at `side`
    side: int = 0
    quarter: int = 0  # that the encoder then goes on; with neither it is the step detector


class Mechanics:
    """A motor, its drive and its load in a cell; `follow` tells it what the axis of its unit does."""

    latest: Ns = (1 << 62) - 1  # its times are int64: 146 years

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
        step: int | None = None,
    ) -> None:
        """Where the controller commands the sequence a place counts `step` 1/64 steps; None: as it is at first."""
        self.rig, self.axis, self.detector = rig, axis, detector
        self.contacts = tuple(contacts)
        self.pins: Sequence[Pin] = (*PINS, *(contact.pin for contact in self.contacts))
        self.shaft, self.sign = shaft, -1 if reverse else 1
        self.trace: Log[Floats] | None = Log() if record else None
        sequencer = Sequencer(rig.drive)
        rotor = Rotor(rig, sequencer, 0, SAMPLE)
        load_kernel(rig)
        self._course = Course(rotor, sequencer)
        self._zero, self._pitch, self._step = rig.drive.winding.offset, rig.drive.winding.pitch, step
        self._supplied = True  # as far as the controller commands
        self._first = row_of(rotor, 0)  # of the trace
        self._ahead: Course | None = None  # as far as a look ahead has come without finding anything
        self._watched: set[str] = set()
        self._inputs: dict[str, Level] = {pin.name: HIGH for pin in PINS if pin.kind.reads}
        self._out: list[Output] = []
        self._driver = PinDriver(self._out)
        self._sides = [self._side(contact, rotor.angle) for contact in self.contacts]
        self._quarter = self._quarter_at(rotor.angle)  # of the encoder
        self._wanted: float | None = None  # where DONE waits for the rotor, el. rad
        self._checked = 0  # pulses of the train that the detector has seen
        self._crossing: Ns = NEVER
        self._reached = (0.0, True)  # the angle that is reached then, and whether from below
        self._horizon: Ns = NEVER
        self.deadline: Ns = NEVER
        self._powered = False

    # -- where it is ---------------------------------------------------------------------------------------

    def place_of(self, angle: Any) -> Any:
        """The place on the axis, in steps, of an electrical angle (or an array of them)."""
        return self.shaft + self.sign * (angle - self._zero) / self._pitch

    def angle_of(self, place: float) -> float:
        """The electrical angle of a place on the axis."""
        return self._zero + self.sign * (place - self.shaft) * self._pitch

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
        if course.power is not None:
            return float(self.place_of(self.rig.drive.winding.angle(course.sequencer.place)))
        return self.shaft + self.sign * course.sequencer.place

    def traced(self, now: Ns) -> Floats:
        """Everything that was sampled up to `now` (columns as in `kernel`). Only of a cell that records."""
        log = deepcopy(self.trace)
        assert log is not None
        course = self._course.twin()
        course.go(now, trace=log)
        rows = [self._first, *log, row_of(course.rotor, now)]
        return np.concatenate(rows)

    # -- the contract of a device ----------------------------------------------------------------------------

    def power(self, on: bool, now: Ns) -> None:
        """At the start of a cell: tell every level."""
        if on:
            self._powered = True
            self._driver.set("DONE", HIGH, now)
            self._tell(now)
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
            sequencer.on = self._inputs["ENABLE"] == HIGH and self._supplied
            course.change(sequencer.set_level(self._level(), now), self.trace)
            self._plan(now)

    def take_level(self, pin: str, level: Level, now: Ns) -> None:
        """Who drives an input is switched on or off: the drive makes no step of it."""
        if pin == "CLOCK":
            self.advance(now)
            self._inputs[pin] = level
        else:
            self.set_pin(pin, level, now)

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
            course.direction, course.way = self.sign * motion.direction, motion.direction
            course.shaft = motion.shaft + motion.direction * (motion.first - 1)
            self._checked = motion.first - 1
            if course.power is not None:
                first = motion.train.time_of(motion.first)
                course.change(course.power.begins(course.sequencer, motion.at, first), self.trace)
        else:
            course.last = min(course.last, motion.last)
            course.go(motion.at, trace=self.trace)
            self._checked = min(self._checked, course.last)
            if course.power is not None and course.sequencer.moving:
                course.change(course.power.ends(course.sequencer, motion.at), self.trace)
        self._plan(motion.at)

    @property
    def contact_names(self) -> tuple[str, ...]:
        """The switches that its rotor moves."""
        return tuple(contact.name for contact in self.contacts)

    def move_contact(self, name: str, low: float | None, high: float | None, now: Ns) -> None:
        """Put a contact elsewhere: places as its cell file counts them. ValueError if that has no width."""
        self._go_before(now)
        index = self.contact_names.index(name)
        moved = self.contacts[index].moved(low, high)
        self.contacts = (*self.contacts[:index], moved, *self.contacts[index + 1 :])
        self._sides[index] = self._side(moved, self.rotor_at(now).angle)
        if self._powered:
            self._driver.set(name, moved.level(self._sides[index]), now)
        self._plan(now)

    @property
    def standing(self) -> Floats:
        """The first row of the trace: how the rotor stood before anything moved it."""
        return self._first

    @property
    def cycle(self) -> float:
        """Steps of the axis in an electrical cycle: four full steps."""
        return 2 * pi / self._pitch

    def catch_up(self, now: Ns) -> Rotor:
        """Compute the rotor up to `now`, for somebody who asks again and again; it is the same whoever asks."""
        self._go_before(now)
        return self.rotor_at(now)

    def heed(self, told: DriveSet | StageSet | Powered) -> None:
        """The controller commands its power stage: from now on that counts, and not what the drive was set to."""
        if not self.rig.sequences:
            return
        if not isinstance(told, Powered) and told.axis != self.axis:
            return
        if isinstance(told, DriveSet) and told.connector != self.axis:
            return  # the second connector of an axis that drives two
        self._go_before(told.at)
        course, sequencer = self._course, self._course.sequencer
        if isinstance(told, Powered):
            if course.power is None:
                return
            self._supplied = told.on
        else:
            stage = told.stage
            begins = course.power is None
            course.power = Power(stage, 1 / self.rig.drive.current if stage.chops else 1.0)
            course.power.take(sequencer, self.sign * (course.shaft - told.origin), course.rate(told.at))
            if begins:
                self._begin(stage.places, told.at)
        sequencer.on = self._inputs["ENABLE"] == HIGH and self._supplied
        course.change(sequencer.set_level(sequencer.level if sequencer.on else 0.0, told.at), self.trace)
        self._plan(told.at)

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
        if self._course.power is not None:
            return self._course.power.level(self._course.sequencer)
        if currents.after:
            return self._course.sequencer.own_level
        if inputs["RAMP"] == HIGH and inputs["MOV"] == HIGH:
            return currents.ramp
        return currents.slew if inputs["MOV"] == HIGH else currents.rest

    def _begin(self, step: int, now: Ns) -> None:
        """The controller commands for the first time: the rotor stands where that asks it to, at the start."""
        winding, course = self.rig.drive.winding, self._course
        self._zero = winding.angle(course.sequencer.place)
        self._pitch = winding.pitch * (self._step or step)
        level = course.sequencer.level
        try:
            course.rotor = Rotor(self.rig, course.sequencer, now, SAMPLE)
        except MotorError:  # the load is more than what it is given at first: somebody holds it until then
            course.sequencer.level = 1.0
            course.rotor = Rotor(self.rig, course.sequencer, now, SAMPLE)
            course.sequencer.level = level
        self._first = row_of(course.rotor, now)
        self._sides = [self._side(contact, course.rotor.angle) for contact in self.contacts]
        self._quarter = self._quarter_at(course.rotor.angle)
        if self._powered:
            self._tell(now)

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

    def _edges(self, contact: Contact) -> tuple[Edge, Edge]:
        """Where the range of a contact begins and ends, by place; both ends are within."""
        upper = self.sign > 0
        return (Edge.at(self.angle_of(contact.low), upper=upper),
                Edge.at(self.angle_of(contact.high), upper=not upper))  # fmt: skip

    def _side(self, contact: Contact, angle: float) -> int:
        """Where the rotor is at an angle: -1 below the range of a contact, 0 within, 1 above."""
        low, high = self._edges(contact)
        if self.sign > 0:
            return -1 if angle <= low.below else 1 if angle >= high.above else 0
        return -1 if angle >= low.above else 1 if angle <= high.below else 0

    def _quarter_edge(self, quarter: int) -> Edge:
        """Where this quarter of the encoder begins, by place."""
        return Edge.at(self.angle_of(quarter - 0.5), upper=self.sign > 0)

    def _quarter_at(self, angle: float) -> int:
        """The quarter that the encoder is in at an angle."""
        near: int = floor(self.place_of(angle) + 0.5)
        for quarter in (near + 1, near):  # what rounding leaves open is settled by the edges alone
            edge = self._quarter_edge(quarter)
            if angle >= edge.above if self.sign > 0 else angle <= edge.below:
                return quarter
        return near - 1

    def _waits(self) -> list[_Wait]:
        """What there is to wait for."""
        waits: list[_Wait] = []

        def wait(edge: Edge, way: int, contact: int = -1, side: int = 0, quarter: int = 0) -> None:
            if abs(edge.above) < inf:
                up = way == self.sign
                waits.append(_Wait(edge.above if up else edge.below, up, contact, side, quarter))

        for k, (contact, side) in enumerate(zip(self.contacts, self._sides, strict=True)):
            if contact.name in self._watched:
                low, high = self._edges(contact)
                if side < 0:
                    wait(low, 1, k, 0)
                elif side > 0:
                    wait(high, -1, k, 0)
                else:
                    wait(low, -1, k, -1)
                    wait(high, 1, k, 1)
        if self._watched & {"X", "Y"}:
            wait(self._quarter_edge(self._quarter), -1, quarter=-1)
            wait(self._quarter_edge(self._quarter + 1), 1, quarter=1)
        if self._wanted is not None:
            waits.append(_Wait(self._wanted, self._course.direction > 0))
        return waits

    def _plan(self, now: Ns) -> None:
        """Look ahead, as far as it is worth it."""
        self._crossing = self._horizon = NEVER
        self._ahead = None
        waits = self._waits() if self._powered else []
        idle = self._course.frozen and self._course.next_change() >= NEVER
        if waits and not idle:
            low = max((wait.angle for wait in waits if not wait.up), default=-inf)
            high = min((wait.angle for wait in waits if wait.up), default=inf)
            ahead = self._course.twin()
            horizon = now + SLICE
            if ahead.go(horizon, low, high):
                up = float(ahead.rotor.s[kernel.X_NEXT]) >= high
                self._reached = (high if up else low), up
                self._crossing = max(crossing_time(ahead.rotor, *self._reached), now)
            else:
                self._horizon, self._ahead = horizon, ahead
        self._replan()

    def _replan(self) -> None:
        self.deadline = min(self._crossing, self._horizon, self._check_due())

    def _crossed(self, now: Ns) -> None:
        """The rotor has reached what it was looked ahead for; whoever else waits for the same is told, too."""
        for wait in self._waits():
            if (wait.angle, wait.up) != self._reached:
                continue
            if wait.contact >= 0:
                contact = self.contacts[wait.contact]
                self._sides[wait.contact] = wait.side
                self._driver.set(contact.name, contact.level(wait.side), now)
            elif wait.quarter:
                self._quarter += wait.quarter
                self._tell_quarter(now)
            else:
                self._wanted = None
                self._driver.set("DONE", HIGH, now)

    def _tell(self, now: Ns) -> None:
        """How the contacts and the encoder are."""
        for contact, side in zip(self.contacts, self._sides, strict=True):
            self._driver.set(contact.name, contact.level(side), now)
        self._tell_quarter(now)

    def _tell_quarter(self, now: Ns) -> None:
        x, y = QUADRATURE[self._quarter % 4]
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
        wanted = winding.angle(course.sequencer.place) - course.direction * self.detector.window * self._pitch
        behind = course.direction * (wanted - course.rotor.angle)
        before, self._wanted = self._wanted, wanted if behind > 0 else None
        self._driver.set("DONE", HIGH if self._wanted is None else LOW, now)
        if self._wanted == before:
            self._replan()
        else:
            self._plan(now)
