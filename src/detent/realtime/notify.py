"""What a service manager is told by the protocol of sd_notify: ready, still alive, stopping, and a line of status.

Datagrams of NAME=VALUE lines to the socket that $NOTIFY_SOCKET names: a path, or an abstract name behind `@`
(sd_notify(3)). Without it nothing is told, and nothing fails. The watchdog (sd_watchdog_enabled(3)) is fed by the loop
itself, between two wake-ups of which the cell was served: a loop that hangs is restarted.
"""

import contextlib
import os
import socket
from collections.abc import Mapping

from detent.realtime.pace import WallNs

FEEDS = 3  # in the time of the watchdog


class Notifier:
    """To the service manager, if there is one."""

    def __init__(self, environment: Mapping[str, str], *, process: int | None = None) -> None:
        """As $NOTIFY_SOCKET, $WATCHDOG_USEC and $WATCHDOG_PID say; `process` is who this is, not given: it is."""
        self._socket: socket.socket | None = None
        address = environment.get("NOTIFY_SOCKET", "")
        if address[:1] in ("/", "@") and len(address) > 1:
            self._address = "\0" + address[1:] if address[0] == "@" else address
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)
        self._every: WallNs | None = None
        self._due: WallNs | None = None
        usual, wanted = environment.get("WATCHDOG_USEC", ""), environment.get("WATCHDOG_PID", "")
        mine = not wanted or wanted == str(os.getpid() if process is None else process)
        if self._socket is not None and mine and usual.isdecimal() and int(usual) > 0:
            self._every = int(usual) * 1000 // FEEDS

    @property
    def heard(self) -> bool:
        """Whether there is anybody to tell."""
        return self._socket is not None

    def ready(self, status: str) -> None:
        """It is served; from now on the watchdog counts."""
        self._tell(f"READY=1\nSTATUS={_line(status)}")

    def status(self, text: str) -> None:
        """A line for people, as `systemctl status` shows it."""
        self._tell(f"STATUS={_line(text)}")

    def stopping(self) -> None:
        """It ends now."""
        self._tell("STOPPING=1")

    def deadline(self) -> WallNs | None:
        """When `due` wants to be called; None without a watchdog."""
        return None if self._every is None else self._due or 0

    def due(self, wall: WallNs) -> None:
        """Say that it is alive, if it is time to."""
        if self._every is not None and (self._due is None or wall >= self._due):
            self._due = wall + self._every
            self._tell("WATCHDOG=1")

    def close(self) -> None:
        """Tell nothing any more."""
        found, self._socket, self._every = self._socket, None, None
        if found is not None:
            found.close()

    def _tell(self, text: str) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):  # a manager that is gone, or busy: the cell goes on
                self._socket.sendto(text.encode(), self._address)


def _line(text: str) -> str:
    return " ".join(text.split())
