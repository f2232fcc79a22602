"""The serial adapters SIN-8 and SIN-10: a host on one side, a party line on the other (manual, pages 18 to 20).

They are devices of a cell. Towards the host they speak on TXD and hear on RXD, towards the axes on TX and RX, and
they drive PARTY. What the manual leaves to the SIN-10's own guide is our assumption (E).
"""

from collections import deque
from collections.abc import Sequence
from enum import Enum
from typing import Any, Final

from detent.pins import HIGH, LOW, Level, Pin, PinDriver, PinKind
from detent.ticks import MS, NEVER, Ns, instants
from detent.uart import Char, Format, SerialPort, Transmitter

LF, CR, ESC, SPACE = 0x0A, 0x0D, 0x1B, 0x20
CTRL_C, CTRL_P = 0x03, 0x10
BUFFER: Final = 256  # characters, each way
NAMES: Final = bytes(value for value in range(0x21, 0x7F) if value not in b"[\\]^_`@")
PATIENCE: Final[Ns] = 2 * MS  # for an echo, beside four characters
EXECUTING: Final[Ns] = 20 * MS  # as long as most commands take (page 29 of the manual), and a stop waits for its echo
LONGEST: Final[Ns] = 2_000 * MS  # as long as any command takes of which the end is to come: C 1, a long answer to [
RESTART: Final[Ns] = 5 * MS  # from ^P to the scan
LOST: Final = b"\0\r"  # stands in the buffer for what the line had beyond that: NUL is no name
_ROOM: Final = 128  # characters that may wait for the host before another command begins

PINS = (
    Pin("RXD", None, PinKind.SERIAL, "from the host"),
    Pin("TXD", None, PinKind.SERIAL, "to the host"),
    Pin("RX", None, PinKind.SERIAL, "from the axes"),
    Pin("TX", None, PinKind.SERIAL, "to the axes"),
    Pin("SWITCH", None, PinKind.INPUT, "the switch: 1 = party line (P), 0 = single (S)"),
    Pin("PARTY", 8, PinKind.OUTPUT, "party select of the axes"),
)
UPSTREAM = SerialPort("RXD", "TXD")
DOWNSTREAM = SerialPort("RX", "TX")


class Adapter:
    """What both adapters are: a converter between two lines, and the driver of PARTY."""

    INSTANTS = instants()
    pins: Sequence[Pin] = PINS
    serial_port = UPSTREAM
    downstream = DOWNSTREAM

    def __init__(self, baud: int, line_baud: int, party: bool, line_timing: bool) -> None:
        self.line_format, self.downstream_format = Format(baud), Format(line_baud)
        self._timed = line_timing
        self._party: Level = HIGH if party else LOW
        self._powered = False
        self._out: list[Any] = []
        self._driver = PinDriver(self._out)
        self._make_transmitters()

    def _make_transmitters(self) -> None:
        self._up = Transmitter(UPSTREAM.sends, self.line_format, self._out, timed=self._timed)
        self._down = Transmitter(DOWNSTREAM.sends, self.downstream_format, self._out, timed=self._timed)

    def power(self, on: bool, now: Ns) -> None:
        """Switch the supply, which comes from the first axis."""
        self._powered = on
        self._make_transmitters()
        if on:
            self._driver.set("PARTY", self._party, now)
        else:
            self._driver.release()

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """The switch is moved; the axes look at PARTY when they are reset."""
        self.advance(now)
        self._party = level
        if self._powered:
            self._driver.set("PARTY", level, now)

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> None:
        """Characters from the host or from the axes: passed on."""
        self.advance(now)
        if self._powered:
            towards = self._down if port == UPSTREAM.receives else self._up
            for char in chars:
                towards.send(bytes((char.value,)), now)

    def stored(self, ok: bool, now: Ns) -> None:
        """It stores nothing."""

    def next_deadline(self) -> Ns | None:
        """When the next character goes out."""
        deadline = min(self._up.deadline, self._down.deadline)
        return None if deadline >= NEVER else deadline

    def advance(self, now: Ns) -> None:
        """Begin the characters that are due."""
        self._up.advance(now)
        self._down.advance(now)

    def drain(self) -> list[Any]:
        """What it sent, and PARTY."""
        out = self._out.copy()
        self._out.clear()
        return out

    def watch(self, pin: str) -> None:
        """It gives no pulses."""

    @property
    def answering(self) -> bool:
        """Whether an answer is still to come."""
        return False

    def frame(self, text: str) -> bytes:
        """What a host sends: behind a plain converter, the characters as they are."""
        return text.encode("latin-1", "replace")

    def answers(self, data: bytes) -> list[str]:
        """The lines that came from it."""
        return [line for line in data.decode("latin-1").replace("\r", "\n").split("\n") if line]


