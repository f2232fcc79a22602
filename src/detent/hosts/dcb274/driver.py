"""The DCB-274 as an axis: the common face over its commands (`detent.hosts.axis`), and the two shells."""

from detent.hosts.axis import Limits, Speeds
from detent.hosts.dcb274.handshake import RESET
from detent.hosts.dcb274.memory import Memory
from detent.hosts.dcb274.ranges import CEILING, FARTHEST, SLOWEST, commanded_rate, ramp_seconds
from detent.hosts.dcb274.unit import REST
from detent.hosts.errors import MotionFailed
from detent.hosts.exchange import Asynchronous, Blocking, Steps, operation

DIVIDE_AT = 229  # in NV memory (page 31)


class Dcb274(Memory):
    """One DCB-274. Here rates are those of the motor: what the unit is told, divided by D.

    `home_rate` is the rate at which `home` searches: the manual's example by default (page 38).
    """

    fastest = CEILING
    home_rate: float = 1000.0

    @operation
    def move_to(self, position: int) -> Steps[None]:
        """Begin an index to `position` (R), behind one that is under way."""
        yield from self.index_to(position)

    @operation
    def move_by(self, steps: int) -> Steps[None]:
        """Begin an index by `steps` (+ or -), behind one that is under way."""
        stands = (yield from self.moving_status()) == REST
        target = (yield from self.position()) + steps if stands else None
        yield from self.plus(steps) if steps >= 0 else self.minus(-steps)
        if target is not None and abs(target) <= FARTHEST:
            self._leave(target)

    @operation
    def run_at(self, rate: float) -> Steps[None]:
        """Ramp to `rate` and go on (M)."""
        divide = yield from self._divisor()
        yield from self.velocity(commanded_rate(rate * divide))

    @operation
    def halt(self) -> Steps[None]:
        """Stop at once: by ESC in single mode, where lines have names by ``|``, which stops this axis alone (page 57).

        Raises DriverError if the axis does not take it; `abort` then stops every axis on the line.
        """
        if self.mode == "single":
            yield from self.abort()
        else:
            yield from self.terminate()

    @operation
    def home(self, direction: int = -1) -> Steps[None]:
        """Begin the search for the home switch (F) at `home_rate`, or as fast as D lets it. The counter is not set."""
        divide = yield from self._divisor()
        yield from self.find_home(commanded_rate(min(self.home_rate * divide, CEILING)), direction)

    @property
    def runs_a_program(self) -> bool:
        """Whether a program that this driver has started, or met, has not been seen to end, and could print."""
        return self.mode == "single" and self._way.running

    @operation
    def moving(self) -> Steps[bool]:
        """Whether the motor moves (^), or a program runs that this driver has started."""
        if self._way.running:
            if not (yield from self._unbroken(self._way.over())):
                return True
            self._way.running = False
        return bool((yield from self.moving_status()) & 3)

    @operation
    def set_speeds(self, speeds: Speeds) -> Steps[Speeds]:
        """I, V, K, and another D if these rates and this ramp need one. Rates are 0.16 to 41 480 steps/s.

        How long a ramp takes is our reading of the unit's fixed table. Where lines have names the unit does not tell
        its speeds, and those that it was told are returned.
        """
        start, slew, seconds = speeds
        if not 0 < start <= slew or seconds < 0:
            raise ValueError(f"start at more than 0, at no more than slew, ramp for 0 s or more; not {speeds}")
        if start == slew:  # there is no ramp that could take its time
            speeds = speeds._replace(seconds=0.0)
            seconds = 0.0
        old = yield from self._divisor()
        fit = [d for d in (old, *range(1, 256)) if start * d >= SLOWEST and slew * d <= CEILING]
        fit = [d for d in fit if _slope(speeds, d) <= 255]
        if not fit:
            what = f"{SLOWEST} to {CEILING} steps/s, divided by the same 1 to 255, with ramps of at most 255 steps each"
            raise ValueError(f"no D makes {start:g} to {slew:g} steps/s in {seconds:g} s: the unit does {what}")
        divisor = fit[0]
        slope = max(_slope(speeds, divisor), 1 if seconds else 0)
        if divisor != old:
            yield from self.divide(divisor)
        yield from self.initial_velocity(commanded_rate(start * divisor))
        yield from self.slew_velocity(commanded_rate(slew * divisor))
        yield from self.ramp_slope(slope, slope)
        if self.mode == "single":
            settings = yield from self.examine()
            start, slew = settings.initial / divisor, settings.slew / divisor
        return Speeds(start, slew, slope * ramp_seconds(start * divisor, slew * divisor, divisor))

    @operation
    def limits(self) -> Steps[Limits]:
        """Limit B stops minus motion, limit A plus motion (])."""
        inputs = yield from self.inputs()
        return Limits(inputs.limit_b, inputs.limit_a)

    @operation
    def wait(self, timeout: float | None = None) -> Steps[None]:
        """Wait until the axis stands and no program runs.

        Raises MotionFailed after `timeout` seconds, if an index ended elsewhere than it should, or if a limit switch
        ended a search for home. The unit itself does not tell: an index cut by a limit counts as complete. A stop by
        another thread ends the wait and is no failure.
        """
        yield from super().wait(timeout)
        target, search, cut_short = self._target, self._search, self._cut_short
        self._leave(None)
        if cut_short:
            raise MotionFailed(self.title, RESET)
        told = self._times_told
        if target is not None:
            position = yield from self.position()
            if position != target and self._times_told == told:
                met = yield from self.limits()
                why = "limit A is met" if met.high else "limit B is met" if met.low else "was it stopped otherwise?"
                if not position:
                    why += " Or was its supply lost?"
                raise MotionFailed(self.title, f"stands at {position}, not at {target}: {why}")
        elif search:
            met = yield from self.limits()
            if met.high if search > 0 else met.low:
                raise MotionFailed(self.title, f"met limit {'A' if search > 0 else 'B'} before the home switch")

    def _divisor(self) -> Steps[int]:
        """D: as X tells, or where X does not, as NV memory has it (page 31) while this driver has not set it."""
        if self._divide is None:
            if self.mode == "single":
                yield from self.examine()
            else:
                self._divide = max((yield from self.read_memory(DIVIDE_AT))[0], 1)
        return self._divide or 1


def _slope(speeds: Speeds, divisor: int) -> int:
    """The K whose ramp takes that long."""
    return round(speeds.seconds / ramp_seconds(speeds.start * divisor, speeds.slew * divisor, divisor))


class BlockingDcb274(Blocking, Dcb274):
    """A DCB-274 whose operations are calls."""


class AsyncDcb274(Asynchronous, Dcb274):
    """A DCB-274 whose operations are coroutines."""
