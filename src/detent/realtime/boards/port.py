"""What a wire to a board is: bytes both ways, without ever waiting."""

from collections.abc import Sequence
from typing import Protocol

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
