"""Characters on a serial line: format, times, the transmit queue, what a receiver makes of a mismatch.

A character takes a whole number of bit times; bit times are fractions of a nanosecond, so the k-th
character of a burst ends at the burst's start plus k characters, rounded once.
"""

from collections import deque
from fractions import Fraction
from typing import NamedTuple, Protocol

from detent.ticks import NEVER, SECOND, Ns, round_ratio


class Char(NamedTuple):
    """A character as a receiver sees it."""

    value: int
    parity_ok: bool = True
    framing_ok: bool = True


SOUND = tuple(Char(value) for value in range(256))
"""Every undamaged character, made once."""


class Format(NamedTuple):
    """One start bit, then `data_bits`, `parity` ('none', 'odd', 'even'), `stop_bits`, at `baud` bits a second."""

    baud: int
    data_bits: int = 8
    parity: str = "none"
    stop_bits: int = 1

    @property
    def bits(self) -> int:
        """Bit times that one character takes on the line."""
        return 1 + self.data_bits + (self.parity != "none") + self.stop_bits

    def duration(self, characters: int = 1) -> Ns:
        """Nanoseconds that `characters` take back to back, rounded once."""
        return round_ratio(characters * self.bits * SECOND, self.baud)

    def __str__(self) -> str:
        """Like ``9600 7O2``."""
        return f"{self.baud} {self.data_bits}{self.parity[0].upper()}{self.stop_bits}"


class Sent(NamedTuple):
    """A character on a serial output: its start bit begins at `at`, its last stop bit ends at `done`."""

    at: Ns
    port: str
    char: Char
    done: Ns


class SerialPort(NamedTuple):
    """A serial port of a device, by the pins that carry its characters.

    `early` is how many bit times before the end of its stop bit the device recognises a character: then it is
    received. With `start_bits` it sees, as a level 0 on the receiving pin, every start bit too.
    """

    receives: str
    sends: str
    early: Fraction = Fraction(0)
    start_bits: bool = False


class Outbox(Protocol):
    """Where a transmitter tells what it sends: its owner's list of outputs."""

    def append(self, item: Sent, /) -> None:
        """Take the next character."""


class Transmitter:
    """The sending half of a UART with its queue. `deadline` is the next start bit, `busy_until` the last stop bit.

    With `timed` false, characters take no time (a link without line timing).
    """

    __slots__ = ("_burst", "_format", "_index", "_out", "_port", "_queue", "_timed", "busy_until", "deadline")

    def __init__(self, port: str, form: Format, out: Outbox, *, timed: bool = True) -> None:
        self._port, self._format, self._out, self._timed = port, form, out, timed
        self._queue: deque[int] = deque()
        self._burst: Ns = 0  # start of the run of characters sent without a pause
        self._index = 0  # of the next character in the burst
        self.busy_until: Ns = 0
        self.deadline: Ns = NEVER

    def send(self, data: bytes, now: Ns) -> None:
        """Queue characters behind those that wait already; the first starts at once on an idle line."""
        if not data:
            return
        if not self._timed:
            for value in data:
                self._out.append(Sent(now, self._port, SOUND[value], now))
            self.busy_until = now
            return
        if not self._queue:
            if self.busy_until <= now:
                self._burst, self._index = now, 0
            self.deadline = max(now, self.busy_until)
        self._queue.extend(data)
        self.busy_until = self._burst + self._format.duration(self._index + len(self._queue))
        self.advance(now)

    def discard(self) -> None:
        """Drop every character whose start bit has not begun."""
        self._queue.clear()
        self.deadline = NEVER
        self.busy_until = self._burst + self._format.duration(self._index)

    def change(self, form: Format) -> None:
        """Send in another format from now on. No character may be waiting: `discard` them first."""
        if self._queue:
            raise RuntimeError("characters are waiting to be sent: discard them before the format changes")
        self._burst, self._index, self._format = self.busy_until, 0, form

    def advance(self, now: Ns) -> None:
        """Begin the characters that are due up to and including `now`."""
        while self.deadline <= now:
            start = self.deadline
            self._index += 1
            done = self._burst + self._format.duration(self._index)
            self._out.append(Sent(start, self._port, SOUND[self._queue.popleft()], done))
            self.deadline = done if self._queue else NEVER
