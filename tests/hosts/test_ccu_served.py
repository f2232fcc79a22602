"""The CCU's driver on drives that are served: messages and answers as a stream of bytes (Cassinis, table 1)."""

import os
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from detent.cell.description import parse
from detent.hosts.ccu import Ccu
from detent.realtime.endpoints.wanted import Wanted
from detent.realtime.service import Service

TWO = """
[units.left]
model = "supersigma"
[units.right]
model = "supersigma"
options = { number = 2, short = "free" }
[lines.microbus]
units = ["left", "right"]
"""


class Stream:
    """A port for the driver on a file descriptor or a socket."""

    def __init__(self, write: Callable[[bytes], object], read: Callable[[int], bytes]) -> None:
        self.write, self._read = write, read

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            data += self._read(count - len(data))
        return data


@contextmanager
def served(kind: str) -> Iterator[tuple[Service, Stream]]:
    wanted = [Wanted("tcp", "127.0.0.1:0")] if kind == "tcp" else [Wanted("pty")]
    with Service(parse(TWO, "two"), lambda file: "", wanted, pace=50) as service:
        (endpoint,) = service.endpoints
        serving = threading.Thread(target=service.run)
        if kind == "tcp":
            host, _, port = endpoint.address.rpartition(":")
            client = socket.create_connection((host, int(port)), timeout=20)
            stream, close = Stream(client.sendall, client.recv), client.close
        else:
            terminal = os.open(endpoint.address, os.O_RDWR | os.O_NOCTTY)
            stream = Stream(lambda data: os.write(terminal, data), lambda count: os.read(terminal, count))

            def close() -> None:
                os.close(terminal)

        serving.start()
        try:
            yield service, stream
        finally:
            service.stop()
            serving.join()
            close()


@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_two_drives_move_at_the_word_of_a_ccu_outside(kind: str) -> None:
    with served(kind) as (service, stream):
        ccu = Ccu(stream, lambda seconds: None)  # no need to wait: every question takes its time
        reports = ccu.move_all({1: 300, 2: -2600})
        assert {drive: report.steps for drive, report in reports.items()} == {1: 300, 2: 2600}
        ccu.move_line({1: -60, 2: 20})
        cell = service.cell
    assert [drive.status(cell.now).position for drive in cell.controllers().values()] == [240, -2580]