class Sin8(Adapter):
    """The SIN-8: RS-232 to RS-422, and the switch for party or single line (page 18).

    A converter passes a character on while it comes: the copy ends with the character itself.
    """

    def __init__(self, baud: int = 9600, party: bool = True, *, line_timing: bool = True) -> None:
        super().__init__(baud, baud, party, line_timing)

    def _make_transmitters(self) -> None:
        self._up = Transmitter(UPSTREAM.sends, self.line_format, self._out, timed=False)
        self._down = Transmitter(DOWNSTREAM.sends, self.downstream_format, self._out, timed=False)


class Task(Enum):
    """What an exchange with an axis is for."""

    NONE = "none"
    COMMAND = "command"
    POLL = "is it moving"
    SCAN = "is there an axis of this name"
    STOP = "one axis is to stop"
    RESTART = "after ^P"
    ABORT = "after ESC"


class Waiting(Enum):
    """What the exchange waits for."""

    NOTHING = "nothing"
    ECHO = "the echo of a character"
    END = "the line feed of the axis"


class Sin10(Adapter):
    """The SIN-10: does the handshake, polls, scans (page 19).

    Line of commands separated by ``;``, ended by CR or LF; each is answered with one line. `&` first: it restarts
    the axes in party line mode and answers their names. ``9W*`` and ``9Wn`` wait until all axes or one stand
    still. ESC and ^C go through at once, and end everything; ESC is answered ``#``. A line that is ``n@`` or ``n|``
    stops one axis (pages 33, 57): it waits for nothing that the adapter itself waits for.

    With its switch off, as it comes (page 4: "all (8) switches in off position"), and before it has looked for axes,
    SPACE makes it a plain converter, and signs one axis on; a character before that is its name (page 23). So it
    stays until `&`, ^C or power-off: "selectable via host commands or a built in mode switch" (page 20).
    """

    INSTANTS = instants(_timer=0, _begin_at=0, _silent_since=EXECUTING)

    def __init__(
        self, baud: int = 9600, line_baud: int = 9600, party: bool = False, converter: bool = False, *,
        line_timing: bool = True,
    ) -> None:  # fmt: skip
        super().__init__(baud, line_baud, party, line_timing)
        self._converter = converter  # "the SIN-10 can be one"
        self._through = converter  # characters go through as they are
        self.names = b""  # of the axes that the scan has found
        self._forget()

    def _forget(self) -> None:
        self._buffer = bytearray()  # from the host, as far as it has not been begun
        self._lines = 0  # complete ones in it
        self._lost = False  # the line that comes is longer than what the buffer has left
        self._stops: deque[bytes] = deque()  # lines that stop an axis, to be sent as soon as may be
        self._held: tuple[Task, bytes] | None = None  # what a stop has come before: task, and the reply so far
        self._task, self._waiting = Task.NONE, Waiting.NOTHING
        self._to_send: deque[int] = deque()  # to the axis
        self._expected = 0  # the echo
        self._reply = bytearray()  # of the axis: echo and data
        self._silent = False  # an echo did not come
        self._axes: deque[int] = deque()  # still to be scanned, or to be waited for
        self._command = ""  # that a wait answers
        self._timer: Ns = NEVER
        self._silent_since: Ns = 0  # the line of the axes, behind the end of a command
        self._begin_at: Ns = NEVER  # when the host's line has room for another answer

    def power(self, on: bool, now: Ns) -> None:
        """Switch the supply."""
        super().power(on, now)
        self._restart()

    def _restart(self) -> None:
        """Power-on and ^C. With the switch off the axes are in single mode behind it, and none is known."""
        self._through = self._converter
        if self._party == LOW:
            self.names = b""
        self._forget()

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> None:
        """Characters from the host or from the axes."""
        if self._converter:
            super().receive(port, chars, now)
            return
        self.advance(now)
        for char in chars:
            if self._powered:
                if port == UPSTREAM.receives:
                    self._from_host(char.value, now)
                elif self._through:
                    self._up.send(bytes((char.value,)), now)
                else:
                    self._from_axis(char.value, now)
                self.advance(now)

    def next_deadline(self) -> Ns | None:
        """When a character goes out, or patience ends."""
        deadline = self._next()
        return None if deadline >= NEVER else deadline

    def advance(self, now: Ns) -> None:
        """Do what is due, in order of time."""
        while (at := self._next()) <= now:
            if self._timer <= at:
                self._timer = NEVER
                self._no_echo(at)
            elif self._begin_at <= at:
                self._begin_at = NEVER
                self._begin(at)
            else:
                self._up.advance(at)
                self._down.advance(at)

    def _next(self) -> Ns:
        return min(self._up.deadline, self._down.deadline, self._timer, self._begin_at)

    @property
    def answering(self) -> bool:
        """Whether commands are in hand or wait."""
        return self._task is not Task.NONE or self._lines > 0

    def frame(self, text: str) -> bytes:
        """A line of commands as a host sends it."""
        return super().frame(text if self._converter else text + "\r")

    # -- from the host -----------------------------------------------------------------------------------

    def _from_host(self, value: int, now: Ns) -> None:
        if value == SPACE and self._signs_on:
            self._through = True
            self._down.send(bytes(self._buffer), now)
            self._buffer.clear()
        if self._through and value not in (CTRL_C, ord("&")):
            self._down.send(bytes((value,)), now)
            return
        self._through = False
        if value in (ESC, CTRL_C):
            self._forget()
            self._up.discard()
            self._down.discard()
            self._down.send(bytes((value,)), now)
            if value == ESC:
                self._task = Task.ABORT
                self._wait_for_echo(now)
            else:
                self._restart()
        elif value in (CR, LF):
            self._line_ends(now)
        elif self._lost or len(self._buffer) >= BUFFER:
            self._lost = True
        else:
            self._buffer.append(value)

    @property
    def _signs_on(self) -> bool:
        """Whether SPACE is for an axis in single mode: nothing else has been said, but perhaps its name."""
        return self._party == LOW and not self.names and not self._busy and len(self._buffer) <= 1

    def _line_ends(self, now: Ns) -> None:
        """A line is whole. A stop goes first; a command of which a part was lost is not done, but answered ``#``."""
        start = self._buffer.rfind(CR) + 1
        line = bytes(self._buffer[start:])
        if self._lost:
            self._lost = False
            if not line and self._buffer[-2:] == LOST:
                return  # several lines in a row are one: the buffer has an end
            del self._buffer[max(start, self._buffer.rfind(b";") + 1) :]
            self._buffer += LOST
        elif not line:
            return
        elif len(line) == 2 and line[1] in b"@|" and self._known(chr(line[0])) and self._busy:
            del self._buffer[start:]
            if line not in self._stops:
                self._stops.append(line)
            self._cut_in(now)
            return
        else:
            self._buffer.append(CR)
        self._lines += 1
        self._look(now)

    @property
    def _busy(self) -> bool:
        return self._task is not Task.NONE or self._lines > 0

    def _cut_in(self, now: Ns) -> None:
        """A stop waits: nothing is under way, or a command waits in its axis; a poll is over soon.

        An answer that comes, perhaps of another axis, would collide with the echo: so the line is silent for a while.
        """
        if not self._stops or self._task not in (Task.NONE, Task.COMMAND):
            return
        if self._task is Task.COMMAND:
            if not self._waits_for_axis:
                return
            if now < self._silent_since + EXECUTING:
                self._timer = self._silent_since + EXECUTING
                return
            self._held = self._task, bytes(self._reply)
        self._exchange(Task.STOP, self._stops.popleft(), now)

    @property
    def _waits_for_axis(self) -> bool:
        """Whether a whole command was sent, and its end is the axis' matter."""
        return self._waiting is Waiting.END and not self._silent

    def _look(self, now: Ns) -> None:
        """Begin the next command as soon as the host's line has room for its answer."""
        self._cut_in(now)
        if self._task is Task.NONE and self._lines:
            self._begin_at = max(now, self._up.busy_until - self.line_format.duration(_ROOM) if self._timed else now)

    def _begin(self, now: Ns) -> None:
        if self._task is not Task.NONE:
            return  # a stop came before
        end = next(i for i, value in enumerate(self._buffer) if value in b";\r")
        command, separator = self._buffer[:end].decode("latin-1").strip(" "), self._buffer[end]
        del self._buffer[: end + 1]
        self._lines -= separator == CR
        if command == "&":
            self._down.send(bytes((CTRL_P,)), now)
            self.names, self._axes = b"", deque(NAMES)
            self._task, self._timer = Task.RESTART, max(now, self._down.busy_until) + RESTART
        elif command[:2] == "9W" and len(command) == 3 and self._known(command[2]):
            self._command = command
            self._axes = deque(self.names if command[2] == "*" else command[2].encode("latin-1"))
            self._poll(now)
        elif command and command[0] != "*" and self._known(command[0]):
            self._exchange(Task.COMMAND, command.encode("latin-1"), now)
        elif command:
            self._answer("#", now)
        else:
            self._look(now)

    def _known(self, name: str) -> bool:
        return bool(self.names) and (name == "*" or name.encode("latin-1") in self.names)

    def _answer(self, text: str, now: Ns) -> None:
        """One line to the host; then the next command."""
        self._task, self._waiting = Task.NONE, Waiting.NOTHING
        self._up.send(text.encode("latin-1") + b"\r\n", now)
        self._look(now)

    # -- exchanges with the axes -------------------------------------------------------------------------

    def _exchange(self, task: Task, text: bytes, now: Ns) -> None:
        self._task, self._silent = task, False
        self._reply.clear()
        self._to_send = deque(text)
        self._send_next(now)

    def _send_next(self, now: Ns) -> None:
        """The next character, whose echo is awaited; behind the last one the line feed."""
        if self._to_send:
            self._expected = self._to_send.popleft()
            self._waiting = Waiting.ECHO
            self._down.send(bytes((self._expected,)), now)
            self._wait_for_echo(now)
        else:
            self._waiting = Waiting.END
            self._down.send(bytes((LF,)), now)
            self._silent_since = max(now, self._down.busy_until)
            self._cut_in(now)  # a stop may have come while the command was spelled

    def _wait_for_echo(self, now: Ns) -> None:
        characters = self.downstream_format.duration(4) if self._timed else 0
        patience = PATIENCE
        if self._task is Task.STOP:  # its axis may just execute what came before
            patience = LONGEST if self._held_command else EXECUTING
        self._timer = now + characters + patience

    @property
    def _held_command(self) -> bool:
        """Whether a stop has come before the end of a command."""
        return self._held is not None and self._held[0] is Task.COMMAND

    @property
    def _owed_first(self) -> bool:
        """Whether what comes ends the command that a stop came before: so it does if one axis has both."""
        if self._held is None or not self._held_command:
            return False
        return self._waiting is Waiting.ECHO or self._held[1][:1] == self._reply[:1]

    def _from_axis(self, value: int, now: Ns) -> None:
        if self._waiting is Waiting.ECHO and value == self._expected:
            self._timer = NEVER
            self._reply.append(value)
            self._send_next(now)
        elif self._held is not None and self._owed_first:
            if value == LF:
                self._up.send(self._held[1] + b"\r\n", now)
                self._held = None
                if self._waiting is Waiting.ECHO:
                    self._wait_for_echo(now)
            else:
                self._held = self._held[0], self._held[1] + bytes((value,))
        elif self._waiting is Waiting.END:
            if value == LF:
                self._timer = NEVER
                self._done(now)
            else:
                self._reply.append(value)
                self._silent_since = now
                if self._task is Task.COMMAND:
                    self._cut_in(now)

    def _no_echo(self, now: Ns) -> None:
        """Patience is over: with an echo, the end of a broken line, an answer; or ^P or ESC has been obeyed."""
        if self._task is Task.COMMAND and self._waits_for_axis:
            self._cut_in(now)
        elif self._task is Task.RESTART:
            self._down.send(bytes((LF,)), now)
            self._scan(now)
        elif self._task is Task.ABORT:
            self._answer("#", now)
        elif self._waiting is Waiting.ECHO:
            self._silent = True
            self._to_send.clear()
            self._send_next(now)
            self._wait_for_echo(now)
        else:
            self._done(now)

    def _done(self, now: Ns) -> None:
        """The line feed has come, or never will."""
        self._waiting = Waiting.NOTHING
        match self._task:
            case Task.COMMAND:
                self._answer(self._said(), now)
            case Task.STOP:
                self._up.send(self._said().encode("latin-1") + b"\r\n", now)
                self._go_on(now)
            case Task.SCAN:
                if self._reply:
                    self.names += bytes((self._axes[0],))
                self._axes.popleft()
                self._scan(now)
            case Task.POLL:
                status = self._reply[2:].strip()
                if not self._silent and status.isdigit() and int(status) & 3 == 0:
                    self._axes.popleft()
                if self._stops:
                    self._held = Task.POLL, b""
                    self._exchange(Task.STOP, self._stops.popleft(), now)
                else:
                    self._poll(now)

    def _said(self) -> str:
        """What the axis said: the echo and its answer; ``?`` if it did not even echo what stands behind its name."""
        if self._silent and len(self._reply) < 2:
            return "?"
        return self._reply.decode("latin-1") + ("?" if self._silent else "")

    def _go_on(self, now: Ns) -> None:
        """Behind a stop: with what it came before."""
        held, self._held = self._held, None
        if held is None:
            self._task, self._waiting = Task.NONE, Waiting.NOTHING
            self._look(now)
        elif held[0] is Task.POLL:
            self._poll(now)
        else:  # another axis, or one that did not take the stop, still owes the end of its command
            self._task, self._waiting, self._silent = Task.COMMAND, Waiting.END, False
            self._reply = bytearray(held[1])
            self._cut_in(now)

    def _scan(self, now: Ns) -> None:
        if self._axes:
            self._exchange(Task.SCAN, bytes((self._axes[0],)), now)
        else:
            self._answer(self.names.decode("latin-1"), now)

    def _poll(self, now: Ns) -> None:
        if self._axes:
            self._exchange(Task.POLL, bytes((self._axes[0], ord("^"))), now)
        else:
            self._answer(self._command, now)
