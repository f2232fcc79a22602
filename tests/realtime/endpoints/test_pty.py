import itertools
import os
import select
import socket
import subprocess
import sys
import termios
import tty
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import serial
from tests.realtime.ticking import TickingCell, look

from detent.realtime.endpoints import unsettler
from detent.realtime.endpoints.endpoint import MOST_WAITING, EndpointError
from detent.realtime.endpoints.pty import PseudoTerminal
from detent.realtime.endpoints.unsettling import Unsettling
from detent.realtime.loop import Loop
from detent.realtime.pace import Pace


@contextmanager
def served(terminal: PseudoTerminal, cell: TickingCell) -> Iterator[Loop]:
    loop = Loop(cell, Pace(), [(0, terminal)], wait=look)
    try:
        yield loop
    finally:
        loop.close()
        terminal.close()


def opened(address: str) -> int:
    return os.open(address, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)


def answer(loop: Loop, client: int, length: int) -> bytes:
    """What the client reads: `length` bytes, however many steps that takes."""
    data = b""
    while len(data) < length:
        loop.step()
        if select.select([client], [], [], 0)[0]:
            data += os.read(client, length - len(data))
    return data


def test_a_client_is_answered() -> None:
    terminal = PseudoTerminal()
    with served(terminal, TickingCell(None)) as loop:
        client = opened(terminal.address)
        os.write(client, b"V1\x17\r\x80\xff\x03\x13\n")
        assert answer(loop, client, 9) == b"V1\x17\r\x80\xff\x03\x13\n"
        os.close(client)


def test_clients_come_and_go() -> None:
    terminal, cell = PseudoTerminal(), TickingCell(None)
    with served(terminal, cell) as loop:
        for text in (b"one\r", b"two\r", b"three\r"):
            client = opened(terminal.address)
            os.write(client, text)
            assert answer(loop, client, len(text)) == text
            os.close(client)
        loop.step()
    assert cell.got() == b"one\rtwo\rthree\r"


def test_a_client_that_leaves_inside_a_frame_leaves_what_it_said_on_the_line() -> None:
    terminal, cell = PseudoTerminal(), TickingCell(None)
    with served(terminal, cell) as loop:
        client = opened(terminal.address)
        os.write(client, b"G+5")
        os.close(client)
        while cell.got() != b"G+5":
            loop.step()


def test_a_client_may_set_the_format_of_the_controller() -> None:
    terminal = PseudoTerminal()
    with served(terminal, TickingCell(None)) as loop:
        client = opened(terminal.address)
        settings = termios.tcgetattr(client)
        settings[2] |= termios.PARENB | termios.PARODD | termios.CSTOPB
        settings[4] = settings[5] = termios.B9600
        termios.tcsetattr(client, termios.TCSAFLUSH, settings)
        os.write(client, b"F\r")
        assert answer(loop, client, 2) == b"F\r"
        os.close(client)


def test_a_client_that_does_not_read_loses_the_oldest_bytes_and_stops_nobody() -> None:
    terminal, cell = PseudoTerminal(), TickingCell(None)
    with served(terminal, cell):
        client = opened(terminal.address)
        told = 0
        while not terminal.dropped:
            terminal.send(b"%07d\r" % told, 0)
            told += 1
        assert told * 8 > MOST_WAITING
        tty.setraw(client, termios.TCSANOW)  # without flushing what waits there
        read = b""
        while not read.endswith(b"%07d\r" % (told - 1)):
            terminal.flush()
            if select.select([client], [], [], 0)[0]:
                read += os.read(client, 4096)
        assert len(read) == told * 8 - terminal.dropped
        assert not terminal.writing()
        os.close(client)


def test_a_link_leads_to_the_terminal_while_it_is_served(tmp_path: Path) -> None:
    link = tmp_path / "stepper"
    terminal = PseudoTerminal(link)
    assert terminal.address == str(link)
    assert os.readlink(link).startswith("/dev/")
    with served(terminal, TickingCell(None)) as loop:
        client = opened(str(link))
        os.write(client, b"F\r")
        assert answer(loop, client, 2) == b"F\r"
        os.close(client)
    assert list(tmp_path.iterdir()) == []


def test_a_link_that_was_left_behind_is_replaced(tmp_path: Path) -> None:
    link = tmp_path / "stepper"
    link.symlink_to("/dev/pts/gone")
    terminal = PseudoTerminal(link)
    assert os.readlink(link) != "/dev/pts/gone"
    terminal.close()
    assert list(tmp_path.iterdir()) == []


def test_a_link_that_somebody_put_elsewhere_is_left_alone(tmp_path: Path) -> None:
    link = tmp_path / "stepper"
    terminal = PseudoTerminal(link)
    link.unlink()
    link.symlink_to("/dev/null")
    terminal.close()
    terminal.close()
    assert os.readlink(link) == "/dev/null"


