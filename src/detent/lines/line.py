"""A line from a host to its units: every unit hears the host, the host hears every unit.

With one unit that is a point-to-point connection, with several a multipoint one. Characters are delivered at
the end of their last stop bit, or earlier where a receiver does not wait for it. The units' outputs share a wire
on which a 0 wins: characters of two units that coincide in time merge bit by bit, ones that overlap are damaged.
"""

from typing import NamedTuple

from detent.pins import Level
from detent.ticks import NEVER, Ns, instants
from detent.uart import Char, Chars, Format, Sent, Transmitter, characters

HOST_PORT = "HOST"
EVERYBODY = -1


class Heard(NamedTuple):
    """A character that has reached the host."""

    at: Ns
    char: Char


class Arrival(NamedTuple):
    """A character that has reached the unit at `place` on the line, or everybody."""

    place: int
    sent: Sent


class Line:
    """One host, some units, one character format. With `timed` false, characters take no time.

    The units receive a character `early` ns before its end; with `start_bits`, `started` tells when one begins.
    """

    __slots__ = (
        "_early",
        "_from_units",
        "_host",
        "_immediate",
        "_on_wire",
        "_start_bits",
        "_told",
        "deadline",
        "format",
        "heard",
    )

    INSTANTS = instants(deadline=0)
    PAST = ("heard",)
    hosted: bool = False  # whether its host is a unit of the cell
    strobe: str = ""  # the input of every unit that the line drives, if it has such a wire
    parting: Chars = b""  # what its units hear when the host's program leaves, where that means something to them

    def __init__(self, form: Format, *, timed: bool = True, early: Ns = 0, start_bits: bool = False) -> None:
        self.format = form
        self._early, self._start_bits = (early, start_bits) if timed else (0, False)
        self._immediate = not timed and type(self) is Line
        self._told = 0  # characters on the wire whose start bits were told
        self.deadline: Ns = NEVER
        self.heard: list[Heard] = []  # what reached the host and was not taken yet
        self._on_wire: list[Sent] = []  # from the host; also the transmitter's outbox
        self._host = Transmitter(HOST_PORT, form, self._on_wire, timed=timed)
        self._from_units: list[Sent] = []  # what they are sending, as it will arrive

    def immediate(self, data: Chars) -> list[Char]:
        """`data` as every unit hears it at once, on a plain line without timing; else nothing: `send` it."""
        if not self._immediate:
            return []
        limit = 1 << self.format.data_bits
        return [char if char.value < limit else self._narrowed(char) for char in characters(data)]

    def send(self, data: Chars, now: Ns) -> None:
        """The host sends `data`, behind what it is still sending. A byte too wide for the line arrives damaged."""
        self._host.send(data, now)
        self._plan()

    def discard(self) -> None:
        """The host takes back what it has not begun to send."""
        self._host.discard()
        self._plan()

    def change(self, form: Format) -> None:
        """The host speaks in another format from now on; what it has not begun to send is lost."""
        self._host.discard()
        self._host.change(form)
        self.format = form
        self._plan()

    @property
    def host_busy_until(self) -> Ns:
        """When the last stop bit of what the host has sent so far ends."""
        return self._host.busy_until

    def from_unit(self, place: int, sent: Sent) -> None:
        """The unit at `place` on the line begins a character."""
        at, _, char, done = sent
        if at == done:  # characters take no time here, so that none can meet another
            self.heard.append(Heard(done, char))
            return
        for index, other in enumerate(self._from_units):
            if (other.at, other.done) == (at, done):
                merged = Char(other.char.value & char.value, other.char.parity_ok, other.char.framing_ok)
                self._from_units[index] = other._replace(char=merged)
                return
            if other.done > at:
                self._from_units[index] = other._replace(char=other.char._replace(framing_ok=False))
                sent = sent._replace(char=sent.char._replace(framing_ok=False))
        self._from_units.append(sent)
        if done < self.deadline:
            self.deadline = done

    def advance(self, now: Ns) -> list[Arrival]:
        """Deliver what is due: to the host into `heard`; returned is what reaches the units at `now`."""
        if self._host.deadline <= now:
            self._host.advance(now)
        if self._from_units:
            sending = []
            for sent in self._from_units:
                if sent.done <= now:
                    self.heard.append(Heard(sent.done, sent.char))
                else:
                    sending.append(sent)
            self._from_units = sending
        if not self._on_wire:
            self._plan()
            return []
        arrived = [sent for sent in self._on_wire if sent.done - self._early <= now]
        if arrived:
            del self._on_wire[: len(arrived)]
            self._told = max(self._told - len(arrived), 0)
        self._plan()
        return [Arrival(EVERYBODY, self._arriving(sent)) for sent in arrived]

    def strobes(self, now: Ns) -> list[Level]:
        """The levels that the strobe takes up to and including `now`, in order; to be asked before `advance`."""
        return []

    def _arriving(self, sent: Sent) -> Sent:
        char = self._narrowed(sent.char)
        return sent if char is sent.char else sent._replace(char=char)

    def _narrowed(self, char: Char) -> Char:
        """The character as it arrives: one too wide for the line has its parity spoilt."""
        width = 1 << self.format.data_bits
        return char if char.value < width else char._replace(value=char.value % width, parity_ok=False)

    def started(self) -> bool:
        """Whether the host has begun a character since the last call. Never, unless units want to know."""
        if not self._start_bits or self._told == len(self._on_wire):
            return False
        self._told = len(self._on_wire)
        self._plan()
        return True

    def take(self) -> list[Heard]:
        """What has reached the host since the last call."""
        heard = self.heard
        self.heard = []
        return heard

    def _plan(self) -> None:
        deadline = self._host.deadline
        if self._on_wire and self._on_wire[0].done - self._early < deadline:
            deadline = self._on_wire[0].done - self._early
        if self._start_bits and self._told < len(self._on_wire):
            deadline = min(deadline, self._on_wire[self._told].at)
        for sent in self._from_units:
            if sent.done < deadline:
                deadline = sent.done
        self.deadline = deadline
