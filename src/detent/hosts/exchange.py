"""Drivers without I/O: what a driver wants of its port is data, and two shells carry it out.

A driver's method is a generator of `Step`s: it yields an `Ask`, is sent the `Answer`, and returns its result. It
opens nothing, waits for nothing and reads no clock, so that a test can play the device with a list of answers. A
method marked `@operation` is

- on the plain driver: a generator, for other operations (``yield from self.position()``) and for tests;
- on a subclass with `Blocking` before it: an ordinary call, ``unit.position()``;
- on a subclass with `Asynchronous` before it: a coroutine, ``await unit.position()``.

Type checkers see all three. The ports behind the shells are in `detent.realtime.ports`; `detent.cell.host` has one that
lives in the virtual time of a cell.
"""

from collections.abc import Callable, Coroutine, Generator, Iterator
from contextlib import AbstractAsyncContextManager, AbstractContextManager, AsyncExitStack, ExitStack, closing
from functools import cached_property, partial, update_wrapper
from inspect import Signature, signature
from typing import (
    TYPE_CHECKING,
    Any,
    Concatenate,
    Final,
    Generic,
    NamedTuple,
    ParamSpec,
    Protocol,
    Self,
    TypeAlias,
    TypeVar,
    cast,
    get_args,
    overload,
)

from detent.hosts.errors import ECHOES, BadAnswer, DriverError, NoAnswer, PortLost, Spoken

T = TypeVar("T")
P = ParamSpec("P")


LONGEST_ANSWER: Final = 65_536
"""Bytes that are read for one answer, and dropped by one `Clear`: a line that says more than that babbles."""


class Ask(NamedTuple):
    """Send `data`, then read until `complete` says that an answer is there, for `timeout` seconds at most.

    `complete` is given everything that has come and returns how many bytes of it are the answer, None while it is
    not whole; what lies behind the answer is kept for the next one. Without `complete` nothing is read. No answer
    is longer than `LONGEST_ANSWER`: who sends more than that is not listened to any further.
    """

    data: bytes
    complete: Callable[[bytes], int | None] | None = None
    timeout: float = 0.0


class Pause(NamedTuple):
    """Let so many seconds pass; the port stays ours. Time counts from when the last byte was handed over."""

    seconds: float


class Rest(NamedTuple):
    """Let so many seconds pass; whoever else wants the port may have it meanwhile."""

    seconds: float


class Clear(NamedTuple):
    """Forget what has come and was not read, `LONGEST_ANSWER` bytes of it at most."""


class Progress(NamedTuple):
    """So much of a long operation is done: what, of how many. Costs nothing where nobody looks."""

    done: int
    total: int
    what: str = ""


class Answer(NamedTuple):
    """What came: the answer to an `Ask`, or, if it is not `whole`, everything that came in its time.

    `at` is when an `Ask` that reads, a `Pause` or a `Rest` was done, in seconds by the clock of the port: only
    differences count.
    """

    data: bytes = b""
    whole: bool = True
    at: float = 0.0


Step: TypeAlias = Ask | Pause | Rest | Clear | Progress
Steps: TypeAlias = Generator[Step, Answer, T]

NOTHING = Answer()


def length(count: int) -> Callable[[bytes], int | None]:
    """Complete once `count` bytes are there."""
    return lambda data: count if len(data) >= count else None


def until(end: bytes) -> Callable[[bytes], int | None]:
    """Complete behind the first `end`."""

    def complete(data: bytes) -> int | None:
        place = data.find(end)
        return None if place < 0 else place + len(end)

    return complete


def attempt(steps: Generator[Step, Answer, T]) -> Generator[Step, Answer, T | DriverError]:
    """The result of `steps`, or the error that ended them, for whoever has to mend things first."""
    try:
        return (yield from steps)
    except DriverError as error:
        return error


class Driver:
    """A host's side of one unit. `title` is what errors call it; `forget` drops what is known of a unit on a line."""

    title: str

    def forget(self) -> None:
        """The connection was lost: whatever was agreed on with the unit must be agreed on again."""

    def ask(self, data: bytes, complete: Callable[[bytes], int | None], timeout: float) -> Steps[bytes]:
        """The whole answer to `data`. Raises NoAnswer."""
        answer = yield Ask(data, complete, timeout)
        if not answer.whole:
            if len(data) > 1 and answer.data == data:
                raise BadAnswer(self.title, ECHOES, Spoken(data, answer.data))
            what = "does not answer" if not answer.data else "does not finish its answer"
            raise NoAnswer(self.title, f"{what} within {timeout:g} s", Spoken(data, answer.data))
        return answer.data


