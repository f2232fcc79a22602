"""Nothing that was asked before a stop moves anything behind it: every call that moves, every kind of unit and stop."""

import asyncio
import json
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from starlette.websockets import WebSocketDisconnect
from tests.workbench.test_units import Desk, at_desk, served

import detent.workbench.units.unit
from detent.realtime.connect import connect_async
from detent.workbench.live import Live
from detent.workbench.stops import Asked, Overtaken, Stops, asked_by
from detent.workbench.units.registry import MOVING

pytestmark = pytest.mark.waits

NAME = "axis"
LINES = {"gs-c200": "+500", "dcb-274": "+ 500", "bs0610": "X+500", "supersigma": "GOTO 500"}
HOMES = {"gs-c200": True, "dcb-274": True, "bs0610": False, "supersigma": True}
HOLDS = {"gs-c200": True, "dcb-274": True, "bs0610": True, "supersigma": False}
KEPT = {"gs-c200": "+500", "dcb-274": "+ 500"}  # of a program


class Window:
    """A socket of a window: it says of stops what `workbench.js` does."""

    def __init__(self, live: Live) -> None:
        self._live, self._own, self._number = live, 0, 0
        self._calls = asyncio.Queue[str]()
        self._waiting: dict[int, asyncio.Future[Any]] = {}
        self._serving = asyncio.create_task(live.serve(self))  # type: ignore[arg-type]

    async def accept(self) -> None:
        pass

    async def receive_text(self) -> str:
        if not (text := await self._calls.get()):
            raise WebSocketDisconnect
        return text

    async def send_text(self, text: str) -> None:
        told = json.loads(text)
        if "id" in told:
            self._waiting[told["id"]].set_result(told)

    async def close(self) -> None:
        pass

    def asking(self) -> "Hand":
        """A hand that acts now."""
        return Hand(self, self._live.stops.count, self._own)

    def call(self, name: str, *arguments: object) -> "asyncio.Future[Any]":
        return self.asking().call(name, *arguments)

    def say(self, name: str, arguments: Sequence[object], known: list[int]) -> "asyncio.Future[Any]":
        self._number += 1
        self._own += name in ("stop_all", "unit_stop")
        future = self._waiting[self._number] = asyncio.get_running_loop().create_future()
        self._calls.put_nowait(json.dumps({"call": name, "args": arguments, "id": self._number, "stops": known}))
        return future

    async def leave(self) -> None:
        self._calls.put_nowait("")
        await self._serving


class Hand(NamedTuple):
    """What one hand began, knowing the stops that its window was `told` of and those of its `own`."""

    window: Window
    told: int
    own: int

    def call(self, name: str, *arguments: object) -> "asyncio.Future[Any]":
        return self.window.say(name, arguments, [self.told, self.own])


STOPS = {"everything": ("stop_all",), "the unit": ("unit_stop", NAME)}
WAYS = [  # which stop, whether in the same window, whether the connection is there by then
    ("everything", True, False), ("everything", False, True), ("the unit", True, True), ("the unit", False, False),
]  # fmt: skip


