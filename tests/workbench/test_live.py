"""The table that windows look at: what goes out, and what comes of a call."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Annotated, Any

import pytest
from pydantic import Field
from starlette.websockets import WebSocketDisconnect

import detent.workbench.live
from detent.workbench.live import LATE, MOST_CALLS, Live


class Socket:
    """A window's socket: `sent` by the server, `calls` by the window; it leaves once `leave` is set."""

    def __init__(self, *calls: object) -> None:
        self.sent: list[dict[str, Any]] = []
        self._calls = [json.dumps(call) if not isinstance(call, str) else call for call in calls]
        self.leave = asyncio.Event()
        self.ready = asyncio.Event()  # as many answers as calls have come
        self.open = asyncio.Event()
        self.open.set()  # cleared: the window takes nothing

    async def accept(self) -> None:
        pass

    async def receive_text(self) -> str:
        if self._calls:
            return self._calls.pop(0)
        await self.leave.wait()
        raise WebSocketDisconnect

    async def send_text(self, text: str) -> None:
        await self.open.wait()
        self.sent.append(json.loads(text))
        self.ready.set()

    async def close(self) -> None:
        pass

    def values(self) -> dict[str, Any]:
        """The table as this window knows it."""
        known: dict[str, Any] = {}
        for message in self.sent:
            known |= message.get("set", {})
        return known

    async def until(self, condition: Callable[[], object]) -> None:
        while not condition():
            self.ready.clear()
            await self.ready.wait()


async def with_window(live: Live, socket: Socket, then: Callable[[], Awaitable[None]]) -> None:
    serving = asyncio.create_task(live.serve(socket))  # type: ignore[arg-type]
    await socket.until(socket.values)
    await then()
    socket.leave.set()
    await serving


def answers(live: Live, *calls: object) -> list[dict[str, Any]]:
    """What a window gets back for its calls, by their numbers."""
    wanted = [call["id"] for call in calls if isinstance(call, dict) and "id" in call]

    async def run() -> list[dict[str, Any]]:
        socket = Socket(*calls)

        def found() -> list[dict[str, Any]]:
            return [message for message in socket.sent if "id" in message]

        async def wait() -> None:
            await socket.until(lambda: len(found()) == len(wanted))

        await with_window(live, socket, wait)
        return sorted(found(), key=lambda answer: answer["id"])

    return asyncio.run(run())


@pytest.fixture
def live() -> Live:
    made = Live()

    async def add(a: int, b: Annotated[int, Field(ge=0, le=9)] = 1) -> int:
        return a + b

    async def fail(kind: str) -> None:
        raise {
            "key": KeyError("no unit 'x'"),
            "file": OSError(2, "No such file", "a/b"),
            "run": RuntimeError("it is gone"),
        }[kind]

    made.offer("add", add)
    made.offer("fail", fail)
    return made


def test_a_new_window_gets_the_whole_table_and_then_what_changes(live: Live) -> None:
    live.put({"now": 1, "held": False})

    async def run() -> None:
        socket = Socket()

        async def change() -> None:
            live.put({"now": 2, "held": False})
            await socket.until(lambda: socket.values()["now"] == 2)

        await with_window(live, socket, change)
        assert socket.sent[0]["set"]["held"] is False
        assert all("held" not in message.get("set", {}) for message in socket.sent[1:])

    asyncio.run(run())


def test_a_slow_window_gets_the_newest_value_and_no_queue(live: Live) -> None:
    live.put({"now": 0})

    async def run() -> None:
        socket = Socket()

        async def change() -> None:
            socket.open.clear()
            for now in range(1, 101):
                live.put({"now": now})
                await asyncio.sleep(0)
            socket.open.set()
            await socket.until(lambda: socket.values()["now"] == 100)

        await with_window(live, socket, change)
        assert len(socket.sent) < 5

    asyncio.run(run())


def test_windows_are_counted_for_everybody(live: Live) -> None:
    async def run() -> None:
        one, two = Socket(), Socket()

        async def second() -> None:
            async def nothing() -> None:
                await one.until(lambda: one.values()["windows"] == 2)

            await with_window(live, two, nothing)
            await one.until(lambda: one.values()["windows"] == 1)

        await with_window(live, one, second)
        assert live.windows == 0

    asyncio.run(run())


def test_a_call_is_answered_with_its_value_or_with_the_reason_why_not(live: Live) -> None:
    found = answers(
        live,
        {"id": 1, "call": "add", "args": [40, 2]},
        {"id": 2, "call": "add", "args": [40, 12]},
        {"id": 3, "call": "add", "args": ["x"]},
        {"id": 4, "call": "add", "args": [1, 2, 3]},
        {"id": 5, "call": "sing", "args": []},
        {"id": 6, "call": "fail", "args": ["key"]},
        {"id": 7, "call": "fail", "args": ["file"]},
        {"id": 8, "call": "fail", "args": ["run"]},
    )
    assert found[0] == {"id": 1, "value": 42}
    assert "less than or equal to 9" in found[1]["error"]
    assert "valid integer" in found[2]["error"]
    assert "add: " in found[3]["error"]
    assert found[4]["error"] == "there is no call 'sing'"
    assert found[5]["error"] == "no unit 'x'"
    assert found[6]["error"] == "a/b: No such file"
    assert found[7]["error"] == "it is gone"


@pytest.mark.parametrize("given", ["x" * 100_000, 10**400, ["x"] * 50_000], ids=["text", "number", "list"])
def test_an_error_quotes_no_more_of_a_call_than_a_person_reads(live: Live, given: object) -> None:
    (answer,) = answers(live, {"id": 1, "call": "add", "args": [1, given]})
    assert len(answer["error"]) < 700


