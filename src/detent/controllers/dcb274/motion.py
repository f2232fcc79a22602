"""Moves, constant velocity, home, jog, step inputs, limits and trip positions of one axis.

A motion is planned as a train; whatever happens in the middle turns it into another that agrees with the pulses
already sent. `advance` tells when a motion has ended and when a step has reached the trip position.
"""

from enum import Enum
from typing import NamedTuple

from detent.axis import Axis, Leeway
from detent.controllers.dcb274 import settings
from detent.controllers.dcb274.pins import DIRECTION_HELD, LEAST_STEP_LOW, LEAST_STEP_PERIOD
from detent.controllers.dcb274.ports import Ports
from detent.controllers.dcb274.settings import Settings
from detent.controllers.device import Stop
from detent.pins import HIGH, LOW
from detent.pulses import Train, Uniform
from detent.ramps import timer_table
from detent.ticks import MS, NEVER, SECOND, Ns, instants, to_fixed

SETTLING: Ns = SECOND  # from the end of a motion to the hold current (page 52)
COUNTS = 1 << 24  # of the position counter
JOG_UNIT = 30  # full steps/s


class Course(Enum):
    """What the axis is doing."""

    REST = "rest"
    INDEX = "index"
    SEEK_LOW = "seek home low"
    SEEK_HIGH = "seek home high"
    VELOCITY = "velocity"
    JOG = "jog"


_INDEXING = (Course.INDEX, Course.SEEK_LOW, Course.SEEK_HIGH)


class News(NamedTuple):
    """What a deadline or an input brought.

    An action may be complete; a step has reached the trip position; a limit stops the motion.
    """

    ended: bool = False
    tripped: bool = False
    limited: bool = False


NOTHING = News()
ENDED = News(ended=True)


