"""RFC 2217 as pyserial's and serialx's clients speak it, against a GS-C200 that is served."""

import asyncio
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import serial
import serialx
from tests.realtime.ticking import TickingCell, look

from detent.cell.description import single
from detent.lines.line import Heard
from detent.realtime.endpoints.rfc2217 import QUIET, Rfc2217Port
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.endpoints.tcp import TcpAddress
from detent.realtime.endpoints.telnet import COM_PORT, DO, DONT, ECHO, SUPPRESS_GO_AHEAD, WILL, negotiation, parameters
from detent.realtime.loop import Loop
from detent.realtime.pace import Pace
from detent.realtime.service import Service
from detent.uart import Char, Format

TIMEOUT = 20.0

# pyserial names its thread in a way that Python is giving up
pyserials = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")


@contextmanager
def served() -> Iterator[str]:
    """A GS-C200 behind RFC 2217: the URL."""
    endpoints = [EndpointSpec("rfc2217", "127.0.0.1:0")]
    with Service(single("gs-c200"), lambda file: "", endpoints, pace=20) as service, service.in_thread():
        yield f"rfc2217://{service.endpoints[0].address}"


def frame(text: str) -> bytes:
    """GS-C200 datasheet, "Checksum": the sum of the characters, 10h set, before the CR."""
    return (text + chr(sum(text.encode()) & 0x7F | 0x10) + "\r").encode()


@pyserials
def test_pyserial_is_answered_and_its_lines_are_looped_back() -> None:
    with served() as url, serial.serial_for_url(url, 9600, 7, "O", 2, timeout=TIMEOUT) as port:
        port.write(frame("F"))
        assert port.read_until(b"\r") == frame("R")
        assert (port.cts, port.dsr, port.cd, port.ri) == (True, True, True, False)


def with_parity(text: bytes) -> bytes:
    """Seven bits and odd parity, as eight bits without."""
    return bytes(value | (1 - value.bit_count() % 2) << 7 for value in text)


@pyserials
def test_a_client_of_another_format_is_not_understood_and_hears_garbage_until_it_sets_the_right_one() -> None:
    with served() as url, serial.serial_for_url(url, 9600, 8, "N", 1, timeout=TIMEOUT) as port:
        # the right bytes but for one, whose eighth bit is no parity bit; CR has three ones, so that its own is right
        port.write(frame("S50"))
        assert port.read_until(b"\r") == frame("E1"), "which happens to have no parity bit set"
        port.write(with_parity(frame("S50")))
        assert port.read_until(b"\r") == with_parity(frame("Y")) != frame("Y")
        port.bytesize, port.parity, port.stopbits, port.baudrate = 7, "O", 2, 19200
        port.write(frame("F"))  # nothing in it is a CR at half the rate
        port.baudrate = 9600
        port.write(b"\r")
        assert port.read_until(b"\r") == frame("E1"), "the garbage made the frame bad"
        port.write(frame("F"))
        assert port.read_until(b"\r") == frame("R")


@pyserials
def test_a_break_spoils_the_frame() -> None:
    """GS-C200 datasheet, "Error messages": E1, a framing error."""
    with served() as url, serial.serial_for_url(url, 9600, 7, "O", 2, timeout=TIMEOUT) as port:
        port.break_condition = True
        port.break_condition = False
        port.write(frame("F"))
        assert port.read_until(b"\r") == frame("E1")


def test_serialx_is_answered() -> None:
    with (
        served() as url,
        serialx.serial_for_url(url, 9600, byte_size=7, parity="O", stopbits=2, read_timeout=TIMEOUT) as port,
    ):
        port.write(frame("F"))
        assert port.readexactly(3) == frame("R")


def test_serialx_with_the_wrong_parity_hears_what_the_bits_are() -> None:
    with (
        served() as url,
        serialx.serial_for_url(url, 9600, byte_size=8, parity="N", stopbits=1, read_timeout=TIMEOUT) as port,
    ):
        port.write(frame("S50"))
        assert port.readexactly(4) == frame("E1")
        port.write(with_parity(frame("S50")))
        assert port.readexactly(3) == with_parity(frame("Y"))


