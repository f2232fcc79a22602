"""What a host connects to, as people write it, and why it could not be opened, as people can mend it."""

import errno
from pathlib import Path
from typing import NamedTuple

from detent.realtime.endpoints.tcp import TcpAddress

CONNECT_SECONDS = 5.0  # how long the other side of a connection may take to answer
CLOSED = {
    "device": "the other end closed it, or it was unplugged",
    "tcp": "the other end closed it; it may serve one client at a time, and have one",
}
"""What an end that nobody asked for means, by the kind of address."""
TERMINALS = ("/dev/pts/", "/dev/ttys")  # pseudo-terminals of Linux, and of macOS


class PortError(OSError):
    """A port that cannot be opened as asked. The text says what is wrong and what to do."""


class Address(NamedTuple):
    """Where a port is: `kind` is device, tcp or rfc2217; `where` is a path, or HOST:PORT."""

    kind: str
    where: str

    @classmethod
    def parse(cls, text: str) -> "Address":
        """Read a device or a link to one, ``HOST:PORT``, or ``rfc2217://HOST:PORT``. Raises ValueError."""
        scheme, slashes, rest = text.partition("://")
        if slashes:
            kinds = {"rfc2217": "rfc2217", "tcp": "tcp", "socket": "tcp"}
            if scheme not in kinds:
                raise ValueError(f"{text!r}: write a device like /dev/ttyUSB0, HOST:PORT, or rfc2217://HOST:PORT")
            address = TcpAddress.parse(rest)
            if address.port == 0:
                raise ValueError(f"{text!r}: port 0 is no port to connect to")
            return cls(kinds[scheme], str(address))
        _, colon, port = text.rpartition(":")
        if colon and port.isdecimal() and "/" not in text and not Path(text).exists():
            return cls.parse(f"tcp://{text}")
        if not text:
            raise ValueError("say which port: a device like /dev/ttyUSB0, HOST:PORT, or rfc2217://HOST:PORT")
        return cls("device", text)

    @property
    def tcp(self) -> TcpAddress:
        """Host and port of what is no device."""
        return TcpAddress.parse(self.where)

    @property
    def formless(self) -> bool:
        """Whether the port has no character format of its own: raw TCP, or a pseudo-terminal."""
        if self.kind == "device":
            return str(Path(self.where).resolve()).startswith(TERMINALS)
        return self.kind == "tcp"

    def __str__(self) -> str:
        """As it is written."""
        return f"rfc2217://{self.where}" if self.kind == "rfc2217" else self.where


def port_error(address: Address, error: Exception) -> PortError:
    """What `error`, met when `address` was opened, says to people: what is wrong, and the remedy."""
    if isinstance(error, PortError):
        return error
    number = error.errno if isinstance(error, OSError) else next((a for a in error.args if isinstance(a, int)), None)
    reason = _device(address.where, number) if address.kind == "device" else _network(address, error, number)
    if not reason:
        reason = (getattr(error, "strerror", None) or str(error.args[-1] if error.args else error)).rstrip(".")
    return PortError(f"{address} cannot be opened: {reason}")


def _device(path: str, number: int | None) -> str:
    match number:
        case errno.ENOENT if Path(path).is_symlink():
            return f"the link leads to {Path(path).readlink()}, which is gone; is what made it still served?"
        case errno.ENOENT:
            return "there is no such device; detent find lists those that are there"
        case errno.EACCES | errno.EPERM:
            return f"no permission; add yourself to the group {_group(path)} (sudo usermod -aG) and log in again"
        case errno.EBUSY:
            return "it is in use; end the program that has it open"
        case errno.ENXIO | errno.ENODEV | errno.EIO:
            return "no device is behind it; plug it in"
        case errno.ENOTTY | errno.EINVAL | errno.EISDIR | errno.ENOTDIR:
            return "it is no serial device"
    return ""


def _network(address: Address, error: Exception, number: int | None) -> str:
    if isinstance(error, TimeoutError):
        if address.kind == "rfc2217":
            return f"no answer within {CONNECT_SECONDS:g} s; does RFC 2217 live there? Raw TCP is {address.where}"
        return f"no answer within {CONNECT_SECONDS:g} s; is the host up?"
    match number:
        case errno.ECONNREFUSED:
            return "nothing listens there; is the server started, and the port number right?"
        case errno.EHOSTUNREACH | errno.ENETUNREACH:
            return "the host cannot be reached"
    if address.kind == "rfc2217" and "closed by server" in str(error):  # serialx has no number for it
        return CLOSED["tcp"]
    return ""


def _group(path: str) -> str:
    """The group that may open a device; dialout where it cannot be told."""
    try:
        import grp

        name = grp.getgrgid(Path(path).stat().st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return "dialout"
    return "dialout" if name == "root" else name
