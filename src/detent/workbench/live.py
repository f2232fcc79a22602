"""What all windows show, as one flat table of keys and values, and the calls that they make.

One socket a window (`/live`). The server pushes what changed since it pushed last, as JSON ``{"set": {KEY: VALUE}}``;
a window that is slow gets fewer and newer values, never a queue. It hears something every `BEAT` seconds, if only
``{}``: so a window knows a server that hangs from a cell that stands. A window calls
``{"call": NAME, "args": [...], "id": N}`` and gets ``{"id": N, "value": ...}`` or ``{"id": N, "error": TEXT}``.
"""

import asyncio
import contextlib
import json
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import TypeAlias

from pydantic import ValidationError, validate_call
from starlette.websockets import WebSocket, WebSocketDisconnect

from detent.hosts.errors import told

Value: TypeAlias = "str | int | float | bool | Sequence[Value] | Mapping[str, Value] | None"
Call: TypeAlias = Callable[..., Awaitable[object]]

MISTAKES = (ValueError, KeyError, TypeError, OSError, RuntimeError)  # whose text is for the person at the window
LONGEST_CALL = 1 << 20  # characters
BEAT = 1.0  # seconds


class Live:
    """The table, the windows that look at it, and what they may call."""

    def __init__(self) -> None:
        self._table: dict[str, Value] = {}
        self._windows: set[_Window] = set()
        self._calls: dict[str, Call] = {}
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

    def offer(self, name: str, call: Call) -> None:
        """Let windows call `call` by `name`. Its arguments are checked against its annotations."""
        if name in self._calls:
            raise ValueError(f"there is a call {name!r} already")
        self._calls[name] = validate_call(call)

    async def serve(self, socket: WebSocket) -> None:
        """One window, from its socket's opening to its end.

        What it has asked for is done though it leaves at once: who closes a window behind a STOP has stopped.
        """
        await socket.accept()
        window = _Window(socket)
        window.show(self._table)
        self._windows.add(window)
        self.put({"windows": self.windows})
        sender = asyncio.create_task(window.send())
        try:
            while True:
                text = await socket.receive_text()
                if len(text) > LONGEST_CALL:
                    break
                answer = asyncio.create_task(self._answer(window, text))
                self._answers.add(answer)
                answer.add_done_callback(self._answers.discard)
        except (WebSocketDisconnect, RuntimeError, KeyError):  # gone, or it sent what is no text
            pass
        finally:
            self._windows.discard(window)
            sender.cancel()
            self.put({"windows": self.windows})
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await socket.close()

    async def _answer(self, window: "_Window", text: str) -> None:
        """Carry out a call, tell its window what came of it."""
        try:
            asked = json.loads(text)
            number, name, arguments = int(asked["id"]), str(asked["call"]), list(asked.get("args", ()))
        except (ValueError, KeyError, TypeError):
            return  # nobody who waits for an answer
        try:
            call = self._calls.get(name)
            if call is None:
                raise ValueError(f"there is no call {name!r}")
            window.reply({"id": number, "value": await call(*arguments)})
        except ValidationError as error:
            first = error.errors()[0]
            window.reply({"id": number, "error": f"{name}: {first['msg']} (it is {first.get('input')!r})"})
        except MISTAKES as error:
            words = error.args[0] if isinstance(error, KeyError) and error.args else told(error)
            window.reply({"id": number, "error": str(words) or type(error).__name__})


class _Window:
    """What is to be sent to one window."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self._values: dict[str, Value] = {}
        self._replies: list[dict[str, object]] = []
        self._work = asyncio.Event()

    def show(self, values: Mapping[str, Value]) -> None:
        """Send these values soon; values of the same keys that still wait are left out."""
        self._values.update(values)
        self._work.set()

    def reply(self, answer: dict[str, object]) -> None:
        """Send the answer to a call."""
        self._replies.append(answer)
        self._work.set()

    async def send(self) -> None:
        """Send what there is, for ever."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(BEAT):
                        await self._work.wait()
                self._work.clear()
                values, self._values = self._values, {}
                replies, self._replies = self._replies, []
                if values or not replies:
                    told = {"set": values} if values else {}
                    await self._socket.send_text(json.dumps(told, separators=(",", ":")))
                for answer in replies:
                    await self._socket.send_text(json.dumps(answer, separators=(",", ":"), default=_plain))


def _plain(value: object) -> object:
    """What JSON has no form for, as it comes from the engine."""
    if isinstance(value, (set, frozenset)):
        return sorted(value)
    if isinstance(value, bytes):
        return value.hex()
    raise TypeError(f"{type(value).__name__} does not go to a window")
