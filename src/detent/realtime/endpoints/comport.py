"""The serial port that a client of RFC 2217 sees: what it sets, what it is told, what its UART hears. No I/O.

The client's UART sits at the other end of the line's wire. While its format is the line's, it hears and says bytes;
else both sides make of the other's characters what their UARTs make of the bits (`detent.uart.Receiver`). Until it is
set, its format is the line's. The cable has three wires; RTS is looped back to CTS, DTR to DSR and to carrier detect.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import Final

from detent.lines.line import Heard
from detent.realtime.endpoints import telnet
from detent.realtime.endpoints.endpoint import MOST_WAITING
from detent.ticks import Ns
from detent.uart import SOUND, Char, Format, Receiver, break_as, heard_as

ANSWER: Final = 100  # what the server says has the client's number and this


class Asked(IntEnum):
    """The commands of RFC 2217 by their numbers; the notifications are the server's alone."""

    SIGNATURE = 0
    SET_BAUDRATE = 1
    SET_DATASIZE = 2
    SET_PARITY = 3
    SET_STOPSIZE = 4
    SET_CONTROL = 5
    NOTIFY_LINESTATE = 6
    NOTIFY_MODEMSTATE = 7
    FLOWCONTROL_SUSPEND = 8
    FLOWCONTROL_RESUME = 9
    SET_LINESTATE_MASK = 10
    SET_MODEMSTATE_MASK = 11
    PURGE_DATA = 12


PARITIES: Final = ("none", "odd", "even", "mark", "space")  # SET-PARITY counts them from 1
STOP_BITS: Final = {1: 1, 2: 2, 3: 2}  # SET-STOPSIZE; 3 is one and a half, which is sent as two
_RECEIVE_BUFFER: Final = (1, 3)  # PURGE-DATA that means what we have for the client
_FLOW: Final = {0: (1, 2, 3, 17, 19), 13: (14, 15, 16, 18)}  # SET-CONTROL: the question, the choices; 1 and 14: none
_BREAK, _DTR, _RTS = 4, 7, 10  # SET-CONTROL: the question; the next number sets, the one behind it resets
_CARRIER, _DSR, _CTS = 0x80, 0x20, 0x10  # modem state; the same four bits lower say that it changed
_BROKEN, _FRAMING, _PARITY = 0x10, 0x08, 0x04  # line state
_CR_NUL = b"\r\0"


