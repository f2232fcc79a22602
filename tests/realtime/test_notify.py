"""What a service manager is told, at a socket of the test's own."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.realtime.ticking import TickingCell

from detent.cell.description import parse
from detent.realtime.appearing import devices, wait_for
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.loop import Loop
from detent.realtime.notify import Notifier
from detent.realtime.pace import Pace
from detent.ticks import SECOND


@pytest.fixture(params=["path", "abstract"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[socket.socket, str]]:
    """A socket, and what $NOTIFY_SOCKET says of it."""
    name = str(tmp_path / "notify")
    address = name if request.param == "path" else "\0" + name
    made = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    made.bind(address)
    made.setblocking(False)
    yield made, address.replace("\0", "@")
    made.close()


def heard(at: socket.socket) -> list[str]:
    found = []
    while True:
        try:
            found.append(at.recv(4096).decode())
        except BlockingIOError:
            return found


def test_ready_status_and_the_end_are_told(manager: tuple[socket.socket, str]) -> None:
    at, name = manager
    notifier = Notifier({"NOTIFY_SOCKET": name})
    assert notifier.heard
    assert notifier.deadline() is None  # no watchdog was asked for
    notifier.status("waiting for\na board")
    notifier.ready("serving slide")
    notifier.due(5 * SECOND)
    notifier.stopping()
    assert heard(at) == ["STATUS=waiting for a board", "READY=1\nSTATUS=serving slide", "STOPPING=1"]
    notifier.close()
    notifier.status("nobody hears this")
    assert heard(at) == []


def test_the_watchdog_is_fed_three_times_in_its_time(manager: tuple[socket.socket, str]) -> None:
    at, name = manager
    notifier = Notifier({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "7"}, process=7)
    for tenth in range(31):
        notifier.due(tenth * SECOND // 10)
    assert heard(at) == ["WATCHDOG=1"] * 4
    assert notifier.deadline() == 4 * SECOND
    other = Notifier({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "8"}, process=7)
    assert other.deadline() is None
    other.close()
    notifier.close()


def test_the_loop_feeds_it_though_nothing_happens(manager: tuple[socket.socket, str]) -> None:
    at, name = manager
    notifier = Notifier({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "3000000"})
    waits: list[float | None] = []
    loop = Loop(
        TickingCell(None), Pace(), [], wait=lambda r, w, x, s: waits.append(s) or ([], [], []), timers=[notifier]
    )  # type: ignore[func-returns-value]
    loop.step()
    loop.step()
    loop.close()
    notifier.close()
    assert heard(at) == ["WATCHDOG=1"]
    assert waits[0] == 0.0
    assert waits[1] is not None
    assert 0 < waits[1] <= 1.0


@pytest.mark.parametrize(
    "environment", [{}, {"NOTIFY_SOCKET": ""}, {"NOTIFY_SOCKET": "@"}, {"NOTIFY_SOCKET": "vsock:2:1"},
                    {"WATCHDOG_USEC": "1000000"}],
)  # fmt: skip
def test_without_a_manager_nothing_is_told(environment: dict[str, str]) -> None:
    notifier = Notifier(environment)
    assert not notifier.heard
    assert notifier.deadline() is None
    notifier.ready("x")
    notifier.due(0)
    notifier.close()


def test_a_manager_that_is_gone_stops_nothing(tmp_path: Path) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": str(tmp_path / "gone"), "WATCHDOG_USEC": "10"})
    notifier.ready("serving")
    notifier.due(SECOND)
    notifier.stopping()
    notifier.close()


CELL = """
[units.x]
model = "gs-c200"
[lines.host]
units = ["x"]
endpoint = "serial:/dev/serial/by-id/host"
[boards.b]
serial = "/dev/serial/by-id/board@115200"
[boards.spare]
serial = "/dev/serial/by-id/spare"
[boards.f]
serial = "fake:"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
unwired = ["EOT", "HOME"]
"""


def test_what_a_cell_needs_before_it_can_be_served() -> None:
    described = parse(CELL, "cell.toml")
    board, host = "/dev/serial/by-id/board", "/dev/serial/by-id/host"
    assert devices(described, (), real=True) == {board: "boards.b.serial", host: "lines.host.endpoint"}
    assert devices(described, (), real=False) == {host: "lines.host.endpoint"}
    assert devices(described, [EndpointSpec("serial", "/dev/ttyS0")], real=False) == {"/dev/ttyS0": "--serial"}
    assert devices(described, [EndpointSpec("pty")], real=False) == {}


@pytest.mark.parametrize("order", [("a", "b"), ("b", "a")])
def test_devices_may_come_in_any_order_and_it_is_told_once_which_are_missing(order: tuple[str, str]) -> None:
    plugged, coming, told = {"c"}, list(order), list[list[str]]()
    wait_for(
        ["a", "b", "c"], lambda missing: told.append(list(missing)), there=plugged.__contains__,
        sleep=lambda _: plugged.add(coming.pop(0)),
    )  # fmt: skip
    assert (told, coming) == ([["a", "b"]], [])
    wait_for(["c"], lambda missing: told.append(list(missing)), there=plugged.__contains__, sleep=lambda _: None)
    assert told == [["a", "b"]]