def test_serialx_asks_without_blocking_and_clients_come_one_after_the_other() -> None:
    async def ask(url: str) -> bytes:
        reader, writer = await serialx.open_serial_connection(url, 9600, byte_size=7, parity="O", stopbits=2)
        writer.write(frame("F"))
        answer: bytes = await asyncio.wait_for(reader.readuntil(b"\r"), TIMEOUT)
        writer.close()
        await writer.wait_closed()
        return answer

    with served() as url:
        assert [asyncio.run(ask(url)) for _ in range(3)] == [frame("R")] * 3


class Bench:
    """A port, a cell that echoes, and a loop driven by hand."""

    def __init__(self, *, echoes: bool = False) -> None:
        self.port = Rfc2217Port(TcpAddress("127.0.0.1", 0), "drill", Format(9600), echoes=echoes)
        self.cell = TickingCell(None)
        self.loop = Loop(self.cell, Pace(), [(0, self.port)], wait=look)
        self.client = socket.create_connection(TcpAddress.parse(self.port.address))
        self.client.setblocking(False)

    def read(self, length: int) -> bytes:
        data = b""
        while len(data) < length:
            self.loop.step()
            try:
                data += self.client.recv(length - len(data))
            except BlockingIOError:
                continue
        return data

    def close(self) -> None:
        self.loop.close()
        self.port.close()
        self.client.close()


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.close()


def test_a_client_that_sets_nothing_has_the_format_of_the_line(bench: Bench) -> None:
    bench.client.sendall(b"V1\r\xff\xff")
    assert bench.read(5) == b"V1\r\xff\xff"
    ((_, _, chars),) = bench.cell.sent
    assert list(chars) == [Char(value) for value in b"V1\r\xff"]


def test_a_line_that_echoes_asks_a_telnet_for_each_character_and_not_to_show_it() -> None:
    """RFC 857, 858: with both a telnet sends what is typed at once, and shows only what comes back."""
    bench = Bench(echoes=True)
    assert bench.read(6) == negotiation(WILL, ECHO) + negotiation(WILL, SUPPRESS_GO_AHEAD)
    bench.client.sendall(negotiation(DO, ECHO) + negotiation(DO, SUPPRESS_GO_AHEAD) + b" ")
    assert bench.read(1) == b" "
    bench.close()


def test_a_client_that_wants_no_echo_is_served_all_the_same() -> None:
    bench = Bench(echoes=True)
    bench.read(6)
    bench.client.sendall(negotiation(DONT, ECHO) + negotiation(DONT, SUPPRESS_GO_AHEAD) + b"X\r")
    assert bench.read(2) == b"X\r"
    bench.close()


def test_what_a_slow_receiver_was_left_with_is_told_when_the_line_is_quiet(bench: Bench) -> None:
    bench.client.sendall(parameters(COM_PORT, b"\1" + (4800).to_bytes(4)))
    bench.read(10)
    bench.port.hear([Heard(1_041_667, Char(0))], 1_000)
    assert bench.port.deadline() == 1_000 + QUIET
    bench.port.due(1_000 + QUIET)
    assert bench.port.deadline() is None
    assert bench.read(1) == b"\xf8"


def test_the_next_client_begins_with_the_format_of_the_line_again(bench: Bench) -> None:
    bench.client.sendall(parameters(COM_PORT, b"\1" + (4800).to_bytes(4)))
    bench.read(10)
    bench.client.close()
    bench.client = socket.create_connection(TcpAddress.parse(bench.port.address))
    bench.client.setblocking(False)
    bench.client.sendall(b"V1\r")
    assert bench.read(3) == b"V1\r"


def test_a_second_client_is_told_so(bench: Bench) -> None:
    bench.client.sendall(b"F\r")
    bench.read(2)
    with socket.create_connection(TcpAddress.parse(bench.port.address)) as second:
        for _ in range(3):
            bench.loop.step()
        second.settimeout(TIMEOUT)
        assert b"drill is in use by" in second.recv(200)


def test_bytes_that_a_client_told_us_to_hold_for_too_long_are_counted_beyond_its_end(bench: Bench) -> None:
    bench.client.sendall(parameters(COM_PORT, b"\x08") + b"F")
    while not bench.cell.sent:
        bench.loop.step()
    bench.port.hear([Heard(0, Char(0))] * 5_000, 0)
    lost = bench.port.dropped
    assert lost > 0
    bench.client.close()
    bench.client = socket.create_connection(TcpAddress.parse(bench.port.address))
    bench.client.setblocking(False)
    bench.client.sendall(b"F")
    bench.read(1)
    assert bench.port.dropped == lost
