"""Telnet as far as a serial port over TCP needs it: what is data, what is a command (RFC 854, 855, 1143). No I/O.

``IAC`` (255) announces a command; in data it is written twice. The bytes may be cut anywhere.
"""

from enum import Enum, auto
from typing import Final, NamedTuple, TypeAlias

IAC: Final = 255
DONT, DO, WONT, WILL, SB, BREAK, SE = 254, 253, 252, 251, 250, 243, 240
BINARY, ECHO, SUPPRESS_GO_AHEAD, COM_PORT = 0, 1, 3, 44  # options
MOST_PARAMETERS: Final = 256  # bytes of one subnegotiation that are kept; nobody has that much to say

_IAC = bytes((IAC,))
_VERBS = (DONT, DO, WONT, WILL)


class Data(NamedTuple):
    """Bytes of the other side, as it meant them."""

    data: bytes


class Command(NamedTuple):
    """A command without anything behind it, such as `BREAK`."""

    code: int


class Negotiation(NamedTuple):
    """`verb` (WILL, WONT, DO, DONT) about an option."""

    verb: int
    option: int


class Parameters(NamedTuple):
    """What is said about an option that both sides agreed on."""

    option: int
    value: bytes


Item: TypeAlias = Data | Command | Negotiation | Parameters


def escaped(data: bytes) -> bytes:
    """`data` as it is sent."""
    return data.replace(_IAC, _IAC + _IAC)


def negotiation(verb: int, option: int) -> bytes:
    """A negotiation as it is sent."""
    return bytes((IAC, verb, option))


def parameters(option: int, value: bytes) -> bytes:
    """A subnegotiation as it is sent."""
    return bytes((IAC, SB, option)) + escaped(value) + bytes((IAC, SE))


class _In(Enum):
    """Where the decoder is."""

    DATA = auto()
    COMMAND = auto()  # behind IAC
    WISH = auto()  # behind a verb
    PARAMETERS = auto()
    PARAMETERS_COMMAND = auto()  # behind IAC there


class Decoder:
    """Takes apart what the other side sends."""

    def __init__(self) -> None:
        self._in = _In.DATA
        self._verb = 0
        self._parameters = bytearray()

    def feed(self, data: bytes) -> list[Item]:
        """What is whole now, in order. Data is given at once, the rest when it is complete."""
        items: list[Item] = []
        text = bytearray()
        for value in data:
            item = self._take(value, text)
            if item is not None:
                if text:
                    items.append(Data(bytes(text)))
                    text.clear()
                items.append(item)
        if text:
            items.append(Data(bytes(text)))
        return items

    def _take(self, value: int, text: bytearray) -> Item | None:
        """One byte: into `text` if it is data; the command that it completes."""
        match self._in:
            case _In.DATA if value != IAC:
                text.append(value)
            case _In.DATA:
                self._in = _In.COMMAND
            case _In.COMMAND:
                return self._command(value, text)
            case _In.WISH:
                self._in = _In.DATA
                return Negotiation(self._verb, value)
            case _In.PARAMETERS if value != IAC:
                self._keep(value)
            case _In.PARAMETERS:
                self._in = _In.PARAMETERS_COMMAND
            case _In.PARAMETERS_COMMAND if value == IAC:
                self._in = _In.PARAMETERS
                self._keep(value)
            case _In.PARAMETERS_COMMAND if value == SE:
                self._in = _In.DATA
                if self._parameters:
                    return Parameters(self._parameters[0], bytes(self._parameters[1:]))
            case _In.PARAMETERS_COMMAND:  # an end is missing: what was begun is void, the command counts
                return self._command(value, text)
        return None

    def _command(self, value: int, text: bytearray) -> Item | None:
        self._in = _In.DATA
        if value == IAC:
            text.append(value)
        elif value in _VERBS:
            self._verb, self._in = value, _In.WISH
        elif value == SB:
            self._parameters.clear()
            self._in = _In.PARAMETERS
        elif value != SE:
            return Command(value)
        return None

    def _keep(self, value: int) -> None:
        if len(self._parameters) < MOST_PARAMETERS:
            self._parameters.append(value)


class Options:
    """Which options are agreed on, both ways; `accepted` are those we agree to. Answers only what changes something."""

    def __init__(self, accepted: frozenset[int]) -> None:
        self._accepted = accepted
        self.ours: set[int] = set()  # we do
        self.theirs: set[int] = set()  # the other side does
        self._offered: set[tuple[int, int]] = set()  # negotiations of ours without an answer

    def offer(self, verb: int, option: int) -> bytes:
        """Ask for an option by WILL or DO: the bytes to send, none if that was said already."""
        agreed = self.ours if verb == WILL else self.theirs
        if option in agreed or (verb, option) in self._offered:
            return b""
        self._offered.add((verb, option))
        return negotiation(verb, option)

    def answer(self, asked: Negotiation) -> bytes:
        """The answer to a negotiation of the other side; none if it was one itself, or changes nothing."""
        verb, option = asked
        of_theirs = verb in (WILL, WONT)
        agreed = self.theirs if of_theirs else self.ours
        yes, no = (DO, DONT) if of_theirs else (WILL, WONT)
        offered = (yes, option) in self._offered
        self._offered.discard((yes, option))
        if verb in (WILL, DO):
            if option in agreed:
                return b""
            if option not in self._accepted:
                return negotiation(no, option)
            agreed.add(option)
            return b"" if offered else negotiation(yes, option)
        if option not in agreed:
            return b""
        agreed.discard(option)
        return negotiation(no, option)
