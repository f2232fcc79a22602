import asyncio
import contextlib
import errno
import os
import pty
import socket
import threading
import time
import tty
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest

from detent.hosts.errors import NoAnswer, PortLost
from detent.hosts.exchange import Asynchronous, Blocking, Clear, Driver, Steps, operation, until
from detent.realtime import ports
from detent.realtime.addresses import Address, PortError, port_error
from detent.realtime.async_ports import open_async_port
from detent.realtime.ports import open_port

EVERY_BYTE = bytes(range(256))  # XON, XOFF, NUL, CR, LF and DEL among them


class Terminal:
    """A pseudo-terminal; the test plays the device at its other end."""

    def __init__(self, link: Path) -> None:
        self.ours, self._theirs = pty.openpty()
        tty.setraw(self._theirs)
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(self._theirs))

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            data += os.read(self.ours, count - len(data))
        return data

    def write(self, data: bytes) -> None:
        os.write(self.ours, data)

    def vanish(self) -> None:
        """As an adapter does that is pulled out."""
        for descriptor in (self.ours, self._theirs):
            if descriptor >= 0:
                os.close(descriptor)
        self.ours = self._theirs = -1


@pytest.fixture
def link(tmp_path: Path) -> Path:
    return tmp_path / "stepper"


@pytest.fixture
def terminal(link: Path) -> Iterator[Terminal]:
    made = Terminal(link)
    yield made
    made.vanish()


class Listening:
    """A TCP port; the test plays the device behind it."""

    def __init__(self) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self.listener.getsockname()[1]}"
        self.client: socket.socket | None = None

    def accept(self) -> socket.socket:
        if self.client is not None:
            self.client.close()
        self.client, _ = self.listener.accept()
        return self.client

    def close(self) -> None:
        if self.client is not None:
            self.client.close()
        self.listener.close()


@pytest.fixture
def listening() -> Iterator[Listening]:
    made = Listening()
    yield made
    made.close()


class Unit(Driver):
    """A driver of one question."""

    title = "unit at a port"

    def __init__(self) -> None:
        self.forgot = 0

    def forget(self) -> None:
        self.forgot += 1

    @operation
    def question(self, text: bytes = b"F\r", timeout: float = 10.0) -> Steps[bytes]:
        """What is answered, to CR."""
        yield Clear()
        return (yield from self.ask(text, until(b"\r"), timeout))


class BlockingUnit(Blocking, Unit): ...


class AsyncUnit(Asynchronous, Unit): ...


@pytest.mark.parametrize(
    ("text", "kind", "where"),
    [
        ("/dev/ttyUSB0", "device", "/dev/ttyUSB0"),
        ("/dev/serial/by-path/usb-0:1:1.0", "device", "/dev/serial/by-path/usb-0:1:1.0"),
        ("127.0.0.1:4001", "tcp", "127.0.0.1:4001"),
        (":4001", "tcp", "127.0.0.1:4001"),
        ("[::1]:4001", "tcp", "[::1]:4001"),
        ("tcp://box:23", "tcp", "box:23"),
        ("socket://box:23", "tcp", "box:23"),
        ("rfc2217://box:23", "rfc2217", "box:23"),
    ],
)  # fmt: skip
def test_addresses_are_devices_tcp_or_rfc_2217(text: str, kind: str, where: str) -> None:
    assert Address.parse(text) == (kind, where)
    assert Address.parse(str(Address.parse(text))) == (kind, where)


@pytest.mark.parametrize("text", ["", "http://box:80", "rfc2217://box", "box:0", "box:99999", "tcp://"])
def test_what_is_no_address_is_refused_with_what_would_be_one(text: str) -> None:
    with pytest.raises(ValueError, match=r"HOST:PORT|port 0|host|127\.0\.0\.1"):
        Address.parse(text)


def test_a_pseudo_terminal_carries_every_byte_as_it_is(terminal: Terminal, link: Path) -> None:
    port = open_port(str(link), baud=9600, data_bits=7, parity="odd", stop_bits=2)
    port.write(EVERY_BYTE)
    assert terminal.read(256) == EVERY_BYTE
    terminal.write(EVERY_BYTE)
    came = b""
    while len(came) < 256:
        came += port.receive(10.0)
    assert came == EVERY_BYTE
    port.close()


def test_a_pseudo_terminal_has_no_format_and_takes_any_again_and_again(terminal: Terminal, link: Path) -> None:
    for _ in range(2):  # the system refuses 7O2 there the second time
        open_port(str(link), data_bits=7, parity="odd", stop_bits=2).close()

    async def again() -> None:
        await (await open_async_port(str(link), data_bits=7, parity="odd", stop_bits=2)).close()

    run(again)


