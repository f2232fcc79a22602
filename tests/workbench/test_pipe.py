"""Messages between the workbench and the process of its cell arrive whole, and neither end waits for the other."""

import pickle
import socket

import pytest
from tests.workbench.told import EXAMPLES, example

from detent.ticks import SECOND
from detent.workbench.pipe import HEAD, TICK, Pipe, packed


class Ends:
    """Both ends of a pipe."""

    def __init__(self) -> None:
        ours, self.theirs = socket.socketpair()
        self.heard: list[object] = []
        self.ticks: list[int] = []
        self.gone = False
        self.pipe = Pipe(ours, self.heard.append, self.ticks.append, self._leave)
        self.descriptor = ours.fileno()

    def _leave(self) -> None:
        self.gone = True

    def read(self) -> object:
        (length,) = HEAD.unpack(self.theirs.recv(HEAD.size, socket.MSG_WAITALL))
        return pickle.loads(self.theirs.recv(length, socket.MSG_WAITALL))

    def close(self) -> None:
        self.pipe.close()
        self.theirs.close()


def test_a_message_in_pieces_and_two_in_one() -> None:
    ends = Ends()
    data = packed(("one", 1))
    for byte in data:
        ends.theirs.sendall(bytes([byte]))
        assert ends.pipe.receive(ends.descriptor, 0) == b""  # nothing of it is for a line
    assert ends.heard == [("one", 1)]
    ends.theirs.sendall(packed("two") + packed("three"))
    ends.pipe.receive(ends.descriptor, 0)
    assert ends.heard[1:] == ["two", "three"]
    assert ends.pipe.receive(ends.descriptor, 0) == b""
    ends.close()


def test_what_there_is_no_room_for_waits_without_keeping_the_cell() -> None:
    ends = Ends()
    ends.theirs.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    large = b"x" * (9 << 20)
    ends.pipe.push(large)
    assert ends.pipe.full
    assert list(ends.pipe.writing()) == [ends.descriptor]
    got = bytearray()
    while len(got) < len(packed(large)):
        got += ends.theirs.recv(1 << 20)
        ends.pipe.flush()
    assert not ends.pipe.full
    assert list(ends.pipe.writing()) == []
    assert bytes(got) == packed(large)
    ends.close()


def test_it_ticks_twenty_times_a_second() -> None:
    ends = Ends()
    assert ends.pipe.deadline() == 0
    ends.pipe.due(1000)
    assert ends.ticks == [1000]
    assert ends.pipe.deadline() == 1000 + TICK == 1000 + SECOND // 20
    ends.close()


def test_the_end_of_the_workbench_is_the_end() -> None:
    ends = Ends()
    ends.theirs.close()
    ends.pipe.receive(ends.descriptor, 0)
    assert ends.gone
    assert ends.pipe.reading(True) == ()
    assert ends.pipe.deadline() is None
    ends.pipe.push("nobody")  # and no error
    ends.pipe.close()


@pytest.mark.parametrize("name", sorted(path.parent.name for path in EXAMPLES.glob("*/cell.toml")))
def test_whatever_happens_in_a_cell_arrives_as_it_was(name: str) -> None:
    told = example(name)
    told.history.run_to(SECOND // 50 if name == "closed-loop-motor" else 2 * SECOND)
    news = told.history.news()
    assert pickle.loads(packed(news)[HEAD.size :]) == news
    assert pickle.loads(packed(told.mirror.views)[HEAD.size :]) == told.mirror.views
