"""Characters on a serial line: format, times, the transmit queue, what a receiver makes of a mismatch.

A character takes a whole number of bit times; bit times are fractions of a nanosecond, so the k-th
character of a burst ends at the burst's start plus k characters, rounded once.
"""

from collections import deque
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple, Protocol, TypeAlias

from detent.ticks import NEVER, SECOND, Ns, instants, round_ratio


class Char(NamedTuple):
    """A character as a receiver sees it."""

    value: int
    parity_ok: bool = True
    framing_ok: bool = True


SOUND = tuple(Char(value) for value in range(256))
"""Every undamaged character, made once."""

Chars: TypeAlias = bytes | Sequence[Char]
"""Characters in a row; bytes are undamaged ones."""


def characters(data: Chars) -> Sequence[Char]:
    """`data` as characters, one by one."""
    return [SOUND[value] for value in data] if isinstance(data, bytes) else data


class Format(NamedTuple):
    """One start bit, `data_bits`, `parity` (none, odd, even, mark, space), `stop_bits`, at `baud` bits a second."""

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


def break_as(read: Format) -> Char:
    """What a receiver makes of a line that is held at 0 for longer than a character."""
    return Char(0, _parity_bit(0, read.parity) == 0, framing_ok=False)


class Receiver:
    """What a receiver in the format `read` makes of characters that are sent in another, by the bits on the wire.

    A character begins where the line falls, if it is still low half a bit later. Each bit is looked at in its middle,
    by the receiver's clock; of the stop bits the first alone. From there on the next character may begin: behind a
    stop bit that is low, when the line has risen.
    """

    __slots__ = ("_at", "_half", "_levels", "_read", "_sent", "_width")

    def __init__(self, sent: Format, read: Format) -> None:
        self._sent, self._read = sent, read
        # times are counted in units of which a bit of either side has an even number
        self._width = 2 * read.baud  # of a bit sent
        self._half = sent.baud  # of half a bit read
        self._levels = [1]  # of the bits that may still matter, one that was high before them
        self._at = 0  # where the receiver looks, from their begin

    def hear(self, chars: Chars) -> list[Char]:
        """`chars` follow on the line without a pause: the characters that are decided by them."""
        for char in characters(chars):
            self._levels += _bits(char, self._sent)
        heard = self._decide(len(self._levels) * self._width)
        passed = self._at // self._width
        del self._levels[:passed]
        self._at -= passed * self._width
        return heard

    def idle(self) -> list[Char]:
        """The line is high for a while now: what was begun ends so."""
        heard = self._decide(None)
        self._levels, self._at = [1], 0
        return heard

    def _decide(self, until: int | None) -> list[Char]:
        """The characters that begin behind `_at` and end before `until`; None: the line is high for ever."""
        data_bits, parity = self._read.data_bits, self._read.parity
        stop = 1 + data_bits + (parity != "none")
        heard: list[Char] = []
        while (edge := self._falls()) is not None:
            if until is not None and edge + (2 * stop + 1) * self._half >= until:
                break
            start, *bits = (self._level(edge + (2 * bit + 1) * self._half) for bit in range(stop + 1))
            if start:  # too short for a start bit
                self._at = edge + self._half
                continue
            value = sum(level << bit for bit, level in enumerate(bits[:data_bits]))
            parity_ok = parity == "none" or bits[data_bits] == _parity_bit(value, parity)
            heard.append(Char(value, parity_ok, framing_ok=bool(bits[-1])))
            self._at = edge + (2 * stop + 1) * self._half
        return heard

    def _falls(self) -> int | None:
        """When the line next falls."""
        high = False
        for bit in range(self._at // self._width, len(self._levels)):
            if high and not self._levels[bit]:
                return bit * self._width
            high = bool(self._levels[bit])
        return None

    def _level(self, at: int) -> int:
        bit = at // self._width
        return self._levels[bit] if bit < len(self._levels) else 1


def heard_as(chars: Chars, sent: Format, read: Format) -> list[Char]:
    """What a receiver in the format `read` makes of `chars`, sent in the format `sent` in one go on an idle line."""
    receiver = Receiver(sent, read)
    return receiver.hear(chars) + receiver.idle()


def _bits(char: Char, form: Format) -> list[int]:
    """The levels of a character on the wire, one a bit time."""
    value = char.value & ((1 << form.data_bits) - 1)
    bits = [0, *(value >> bit & 1 for bit in range(form.data_bits))]
    if form.parity != "none":
        bits.append(_parity_bit(value, form.parity) ^ (not char.parity_ok))
    return [*bits, int(char.framing_ok), *[1] * (form.stop_bits - 1)]


def _parity_bit(value: int, parity: str) -> int:
    """The parity bit behind `value`; 0 where there is none."""
    match parity:
        case "odd":
            return 1 - value.bit_count() % 2
        case "even":
            return value.bit_count() % 2
        case _:
            return int(parity == "mark")


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

    __slots__ = ("_baud", "_bits", "_burst", "_index", "_out", "_port", "_queue", "_timed", "busy_until", "deadline")
    INSTANTS = instants(_burst="busy_until", busy_until=0, deadline=0)

    def __init__(self, port: str, form: Format, out: Outbox, *, timed: bool = True) -> None:
        self._port, self._out, self._timed = port, out, timed
        self._bits, self._baud = form.bits, form.baud
        self._queue: deque[Char] = deque()
        self._burst: Ns = 0  # start of the run of characters sent without a pause
        self._index = 0  # of the next character in the burst
        self.busy_until: Ns = 0
        self.deadline: Ns = NEVER

    def send(self, data: Chars, now: Ns) -> None:
        """Queue characters behind those that wait already; the first starts at once on an idle line."""
        if not data:
            return
        if not self._timed:
            for char in characters(data):
                self._out.append(Sent(now, self._port, char, now))
            self.busy_until = now
            return
        if not self._queue:
            if self.busy_until <= now:
                self._burst, self._index = now, 0
            self.deadline = max(now, self.busy_until)
        self._queue.extend(characters(data))
        self.busy_until = self._end(self._index + len(self._queue))
        self.advance(now)

    def discard(self) -> None:
        """Drop every character whose start bit has not begun."""
        self._queue.clear()
        self.deadline = NEVER
        self.busy_until = self._end(self._index)

    def change(self, form: Format) -> None:
        """Send in another format from now on. No character may be waiting: `discard` them first."""
        if self._queue:
            raise RuntimeError("characters are waiting to be sent: discard them before the format changes")
        self._burst, self._index = self.busy_until, 0
        self._bits, self._baud = form.bits, form.baud

    def advance(self, now: Ns) -> None:
        """Begin the characters that are due up to and including `now`."""
        while self.deadline <= now:
            start = self.deadline
            self._index += 1
            char = self._queue.popleft()
            done = self._end(self._index) if self._queue else self.busy_until
            self._out.append(Sent(start, self._port, char, done))
            self.deadline = done if self._queue else NEVER

    def _end(self, characters: int) -> Ns:
        """When so many characters of the burst have been sent: as `Format.duration` has it, rounded once."""
        return self._burst + round_ratio(characters * self._bits * SECOND, self._baud)
