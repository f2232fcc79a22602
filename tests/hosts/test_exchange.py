"""The two shells of a driver: what it asks for is carried out on a port, in order, and one operation at a time."""

import asyncio
import inspect
from collections import deque
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager

import pytest

from detent.hosts.axis import Axis
from detent.hosts.errors import BadAnswer, Busy, DriverError, MotionFailed, NoAnswer, PortLost, Refused, Spoken
from detent.hosts.exchange import (
    Ask,
    Asynchronous,
    Blocking,
    Clear,
    Operation,
    Pause,
    Progress,
    Rest,
    Steps,
    length,
    operation,
    until,
)


class Echo(Axis):
    """A device that answers what it is asked for, line by line."""

    title = "echo"

    def __init__(self) -> None:
        self.agreed = True
        self.turns = 3

    def forget(self) -> None:
        self.agreed = False

    @operation
    def say(self, text: str, timeout: float = 1.0) -> Steps[str]:
        """Send a line; its answer."""
        data = yield from self.ask(text.encode() + b"\r", until(b"\r"), timeout)
        return data[:-1].decode()

    @operation
    def twice(self, text: str) -> Steps[list[str]]:
        """Two lines with a pause between them."""
        first = yield from self.say(text)
        yield Progress(1, 2, "lines")
        yield Pause(0.25)
        return [first, (yield from self.say(text + "2"))]

    @operation
    def tell(self, data: bytes) -> Steps[None]:
        """Send, and read nothing."""
        yield Clear()
        yield Ask(data)

    @operation
    def position(self) -> Steps[int]:
        """Asked for, with a rest before it."""
        yield Rest(2.0)
        return int((yield from self.say("p")))

    @operation
    def moving(self) -> Steps[bool]:
        """For so many questions."""
        self.turns -= 1
        yield Ask(b"m")
        return self.turns > 0


class BlockingEcho(Blocking, Echo):
    """The echo as calls."""


class AsyncEcho(Asynchronous, Echo):
    """The echo as coroutines."""


class Wire:
    """A port on which every line is answered by what is put there; its clock stands but for waiting."""

    def __init__(self, *chunks: bytes) -> None:
        self.chunks = deque(chunks)
        self.kept = b""
        self.log: list[object] = []
        self.now = 0.0
        self.away = 0.0  # for how long the computer is kept away each time that something is read
        self.broken = False

    def write(self, data: bytes) -> None:
        if self.broken:
            raise OSError(5, "Input/output error")
        self.log.append(data)

    def receive(self, timeout: float) -> bytes:
        if self.kept:
            data, self.kept = self.kept, b""
            return data
        self.now += self.away
        if self.chunks:
            return self.chunks.popleft()
        self.now += timeout
        return b""

    def keep(self, data: bytes) -> None:
        self.kept = data + self.kept

    def wait(self, seconds: float) -> None:
        self.log.append(seconds)

    def clock(self) -> float:
        return self.now

    @contextmanager
    def turn(self) -> Iterator[None]:
        self.log.append("mine")
        try:
            yield
        finally:
            self.log.append("free")

    def close(self) -> None:
        self.log.append("closed")


