"""Movements, braking and origination: what the rate generator and the step counter are made to do."""

from enum import Enum

from detent.axis import Axis, Moment
from detent.controllers.device import Stop
from detent.controllers.supersigma import pins
from detent.controllers.supersigma.program import Program
from detent.pins import HIGH, LOW, Level, PinDriver
from detent.ramps.differences import nearest_count
from detent.ramps.rate_generator import CLOCK_NS
from detent.ramps.table_movement import Movement, braked, constant
from detent.ticks import NEVER, Ns, instants, to_fixed

ENDLESS = 1 << 40  # steps of a search: 50 years at low speed


class Course(Enum):
    """What the motor is doing."""

    REST = "ready"
    MOVE = "running"
    BRAKE = "braking"
    TO_SWITCH = "to the limit switch"
    FROM_SWITCH = "from the limit switch"


class Motion:
    """The motion of one drive. `deadline` says when to call `advance`; `course` what is going on."""

    __slots__ = (
        "_axis",
        "_done",
        "_inputs",
        "_movement",
        "_pins",
        "_program",
        "_start",
        "_step_rises",
        "course",
        "deadline",
    )
    INSTANTS = instants(_start="deadline", _step_rises=0, deadline=0)

    def __init__(self, axis: Axis, driver: PinDriver, inputs: dict[str, Level], program: Program) -> None:
        self._axis, self._pins, self._inputs, self._program = axis, driver, inputs, program
        self.reset()

    def reset(self) -> None:
        """The state at power-on."""
        self.course = Course.REST
        self.deadline: Ns = NEVER
        self._movement: Movement | None = None
        self._start: Ns = 0  # of the movement: clock 0 of the rate generator
        self._done = 0  # steps of the last movement
        self._step_rises: Ns = NEVER

    @property
    def at_rest(self) -> bool:
        """Whether nothing moves."""
        return self.course is Course.REST

    @property
    def originating(self) -> bool:
        """Whether origination is under way."""
        return self.course in (Course.TO_SWITCH, Course.FROM_SWITCH)

    @property
    def lowest(self) -> int:
        """The N at which ramps begin."""
        return self._program.table.first

    def steps_done(self, now: Ns) -> int:
        """What the step counter shows: the steps of the movement under way, or of the last one."""
        return self._axis.given(now) if self._axis.moving else self._done

    def pulses_are_wired(self) -> None:
        """A wire leads from the step output to another device: give every pulse as an event of its own."""
        self._axis.every_pulse = True

    def move(self, steps: int, direction: int, now: Ns) -> None:
        """A movement with the ramps that its length allows."""
        self._ramped(steps, direction, len(self._program.table.differences), now)

    def move_limited(self, steps: int, direction: int, limit: int, now: Ns) -> None:
        """The same at no more than `limit` half steps/s: only the first entries of the table are used."""
        self._ramped(steps, direction, self._program.table.entries_up_to(limit), now)

    def move_constant(self, steps: int, direction: int, speed: int, now: Ns) -> None:
        """A movement at `speed` half steps/s from the first pulse to the last."""
        self._begin(Course.MOVE, constant(nearest_count(speed), steps), direction, now)

    def originate(self, now: Ns) -> None:
        """Backward at low speed until the limit switch is active; if it is already, straight on to the way back."""
        if self._inputs[pins.RAIL] == LOW:
            self._search(Course.FROM_SWITCH, 1, now)
        else:
            self._search(Course.TO_SWITCH, -1, now)

    def stop(self, now: Ns) -> None:
        """06h: the table is run back from the present entry at the normal interval."""
        self._brake(self._program.table.interval, now)

    def emergency(self, now: Ns) -> None:
        """07h and the two inputs: the same with a fraction of the interval, the steepest allowable curve."""
        self._brake(max(self._program.table.interval // self._program.braking, 1), now)

    def switch_changed(self, level: Level, now: Ns) -> bool:
        """The limit switch takes a level during origination. True when that is the origin."""
        if self.course is Course.TO_SWITCH and level == LOW:
            self._axis.cut(now)
            self._search(Course.FROM_SWITCH, 1, now)
        elif self.course is Course.FROM_SWITCH and level == HIGH:
            self._done = self._axis.given(now)
            self._axis.cut(now)
            self._rest(now)
            return True
        return False

    def cuts(self) -> list[Stop]:
        """The edge of the limit switch that origination waits for; all other stops brake."""
        if not self._axis.stepping:
            return []
        if self.course is Course.TO_SWITCH:
            return [Stop(pins.RAIL, LOW)]
        return [Stop(pins.RAIL, HIGH)] if self.course is Course.FROM_SWITCH else []

    def halt(self, now: Ns) -> None:
        """Stop at once, wherever it is."""
        if self._axis.moving:
            self._done = self._axis.given(now)
            self._axis.cut(now)
            self._rest(now)

    def advance(self, at: Ns) -> None:
        """Deal with the deadline `at`."""
        if self._step_rises <= at:
            self._step_rises = NEVER
            self._pins.set(pins.STEP, HIGH, at)
            self._plan()
            return
        moment, pulse = self._axis.advance(at)
        if self._axis.every_pulse:
            self._pins.set(pins.STEP, LOW, at)
            self._step_rises = at + pins.STEP_LOW_NS
        if moment is Moment.END:
            self._done = pulse
            self._rest(at)
        else:
            self._plan()

    def _ramped(self, steps: int, direction: int, entries: int, now: Ns) -> None:
        from detent.ramps.short_movements import movement  # brings NumPy

        table, offset, way, _ = self._program
        self._begin(Course.MOVE, movement(table, steps, offset, way, entries), direction, now)

    def _search(self, course: Course, direction: int, now: Ns) -> None:
        self._begin(course, constant(self._program.table.first, ENDLESS), direction, now)

    def _begin(self, course: Course, wanted: Movement, direction: int, now: Ns) -> None:
        self.course, self._movement, self._start = course, wanted, now
        self._pins.set(pins.DIRECTION, HIGH if direction > 0 else LOW, now)
        self._pins.set(pins.MOVING, HIGH, now)
        self._axis.start(wanted.train.at(to_fixed(now)), direction, (), now)
        self._plan()

    def _brake(self, interval: int, now: Ns) -> None:
        """The firmware hears of it on the first clock not before `now`."""
        if self._movement is None:
            return
        clock = -((self._start - now) // CLOCK_NS)
        self.course = Course.BRAKE
        shorter = braked(self._movement, clock, interval)
        if shorter is not self._movement:
            self._movement = shorter
            self._axis.replan(shorter.train.at(to_fixed(self._start)), (), now)
            self._plan()

    def _rest(self, now: Ns) -> None:
        self.course = Course.REST
        self._movement = None
        self._pins.set(pins.MOVING, LOW, now)
        self._plan()

    def _plan(self) -> None:
        self.deadline = min(self._axis.deadline, self._step_rises)