def test_a_link_is_not_taken_from_one_who_serves_there(tmp_path: Path) -> None:
    link = tmp_path / "stepper"
    terminal = PseudoTerminal(link)
    with pytest.raises(EndpointError, match="stepper is in use: another detent serves there; stop it, or choose"):
        PseudoTerminal(link)
    with served(terminal, TickingCell(None)) as loop:
        client = opened(str(link))
        os.write(client, b"F\r")
        assert answer(loop, client, 2) == b"F\r"
        os.close(client)
    PseudoTerminal(link).close()


SETTINGS = [
    {"baudrate": 9600, "bytesize": 7, "parity": "O", "stopbits": 2},
    {"baudrate": 9600, "bytesize": 7, "parity": "E", "stopbits": 1},
    {"baudrate": 50, "bytesize": 8, "parity": "E", "stopbits": 1},
    {"baudrate": 115200, "bytesize": 8, "parity": "N", "stopbits": 1},
]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux refuses formats on a pseudo-terminal")
@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_any_format_can_be_asked_for_again_and_again(settings: dict[str, Any]) -> None:
    """The kernel does not take 7 bits or parity, and what it does not take is an error if nothing else changes."""
    terminal = PseudoTerminal()
    with served(terminal, TickingCell(None)) as loop:
        for _ in range(3):
            with serial.Serial(terminal.address, timeout=0, **settings) as client:
                for attribute, value in [("timeout", 0), ("timeout", 60), *settings.items()]:
                    settle(loop)
                    setattr(client, attribute, value)  # each sets everything again
                client.write(b"F\r")
                settle(loop)
                assert client.read(2) == b"F\r"
            settle(loop)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux refuses formats on a pseudo-terminal")
def test_what_was_changed_in_between_is_seen_even_within_one_setting() -> None:
    """The C library looks before and after; a loop that is quick changes something between the two."""
    terminal = PseudoTerminal()
    with (
        served(terminal, TickingCell(None)) as loop,
        serial.Serial(terminal.address, timeout=0, **SETTINGS[0]) as client,
    ):
        settle(loop)
        before = termios.tcgetattr(client.fileno())[5]
        for number in range(5):
            client.timeout = number
            settle(loop)
            before, after = termios.tcgetattr(client.fileno())[5], before
            assert before != after


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux refuses formats on a pseudo-terminal")
def test_a_setting_is_unsettled_while_the_loop_has_other_work() -> None:
    """No loop is as quick as a program that sets its port twice: a process beside it is."""
    unsettling = Unsettling()
    terminals = [PseudoTerminal(unsettling=unsettling) for _ in range(2)]
    try:
        for _ in range(3):
            for terminal in terminals:
                with serial.Serial(terminal.address, timeout=0, **SETTINGS[0]) as client:
                    for number in range(3):
                        unusual(client.fileno())
                        client.timeout = number
                    unusual(client.fileno())
    finally:
        for terminal in terminals:
            terminal.close()
    with pytest.raises(OSError, match="No such file"):
        os.stat(terminals[0].address)  # nobody keeps it open


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux refuses formats on a pseudo-terminal")
def test_whoever_is_sooner_gets_time_for_it() -> None:
    """The loop holds no lock of the terminal then, which a client and whoever unsettles it would wait for."""

    class Somebody(Unsettling):
        def watch(self, ours: int) -> bool:
            return True

    terminal = PseudoTerminal(unsettling=Somebody())
    ours = terminal.reading(room=True)[-1]
    with serial.Serial(terminal.address, timeout=0, **SETTINGS[0]) as client:
        terminal.receive(ours, 1_000)
        assert termios.tcgetattr(client.fileno())[5] == termios.B9600
        deadline = terminal.deadline()
        assert deadline is not None
        assert deadline > 1_000
        client.baudrate = 4800
        terminal.receive(ours, 2_000)
        assert terminal.deadline() == deadline + 1_000  # not between two settings
        terminal.due(deadline + 1_000)
        assert terminal.deadline() is None
        assert termios.tcgetattr(client.fileno())[5] in unsettler.SERVING
    terminal.close()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux refuses formats on a pseudo-terminal")
