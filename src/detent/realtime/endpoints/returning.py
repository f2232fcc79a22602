"""A serial port whose adapter may be pulled out and plugged in again while the cell at its other end goes on."""

import contextlib
from collections.abc import Callable, Sequence

from detent.realtime.endpoints.endpoint import Endpoint, EndpointError, EndpointLost
from detent.realtime.pace import WallNs
from detent.ticks import MS
from detent.uart import Chars

TRY_EVERY: WallNs = 500 * MS


class Returning:
    """The endpoint that `again` opens; while it is gone its line has a host that says and hears nothing."""

    def __init__(self, again: Callable[[], Endpoint], tell: Callable[[str], None]) -> None:
        """Opens it. `tell` is told once when it is gone, and when it is there again. Raises EndpointError."""
        self._again, self._tell = again, tell
        first = again()
        self._endpoint: Endpoint | None = first
        self.kind, self.address = first.kind, first.address
        self._dropped = 0
        self._try_at: WallNs = 0

    @property
    def dropped(self) -> int:
        """Bytes that the device did not take, those that were said while it was gone among them."""
        return self._dropped + (0 if self._endpoint is None else self._endpoint.dropped)

    def reading(self, room: bool) -> Sequence[int]:
        """The device, while it is there and the line has room."""
        return () if self._endpoint is None else self._endpoint.reading(room)

    def writing(self) -> Sequence[int]:
        """The device, while it is there and bytes wait."""
        return () if self._endpoint is None else self._endpoint.writing()

    def deadline(self) -> WallNs | None:
        """When to look whether it is back."""
        return self._try_at if self._endpoint is None else self._endpoint.deadline()

    def due(self, wall: WallNs) -> None:
        """Look whether it is back."""
        if self._endpoint is not None:
            self._endpoint.due(wall)
            return
        try:
            self._endpoint = self._again()
        except EndpointError:
            self._try_at = wall + TRY_EVERY
        else:
            self._tell(f"{self.address} is there again")

    def receive(self, descriptor: int, wall: WallNs) -> Chars:
        """What came; nothing from one that is gone."""
        if self._endpoint is None:
            return b""
        try:
            return self._endpoint.receive(descriptor, wall)
        except EndpointLost:
            self._gone()
            return b""

    def send(self, data: bytes, wall: WallNs) -> None:
        """Put `data` on the wire; nobody hears it while it is gone."""
        if self._endpoint is None:
            self._dropped += len(data)
            return
        try:
            self._endpoint.send(data, wall)
        except EndpointLost:
            self._dropped += len(data)
            self._gone()

    def flush(self) -> None:
        """There is room again."""
        if self._endpoint is not None:
            try:
                self._endpoint.flush()
            except EndpointLost:
                self._gone()

    def close(self) -> None:
        """Give the device back."""
        if self._endpoint is not None:
            self._endpoint.close()

    def _gone(self) -> None:
        lost, self._endpoint = self._endpoint, None
        assert lost is not None
        self._dropped += lost.dropped
        with contextlib.suppress(OSError):  # it is gone already
            lost.close()
        self._try_at = 0
        self._tell(f"{self.address} is gone, and the cell goes on; plug it in again, and its host is heard as before")
