"""Talk on a MICROBUS, from the side of its CCU: messages, the answer to status, and how both stay in step.

Nothing marks where a message begins (Cassinis, table 1). A stray byte, or a program that left in the middle of one,
leaves a drive waiting for the rest: it would take the next question for that, and perhaps move. A drive forgets half a
message when no byte has come for `SILENCE` seconds (docs/controllers/supersigma.md). So a driver

- keeps silent for so long before its first message, and behind every question that was not answered;
- asks before it lets a drive move: whoever answers is in step;
- says a stop at once, and once more when the drive has answered: then it is heard for certain;
- has a drive refuse something before it lets it move, where status would read the same if the drive had not heard that;
- takes whatever was broken off for a question that is not answered yet.

Filling the gap with bytes instead would not do: whatever they are, they could be the steps of a movement.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple

from detent.hosts.errors import ECHOES, BadAnswer, Busy, NoAnswer, Spoken
from detent.hosts.exchange import Ask, Clear, Driver, Pause, Steps, length
from detent.hosts.interpolation import LARGEST_SPEED, UNIT

MOVE, CONSTANT, LIMIT, ORIGINATE, STATUS, STOP, EMERGENCY = range(1, 8)
BACKWARD: Final = 0x80
LARGEST_STEPS: Final = 0xFFFF
ANSWER: Final = 3  # bytes
NO_FLAG: Final = 0xE0  # bits of the third that are always 0
PATIENCE: Final = 0.5  # seconds for the answer to status, beyond what its bytes take
SILENCE: Final = 0.11  # a drive counts 0.1 s, by a clock of its own
MORE: Final = 0.02  # seconds that another controller may take for the rest of what it says
TRIES: Final = 2
STOPS: Final = 4  # times that a stop is said before it is given up
NO_COMMAND: Final = 0x78
"""No op-code, and none that is one with one bit wrong."""
REFUSAL: Final = 0x10  # the flag of a command that was refused: an accepted movement clears it


class Report(NamedTuple):
    """An answer to status: the steps of the last movement or of the one under way, and the flags."""

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
        return bool(self.flags & REFUSAL)

    def follows(self, before: "Report") -> bool:
        """Whether a movement was accepted behind `before`. One that ended just as that one did cannot be told."""
        flags = (self.flags ^ before.flags) & ~REFUSAL
        return self.steps != before.steps or bool(flags) or (before.refused and not self.refused)


class BusDriver(Driver):
    """Who talks on a MICROBUS. Several may share a port."""

    _patience = PATIENCE
    _in_step = False  # nobody but us has spoken on the bus, as far as is known
    _at = 0.0  # when the last status was answered, in seconds by the clock of the port
    _refusing: frozenset[int] = frozenset()  # drives that were made to refuse, and were told no movement since

    def forget(self) -> None:
        """The connection was lost: another may have spoken, and half a message may be waiting."""
        self._in_step = False

    def _silent(self) -> Steps[None]:
        """Let the drives forget what they may have of a message."""
        yield Pause(SILENCE)
        self._in_step = True

    def _status(self, drive: int) -> Steps[Report]:
        """Status of a drive, asked again behind a silence if it is not answered. Raises NoAnswer, BadAnswer.

        A late answer to an earlier question is not taken for it.
        """
        data, more = message(drive, STATUS), b""
        if not self._in_step:
            yield from self._silent()
            more = b"?"  # who is there is not known yet
        for left in reversed(range(TRIES)):
            yield Clear()
            self._in_step = False
            answer = yield Ask(data, length(ANSWER), self._patience)
            echoed = answer.data[: len(data)] == data
            if echoed and answer.whole:  # steps and a flag that read so, or an echo before the answer
                echoed = (yield Ask(b"", length(len(data)), self._patience)).whole
            if echoed:
                raise BadAnswer(f"drive {drive}", ECHOES, Spoken(data, answer.data))
            if answer.whole and more:
                more = (yield Ask(b"", length(1), MORE)).data
            if answer.whole and not answer.data[2] & NO_FLAG and not more:
                self._at, self._in_step = answer.at, True
                return _report(answer.data)
            if left:
                yield from self._silent()
                more = b"?"
        spoken = Spoken(data, answer.data)
        if answer.whole:
            what = "says more than a drive does" if more else "its answer to status was damaged"
            raise BadAnswer(f"drive {drive}", what, spoken._replace(received=answer.data + more))
        what = "does not finish its answer" if answer.data else "does not answer status"
        raise NoAnswer(f"drive {drive}", f"{what} within {self._patience:g} s", spoken)

    def _ready(self, drive: int) -> Steps[Report]:
        """Status of a drive that is to move: it is at rest, and in step. Raises Busy."""
        report = yield from self._status(drive)
        if report.moving:
            raise Busy(f"drive {drive}", "moves", advice="wait() for its end, or stop() it")
        return report

    def _said(self, data: bytes) -> Steps[None]:
        """Say what is not answered. Broken off, it may be there in part."""
        self._in_step = False
        yield Ask(data)
        self._in_step = True

    def _moved(self, data: bytes, drives: Iterable[int]) -> Steps[None]:
        """Say `data`, movements of `drives`: the flag of a refusal tells from then on that one was not made."""
        self._refusing -= frozenset(drives)
        yield from self._said(data)

    def _blamed(self, drive: int, report: Report) -> Report:
        """`report` without the refusal that a call which was broken off has asked a drive for."""
        return report._replace(flags=report.flags & ~REFUSAL) if drive in self._refusing else report

    def _distinct(self, drive: int, report: Report, steps: int | None) -> Steps[Report]:
        """A report of a drive at rest that a movement by `steps` (None: origination) will not end with, too.

        If `report` is one, the drive is told what it refuses: that flag is cleared by a movement, if that is accepted.
        A command is not answered, and one that was damaged on the bus may look obeyed without that.
        """
        same = report.originated if steps is None else report.steps == abs(steps)
        for _ in range(TRIES):
            if report.refused or not same:
                return report
            self._refusing |= {drive}
            yield from self._said(message(drive, NO_COMMAND))
            report = yield from self._status(drive)
        if not report.refused:
            raise BadAnswer(f"drive {drive}", f"does not tell that it refuses {NO_COMMAND:02X}h, which is no op-code")
        return report

    def _stopped(self, drive: int, code: int) -> Steps[None]:
        """Tell a drive to stop, at once; and again, once it is known to be in step. Raises NoAnswer.

        A stop that is said twice stops once. One that was damaged may be a command that moves a drive at rest: it is
        asked whether that has happened.
        """
        data = message(drive, code)
        if not self._in_step:
            yield Ask(data)
            yield from self._silent()
        for left in reversed(range(STOPS)):
            self._in_step = False
            yield Ask(data)
            yield Clear()
            # at first not long: what did not hear it moves on
            answer = yield Ask(message(drive, STATUS), length(ANSWER), self._patience / 2**left)
            if answer.whole and not answer.data[2] & NO_FLAG:
                yield from self._said(data)
                if _report(answer.data).moving:
                    return
                self._in_step = False
                more = yield Ask(message(drive, STATUS), length(ANSWER), self._patience / 2 ** (left + 1))
                self._in_step = more.whole
                if more.whole and not _report(more.data).moving:
                    return
                answer = more
                if left and not more.whole:
                    yield from self._silent()
            elif left:
                yield from self._silent()
        if answer.data == message(drive, STATUS):
            raise BadAnswer(f"drive {drive}", f"{ECHOES}; it may still move", Spoken(answer.data, answer.data))
        what = f"does not answer: it was told to stop {STOPS} times and may still move"
        raise NoAnswer(f"drive {drive}", what, Spoken(data, answer.data))


def _report(data: bytes) -> Report:
    return Report(int.from_bytes(data[:2], "big"), data[2])


def message(drive: int, code: int, steps: int | None = None, speed: int | None = None) -> bytes:
    """One message (table 1): number, op-code with the direction, steps, speed. Raises ValueError."""
    data = bytearray([drive_number(drive), code])
    if steps is not None:
        if not 1 <= abs(steps) <= LARGEST_STEPS:
            raise ValueError(f"a movement has 1 to {LARGEST_STEPS} steps, forward (+) or backward (-), not {steps}")
        data[1] |= BACKWARD if steps < 0 else 0
        data += abs(steps).to_bytes(2, "big")
    if speed is not None:
        data.append(speed_units(speed))
    return bytes(data)


def drive_number(drive: int) -> int:
    """`drive`, if it can be the number of one. Raises ValueError."""
    if not 0 <= drive <= 0xFF:
        raise ValueError(f"a drive has a number of 0 to 255, not {drive}")
    return drive


def speed_units(speed: int) -> int:
    """The byte of a speed. Raises ValueError for one that it cannot hold."""
    units, rest = divmod(speed, UNIT)
    if rest or not 1 <= units <= LARGEST_SPEED:
        raise ValueError(f"a speed is a multiple of {UNIT} half steps/s up to {LARGEST_SPEED * UNIT}, not {speed}")
    return units
