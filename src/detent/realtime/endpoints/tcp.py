"""A TCP port: the bytes of the line as they are, for one client at a time."""

import contextlib
import select
import socket
from collections.abc import Sequence
from typing import NamedTuple

from detent.one_line import one_line
from detent.realtime.endpoints.endpoint import MOST_READ, OUT_OF_DESCRIPTORS, EndpointError, Outgoing
from detent.realtime.pace import WallNs
from detent.realtime.system import reuse_address
from detent.ticks import SECOND
from detent.uart import Chars

DEAF: WallNs = SECOND  # how long no client is let in when there is no descriptor left for one
LINGER: WallNs = SECOND  # a client that has said all it had to say may still wait for the answer
_BACKLOG = 8
_KEEPALIVE = {"TCP_KEEPIDLE": 10, "TCP_KEEPINTVL": 5, "TCP_KEEPCNT": 3}  # seconds, seconds, times


class TcpAddress(NamedTuple):
    """HOST:PORT. Port 0 is any that is free."""

    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> "TcpAddress":
        """Read HOST:PORT; an IPv6 host stands in brackets, no host is this computer. Raises ValueError."""
        host, colon, port = text.rpartition(":")
        bracketed = host.startswith("[") and host.endswith("]")
        figures = port.isascii() and port.isdigit() and len(port) <= 5
        if not colon or not figures or int(port) > 65535 or (":" in host and not bracketed) or len(host) > 255:
            told = one_line(repr(text), 100)
            raise ValueError(f"{told} is no HOST:PORT; write 127.0.0.1:4001, [::1]:4001, or port 0 for any free one")
        return cls(host[1:-1] if bracketed else host or "127.0.0.1", int(port))

    def __str__(self) -> str:
        """As it is written."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


class TcpPort:
    """A listening port for the line `name`. One client at a time; a second one is told so and sent away.

    A client that ends its sending side gets the answers of one more second; it makes room for the next client
    at once. A client whose computer vanished is dropped after half a minute of silence.
    """

    kind = "tcp"

    def __init__(self, address: TcpAddress, name: str, parting: Chars = b"") -> None:
        """`parting` is what the line hears when a client leaves. Raises EndpointError if the port cannot be had."""
        self._listener = _listen(address)
        self._name = name
        host, port = self._listener.getsockname()[:2]
        self.address = str(TcpAddress(host, port))
        self._client: socket.socket | None = None
        self._peer = ""
        self._until: WallNs | None = None  # the client has said everything, and goes then
        self._deaf_until: WallNs | None = None  # nobody is let in before
        self._parting = parting
        self._said = False  # the client has said something
        self._owed = False  # it has left since, or has said everything, and the line has not heard so
        self._outgoing = Outgoing(self._write)

    @property
    def dropped(self) -> int:
        """Bytes that were lost because a client did not read them."""
        return self._outgoing.dropped

    def reading(self, room: bool) -> Sequence[int]:
        """The client, while the line has room and it has not said everything; the port, for new clients.

        In this order, so that a client that leaves makes room for one that comes in the same wake-up.
        """
        listening = (self._listener.fileno(),) if self._deaf_until is None else ()
        if room and self._client is not None and self._until is None:
            return (self._client.fileno(), *listening)
        return listening

    def writing(self) -> Sequence[int]:
        """The client, while bytes wait."""
        return (self._client.fileno(),) if self._client is not None and self._outgoing else ()

    def deadline(self) -> WallNs | None:
        """When a client that has said everything goes, or others are let in again."""
        if self._deaf_until is None or (self._until is not None and self._until < self._deaf_until):
            return self._until
        return self._deaf_until

    def due(self, wall: WallNs) -> None:
        """One of both."""
        if self._deaf_until is not None and self._deaf_until <= wall:
            self._deaf_until = None
        if self._until is not None and self._until <= wall:
            self._leave()

    def receive(self, descriptor: int, wall: WallNs) -> Chars:
        """A new client, or what the client sent; and that a client has left, where that means something."""
        if descriptor == self._listener.fileno():
            self._accept(wall)
            return self._parted()
        if self._client is None or descriptor != self._client.fileno():
            return self._parted()  # it left in this very wake-up
        try:
            data = self._client.recv(MOST_READ)
        except BlockingIOError:
            return b""
        except OSError:
            self._leave()
            return self._parted()
        if not data:
            self._until = wall + LINGER
            self._ended()
            return self._parted()
        self._said = True
        return self._understood(data, wall)

    def _ended(self) -> None:
        """Nothing more will come from the client."""
        self._owed |= self._said
        self._said = False

    def _parted(self) -> Chars:
        """What the line hears of a client from which nothing more will come, once."""
        owed, self._owed = self._owed, False
        return self._parting if owed else b""

    def send(self, data: bytes, wall: WallNs) -> None:
        """Give `data` to the client, if there is one."""
        if self._client is None:
            return
        if self._until is not None:
            self._until = wall + LINGER
        try:
            self._outgoing.send(data)
        except OSError:
            self._leave()

    def flush(self) -> None:
        """The client has read something."""
        try:
            self._outgoing.flush()
        except OSError:
            self._leave()

    def close(self) -> None:
        """Close the port and the connection."""
        self._leave()
        self._listener.close()

    def _understood(self, data: bytes, wall: WallNs) -> Chars:
        """What the client's bytes are on the line."""
        return data

    def _begin(self) -> None:
        """A client was let in."""

    def _write(self, data: bytes) -> int:
        return self._client.send(data) if self._client is not None else len(data)

    def _accept(self, wall: WallNs) -> None:
        try:
            client, address = self._listener.accept()
        except OSError as error:
            if error.errno in OUT_OF_DESCRIPTORS:
                self._deaf_until = wall + DEAF  # it stays at the door: to look again at once would be for nothing
            return  # else it went away before it was let in
        peer = str(TcpAddress(address[0], address[1]))
        if self._client is not None and self._until is None and not _gone(self._client):
            _refuse(client, f"{self._name} is in use by {self._peer}; one client at a time, try again later")
            return
        self._leave()
        try:
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            for option, value in _KEEPALIVE.items():
                if hasattr(socket, option):  # not on every system
                    client.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)
        except OSError:
            client.close()  # it is gone already
            return
        self._client, self._peer = client, peer
        self._begin()

    def _leave(self) -> None:
        """The client goes, or is gone."""
        self._ended()
        self._outgoing.forget()
        self._until = None
        if self._client is not None:
            self._client.close()
            self._client = None