class AsyncWire:
    """The same for coroutines."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire

    async def write(self, data: bytes) -> None:
        self.wire.write(data)

    async def receive(self, timeout: float) -> bytes:
        return self.wire.receive(timeout)

    def keep(self, data: bytes) -> None:
        self.wire.keep(data)

    async def wait(self, seconds: float) -> None:
        self.wire.wait(seconds)

    def clock(self) -> float:
        return self.wire.clock()

    @asynccontextmanager
    async def turn(self) -> AsyncIterator[None]:
        with self.wire.turn():
            yield

    async def close(self) -> None:
        self.wire.close()


class Both:
    """A driver in either shell, called alike."""

    def __init__(self, shell: str, *chunks: bytes) -> None:
        self.wire = Wire(*chunks)
        self.seen: list[Progress] = []
        self.plain = Echo()
        self.unit: BlockingEcho | AsyncEcho
        if shell == "blocking":
            self.unit = BlockingEcho(self.plain, self.wire, self.seen.append)
        else:
            self.unit = AsyncEcho(self.plain, AsyncWire(self.wire), self.seen.append)

    def call(self, name: str, *given: object, **named: object) -> object:
        result = getattr(self.unit, name)(*given, **named)

        async def finished() -> object:
            return await result

        return asyncio.run(finished()) if inspect.isawaitable(result) else result


SHELLS = pytest.mark.parametrize("shell", ["blocking", "asynchronous"])


@SHELLS
def test_what_came_while_the_computer_was_kept_away_came_in_time(shell: str) -> None:
    both = Both(shell, b"o", b"ne\r")
    both.wire.away = 3.0
    assert both.call("say", "x") == "one"
    babbling = Both(shell, *[b"o"] * 100)
    babbling.wire.away = 3.0
    with pytest.raises(NoAnswer):
        babbling.call("say", "x")
    assert len(babbling.wire.chunks) == 98


@SHELLS
def test_an_answer_may_come_in_parts_and_what_lies_behind_it_is_kept(shell: str) -> None:
    both = Both(shell, b"o", b"ne\rtw", b"o2\r")
    assert both.call("twice", "x") == ["one", "two2"]
    assert both.wire.log == ["mine", b"x\r", 0.25, b"x2\r", "free"]
    assert both.seen == [(1, 2, "lines")]


@SHELLS
def test_while_an_operation_rests_the_port_is_free(shell: str) -> None:
    both = Both(shell, b"-17\r")
    assert both.call("position") == -17
    assert both.wire.log == [2.0, "mine", b"p\r", "free"]


@SHELLS
def test_what_came_before_is_forgotten_on_request(shell: str) -> None:
    both = Both(shell, b"old", b"older")
    both.call("tell", b"\x1b")
    assert both.wire.log == ["mine", b"\x1b", "free"]
    assert not both.wire.chunks


@SHELLS
def test_an_answer_that_does_not_end_in_time_is_an_error_with_the_exchange(shell: str) -> None:
    both = Both(shell, b"on")
    with pytest.raises(NoAnswer, match=r"echo: does not finish its answer within 1 s \(sent 'x\\r', received 'on'\)"):
        both.call("say", "x")
    assert both.wire.log[-1] == "free"
    with pytest.raises(NoAnswer, match=r"echo: does not answer within 0\.5 s \(sent 'x\\r', received nothing\)"):
        both.call("say", "x", timeout=0.5)
    assert both.wire.now == 1.5


@SHELLS
def test_a_lost_port_is_told_and_the_driver_forgets_what_was_agreed(shell: str) -> None:
    both = Both(shell, b"again\r")
    both.wire.broken = True
    with pytest.raises(PortLost, match="echo: the port is gone: Input/output error"):
        both.call("say", "x")
    assert not both.plain.agreed
    both.wire.broken = False
    assert both.call("say", "x") == "again"


@SHELLS
def test_waiting_asks_until_the_axis_stands_and_gives_others_the_port_between(shell: str) -> None:
    both = Both(shell)
    both.call("wait")
    assert both.wire.log == ["mine", b"m", "free", 0.02, "mine", b"m", "free", 0.02, "mine", b"m", "free"]
    both.plain.turns = 1000
    with pytest.raises(MotionFailed, match=r"still moves after 0\.1 s"):
        both.call("wait", 0.1)


def test_a_shell_shows_what_the_driver_is_and_closes_the_port() -> None:
    wire = Wire()
    with BlockingEcho(Echo(), wire) as unit:
        assert (unit.title, unit.turns) == ("echo", 3)
        with pytest.raises(AttributeError, match="no_such_thing"):
            _ = unit.no_such_thing
    assert wire.log == ["closed"]


def test_operations_keep_their_name_and_documentation() -> None:
    assert isinstance(Echo.say, Operation)
    assert BlockingEcho(Echo(), Wire()).say.__doc__ == "Send a line; its answer."
    assert Echo.say.__name__ == "say"  # type: ignore[attr-defined]


def test_what_an_axis_cannot_do_does_not_look_as_if_it_were_done() -> None:
    with pytest.raises(NotImplementedError):
        BlockingEcho(Echo(), Wire()).home()


def test_a_length_is_complete_when_it_is_there() -> None:
    assert [length(3)(b"ab"), length(3)(b"abc"), length(3)(b"abcd")] == [None, 3, 3]


def test_errors_say_who_is_at_fault() -> None:
    assert issubclass(NoAnswer, TimeoutError)
    assert issubclass(PortLost, ConnectionError)
    assert issubclass(Busy, Refused)
    for kind in (NoAnswer, BadAnswer, Refused, MotionFailed, PortLost):
        assert issubclass(kind, DriverError)
    error = Refused("drill", "the program memory is full", Spoken(b"A1\r", b"E3\r"), code="E3")
    assert str(error) == r"drill: the program memory is full (sent 'A1\r', received 'E3\r')"
    assert (error.code, error.unit) == ("E3", "drill")