class ComPort:
    """One client's port on the line `name`, whose characters have the format `line`; one that `echoes` can say so."""

    def __init__(self, line: Format, name: str, *, echoes: bool = False) -> None:
        self.format = self._line = line
        self.dropped = 0  # bytes that were lost because the client told us to hold them and never asked for them
        self._name = name
        self._decoder = telnet.Decoder()
        agreed = (telnet.BINARY, telnet.SUPPRESS_GO_AHEAD, telnet.COM_PORT, *([telnet.ECHO] if echoes else ()))
        self._options = telnet.Options(frozenset(agreed))
        self._behind_cr = False  # the last character of a client that is no more than a telnet
        self._stop_size = line.stop_bits
        self._flow = {question: choices[0] for question, choices in _FLOW.items()}
        self._lines = {_BREAK: False, _DTR: True, _RTS: True}
        self._line_mask, self._modem_mask = 0, 0xFF
        self._suspended = False
        self._held = bytearray()
        self._last: Ns = -1  # when the last character that was heard ended
        self._tuned()

    def offer_echo(self) -> bytes:
        """What tells a plain telnet to send each character as it is typed, and to leave showing it to the line."""
        return self._options.offer(telnet.WILL, telnet.ECHO) + self._options.offer(
            telnet.WILL, telnet.SUPPRESS_GO_AHEAD
        )

    # -- from the client ---------------------------------------------------------------------------------

    def receive(self, data: bytes) -> tuple[list[Char], bytes]:
        """The client sends `data`: the characters as the line has them, and the bytes to answer with."""
        chars: list[Char] = []
        answer = b""
        for item in self._decoder.feed(data):
            match item:
                case telnet.Data(text):
                    chars += self._said(text)
                case telnet.Command(telnet.BREAK):
                    chars.append(break_as(self._line))
                case telnet.Negotiation():
                    answer += self._agree(item)
                case telnet.Parameters(telnet.COM_PORT, value) if value:
                    if value[0] == Asked.SET_CONTROL and value[1:] == bytes((_BREAK + 1,)) and not self._lines[_BREAK]:
                        chars.append(break_as(self._line))
                    answer += self._do(value[0], value[1:])
        return chars, answer

    def _said(self, text: bytes) -> Sequence[Char]:
        if not self._options.theirs & {telnet.BINARY, telnet.COM_PORT}:
            text = self._without_nul(text)
        if self._lines[_BREAK]:
            return ()  # the line is held at 0, whatever is sent
        if not self._fits:
            return heard_as(text, self.format, self._line)
        widest = (1 << self.format.data_bits) - 1
        return [SOUND[value & widest] for value in text]

    def _without_nul(self, text: bytes) -> bytes:
        """What a terminal means: it sends CR as CR NUL (RFC 854)."""
        if self._behind_cr and text[:1] == b"\0":
            text = text[1:]
        self._behind_cr = text.endswith(b"\r")
        return text.replace(_CR_NUL, b"\r")

    def _agree(self, asked: telnet.Negotiation) -> bytes:
        options = self._options
        answer = options.answer(asked)
        if asked == (telnet.WILL, telnet.COM_PORT) and answer:  # some clients wait for the server to ask for the rest
            answer += options.offer(telnet.WILL, telnet.BINARY) + options.offer(telnet.DO, telnet.BINARY)
            answer += self._modem_state(0)
        return answer

    def _do(self, command: int, value: bytes) -> bytes:
        """A command of RFC 2217: what is answered. One that is not understood is answered with what is so."""
        match command:
            case Asked.SIGNATURE:
                return b"" if value else _told(command, f"Detent, line {self._name}".encode())
            case Asked.SET_BAUDRATE:
                if len(value) == 4 and any(value):
                    self._tune(self.format._replace(baud=int.from_bytes(value)))
                return _told(command, self.format.baud.to_bytes(4))
            case Asked.SET_DATASIZE:
                if value in (b"\5", b"\6", b"\7", b"\x08"):
                    self._tune(self.format._replace(data_bits=value[0]))
                return _told(command, bytes((self.format.data_bits,)))
            case Asked.SET_PARITY:
                if len(value) == 1 and 1 <= value[0] <= len(PARITIES):
                    self._tune(self.format._replace(parity=PARITIES[value[0] - 1]))
                return _told(command, bytes((PARITIES.index(self.format.parity) + 1,)))
            case Asked.SET_STOPSIZE:
                if len(value) == 1 and value[0] in STOP_BITS:
                    self._stop_size = value[0]
                    self._tune(self.format._replace(stop_bits=STOP_BITS[self._stop_size]))
                return _told(command, bytes((self._stop_size,)))
            case Asked.SET_CONTROL if len(value) == 1:
                return self._control(value[0])
            case Asked.NOTIFY_MODEMSTATE:  # a question, by custom
                return self._modem_state(0)
            case Asked.FLOWCONTROL_SUSPEND:
                self._suspended = True
            case Asked.FLOWCONTROL_RESUME:
                self._suspended = False
                held, self._held = bytes(self._held), bytearray()
                return telnet.escaped(held)
            case Asked.SET_LINESTATE_MASK if len(value) == 1:
                self._line_mask = value[0]
                return _told(command, value)
            case Asked.SET_MODEMSTATE_MASK if len(value) == 1:
                self._modem_mask = value[0]
                return _told(command, value) + self._modem_state(0)
            case Asked.PURGE_DATA if len(value) == 1:
                if value[0] in _RECEIVE_BUFFER:
                    self._held.clear()
                return _told(command, value)
        return b""

    def _control(self, value: int) -> bytes:
        """SET-CONTROL: set something, or ask for it."""
        for question, choices in _FLOW.items():
            if value in choices:
                self._flow[question] = value
            if value == question or value in choices:
                return _told(Asked.SET_CONTROL, bytes((self._flow[question],)))
        for question, on in self._lines.items():
            if question <= value <= question + 2:
                now = on if value == question else value == question + 1
                before = self._modem()
                self._lines[question] = now
                answer = _told(Asked.SET_CONTROL, bytes((question + 1 if now else question + 2,)))
                changed = (before ^ self._modem()) & self._modem_mask
                return answer + self._modem_state(changed) if changed else answer
        return b""

    # -- to the client -----------------------------------------------------------------------------------

    def hear(self, heard: Sequence[Heard]) -> bytes:
        """Characters have reached the host of the line: the bytes that the client is told."""
        if self._fits:
            return b"".join(self._told_char(one.char) for one in heard)
        told = b""
        for at, char in heard:
            if at - self._line.duration() > self._last + 1:  # a pause, if not a rounding
                told += self.idle()
            self._last = at
            told += b"".join(self._told_char(made) for made in self._receiver.hear((char,)))
        return told

    def idle(self) -> bytes:
        """Nothing more comes for a while: the bytes that a client of another format is told of what was begun."""
        return b"".join(self._told_char(made) for made in self._receiver.idle())

    @property
    def waits(self) -> bool:
        """Whether `idle` should be called when nothing has come for a while."""
        return not self._fits

    def _told_char(self, char: Char) -> bytes:
        state = self._line_mask & (
            (0 if char.parity_ok else _PARITY)
            | (0 if char.framing_ok else _FRAMING if char.value else _FRAMING | _BROKEN)
        )
        notice = _told(Asked.NOTIFY_LINESTATE, bytes((state,))) if state else b""
        data = bytes((char.value & 0xFF,))
        if self._suspended:
            self._held += data
            excess = max(len(self._held) - MOST_WAITING, 0)
            del self._held[:excess]
            self.dropped += excess
            return notice
        return notice + telnet.escaped(data)

    def _modem(self) -> int:
        return (self._lines[_DTR] and _DSR | _CARRIER) | (self._lines[_RTS] and _CTS)

    def _modem_state(self, changed: int) -> bytes:
        """NOTIFY-MODEMSTATE with the lines that `changed`; without a change it is what is so now."""
        if not self._modem_mask:
            return b""
        state = (self._modem() | changed >> 4) & self._modem_mask
        return _told(Asked.NOTIFY_MODEMSTATE, bytes((state,)))

    # -- the format --------------------------------------------------------------------------------------

    def _tune(self, form: Format) -> None:
        if form != self.format:
            self.format = form
            self._tuned()

    def _tuned(self) -> None:
        """The client's UART has another format, and forgets what it was about to receive."""
        # how many stop bits there are is nothing that a receiver could tell
        self._fits = self.format._replace(stop_bits=self._line.stop_bits) == self._line
        self._receiver = Receiver(self._line, self.format)


def _told(command: int, value: bytes) -> bytes:
    """What the server says, as it is sent."""
    return telnet.parameters(telnet.COM_PORT, bytes((command + ANSWER,)) + value)
