import contextlib
import os
import select
import socket
import struct
from collections.abc import Callable, Iterator
from itertools import product

import pytest
from tests.realtime.ticking import Client, TickingCell, look

from detent.realtime.endpoints.endpoint import MOST_READ, MOST_WAITING, EndpointError
from detent.realtime.endpoints.tcp import LINGER, TcpAddress, TcpPort
from detent.realtime.loop import Loop
from detent.realtime.pace import Pace
from detent.uart import Char, Chars


class Bench:
    """A port, a cell that echoes, and a loop driven by hand."""

    def __init__(self, host: str = "127.0.0.1", parting: Chars = b"") -> None:
        self.port = TcpPort(TcpAddress(host, 0), "drill", parting)
        self.cell = TickingCell(None, lines=2)
        self.beside = Client()  # on the other line
        self.loop = Loop(self.cell, Pace(), [(0, self.port), (1, self.beside)], wait=look)
        self.clients: list[socket.socket] = []

    def connect(self) -> socket.socket:
        """A client that has been let in, or sent away."""
        address = TcpAddress.parse(self.port.address)
        client = socket.create_connection(address)
        client.setblocking(False)
        self.clients.append(client)
        self.step_until(lambda: not select.select([self.listener], [], [], 0)[0])
        return client

    @property
    def listener(self) -> int:
        return self.port.reading(False)[0]

    @property
    def connected(self) -> bool:
        return len(self.port.reading(True)) == 2

    def step_until(self, done: Callable[[], object]) -> None:
        while not done():
            self.loop.step()

    def exchange(self, client: socket.socket, text: bytes) -> None:
        client.sendall(text)
        assert self.read(client, len(text)) == text

    def read(self, client: socket.socket, length: int) -> bytes:
        data = b""
        while len(data) < length:
            self.loop.step()
            with contextlib.suppress(BlockingIOError):
                more = client.recv(length - len(data))
                if not more:
                    break
                data += more
        return data

    def close(self) -> None:
        self.loop.close()
        self.port.close()
        for client in self.clients:
            client.close()


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.close()


def reset(client: socket.socket) -> None:
    """Leave without a word."""
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()


def everything(client: socket.socket) -> bytes:
    """What a client reads until the end."""
    client.setblocking(True)
    data = b""
    while more := client.recv(4096):
        data += more
    return data


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "localhost"])
def test_a_client_is_answered(host: str) -> None:
    try:
        bench = Bench(host)
    except EndpointError:
        assert host == "::1", "only IPv6 may be missing on a computer"
        pytest.skip("this computer has no IPv6")
    bench.exchange(bench.connect(), b"V1\x17\r\x80\xff\n")
    bench.close()


def test_clients_come_one_after_the_other(bench: Bench) -> None:
    for text in (b"one\r", b"two\r", b"three\r"):
        client = bench.connect()
        bench.exchange(client, text)
        client.close()
        bench.step_until(lambda: not bench.connected)
    assert bench.cell.got() == b"one\rtwo\rthree\r"


def test_a_second_client_is_told_so_and_the_first_goes_on(bench: Bench) -> None:
    first = bench.connect()
    bench.exchange(first, b"F\r")
    second = bench.connect()
    host, port = first.getsockname()
    told = everything(second).decode()
    assert told == f"detent: drill is in use by {host}:{port}; one client at a time, try again later\r\n"
    bench.exchange(first, b"F\r")
    assert bench.cell.got() == b"F\rF\r"


def test_a_client_that_leaves_inside_a_frame_makes_room_for_the_next(bench: Bench) -> None:
    client = bench.connect()
    client.sendall(b"G+5")
    client.close()
    bench.step_until(lambda: bench.cell.got() == b"G+5")
    bench.exchange(bench.connect(), b"\r")


def test_a_reset_connection_makes_room_for_the_next(bench: Bench) -> None:
    client = bench.connect()
    bench.exchange(client, b"F\r")
    reset(client)
    bench.step_until(lambda: not bench.connected)
    bench.exchange(bench.connect(), b"F\r")


def test_a_reset_that_shows_in_writing_makes_room_for_the_next(bench: Bench) -> None:
    reset(bench.connect())
    bench.step_until(lambda: bench.port.send(b"R\r", 0) or not bench.connected)
    bench.exchange(bench.connect(), b"F\r")


def test_a_client_that_has_said_everything_gets_its_answer_and_then_the_end(bench: Bench) -> None:
    client = bench.connect()
    client.sendall(b"V1\r")
    client.shutdown(socket.SHUT_WR)
    assert bench.read(client, 3) == b"V1\r"
    bench.step_until(lambda: bench.port.deadline() is not None)
    deadline = bench.port.deadline()
    bench.port.send(b"more\r", deadline - 1)
    assert bench.port.deadline() == deadline - 1 + LINGER, "an answer gives it time for the next one"
    bench.port.due(deadline - 1 + LINGER)
    assert everything(client) == b"more\r"
    assert bench.port.deadline() is None


def test_a_client_that_has_said_everything_makes_room_for_the_next_at_once(bench: Bench) -> None:
    client = bench.connect()
    client.shutdown(socket.SHUT_WR)
    bench.step_until(lambda: bench.port.deadline() is not None)
    bench.exchange(bench.connect(), b"F\r")
    assert everything(client) == b""


