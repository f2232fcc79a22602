"""The engine's end of the pipe to the workbench, as an endpoint of the loop that serves the cell.

A message is its length in four bytes, big-endian, and a pickle. Neither end ever waits for the other.
"""

import contextlib
import pickle
import socket
import struct
from collections.abc import Callable, Sequence

from detent.realtime.pace import WallNs
from detent.ticks import MS

HEAD = struct.Struct(">I")
TICK: WallNs = 50 * MS  # between two looks at the cell
READ = 1 << 16
FULL = 8 << 20  # bytes that wait for the workbench: then it is told nothing new until it has caught up


def packed(message: object) -> bytes:
    """A message as it goes over the pipe."""
    data = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
    return HEAD.pack(len(data)) + data


class Pipe:
    """Messages of the workbench go to `heed`; `tick` is called twenty times a second; `gone` when it has left."""

    kind = "pipe"
    address = ""
    dropped = 0

    def __init__(
        self, end: socket.socket, heed: Callable[[object], None], tick: Callable[[WallNs], None],
        gone: Callable[[], None],
    ) -> None:  # fmt: skip
        end.setblocking(False)
        self._end, self._heed, self._tick, self._gone = end, heed, tick, gone
        self._in, self._out = bytearray(), bytearray()
        self._next: WallNs | None = 0

    @property
    def full(self) -> bool:
        """Whether the workbench is far behind."""
        return len(self._out) > FULL

    def push(self, message: object) -> None:
        """Tell the workbench, now or when it reads."""
        self._out += packed(message)
        self.flush()

    def reading(self, room: bool) -> Sequence[int]:
        """Its end, whatever the line has room for."""
        return () if self._next is None else (self._end.fileno(),)

    def writing(self) -> Sequence[int]:
        """Its end, while something waits."""
        return (self._end.fileno(),) if self._out and self._next is not None else ()

    def deadline(self) -> WallNs | None:
        """The next tick."""
        return self._next

    def due(self, wall: WallNs) -> None:
        """A tick."""
        self._next = wall + TICK
        self._tick(wall)

    def receive(self, descriptor: int, wall: WallNs) -> bytes:
        """Something was asked for. Nothing of it is for the line."""
        try:
            data = self._end.recv(READ)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._leave()
            return b""
        self._in += data
        while len(self._in) >= HEAD.size:
            (length,) = HEAD.unpack_from(self._in)
            if len(self._in) < HEAD.size + length:
                break
            message = pickle.loads(self._in[HEAD.size : HEAD.size + length])
            del self._in[: HEAD.size + length]
            self._heed(message)
        return b""

    def send(self, data: bytes, wall: WallNs) -> None:
        """What hosts hear is in the recording."""

    def flush(self) -> None:
        """Write what there is room for."""
        while self._out and self._next is not None:
            try:
                del self._out[: self._end.send(self._out)]
            except BlockingIOError:
                return
            except OSError:
                self._leave()

    def close(self) -> None:
        """Write what is left, for at most a few seconds, and let go."""
        if self._next is not None:
            self._next = None
            self._end.settimeout(5)
            with contextlib.suppress(OSError):  # nobody reads any more
                self._end.sendall(self._out)
        self._end.close()

    def _leave(self) -> None:
        self._next = None
        self._gone()