def wrapped(position: int) -> int:
    """A position as the 24-bit counter has it."""
    return (position + COUNTS // 2) % COUNTS - COUNTS // 2


class Motion:
    """The motion of one axis. `deadline` says when to call `advance`."""

    INSTANTS = instants(
        rested_at=4 * SECOND,  # three of the longest periods between external steps, and more than `SETTLING`
        _energized_at=0, _sets_off=0, _step_due=0, _step_fell=LEAST_STEP_LOW, _stepped=NEVER,
    )  # fmt: skip
    PLACES = ("_origin",)

    def __init__(self, axis: Axis, ports: Ports, registers: Settings, *, encoder: bool) -> None:
        self._axis, self._ports, self._settings, self._encoder = axis, ports, registers, encoder
        self.leeway = Leeway()  # of the position counter
        self.reset()

    def reset(self) -> None:
        """At rest, position 0, current at hold."""
        self.course = Course.REST
        self.phase_origin = self._axis.shaft  # where the step sequence was at its start phase
        self.rested_at: Ns = -NEVER  # when the last motion ended
        self._energized_at: Ns = -NEVER  # when the current has been at run for w, since it rose last
        self._sets_off: Ns = NEVER  # when the motion that waits for that begins
        self._origin = self._axis.shaft
        self._limited = False  # a limit has been met since the motion began
        self._stopping = False  # on the way to rest, by a soft stop, M 0 or a new direction
        self._stop_later = False  # a soft stop waits for the end of a ramp
        self._reversed: int | None = None  # M has turned: the period, with its sign, to go on with after the stop
        self._down_from = 0  # the pulse of an index at which its down ramp begins
        self._ramp_end = 0  # the pulse at which a constant velocity is reached
        self._target = 0  # period of the constant velocity or jog, in ticks, with its sign
        self._home = 0  # the direction in which home is approached at last
        self._home_period = 0
        self._trip: int | None = None
        # since when STEP reads low; a level that nobody was seen to bring about is no edge
        self._step_fell: Ns = NEVER
        self._stepped: Ns = -NEVER  # when the last external step was made
        self._step_due: Ns = NEVER  # when an external step is made, if its direction is held until then
        self._step_direction = 1
        self.step_period: Ns = NEVER  # between the last two external steps

    # -- looking -----------------------------------------------------------------------------------------

    @property
    def at_rest(self) -> bool:
        """Whether nothing moves."""
        return self.course is Course.REST

    @property
    def indexing(self) -> bool:
        """Whether an index or a homing is under way: what W waits for."""
        return self.course in _INDEXING

    @property
    def homing(self) -> bool:
        """Whether home is looked for."""
        return self.course in (Course.SEEK_LOW, Course.SEEK_HIGH)

    def completing(self, now: Ns) -> bool:
        """Whether an action is in its completion cycle (page 27)."""
        if self.course is Course.VELOCITY:
            return self._stopping or self._axis.given(now) < self._ramp_end
        return self.indexing

    def energizing(self, now: Ns) -> bool:
        """Whether a motion has begun that waits for its current (w, page 51)."""
        return now < self._sets_off < NEVER

    @property
    def status(self) -> int:
        """What ^ prints: 0 at rest, 1 indexing or homing, 3 constant velocity or jog, ramps included."""
        if self.at_rest:
            return 0
        return 1 if self.indexing else 3

    def position(self, now: Ns) -> int:
        """The position counter."""
        self.leeway.exactly()
        return wrapped(self._axis.shaft_at(now) - self._origin)

    def period(self, now: Ns) -> int:
        """Ticks between the pulses before and after `now`; 0 at rest."""
        train = self._axis.train
        return 0 if train is None else timer_table.period_after(train, self._axis.given(now))

    @property
    def deadline(self) -> Ns:
        """When something happens by itself."""
        at = self._axis.deadline
        if (output := self._ports.deadline) < at:
            at = output
        if self._step_due < at:
            at = self._step_due
        return self._sets_off if self._sets_off < at else at

    def next_change(self, now: Ns) -> Ns:
        """When the position changes next by itself."""
        train = self._axis.train
        return NEVER if train is None else train.time_of(self._axis.given(now) + 1)

    # -- the counter and the trip position ---------------------------------------------------------------

    def set_origin(self, position: int, now: Ns) -> None:
        """O: the counter takes a value; the distance of a move under way stays (page 47)."""
        self._origin = self._axis.shaft_at(now) - position
        self._remark(now)

    def set_trip(self, position: int | None, now: Ns) -> None:
        """Tell when the counter reaches this position; None: never."""
        self._trip = position
        self._remark(now)

    def reset_phase(self, now: Ns) -> None:
        """H: back to step 1 of the sequence (page 40)."""
        self.phase_origin = self._axis.shaft_at(now)

    # -- starting ----------------------------------------------------------------------------------------

    def index(self, steps: int, direction: int, now: Ns) -> None:
        """+, - and R, at rest. No steps into an active limit."""
        if not steps or self._ports.limit(direction):
            return
        move = timer_table.index(self._settings.speeds, steps)
        self.course, self._down_from = Course.INDEX, steps - move.down
        self._start(move.train, direction, now)

    def ready_to_index(self, now: Ns) -> bool:
        """Whether an index may start now; a constant velocity begins to ramp down for it."""
        if self.course is Course.VELOCITY and not self._stopping:
            self.soft_stop(now)
        return self.at_rest

    def velocity(self, count: int, now: Ns) -> None:
        """M, when the ramp before it is complete: a timer count with its sign, 0 stops.

        Where a limit has begun a stop while M was executed, it sets off from rest, if it may then.
        """
        period = count * self._settings.divide
        if self.course is Course.VELOCITY:
            if period == 0:
                self.soft_stop(now)
            elif self._stopping:
                self._reversed = period
            elif (period > 0) is (self._axis.direction > 0):
                self._change(abs(period), now)
            else:
                self.soft_stop(now)
                if self.at_rest:
                    self._begin_velocity(period, Course.VELOCITY, now)
                else:
                    self._reversed = period
        elif period:
            self._begin_velocity(period, Course.VELOCITY, now)

    def home(self, count: int, direction: int, now: Ns) -> None:
        """F, at rest. The low edge is looked for in `direction`, the high edge the other way.

        A soft stop ends it, whatever the switch does while the axis comes to rest (page 28).
        """
        self._home = -direction
        self._home_period = max(count, self._settings.initial) * self._settings.divide
        if self._ports.active("HOME"):
            self._approach_home(self._settings.initial * self._settings.divide, now)
        elif not self._ports.limit(direction):
            self.course = Course.SEEK_LOW
            self._run(direction * count * self._settings.divide, now)

    def jog(self, direction: int, fast: bool, now: Ns) -> None:
        """The jog inputs ask for this direction (0: none) and speed, at rest or while jogging."""
        unit = self._jog_speed(fast)
        period = timer_table.count_of(unit) * self._settings.divide if unit else 0
        if self.course is Course.JOG:
            if self._stopping:
                return
            if self.jog_ends(direction, fast):
                self.soft_stop(now)
            elif period != abs(self._target):
                self._change(period, now)
        elif unit and direction and not self._ports.limit(direction):
            self._begin_velocity(direction * period, Course.JOG, now)

    def jog_ends(self, direction: int, fast: bool) -> bool:
        """Whether the jog under way ends, if its inputs ask for this."""
        return not self._jog_speed(fast) or direction != self._axis.direction

    def _jog_speed(self, fast: bool) -> int:
        return self._settings.jog[fast] * JOG_UNIT * settings.RESOLUTION[self._settings.resolution]

    @property
    def jogging(self) -> bool:
        """Whether the axis follows the jog inputs."""
        return self.course is Course.JOG

    # -- stopping ----------------------------------------------------------------------------------------

    def soft_stop(self, now: Ns, *, limited: bool = False) -> None:
        """Decelerate by K to the initial speed and stop; the pulse that is on its way keeps its time.

        A motion that waits for its current (w) has made no step, and makes none. Where a ramp to rest is under way that
        goes on, but for a limit (`limited`): K may be another by now, and the shorter one counts.
        """
        self._step_due = NEVER
        train = self._axis.train
        if train is None:
            return
        self._reversed = None
        if self.energizing(now):
            self.halt(now)
        if self.at_rest or (self._stopping and not limited):
            return
        given = self._axis.given(now)
        if self.course is Course.INDEX and given >= self._down_from and not limited:
            return  # it stops of itself
        change = timer_table.change(0, self._settings.speeds, timer_table.period_after(train, given), None)
        steps = given + 1 + change.ramp
        if train.steps is not None and steps >= train.steps:
            return
        self._stopping = True
        head = train.head(given + 1)
        base = head.fixed_time(given + 1) - train.start
        stop = Train((*head.segments, *(segment.moved(base) for segment in change.segments)), train.start)
        self._axis.replan(stop, (), now)
        self._remark(now)

    def soft_stop_after_ramp(self, now: Ns) -> None:
        """A soft stop between two M: the ramp under way is completed before (page 28).

        The first ramp of a reversal ends at rest, and there the axis stays.
        """
        ramping = self.course is Course.VELOCITY and not self._stopping and self._axis.given(now) < self._ramp_end
        if ramping and not self.energizing(now):
            self._stop_later = True
        else:
            self.soft_stop(now)

    def halt(self, now: Ns) -> None:
        """ESC, a limit: the pulses stop at once, and no step from outside is still to come."""
        self._step_due = NEVER
        if self._axis.moving:
            self._axis.cut(now)
        self._finish(now)

    # -- inputs ------------------------------------------------------------------------------------------

    def input_changed(self, pin: str, now: Ns) -> News:
        """A switch or the step inputs have a new level, which `Ports` knows already."""
        if pin in ("STEP", "DIR"):
            return self._step_input(pin, now)
        return self.switches_changed(now)

    def options_changed(self, now: Ns) -> None:
        """Inputs may read otherwise than before, without an edge."""
        self.step_found(now)
        self.switches_changed(now)

    def step_found(self, now: Ns) -> None:
        """STEP is driven, and has the level that it has: low, it may rise."""
        self._step_fell = now if self._ports.reads("STEP") == LOW else NEVER

    def switches_changed(self, now: Ns) -> News:
        """Limits and home may have changed, by a level or by an option."""
        if self.at_rest:
            return NOTHING
        if self._ports.limit(self._axis.direction):
            if self._settings.flags & settings.GENTLE:
                before, self._limited = self._limited, True
                self.soft_stop(now, limited=not before)
            else:
                self.halt(now)
            return News(self.at_rest, limited=True)
        if self._stopping:
            return NOTHING  # "after velocity deceleration, the process is terminated" (page 28): of F as well
        low = self._ports.active("HOME")
        if self.course is Course.SEEK_LOW and low:
            self._axis.cut(now)
            self.rested_at = now  # so the current is at run, and w is not waited for again (page 51)
            self._approach_home(self._home_period, now)
        elif self.course is Course.SEEK_HIGH and not low:
            self.halt(now)
        return ENDED if self.at_rest else NOTHING

    def cuts(self, now: Ns) -> list[Stop]:
        """The levels of limits and home at which `switches_changed` stops the pulses at once."""
        if not self._axis.stepping:
            return []
        levels, found = self._ports.levels, []
        for pin in ("LIMIT-A", "LIMIT-B", "HOME"):
            levels[pin] ^= 1
            if self._cuts_now(now):
                found.append(Stop(pin, levels[pin]))
            levels[pin] ^= 1
        return found

    def _cuts_now(self, now: Ns) -> bool:
        """Whether the switches, as they are, end the motion under way without a ramp."""
        if self._ports.limit(self._axis.direction):
            return not self._settings.flags & settings.GENTLE or self.energizing(now)
        if self._stopping:
            return False
        low = self._ports.active("HOME")
        return (self.course is Course.SEEK_LOW and low) or (self.course is Course.SEEK_HIGH and not low)

    def advance(self, at: Ns) -> News:
        """Deal with the deadline `at`; a step comes before whatever the outputs do."""
        if self._sets_off <= at:
            self._sets_off = NEVER
            return NOTHING
        if self._axis.deadline > at:
            if self._step_due <= at:
                return self._external_step(at)
            self._ports.advance(at)
            return NOTHING
        _, pulse = self._axis.advance(at)
        if self._axis.every_pulse:
            self._ports.pulse(at)
        tripped = self._trip is not None and self.position(at) == self._trip
        if not self._axis.moving:
            return News(self._ended(at), tripped)
        reached = pulse == self._ramp_end and self.course is Course.VELOCITY
        if reached and self._stop_later:
            self.soft_stop(at)
        return News(reached, tripped)

    # -- inside ------------------------------------------------------------------------------------------

    def _start(self, train: Train, direction: int, now: Ns) -> None:
        if now >= self.rested_at + SETTLING:  # the current has fallen to hold, and rises now (page 51)
            self._energized_at = now + self._settings.pre_energize * 10 * MS
        start = to_fixed(max(now, self._energized_at))
        self._sets_off = self._energized_at if self._energized_at > now else NEVER
        self._stopping = self._limited = False
        self.step_period = NEVER
        self._ports.moving(True, direction, now)
        self._axis.every_pulse = self._ports.pulses_are_wired
        self._axis.start(train.at(start), direction, (), now)
        self._remark(now)

    def _run(self, period: int, now: Ns) -> None:
        """Start from rest towards a constant period, in ticks with its sign."""
        change = timer_table.change(0, self._settings.speeds, None, abs(period))
        self._ramp_end, self._target = change.ramp, period
        self._start(Train(change.segments), 1 if period > 0 else -1, now)

    def _begin_velocity(self, period: int, course: Course, now: Ns) -> None:
        if not self._ports.limit(1 if period > 0 else -1):
            self.course = course
            self._run(period, now)

    def _approach_home(self, period: int, now: Ns) -> None:
        """Without a ramp to the first high level of the home switch."""
        if self._ports.limit(self._home):
            self._finish(now)
            return
        self.course = Course.SEEK_HIGH
        self._start(Train((Uniform(0, timer_table.TICK * period, 1, None),)), self._home, now)

    def _change(self, period: int, now: Ns) -> None:
        """From the speed of the next pulse to another in the same direction."""
        train = self._axis.train
        assert train is not None
        given = self._axis.given(now)
        change = timer_table.change(0, self._settings.speeds, timer_table.period_after(train, given), period)
        head = train.head(given + 1)
        base = head.fixed_time(given + 1) - train.start
        self._ramp_end = given + 1 + change.ramp
        self._target = period * self._axis.direction
        plan = Train((*head.segments, *(segment.moved(base) for segment in change.segments)), train.start)
        self._axis.replan(plan, (), now)
        self._remark(now)

    def _ended(self, at: Ns) -> bool:
        """The last pulse was given. True unless a motion in the other direction follows."""
        period, self._reversed = self._reversed, None
        course = self.course
        self._finish(at)
        if period is not None:
            self._begin_velocity(period, course, at)
        return self.at_rest

    def _finish(self, now: Ns) -> None:
        if self.course is not Course.REST:
            self.rested_at = now
        self.course = Course.REST
        self._sets_off = NEVER
        self._stopping = self._stop_later = False
        self._reversed = None
        self._ports.moving(False, self._axis.direction, now)

    def _remark(self, now: Ns) -> None:
        """Ask to be woken at the end of a ramp and at the trip position."""
        if not self._axis.moving:
            return
        marks = [self._ramp_end] if self.course is Course.VELOCITY and not self._stopping else []
        if self._trip is not None:
            given = self._axis.given(now)
            away = (self._trip - self.position(now)) * self._axis.direction % COUNTS
            marks.append(given + (away or COUNTS))
        self._axis.remark(tuple(sorted({mark for mark in marks if mark > 0})), now)

    def _step_input(self, pin: str, now: Ns) -> News:
        """A step from outside: a rising edge, or with the encoder option an edge of A or B (page 10).

        A rising edge makes its step when its direction has been held for 10 us, and none when it has not.
        """
        a, b = self._ports.reads("STEP"), self._ports.reads("DIR")
        if self._encoder:
            # A leads B in plus direction: A equals B behind an edge of B, and differs behind one of A
            direction, due = 1 if (a != b) is (pin == "STEP") else -1, now
        elif pin == "DIR":
            self._step_due = NEVER
            return NOTHING
        elif a == LOW:
            self._step_fell = now
            return NOTHING
        else:
            low, self._step_fell = now - self._step_fell, NEVER
            if low < LEAST_STEP_LOW:
                return NOTHING
            direction, due = 1 if b == HIGH else -1, now + DIRECTION_HELD
        # the last step may have been the axis's own: then it has been at rest since
        if self._step_due < NEVER or due - self.rested_at < LEAST_STEP_PERIOD or not self.at_rest:
            return NOTHING
        self._step_direction = direction
        if due == now:
            return self._external_step(now)
        self._step_due = due
        return NOTHING

    def _external_step(self, now: Ns) -> News:
        """Make the step that the inputs ask for, unless a motion of the axis's own or a limit is in its way."""
        self._step_due = NEVER
        if not self.at_rest or self._ports.limit(self._step_direction):
            return NOTHING
        self.step_period, self._stepped = now - self._stepped, now
        self._axis.every_pulse = False
        self._ports.turn(self._step_direction, now)
        self._axis.start(Train((Uniform(0, 1, 1, 1),), to_fixed(now - 1)), self._step_direction, (), now)
        self._axis.advance(now)
        if self._ports.pulses_are_wired:
            self._ports.pulse(now)
        self.rested_at = now
        # "The trip is not currently usable in the encoder mode" (page 49)
        return News(False, not self._encoder and self._trip is not None and self.position(now) == self._trip)
