"""Endpoints as a cell file or the command line specifies them."""

from pathlib import Path
from typing import NamedTuple

from detent.one_line import one_line
from detent.realtime.endpoints.endpoint import Endpoint, EndpointError
from detent.realtime.endpoints.opened import Openings
from detent.realtime.endpoints.rfc2217 import Rfc2217Port
from detent.realtime.endpoints.serialport import SerialPort
from detent.realtime.endpoints.tcp import TcpAddress, TcpPort
from detent.realtime.endpoints.unsettling import Unsettling
from detent.realtime.system import termios
from detent.uart import Chars, Format

_LISTENING = ("tcp", "rfc2217")  # those that are a HOST:PORT


class EndpointSpec(NamedTuple):
    """An endpoint of some kind, and where: a link or nothing for a pty, HOST:PORT for tcp and rfc2217, a device."""

    kind: str
    where: str = ""

    @classmethod
    def usual(cls) -> "EndpointSpec":
        """Where nothing is asked for: a pseudo-terminal, or a free TCP port where the system has none."""
        return cls("pty") if termios is not None else cls("tcp", "127.0.0.1:0")

    @classmethod
    def parse(cls, text: str) -> "EndpointSpec":
        """Read pty, pty:LINK, tcp:HOST:PORT, rfc2217:HOST:PORT or serial:DEVICE. Raises ValueError."""
        kind, _, where = text.partition(":")
        if kind not in ("pty", *_LISTENING, "serial") or (kind != "pty" and not where):
            raise ValueError(
                f"{one_line(repr(text), 100)} is no endpoint; "
                "write pty, pty:LINK, tcp:HOST:PORT, rfc2217:HOST:PORT or serial:DEVICE"
            )
        return cls(kind, where).checked()

    def checked(self) -> "EndpointSpec":
        """Itself, if `where` can be understood. Raises ValueError."""
        if self.kind in _LISTENING:
            TcpAddress.parse(self.where)
        return self

    def of_several(self, number: int, name: str) -> "EndpointSpec":
        """The same for line `number`, called `name`, of several.

        A link gets the name appended; ports other than 0 count up. Raises ValueError if it cannot be shared out.
        """
        if self.kind == "pty" and self.where:
            return self._replace(where=f"{self.where}-{name}")
        if self.kind in _LISTENING:
            address = TcpAddress.parse(self.where)
            port = address.port and address.port + number
            if port > 65535:
                raise ValueError(f"{self.where}: no port is left for line {name}; begin lower, or use port 0")
            return self._replace(where=str(address._replace(port=port)))
        if self.kind == "serial":
            raise ValueError(
                f"{self.where} is one wire and the cell has several lines; "
                "give one of them endpoint = 'serial:DEVICE' in the cell file"
            )
        return self

    def open(
        self,
        name: str,
        form: Format,
        parting: Chars = b"",
        *,
        echoes: bool = False,
        openings: Openings | None = None,
        unsettling: Unsettling | None = None,
    ) -> Endpoint:
        """The endpoint, for the line `name` with characters of `form`. Raises EndpointError.

        `parting` is what the line hears when a client leaves, as far as that is seen. One that `echoes` sends back what
        is typed. Those of one loop may share `openings` and `unsettling`.
        """
        match self.kind:
            case "pty":
                if termios is None:
                    raise EndpointError("this system has no pseudo-terminals; take --tcp or --rfc2217 HOST:PORT")
                from detent.realtime.endpoints.pty import PseudoTerminal

                return PseudoTerminal(Path(self.where) if self.where else None, parting, openings, unsettling)
            case "tcp":
                return TcpPort(TcpAddress.parse(self.where), name, parting)
            case "rfc2217":
                return Rfc2217Port(TcpAddress.parse(self.where), name, form, parting, echoes=echoes)
            case _:
                return SerialPort(self.where, form)
