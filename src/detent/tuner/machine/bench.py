"""A real axis with a witness: what each controller can do for a trial, over its driver.

A witness is a switch that is closed at one end of the travel and over everything behind it. Every motion here has a
number of steps, so that it ends by itself whatever becomes of the host and the line; what was made is read from the
unit's own counter afterwards.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from detent.hosts.axis import Axis
from detent.hosts.errors import DriverError, MotionFailed
from detent.hosts.exchange import Rest, Steps, attempt
from detent.moves.law import Law, Values

POLL = 0.01  # seconds between two questions whether a motion is over


class WitnessError(ValueError):
    """A witness that this controller cannot read; the text says which it can."""


class Knob(NamedTuple):
    """The setting that trials make harder, step by step; one of several numbers sets all of them alike.

    `longer`: a larger number is a longer ramp. `reserve`: by what the last good one is made gentler before it is used.
    """

    name: str
    settings: tuple[str, ...]
    longer: bool
    low: int
    high: int
    reserve: float

    def set(self, values: Values, number: int) -> dict[str, int]:
        """The settings with the knob at `number`."""
        return {**values, **dict.fromkeys(self.settings, number)}

    def gentlest(self, values: Values) -> int:
        """The number that is no harder than any of the settings: as trials set all of them alike."""
        numbers = [values[name] for name in self.settings]
        return max(numbers) if self.longer else min(numbers)

    def harder(self, number: int, factor: float) -> int:
        """The number that is harder by a factor above 1 (gentler below 1), within what the command takes."""
        wanted = number / factor if self.longer else number * factor
        return min(max(round(wanted), self.low), self.high)


class Bench:
    """One axis and its witness. The generators are operations of a driver: `Blocking.perform` carries them out.

    `away` is the direction that leads from the witness into the travel, `lowest` the count below which the unit refuses
    to go (None: there is none), `sees_opening` whether it can be read that the witness opens.
    """

    away = 1
    lowest: int | None = None
    sees_opening = True
    slowest = 1  # steps/s

    def __init__(self, driver: Any, law: Law, knob: Knob) -> None:
        self.driver, self.law, self.knob = driver, law, knob
        self.title: str = driver.title

    def prepare(self) -> Steps[None]:
        """See that the unit can be tried. Raises DriverError, ValueError."""
        if (yield from self.driver.moving()):
            raise MotionFailed(self.title, "moves, or runs a program: stop it before it is tuned")

    def closed(self) -> Steps[bool]:
        """Whether the witness is closed."""
        raise NotImplementedError
        yield

    def slowly(self, rate: int) -> Steps[None]:
        """Make the next motions at `rate` steps/s, without a ramp."""
        raise NotImplementedError
        yield

    def settings(self, values: Values) -> Steps[None]:
        """Make the next motions with these settings."""
        raise NotImplementedError
        yield

    def count(self) -> Steps[int]:
        """The unit's own count of steps."""
        found: int = yield from self.driver.position()
        return found

    def move(self, steps: int, timeout: float) -> Steps[int]:
        """Move by `steps` (with the controller's sign) and wait: what was made, by the unit's count.

        Raises MotionFailed when it does not end within `timeout` seconds: it was told to stop at once then.
        """
        before = yield from self.count()
        yield from self._start(steps)
        yield from self.rest(timeout)
        return self.between(before, (yield from self.count()))

    def between(self, before: int, after: int) -> int:
        """Steps from one count to another."""
        return after - before

    def rest(self, timeout: float) -> Steps[None]:
        """Wait until the axis stands."""
        waited = 0.0
        while (yield from self.driver.moving()):
            if waited >= timeout:
                stopped = yield from attempt(self.driver.halt())
                told = "it would not be stopped either" if isinstance(stopped, DriverError) else "it was stopped"
                raise MotionFailed(self.title, f"still moved {timeout:.1f} s after it was told to move; {told}")
            yield Rest(POLL)
            waited += POLL

    def _start(self, steps: int) -> Steps[None]:
        yield from self.driver.move_by(steps)

    def end(self) -> Steps[None]:
        """Stop through the ramp, and wait until it stands; at once, if it does not.

        A unit that is busy with something else may refuse to stop: every motion of a trial ends by itself.
        """
        yield from attempt(self.driver.stop())
        yield from self.rest(10.0)


