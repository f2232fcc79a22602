"""A pseudo-terminal: what a program that expects a serial port opens."""

import os
import pty
import stat
import tty
from collections.abc import Sequence
from itertools import count
from pathlib import Path

from detent.realtime.endpoints.endpoint import EndpointError, Outgoing, read_ready
from detent.realtime.pace import WallNs


class PseudoTerminal:
    """A raw pseudo-terminal, on request under the name `link` too. Clients come and go as they like.

    Its own end of the clients' side stays open, so that the last client leaving ends nothing. Baud rate and
    format that a client sets are accepted and have no effect: the line of the cell has its own.
    """

    kind = "pty"

    def __init__(self, link: Path | None = None) -> None:
        """Raises EndpointError if `link` cannot be made or is something else than a link."""
        try:
            self._ours, self._theirs = pty.openpty()
        except OSError as error:
            raise EndpointError(f"no pseudo-terminal to be had: {error.strerror or error}") from error
        self._link: Path | None = None
        try:
            tty.setraw(self._theirs)
            os.set_blocking(self._ours, False)
            self._device = os.ttyname(self._theirs)
            if link is not None:
                _point(link, self._device)
                self._link = link
        except BaseException:
            self.close()
            raise
        self.address = str(link) if link is not None else self._device
        self._outgoing = Outgoing(lambda data: os.write(self._ours, data))

    @property
    def dropped(self) -> int:
        """Bytes that were lost because no client read them."""
        return self._outgoing.dropped

    def reading(self, room: bool) -> Sequence[int]:
        """Our end, while the line has room."""
        return (self._ours,) if room else ()

    def writing(self) -> Sequence[int]:
        """Our end, while bytes wait."""
        return (self._ours,) if self._outgoing else ()

    def deadline(self) -> WallNs | None:
        """Never."""
        return None

    def due(self, wall: WallNs) -> None:
        """Nothing is ever due."""

    def receive(self, descriptor: int, wall: WallNs) -> bytes:
        """What the client wrote."""
        return read_ready(descriptor)

    def send(self, data: bytes, wall: WallNs) -> None:
        """Give `data` to the client, now or when it reads."""
        self._outgoing.send(data)

    def flush(self) -> None:
        """The client has read something."""
        self._outgoing.flush()

    def close(self) -> None:
        """Close the terminal; remove the link if it still is ours."""
        if self._link is not None:
            link, self._link = self._link, None
            try:
                if str(link.readlink()) == self._device:
                    link.unlink()
            except OSError:
                pass  # somebody took it away or put something else there: not ours any more
        for descriptor in (self._ours, self._theirs):
            if descriptor >= 0:
                os.close(descriptor)
        self._ours = self._theirs = -1


def _point(link: Path, device: str) -> None:
    """Make `link` point to `device`: in one step, if it pointed elsewhere before."""
    try:
        present = link.lstat()
    except FileNotFoundError:
        present = None
    except OSError as error:
        raise EndpointError(f"{link}: {error.strerror}; choose another LINK for --pty") from error
    if present is not None and not stat.S_ISLNK(present.st_mode):
        raise EndpointError(f"{link} exists and is not a symbolic link; remove it or choose another LINK for --pty")
    try:
        temporary = _link_beside(link, device)
        try:
            temporary.replace(link)
        except BaseException:
            temporary.unlink()
            raise
    except OSError as error:
        raise EndpointError(f"{link} cannot be made: {error.strerror}; choose another LINK for --pty") from error


def _link_beside(link: Path, device: str) -> Path:
    """A link to `device` in the folder of `link`, under a name that nobody has."""
    for number in count():
        temporary = link.with_name(f".{link.name}.{os.getpid()}.{number}")
        try:
            temporary.symlink_to(device)
        except FileExistsError:
            continue
        return temporary
    raise AssertionError("count() has no end")
