"""Where the workbench listens, before anything heavy is loaded."""

import contextlib
import errno
import ipaddress
import socket
from typing import NamedTuple
from urllib.parse import quote

from detent.realtime.system import reuse_address

USUAL = 8274  # the port without a word: a browser keeps what it remembers by address and port
LAST_PORT = 65_535
TRIED = 10  # ports from there on, before any that is free


class Place(NamedTuple):
    """Where the server listens, and the token that is asked for there."""

    host: str = "127.0.0.1"
    port: int = 0  # 0: any that is free
    token: str | None = None


class Listening(NamedTuple):
    """A socket that is bound."""

    socket: socket.socket
    host: str
    port: int

    def url(self, token: str | None, page: str = "") -> str:
        """The address to open in a browser on this machine; of a page, by its path."""
        named = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)
        with contextlib.suppress(ValueError):
            if ipaddress.ip_address(named).version == 6:
                named = f"[{named}]"
        return f"http://{named}:{self.port}/{page}" + (f"?token={quote(token, safe='')}" if token else "")


def listen_as_usual(host: str, token: str | None) -> Listening:
    """Listen on the usual port, or on the next one that is free. Raises OSError."""
    for port in (*range(USUAL, USUAL + TRIED), 0):
        try:
            return listen(Place(host, port, token))
        except OSError as error:
            if port == 0 or error.errno not in (errno.EADDRINUSE, errno.EACCES):
                raise
    raise AssertionError("the last port raises by itself")


def listen(place: Place) -> Listening:
    """Bind where the server shall listen. Raises OSError, and ValueError for a port that is none."""
    if not 0 <= place.port <= LAST_PORT:
        raise ValueError(f"--port {place.port}: a port is 1 to {LAST_PORT}, or 0 for any that is free")
    family = socket.AF_INET6 if ":" in place.host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    try:
        reuse_address(bound)
        bound.bind((place.host, place.port))
        bound.listen(128)  # now, so that whoever is told the address may connect at once
    except OSError:
        bound.close()
        raise
    return Listening(bound, place.host, bound.getsockname()[1])