class Port(Protocol):
    """What a `Blocking` driver needs of a serial port, a socket, or the line of a cell."""

    def write(self, data: bytes, /) -> object:
        """Hand over all of `data`. Raises OSError if the port is gone; the next call opens it again."""

    def receive(self, timeout: float, /) -> bytes:
        """What has come, as soon as that is something; nothing if nothing comes within `timeout` seconds."""

    def keep(self, data: bytes, /) -> object:
        """`data` was read too early: it comes first at the next `receive`."""

    def wait(self, seconds: float, /) -> object:
        """Let so many seconds pass, from when the last byte written is on its way."""

    def clock(self) -> float:
        """Seconds since whenever, never fewer than before."""

    def turn(self) -> AbstractContextManager[object]:
        """The port is one operation's alone while this lasts."""

    def close(self) -> object:
        """Let go of it."""


class AsyncPort(Protocol):
    """The same for an `Asynchronous` driver."""

    async def write(self, data: bytes, /) -> object:
        """Hand over all of `data`. Raises OSError if the port is gone; the next call opens it again."""

    async def receive(self, timeout: float, /) -> bytes:
        """What has come, as soon as that is something; nothing if nothing comes within `timeout` seconds."""

    def keep(self, data: bytes, /) -> object:
        """`data` was read too early: it comes first at the next `receive`."""

    async def wait(self, seconds: float, /) -> object:
        """Let so many seconds pass, from when the last byte written is on its way."""

    def clock(self) -> float:
        """Seconds since whenever, never fewer than before."""

    def turn(self) -> AbstractAsyncContextManager[object]:
        """The port is one operation's alone while this lasts."""

    async def close(self) -> object:
        """Let go of it."""


Watch: TypeAlias = Callable[[Progress], object]
"""Is told how far a long operation is."""


class _Shell:
    """What both shells have: the plain driver and who watches. Whatever is no operation is the driver's."""

    def __init__(self, driver: Driver, watch: Watch | None = None) -> None:
        self.driver, self.watch = driver, watch

    if not TYPE_CHECKING:  # a checker sees what the driver's class has: a misspelt name is an error to it

        def __getattr__(self, name: str) -> Any:  # called only for what is neither the shell's nor an operation
            if name == "driver":
                raise AttributeError(name)
            return getattr(self.driver, name)

    def _lost(self, error: OSError) -> PortLost:
        self.driver.forget()
        lost = PortLost(self.driver.title, f"the port is gone: {error.strerror or error}")
        lost.__cause__ = error
        return lost


def _looks(clock: Callable[[], float], timeout: float) -> Iterator[float]:
    """For how long to wait for more, each time: until `timeout` is over, and behind it not at all, once.

    What has come by then while the computer was kept away came in time.
    """
    end = clock() + timeout
    while (left := end - clock()) >= 0:
        yield left
    yield 0.0


def _next(steps: Steps[T], answer: Answer | PortLost | None) -> Step:
    """The next step of an operation. A lost port is raised inside it: it may have to say what is where now."""
    if isinstance(answer, PortLost):
        return steps.throw(answer)
    return next(steps) if answer is None else steps.send(answer)


