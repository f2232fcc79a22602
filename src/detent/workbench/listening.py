"""Where the workbench listens, before anything heavy is loaded."""

import contextlib
import ipaddress
import socket
from typing import NamedTuple


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

    def url(self, token: str | None) -> str:
        """The address to open in a browser on this machine."""
        named = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)
        with contextlib.suppress(ValueError):
            if ipaddress.ip_address(named).version == 6:
                named = f"[{named}]"
        return f"http://{named}:{self.port}/" + (f"?token={token}" if token else "")


def listen(place: Place) -> Listening:
    """Bind where the server shall listen. Raises OSError."""
    family = socket.AF_INET6 if ":" in place.host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((place.host, place.port))
        bound.listen(128)  # now, so that whoever is told the address may connect at once
    except OSError:
        bound.close()
        raise
    return Listening(bound, place.host, bound.getsockname()[1])