@pytest.mark.parametrize("model", LINES)
def test_what_waits_for_a_connection_or_is_on_its_way_is_ended_by_a_stop(
    tmp_path: Path, model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever presses it, in whichever window; the stop itself is said as soon as the unit is there."""
    gate = asyncio.Event()
    options = "drive=1" if model == "supersigma" else ""

    async def slowly(model: str, port: Any, **options: Any) -> Any:
        await gate.wait()
        return await connect_async(model, port, **options)

    async def scene(desk: Desk) -> None:
        mine, other = Window(desk.live), Window(desk.live)
        there = ("unit_connect", model, address, options, NAME)
        gate.set()
        await mine.call(*there)
        kept = "value" in await mine.call("unit_backup", NAME, "kept.toml")
        await mine.call("unit_leave", NAME)
        tried = list(product(cases(model, kept), WAYS))
        for (what, given), (stop, same, late) in tried[
            :: 5 if model == "dcb-274" else 1
        ]:  # whose stop takes half a second
            gate.clear()
            hand = mine.asking()
            connecting = hand.call(*there)
            while NAME not in desk.stopping._stops:
                await asyncio.sleep(0)
            if late:
                gate.set()
                await connecting
            stopping = (mine if same else other).call(*STOPS[stop])
            while desk.live.stops.count == hand.told:
                await asyncio.sleep(0)
            gate.set()
            assert "value" in await connecting
            told = await hand.call(what, *given)
            words = told.get("error") or told["value"][0]["meaning"]
            assert "STOP came behind it" in words, (what, given, stop, same, late, told)
            assert "value" in await stopping
            assert not desk.facts(NAME)["held"]
            await mine.call("unit_leave", NAME)
        again = mine.asking()
        await again.call(*there)
        if model != "supersigma":  # which knows no place before it was sent home
            assert "value" in await again.call("unit_move", NAME, "jog", 70), "asked behind all of them it is done"
            await desk.until(NAME, lambda facts: facts["position"] == 70 and not facts["moving"])
        await mine.leave()
        await other.leave()

    with served(model) as address:
        monkeypatch.setattr(detent.workbench.units.unit, "connect_async", slowly)
        at_desk(tmp_path, scene)


def test_a_unit_that_cannot_be_connected_to_is_not_said_to_be_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate = asyncio.Event()

    async def never(*_: Any, **__: Any) -> Any:
        await gate.wait()
        raise OSError(113, "no route to host")

    async def scene(desk: Desk) -> None:
        window = Window(desk.live)
        connecting = window.call("unit_connect", "gs-c200", "far:1", "", NAME)
        while not desk.live.get("stop.able"):
            await asyncio.sleep(0)
        stopping = [window.call(*stop) for stop in STOPS.values()]
        await asyncio.sleep(0)
        gate.set()
        for told in [*await asyncio.gather(*stopping), await connecting]:
            assert "no route to host" in told["error"]
        assert desk.live.get("stop.able") == []
        assert "no unit 'axis' is connected" in (await window.call("unit_stop", NAME))["error"]
        await window.leave()

    monkeypatch.setattr(detent.workbench.units.unit, "connect_async", never)
    at_desk(tmp_path, scene)


def test_a_stop_of_one_unit_ends_nothing_of_another_and_its_own_window_goes_on_at_once(tmp_path: Path) -> None:
    async def scene(desk: Desk) -> None:
        window = Window(desk.live)
        for name, address in (("a", first), ("b", second)):
            await window.call("unit_connect", "gs-c200", address, "", name)
        hand = window.asking()
        assert "value" in await window.call("unit_stop", "a")
        assert "value" in await hand.call("unit_move", "b", "jog", 20)
        assert "STOP came behind it" in (await hand.call("unit_move", "a", "jog", 20))["error"]
        hand = Hand(window, hand.told, window.asking().own)  # the table has not said yet that it was stopped
        assert "value" in await hand.call("unit_move", "a", "jog", 30)
        for name, place in (("a", 30), ("b", 20)):
            await desk.until(name, lambda facts, place=place: facts["position"] == place)  # type: ignore[misc]
        await window.leave()

    with served("gs-c200") as first, served("gs-c200") as second:
        at_desk(tmp_path, scene)


def test_a_key_that_was_stopped_does_not_hold_what_another_window_begins_behind_it(tmp_path: Path) -> None:
    async def scene(desk: Desk) -> None:
        mine, other = Window(desk.live), Window(desk.live)
        await mine.call("unit_connect", "gs-c200", address, "", NAME)
        hand = mine.asking()
        assert "value" in await hand.call("unit_hold", NAME, 200.0)
        assert "value" in await hand.call("unit_held", NAME)
        assert "value" in await other.call("stop_all")
        while "error" in await other.call("unit_hold", NAME, 200.0):  # it still ramps down
            pass
        assert "STOP came behind it" in (await hand.call("unit_held", NAME))["error"]
        assert "value" in await other.call("unit_held", NAME)
        assert "value" in await other.call("unit_stop", NAME)
        for window in (mine, other):
            await window.leave()

    with served("gs-c200") as address:
        at_desk(tmp_path, scene)


def test_what_is_asked_without_a_window_is_behind_every_stop() -> None:
    stops = Stops()
    stops.stop("x")
    stops.check("x")
    with asked_by(Asked(stops.count)):
        stops.check("x")
    with asked_by(Asked(stops.count - 1)):
        stops.check("y")
        with pytest.raises(Overtaken):
            stops.check("y", "x")
    stops.check("x")


def cases(model: str, kept: bool) -> list[tuple[str, tuple[object, ...]]]:
    """Each call that moves a unit, with what it may be given; `kept`: there is a backup of it."""
    line = LINES[model]
    found: dict[str, list[tuple[object, ...]]] = {
        "unit_move": [(NAME, "jog", 500), (NAME, "go", 500), (NAME, "zero"), *[(NAME, "home", 1)] * HOMES[model]],
        "unit_hold": [(NAME, 300.0)] * HOLDS[model],
        "unit_held": [(NAME,)],
        "unit_say": [(NAME, line)],
        "unit_lines": [(NAME, [line, line])],
        "unit_both": [([NAME], line)],
        "unit_store": [(NAME, KEPT[model])] if model in KEPT else [],
        "unit_restore": [(NAME, "kept.toml", "seen")] * kept,
    }
    assert set(found) == set(MOVING), "every call that moves is tried"
    return [(what, one) for what, several in found.items() for one in several]