def _listen(address: TcpAddress) -> socket.socket:
    try:
        found = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise EndpointError(f"{address}: no such host here: {reason}; try 127.0.0.1") from error
    family, kind, protocol, _, where = found[0]
    listener = socket.socket(family, kind, protocol)
    try:
        reuse_address(listener)
        listener.setblocking(False)
        listener.bind(where)
        listener.listen(_BACKLOG)
    except OSError as error:
        listener.close()
        raise EndpointError(
            f"{address} cannot be listened on: {error.strerror}; choose another port, or 0 for any free one"
        ) from error
    return listener


def _gone(client: socket.socket) -> bool:
    """Whether a client that is not being read just now, because its line is behind, has said everything and left."""
    if hasattr(select, "POLLRDHUP"):  # sees it behind what has not been read
        poll = select.poll()
        poll.register(client, select.POLLRDHUP)
        return bool(poll.poll(0))
    try:
        return client.recv(1, socket.MSG_PEEK) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def _refuse(client: socket.socket, text: str) -> None:
    """Tell a client why it is sent away. What it has sent already is read, or its system would drop the text."""
    with client, contextlib.suppress(OSError):  # it may be gone: then there is nobody to tell
        client.setblocking(False)
        client.sendall(f"detent: {text}\r\n".encode())
        client.shutdown(socket.SHUT_WR)
        client.recv(MOST_READ)
