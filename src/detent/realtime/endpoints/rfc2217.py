"""A serial port over TCP (RFC 2217): clients set its baud rate and format, and hear garbage if these do not fit."""

from collections.abc import Sequence

from detent.lines.line import Heard
from detent.realtime.endpoints.comport import ComPort
from detent.realtime.endpoints.tcp import TcpAddress, TcpPort
from detent.realtime.pace import WallNs
from detent.ticks import MS
from detent.uart import Chars, Format

QUIET: WallNs = 50 * MS  # a client that reads in another format is told what its UART was left with so long after


class Rfc2217Port(TcpPort):
    """A listening port for the line `name` with characters of `form`; clients come and go as at a `TcpPort`.

    Each client begins with the format of the line.
    """

    kind = "rfc2217"

    def __init__(
        self, address: TcpAddress, name: str, form: Format, parting: Chars = b"", *, echoes: bool = False
    ) -> None:
        """`echoes`: the line sends back what is typed, so a plain telnet need not show it, nor keep it until Enter.

        Raises EndpointError if the port cannot be had.
        """
        super().__init__(address, name, parting)
        self._echoes = echoes
        self._form = form
        self._lost_before = 0  # by earlier clients
        self._port = ComPort(form, name, echoes=echoes)
        self._idle_at: WallNs | None = None

    @property
    def dropped(self) -> int:
        """Bytes that were lost because a client did not read them, or told us to hold them for too long."""
        return super().dropped + self._lost_before + self._port.dropped

    def deadline(self) -> WallNs | None:
        """When a client that has said everything goes, or the line counts as quiet."""
        return min((at for at in (super().deadline(), self._idle_at) if at is not None), default=None)

    def due(self, wall: WallNs) -> None:
        """One of both."""
        if self._idle_at is not None and self._idle_at <= wall:
            self._idle_at = None
            self.send(self._port.idle(), wall)
        leaves = super().deadline()
        if leaves is not None and leaves <= wall:
            super().due(wall)

    def hear(self, heard: Sequence[Heard], wall: WallNs) -> None:
        """The client hears what its UART makes of the line."""
        if self._client is None:
            return
        self.send(self._port.hear(heard), wall)
        self._idle_at = wall + QUIET if self._port.waits else None

    def _begin(self) -> None:
        self._lost_before += self._port.dropped
        self._port = ComPort(self._form, self._name, echoes=self._echoes)
        self._idle_at = None
        if self._echoes:
            self._outgoing.send(self._port.offer_echo())

    def _understood(self, data: bytes, wall: WallNs) -> Chars:
        chars, answer = self._port.receive(data)
        self.send(answer, wall)
        return chars
