"""What all windows show, as one flat table of keys and values, and the calls that they make.

One socket a window (`/live`). The server pushes what changed since it pushed last, as JSON ``{"set": {KEY: VALUE}}``;
a window that is slow gets fewer and newer values, never a queue. It hears something every `BEAT` seconds,
whatever happens: so a window knows a server that hangs from a cell that stands. A window calls
``{"call": NAME, "args": [...], "id": N}`` and gets ``{"id": N, "value": ...}`` or ``{"id": N, "error": TEXT}``.
What the server says carries a ``beat``, its own clock in ms, and what a window calls the one that it ``heard`` last:
so what moves something is not done long after it was asked for, when whoever asked has been told that it was not.
It carries ``stops`` as well, what the window knew of stops when a hand acted: ``stop.count`` of the table, and how many
it had called itself on this socket. So nothing that moves is done behind a stop that came after it (`stops`).
A window that takes no answers is heard no further than `MOST_CALLS` calls.
"""

import asyncio
import contextlib
import json
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Final, TypeAlias

from pydantic import ValidationError, validate_call
from starlette.websockets import WebSocket, WebSocketDisconnect

from detent.hosts.errors import told
from detent.one_line import one_line
from detent.workbench.stops import Asked, Stops, asked_by

Value: TypeAlias = "str | int | float | bool | Sequence[Value] | Mapping[str, Value] | None"
Call: TypeAlias = Callable[..., Awaitable[object]]

MISTAKES = (ValueError, KeyError, TypeError, OSError, RuntimeError)  # whose text is for the person at the window
LONGEST_CALL = 1 << 20  # characters
BEAT = 1.0  # seconds
LATE: Final = 10.0  # seconds after which nothing moves any more that was asked for; a window gives up after 20
MOST_CALLS: Final = 100  # of a window at once; an answer that it has not taken counts
MOST_LINES: Final = 100  # of an error


class Live:
    """The table, the windows that look at it, and what they may call."""

    def __init__(self) -> None:
        self._table: dict[str, Value] = {}
        self._windows: set[_Window] = set()
        self._calls: dict[str, Call] = {}
        self._moves: dict[str, str] = {}  # what is not done late, nor behind a stop of these
        self._stopping: set[str] = set()  # what stops something
        self.stops = Stops(lambda count: self.put({"stop.count": count}))
        self._table["stop.count"] = self.stops.count
        self._answers: set[asyncio.Task[None]] = set()

    @property
    def windows(self) -> int:
        """How many windows are open."""
        return len(self._windows)

    def get(self, key: str) -> Value:
        """What the windows show for `key`; None if nothing."""
        return self._table.get(key)

    def put(self, values: Mapping[str, Value]) -> None:
        """Show these values from now on. Only those that changed go out."""
        table = self._table
        changed = {key: value for key, value in values.items() if key not in table or table[key] != value}
        if changed:
            table.update(changed)
            for window in self._windows:
                window.show(changed)

    def offer(self, name: str, call: Call, *, moves: str = "", stops: bool = False) -> None:
        """Let windows call `call` by `name`. Its arguments are checked against its annotations.

        `moves`: what it moves, as `stops` names it; it is not done when it comes `LATE`, nor behind a stop of that.
        One that `stops` is done however late it is.
        """
        if name in self._calls:
            raise ValueError(f"there is a call {name!r} already")
        self._calls[name] = validate_call(call)
        if moves:
            self._moves[name] = moves
        if stops:
            self._stopping.add(name)

    async def serve(self, socket: WebSocket) -> None:
        """One window, from its socket's opening to its end.

        What it has asked for is done though it leaves at once: who closes a window behind a STOP has stopped.
        """
        await socket.accept()
        window = _Window(socket, self.stops)
        window.show(self._table)
        self._windows.add(window)
        self.put({"windows": self.windows})
        sender = asyncio.create_task(window.send())
        try:
            await self._hear(window, socket, sender)
        except (WebSocketDisconnect, RuntimeError, KeyError):  # gone, or it sent what is no text
            pass
        finally:
            self._windows.discard(window)
            sender.cancel()
            self.put({"windows": self.windows})
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await socket.close()

    async def _hear(self, window: "_Window", socket: WebSocket, sender: asyncio.Task[None]) -> None:
        """Begin what a window calls, `MOST_CALLS` at once. Raises what ends its socket."""
        asked: set[asyncio.Task[None]] = set()
        while len(text := await socket.receive_text()) <= LONGEST_CALL:
            answer = asyncio.create_task(self._answer(window, text))
            for under_way in (self._answers, asked):
                under_way.add(answer)
                answer.add_done_callback(under_way.discard)
            while len(asked) >= MOST_CALLS and not sender.done():
                await asyncio.wait({sender, *asked}, return_when=asyncio.FIRST_COMPLETED)

    async def _answer(self, window: "_Window", text: str) -> None:
        """Carry out a call, tell its window what came of it; done when the window has taken that, or has left."""
        try:
            asked = json.loads(text)
            number, name, arguments = int(asked["id"]), str(asked["call"]), list(asked.get("args", ()))
        except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
            return  # nobody who waits for an answer
        try:
            call = self._calls.get(name)
            if call is None:
                raise ValueError(f"there is no call {name!r}")
            with asked_by(window.asked(asked.get("stops"), stops_too=name in self._stopping)):
                if name in self._moves:
                    _check_fresh(asked.get("heard"))
                    self.stops.check(self._moves[name])
                answer: dict[str, object] = {"id": number, "value": await call(*arguments)}
        except Exception as error:  # whatever it is: somebody waits for the answer
            answer = {"id": number, "error": _in_words(name, error)}
            if not isinstance(error, MISTAKES):
                told_of = {"message": f"The call {name} failed", "exception": error}
                asyncio.get_running_loop().call_exception_handler(told_of)
        await window.reply(answer)


