"""Connections of the web server: whoever keeps a place without saying what he wants, or takes no answer, leaves it."""

import asyncio
from typing import Any, ClassVar, Final

from uvicorn.protocols.http.auto import AutoHTTPProtocol

QUIET: Final = 10.0  # seconds in which a client has to say what it wants
MOST: Final = 256  # connections at once that are no open windows; one more takes the place of the slowest

_Protocol: Any = AutoHTTPProtocol


class LimitedConnection(_Protocol):  # type: ignore[misc]
    """A connection of uvicorn with patience. A WebSocket, which has passed the guard, is left alone."""

    open: ClassVar["dict[LimitedConnection, None]"] = {}  # of this process, the oldest first

    def connection_made(self, transport: asyncio.Transport) -> None:
        """A client has come."""
        super().connection_made(transport)
        if len(self.open) >= MOST:
            slowest = next((one for one in self.open if not one.asked), next(iter(self.open)))
            slowest.leave()
        self.open[self] = None
        self._hurry: asyncio.TimerHandle | None = asyncio.get_running_loop().call_later(QUIET, self._too_slow)

    def data_received(self, data: bytes) -> None:
        """It says something."""
        super().data_received(data)
        if self.asked or self._upgraded:
            self._stop()
            if self._upgraded:
                self.open.pop(self, None)
        elif self._hurry is None:
            self._hurry = asyncio.get_running_loop().call_later(QUIET, self._too_slow)

    def connection_lost(self, exc: Exception | None) -> None:
        """It has left."""
        self._stop()
        self.open.pop(self, None)
        super().connection_lost(exc)

    @property
    def asked(self) -> bool:
        """Whether a whole request waits for its answer."""
        return self.cycle is not None and not self.cycle.response_complete

    @property
    def _upgraded(self) -> bool:
        return self.transport.get_protocol() is not self

    def _stop(self) -> None:
        if self._hurry is not None:
            self._hurry.cancel()
            self._hurry = None

    def _too_slow(self) -> None:
        self._hurry = None
        if not self.asked and not self._upgraded:
            self.leave()

    def leave(self) -> None:
        """Its place is another's."""
        self.open.pop(self, None)
        self.transport.abort()
