"""Where bytes of a board come from: a serial device, or a fake board in this process."""

import os
import select
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from detent.cell.real_pins import device_of
from detent.realtime.boards.board import Board, State
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.chips import Chips
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.port import Port as Port
from detent.realtime.boards.port import PortError as PortError
from detent.realtime.boards.port import PortLost as PortLost
from detent.realtime.boards.setup import BoardSetup
from detent.realtime.boards.vocabulary import EVERYTHING
from detent.realtime.pace import WallNs
from detent.realtime.system import TerminalError, lock, termios

BAUD = 250_000  # the firmware's own default; USB boards do not care
MOST_READ = 4096
FAKE = "fake:"
FAKES: Mapping[str, Callable[[], FakeBoard]] = {
    "": lambda: FakeBoard(moves=512),
    "rp2040": lambda: FakeBoard(moves=512, frequency=12_000_000, pins={"gpio0": (0, 30)}, window=None, reserved={}),
    "stm32": lambda: FakeBoard(
        moves=512, frequency=64_000_000, window=None, reserved={"USB": "PA11,PA12"},
        pins={f"P{port}0": (16 * number, 16) for number, port in enumerate("ABCDEFGH")},
    ),
}  # fmt: skip
"""Fake boards by what follows `fake:`, with the names that the pins of such boards have."""
BY_ID = Path("/dev/serial/by-id")


class SerialPort:
    """A serial device, a USB board, or the terminal of the firmware's Linux process."""

    def __init__(self, address: str) -> None:
        """`address` is a device, with `@BAUD` behind it where it is no USB board and not flashed for 250000 Bd.

        PortError with the remedy.
        """
        self.address = address
        self._device, baud = device_of(address)
        self._baud = baud or str(BAUD)
        self._port: object | None = None
        self._descriptor = -1
        self._waiting = bytearray()
        self._open()

    def _open(self) -> None:
        if termios is None:
            raise PortError(f"{self._device}: real boards need Linux or macOS; fake: is a board without one")
        import tty

        device = self._device
        try:
            self._descriptor = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except IsADirectoryError:
            raise PortError(f"{device} is a directory: name the board's device in it") from None
        except OSError as error:
            remedy = "join the group of the device (dialout)" if isinstance(error, PermissionError) else (
                "look at /dev/serial/by-id and plug it in")  # fmt: skip
            raise PortError(f"{device} cannot be opened: {error.strerror}; {remedy}") from error
        try:
            tty.setraw(self._descriptor)
            if not os.path.realpath(device).startswith("/dev/pts/"):
                self._set_baud()
            lock(self._descriptor)
        except BlockingIOError as error:
            self.close()
            raise PortError(f"{device} is in use by another program; end that first") from error
        except FileNotFoundError as error:
            self.close()
            raise PortError(f"{device} was unplugged as it was opened; plug it in again") from error
        except (OSError, TerminalError, ValueError) as error:
            self.close()
            why = str(error.args[-1]).lower()
            raise PortError(f"{device} is no serial device ({why}): name the board's own, as in {BY_ID}") from error

    def _set_baud(self) -> None:
        import serialx

        descriptor, self._descriptor = self._descriptor, -1
        os.close(descriptor)
        port = serialx.Serial(self._device, int(self._baud))  # type: ignore[abstract]  # this system's own class
        port.open()
        self._port, self._descriptor = port, port.fileno()
        os.set_blocking(self._descriptor, False)

    def reading(self) -> Sequence[int]:
        """The device, while it is there."""
        return (self._descriptor,) if self._descriptor >= 0 else ()

    def writing(self) -> Sequence[int]:
        """The device, while bytes wait."""
        return (self._descriptor,) if self._descriptor >= 0 and self._waiting else ()

    def receive(self, wall: WallNs) -> bytes:
        """What has come. PortLost."""
        if self._descriptor < 0:
            return b""
        try:
            data = os.read(self._descriptor, MOST_READ)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._lost(error.strerror) from error
        if not data and self._hung_up():
            raise self._lost("it was unplugged, or has started again")
        return data

    def send(self, data: bytes, wall: WallNs) -> None:
        """Send `data`, now or when there is room. PortLost."""
        self._waiting += data
        self.flush()

    def flush(self) -> None:
        """There is room to write again. PortLost."""
        if self._descriptor < 0:
            return
        try:
            while self._waiting:
                del self._waiting[: os.write(self._descriptor, self._waiting)]
        except BlockingIOError:
            pass
        except OSError as error:
            raise self._lost(error.strerror) from error

    def deadline(self) -> WallNs | None:
        """Never: its descriptor says when."""
        return None

    def reopen(self) -> bool:
        """Try to open it again; whether it is open."""
        self.close()
        try:
            self._open()
        except PortError:
            return False
        return True

    def close(self) -> None:
        """Let go of it."""
        self._waiting.clear()
        port, self._port = self._port, None
        descriptor, self._descriptor = self._descriptor, -1
        if port is not None:
            port.close()  # type: ignore[attr-defined]
        elif descriptor >= 0:
            os.close(descriptor)

    def _hung_up(self) -> bool:
        """Whether nothing to read means its end: a terminal without data says the same."""
        poll = select.poll()
        poll.register(self._descriptor, 0)
        return any(event & (select.POLLHUP | select.POLLERR | select.POLLNVAL) for _, event in poll.poll(0))

    def _lost(self, reason: str | None) -> PortLost:
        self.close()
        return PortLost(f"{self._device} is gone ({reason})")


