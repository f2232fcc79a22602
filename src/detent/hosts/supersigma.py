"""Host side of the SUPERSIGMA robot: the Central Control Unit of its MICROBUS, and one drive as an axis.

It knows the messages of the drives (Cassinis, table 1; the codes are Detent's: docs/controllers/supersigma.md) and no
more. Steps are half steps, with a sign: forward is plus; speeds are half steps/s, multiples of 100. Only status is
answered, so whether a command was taken is known when the drive is asked.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import asin, sqrt

from detent.hosts.axis import POLL, Axis, Limits, Speeds
from detent.hosts.errors import Busy, DriverError, MotionFailed
from detent.hosts.exchange import Asynchronous, Blocking, Rest, Steps, attempt, operation
from detent.hosts.interpolation import CLOCK_HZ, EXCHANGE, MESSAGE, UNIT, Run, line, together
from detent.hosts.microbus import (
    CONSTANT,
    EMERGENCY,
    LARGEST_STEPS,
    LIMIT,
    MOVE,
    ORIGINATE,
    PATIENCE,
    STOP,
    BusDriver,
    Report,
    drive_number,
    message,
    speed_units,
)

# The curve of the paper, V = 15000 sin^2(4.54426 t + 0.2097) half steps/s: where ramps begin, and where they end.
AWAITED = 50  # times that a drive is asked whether a movement has ended that should have
LOW, TOP, _RATE, _PHASE = 650, 15_000, 4.54426, 0.2097


class DriveFailed(MotionFailed):
    """A drive did not do what it was told: its number, and what it reported."""

    def __init__(self, drive: int, what: str, report: Report) -> None:
        super().__init__(f"drive {drive}", what)
        self.drive, self.report = drive, report


class Supersigma(Axis, BusDriver):
    """One drive, `drive` its number on the bus; several may share a port.

    A drive does not count positions. The driver does, from the steps that status reports of each movement, and knows
    of no other movements: if somebody else moves the drive, a second host or a `Ccu` on the same port, the position
    is wrong until the next `home` or `set_position`.
    """

    fastest = TOP

    def __init__(self, drive: int = 1, *, patience: float = PATIENCE) -> None:
        """Raises ValueError."""
        drive_number(drive)
        self.drive, self._patience = drive, patience
        self.title = f"drive {drive}"
        self._limit: int | None = None  # of moves with ramps, half steps/s
        self._from = 0  # where the movement that is accounted for began, or the drive stands
        self._direction = 0  # of that movement; 0: there is none
        self._last = 0  # direction of the last movement
        self._before = Report(0, 0)  # what was reported before the movement that is accounted for
        self._taken = False  # that movement was seen
        self._originating = False
        self._wanted: int | None = None  # steps of the movement under way, as long as nobody stops it

    # -- the drive's own commands ------------------------------------------------------------------------

    @operation
    def status(self) -> Steps[Report]:
        """Steps of the last movement or of the one under way, and flags. Raises NoAnswer."""
        report = yield from self._status(self.drive)
        if self._direction:
            self._taken = self._taken or report.moving
            for _ in range(AWAITED):  # nothing but the same answer tells a damaged one from a sound one
                if report.moving:
                    break
                before, report = report, (yield from self._status(self.drive))
                if report == before:
                    if self._taken or report.follows(self._before):  # else it was never heard
                        self._from = self._place(report)
                    self._direction = 0
                    break
        return report

    @operation
    def move(self, steps: int, *, limit: int | None = None) -> Steps[None]:
        """Begin a movement with ramps, at no more than `limit` half steps/s if that is given. Raises Busy.

        Below 650, where the ramps begin, it goes at the limit from the first step to the last.
        """
        yield from self._begin(_move(self.drive, steps, limit), steps)

    @operation
    def limited(self, steps: int, limit: int) -> Steps[None]:
        """Begin a movement with op-code 03h, whatever `limit`: below 650 the drive goes at 650. Raises Busy."""
        yield from self._begin(message(self.drive, LIMIT, steps, limit), steps)

    @operation
    def constant(self, steps: int, speed: int) -> Steps[None]:
        """Begin a movement at `speed` half steps/s without ramps. Raises Busy."""
        yield from self._begin(message(self.drive, CONSTANT, steps, speed), steps)

    @operation
    def originate(self) -> Steps[None]:
        """Begin the search for the origin, backward to the end of the rail. It is position 0. Raises Busy."""
        yield from self._begin(message(self.drive, ORIGINATE), None)

    @operation
    def emergency(self) -> Steps[None]:
        """Stop by the steepest ramp. Raises NoAnswer if the drive does not tell that it heard it."""
        self._wanted = None
        yield from self._stopped(self.drive, EMERGENCY)

    def _begin(self, data: bytes, steps: int | None) -> Steps[None]:
        """Begin a movement by `steps`, None for origination.

        A drive refuses to begin while it moves, and tells only when it is asked: it is asked first.
        """
        report = yield from self.status()
        if report.moving:
            raise self._busy()
        self._before, self._taken = (yield from self._distinct(self.drive, report, steps)), False
        # accounted for before it is said: whoever is broken off then may have said it
        self._direction = self._last = 1 if steps is not None and steps > 0 else -1
        self._originating, self._wanted = steps is None, None if steps is None else abs(steps)
        yield from self._moved(data, [self.drive])

    def _busy(self) -> Busy:
        return Busy(self.title, "moves", advice="wait() for its end, or stop() it")

    def _place(self, report: Report) -> int:
        """Where the drive is. While it looks for its origin it is backward of where it began: its steps say no more."""
        if self._originating:
            return 0 if report.originated and not report.moving else self._from
        return self._from + self._direction * report.steps

    # -- the common face ---------------------------------------------------------------------------------

    @operation
    def move_to(self, position: int) -> Steps[None]:
        """Begin a movement to `position`, 65 535 half steps away at most; none if it is there. Raises Busy."""
        if (yield from self.moving()):
            raise self._busy()
        yield from self.move_by(position - self._from)

    @operation
    def move_by(self, steps: int) -> Steps[None]:
        """Begin a movement by `steps`, with ramps, within the speed that `set_speeds` has set."""
        if steps:
            yield from self.move(steps, limit=self._limit)

    @operation
    def run_at(self, rate: float) -> Steps[None]:
        """A drive makes a number of steps, never an endless run. Raises ValueError."""
        raise ValueError(f"a drive moves by a number of steps: constant(steps, speed), up to {LARGEST_STEPS} of them")
        yield

    @operation
    def stop(self) -> Steps[None]:
        """Stop through the ramp. Raises NoAnswer if the drive does not tell that it heard it."""
        self._wanted = None
        yield from self._stopped(self.drive, STOP)

    @operation
    def halt(self) -> Steps[None]:
        """The emergency brake: a drive never just cuts its pulses."""
        yield from self.emergency()

    @operation
    def home(self, direction: int = -1) -> Steps[None]:
        """Begin the search for the origin, which always goes backward: -1. Position 0 is there."""
        if direction != -1:
            raise ValueError("a drive looks for its origin backward: home(-1), or originate()")
        yield from self.originate()

    @operation
    def position(self) -> Steps[int]:
        """Where the movements of this driver have brought it; during a search for the origin, where that began."""
        report = yield from self.status()
        return self._place(report) if self._direction else self._from

    @operation
    def set_position(self, position: int) -> Steps[None]:
        """Call the place where the drive is `position`, on this side only. Raises Busy during a search."""
        here = yield from self.position()
        if self._direction and self._originating:
            raise Busy(self.title, "looks for its origin, which will be position 0")
        self._from += position - here

    @operation
    def moving(self) -> Steps[bool]:
        """Whether the motor moves."""
        return (yield from self.status()).moving

    @operation
    def set_speeds(self, speeds: Speeds) -> Steps[Speeds]:
        """Keep moves below `slew`, rounded down to hundreds. Start and ramp are those of the drive's table.

        A `slew` below 650, where its ramps begin, makes them constant at that.

        What is returned counts for the paper's table. Nothing is sent: the limit goes with each move.
        """
        if speeds.slew < UNIT:
            raise ValueError(f"a speed limit is {UNIT} half steps/s or more, not {speeds.slew:g}")
        limit = int(speeds.slew // UNIT) * UNIT
        self._limit = limit if limit < TOP else None
        if limit <= LOW:
            return Speeds(limit, limit, 0.0)
        slew = min(limit, TOP)
        return Speeds(LOW, slew, (asin(sqrt(slew / TOP)) - _PHASE) / _RATE)
        yield

    @operation
    def limits(self) -> Steps[Limits]:
        """The end of the rail, if the last movement met it: which end, the direction of that movement tells."""
        met = (yield from self.status()).end_of_rail
        return Limits(met and self._last < 0, met and self._last > 0)

    @operation
    def wait(self, timeout: float | None = None) -> Steps[None]:
        """Wait until the drive stands.

        Raises DriveFailed for an emergency, a refusal, an origin that was not found, other steps than were told.
        """
        yield from super().wait(timeout)
        report = yield from self.status()
        originating, self._originating = self._originating, False
        wanted, self._wanted = self._wanted, None
        _check(self.drive, self._blamed(self.drive, report), wanted)
        if originating and not report.originated:
            raise DriveFailed(self.drive, "found no origin", report)


class Ccu(BusDriver):
    """The drives of one MICROBUS together: each call names the drive or the drives. It keeps no positions."""

    title = "CCU"

    def __init__(self, *, poll: float = POLL, patience: float = PATIENCE) -> None:
        """`poll`: seconds between two questions whether drives have arrived."""
        self._poll, self._patience = poll, patience

    # -- single drives -----------------------------------------------------------------------------------

    @operation
    def move(self, drive: int, steps: int, *, limit: int | None = None) -> Steps[None]:
        """Begin a movement with ramps, at no more than `limit` half steps/s if that is given. Raises Busy."""
        yield from self._begin(drive, _move(drive, steps, limit), steps)

    @operation
    def move_constant(self, drive: int, steps: int, speed: int) -> Steps[None]:
        """Begin a movement at `speed` half steps/s without ramps. Raises Busy."""
        yield from self._begin(drive, message(drive, CONSTANT, steps, speed), steps)

    @operation
    def originate(self, drive: int) -> Steps[None]:
        """Begin the search for the origin. Raises Busy."""
        yield from self._begin(drive, message(drive, ORIGINATE), None)

    @operation
    def stop(self, drive: int) -> Steps[None]:
        """Stop through the ramp. Raises NoAnswer if the drive does not tell that it heard it."""
        yield from self._stopped(drive, STOP)

    @operation
    def emergency(self, drive: int) -> Steps[None]:
        """Stop by the steepest ramp. Raises NoAnswer if the drive does not tell that it heard it."""
        yield from self._stopped(drive, EMERGENCY)

    @operation
    def status(self, drive: int) -> Steps[Report]:
        """Ask a drive. Raises NoAnswer."""
        return (yield from self._status(drive))

    def _begin(self, drive: int, data: bytes, steps: int | None) -> Steps[None]:
        """Begin a movement by `steps`, None for origination.

        Whoever is to move is asked first: it is at rest and in step with us then.
        """
        yield from self._distinct(drive, (yield from self._ready(drive)), steps)
        yield from self._moved(data, [drive])

    # -- several drives ----------------------------------------------------------------------------------

    @operation
    def wait_for(self, *drives: int) -> Steps[dict[int, Report]]:
        """Wait until all of `drives` are at rest; their reports.

        Raises DriveFailed as soon as one tells of an emergency or a refused command.
        """
        reports: dict[int, Report] = {}
        waiting = list(drives)
        while waiting:
            for drive in tuple(waiting):
                report = reports[drive] = self._blamed(drive, (yield from self.status(drive)))
                _check(drive, report)
                if not report.moving:
                    waiting.remove(drive)
            if waiting:
                yield Rest(self._poll)
        return reports

    @operation
    def move_all(self, steps: Mapping[int, int], *, limit: int | None = None) -> Steps[dict[int, Report]]:
        """Move several drives at once, each as fast as it can, and wait until all have arrived."""
        return self._made((yield from self._all(steps, lambda drive: _move(drive, steps[drive], limit))), steps)

    @operation
    def originate_all(self, drives: Iterable[int]) -> Steps[dict[int, Report]]:
        """Find the origins of several drives at once, and wait until all are found."""
        reports = yield from self._all(dict.fromkeys(drives), lambda drive: message(drive, ORIGINATE))
        for drive, report in reports.items():
            if not report.originated:
                raise DriveFailed(drive, "found no origin", report)
        return reports

    @operation
    def move_line(self, steps: Mapping[int, int], *, speed: int = 600) -> Steps[None]:
        """Move several drives on a straight line and wait until they have arrived, all together.

        No axis goes faster than `speed` half steps/s: constant speeds have no ramps, so the motors must be able to
        start at it (only axes of equal distances have the ramps of a speed limit, above 650). The longest axis makes
        one movement and never stops; the others follow it in movements of their own (`detent.hosts.interpolation`),
        each of which is sent when the one before has ended.

        Pulse for pulse every axis is less than one step of its own from the line, or one where it goes as far as the
        longest, if this computer is never later than 0.3 ms with a command; else it is as much more as the axis makes
        steps in the rest of the time. If a drive does not do what it is told, all are stopped.

        Raises DriveFailed, Busy, NoAnswer, ValueError.
        """
        fastest = speed_units(speed)
        drives = [drive for drive, count in steps.items() if count]
        for drive in drives:
            message(drive, CONSTANT, steps[drive], speed)
        limit = together([steps[drive] for drive in drives], fastest) * UNIT
        runs = [] if limit > LOW else line([steps[drive] for drive in drives], fastest)
        begins = {drive: steps[drive] for drive in drives} | {drives[run.axis]: run.steps for run in reversed(runs)}
        for drive in drives:
            yield from self._distinct(drive, (yield from self._ready(drive)), begins[drive])
        try:
            if limit > LOW:
                data = b"".join(message(drive, LIMIT, steps[drive], limit) for drive in drives)
                yield from self._moved(data, drives)
                self._made((yield from self.wait_for(*drives)), steps)
            else:
                yield from self._follow(drives, runs)
        except DriverError:
            for drive in drives:
                yield from attempt(self._stopped(drive, STOP))
            raise

    def _follow(self, drives: Sequence[int], runs: Sequence[Run]) -> Steps[None]:
        """Send each movement of a line at its time, when the one before of its drive has ended; wait for the last.

        One of as many steps as the one before it in the line, where the bus has no time for a refusal, is looked at on
        its way, if it has time for a question.
        """
        commands = [message(drives[run.axis], CONSTANT, run.steps, run.speed * UNIT) for run in runs]
        first = sum(run.at == place * MESSAGE for place, run in enumerate(runs[: len(drives)]))
        began = self._at + MESSAGE / CLOCK_HZ
        # one write, so that the drives start one message apart, as the line is reckoned
        yield from self._moved(b"".join(commands[:first]), drives)
        self._at += first * MESSAGE / CLOCK_HZ
        made = {run.axis: abs(run.steps) for run in runs[:first]}
        unsure: list[Run] = []
        for run, command in zip(runs[first:], commands[first:], strict=True):
            ask_at = began + (run.at - EXCHANGE) / CLOCK_HZ
            while unsure and self._at + MESSAGE / CLOCK_HZ <= ask_at:
                other = unsure.pop()
                yield from self._seen(drives[other.axis], began + other.end / CLOCK_HZ)
            yield Rest(max(ask_at - self._at, 0.0))
            yield from self._ended(drives[run.axis], made[run.axis])
            yield from self._said(command)
            if made[run.axis] == abs(run.steps):
                unsure.append(run)
            made[run.axis] = abs(run.steps)
            _check(drives[runs[0].axis], (yield from self._status(drives[runs[0].axis])))
        for other in reversed(unsure):
            yield from self._seen(drives[other.axis], began + other.end / CLOCK_HZ)
        yield Rest(max(began + max((run.end for run in runs), default=0) / CLOCK_HZ - self._at, 0.0))
        for axis, steps in made.items():
            yield from self._ended(drives[axis], steps)

    def _seen(self, drive: int, end: float) -> Steps[None]:
        """See that a drive moves whose movement lasts until `end` at least. Raises DriveFailed."""
        report = yield from self._status(drive)
        _check(drive, report)
        if not report.moving and self._at < end:
            raise DriveFailed(drive, "was not seen to move: a message was lost on the bus", report)

    def _ended(self, drive: int, steps: int) -> Steps[None]:
        """See that the movement of a drive has ended, which it should have by now. Raises DriveFailed."""
        for _ in range(AWAITED):
            report = yield from self._status(drive)
            _check(drive, report)
            if not report.moving:
                _check(drive, report, steps)
                return
        raise DriveFailed(drive, "still moves: its clock is not that of the other drives", report)

    def _all(self, steps: Mapping[int, int | None], start: Callable[[int], bytes]) -> Steps[dict[int, Report]]:
        """Start all drives that have steps, or none named: originations; wait for all."""
        drives = [drive for drive, count in steps.items() if count != 0]
        data = [start(drive) for drive in drives]
        for drive in drives:
            yield from self._distinct(drive, (yield from self._ready(drive)), steps[drive])
        for drive, one in zip(drives, data, strict=True):
            yield from self._moved(one, [drive])
        return (yield from self.wait_for(*drives))

    def _made(self, reports: Mapping[int, Report], steps: Mapping[int, int]) -> dict[int, Report]:
        """`reports`, if every drive has made its steps. Raises DriveFailed."""
        for drive, report in reports.items():
            _check(drive, report, abs(steps[drive]))
        return dict(reports)


def _move(drive: int, steps: int, limit: int | None) -> bytes:
    """The message of a movement at no more than `limit`: below where ramps begin that is constant speed."""
    if limit is None:
        return message(drive, MOVE, steps)
    return message(drive, CONSTANT if limit < LOW else LIMIT, steps, limit)


def _check(drive: int, report: Report, steps: int | None = None) -> None:
    """Raise DriveFailed for an emergency or a refused command, and for other `steps` made than were told."""
    if report.end_of_rail:
        raise DriveFailed(drive, f"met the end of its rail after {report.steps} steps", report)
    if report.excessive_force:
        raise DriveFailed(drive, f"met excessive force after {report.steps} steps", report)
    if report.refused:
        raise DriveFailed(drive, "refused a command, or has not heard it", report)
    if steps is not None and report.steps != steps:
        why = "a message was lost or damaged on the bus"
        if not report.steps:
            why += ", or its supply was lost, and its place with it: originate()"
        raise DriveFailed(drive, f"made {report.steps} of {steps} steps: {why}", report)


class BlockingSupersigma(Blocking, Supersigma):
    """A drive whose operations are calls."""


class AsyncSupersigma(Asynchronous, Supersigma):
    """A drive whose operations are coroutines."""


class BlockingCcu(Blocking, Ccu):
    """A CCU whose operations are calls."""


class AsyncCcu(Asynchronous, Ccu):
    """A CCU whose operations are coroutines."""
