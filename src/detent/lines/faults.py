"""Faults of a serial line: damaged, lost and late characters, a cable that is out.

A fault is data. Whether it strikes the n-th character that it meets follows from its seed and from n alone, by a
hash and not by a generator with a state: the same line with the same characters is damaged in the same way every time.
`FaultyLine` stands in the place of a line while it has faults; a line without any knows nothing of this.
"""

from collections import deque
from typing import Final, NamedTuple, Protocol

from detent.lines.daisy_chain import DaisyChain
from detent.lines.line import Arrival, Heard, Line
from detent.pins import Level
from detent.ticks import NEVER, Ns
from detent.uart import Char, Chars, Format, Sent

UNITS, HOST, BOTH = "units", "host", "both"
TOWARDS: Final = (UNITS, HOST, BOTH)
"""Where a character is on its way to when a fault meets it."""

MOST_STRIKES: Final = 100  # remembered, the newest
_MASK: Final = (1 << 64) - 1
_WAYS: Final = (UNITS, HOST)


def drawn(seed: int, n: int) -> int:
    """64 bits that look drawn by lot and follow from `seed` and `n` (SplitMix64: Steele, Lea, Flood 2014)."""
    return _mixed(_mixed(seed & _MASK) + n * 0x9E3779B97F4A7C15 & _MASK)


def _mixed(z: int) -> int:
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & _MASK
    z = (z ^ z >> 27) * 0x94D049BB133111EB & _MASK
    return z ^ z >> 31


class Meeting(NamedTuple):
    """The `n`-th character, from 1, that a fault meets on its way `towards` the units or the host."""

    char: Char
    n: int
    towards: str
    form: Format

    def draw(self, seed: int, use: int = 0) -> int:
        """64 bits for this character, others for each `use`."""
        return drawn(seed, (self.n * len(_WAYS) + _WAYS.index(self.towards)) * 2 + use)


class LineFault(Protocol):
    """What can be wrong with a line."""

    @property
    def towards(self) -> str:
        """The characters it meets: those on their way to the units, to the host, or both."""

    def check(self, form: Format) -> None:
        """Raise ValueError, with a remedy, where a line with characters of `form` cannot have this fault."""

    def meet(self, meeting: Meeting) -> Char | None:
        """What becomes of a character; None: it is lost."""

    def delay(self) -> Ns:
        """How much later a character comes."""


class BitErrors(NamedTuple):
    """One bit is wrong in a share `rate` of the characters, or in the `nth` one alone.

    `bit` is 0 to 7, ``parity`` or ``framing`` (the stop bit reads 0); empty: a data or parity bit, drawn each time.
    """

    towards: str = BOTH
    rate: float = 0.0
    nth: int = 0
    bit: str = ""
    seed: int = 0

    def check(self, form: Format) -> None:
        """Raise ValueError for a choice that makes no sense, or a bit that characters of `form` do not have."""
        _check_towards(self.towards)
        _check_share(self.rate, self.nth)
        known = [*map(str, range(form.data_bits)), *(["parity"] if form.parity != "none" else []), "framing"]
        if self.bit and self.bit not in known:
            raise ValueError(f"characters of {form} have no bit {self.bit!r}; there are: {', '.join(known)}")

    def meet(self, meeting: Meeting) -> Char | None:
        """The character, with a wrong bit where it is struck."""
        char, form = meeting.char, meeting.form
        if not _struck(self.rate, self.nth, self.seed, meeting):
            return char
        if self.bit == "framing":
            return char._replace(framing_ok=False)
        parity = form.parity != "none"
        if self.bit:
            bit = form.data_bits if self.bit == "parity" else int(self.bit)
        else:
            bit = meeting.draw(self.seed, 1) % (form.data_bits + parity)
        value = char.value ^ (1 << bit) if bit < form.data_bits else char.value
        return char._replace(value=value, parity_ok=char.parity_ok != parity)  # a second wrong bit hides the first

    def delay(self) -> Ns:
        """None."""
        return 0