class GsC200Bench(Bench):
    """A GS-C200 or GS-C200S: any of UI1 to UI3, closed when it reads `level`. EOT and HOME cannot be read."""

    slowest = 10

    def __init__(self, driver: Any, law: Law, knob: Knob, pin: int, level: bool, away: int) -> None:
        super().__init__(driver, law, knob)
        self._pin, self._level, self.away = pin, level, away
        self._positions = None if driver.signed else 10_000_000
        self.lowest = None if driver.signed else 0

    def prepare(self) -> Steps[None]:
        """Fetch an error of an old program, too. In programming mode settings would be stored and not obeyed."""
        yield from super().prepare()
        if self.driver.programming:
            raise MotionFailed(self.title, "is in programming mode: leave it before it is tuned")

    def closed(self) -> Steps[bool]:
        """V2."""
        return (yield from self.driver.pins()).inputs[self._pin - 1] is self._level

    def slowly(self, rate: int) -> Steps[None]:
        """S and T alike: there is no ramp."""
        yield from self._told(rate // 10, rate // 10, 1)

    def settings(self, values: Values) -> Steps[None]:
        """S, T and R."""
        yield from self._told(values["S"], values["T"], values["R"])

    def _told(self, start: int, top: int, ramp: int) -> Steps[None]:
        yield from self.driver.set_start_stop(10 * start)
        yield from self.driver.set_top(10 * top)
        yield from self.driver.set_ramp(ramp)

    def _start(self, steps: int) -> Steps[None]:
        yield from self.driver.fresh()
        yield from self.driver.move(steps)

    def between(self, before: int, after: int) -> int:
        """A GS-C200 counts from 0 to 9 999 999 and begins again."""
        if self._positions is None:
            return after - before
        half = self._positions // 2
        return (after - before + half) % self._positions - half


class DcbBench(Bench):
    """A DCB-274: HOME, P1 to P5, LIMIT-A or LIMIT-B, as `]` reads them. A limit stops the motion that closes it."""

    slowest = 40

    def __init__(self, driver: Any, law: Law, knob: Knob, flag: str, level: bool, away: int) -> None:
        super().__init__(driver, law, knob)
        self._flag, self._level, self.away = flag, level, away

    def closed(self) -> Steps[bool]:
        """] 0."""
        return getattr((yield from self.driver.inputs()), self._flag) is self._level

    def slowly(self, rate: int) -> Steps[None]:
        """K 0: there is no ramp."""
        yield from self._told(rate, rate, 0, 0, 1)

    def settings(self, values: Values) -> Steps[None]:
        """I, V, K and D."""
        yield from self._told(values["I"], values["V"], values["K up"], values["K down"], values["D"])

    def _told(self, initial: int, slew: int, up: int, down: int, divide: int) -> Steps[None]:
        yield from self.driver.divide(divide)
        yield from self.driver.initial_velocity(initial)
        yield from self.driver.slew_velocity(slew)
        yield from self.driver.ramp_slope(up, down)


class GenStepperBench(Bench):
    """A motor of a BS0610 or BS0710: its limit inputs, which stop the motion that closes them."""

    def __init__(self, driver: Any, law: Law, knob: Knob, high: bool, away: int) -> None:
        super().__init__(driver, law, knob)
        self._high, self.away = high, away

    def closed(self) -> Steps[bool]:
        """Memory 5."""
        met = yield from self.driver.limits()
        return bool(met.high if self._high else met.low)

    def slowly(self, rate: int) -> Steps[None]:
        """K and R alike: there is no ramp."""
        yield from self.driver.set_stop_rate(rate)
        yield from self.driver.set_run_rate(rate)

    def settings(self, values: Values) -> Steps[None]:
        """K, R and P."""
        yield from self.driver.set_stop_rate(values["K"])
        yield from self.driver.set_run_rate(values["R"])
        yield from self.driver.set_slope(values["P"])

    def _start(self, steps: int) -> Steps[None]:
        yield from self.driver.go_by(steps)


class SupersigmaBench(Bench):
    """A SUPERSIGMA drive: RAIL, of which status tells only that it closed during the last movement.

    So nobody sees it open: where it should have opened, the next approach shows whether it had.
    """

    slowest = 100
    sees_opening = False

    def __init__(self, driver: Any, law: Law, knob: Knob) -> None:
        super().__init__(driver, law, knob)
        self._met = False
        self._rate: int | None = None  # None: with the ramps of the table
        self._limit = law.settings[0].high

    def closed(self) -> Steps[bool]:
        """Whether the last movement towards it closed it."""
        return self._met
        yield

    def slowly(self, rate: int) -> Steps[None]:
        """The rate goes with each movement, in hundreds."""
        self._rate = rate // 100 * 100
        return
        yield

    def settings(self, values: Values) -> Steps[None]:
        """The limit goes with each movement."""
        self._rate, self._limit = None, values["limit"]
        return
        yield

    def move(self, steps: int, timeout: float) -> Steps[int]:
        """By the steps that status reports, as a drive counts no positions."""
        if self._rate is None:
            yield from self.driver.limited(steps, 100 * self._limit)
        else:
            yield from self.driver.constant(steps, self._rate)
        yield from self.rest(timeout)
        report = yield from self.driver.status()
        if report.refused or report.excessive_force:
            what = "refused a command" if report.refused else f"met excessive force after {report.steps} steps"
            raise MotionFailed(self.title, what)
        self._met = report.end_of_rail if steps < 0 else False
        if report.end_of_rail and steps > 0:
            raise MotionFailed(self.title, f"met the end of the rail {report.steps} steps on its way out")
        made: int = report.steps if steps > 0 else -report.steps
        return made


def knob_of(law: Law) -> Knob:
    """The setting of a law that trials make harder, and what is held in reserve.

    A ramp twice as long costs a few percent of the time, and of 6144 simulated days one lost a step with it, where the
    last good ramp itself lost on one day of four. A SUPERSIGMA has its ramp in an EPROM, and only the speed at which it
    ends is a command: its reserve is a guess.
    """
    letters = [setting.name for setting in law.settings]
    by_name = {setting.name: setting for setting in law.settings}
    if "R" in letters and "S" in letters:
        return Knob("R", ("R",), True, by_name["R"].low, by_name["R"].high, 2.0)
    if "K up" in letters:
        high = min(by_name["K up"].high, by_name["K down"].high)
        return Knob("K", ("K up", "K down"), True, 1, high, 2.0)
    if "P" in letters:
        return Knob("P", ("P",), False, by_name["P"].low, by_name["P"].high, 2.0)
    return Knob("limit", ("limit",), False, by_name["limit"].low, by_name["limit"].high, 1.25)


def bench(law: Law, driver: Axis, witness: str, away: int | None = None) -> Bench:
    """The bench of a unit. `witness` is an input, with ``=1`` behind it if it is closed when it reads 1.

    `away` is the direction from the witness into the travel, +1 or -1; where the input itself has a side, or the unit
    searches for its origin on one, it need not be given. Raises WitnessError.
    """
    name, _, text = witness.strip().upper().partition("=")
    make = _BENCHES[law.model]
    if text not in ("", "0", "1"):
        raise WitnessError(f"--witness {witness}: write {name}, or {name}=1 where 1 is closed")
    return make(law, driver, knob_of(law), name, text, away)


def _gsc200(law: Law, driver: Axis, knob: Knob, name: str, text: str, away: int | None) -> Bench:
    pins = {"UI1": 1, "UI2": 2, "UI3": 3}
    if name not in pins:
        raise WitnessError(
            f"--witness {name}: the host of a {law.model} can read UI1, UI2 and UI3, and neither HOME nor EOT: wire "
            "the switch to one of them, too"
        )
    return GsC200Bench(driver, law, knob, pins[name], text == "1", away or 1)


def _dcb274(law: Law, driver: Axis, knob: Knob, name: str, text: str, away: int | None) -> Bench:
    flags = {"HOME": "home", "LIMIT-A": "limit_a", "LIMIT-B": "limit_b", **{f"P{n}": f"p{n}" for n in range(1, 6)}}
    if name not in flags:
        raise WitnessError(f"--witness {name}: the host of a {law.model} can read {', '.join(flags)}")
    side = {"LIMIT-A": -1, "LIMIT-B": 1}.get(name)
    return DcbBench(driver, law, knob, flags[name], text != "0", _side(name, side, away) or 1)


def _genstepper(law: Law, driver: Axis, knob: Knob, name: str, text: str, away: int | None) -> Bench:
    motor = getattr(driver, "motor", "X")
    sides = {f"L{motor}-": 1, f"L{motor}+": -1}
    if name not in sides:
        raise WitnessError(
            f"--witness {name}: the host can read {' and '.join(sides)} for motor {motor}; a board has no other input "
            "that does not move a motor"
        )
    if text == "1":
        raise WitnessError(f"--witness {name}=1: limit inputs are low when met, unless T has turned them round")
    return GenStepperBench(driver, law, knob, sides[name] < 0, _side(name, sides[name], away) or 1)


def _supersigma(law: Law, driver: Axis, knob: Knob, name: str, text: str, away: int | None) -> Bench:
    if name != "RAIL" or text == "1":
        raise WitnessError(f"--witness {name}: a drive tells only of RAIL, and only that it was met")
    if away == -1:
        raise WitnessError("--away -1: a drive looks for the end of its rail backward, so its travel is forward")
    return SupersigmaBench(driver, law, knob)


def _side(name: str, side: int | None, away: int | None) -> int | None:
    if side is not None and away not in (None, side):
        raise WitnessError(f"--away {away:+d}: {name} is the switch at the other end; leave --away out")
    return side or away


_BENCHES: dict[str, Callable[[Law, Axis, Knob, str, str, int | None], Bench]] = {
    "gs-c200": _gsc200,
    "gs-c200s": _gsc200,
    "dcb-274": _dcb274,
    "supersigma": _supersigma,
    "bs0610": _genstepper,
    "bs0710": _genstepper,
}