class Blocking(_Shell):
    """Operations are calls that return when they are done.

    ``class BlockingGsC200(Blocking, GsC200)`` gives a driver this shell. Several drivers may share a port.
    """

    def __init__(self, driver: Driver, port: Port, watch: Watch | None = None) -> None:
        super().__init__(driver, watch)
        self.port = port

    def perform(self, steps: Steps[T]) -> T:
        """Carry out the steps of an operation of the plain driver; its result. Raises DriverError."""
        answer: Answer | PortLost | None = None
        with closing(steps), ExitStack() as turn:  # who is interrupted learns of it now, and not from the collector
            mine = False
            while True:
                try:
                    step = _next(steps, answer)
                except StopIteration as end:
                    return end.value  # type: ignore[no-any-return]
                if isinstance(step, Rest):
                    turn.close()
                    mine = False
                elif not mine:
                    turn.enter_context(self.port.turn())
                    mine = True
                try:
                    answer = self._do(step)
                except OSError as error:
                    answer = self._lost(error)

    def _do(self, step: Step) -> Answer:
        match step:
            case Ask(data, complete, timeout):
                if data:
                    self.port.write(data)
                return NOTHING if complete is None else self._read(complete, timeout)
            case Pause(seconds) | Rest(seconds):
                self.port.wait(seconds)
                return Answer(at=self.port.clock())
            case Clear():
                left = LONGEST_ANSWER
                while left > 0 and (dropped := self.port.receive(0.0)):
                    left -= len(dropped)
            case Progress():
                if self.watch is not None:
                    self.watch(step)
        return NOTHING

    def _read(self, complete: Callable[[bytes], int | None], timeout: float) -> Answer:
        port, came = self.port, b""
        for left in _looks(port.clock, timeout):
            more = port.receive(left)
            if not more:
                break
            came += more
            if len(came) > LONGEST_ANSWER:
                break
            count = complete(came)
            if count is not None:
                port.keep(came[count:])
                return Answer(came[:count], at=port.clock())
        return Answer(came, whole=False, at=port.clock())

    def close(self) -> None:
        """Close the port, for all who share it."""
        self.port.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Asynchronous(_Shell):
    """Operations are coroutines. ``class AsyncGsC200(Asynchronous, GsC200)`` gives a driver this shell."""

    def __init__(self, driver: Driver, port: AsyncPort, watch: Watch | None = None) -> None:
        super().__init__(driver, watch)
        self.port = port

    async def perform(self, steps: Steps[T]) -> T:
        """Carry out the steps of an operation of the plain driver; its result. Raises DriverError."""
        with closing(steps):  # who is cancelled learns of it now, and not from the collector
            return await self._perform(steps)

    async def _perform(self, steps: Steps[T]) -> T:
        answer: Answer | PortLost | None = None
        async with AsyncExitStack() as turn:
            mine = False
            while True:
                try:
                    step = _next(steps, answer)
                except StopIteration as end:
                    return end.value  # type: ignore[no-any-return]
                if isinstance(step, Rest):
                    await turn.aclose()
                    mine = False
                elif not mine:
                    await turn.enter_async_context(self.port.turn())
                    mine = True
                try:
                    answer = await self._do(step)
                except OSError as error:
                    answer = self._lost(error)

    async def _do(self, step: Step) -> Answer:
        match step:
            case Ask(data, complete, timeout):
                if data:
                    await self.port.write(data)
                return NOTHING if complete is None else await self._read(complete, timeout)
            case Pause(seconds) | Rest(seconds):
                await self.port.wait(seconds)
                return Answer(at=self.port.clock())
            case Clear():
                left = LONGEST_ANSWER
                while left > 0 and (dropped := await self.port.receive(0.0)):
                    left -= len(dropped)
            case Progress():
                if self.watch is not None:
                    self.watch(step)
        return NOTHING

    async def _read(self, complete: Callable[[bytes], int | None], timeout: float) -> Answer:
        port, came = self.port, b""
        for left in _looks(port.clock, timeout):
            more = await port.receive(left)
            if not more:
                break
            came += more
            if len(came) > LONGEST_ANSWER:
                break
            count = complete(came)
            if count is not None:
                port.keep(came[count:])
                return Answer(came[:count], at=port.clock())
        return Answer(came, whole=False, at=port.clock())

    async def close(self) -> None:
        """Close the port, for all who share it."""
        await self.port.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()


class Operation(Generic[P, T]):
    """A method of a driver, seen as its owner's shell needs it: see `operation`."""

    def __init__(self, method: Callable[Concatenate[Any, P], Steps[T]]) -> None:
        self._method = method
        update_wrapper(self, method)

    @overload
    def __get__(self, unit: None, owner: type[Any]) -> Self: ...
    @overload
    def __get__(self, unit: Blocking, owner: type[Any]) -> Callable[P, T]: ...
    @overload
    def __get__(self, unit: Asynchronous, owner: type[Any]) -> Callable[P, Coroutine[Any, Any, T]]: ...
    @overload
    def __get__(self, unit: Driver, owner: type[Any]) -> Callable[P, Steps[T]]: ...
    def __get__(self, unit: Any, owner: type[Any]) -> Any:
        """The method as a call, a coroutine function or a generator function."""
        if unit is None:
            return self
        if not isinstance(unit, _Shell):
            return partial(self._method, unit)
        method = self._method

        def call(*given: P.args, **named: P.kwargs) -> Any:
            return cast("Blocking | Asynchronous", unit).perform(method(unit.driver, *given, **named))

        update_wrapper(call, method)
        call.__signature__ = self.signature  # type: ignore[attr-defined]
        return call

    def __call__(self, unit: Any, *given: P.args, **named: P.kwargs) -> Any:
        """The method of a class, given a unit of it: ``BlockingGsC200.position(unit)``."""
        return self.__get__(unit, type(unit))(*given, **named)

    @property
    def __signature__(self) -> Signature:
        """As `signature`, behind the unit."""
        own = next(iter(signature(self._method).parameters.values()))
        return self.signature.replace(parameters=[own, *self.signature.parameters.values()])

    @cached_property
    def signature(self) -> Signature:
        """What a shell's call takes and returns: without the driver, and with the result in place of the steps."""
        found = signature(self._method)
        result = get_args(found.return_annotation)
        return found.replace(
            parameters=list(found.parameters.values())[1:],
            return_annotation=_plain(result[-1]) if len(result) == 3 else found.return_annotation,
        )


def _plain(kind: Any) -> Any:
    return None if kind is type(None) else kind


def operation(method: Callable[Concatenate[Any, P], Steps[T]]) -> Operation[P, T]:
    """Make a generator of steps the method of a driver that both shells understand.

    Arguments are checked when the first step is asked for: on a shell, at the call.
    """
    return Operation(method)