class LostCharacters(NamedTuple):
    """A share `rate` of the characters, or the `nth` one alone, never arrives."""

    towards: str = BOTH
    rate: float = 0.0
    nth: int = 0
    seed: int = 0

    def check(self, form: Format) -> None:
        """Raise ValueError for a choice that makes no sense."""
        _check_towards(self.towards)
        _check_share(self.rate, self.nth)

    def meet(self, meeting: Meeting) -> Char | None:
        """The character, or nothing."""
        return None if _struck(self.rate, self.nth, self.seed, meeting) else meeting.char

    def delay(self) -> Ns:
        """None."""
        return 0


class Delay(NamedTuple):
    """Every character comes `by` ns later than it should, and none overtakes another."""

    by: Ns
    towards: str = HOST

    def check(self, form: Format) -> None:
        """Raise ValueError for a choice that makes no sense."""
        _check_towards(self.towards)
        if self.by <= 0:
            raise ValueError("say how much later characters come: a time above 0")

    def meet(self, meeting: Meeting) -> Char | None:
        """The character as it is."""
        return meeting.char

    def delay(self) -> Ns:
        """Its time."""
        return self.by


class CableOut(NamedTuple):
    """Nothing arrives. What is on the wire when the cable is plugged in again arrives whole, or not at all."""

    towards: str = BOTH

    def check(self, form: Format) -> None:
        """Raise ValueError for a choice that makes no sense."""
        _check_towards(self.towards)

    def meet(self, meeting: Meeting) -> Char | None:
        """Nothing."""
        return None

    def delay(self) -> Ns:
        """None."""
        return 0


class Strike(NamedTuple):
    """A fault changed a character on its way; `after` is None where it was lost."""

    at: Ns
    fault: int
    towards: str
    before: Char
    after: Char | None


class Tally(NamedTuple):
    """How many characters a fault has met and how many it has struck, both ways together."""

    met: int
    struck: int


class _Standing:
    """A fault that is there, with what it has met so far, each way."""

    __slots__ = ("fault", "met", "struck")

    def __init__(self, fault: LineFault) -> None:
        self.fault = fault
        self.met = {UNITS: 0, HOST: 0}
        self.struck = 0


