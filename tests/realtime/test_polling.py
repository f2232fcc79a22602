"""Waiting for descriptors: the same for few and many, and a refusal before anything is told where there are too few."""

import errno
import fcntl
import os
import resource
import socket
from collections.abc import Iterator
from random import Random

import pytest
from tests.realtime.ticking import TickingCell, look

from detent.cell.description import parse
from detent.realtime import polling
from detent.realtime.endpoints.endpoint import EndpointError
from detent.realtime.endpoints.opened import Openings
from detent.realtime.endpoints.pty import PseudoTerminal
from detent.realtime.endpoints.tcp import DEAF, TcpAddress, TcpPort
from detent.realtime.loop import Loop
from detent.realtime.pace import Pace
from detent.realtime.service import Service

LARGE = polling.FEW + 300


@pytest.fixture
def many() -> Iterator[None]:
    """This process may have large descriptors."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    polling.allow_many()
    if resource.getrlimit(resource.RLIMIT_NOFILE)[0] <= LARGE + 100:
        pytest.skip("the system gives this process no descriptors from 1024 on")
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


def pairs(count: int, *, large: bool) -> list[tuple[int, int]]:
    """Connected sockets, with large descriptors on request."""
    made = []
    for _ in range(count):
        for end in (ends := socket.socketpair()):
            end.setblocking(False)
        numbers = [end.detach() for end in ends]
        if large:
            moved = [fcntl.fcntl(number, fcntl.F_DUPFD_CLOEXEC, LARGE) for number in numbers]
            for number in numbers:
                os.close(number)
            numbers = moved
        made.append((numbers[0], numbers[1]))
    return made


@pytest.mark.parametrize("seed", range(20))
def test_many_descriptors_are_waited_for_as_few_are(many: None, seed: int) -> None:
    """What is ready is the same, whatever happened at the other end."""
    random = Random(seed)
    few, large = pairs(6, large=False), pairs(6, large=True)
    for number in range(6):
        action = random.choice(("nothing", "said", "gone", "full", "said and gone"))
        for mine, other in (few[number], large[number]):
            if "said" in action:
                os.write(other, b"x")
            if action == "full":
                try:
                    while True:
                        os.write(mine, b"x" * 65536)
                except BlockingIOError:
                    pass
            if "gone" in action:
                with socket.socket(fileno=os.dup(other)) as shut:
                    shut.shutdown(socket.SHUT_RDWR)
    reading = [number for number in range(6) if random.random() < 0.8]
    writing = [number for number in range(6) if random.random() < 0.6]
    found = []
    for ends in (few, large):
        mine = [pair[0] for pair in ends]
        readable, writable, _ = polling.wait([mine[n] for n in reading], [mine[n] for n in writing], (), 0.0)
        found.append((sorted(map(mine.index, readable)), sorted(map(mine.index, writable))))
    for one, other in few + large:
        os.close(one)
        os.close(other)
    assert found[0] == found[1]


def test_a_sleep_of_less_than_a_millisecond_is_none_rather_than_too_long(
    many: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    slept: list[int | None] = []

    class Poll:
        def register(self, descriptor: int, events: int) -> None:
            pass

        def poll(self, milliseconds: int | None) -> list[tuple[int, int]]:
            slept.append(milliseconds)
            return []

    monkeypatch.setattr(polling.select, "poll", Poll)
    for timeout in (0.0, 0.0009, 0.0019, 3.99, None):
        assert polling.wait([LARGE], [], (), timeout) == ([], [], [])
    assert slept == [0, 0, 1, 3990, None]


def test_a_loop_serves_endpoints_with_large_descriptors(many: None) -> None:
    pad = [fcntl.fcntl(0, fcntl.F_DUPFD_CLOEXEC, 0) for _ in range(polling.FEW)]
    terminal, cell = PseudoTerminal(), TickingCell(None)
    loop = Loop(cell, Pace(), [(0, terminal)])
    for one in pad:
        os.close(one)
    assert terminal.reading(True)[-1] >= polling.FEW
    client = os.open(terminal.address, os.O_RDWR | os.O_NOCTTY)
    os.write(client, b"F\r")
    while cell.got() != b"F\r":
        loop.step()
    os.close(client)
    loop.close()
    terminal.close()


def test_who_comes_and_goes_is_told_to_every_terminal_that_shares_the_telling() -> None:
    openings = Openings()
    terminals = [PseudoTerminal(openings=openings) for _ in range(3)]
    assert len({terminal.reading(False) for terminal in terminals}) == 1, "one descriptor for all"
    cell = TickingCell(None, lines=3)
    loop = Loop(cell, Pace(), list(enumerate(terminals)), wait=look)
    stays, client = (os.open(terminals[n].address, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK) for n in (0, 1))
    for terminal in terminals:
        terminal.send(b"who hears this", 0)
    os.close(client)
    loop.step()
    client = os.open(terminals[1].address, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    with pytest.raises(BlockingIOError):
        os.read(client, 100)  # what was said to the one before is not for the next
    assert os.read(stays, 100) == b"who hears this"
    os.close(client)
    os.close(stays)
    loop.close()
    for terminal in terminals:
        terminal.close()
    assert openings.descriptor == -1


def test_a_cell_for_which_there_are_too_few_descriptors_is_refused_with_the_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And what was opened before is closed again."""
    units = "".join(f'[units.u{n}]\nmodel = "gs-c200"\nstraps = {{ CHS = "low" }}\n' for n in range(5))
    opened: list[int] = []
    openpty = os.openpty

    def few() -> tuple[int, int]:
        if len(opened) == 6:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        made = openpty()
        opened.extend(made)
        return made

    monkeypatch.setattr(os, "openpty", few)
    with pytest.raises(EndpointError, match=r"no more open files: raise the limit \(ulimit -n\), or serve fewer lines"):
        Service(parse(units, "five.toml"), lambda name: name)
    for descriptor in opened:
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(descriptor)


def test_a_client_for_whom_there_is_no_descriptor_stays_at_the_door_and_nobody_looks_again_and_again() -> None:
    class Full:
        """A listening socket that has somebody at the door, and no descriptor for him at first."""

        def __init__(self, listener: socket.socket) -> None:
            self.listener, self.room = listener, False

        def fileno(self) -> int:
            return self.listener.fileno()

        def accept(self) -> object:
            if not self.room:
                raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
            return self.listener.accept()

        def close(self) -> None:
            self.listener.close()

    port = TcpPort(TcpAddress("127.0.0.1", 0), "drill")
    full = port._listener = Full(port._listener)  # type: ignore[assignment]
    client = socket.create_connection(TcpAddress.parse(port.address))
    (listening,) = port.reading(True)
    assert port.receive(listening, 5) == b""
    assert (port.reading(True), port.deadline()) == ((), 5 + DEAF)
    port.due(4 + DEAF)
    assert port.reading(True) == ()
    full.room = True
    port.due(5 + DEAF)
    assert (port.reading(True), port.deadline()) == ((listening,), None)
    port.receive(listening, 6 + DEAF)
    assert len(port.reading(True)) == 2
    client.close()
    port.close()
