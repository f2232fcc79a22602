"""One motor's motion: go, slew, stop, and what happens when they meet (manual, pages 22, 27, 31 to 33, 36, 38).

The motor is always in one `Action` with one `Plan` of `ramps.tick_accumulator`. A command that comes in motion
takes the accumulators as they are on the tick, and plans on from there. Ticks are counted from the reset.

A limit that closes ahead is a Z (page 12): whatever was to follow the ramp-down is dropped, and as long as the limit
is closed nothing that is asked for leads on towards it.
"""

from enum import Enum

from detent.axis import Axis
from detent.controllers.genstepper.inputs import Limits
from detent.controllers.genstepper.link import LARGEST, saturated
from detent.pulses import Ticked, Train
from detent.ramps.tick_accumulator import TICK, UNIT, UPDATES, Plan, Point, slewing, stopping, toward
from detent.ticks import NEVER, Ns, to_fixed

LEAST_KEPT, DEFAULT_SLOPE, DEFAULT_RATE = 80, 8_000, 400  # what K, P and R make of 0
ONE_STEP = Train((Ticked(0, TICK, 1, UNIT, 0, UNIT),))  # one tick, with a step on it


class Action(Enum):
    """What the motor does."""

    IDLE = "idle"
    GOING = "going"  # towards a target: report -8 tells ramping up, at speed, slowing
    SLEWING = "slewing"
    STOPPING = "stopping"
    REVERSING = "reversing"  # stops, then slews: the other way, or on from a limit that has opened again
    TURNING = "turning"  # stops, then goes to a target