def test_a_flood_is_taken_in_small_portions_and_others_are_served_between_them(bench: Bench) -> None:
    client = bench.connect()
    flood = bytes(range(256)) * 200
    sent = received = 0
    while received < len(flood):
        with contextlib.suppress(BlockingIOError):
            sent += client.send(flood[sent:])
        bench.loop.step()
        with contextlib.suppress(BlockingIOError):
            received += len(client.recv(65536))
    assert bench.cell.got() == flood
    assert max(len(data) for _, _, data in bench.cell.sent) <= MOST_READ


def test_nothing_is_read_while_the_line_is_behind_and_nothing_is_lost(bench: Bench) -> None:
    client = bench.connect()
    bench.cell.lines[0].host_busy_until = 1 << 90
    client.sendall(b"F\r")
    for _ in range(3):
        bench.loop.step()
    assert bench.cell.got() == b""
    bench.cell.lines[0].host_busy_until = 0
    assert bench.read(client, 2) == b"F\r"


def test_a_client_that_left_while_the_line_was_behind_makes_room_for_the_next(bench: Bench) -> None:
    for said, leave in product((b"", b"F\r" * 10_000), (socket.socket.close, reset)):
        client = bench.connect()
        bench.cell.lines[0].host_busy_until = 1 << 90
        with contextlib.suppress(BlockingIOError):  # as much as the systems between take
            client.sendall(said)
        leave(client)
        following = bench.connect()
        bench.cell.lines[0].host_busy_until = 0
        bench.exchange(following, b"F\r")
        following.close()
        bench.step_until(lambda: not bench.connected)


def test_a_client_that_does_not_read_loses_the_oldest_bytes_and_stops_nobody(bench: Bench) -> None:
    client = bench.connect()
    told = 0
    while not bench.port.dropped:
        bench.port.send(b"%07d\r" % told * 100, 0)
        told += 1
    assert told * 800 > MOST_WAITING
    data = b""
    while not data.endswith(b"%07d\r" % (told - 1)):
        bench.port.flush()
        with contextlib.suppress(BlockingIOError):
            data += client.recv(65536)
    assert len(data) == told * 800 - bench.port.dropped
    assert not bench.port.writing()


def test_without_a_client_nobody_is_told_anything(bench: Bench) -> None:
    bench.port.send(b"R\r", 0)
    client = bench.connect()
    bench.exchange(client, b"F\r")
    assert bench.port.dropped == 0


def test_a_client_that_vanished_is_noticed_by_the_system(bench: Bench) -> None:
    bench.connect()
    kept = socket.socket(fileno=socket.dup(bench.port.reading(True)[0]))
    assert kept.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
    assert kept.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
    kept.close()


def test_a_port_in_use_is_an_error_with_a_remedy(bench: Bench) -> None:
    with pytest.raises(EndpointError, match="cannot be listened on: Address already in use; choose another port, or 0"):
        TcpPort(TcpAddress.parse(bench.port.address), "other")


def test_a_host_that_is_not_here_is_an_error_with_a_remedy() -> None:
    with pytest.raises(EndpointError, match=r"192\.0\.2\.1:0 cannot be listened on: .*"):
        TcpPort(TcpAddress("192.0.2.1", 0), "drill")
    with pytest.raises(EndpointError, match=r"no such host here: .*; try 127\.0\.0\.1"):
        TcpPort(TcpAddress("no host.invalid", 0), "drill")


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("127.0.0.1:4001", "127.0.0.1", 4001),
        ("[::1]:0", "::1", 0),
        ("localhost:65535", "localhost", 65535),
        (":4001", "127.0.0.1", 4001),
    ],
)
def test_an_address_is_read_as_it_is_written(text: str, host: str, port: int) -> None:
    address = TcpAddress.parse(text)
    assert address == (host, port)
    assert str(address) == (f"127.0.0.1{text}" if text.startswith(":") else text)


@pytest.mark.parametrize("text", ["", "4001", "host", "host:", "host:x", "host:-1", "host:65536", "::1:4001", "h:٣"])
def test_what_is_no_address_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(ValueError, match=r"is no HOST:PORT; write 127\.0\.0\.1:4001"):
        TcpAddress.parse(text)


def test_closing_twice_does_no_harm() -> None:
    port = TcpPort(TcpAddress("127.0.0.1", 0), "drill")
    listening = port.reading(True)
    port.close()
    port.close()
    for descriptor in listening:
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(descriptor)


def test_a_line_to_which_it_means_something_hears_once_that_a_client_has_left() -> None:
    gone = (Char(0, framing_ok=False),)
    bench = Bench(parting=gone)
    try:
        silent = bench.connect()
        reset(silent)
        bench.step_until(lambda: not bench.connected)
        bench.exchange(bench.connect(), b"\x01\x01")
        bench.clients[-1].shutdown(socket.SHUT_WR)
        bench.step_until(lambda: bench.port.deadline() is not None)
        bench.exchange(bench.connect(), b"\x02")
        reset(bench.clients[-1])
        bench.step_until(lambda: not bench.connected)
        bench.exchange(bench.connect(), b"\x03")
        assert [data for _, _, data in bench.cell.sent] == [b"\x01\x01", gone, b"\x02", gone, b"\x03"]
    finally:
        bench.close()