GARBAGE = [
    "", "{", "[]", "7", "null", '{"call": "add"}', '{"id": "x", "call": "add"}', "[" * 100_000, '{"a":' * 50_000,
    '{"id": NaN, "call": "add"}', '{"id": 1e999, "call": "add"}', '{"id": ' + "9" * 5000 + "}",
    '{"id": 1, "call": "add", "args": 7}',
]  # fmt: skip


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("garbage", GARBAGE, ids=lambda text: text[:30])
def test_garbage_from_a_window_is_ignored(live: Live, garbage: str) -> None:
    assert answers(live, garbage, {"id": 1, "call": "add", "args": [1]}) == [{"id": 1, "value": 2}]


def test_a_window_hears_something_where_nothing_changes(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detent.workbench.live, "BEAT", 0.01)

    async def run() -> None:
        socket = Socket()

        async def beats() -> None:
            await socket.until(lambda: sum(message.keys() == {"beat"} for message in socket.sent) >= 3)

        await with_window(live, socket, beats)

    asyncio.run(run())


def test_what_a_window_asks_for_is_done_though_it_leaves_at_once(live: Live) -> None:
    done: list[str] = []

    async def stop() -> None:
        done.append("begun")
        await asyncio.sleep(0)
        done.append("confirmed")

    live.offer("stop", stop)

    async def run() -> None:
        socket = Socket({"id": 1, "call": "stop"})
        socket.leave.set()
        await live.serve(socket)  # type: ignore[arg-type]
        for _ in range(10):
            await asyncio.sleep(0)

    asyncio.run(run())
    assert done == ["begun", "confirmed"]


def test_what_moves_is_not_done_late_and_a_stop_is(live: Live) -> None:
    done: list[str] = []

    async def move() -> None:
        done.append("move")

    async def stop() -> None:
        done.append("stop")

    live.offer("move", move, moves="units")
    live.offer("stop", stop)

    async def run() -> None:
        now = 1000 * asyncio.get_running_loop().time()
        long_ago = now - 1001 * LATE
        socket = Socket(
            {"id": 1, "call": "move", "heard": long_ago},
            {"id": 2, "call": "stop", "heard": long_ago},
            {"id": 3, "call": "move", "heard": now},
            {"id": 4, "call": "move", "heard": None},
        )

        async def answered() -> None:
            await socket.until(lambda: sum("id" in message for message in socket.sent) == 4)

        await with_window(live, socket, answered)
        (refused,) = [message for message in socket.sent if "error" in message]
        assert refused["id"] == 1
        assert "it is not done; ask again" in refused["error"]

    asyncio.run(run())
    assert sorted(done) == ["move", "move", "stop"]


def test_a_call_is_offered_once(live: Live) -> None:
    async def add() -> None:
        pass

    with pytest.raises(ValueError, match="already"):
        live.offer("add", add)


def test_whatever_a_call_ends_with_is_an_answer_of_a_line(live: Live) -> None:
    async def fails(how: str) -> None:
        raise {"assertion": AssertionError("x"), "arithmetic": OverflowError("too large"), "silent": AssertionError(),
               "long": ValueError("y" * 100_000), "lines": ValueError("a\n" * 100_000)}[how]  # fmt: skip

    live.offer("fails", fails)
    told_of: list[dict[str, Any]] = []

    async def run() -> list[dict[str, Any]]:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: told_of.append(context))
        hows = ("assertion", "arithmetic", "silent", "long", "lines", 1 << 20, "x" * 100_000)
        socket = Socket(*({"id": n, "call": "fails", "args": [how]} for n, how in enumerate(hows)))
        await with_window(live, socket, lambda: socket.until(lambda: len(socket.sent) > len(hows)))
        return [message for message in socket.sent if "id" in message]

    found = asyncio.run(run())
    assert [one["error"] for one in sorted(found, key=lambda one: one["id"])[:3]] == [
        "x",
        "too large",
        "AssertionError",
    ]
    assert len(found) == 7
    for one in found:
        assert len(one["error"]) < 1000, one["id"]
    assert len(told_of) == 3, "what is no mistake of the person at the window is a fault of ours: it is told"


def test_a_window_that_takes_no_answers_is_heard_no_further_and_may_leave(live: Live) -> None:
    """Neither what it asks nor what it would be answered is kept without a bound."""
    begun = 0

    async def count() -> str:
        nonlocal begun
        begun += 1
        return "x" * 1000

    live.offer("count", count)

    async def run() -> None:
        socket = Socket(*({"id": n, "call": "count"} for n in range(5 * MOST_CALLS)))
        socket.open.clear()
        serving = asyncio.create_task(live.serve(socket))  # type: ignore[arg-type]
        for _ in range(20 * MOST_CALLS):
            await asyncio.sleep(0)
        assert begun == MOST_CALLS
        socket.open.set()
        await socket.until(lambda: begun == 5 * MOST_CALLS)
        socket.leave.set()
        await serving

    asyncio.run(run())


def test_a_window_that_is_gone_while_its_answers_wait_is_let_go(live: Live) -> None:
    async def for_ever() -> None:
        await asyncio.Event().wait()

    live.offer("for_ever", for_ever)

    async def run() -> None:
        socket = Socket(*({"id": n, "call": "for_ever"} for n in range(2 * MOST_CALLS)))
        serving = asyncio.create_task(live.serve(socket))  # type: ignore[arg-type]
        await socket.until(lambda: socket.values().get("windows") == 1)

        async def gone(text: str) -> None:
            raise WebSocketDisconnect

        socket.send_text = gone  # type: ignore[method-assign]
        live.put({"now": 12345})
        socket.leave.set()
        await serving
        assert not live.windows

    asyncio.run(run())
