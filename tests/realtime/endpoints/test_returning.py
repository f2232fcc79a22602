"""A serial port that goes away and comes back: its cell goes on, and people are told once each."""

import os
import pty
from pathlib import Path

import pytest

from detent.realtime.endpoints.endpoint import EndpointError
from detent.realtime.endpoints.returning import TRY_EVERY, Returning
from detent.realtime.endpoints.serialport import SerialPort
from detent.uart import Format


class Adapter:
    """A pseudo-terminal under a name that stays, as an adapter has one in by-id."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.plug()

    def plug(self) -> None:
        self.host, theirs = pty.openpty()
        self.link.symlink_to(os.ttyname(theirs))
        self._theirs = theirs

    def pull(self) -> None:
        self.link.unlink()
        os.close(self.host)
        os.close(self._theirs)


def test_it_goes_and_comes_back(tmp_path: Path) -> None:
    adapter, told = Adapter(tmp_path / "wire"), []
    port = Returning(lambda: SerialPort(str(adapter.link), Format(9600, 8, "none", 1)), told.append)
    os.write(adapter.host, b"V\r")
    [descriptor] = port.reading(True)
    assert port.receive(descriptor, 0) == b"V\r"
    adapter.pull()
    assert port.receive(descriptor, 1) == b""
    assert (port.reading(True), port.writing()) == ((), ())
    port.send(b"lost", 2)
    assert port.dropped == 4
    assert port.receive(descriptor, 2) == b"", "an event of before"
    port.due(3)
    assert port.deadline() == 3 + TRY_EVERY
    port.due(4)
    assert len(told) == 1, told
    assert "is gone, and the cell goes on; plug it in again" in told[0]
    adapter.plug()
    port.due(5)
    [descriptor] = port.reading(True)
    os.write(adapter.host, b"Z\r")
    assert port.receive(descriptor, 6) == b"Z\r"
    port.send(b"Y\r", 6)
    assert os.read(adapter.host, 10) == b"Y\r"
    assert told[1:] == [f"{adapter.link} is there again"]
    port.close()


def test_one_that_is_not_there_at_first_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(EndpointError, match="cannot be opened"):
        Returning(lambda: SerialPort(str(tmp_path / "wire"), Format(9600, 8, "none", 1)), print)
