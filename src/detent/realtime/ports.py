"""Ports that drivers speak through, in real time: a serial device or pseudo-terminal, TCP, RFC 2217.

Bytes go out and come in as they are: the port is raw, without flow control. A port that is lost raises OSError, and
the next call opens it again. Several threads may share a port: `turn` lets one operation after the other have it.
"""

import contextlib
import errno
import os
import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING, Protocol, TypedDict

from detent.realtime.addresses import CLOSED, CONNECT_SECONDS, Address, PortError, port_error
from detent.realtime.system import TerminalError, termios
from detent.ticks import SECOND
from detent.uart import Format

if TYPE_CHECKING:
    from serialx import BaseSerial, Parity, StopBits

MOST_READ = 4096
STALLED_SECONDS = 10.0  # a port that takes no byte for so long is lost


def open_port(
    address: str, *, baud: int = 9600, data_bits: int = 8, parity: str = "none", stop_bits: int = 1
) -> "RealPort":
    """Open a device or a link to one, ``HOST:PORT`` (the bytes as they are), or ``rfc2217://HOST:PORT``.

    `parity` is none, odd or even. A pseudo-terminal and TCP have no format: there it only says how long characters
    take at the other end. Raises ValueError for what is no address, PortError for a port that cannot be opened.
    """
    port = RealPort(Address.parse(address), Format(baud, data_bits, parity, stop_bits))
    port.open()
    return port


class Wire(Protocol):
    """An open connection. Every call raises OSError once it is gone."""

    def read(self, timeout: float, /) -> bytes:
        """What has come, as soon as that is something; nothing if nothing comes within `timeout` seconds."""

    def write(self, data: bytes, /) -> object:
        """Hand over all of `data`."""

    def set_format(self, form: Format, /) -> object:
        """Go on in another format, where there is one."""

    def close(self) -> object:
        """Let go of it."""


class RealPort:
    """A `detent.hosts.exchange.Port` in real time, at `address`, with characters of `form`.

    Its clock never is before the end of what has been written, by the time that characters of `form` take: so a
    time-out does not begin, and a pause does not end, while a slow line still sends.
    """

    def __init__(self, address: Address, form: Format) -> None:
        self.address, self.form = address, form
        self._wire: Wire | None = None
        self._kept = b""
        self._turn = threading.Lock()
        self._sent = 0.0  # when the last character written is over
        self._character = form.duration() / SECOND

    def open(self) -> None:
        """Open it if it is not. Raises PortError."""
        self._opened()

    def set_format(self, form: Format) -> None:
        """Go on in another format, if it is another and the port has one. Raises PortError, OSError."""
        if form == self.form:
            return
        self.form, self._character = form, form.duration() / SECOND
        if self.address.formless:
            return
        try:
            self._opened().set_format(form)
        except OSError:
            self.close()
            raise

    def write(self, data: bytes, /) -> None:
        """Hand over all of `data`. Raises OSError if the port is gone; the next call opens it again."""
        try:
            self._opened().write(data)
        except OSError:
            self.close()
            raise
        self._sent = self.clock() + len(data) * self._character

    def receive(self, timeout: float, /) -> bytes:
        """What has come, as soon as that is something; nothing if nothing comes within `timeout` seconds.

        They count from the end of what was written; 0 is a look that does not wait. Raises OSError as `write` does.
        """
        if self._kept:
            data, self._kept = self._kept, b""
            return data
        try:
            if timeout > 0:
                timeout += max(self._sent - time.monotonic(), 0.0)
            return self._opened().read(timeout)
        except OSError:
            self.close()
            raise

    def keep(self, data: bytes, /) -> None:
        """`data` was read too early: it comes first at the next `receive`."""
        self._kept = data + self._kept

    def wait(self, seconds: float, /) -> None:
        """Let so many seconds pass, from the end of what was written."""
        left = self.clock() + seconds - time.monotonic()
        if left > 0:
            time.sleep(left)

    def clock(self) -> float:
        """Seconds: the present, or the end of what was written if that is later."""
        return max(time.monotonic(), self._sent)

    def turn(self) -> AbstractContextManager[object]:
        """The port is one operation's alone while this lasts."""
        return self._turn

    def close(self) -> None:
        """Let go of it. A later call opens it again."""
        wire, self._wire = self._wire, None
        self._kept = b""
        if wire is not None:
            with contextlib.suppress(OSError):  # it is gone already
                wire.close()

    def _opened(self) -> Wire:
        if self._wire is None:
            self._wire = open_wire(self.address, self.form)
        return self._wire


def open_wire(address: Address, form: Format) -> Wire:
    """Connect to `address`. Raises PortError."""
    try:
        return _Tcp(address) if address.kind == "tcp" else _open_serial(address, form)
    except (OSError, ValueError) as error:
        raise port_error(address, error) from error


def need_serialx(address: Address) -> None:
    """Raise PortError where serialx, which knows serial ports and RFC 2217, cannot be loaded."""
    try:
        import serialx  # noqa: F401
    except Exception as error:  # it is not for every system, and says so in many ways
        raise PortError(f"{address}: serialx, which opens it, cannot be loaded: {error}; take HOST:PORT") from error


def _open_serial(address: Address, form: Format) -> Wire:
    need_serialx(address)
    import serialx  # only here: it takes a while

    try:
        if address.kind == "device":
            device = serialx.Serial(address.where, **settings(accepted(address, form)))  # type: ignore[abstract]  # this system's own class
            device.open()
            return _Device(device) if termios is not None else _Serial(device)
        serial = serialx.serial_for_url(
            str(address), connect_timeout=CONNECT_SECONDS, write_timeout=STALLED_SECONDS, **settings(form)
        )
        try:
            with _ends_in(CONNECT_SECONDS, serial):
                serial.open()
        except BaseException:
            with contextlib.suppress(OSError, serialx.SerialException):
                serial.close()
            raise
        return _Serial(serial)
    except (TerminalError, serialx.SerialException) as error:
        raise port_error(address, error) from error


