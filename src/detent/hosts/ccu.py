"""The Central Control Unit of the SUPERSIGMA robot: a host's side of the MICROBUS.

It knows the messages of the drives (docs/controllers/supersigma.md) and no more: it sends commands, asks for status,
and waits. Steps are half steps, with a sign: forward is plus.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple, Protocol

from detent.hosts.interpolation import LARGEST_SPEED, UNIT, legs, order_of

MOVE, CONSTANT, LIMIT, ORIGINATE, STATUS, STOP, EMERGENCY = range(1, 8)
BACKWARD = 0x80
LARGEST_STEPS = 0xFFFF
POLL = 0.02  # seconds between two questions whether a drive has arrived


class Port(Protocol):
    """What carries the bytes: a serial port, or a line of a cell."""

    def write(self, data: bytes, /) -> object:
        """Send `data`."""

    def read(self, count: int, /) -> bytes:
        """The next `count` bytes; fewer if they do not come."""


class DriveFailed(RuntimeError):
    """A drive did not do what it was told: its number, and what it last reported, if it did."""

    def __init__(self, drive: int, what: str, report: "Report | None" = None) -> None:
        super().__init__(f"drive {drive} {what}")
        self.drive, self.report = drive, report


class Report(NamedTuple):
    """An answer to status: the steps of the last movement, and the flags."""

    steps: int
    flags: int

    @property
    def moving(self) -> bool:
        """The motor moves."""
        return bool(self.flags & 0x01)

    @property
    def end_of_rail(self) -> bool:
        """The end of the rail was met."""
        return bool(self.flags & 0x02)

    @property
    def excessive_force(self) -> bool:
        """There was excessive force."""
        return bool(self.flags & 0x04)

    @property
    def originated(self) -> bool:
        """The origin has been found."""
        return bool(self.flags & 0x08)

    @property
    def refused(self) -> bool:
        """A command was refused."""
        return bool(self.flags & 0x10)


class Ccu:
    """Drives on one MICROBUS. `wait` lets so many seconds pass, as time.sleep does."""

    def __init__(self, port: Port, wait: Callable[[float], object], *, poll: float = POLL) -> None:
        self._port, self._wait, self._poll = port, wait, poll

    # -- single drives -----------------------------------------------------------------------------------

    def move(self, drive: int, steps: int, *, limit: int | None = None) -> None:
        """Start a movement with ramps, at no more than `limit` half steps/s (a multiple of 100) if that is given."""
        if limit is None:
            self._send(drive, MOVE, steps)
        else:
            self._send(drive, LIMIT, steps, _units(limit))

    def move_constant(self, drive: int, steps: int, speed: int) -> None:
        """Start a movement at `speed` half steps/s, a multiple of 100, without ramps."""
        self._send(drive, CONSTANT, steps, _units(speed))

    def originate(self, drive: int) -> None:
        """Start the search for the origin."""
        self._send(drive, ORIGINATE)

    def stop(self, drive: int) -> None:
        """Stop through the ramp."""
        self._send(drive, STOP)

    def emergency(self, drive: int) -> None:
        """Stop by the steepest ramp."""
        self._send(drive, EMERGENCY)

    def status(self, drive: int) -> Report:
        """Ask a drive. Raises DriveFailed if it does not answer."""
        self._send(drive, STATUS)
        answer = self._port.read(3)
        if len(answer) != 3:
            raise DriveFailed(drive, f"does not answer status: {answer.hex(' ') or 'nothing'} came, and not 3 bytes")
        return Report(int.from_bytes(answer[:2], "big"), answer[2])

    # -- several drives ----------------------------------------------------------------------------------

    def wait_for(self, *drives: int) -> dict[int, Report]:
        """Wait until all of `drives` are at rest; their reports.

        Raises DriveFailed as soon as one tells of an emergency or a refused command.
        """
        reports: dict[int, Report] = {}
        waiting = list(drives)
        while waiting:
            for drive in tuple(waiting):
                report = reports[drive] = self.status(drive)
                _check(drive, report)
                if not report.moving:
                    waiting.remove(drive)
            if waiting:
                self._wait(self._poll)
        return reports

    def move_all(self, steps: Mapping[int, int], *, limit: int | None = None) -> dict[int, Report]:
        """Move several drives at once, each as fast as it can, and wait until all have arrived."""
        return self._all(steps, lambda drive: self.move(drive, steps[drive], limit=limit))

    def originate_all(self, drives: Iterable[int]) -> dict[int, Report]:
        """Find the origins of several drives at once, and wait until all are found."""
        reports = self._all(dict.fromkeys(drives, 1), self.originate)
        for drive, report in reports.items():
            if not report.originated:
                raise DriveFailed(drive, "found no origin", report)
        return reports

    def move_line(self, steps: Mapping[int, int], *, speed: int = 600) -> None:
        """Move several drives on a straight line and wait until they have arrived, all together.

        The longest axis goes at `speed` half steps/s at most, a multiple of 100: constant speeds have no ramps, so
        the motors must be able to start at it. No axis is ever a whole step of its own away from the line.
        """
        fastest = _units(speed)
        drives = [drive for drive, count in steps.items() if count]
        distances = [steps[drive] for drive in drives]
        for count in distances:
            _count(count)
        order = order_of(distances)
        for leg in legs(distances, fastest):
            started = [place for place in order if leg.steps[place]]
            for place in started:
                self.move_constant(drives[place], leg.steps[place], leg.speeds[place] * UNIT)
            self._wait(leg.seconds)
            self.wait_for(*(drives[place] for place in started))

    def _all(self, steps: Mapping[int, int], start: Callable[[int], None]) -> dict[int, Report]:
        drives = [drive for drive, count in steps.items() if count]
        for drive in drives:
            start(drive)
        return self.wait_for(*drives)

    def _send(self, drive: int, code: int, steps: int | None = None, speed: int | None = None) -> None:
        if not 0 <= drive <= 0xFF:
            raise ValueError(f"a drive has a number of 0 to 255, not {drive}")
        data = bytearray([drive, code])
        if steps is not None:
            data[1] |= BACKWARD if steps < 0 else 0
            data += _count(steps)
        if speed is not None:
            data.append(speed)
        self._port.write(bytes(data))


def _count(steps: int) -> bytes:
    """The two bytes of a number of steps. ValueError for one that they cannot hold, and for none."""
    if not 1 <= abs(steps) <= LARGEST_STEPS:
        raise ValueError(f"a movement has 1 to {LARGEST_STEPS} steps, forward (+) or backward (-), not {steps}")
    return abs(steps).to_bytes(2, "big")


def _units(speed: int) -> int:
    """The byte of a speed. ValueError for one that it cannot hold."""
    units, rest = divmod(speed, UNIT)
    if rest or not 1 <= units <= LARGEST_SPEED:
        raise ValueError(f"a speed is a multiple of {UNIT} half steps/s up to {LARGEST_SPEED * UNIT}, not {speed}")
    return units


def _check(drive: int, report: Report) -> None:
    """Raise DriveFailed for an emergency or a refused command."""
    if report.end_of_rail:
        raise DriveFailed(drive, f"met the end of its rail after {report.steps} steps", report)
    if report.excessive_force:
        raise DriveFailed(drive, f"met excessive force after {report.steps} steps", report)
    if report.refused:
        raise DriveFailed(drive, "refused a command", report)
