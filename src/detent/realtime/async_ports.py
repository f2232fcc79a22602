"""The ports of `detent.realtime.ports` for coroutines: on an asyncio loop, through the transports of serialx."""

import asyncio
import errno
import time
from contextlib import AbstractAsyncContextManager, suppress
from typing import TYPE_CHECKING

from detent.realtime.addresses import CLOSED, CONNECT_SECONDS, Address, port_error
from detent.realtime.ports import STALLED_SECONDS, accepted, need_serialx, settings
from detent.realtime.system import TerminalError
from detent.ticks import SECOND
from detent.uart import Format

if TYPE_CHECKING:
    from serialx import BaseSerialTransport


async def open_async_port(
    address: str, *, baud: int = 9600, data_bits: int = 8, parity: str = "none", stop_bits: int = 1
) -> "AsyncRealPort":
    """Open a port as `detent.realtime.ports.open_port` does, for the running loop. Raises ValueError, PortError."""
    port = AsyncRealPort(Address.parse(address), Format(baud, data_bits, parity, stop_bits))
    await port.open()
    return port


class _Inbox(asyncio.Protocol):
    """Keeps what comes until it is fetched, and wakes whoever waits for it."""

    def __init__(self, closed: str) -> None:
        """`closed` is what an end that nobody asked for means."""
        self._closed = closed
        self.came = bytearray()
        self.lost: Exception | None = None
        self.waiting: asyncio.Future[None] | None = None

    def data_received(self, data: bytes) -> None:
        self.came += data
        self.wake()

    def connection_lost(self, exc: Exception | None) -> None:
        self.lost = exc or OSError(errno.EIO, self._closed)
        self.wake()

    def wake(self) -> None:
        if self.waiting is not None and not self.waiting.done():
            self.waiting.set_result(None)

    async def wait(self, seconds: float) -> None:
        """Until something comes or the connection is lost, for so many seconds at most."""
        loop = asyncio.get_running_loop()
        self.waiting = loop.create_future()
        timer = loop.call_later(seconds, self.wake)
        try:
            await self.waiting
        finally:
            timer.cancel()
            self.waiting = None


class AsyncRealPort:
    """A `detent.hosts.exchange.AsyncPort` in real time; its clock is that of `detent.realtime.ports.RealPort`."""

    def __init__(self, address: Address, form: Format) -> None:
        self.address, self.form = address, form
        self._open: tuple[BaseSerialTransport, _Inbox] | None = None
        self._kept = b""
        self._turn = asyncio.Lock()
        self._sent = 0.0  # when the last character written is over
        self._character = form.duration() / SECOND

    async def open(self) -> None:
        """Open it if it is not. Raises PortError."""
        await self._opened()

    async def write(self, data: bytes, /) -> None:
        """Hand over all of `data`. Raises OSError if the port is gone; the next call opens it again."""
        transport, inbox = await self._opened()
        await self._check(inbox)
        try:
            transport.write(data)
        except OSError:
            await self.close()
            raise
        self._sent = self.clock() + len(data) * self._character

    async def receive(self, timeout: float, /) -> bytes:
        """What has come, as soon as that is something; nothing if nothing comes within `timeout` seconds.

        They count from the end of what was written; 0 is a look that does not wait. Raises OSError as `write` does.
        """
        if self._kept:
            data, self._kept = self._kept, b""
            return data
        _, inbox = await self._opened()
        if not inbox.came and inbox.lost is None:
            if timeout > 0:
                await inbox.wait(timeout + max(self._sent - time.monotonic(), 0.0))
            else:  # the loop looks at the port in one turn and hands over what is there in the next
                await asyncio.sleep(0)
                await asyncio.sleep(0)
        if not inbox.came:
            await self._check(inbox)
        data = bytes(inbox.came)
        inbox.came.clear()
        return data

    def keep(self, data: bytes, /) -> None:
        """`data` was read too early: it comes first at the next `receive`."""
        self._kept = data + self._kept

    async def wait(self, seconds: float, /) -> None:
        """Let so many seconds pass, from the end of what was written."""
        await asyncio.sleep(max(self.clock() + seconds - time.monotonic(), 0.0))

    def clock(self) -> float:
        """Seconds: the present, or the end of what was written if that is later."""
        return max(time.monotonic(), self._sent)

    def turn(self) -> AbstractAsyncContextManager[object]:
        """The port is one operation's alone while this lasts."""
        return self._turn

    async def close(self) -> None:
        """Let go of it. A later call opens it again."""
        opened, self._open = self._open, None
        self._kept = b""
        if opened is not None:
            with suppress(OSError):  # it is gone already
                opened[0].close()
                await opened[0].wait_closed()

    async def _check(self, inbox: _Inbox) -> None:
        """Raise OSError if the connection was lost."""
        if inbox.lost is not None:
            await self.close()
            error = inbox.lost
            raise OSError(getattr(error, "errno", None) or errno.EIO, getattr(error, "strerror", None) or str(error))

    async def _opened(self) -> "tuple[BaseSerialTransport, _Inbox]":
        if self._open is None:
            self._open = await _connect(self.address, self.form)
        return self._open


async def _connect(address: Address, form: Format) -> "tuple[BaseSerialTransport, _Inbox]":
    need_serialx(address)
    import serialx  # only here: it takes a while

    url = {"device": address.where, "tcp": f"socket://{address.where}"}.get(address.kind, str(address))
    kind: type[BaseSerialTransport] | None = serialx.SerialTransport if address.kind == "device" else None
    inbox = _Inbox(CLOSED["device" if kind else "tcp"])
    try:
        transport, _ = await serialx.create_serial_connection(
            asyncio.get_running_loop(),
            lambda: inbox,
            url,
            transport_cls=kind,
            close_timeout=STALLED_SECONDS,
            **({} if kind else {"connect_timeout": CONNECT_SECONDS}),  # type: ignore[arg-type]
            **settings(accepted(address, form)),
        )
    except (OSError, ValueError, TerminalError, serialx.SerialException) as error:
        raise port_error(address, error) from error
    return transport, inbox