def open_port(address: str) -> Port:
    """The port at `address`: a serial device (a by-id name is best), a pseudo-terminal, or `fake:`.

    A fake board has 64 pins, gpio0 and gpio1 taken; `fake:rp2040` and `fake:stm32` have the pins of such boards.
    Nothing is connected, but every driver chip that is asked for answers. PortError with the remedy.
    """
    if address.startswith(FAKE):
        make = FAKES.get(address.removeprefix(FAKE))
        if make is None:
            raise PortError(f"{address}: there is no such fake board; there are {', '.join(FAKE + k for k in FAKES)}")
        board = make()
        board.kept_log = board.machine.kept = False
        board.chips = Chips()
        return FakePort(board, address=address)
    return SerialPort(address)


class Found(NamedTuple):
    """What a board says of itself: `detent boards`."""

    address: str
    firmware: str
    mcu: str
    frequency: int
    move_count: int  # 0 where it is not configured
    pins: tuple[str, ...]
    reserved: dict[str, str]  # pins that the board needs itself, and what for
    missing: tuple[str, ...]  # commands that Detent needs and that this firmware has not


class Look:
    """A board that is asked what it is, and left as it was: told bytes and the time like `Board`."""

    def __init__(self, port: Port) -> None:
        self.port = port
        self._board = Board(BoardSetup("look"), only_look=True)

    def start(self, wall: WallNs) -> None:
        """Begin to ask."""
        self._board.start(wall)
        self._pump(wall)

    def turn(self, wall: WallNs) -> bool:
        """Read, write, and do what is due; whether it is over. PortLost."""
        data = self.port.receive(wall)
        if data:
            self._board.receive(data, wall)
        self._board.due(wall)
        self._pump(wall)
        return self._board.state in (State.SEEN, State.REFUSED, State.LOST)

    def deadline(self) -> WallNs | None:
        """When `turn` wants to be called."""
        times = [at for at in (self._board.deadline(), self.port.deadline()) if at is not None]
        return min(times, default=None)

    def _pump(self, wall: WallNs) -> None:
        data = self._board.take()
        if data:
            self.port.send(data, wall)

    @property
    def found(self) -> Found | None:
        """What it said; None if it is no board with such firmware, or has not said all."""
        board = self._board
        if board.state is not State.SEEN:
            return None
        words = board.core.dictionary
        return Found(self.port.address, words.version, words.mcu, words.frequency, board.left_with, words.pins,
                     words.reserved, tuple(words.missing(EVERYTHING)))  # fmt: skip


def candidates() -> list[str]:
    """Devices that call themselves boards with Klipper firmware, by their by-id names.

    Others are not asked: what is said to a board may mean something to whatever else is on a serial port.
    """
    return sorted(str(path) for path in BY_ID.iterdir() if "klipper" in path.name.lower()) if BY_ID.is_dir() else []
