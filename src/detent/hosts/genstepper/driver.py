"""The driver of one motor of a BS0610 or BS0710: the common face over GenStepper's commands, and its settings."""

from collections.abc import Collection, Mapping
from typing import ClassVar, Final

from detent.hosts.axis import Limits, Speeds
from detent.hosts.errors import BadAnswer, DriverError, MotionFailed
from detent.hosts.exchange import Asynchronous, Blocking, Progress, Steps, operation
from detent.hosts.genstepper.commands import (
    AUTO_RATE,
    LIMITS,
    MICROSTEPS,
    PAGE_RATE,
    RATES,
    RUN_RATE,
    STEP_MODES,
    STEP_SIZE,
    STOP_RATE,
    Commands,
    Reports,
    as_position,
)
from detent.hosts.genstepper.dialogue import MOTORS, TRIES, Action

GOING: Final = (Action.RAMPING_UP, Action.RUNNING, Action.SLOWING, Action.STOPPING_TO_GO)
"""Report -8 of a motor that goes to a target."""

ENDING: Final = (Action.IDLE, Action.STOPPING, Action.FINISHED)
"""Report -8 of a motor that was told to stop."""

NO_RAMP: Final = RATES[-1]  # a stop rate at which everything may stop at once (page 29)


class GenStepper(Commands):
    """Motor X or Y of a board. The drivers of both motors share the port; `Commands` says what acts on both.

    After `run_at` the run rate that moves had before is set again by the next move.
    """

    fastest = RATES[-1]
    _target: int | None = None  # where the move under way should end
    _times_told = 0  # how often this driver has told the motor to do something else
    _keep: int | None = None  # K, where it is known
    _slew: int | None = None  # R as moves shall have it
    _run: int | None = None  # R as it is

    def forget(self) -> None:
        """The connection was lost, or the board was reset: nothing is known of it."""
        super().forget()
        self._begin()
        self._keep = self._slew = self._run = None

    def _begin(self) -> None:
        """Something else begins: where it ends is not known yet; who waits for what was before learns of it."""
        self._target = None
        self._times_told += 1

    # -- the common face ---------------------------------------------------------------------------------

    @operation
    def move_to(self, position: int) -> Steps[None]:
        """Begin a move to `position` and return; a motor that moves stops first."""
        self._begin()
        yield from self._at_slew()
        yield from self.go_to(position)
        self._target = position

    @operation
    def move_by(self, steps: int) -> Steps[None]:
        """Begin a move by `steps`, from the target of a move under way, else from where it is; and return.

        Where a motor that slews or stops is when S reaches it, the board alone knows: its target is read back.
        """
        self._begin()
        yield from self._at_slew()
        before = yield from self.reports()
        told = Reports(*(yield from self.ask(f"{as_position(steps)}S", 0, again=False)))
        if before.action in GOING:
            self._target = before.target + steps
        elif before.action == Action.IDLE:
            self._target = before.position + steps
        elif told.action in GOING:
            self._target = told.target

    @operation
    def run_at(self, rate: float) -> Steps[None]:
        """Run at `rate` microsteps/s, rounded to whole ones, until told otherwise, or to a limit. Sets R."""
        whole = round(abs(rate))
        if whole not in RATES:
            raise ValueError(f"a rate to run at is {RATES[0]} to {RATES[-1]} microsteps/s, not {rate:g}; or stop()")
        self._begin()
        if self._slew is None:
            self._slew = yield from self.report(RUN_RATE)
        yield from self._set_run(whole)
        yield from self.slew(1 if rate > 0 else -1)

    @operation
    def stop(self) -> Steps[None]:
        """Z: ramp down to the stop rate and stand. Nothing happens if the motor stands already."""
        self._begin()
        yield from self.at_once("Z")
        yield from self._stopped("Z", ENDING)

    @operation
    def halt(self) -> Steps[None]:
        """Stop this motor at once: Z, K of 62500, at which everything may stop (page 29), and K as it was.

        Z first: K alone would end the stop in which a motor reverses, and let it start the other way at full rate.
        """
        self._begin()
        yield from self.at_once("Z")
        keep = self._keep
        if keep is None:
            (keep,) = yield from self.ask("Z", STOP_RATE)
        self._keep = None
        try:
            yield from self._stopped(f"Z{NO_RAMP}K", (Action.IDLE,), leaves=f"{keep}K")
            yield from self._kept(keep)
        except MotionFailed:
            yield from self._kept(keep)
            raise
        except DriverError as error:
            what = f"{error.what}; it was being halted, and its stop rate may be {NO_RAMP}: set_stop_rate({keep})"
            raise DriverError(self.title, what, error.spoken) from error

    def _kept(self, keep: int) -> Steps[None]:
        """K is given back, as it is due."""
        (told,) = yield from self.ask("", STOP_RATE)
        self._check("K", keep, told)
        self._keep = keep

    def _stopped(self, commands: str, ended: Collection[Action], leaves: str = "") -> Steps[None]:
        """Say `commands` until the board says that the motor has `ended`; `leaves` is due behind them.

        A Z that was damaged on its way is answered like one that was not.
        """
        for _ in range(TRIES):
            if (yield from self.order(commands, leaves=leaves)) in ended:
                return
        raise MotionFailed(self.title, "moves on, though it was told to stop: is one of its slew inputs held?")

    @operation
    def home(self, direction: int = -1) -> Steps[None]:
        """A board has no search for a reference: raises ValueError, which says how to make one."""
        raise ValueError(
            "a GenStepper board does not search for a reference: slew() to a limit switch, wait(), then set_position()"
        )
        yield

    @operation
    def moving(self) -> Steps[bool]:
        """Whether the motor moves."""
        return (yield from self.action()) is not Action.IDLE

    @operation
    def wait(self, timeout: float | None = None) -> Steps[None]:
        """Wait until the motor stands, for `timeout` seconds at most (None: as long as it takes).

        Raises MotionFailed then, and when a move ended elsewhere than it should have: at a limit, say. A stop by
        another thread ends the wait and is no failure.
        """
        position = None
        for _ in range(TRIES):  # nothing but another answer tells a damaged figure from a sound one
            yield from super().wait(timeout)
            target, told = self._target, self._times_told
            if target is None:
                return
            position = yield from self.position()
            if self._times_told != told:
                return
            if position == target:
                self._target = None
                return
        self._target = None
        met = yield from self.limits()
        switches = [f"L{self.motor}{sign}" for sign, closed in zip("-+", met, strict=True) if closed]
        why = f"; {' and '.join(switches)} is met" if switches else ""
        raise MotionFailed(self.title, f"stands at {position} and not at {target}{why}")

    @operation
    def set_speeds(self, speeds: Speeds) -> Steps[Speeds]:
        """Make moves so: K, R, and P from the seconds; returned is what the board makes of it, in whole numbers."""
        keep, run = (_whole(rate) for rate in (max(speeds.start, RATES[0]), speeds.slew))
        if not speeds.seconds >= 0:
            raise ValueError(f"a ramp takes 0 s or longer, not {speeds.seconds:g} s")
        rise = max(run - keep, 0)
        slope = RATES[-1]
        if rise < slope * speeds.seconds:
            slope = max(round(rise / speeds.seconds), RATES[0])
        self._keep = self._slew = self._run = None
        told = Reports(*(yield from self.ask(f"{keep}K{run}R{slope}P", 0)))
        wrong = (told.stop_rate, told.run_rate) != (keep, run)
        if wrong or (told.action == Action.IDLE and told.slope != slope):
            has = f"{told.stop_rate}K {told.run_rate}R {told.slope}P"
            raise BadAnswer(self.title, f"was given {keep}K {run}R {slope}P and has {has}: say it again")
        self._keep, self._slew, self._run = keep, run, run
        return Speeds(keep, run, rise / slope)

    @operation
    def limits(self) -> Steps[Limits]:
        """Which limit inputs are met (memory 5); active low, but for those that T of this driver has inverted."""
        levels = yield from self.memory(LIMITS)
        low, high = ((levels >> place & 1) == (name in self.active_high) for place, name in self._own)
        return Limits(low, high)

    @property
    def _own(self) -> tuple[tuple[int, str], ...]:
        """The bits of the motor's limit inputs, and their names."""
        first = 0 if self.motor == "Y" else 2
        return (first, f"{self.motor}-"), (first + 1, f"{self.motor}+")

    def _at_slew(self) -> Steps[None]:
        """Have moves made at the rate that they had, after a run at another."""
        if self._slew is not None and self._run != self._slew:
            yield from self._set_run(self._slew)

    def _set_run(self, rate: int) -> Steps[None]:
        self._run = None
        yield from Commands.set_run_rate(self, rate)
        self._run = rate

    @operation
    def set_run_rate(self, rate: int) -> Steps[None]:
        """R: the rate of moves and slews, 1 to 62500 microsteps/s; a slew follows at once."""
        yield from self._set_run(rate)
        self._slew = rate

    @operation
    def set_stop_rate(self, rate: int) -> Steps[None]:
        """K: the rate at which motion may start and stop, 1 to 62500 microsteps/s."""
        self._keep = None
        yield from super().set_stop_rate(rate)
        self._keep = rate

    # -- settings ----------------------------------------------------------------------------------------

    SETTINGS: ClassVar[tuple[str, ...]] = ("stop_rate", "run_rate", "slope", "step_mode")
    """The settings of a motor that a board can tell: K, R, P and O. W, H, T and V it does not tell."""

    @operation
    def saved(self) -> Steps[dict[str, object]]:
        """What a board can tell of its settings; it has no programs, and keeps nothing when it is switched off.

        `firmware`, `step_size` in sixty-fourths of a full step, `auto_full_step` in microsteps/s, and under `X` and
        `Y` the settings of the motors.
        """
        found: dict[str, object] = {"model": "genstepper", "firmware": (yield from self.version())}
        found["step_size"] = yield from self.memory(STEP_SIZE)
        found["auto_full_step"] = PAGE_RATE * (yield from self.memory(AUTO_RATE))
        for motor in MOTORS:
            found[motor] = yield from self._settings(motor)
        return found

    @operation
    def restore(self, saved: Mapping[str, object]) -> Steps[list[str]]:
        """Give a board what `saved` returned, and read it back; returned is what was written, in sentences.

        Another step size needs a reset: then positions are forgotten, and T, V, H and W as after power-on. A board
        that moves is left alone. If a setting fails, those before it are given back.
        """
        wanted = _wanted(saved)
        old = _wanted((yield from self.saved()))
        for motor in MOTORS:
            if (yield from self._other(motor).action()) is not Action.IDLE:
                raise MotionFailed(self.title, f"motor {motor} moves: stop it and wait before settings are restored")
        try:
            for done, (name, number) in enumerate(wanted.items()):
                yield Progress(done, len(wanted), "settings")
                yield from self._set(name, number)
        except DriverError as error:
            yield from self._give_back(old, error)
        there = _wanted((yield from self.saved()))
        if there != wanted:
            wrong = ", ".join(f"{name} {there[name]}" for name in wanted if there[name] != wanted[name])
            raise BadAnswer(self.title, f"has {wrong} after all was written")
        yield Progress(len(wanted), len(wanted), "settings")
        told = [f"{name} is {number}." for name, number in wanted.items()]
        if wanted["step_size"] != old["step_size"]:
            told.append("The board was reset for its step size: both motors are at position 0.")
        return told

    def _give_back(self, old: Mapping[str, int], error: DriverError) -> Steps[None]:
        """Write the settings `old` again after `error`, and raise it with what is where."""
        failed = []
        for name, number in old.items():
            try:
                yield from self._set(name, number)
            except DriverError:
                failed.append(f"{name} {number}")
        state = f"these could not be given back: {', '.join(failed)}" if failed else "what was set before is set again"
        raise DriverError(self.title, f"{error.what}; {state}", error.spoken) from error

    def _settings(self, motor: str) -> Steps[dict[str, int]]:
        told = (yield from self._other(motor).reports())._asdict()
        return {name: told[name] % len(STEP_MODES) if name == "step_mode" else told[name] for name in self.SETTINGS}

    def _set(self, name: str, number: int) -> Steps[None]:
        """Set what `_wanted` calls `name`, and read it back."""
        motor, _, setting = name.rpartition(".")
        one = self._other(motor or self.motor)
        match setting:
            case "step_size" if (yield from self.memory(STEP_SIZE)) != number:
                yield from self.reset(number)
            case "auto_full_step":
                yield from one.set_auto_full_step(number)
            case "stop_rate":
                yield from one.set_stop_rate(number)
            case "run_rate":
                yield from one.set_run_rate(number)
            case "slope":
                yield from one.set_slope(number)
            case "step_mode":
                yield from one.set_step_mode(number)

    def _other(self, motor: str) -> "GenStepper":
        """The driver of `motor` on the same board."""
        if motor == self.motor:
            return self
        other = GenStepper(motor, patience=self.patience)
        other._timeout, other._stale = self._timeout, self._stale
        return other


