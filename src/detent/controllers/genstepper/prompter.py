"""When an answer goes out, and what cancels it (manual, pages 22, 29 and 35).

An answer begins as soon as its command is recognised, a quarter into its stop bit, or with V bit 1 eight bit times
later, its characters then with two more stop bits. Any new character, a digit or a sign too, discards what has not
begun. Without line timing an answer waits for one character time, so that it can be discarded as well.
"""

from detent.controllers.genstepper.link import DELAYED
from detent.ticks import NEVER, SECOND, Ns, round_ratio
from detent.uart import Format, Outbox, Transmitter

DELAY_BITS = 8
MORE_STOP_BITS = 2


class Prompter:
    """The sending half of the serial port. `deadline` says when to call `advance`."""

    __slots__ = ("_delay", "_due", "_form", "_pending", "_slow", "_slow_next", "_timed", "_transmitter")

    def __init__(self, port: str, form: Format, out: Outbox, *, timed: bool) -> None:
        self._form, self._timed = form, timed
        self._transmitter = Transmitter(port, form, out, timed=timed)
        self._pending = b""
        self._due: Ns = NEVER  # when the pending answer goes out
        self._slow = self._slow_next = False
        self._delay: Ns = 0

    @property
    def deadline(self) -> Ns:
        """When the next start bit begins."""
        return min(self._due, self._transmitter.deadline)

    def verbose(self, bits: int) -> None:
        """V: bit 1 chooses later and slower answers, from that to the next character on."""
        self._slow_next = bool(bits & DELAYED)

    def answer(self, text: str, now: Ns) -> None:
        """Answer the command that was recognised at `now`."""
        self._pending += text.encode("ascii")
        if self._due >= NEVER:
            self._due = now + (self._delay if self._timed else self._form.duration())
        self.advance(now)

    def discard(self) -> None:
        """A new character comes: drop what has not begun."""
        self._pending, self._due = b"", NEVER
        self._transmitter.discard()
        if self._slow != self._slow_next:
            self._slow = self._slow_next
            self._delay = round_ratio(DELAY_BITS * SECOND, self._form.baud) if self._slow else 0
            more = MORE_STOP_BITS if self._slow else 0
            self._transmitter.change(self._form._replace(stop_bits=self._form.stop_bits + more))

    def advance(self, now: Ns) -> None:
        """Begin what is due."""
        if self._due <= now:
            data, at = self._pending, self._due
            self._pending, self._due = b"", NEVER
            self._transmitter.send(data, at)
        self._transmitter.advance(now)