def test_a_tcp_port_carries_every_byte_at_once(listening: Listening) -> None:
    port = open_port(listening.address)
    client = listening.accept()
    for part in (b"F", b"\x16", b"\r"):  # in parts, none waits for the other end to acknowledge the one before
        port.write(part)
    assert client.recv(3, socket.MSG_WAITALL) == b"F\x16\r"
    port.write(EVERY_BYTE)
    assert client.recv(256, socket.MSG_WAITALL) == EVERY_BYTE
    client.sendall(EVERY_BYTE)
    came = b""
    while len(came) < 256:
        came += port.receive(10.0)
    assert came == EVERY_BYTE
    port.close()
    assert client.recv(1) == b""


def test_what_was_kept_comes_first(terminal: Terminal, link: Path) -> None:
    port = open_port(str(link))
    port.keep(b"and later")
    port.keep(b"now ")
    terminal.write(b"last")
    assert port.receive(0.0) == b"now and later"
    assert port.receive(10.0) == b"last"
    assert port.receive(0.0) == b""
    port.close()


def test_time_counts_from_the_end_of_what_is_sent(terminal: Terminal, link: Path) -> None:
    port = open_port(str(link), baud=110, data_bits=7, parity="odd", stop_bits=2)
    before = port.clock()
    port.write(b"F\r")  # at 110 baud a character of 11 bits takes 0.1 s
    assert port.clock() >= before + 0.2
    assert port.receive(0.0) == b""  # a look does not wait for that
    assert port.receive(1e-9) == b""  # a time-out, however short, begins there
    assert time.monotonic() >= before + 0.2
    port.close()


@pytest.mark.parametrize("way", ["device", "tcp"])
def test_a_lost_port_raises_and_the_next_call_opens_it_again(way: str, link: Path, listening: Listening) -> None:
    terminal = Terminal(link)
    port = open_port(str(link) if way == "device" else listening.address)
    unit = BlockingUnit(Unit(), port)
    if way == "device":
        terminal.vanish()
    else:
        listening.accept().close()
    remedy = "unplugged" if way == "device" else "one client at a time"
    with pytest.raises(PortLost, match=f"unit at a port: the port is gone: .*{remedy}"):
        unit.question()
    assert unit.driver.forgot == 1
    if way == "device":
        with pytest.raises(PortLost, match=r"the link leads to .* which is gone"):
            unit.question()
        terminal = Terminal(link)
    port.write(b"x")
    if way == "device":
        assert terminal.read(1) == b"x"
        terminal.write(b"R\r")
    else:
        client = listening.accept()
        assert client.recv(1) == b"x"
        client.sendall(b"R\r")
    assert port.receive(10.0) == b"R\r"
    port.close()
    terminal.vanish()


def test_the_port_of_a_driver_can_be_closed_and_used_again(terminal: Terminal, link: Path) -> None:
    with BlockingUnit(Unit(), open_port(str(link))) as unit:
        unit.close()
        with pytest.raises(NoAnswer):
            unit.question(timeout=0.01)


def refusal(address: str) -> str:
    with pytest.raises(PortError) as raised:
        open_port(address)
    return str(raised.value)


def test_a_port_that_cannot_be_opened_says_what_to_do(terminal: Terminal, link: Path, tmp_path: Path) -> None:
    assert "there is no such device; detent find" in refusal("/dev/no-such-device")
    (tmp_path / "dangling").symlink_to("/dev/no-such-device")
    assert "the link leads to /dev/no-such-device, which is gone" in refusal(str(tmp_path / "dangling"))
    (tmp_path / "file").touch()
    assert "it is no serial device" in refusal(str(tmp_path / "file"))
    port = open_port(str(link))
    assert "it is in use; end the program" in refusal(str(link))
    port.close()
    open_port(str(link)).close()
    with socket.create_server(("127.0.0.1", 0)) as listener:
        number = listener.getsockname()[1]
    assert f"127.0.0.1:{number} cannot be opened: nothing listens there" in refusal(f"127.0.0.1:{number}")
    assert "nothing listens there" in refusal(f"rfc2217://127.0.0.1:{number}")


def test_whoever_may_not_open_a_device_is_told_the_group() -> None:
    denied = PermissionError(errno.EACCES, "Permission denied")
    text = str(port_error(Address("device", "/dev/no-such-device"), denied))
    assert text.endswith("no permission; add yourself to the group dialout (sudo usermod -aG) and log in again")