def _wanted(saved: Mapping[str, object]) -> dict[str, int]:
    """The numbers of `saved` by name, those of a motor as ``X.run_rate``. ValueError names the key that is wrong."""
    auto = _number("auto_full_step", saved.get("auto_full_step"), range(RATES[-1] + 1))
    found = {
        "step_size": _number("step_size", saved.get("step_size"), MICROSTEPS),
        "auto_full_step": auto - auto % PAGE_RATE,
    }
    for motor in MOTORS:
        settings = saved.get(motor)
        if not isinstance(settings, Mapping):
            raise ValueError(f"{motor}: there must be a table of the settings of motor {motor}")
        for name in GenStepper.SETTINGS:
            numbers = STEP_MODES if name == "step_mode" else RATES
            found[f"{motor}.{name}"] = _number(f"{motor}.{name}", settings.get(name), numbers)
    return found


def _number(name: str, value: object, numbers: range) -> int:
    if not isinstance(value, int) or value not in numbers:
        raise ValueError(f"{name}: it must be a whole number of {numbers[0]} to {numbers[-1]}, not {value!r}")
    return value


def _whole(rate: float) -> int:
    whole = round(rate) if 0 <= rate <= RATES[-1] else 0
    if whole not in RATES:
        raise ValueError(f"a rate is {RATES[0]} to {RATES[-1]} microsteps/s, not {rate:g}")
    return whole


class BlockingGenStepper(Blocking, GenStepper):
    """A motor whose operations are calls: ``BlockingGenStepper(GenStepper("X"), port)``."""


class AsyncGenStepper(Asynchronous, GenStepper):
    """A motor whose operations are coroutines."""
