"""Moves, stops and homing: the sequencer-driver interface (RESET, CLOCK, DIR, MOV, RAMP, ENABLE, HOME, EOT).

A move is planned once, as a train with its ramps; what happens in the middle (Z, K, an input, ENABLE) turns
it into another move that agrees with the pulses already sent.
"""

from enum import Enum

from detent.axis import Axis, Marks, Moment
from detent.controllers.device import Stop
from detent.controllers.gsc200.pins import RESET_LOW_NS
from detent.pins import HIGH, LOW, Level, PinDriver, PulseOutput
from detent.ramps.constant_acceleration import Move, move
from detent.ticks import NEVER, Ns, instants, to_fixed

STEPS_PER_SECOND = 10  # S and T count in tens ("a by 10 multiplier is used")


class Course(Enum):
    """What the axis is doing."""

    REST = "rest"
    MOVE = "move"
    SEEK_EOT = "seek end of travel"
    SEEK_HOME = "seek home"


class Motion:
    """The motion of one module. `deadline` says when to call `advance`; it returns True when a course has ended."""

    __slots__ = ("_axis", "_clock", "_clock_rises", "_clocks_low", "_inputs", "_move", "_pins",
                 "_reset_rises", "course", "deadline",
                 "ramp", "slew", "start_stop")  # fmt: skip
    INSTANTS = instants(_clock_rises=0, _reset_rises=0, deadline=0)

    def __init__(self, axis: Axis, pins: PinDriver, inputs: dict[str, Level], clock: PulseOutput) -> None:
        self._axis, self._pins, self._inputs, self._clock = axis, pins, inputs, clock
        self._clocks_low: tuple[str, ...] = ()  # the clock outputs that are low for the moment
        self.reset()

    def reset(self) -> None:
        """The state at power-on. Until set: S10 T100 R50 (our assumption; the datasheet is silent)."""
        self.start_stop, self.slew, self.ramp = 10, 100, 50
        self.course = Course.REST
        self._move: Move | None = None
        self._clock_rises: Ns = NEVER
        self._reset_rises: Ns = NEVER
        self.deadline: Ns = NEVER

    def pulses_are_wired(self) -> None:
        """A wire leads from CLOCK to another device: give every pulse as an event of its own."""
        self._axis.every_pulse = True

    @property
    def at_rest(self) -> bool:
        """Whether no move and no homing is under way."""
        return self.course is Course.REST

    @property
    def only_reset(self) -> bool:
        """Whether it is at rest, and nothing but RESET changes by itself."""
        return self.course is Course.REST and self._clock_rises >= NEVER

    def postpone(self, by: Ns) -> None:
        """RESET, if it is low, rises so much later."""
        if self._reset_rises < NEVER:
            self._reset_rises += by
            self._plan()

    @property
    def direction(self) -> int:
        """+1 or -1: of the motion under way, or of the last one."""
        return self._axis.direction

    def pulse_reset(self, now: Ns) -> None:
        """RESET goes low for 400 us: power-on, I1 and I3 (pin 27)."""
        self._pins.set("RESET", LOW, now)
        self._reset_rises = now + RESET_LOW_NS
        self._plan()

    def begin(self, steps: int | None, direction: int, now: Ns) -> None:
        """Start a move of `steps` (at least 1; None: without end)."""
        speed = STEPS_PER_SECOND
        self._move = move(self.start_stop * speed, self.slew * speed, self.ramp, steps)
        self.course = Course.MOVE
        pins = self._pins
        pins.set("DIR", HIGH if direction > 0 else LOW, now)
        pins.set("MOV", HIGH, now)
        if self._move.up or self._move.down:
            pins.set("RAMP", HIGH, now)
        self._axis.start(self._move.train.at(to_fixed(now)), direction, self._marks(), now)
        self._plan()

    def decelerate(self, now: Ns) -> None:
        """Z, or the input of a velocity move: stop through the ramp ("Zero the speed").

        With n pulses sent the next keeps its time, and the move becomes one of 2(n+1) steps in the up ramp, of
        n + 1 + R in slew, and stays what it is in the down ramp. Without a ramp, and in homing, it stops at once.
        """
        current, train = self._move, self._axis.train
        if self.course is not Course.MOVE or current is None or train is None or self.slew <= self.start_stop:
            self.halt(now)
            return
        given = self._axis.given(now)
        if given < current.up:
            steps = 2 * (given + 1)
        elif train.steps is None or given < train.steps - current.down:
            steps = given + 1 + self.ramp
        else:
            return
        if train.steps is not None and steps >= train.steps:
            return
        speed = STEPS_PER_SECOND
        self._move = move(self.start_stop * speed, self.slew * speed, self.ramp, steps)
        self._axis.replan(self._move.train.at(train.start), self._marks(), now)
        self._plan()

    def halt(self, now: Ns) -> None:
        """K: the pulses stop at once."""
        if self._axis.moving:
            self._axis.cut(now)
        self._finish(now)

    def home(self, direction: int, now: Ns) -> None:
        """H: at the start-stop speed to the end of travel, then back to the home position.

        Without a step if both inputs are low already; then the course is `REST` on return.
        """
        self._move = None
        if self._inputs["EOT"] == LOW:
            self._seek_home(-direction, now)
            return
        self.course = Course.SEEK_EOT
        self._steady(direction, now)

    def input_changed(self, pin: str, level: Level, now: Ns) -> bool:
        """ENABLE, EOT or HOME takes a level. True when homing has found its place."""
        if pin == "ENABLE":
            self._axis.gate(level == HIGH, now)
            self._plan()
        elif level == LOW and self.course is Course.SEEK_EOT and pin == "EOT":
            self._axis.cut(now)
            self._seek_home(-self._axis.direction, now)
            return self.at_rest
        elif level == LOW and self.course is Course.SEEK_HOME and pin == "HOME":
            self.halt(now)
            return True
        return False

    def cuts(self) -> list[Stop]:
        """ENABLE, and what ends this course of homing ("Home", pins 24, 30, 32); no switch ends a move."""
        if not self._axis.stepping:
            return []
        found = [Stop("ENABLE", LOW)]
        if self.course is Course.SEEK_EOT:
            found.append(Stop("EOT", LOW))
        elif self.course is Course.SEEK_HOME:
            found.append(Stop("HOME", LOW))
        return found

    @property
    def stops_at_once(self) -> bool:
        """Whether `decelerate` stops it without a ramp."""
        return self.course is Course.MOVE and self.slew <= self.start_stop

    def advance(self, at: Ns) -> bool:
        """Deal with the deadline `at`. True when the move's last pulse was given."""
        if self._clock_rises <= at:
            self._clock_rises = NEVER
            for pin in self._clocks_low:
                self._pins.set(pin, HIGH, at)
            self._plan()
            return False
        if self._reset_rises <= at:
            self._reset_rises = NEVER
            self._pins.set("RESET", HIGH, at)
            self._plan()
            return False
        moment, pulse = self._axis.advance(at)
        if self._axis.every_pulse and moment is not Moment.HELD:
            self._clocks_low = self._clock.given_by(self._axis.direction)
            for pin in self._clocks_low:
                self._pins.set(pin, LOW, at)
            self._clock_rises = at + self._clock.width
        if moment is Moment.END:
            self._finish(at)
            return True
        if moment is Moment.MARK and self._move is not None:
            # The first mark ends the up ramp, a later one begins the down ramp.
            self._pins.set("RAMP", LOW if pulse == self._move.up else HIGH, at)
        self._plan()
        return False

    def _seek_home(self, direction: int, now: Ns) -> None:
        if self._inputs["HOME"] == LOW:
            self._finish(now)
            return
        self.course = Course.SEEK_HOME
        self._steady(direction, now)

    def _steady(self, direction: int, now: Ns) -> None:
        """Run at the start-stop speed, without end."""
        rate = self.start_stop * STEPS_PER_SECOND
        self._pins.set("DIR", HIGH if direction > 0 else LOW, now)
        self._pins.set("MOV", HIGH, now)
        self._axis.start(move(rate, rate, 1, None).train.at(to_fixed(now)), direction, (), now)
        self._plan()

    def _finish(self, now: Ns) -> None:
        self.course = Course.REST
        self._move = None
        self._pins.set("RAMP", LOW, now)
        self._pins.set("MOV", LOW, now)
        self._plan()

    def _marks(self) -> Marks:
        """The pulses at which RAMP changes: the end of the up ramp, the start of the down ramp.

        None in a short move, which is one block of ramp ("the ramping is reversed before the maximum speed").
        """
        current = self._move
        if current is None or not current.up:
            return ()
        steps = current.train.steps
        if steps is None:
            return (current.up,)
        return (current.up, steps - current.down) if steps > 2 * self.ramp else ()

    def _plan(self) -> None:
        self.deadline = min(self._axis.deadline, self._clock_rises, self._reset_rises)
