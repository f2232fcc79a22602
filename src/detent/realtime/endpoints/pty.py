"""A pseudo-terminal: what a program that expects a serial port opens."""

import fcntl
import os
import select
import stat
import struct
import termios
import tty
from collections.abc import Sequence
from itertools import count
from pathlib import Path

from detent.realtime.endpoints.endpoint import MOST_READ, EndpointError, Outgoing
from detent.realtime.endpoints.opened import Opened, Openings
from detent.realtime.endpoints.unsettler import SERVING, TELLS, unsettle
from detent.realtime.endpoints.unsettling import Unsettling
from detent.realtime.pace import WallNs
from detent.ticks import MS
from detent.uart import Chars

_SOONER = 50 * MS  # behind the last setting: both at once would wait for each other's locks, and so would the client


class PseudoTerminal:
    """A raw pseudo-terminal, on request under the name `link` too. Clients come and go as they like.

    Its own end of the clients' side stays open, so that the last client leaving ends nothing; what nobody has read is
    forgotten then, and what comes while nobody has it open, as at a serial port. Baud rate and format that a client
    sets are accepted and have no effect: the line of the cell has its own.
    """

    kind = "pty"

    def __init__(
        self,
        link: Path | None = None,
        parting: Chars = b"",
        openings: Openings | None = None,
        unsettling: Unsettling | None = None,
    ) -> None:
        """`parting` is what the line hears when the last client leaves, if it said something.

        Several in one loop may share `openings`, by which they are told who comes and goes, and `unsettling`, which is
        closed with the first of them: then they are served no longer.
        Raises EndpointError if `link` cannot be made, is something else than a link, or is served by another.
        """
        try:
            self._ours, self._theirs = os.openpty()
        except OSError as error:
            raise EndpointError(f"no pseudo-terminal to be had: {error.strerror or error}") from error
        self._parting = parting
        self._said = False  # a client has said something since the last one left
        self._owed: Chars = b""  # to the line: it has not heard yet that they left
        self._link: Path | None = None
        self._clients: Opened | None = None
        self._turn = bytearray(1)
        self._beside = False  # somebody else unsettles it, and sooner
        self._unsettled_by: WallNs | None = None
        self._unsettling = unsettling
        try:
            tty.setraw(self._theirs)
            os.set_blocking(self._ours, False)
            self._device = os.ttyname(self._theirs)
            _lock(self._theirs)
            if TELLS:
                fcntl.ioctl(self._ours, termios.TIOCPKT, struct.pack("i", 1))
                self._unsettle()
                self._beside = unsettling is not None and unsettling.watch(self._ours)
            self._clients = Opened(self._device, openings)
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
        """Our end, while the line has room; and who comes and goes."""
        coming = self._clients.reading() if self._clients is not None else ()
        return (*coming, self._ours) if room else coming

    def writing(self) -> Sequence[int]:
        """Our end, while bytes wait."""
        return (self._ours,) if self._outgoing else ()

    def deadline(self) -> WallNs | None:
        """When a setting has had time to be undone by whoever does it sooner than this loop."""
        return self._unsettled_by

    def due(self, wall: WallNs) -> None:
        """It has had that."""
        self._unsettled_by = None
        self._unsettle()

    def receive(self, descriptor: int, wall: WallNs) -> Chars:
        """What the client wrote; and that the last one has left, where that means something."""
        if descriptor != self._ours:
            self._come_and_go()
            owed, self._owed = self._owed, b""
            return owed
        try:
            read = os.read(self._ours, MOST_READ + 1 if TELLS else MOST_READ)
        except BlockingIOError:
            return b""
        if not TELLS:
            return read
        self._said |= len(read) > 1
        if read[:1] != b"\0":  # not data
            if self._beside:
                self._unsettled_by = wall + _SOONER
            else:
                self._unsettle()
            return b""
        return read[1:]

    def _unsettle(self) -> None:
        unsettle(self._theirs, SERVING, self._turn)

    def send(self, data: bytes, wall: WallNs) -> None:
        """Give `data` to the client, now or when it reads."""
        if self._somebody():
            self._outgoing.send(data)

    def flush(self) -> None:
        """The client has read something."""
        self._outgoing.flush()

    def _somebody(self) -> bool:
        """Whether a client has it open."""
        if self._clients is None or self._clients.somebody:
            return True
        self._come_and_go()
        return self._clients.somebody

    def _come_and_go(self) -> None:
        """Clients came or left: what the last one has not read is not for the next."""
        if self._clients is not None and self._clients.update():
            if self._said:
                self._owed, self._said = self._parting, False
            self._outgoing.forget()
            if select.select((self._theirs,), (), (), 0)[0]:  # or else no lock is taken that a client may wait for
                termios.tcflush(self._theirs, termios.TCIFLUSH)

    def close(self) -> None:
        """Close the terminal; remove the link if it still is ours."""
        if self._unsettling is not None:
            self._unsettling.close()  # which has it open
        if self._clients is not None:
            self._clients.close()
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


_SET_LOCK = getattr(fcntl, "F_OFD_SETLK", None)  # of an open file, so that no other opening or closing releases it


def _lock(descriptor: int) -> bool:
    """Mark a terminal as served while `descriptor` is open; False if another serves it. Clients notice nothing."""
    if _SET_LOCK is None:
        return True
    try:
        fcntl.fcntl(descriptor, _SET_LOCK, struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, 0, 0, 0))
    except OSError:
        return False
    return True


def _served(device: Path) -> bool:
    """Whether `device` is a terminal that somebody serves."""
    try:
        descriptor = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        return not _lock(descriptor)
    finally:
        os.close(descriptor)


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
    if present is not None and str(link.readlink()) == device:
        return  # left behind by one that ended badly, and its terminal is ours now
    if present is not None and _served(link):
        raise EndpointError(f"{link} is in use: another detent serves there; stop it, or choose another LINK for --pty")
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
