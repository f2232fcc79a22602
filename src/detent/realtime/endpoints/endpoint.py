"""What every endpoint answers to the loop, and the bytes that wait for a client."""

import contextlib
import errno
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, runtime_checkable

from detent.lines.line import Heard
from detent.realtime.pace import WallNs
from detent.uart import Chars

MOST_READ = 256  # bytes taken from a client in one wake-up: a flood leaves time for everybody else
OUT_OF_DESCRIPTORS = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)  # what the system has no more of
MOST_WAITING = 4_096  # bytes kept for a client that does not read


class EndpointError(OSError):
    """An endpoint that cannot be opened as asked. The text says what is wrong and what to do."""


@contextlib.contextmanager
def descriptors_suffice() -> Iterator[None]:
    """What is opened meanwhile and finds no descriptor left is an EndpointError with the remedy."""
    try:
        yield
    except OSError as error:
        cause = error.__cause__ if isinstance(error, EndpointError) else error
        if not isinstance(cause, OSError) or cause.errno not in (errno.EMFILE, errno.ENFILE):
            raise
        whose = "the system has" if cause.errno == errno.ENFILE else "this process may have"
        raise EndpointError(f"{whose} no more open files: raise the limit (ulimit -n), or serve fewer lines") from error


class EndpointLost(OSError):
    """An endpoint that went away while it was served and will not come back, such as an unplugged adapter."""


class Endpoint(Protocol):
    """Bytes between one line of the cell and whoever is connected. No call ever waits."""

    kind: str  # pty, tcp, rfc2217, serial
    address: str  # what a client connects to

    @property
    def dropped(self) -> int:
        """Bytes that were lost because a client did not read them."""

    def reading(self, room: bool) -> Sequence[int]:
        """The file descriptors to watch for something to read; bytes for the line only while it has `room`."""

    def writing(self) -> Sequence[int]:
        """The file descriptors to watch for room to write."""

    def deadline(self) -> WallNs | None:
        """When `due` wants to be called, whatever else happens."""

    def due(self, wall: WallNs) -> None:
        """It is `deadline`."""

    def receive(self, descriptor: int, wall: WallNs) -> Chars:
        """`descriptor` has something to read: the characters for the line, which may be none."""

    def send(self, data: bytes, wall: WallNs) -> None:
        """The host of the line hears `data`."""

    def flush(self) -> None:
        """There is room to write again."""

    def close(self) -> None:
        """Let go of everything, remove what was made. May be called twice."""


@runtime_checkable
class Listener(Endpoint, Protocol):
    """An endpoint whose clients have a format of their own: it is given the characters on the line with their times."""

    def hear(self, heard: Sequence[Heard], wall: WallNs) -> None:
        """What has reached the host of the line, instead of `send`."""


class Outgoing:
    """Bytes on their way to a client. Never waits; when too many wait, the oldest are lost and counted."""

    __slots__ = ("_waiting", "_write", "dropped")

    def __init__(self, write: Callable[[bytes], int]) -> None:
        """`write` takes some of the bytes and says how many; it raises BlockingIOError if it has no room."""
        self._write = write
        self._waiting = bytearray()
        self.dropped = 0

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def send(self, data: bytes) -> None:
        """Write at once what there is room for, and keep the rest. Raises what `write` raises."""
        if not self._waiting:
            try:
                written = self._write(data)
            except BlockingIOError:
                written = 0
            if written == len(data):
                return
            data = data[written:]
        self._waiting += data
        excess = len(self._waiting) - MOST_WAITING
        if excess > 0:
            del self._waiting[:excess]
            self.dropped += excess

    def flush(self) -> None:
        """Write what waits, as far as there is room. Raises what `write` raises."""
        if self._waiting:
            with contextlib.suppress(BlockingIOError):  # the loop will say when there is room
                del self._waiting[: self._write(bytes(self._waiting))]

    def forget(self) -> None:
        """Nobody is there to read what waits."""
        self._waiting.clear()


def read_ready(descriptor: int) -> bytes:
    """What a file descriptor has to read, at most `MOST_READ` bytes; none if nothing is there after all."""
    try:
        return os.read(descriptor, MOST_READ)
    except BlockingIOError:
        return b""
