"""A serial port of this computer: the cell at the end of a real wire."""

import os
import select
import stat
from collections.abc import Sequence

from detent.extras import how_to_install
from detent.realtime.endpoints.endpoint import EndpointError, EndpointLost, Outgoing, read_ready
from detent.realtime.pace import WallNs
from detent.realtime.system import TerminalError, termios
from detent.uart import Format


class SerialPort:
    """The serial device at `address`, in the character format of the line."""

    kind = "serial"

    def __init__(self, address: str, form: Format) -> None:
        """Raises EndpointError if the device cannot be opened so."""
        if termios is None:
            raise EndpointError("serial ports are served on Linux and macOS; here take --tcp or --rfc2217 HOST:PORT")
        try:
            import serialx
        except Exception as error:  # it is not for every system, and says so in many ways
            missing = isinstance(error, ModuleNotFoundError) and error.name == "serialx"
            why = "is not installed" if missing else f"cannot be loaded ({error})"
            raise EndpointError(f"--serial needs serialx, which {why}: {how_to_install()}") from error
        self.address = address
        if _is_pseudo_terminal(address):  # it carries bytes, and Linux refuses it any other format
            form = form._replace(data_bits=8, parity="none")
        try:
            self._port = serialx.Serial(  # type: ignore[abstract]  # it is this system's own class
                address, form.baud, byte_size=form.data_bits, parity=form.parity[0].upper(), stopbits=form.stop_bits
            )
            self._port.open()
        except (OSError, ValueError, TerminalError, serialx.SerialException) as error:
            reason = getattr(error, "strerror", None) or error.args[-1]
            raise EndpointError(
                f"{address} cannot be opened at {form}: {reason}; name a serial device that is there and free"
            ) from error
        self._descriptor: int = self._port.fileno()
        os.set_blocking(self._descriptor, False)
        self._outgoing = Outgoing(lambda data: os.write(self._descriptor, data))

    @property
    def dropped(self) -> int:
        """Bytes that the device did not take in time."""
        return self._outgoing.dropped

    def reading(self, room: bool) -> Sequence[int]:
        """The device, while the line has room."""
        return (self._descriptor,) if room else ()

    def writing(self) -> Sequence[int]:
        """The device, while bytes wait."""
        return (self._descriptor,) if self._outgoing else ()

    def deadline(self) -> WallNs | None:
        """Never."""
        return None

    def due(self, wall: WallNs) -> None:
        """Nothing is ever due."""

    def receive(self, descriptor: int, wall: WallNs) -> bytes:
        """What came over the wire. Raises EndpointLost if the device is gone."""
        try:
            data = read_ready(descriptor)
        except OSError as error:
            raise self._lost() from error
        if not data and _hung_up(descriptor):
            raise self._lost()
        return data

    def send(self, data: bytes, wall: WallNs) -> None:
        """Put `data` on the wire. Raises EndpointLost if the device is gone."""
        try:
            self._outgoing.send(data)
        except OSError as error:
            raise self._lost() from error

    def flush(self) -> None:
        """The device takes more. Raises EndpointLost if it is gone."""
        try:
            self._outgoing.flush()
        except OSError as error:
            raise self._lost() from error

    def close(self) -> None:
        """Give the device back."""
        self._port.close()

    def _lost(self) -> EndpointLost:
        return EndpointLost(f"{self.address} is gone; plug it in again and start anew")


def _is_pseudo_terminal(address: str) -> bool:
    """Whether a device is the clients' side of a pseudo-terminal of Linux: its major numbers are 136 to 143."""
    try:
        device = os.stat(address)
    except (OSError, ValueError):
        return False
    return stat.S_ISCHR(device.st_mode) and 136 <= os.major(device.st_rdev) <= 143


def _hung_up(descriptor: int) -> bool:
    """Whether a descriptor that was ready and gave nothing is at its end: a terminal without data says the same."""
    poll = select.poll()
    poll.register(descriptor, 0)
    return any(event & (select.POLLHUP | select.POLLERR | select.POLLNVAL) for _, event in poll.poll(0))