def test_nobody_finds_the_speed_that_he_found_before() -> None:
    """The C library looks before and after; what it finds twice is no difference."""
    terminal = PseudoTerminal()
    turns = bytearray(3)
    with serial.Serial(terminal.address, timeout=0, **SETTINGS[0]) as client:
        unsettler.unsettle(client.fileno(), unsettler.SERVING, turns, 1)  # of the opening
        for speeds in (unsettler.SERVING, unsettler.BESIDE):
            found = []
            for number in range(2 * len(speeds)):
                client.timeout = number  # sets everything again
                unsettler.unsettle(client.fileno(), speeds, turns, 1)
                unsettler.unsettle(client.fileno(), speeds, turns, 1)  # nothing to do any more
                found.append(termios.tcgetattr(client.fileno())[5])
            assert set(found) == set(speeds)
            assert len(set(speeds)) > 1
            assert all(one != other for one, other in itertools.pairwise(found))
    assert not set(unsettler.SERVING) & set(unsettler.BESIDE)
    assert 0 not in unsettler.UNUSUAL
    assert (turns[0], turns[2]) == (0, 0)  # of other terminals
    terminal.close()


def descendants(process: int) -> dict[int, set[int]]:
    """The processes that `process` started, with the processors that each may run on."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    return {int(child): os.sched_getaffinity(int(child)) for child in children}


def gone(processes: Iterable[int]) -> bool:
    """Wait until none of `processes` lives; True. One that has ended may wait for its parent to look."""
    for process in processes:
        with suppress(OSError):
            while Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
                os.sched_yield()
    return True


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux refuses formats on a pseudo-terminal")
def test_there_is_a_process_for_each_processor_and_they_end_with_the_loop() -> None:
    """However it ends: they have no other line to hang on."""
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen([sys.executable, "-I", "-S", unsettler.__file__], stdin=theirs)
    terminal = PseudoTerminal()
    for _ in range(3):
        socket.send_fds(ours, [b"\0"], [terminal.reading(room=True)[-1]])
    with serial.Serial(terminal.address, timeout=0, **SETTINGS[0]) as client:
        unusual(client.fileno())
    beside: dict[int, set[int]] = {}
    processors = os.sched_getaffinity(0)
    while sum(map(len, beside.values())) != len(processors):  # not all of them may have begun yet
        beside = descendants(process.pid)
    assert len(beside) == min(16, len(processors))
    held = Path(f"/proc/{process.pid}/fd")
    while any("ptmx" in str(one.resolve()) for one in held.iterdir()):
        os.sched_yield()  # the first gives terminals on, and keeps none
    ours.close()
    assert process.wait(180) == 0
    assert gone(beside)
    terminal.close()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux refuses formats on a pseudo-terminal")
def test_a_loop_that_is_killed_leaves_no_process() -> None:
    code = (
        "from detent.realtime.endpoints.pty import PseudoTerminal\n"
        "from detent.realtime.endpoints.unsettling import Unsettling\n"
        "terminal = PseudoTerminal(unsettling=Unsettling())\n"
        "print(terminal.address, flush=True)\n"
        "input()\n"
    )
    server = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert server.stdin is not None
    assert server.stdout is not None
    with serial.Serial(server.stdout.readline().strip(), timeout=0, **SETTINGS[0]) as client:
        unusual(client.fileno())  # by one of them: the loop does nothing
        first = [*descendants(server.pid)]
        beside = [child for one in first for child in descendants(one)]
        assert beside
        server.kill()
        assert gone([*first, *beside])
    server.wait()
    server.stdin.close()
    server.stdout.close()


def unusual(descriptor: int) -> None:
    """Wait until the speed is one that nobody uses."""
    while termios.tcgetattr(descriptor)[5] not in unsettler.UNUSUAL:
        os.sched_yield()


def settle(loop: Loop) -> None:
    """Have the loop see what the kernel has to tell."""
    for _ in range(3):
        loop.step()


def test_what_a_client_left_unread_is_not_for_the_next() -> None:
    terminal = PseudoTerminal()
    with served(terminal, TickingCell(None)) as loop:
        for text in (b"old\r", b"older\r"):
            client = opened(terminal.address)
            os.write(client, text)
            settle(loop)
            assert select.select([client], [], [], 60)[0]  # it is there to be read
            os.close(client)
        settle(loop)
        terminal.send(b"to nobody", 0)
        client = opened(terminal.address)
        os.write(client, b"new\r")
        assert answer(loop, client, 4) == b"new\r"
        os.close(client)


def test_a_file_is_never_replaced_by_a_link(tmp_path: Path) -> None:
    link = tmp_path / "stepper"
    link.write_text("precious")
    with pytest.raises(EndpointError, match=r"stepper exists and is not a symbolic link; remove it or choose"):
        PseudoTerminal(link)
    assert link.read_text() == "precious"


def test_a_link_needs_a_folder(tmp_path: Path) -> None:
    with pytest.raises(EndpointError, match="cannot be made: No such file or directory; choose another LINK"):
        PseudoTerminal(tmp_path / "nowhere" / "stepper")
    (tmp_path / "file").touch()
    with pytest.raises(EndpointError, match="Not a directory; choose another LINK"):
        PseudoTerminal(tmp_path / "file" / "stepper")
