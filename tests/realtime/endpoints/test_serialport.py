import os
import pty
import select
import sys
import tty
from collections.abc import Iterator

import pytest
from tests.realtime.ticking import TickingCell, look

from detent.realtime.endpoints.endpoint import EndpointError, EndpointLost
from detent.realtime.endpoints.serialport import SerialPort
from detent.realtime.loop import Loop
from detent.realtime.pace import Pace
from detent.uart import Format

FORM = Format(9600, 7, "odd", 2)


class Wire:
    """A serial device of this computer, and the other end of its wire."""

    def __init__(self) -> None:
        self.end, self.device = pty.openpty()
        tty.setraw(self.device)
        self.path = os.ttyname(self.device)

    def cut(self) -> None:
        for descriptor in (self.end, self.device):
            if descriptor >= 0:
                os.close(descriptor)
        self.end = self.device = -1


@pytest.fixture
def wire() -> Iterator[Wire]:
    made = Wire()
    yield made
    made.cut()


def test_a_pseudo_terminal_in_its_place_can_be_opened_again_and_again(wire: Wire) -> None:
    """As socat makes them. Linux refuses 7 bits and parity there, which are nothing to bytes that never were bits."""
    for _ in range(3):
        SerialPort(wire.path, FORM).close()


def test_the_other_end_of_the_wire_is_answered(wire: Wire) -> None:
    port, cell = SerialPort(wire.path, FORM), TickingCell(None)
    loop = Loop(cell, Pace(), [(0, port)], wait=look)
    os.write(wire.end, b"F\r")
    while not select.select([wire.end], [], [], 0)[0]:
        loop.step()
    assert os.read(wire.end, 10) == b"F\r"
    assert (port.kind, port.address, port.dropped) == ("serial", wire.path, 0)
    loop.close()
    port.close()


def test_a_device_that_goes_away_ends_the_serving(wire: Wire) -> None:
    port = SerialPort(wire.path, FORM)
    loop = Loop(TickingCell(None), Pace(), [(0, port)], wait=look)
    wire.cut()
    with pytest.raises(EndpointLost, match="is gone; plug it in again and start anew"):
        loop.run()
    with pytest.raises(EndpointLost):
        port.send(b"R\r", 0)
    loop.close()
    port.close()


def test_a_device_that_is_not_there_is_an_error_with_a_remedy() -> None:
    with pytest.raises(
        EndpointError, match=r"/dev/nothing cannot be opened at 9600 7O2: No such file .*; name a serial"
    ):
        SerialPort("/dev/nothing", FORM)


def test_what_is_no_serial_device_is_an_error() -> None:
    with pytest.raises(EndpointError, match="/dev/null cannot be opened"):
        SerialPort("/dev/null", FORM)


def test_without_the_library_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serialx", None)
    with pytest.raises(EndpointError, match=r"--serial needs serialx, which is not installed: .*setup"):
        SerialPort("/dev/ttyS0", FORM)
