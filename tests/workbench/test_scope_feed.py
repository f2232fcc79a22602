"""The feed of the Scope page: what a window asks for, and the frames that it gets."""

import asyncio
import json
import struct
from collections.abc import Awaitable, Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from starlette.websockets import WebSocketDisconnect

from detent.ticks import SECOND, Ns
from detent.workbench.scope import ScopeData, Trace, Trigger
from detent.workbench.scope_feed import Feed, first_traces, lane, shape

TRACES = (
    Trace("bar.speed", "bar", "speed", "steps/s", False, "speed"),
    Trace("bar.UO1", "bar", "UO1", "", True, "user output 1"),
    Trace("slide.current_a", "slide", "current_a", "A", False, "phase current A"),
    Trace("slide.current_b", "slide", "current_b", "A", False, "phase current B"),
)
VIEW = {"traces": ["bar.speed", "bar.UO1"], "points": 100, "follow": True, "begin": -SECOND, "end": 0}


class Bench:
    """A cell at `now` whose pin rises every second, at the half, and whose speed counts the columns."""

    def __init__(self, now: Ns) -> None:
        wires = (SimpleNamespace(source="bar.UO1", targets=()),)
        self.picture = SimpleNamespace(title="A cell", target="cell.toml", wires=wires)
        self.state = SimpleNamespace(now=now, begin=0, marks=())
        self.traces, self.cut = TRACES, 0
        self.searched: list[Trigger] = []
        self.callbacks: list[Callable[[], None]] = []

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        self.callbacks.append(callback)
        return lambda: self.callbacks.remove(callback)

    def advance(self, by: Ns) -> None:
        self.state.now += by
        for callback in self.callbacks:
            callback()

    def scope(self, keys: Sequence[str], begin: Ns, end: Ns, points: int) -> ScopeData:
        rows = np.tile(np.arange(points, dtype=np.float64) + 1e9, (len(keys), 1))
        return ScopeData(begin, max((end - begin) // points, 1), points, rows, rows + 1)

    def value_at(self, trace: str, at: Ns) -> float:
        return float("nan") if at < 0 else at / SECOND

    def search(self, trigger: Trigger, begin: Ns, end: Ns, most: int = 1000) -> list[Ns]:
        self.searched.append(trigger)
        first = (begin + SECOND // 2 - 1) // SECOND
        return [k * SECOND + SECOND // 2 for k in range(first, end // SECOND + 1)
                if begin <= k * SECOND + SECOND // 2 <= end][:most]  # fmt: skip

    async def export(self, kind: str, begin: Ns, end: Ns, traces: Sequence[str]) -> bytes:
        return f"{kind} {begin} {end} {','.join(traces)}".encode()


class Window:
    """The window's end of the socket."""

    def __init__(self, bench: Bench) -> None:
        self.said: asyncio.Queue[str | None] = asyncio.Queue()
        self.got: asyncio.Queue[str | bytes] = asyncio.Queue()
        self.task = asyncio.create_task(Feed(bench, self).serve())  # type: ignore[arg-type]

    async def accept(self) -> None:
        pass

    async def receive_text(self) -> str:
        text = await self.said.get()
        if text is None:
            raise WebSocketDisconnect
        return text

    async def send_text(self, text: str) -> None:
        self.got.put_nowait(text)

    async def send_bytes(self, data: bytes) -> None:
        self.got.put_nowait(data)

    def say(self, message: object) -> None:
        self.said.put_nowait("" if message == "" else json.dumps(message))

    async def news(self) -> dict[str, Any]:
        text = await self.got.get()
        assert isinstance(text, str)
        found: dict[str, Any] = json.loads(text)
        return found

    async def frame(self) -> tuple[dict[str, Any], bytes]:
        data = await self.got.get()
        assert isinstance(data, bytes)
        (length,) = struct.unpack_from("<I", data)
        return json.loads(data[4 : 4 + length]), data[-(-(4 + length) // 8) * 8 :]

    async def leave(self) -> None:
        self.said.put_nowait(None)
        await self.task


def at(now: Ns, story: Callable[[Bench, Window], Awaitable[None]]) -> Bench:
    """Tell `story` with a cell at `now` and a window that has been told the traces."""

    async def run() -> Bench:
        bench = Bench(now)
        window = Window(bench)
        told = await window.news()
        assert [row["id"] for row in told["traces"]] == [trace.key for trace in TRACES]
        await story(bench, window)
        await window.leave()
        return bench

    return asyncio.run(run())


def test_a_window_that_follows_sees_as_much_time_before_the_present() -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say({"view": VIEW})
        header, arrays = await window.frame()
        assert (header["from"], header["to"], header["now"]) == (9 * SECOND, 10 * SECOND, 10 * SECOND)
        assert [trace["id"] for trace in header["traces"]] == VIEW["traces"]
        assert len(arrays) == 2 * 2 * 4 * header["count"]

    at(10 * SECOND, story)


def test_values_are_sent_above_their_base_so_that_large_ones_stay_exact() -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say({"view": VIEW})
        header, arrays = await window.frame()
        low = np.frombuffer(arrays, "<f4", header["count"])
        assert header["traces"][0]["base"] == 1e9
        assert (low == np.arange(header["count"])).all()  # 1e9 + 99 is no float32

    at(10 * SECOND, story)


def test_the_next_frame_waits_until_the_last_one_is_painted() -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say({"view": VIEW})
        await window.frame()
        bench.advance(SECOND)
        bench.advance(SECOND)
        for _ in range(20):
            await asyncio.sleep(0)
        assert window.got.empty()
        window.say("")
        header, _ = await window.frame()
        assert header["now"] == 12 * SECOND  # the newest, and not those between

    at(10 * SECOND, story)


def test_a_view_of_the_past_gets_no_frames_while_nothing_in_it_changes() -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say({"view": {**VIEW, "follow": False, "begin": 0, "end": SECOND}})
        await window.frame()
        window.say("")
        bench.advance(SECOND)
        window.say({"find": {"source": "error", "from": 0, "direction": 1}})
        assert "found" in await window.news()  # and no frame before it

    at(10 * SECOND, story)


def test_values_at_the_cursors_are_exact_and_nothing_where_nothing_is_known() -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say({"view": {**VIEW, "cursors": [3 * SECOND, -5]}})
        header, _ = await window.frame()
        assert header["traces"][0]["values"] == [3.0, None]

    at(10 * SECOND, story)


def test_a_trigger_holds_the_view_at_the_last_one_that_fills_it() -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say({"view": {**VIEW, "begin": -4 * SECOND, "trigger": {"source": "bar.UO1", "edge": "rise"}}})
        header, _ = await window.frame()
        # three quarters of four seconds lie behind it: 6.5 s is the last edge for which they have passed
        assert header["trigger"] == 6.5 * SECOND
        assert (header["from"], header["to"]) == (5.5 * SECOND, 9.5 * SECOND)
        window.say("")
        bench.advance(SECOND)
        header, _ = await window.frame()
        assert header["trigger"] == 7.5 * SECOND

    at(10 * SECOND, story)


def test_a_view_that_cannot_be_shown_keeps_no_other_from_the_window() -> None:
    async def story(bench: Bench, window: Window) -> None:
        elsewhere = {"source": "a.trace.of.the.cell.before", "edge": "rise"}
        window.say({"view": {**VIEW, "trigger": elsewhere}})
        header, _ = await window.frame()
        assert header["trigger"] is None
        window.say("")

        def refuse(*_: object) -> ScopeData:
            raise ValueError("there is nothing to show")

        bench.scope, shown = refuse, bench.scope  # type: ignore[method-assign]
        window.say({"view": VIEW})
        assert await window.news() == {"error": "there is nothing to show"}
        bench.scope = shown  # type: ignore[method-assign]
        window.say({"view": VIEW})
        await window.frame()

    at(100 * SECOND, story)


@pytest.mark.parametrize(("direction", "found"), [(1, 4.5), (-1, 3.5)])
def test_the_nearest_trigger_is_found_either_way(direction: int, found: float) -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say({"find": {"source": "bar.UO1", "from": 4 * SECOND, "direction": direction}})
        assert await window.news() == {"found": found * SECOND}

    at(10 * SECOND, story)


def test_a_curve_is_searched_where_it_crosses_the_level_and_a_pin_for_its_edges() -> None:
    async def story(bench: Bench, window: Window) -> None:
        for source in ("bar.speed", "bar.UO1", "error"):
            window.say({"find": {"source": source, "edge": "both", "level": 70, "from": 0, "direction": 1}})
            await window.news()

    up, down = Trigger("up", "bar.speed", 70), Trigger("down", "bar.speed", 70)
    assert at(SECOND, story).searched == [up, down, Trigger("edge", "bar.UO1", 70), Trigger("error")]


def test_nothing_found_is_told_as_well() -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say({"find": {"source": "bar.UO1", "from": 0, "direction": -1}})
        assert await window.news() == {"found": None}

    at(10 * SECOND, story)


@pytest.mark.parametrize(
    "message", [{"view": {}}, {"view": {**VIEW, "points": 10**9}}, {"find": {"source": "x", "from": 0, "direction": 3}},
                {"find": {"source": "nothing", "from": 0, "direction": 1}}]
)  # fmt: skip
def test_what_cannot_be_understood_is_answered_in_words(message: object) -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say(message)
        assert (await window.news())["error"]

    at(SECOND, story)


def test_a_file_comes_with_its_name() -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say({"export": {"kind": "csv", "traces": ["bar.speed"], "begin": -7, "end": 9}})
        header, data = await window.frame()
        assert header == {"file": "a-cell.csv"}
        assert data == b"csv 0 9 bar.speed"

    at(SECOND, story)


def test_frames_are_shown_while_a_file_is_made_and_one_is_made_at_a_time() -> None:
    async def story(bench: Bench, window: Window) -> None:
        made = asyncio.Event()

        async def slow(*_: object) -> bytes:
            await made.wait()
            return b"x"

        bench.export = slow  # type: ignore[method-assign]
        asked = {"export": {"kind": "csv", "traces": ["bar.UO1"], "begin": 0, "end": SECOND}}
        window.say(asked)
        for _ in range(3):
            window.say({"view": VIEW})
            header, _ = await window.frame()
            assert header["now"] == bench.state.now
            window.say("")
        window.say(asked)
        assert await window.news() == {"error": "an export is under way: wait for it"}
        made.set()
        header, data = await window.frame()
        assert (header, data[:1]) == ({"file": "a-cell.csv"}, b"x")
        made.clear()
        window.say(asked)  # and it leaves meanwhile

    at(100 * SECOND, story)


def test_a_window_that_leaves_is_not_called_any_more() -> None:
    async def story(bench: Bench, window: Window) -> None:
        window.say({"view": VIEW})
        await window.frame()

    assert at(SECOND, story).callbacks == []


def test_the_two_phase_currents_share_a_lane_and_only_pulses_make_stairs() -> None:
    assert lane(TRACES[2]) == lane(TRACES[3]) != lane(TRACES[0])
    assert [shape(trace) for trace in TRACES] == ["line", "step", "line", "line"]
    assert first_traces(TRACES, ["bar.UO1"]) == ["bar.speed", "bar.UO1"]
