"""Where bytes of a board come from: a serial device, or a fake board in this process."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from detent.realtime.pace import WallNs


class PortError(OSError):
    """A port that cannot be opened; the text says why and what to do."""


class PortLost(OSError):
    """A port that went away."""


class Port(Protocol):
    """Bytes to and from a board. No call ever waits."""

    address: str

    def reading(self) -> Sequence[int]:
        """File descriptors to watch for something to read."""

    def writing(self) -> Sequence[int]:
        """File descriptors to watch for room to write."""

    def receive(self, wall: WallNs) -> bytes:
        """What has come; nothing where nothing has. PortLost."""

    def send(self, data: bytes, wall: WallNs) -> None:
        """Send `data`, now or when there is room. PortLost."""

    def flush(self) -> None:
        """There is room to write again. PortLost."""

    def deadline(self) -> WallNs | None:
        """When `receive` wants to be called though no descriptor says so: only of a board in this process."""

    def reopen(self) -> bool:
        """After PortLost: try to open it again; whether it is open."""

    def close(self) -> None:
        """Let go of it."""


def open_port(address: str) -> Port:
    """The port at `address`: a serial device (a by-id name is best), a pseudo-terminal, or `fake:` with options.

    PortError with the remedy.
    """
    raise NotImplementedError


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


def candidates() -> list[str]:
    """Serial devices of this computer that may be boards, by their by-id names."""
    raise NotImplementedError