@contextmanager
def _ends_in(seconds: float, serial: "BaseSerial") -> Iterator[None]:
    """What is asked of a port of another computer is over in so many seconds.

    serialx waits so long for each piece of an answer, and so for ever where other things come. Raises TimeoutError.
    """
    late, over = threading.Event(), threading.Event()

    def end_it() -> None:
        late.set()
        while not over.is_set():
            link: socket.socket | None = getattr(serial, "_socket", None)
            if link is not None:
                with contextlib.suppress(OSError):  # it is closed already
                    link.shutdown(socket.SHUT_RDWR)
            over.wait(0.1)  # it may have been about to connect

    timer = threading.Timer(seconds, end_it)
    timer.daemon = True
    timer.start()
    try:
        yield
    except Exception as error:
        if late.is_set():
            raise TimeoutError from error
        raise
    finally:
        over.set()
        timer.cancel()


class _Stream:
    """What the system reads and writes by a descriptor that never blocks.

    Devices are read and written here and not through serialx, which opens and sets them up: a reply is there
    in half the time, and a device that takes nothing for a long time is an error and no endless wait.
    """

    kind = "device"

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        if hasattr(select, "poll"):
            self._readable, self._writable = select.poll(), select.poll()
            self._readable.register(descriptor, select.POLLIN)
            self._writable.register(descriptor, select.POLLOUT)

    def _take(self) -> bytes:
        """What has come; nothing at the end. Raises BlockingIOError if there is nothing yet."""
        return os.read(self._descriptor, MOST_READ)

    def _give(self, data: bytes) -> int:
        """Hand over what there is room for."""
        return os.write(self._descriptor, data)

    def _can_read(self, seconds: float) -> bool:
        if hasattr(select, "poll"):
            return bool(self._readable.poll(seconds * 1e3))
        return bool(select.select((self._descriptor,), (), (), seconds)[0])

    def _can_write(self, seconds: float) -> bool:
        if hasattr(select, "poll"):
            return bool(self._writable.poll(seconds * 1e3))
        return bool(select.select((), (self._descriptor,), (), seconds)[1])

    def read(self, timeout: float) -> bytes:
        if not self._can_read(timeout):
            return b""
        try:
            data = self._take()
        except BlockingIOError:
            return b""
        if not data:
            raise OSError(errno.EIO, CLOSED[self.kind])
        return data

    def write(self, data: bytes) -> None:
        while True:
            try:
                written = self._give(data)
            except BlockingIOError:
                written = 0
            if written == len(data):
                return
            data = data[written:]
            if not self._can_write(STALLED_SECONDS):
                raise OSError(errno.EIO, f"it took nothing for {STALLED_SECONDS:g} s")


class _Device(_Stream):
    """A serial device or a pseudo-terminal."""

    def __init__(self, serial: "BaseSerial") -> None:
        self._serial = serial
        os.set_blocking(serial.fileno(), False)
        super().__init__(serial.fileno())

    def set_format(self, form: Format) -> None:
        self._serial.reconfigure_port(**settings(form))

    def close(self) -> None:
        self._serial.close()


class _Tcp(_Stream):
    """A TCP connection, the bytes as they are.

    Not through serialx, whose sockets keep Nagle's algorithm: a frame written in two parts then is answered after
    40 ms and not after 40 us, on one computer.
    """

    kind = "tcp"

    def __init__(self, address: Address) -> None:
        host, port = address.tcp
        self._socket = socket.create_connection((host, port), timeout=CONNECT_SECONDS)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._socket.setblocking(False)
        super().__init__(self._socket.fileno())

    def _take(self) -> bytes:
        return self._socket.recv(MOST_READ)

    def _give(self, data: bytes) -> int:
        return self._socket.send(data)

    def set_format(self, form: Format) -> None:
        raise NotImplementedError("its bytes have none")

    def close(self) -> None:
        self._socket.close()


class _Serial:
    """Through serialx: a serial port of another computer, or a device of a system that has its own ways with them."""

    def __init__(self, serial: "BaseSerial") -> None:
        self._serial = serial
        self._room = bytearray(MOST_READ)

    def read(self, timeout: float) -> bytes:
        count = self._serial.readinto(self._room, timeout=timeout)
        return bytes(self._room[:count])

    def write(self, data: bytes) -> None:
        self._serial.write(data)

    def set_format(self, form: Format) -> None:
        with _ends_in(CONNECT_SECONDS, self._serial):
            self._serial.reconfigure_port(**settings(form))

    def close(self) -> None:
        self._serial.close()


class Settings(TypedDict):
    """A character format in the words of serialx."""

    baudrate: int
    byte_size: int
    parity: "Parity"
    stopbits: "StopBits"


def accepted(address: Address, form: Format) -> Format:
    """The format that the system is told: a pseudo-terminal takes 8N1, and others only once."""
    return Format(form.baud) if address.formless else form


def settings(form: Format) -> Settings:
    """The format in the words of serialx."""
    from serialx import Parity, StopBits

    return {
        "baudrate": form.baud,
        "byte_size": form.data_bits,
        "parity": Parity(form.parity[0].upper()),
        "stopbits": StopBits(form.stop_bits),
    }