@pytest.mark.parametrize("says", [b"x" * 4096, b"\r\n", bytes((255, 250, 44)) + b"\xff\xff" * 999, b"\xff\xfd\x00"])
def test_who_says_something_else_all_the_time_is_no_port_of_another_computer(
    says: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ports, "CONNECT_SECONDS", 0.5)
    gone = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def babble() -> None:
            client, _ = listener.accept()
            with client, contextlib.suppress(OSError):
                while not gone.wait(0.002):
                    client.sendall(says)

        thread = threading.Thread(target=babble)
        thread.start()
        try:
            assert "does RFC 2217 live there?" in refusal(f"rfc2217://127.0.0.1:{listener.getsockname()[1]}")
        finally:
            gone.set()
            thread.join()


def test_where_rfc_2217_is_not_spoken_the_raw_address_is_named() -> None:
    text = str(port_error(Address("rfc2217", "box:4001"), TimeoutError()))
    assert text.endswith("no answer within 5 s; does RFC 2217 live there? Raw TCP is box:4001")
    assert str(port_error(Address("tcp", "box:4001"), TimeoutError())).endswith("is the host up?")


def test_a_device_that_takes_nothing_is_lost_and_nobody_waits_for_ever(
    terminal: Terminal, link: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("detent.realtime.ports.STALLED_SECONDS", 0.01)
    port = open_port(str(link))
    with pytest.raises(OSError, match="took nothing"):
        port.write(bytes(1_000_000))
    port.close()


# -- coroutines ------------------------------------------------------------------------------------------


def run(coroutine: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(asyncio.wait_for(coroutine(), 60))


def test_coroutines_have_the_same_ports(terminal: Terminal, link: Path, listening: Listening) -> None:
    async def both() -> None:
        port = await open_async_port(str(link), baud=9600, data_bits=7, parity="odd", stop_bits=2)
        await port.write(EVERY_BYTE)
        assert terminal.read(256) == EVERY_BYTE
        terminal.write(EVERY_BYTE)
        came = b""
        while len(came) < 256:
            came += await port.receive(10.0)
        assert came == EVERY_BYTE
        assert await port.receive(0.0) == b""
        terminal.write(b"more")
        port.keep(b"first")
        assert await port.receive(0.0) == b"first"
        assert await port.receive(10.0) == b"more"
        before = port.clock()
        await port.wait(0.001)
        assert port.clock() >= before + 0.001
        await port.close()

        port = await open_async_port(listening.address)
        client = listening.accept()
        await port.write(b"F\r")
        assert client.recv(2, socket.MSG_WAITALL) == b"F\r"
        client.sendall(b"R\r")
        assert await port.receive(10.0) == b"R\r"
        await port.close()
        assert client.recv(1) == b""

    run(both)


def test_what_has_come_is_found_by_a_look_that_does_not_wait(terminal: Terminal, link: Path) -> None:
    async def look() -> None:
        port = await open_async_port(str(link))
        terminal.write(b"stale")
        while not (came := await port.receive(0.0)):
            pass
        assert came == b"stale"
        await port.close()

    run(look)


@pytest.mark.parametrize("way", ["device", "tcp"])
def test_a_coroutine_finds_a_lost_port_opened_again(way: str, link: Path, listening: Listening) -> None:
    async def lose() -> None:
        terminal = Terminal(link)
        port = await open_async_port(str(link) if way == "device" else listening.address)
        unit = AsyncUnit(Unit(), port)
        if way == "device":
            terminal.vanish()
        else:
            listening.accept().close()
        remedy = "device disconnected" if way == "device" else "one client at a time"
        with pytest.raises(PortLost, match=f"unit at a port: the port is gone: .*{remedy}"):
            await unit.question()
        assert unit.driver.forgot == 1
        if way == "device":
            with pytest.raises(PortLost, match=r"the link leads to .* which is gone"):
                await unit.question()
            terminal = Terminal(link)
        await port.write(b"x")
        if way == "device":
            assert terminal.read(1) == b"x"
        else:
            assert listening.accept().recv(1) == b"x"
        await unit.close()
        terminal.vanish()

    run(lose)


def test_a_coroutine_is_told_as_well_why_a_port_cannot_be_opened(link: Path, terminal: Terminal) -> None:
    async def refused() -> None:
        for address, reason in (("/dev/no-such-device", "no such device"), ("/dev/null", "no serial device")):
            with pytest.raises(PortError, match=reason):
                await open_async_port(address)
        port = await open_async_port(str(link))
        with pytest.raises(PortError, match="in use"):
            await open_async_port(str(link))
        await port.close()

    run(refused)