class Motor:
    """One motor. `deadline` says when to call `advance`, which is True when the motor has come to rest."""

    __slots__ = (
        "_axis",
        "_begin_tick",
        "_braking_slope",
        "_ends_at",
        "_field",
        "_floor",
        "_go_keep",
        "_go_run",
        "_limit_tick",
        "_limits",
        "_onward",
        "_origin",
        "_plan",
        "_shut",
        "_time_zero",
        "action",
        "deadline",
        "direction",
        "idle_windings",
        "keep",
        "mark",
        "mode",
        "name",
        "rate",
        "slope",
        "target",
    )  # fmt: skip

    def __init__(self, axis: Axis, limits: Limits) -> None:
        self._axis, self._limits = axis, limits
        self.name = axis.name
        self.reset(0, keep=LEAST_KEPT, slope=DEFAULT_SLOPE, rate=800, idle_windings=0)

    def reset(self, now: Ns, *, keep: int, slope: int, rate: int, idle_windings: int) -> None:
        """As after power-on: at rest, at position 0. Ticks are counted from `now`."""
        if self._axis.moving:
            self._axis.cut(now)
        self._time_zero = now
        self._origin = self._field = self._axis.shaft
        self.action = Action.IDLE
        self.deadline: Ns = NEVER
        self.direction = 1
        self.target = self.mark = 0
        self.keep, self.slope, self.rate = keep, slope, rate
        self.idle_windings, self.mode = idle_windings, 3
        self._plan: Plan | None = None
        self._begin_tick = 0  # of the plan
        self._ends_at: Ns = NEVER
        self._go_run = self._go_keep = self._braking_slope = 0  # as they were when G was given
        self._limit_tick = -1  # the tick before which a limit was seen
        self._onward = 1  # where the slew behind a stop leads
        self._shut = False  # the limit ahead was closed when last looked at
        self._floor = (0, 0)  # slope and stop OK rate that a stop at a limit does not fall below

    # -- where it is -------------------------------------------------------------------------------------

    @property
    def idle(self) -> bool:
        """Whether no motion is under way."""
        return self.action is Action.IDLE

    @property
    def field_origin(self) -> int:
        """The place of the shaft with the field at the begin of its cycle: where it stood at the reset.

        = does not move it: "no actual motor motion is involved" (page 38).
        """
        return self._field

    def field(self, now: Ns) -> int:
        """How far the field has come since the reset, in microsteps."""
        return self._axis.shaft_at(now) - self._field

    def position(self, now: Ns) -> int:
        """The location, in microsteps."""
        return self._axis.shaft_at(now) - self._origin

    def pulses(self, now: Ns) -> int:
        """How many steps were made since the board was made."""
        return self._axis.pulses_at(now)

    def speed(self, now: Ns) -> int:
        """The rate in microsteps/s; the stop OK rate at rest."""
        return self.keep if self._plan is None else self._point(now).rate

    def seen_target(self, now: Ns) -> int:
        """The target of a motion that has one, else the location."""
        return self.target if self.action in (Action.GOING, Action.TURNING) else self.position(now)

    def target_speed(self, now: Ns) -> int:
        """The rate towards which the ramps lead."""
        match self.action:
            case Action.SLEWING:
                return self.rate
            case Action.GOING if self._plan is not None and self._tick(now) - self._begin_tick < self._plan.falls:
                return self._go_run
        return self.keep

    def step_action(self, now: Ns) -> int:
        """The number of what it does in report -8 (page 42)."""
        if self._limit_tick >= self._tick(now):
            return 8
        match self.action:
            case Action.IDLE:
                return 0
            case Action.GOING:
                plan = self._plan
                assert plan is not None
                tick = self._tick(now) - self._begin_tick
                return 1 if tick < plan.rises else 2 if tick < plan.falls else 3
            case Action.SLEWING:
                return 4
            case Action.STOPPING:
                return 5
            case Action.REVERSING if self._onward != self.direction:
                return 6
        return 7

    # -- commands ----------------------------------------------------------------------------------------

    def go(self, target: int, now: Ns) -> None:
        """Go to a position; from a motion by way of a stop ("The code ALWAYS starts from a stop").

        To a place beyond the stop, towards a limit that is closed, it does not go on: there is no step towards one.
        """
        self.target = saturated(target)
        if self.action is Action.IDLE:
            self._start_go(self._tick(now), now)
            return
        self._stop_for(Action.TURNING, now)
        if self.action is Action.TURNING and self._leads_on(now) and self._limits.meets(self.name, self.direction):
            self.action = Action.STOPPING

    def go_relative(self, steps: int, now: Ns) -> None:
        """Go so far from the target of a motion that has one, else from here (page 33)."""
        self.go(self.seen_target(now) + steps, now)

    def slew(self, direction: int, now: Ns) -> None:
        """Go in a direction until stopped; not on towards a limit that is closed, and from a stop at one after that."""
        if self.action is Action.IDLE:
            self._start_slew(direction, self._tick(now), now)
        elif direction == self.direction and self._limits.meets(self.name, direction):
            self._stop_for(Action.STOPPING, now)
        elif direction == self.direction and not self._at_limit:
            self._continue_slew(now)
        else:
            self._onward = direction
            self._stop_for(Action.REVERSING, now)

    def stop(self, now: Ns) -> None:
        """Z: down the ramp to the stop OK rate."""
        if self.action is not Action.IDLE:
            self._stop_for(Action.STOPPING, now)

    def halt(self, now: Ns) -> None:
        """Stop at once."""
        if self._axis.moving:
            self._axis.cut(now)
        self._rest()

    def displace(self, by: int, now: Ns) -> None:
        """The shaft, at rest, is `by` microsteps from where it was thought to be. The field stays as it is."""
        self._axis.displace(by, now)
        self._field += by

    def look_at_limit(self, now: Ns) -> None:
        """A limit may have closed: one ahead is latched, and stops the motor at once or as Z does (page 12).

        So it ends what was to follow a stop under way, too. That stop is not made longer by a P or K that comes then.
        """
        if self.action is Action.IDLE:
            return
        before, self._shut = self._shut, self._limits.meets(self.name, self.direction)
        if not self._shut or before:
            return
        self._limit_tick = self._tick(now)
        if self._limits.hard:
            self.halt(now)
        else:
            self._floor = (self.slope, self.keep)
            self.stop(now)

    @property
    def stepping(self) -> bool:
        """Whether its next step comes by itself."""
        return self._axis.stepping

    def stops_at_once(self, now: Ns) -> bool:
        """Whether a stop that begins at `now` makes no further step."""
        return not self._stop_plan(now).steps

    def cut_by_limit(self, now: Ns) -> bool:
        """Whether a limit ahead that closes at `now` ends the steps with the one before."""
        return self._limits.hard or self.stops_at_once(now)

    def set_rate(self, rate: int, now: Ns) -> None:
        """R: a plain slew follows at once, anything else from its next motion on."""
        self.rate = rate
        if self.action is Action.SLEWING:
            self._continue_slew(now)

    def set_keep(self, keep: int, now: Ns) -> None:
        """K: a stop under way ends there; a target move keeps the one that it began with."""
        self.keep = keep
        self._raise_floor()
        if self.action in (Action.STOPPING, Action.REVERSING, Action.TURNING):
            self._stop_for(self.action, now)

    def set_slope(self, slope: int, now: Ns) -> None:
        """P: at once. A target move keeps the braking point that it computed (page 31)."""
        self.slope = slope
        self._raise_floor()
        if self.action is Action.GOING:
            self._continue_go(now)
        elif self.action is Action.SLEWING:
            self._continue_slew(now)
        elif self.action is not Action.IDLE:
            self._stop_for(self.action, now)

    def set_position(self, position: int, now: Ns) -> None:
        """=: this place is `position`; then the motor stops. Neither the shaft nor the field moves for it."""
        self._origin = self._axis.shaft_at(now) - position
        self.stop(now)

    def step(self, direction: int, now: Ns) -> None:
        """One microstep at `now`, asked for by a pulse."""
        self.direction = direction
        if abs(self.position(now) + direction) <= LARGEST:
            self._axis.start(ONE_STEP.at(to_fixed(now - TICK)), direction, (), now)
            self._axis.advance(now)

    # -- time --------------------------------------------------------------------------------------------

    def advance(self, at: Ns) -> bool:
        """A step of note falls due at `at`, or the plan is over. True when the motor has come to rest."""
        if self._axis.deadline <= at:
            self._axis.advance(at)
        if self._ends_at <= at:
            return self._end(at)
        self._await()
        return False

    def wired(self) -> None:
        """A wire leads from a winding to another device: every step is a moment of its own."""
        self._axis.every_pulse = True

    # -- plans -------------------------------------------------------------------------------------------

    def next_tick(self, now: Ns) -> Ns:
        """When the tick after `now` is."""
        return self._time_zero + (self._tick(now) + 1) * TICK

    def _tick(self, now: Ns) -> int:
        """The last tick up to and including `now`."""
        return (now - self._time_zero) // TICK

    def _point(self, now: Ns) -> Point:
        assert self._plan is not None
        return self._plan.point(self._tick(now) - self._begin_tick)

    def _room(self, direction: int, now: Ns) -> int:
        """How many steps there are to the end of the range of positions."""
        return LARGEST - direction * self.position(now)

    def _start_go(self, tick: int, now: Ns) -> None:
        distance = self.target - self.position(now)
        if distance == 0:
            self._rest()
            return
        self._go_run, self._go_keep, self._braking_slope = self.rate, self.keep, self.slope
        self._turn(1 if distance > 0 else -1)
        if self._barred(tick):
            return
        speed = min(self._go_keep, self._go_run) * UPDATES
        plan = toward(abs(distance), 0, speed, self._go_run, self.slope, self._go_keep, self._braking_slope)
        self._follow(Action.GOING, plan, tick, now)

    def _continue_go(self, now: Ns) -> None:
        assert self._plan is not None
        point, tick = self._point(now), self._tick(now)
        left = abs(self.target - self.position(now))
        braking = tick - self._begin_tick >= self._plan.falls + 1
        self._follow(
            Action.GOING,
            toward(left, point.phase, point.speed, self._go_run, self.slope, self._go_keep, self._braking_slope,
                   braking=braking),
            tick, now,
        )  # fmt: skip

    def _start_slew(self, direction: int, tick: int, now: Ns) -> None:
        self._turn(direction)
        if self._barred(tick):
            return
        room = self._room(direction, now)
        if room == 0:
            self._rest()
            return
        speed = min(self.keep, self.rate) * UPDATES
        self._follow(Action.SLEWING, slewing(0, speed, self.rate, self.slope, room), tick, now)

    @property
    def _at_limit(self) -> bool:
        """Whether a stop is under way because a limit was met."""
        return self._floor != (0, 0)

    def _raise_floor(self) -> None:
        """A stop at a limit that P or K has made shorter is not made longer again by the next."""
        if self._at_limit:
            slope, keep = self._floor
            self._floor = max(slope, self.slope), max(keep, self.keep)

    def _turn(self, direction: int) -> None:
        """From rest, in a direction."""
        self.direction = direction
        self._shut, self._floor, self._limit_tick = False, (0, 0), -1

    def _leads_on(self, now: Ns) -> bool:
        """Whether the target lies beyond the place at which the stop ends that begins at `now`."""
        assert self._plan is not None
        rest = self.position(now) + self.direction * self._plan.steps
        return self.direction * (self.target - rest) > 0

    def _barred(self, tick: int) -> bool:
        """Whether the limit ahead is active already: then there is no step, it is latched, the motor idle."""
        if not self._limits.meets(self.name, self.direction):
            return False
        self._limit_tick = tick
        self._rest()
        return True

    def _continue_slew(self, now: Ns) -> None:
        point = self._point(now)
        plan = slewing(point.phase, point.speed, self.rate, self.slope, self._room(self.direction, now))
        self._follow(Action.SLEWING, plan, self._tick(now), now)

    def _stop_for(self, action: Action, now: Ns) -> None:
        """Stop, then do what `action` says."""
        self._follow(action, self._stop_plan(now), self._tick(now), now)

    def _stop_plan(self, now: Ns) -> Plan:
        point, (slope, keep) = self._point(now), self._floor
        room = self._room(self.direction, now)
        return stopping(point.phase, point.speed, max(self.slope, slope), max(self.keep, keep), room)

    def _follow(self, action: Action, plan: Plan, tick: int, now: Ns) -> None:
        """Do what `plan` says, from `tick` on, which is not after `now`."""
        if self._axis.moving:
            self._axis.cut(now)
        self.action, self._plan, self._begin_tick = action, plan, tick
        if plan.ticks == 0:
            self._end(now)
            return
        begin = self._time_zero + tick * TICK
        self._ends_at = begin + plan.ticks * TICK
        if plan.steps:
            self._axis.start(plan.train.at(to_fixed(begin)), self.direction, (), now)
        self._await()

    def _end(self, now: Ns) -> bool:
        """The plan is over: rest, or what was to follow the stop. True at rest."""
        tick = self._tick(now)
        if self.action is Action.TURNING:
            self._start_go(tick, now)
        elif self.action is Action.REVERSING:
            self._start_slew(self._onward, tick, now)
        else:
            self._rest()
        return self.action is Action.IDLE

    def _rest(self) -> None:
        self.action = Action.IDLE
        self._plan = None
        self._ends_at = NEVER
        self.deadline = NEVER

    def _await(self) -> None:
        self.deadline = min(self._axis.deadline, self._ends_at)
