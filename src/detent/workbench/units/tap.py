"""A port that remembers what went through it, looks at it without taking anything, and stays lost once it is."""

import errno
from contextlib import AbstractAsyncContextManager
from typing import Final

from detent.hosts.exchange import AsyncPort
from detent.workbench.units.transcript import HOST, Transcript, nanoseconds

MOST_UNREAD: Final = 4096  # bytes that nobody asked for and that are kept for the next operation


class Tap:
    """An `AsyncPort` before another one.

    A port that is lost stays so: every call raises OSError until `renew`, where the port itself would be opened again
    and be spoken to without anybody having asked for it.
    """

    def __init__(self, port: AsyncPort, transcript: Transcript, first: "Tap | None" = None) -> None:
        """`first`: the tap that looks at a port which several share."""
        self.port, self.transcript, self._first = port, transcript, first
        self._unread = b""
        self._begin = port.clock()
        self.lost = ""
        """Why the port is gone; "" while it is there."""
        self.sent = self.came = 0.0
        """When something was last sent, and when something last came, in seconds by `clock`."""
        self.began = 0.0
        """When something was sent first since this was set to 0."""

    async def write(self, data: bytes) -> None:
        """Hand over all of `data`. Raises OSError."""
        self._there()
        self.began = self.began or self.port.clock()
        try:
            await self.port.write(data)
        except OSError as error:
            raise self._gone(error) from error
        self.sent = self.port.clock()
        self.transcript.take(HOST, data, nanoseconds(self.sent - self._begin))

    async def receive(self, timeout: float) -> bytes:
        """What has come, as `AsyncPort` has it. Raises OSError."""
        self._there()
        if self._unread:
            data, self._unread = self._unread, b""
            return data
        return await self._come(timeout)

    def keep(self, data: bytes) -> None:
        """`data` was read too early: it comes first at the next `receive`."""
        self._unread = data + self._unread

    async def look(self) -> None:
        """See that the port is there, and what came unasked, which is kept for who reads next. Raises OSError."""
        if self._first is not None:
            self.lost = self.lost or self._first.lost
            return
        async with self.turn():
            self._there()
            data = await self._come(0.0)
            self._unread = (self._unread + data)[-MOST_UNREAD:]

    async def wait(self, seconds: float) -> None:
        """Let so many seconds pass."""
        await self.port.wait(seconds)

    def clock(self) -> float:
        """Seconds."""
        return self.port.clock()

    def turn(self) -> AbstractAsyncContextManager[object]:
        """The port is one operation's alone while this lasts."""
        return self.port.turn()

    async def close(self) -> None:
        """Let go of it, for good."""
        self.lost = self.lost or "it was let go"
        await self.port.close()

    def renew(self) -> None:
        """The port may be opened again."""
        self.lost, self._unread = "", b""
        if self._first is not None:
            self._first.renew()

    async def _come(self, timeout: float) -> bytes:
        try:
            data = await self.port.receive(timeout)
        except OSError as error:
            raise self._gone(error) from error
        if data:
            self.came = self.port.clock()
            self.transcript.take("unit", data, nanoseconds(self.came - self._begin))
        return data

    def _there(self) -> None:
        if self.lost:
            raise OSError(errno.EIO, self.lost)

    def _gone(self, error: OSError) -> OSError:
        self.lost = error.strerror or str(error)
        return error