def _check_fresh(heard: object) -> None:
    """Raises RuntimeError where the last that a window had heard of the server is long ago."""
    if isinstance(heard, int | float) and (away := (_clock() - heard) / 1000) > LATE:
        raise RuntimeError(f"the workbench was away for {away:.0f} s when this was asked: it is not done; ask again")


def _clock() -> int:
    """The server's own, in ms."""
    return round(1000 * asyncio.get_running_loop().time())


def _in_words(name: str, error: Exception) -> str:
    """Why a call was not carried out, for the person at the window."""
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        return one_line(f"{name}: {first['msg']} (it is {first.get('input')!r})")
    if isinstance(error, OSError) and error.filename and error.strerror:
        return one_line(f"{error.filename}: {error.strerror}")
    words = str(error.args[0] if isinstance(error, KeyError) and error.args else told(error))
    return "\n".join(map(one_line, words.splitlines()[:MOST_LINES])) or type(error).__name__


class _Window:
    """What is to be sent to one window."""

    def __init__(self, socket: WebSocket, stops: Stops) -> None:
        self._socket, self._stops = socket, stops
        self._own: list[int] = []  # the numbers of the stops that it has called
        self._values: dict[str, Value] = {}
        self._replies: list[tuple[dict[str, object], asyncio.Event]] = []
        self._work = asyncio.Event()
        self._gone = False

    def show(self, values: Mapping[str, Value]) -> None:
        """Send these values soon; values of the same keys that still wait are left out."""
        self._values.update(values)
        self._work.set()

    def asked(self, stops: object, *, stops_too: bool = False) -> Asked:
        """Who asks, by what its call says of stops: it knows those it was told of, and its own before that call."""
        match stops:
            case [int(told), int(own)]:
                known = max([told, *self._own[: max(own, 0)]])
            case _:
                known = self._stops.count
        if not stops_too:
            return Asked(known)
        mine = len(self._own)
        self._own.append(self._stops.count)

        def stopped(number: int) -> None:
            self._own[mine] = number

        return Asked(known, stopped)

    async def reply(self, answer: dict[str, object]) -> None:
        """Send the answer to a call; until it has gone, or the window has."""
        if not self._gone:
            taken = asyncio.Event()
            self._replies.append((answer, taken))
            self._work.set()
            await taken.wait()

    async def send(self) -> None:
        """Send what there is, until the window has gone."""
        under_way: list[tuple[dict[str, object], asyncio.Event]] = []
        try:
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                while True:
                    with contextlib.suppress(TimeoutError):
                        async with asyncio.timeout(BEAT):
                            await self._work.wait()
                    self._work.clear()
                    values, self._values = self._values, {}
                    under_way, self._replies = self._replies, []
                    if values or not under_way:
                        told: dict[str, object] = {"beat": _clock()}
                        if values:
                            told["set"] = values
                        await self._socket.send_text(json.dumps(told, separators=(",", ":")))
                    for answer, taken in under_way:
                        await self._socket.send_text(json.dumps(answer, separators=(",", ":"), default=_plain))
                        taken.set()
        finally:
            self._gone = True
            for _, taken in (*under_way, *self._replies):
                taken.set()


def _plain(value: object) -> object:
    """What JSON has no form for, as it comes from the engine."""
    if isinstance(value, (set, frozenset)):
        return sorted(value)
    if isinstance(value, bytes):
        return value.hex()
    raise TypeError(f"{type(value).__name__} does not go to a window")