class FaultyLine(Line):
    """The line `line` with faults, each under a number; it is used like the line itself.

    `host_place` is the place of the unit that is the host of the line, if one is. On a daisy chain the faults are
    those of the host's cable: characters from unit to unit pass unharmed. Characters that arrive in the same instant
    meet the faults in the order in which they were sent, and the faults meet them in the order of their numbers.
    """

    __slots__ = ("_chained", "_late", "_late_heard", "_standing", "host_place", "hosted", "line", "strikes", "strobe")
    PAST = ("strikes",)

    def __init__(self, line: Line, host_place: int | None = None) -> None:
        self.line, self.host_place = line, host_place
        self.format, self.hosted, self.strobe = line.format, line.hosted, line.strobe
        self._chained = isinstance(line, DaisyChain)
        self._standing: dict[int, _Standing] = {}
        self._late: list[tuple[Ns, Arrival]] = []  # when, and what: in order
        self._late_heard: list[Heard] = []
        self.strikes: deque[Strike] = deque(maxlen=MOST_STRIKES)
        self.heard = line.take()
        self._plan()

    def begin(self, number: int, fault: LineFault) -> None:
        """The fault is there from now on. Raises ValueError, with a remedy."""
        fault.check(self.format)
        self._standing[number] = _Standing(fault)

    def mend(self, number: int) -> None:
        """The fault is gone. What it has delayed already stays late."""
        del self._standing[number]

    def tally(self, number: int) -> Tally:
        """What a fault has done so far."""
        standing = self._standing[number]
        return Tally(sum(standing.met.values()), standing.struck)

    @property
    def sound(self) -> bool:
        """Whether the line itself can take its place again: no fault, and nothing late."""
        return not (self._standing or self._late or self._late_heard)

    # -- as a line ---------------------------------------------------------------------------------------

    def immediate(self, data: Chars) -> list[Char]:
        """Nothing: what is sent meets the faults when it arrives."""
        return []

    def send(self, data: Chars, now: Ns) -> None:
        """The host sends `data`."""
        self.line.send(data, now)
        self._gather()

    def discard(self) -> None:
        """The host takes back what it has not begun to send."""
        self.line.discard()
        self._plan()

    def change(self, form: Format) -> None:
        """The host speaks in another format from now on."""
        self.line.change(form)
        self.format = form
        self._plan()

    @property
    def host_busy_until(self) -> Ns:
        """When the last stop bit of what the host has sent so far ends."""
        return self.line.host_busy_until

    def from_unit(self, place: int, sent: Sent) -> None:
        """The unit at `place` begins a character."""
        self.line.from_unit(place, sent)
        self._gather()

    def advance(self, now: Ns) -> list[Arrival]:
        """Deliver what is due, as far as it arrives."""
        arrived = [arrival for at, arrival in self._late if at <= now]
        self._late = self._late[len(arrived) :]
        before: Sent | None = None  # where one character reaches several units, it meets the faults once
        char: Char | None = None
        delay: Ns = 0
        for arrival in self.line.advance(now):
            towards = self._towards(arrival.place)
            if towards is None:
                arrived.append(arrival)
                continue
            sent = arrival.sent
            if sent is not before:
                before = sent
                char, delay = self._meet(sent.char, towards, now)
            if char is None:
                continue
            if char is not sent.char:
                arrival = arrival._replace(sent=sent._replace(char=char))
            due = max(now + delay, self._late[-1][0] if self._late else now)
            if due > now:
                late = arrival.sent._replace(at=arrival.sent.at + due - now, done=arrival.sent.done + due - now)
                self._late.append((due, arrival._replace(sent=late)))
            else:
                arrived.append(arrival)
        ready = [heard for heard in self._late_heard if heard.at <= now]
        self._late_heard = self._late_heard[len(ready) :]
        self.heard += ready
        self._gather()
        return arrived

    def strobes(self, now: Ns) -> list[Level]:
        """The levels of the strobe; none that a broken cable brings."""
        levels = self.line.strobes(now)
        self._plan()
        return [] if self._cut() else levels

    def started(self) -> bool:
        """Whether the host has begun a character that the units can see."""
        started = self.line.started()
        self._plan()
        return started and not self._cut()

    # -- inside ------------------------------------------------------------------------------------------

    def _cut(self) -> bool:
        return any(isinstance(s.fault, CableOut) and s.fault.towards != HOST for s in self._standing.values())

    def _towards(self, place: int) -> str | None:
        """Where a character that reaches `place` was on its way to; None: it comes from another unit of a chain."""
        if self._chained and place > 0:
            return None
        return HOST if place == self.host_place else UNITS

    def _meet(self, char: Char, towards: str, at: Ns) -> tuple[Char | None, Ns]:
        """What becomes of a character, and how much later it comes."""
        delay: Ns = 0
        for number, standing in self._standing.items():
            fault = standing.fault
            if fault.towards not in (towards, BOTH):
                continue
            standing.met[towards] += 1
            after = fault.meet(Meeting(char, standing.met[towards], towards, self.format))
            delay += fault.delay()
            if after != char:
                standing.struck += 1
                self.strikes.append(Strike(at, number, towards, char, after))
            if after is None:
                return None, 0
            char = after
        return char, delay

    def _gather(self) -> None:
        """What has reached the host's end of the line meets the faults."""
        for at, sent in self.line.take():
            char, delay = self._meet(sent, HOST, at)
            if char is None:
                continue
            due = max(at + delay, self._late_heard[-1].at if self._late_heard else at)
            (self.heard if due == at else self._late_heard).append(Heard(due, char))
        self._plan()

    def _plan(self) -> None:
        self.deadline = min(
            self.line.deadline,
            self._late[0][0] if self._late else NEVER,
            self._late_heard[0].at if self._late_heard else NEVER,
        )


def _check_towards(towards: str) -> None:
    if towards not in TOWARDS:
        raise ValueError(f"{towards!r} is no way on a line; a fault is towards units, host or both")


def _check_share(rate: float, nth: int) -> None:
    if not 0 <= rate <= 1:
        raise ValueError(f"rate {rate} is no share of the characters; it takes a number from 0 to 1")
    if nth < 0:
        raise ValueError(f"character {nth} does not exist; nth counts from 1")
    if (rate > 0) == (nth > 0):
        raise ValueError("say which characters are struck: either a rate above 0, or the nth one")


def _struck(rate: float, nth: int, seed: int, meeting: Meeting) -> bool:
    return meeting.n == nth if nth else meeting.draw(seed) < rate * (1 << 64)
