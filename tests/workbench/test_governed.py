"""The control interface beside the workbench: programs and windows do the same things to one cell (decision 30)."""

import asyncio
import http.client
import json
import os
import signal
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from tests.workbench.patience import PATIENCE
from tests.workbench.test_driven import CELL

from detent.cell.description import Problem
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.endpoints.tcp import TcpAddress
from detent.ticks import MS
from detent.workbench.client import Bench, BenchError

ANYWHERE = TcpAddress("127.0.0.1", 0)


def played(scene: Callable[[Bench], Awaitable[None]], target: str = "gs-c200s", **options: Any) -> None:
    """Open a bench that is controlled, play the scene, close it."""

    async def whole() -> None:
        more: dict[str, Any] = {"straps": ("CHS=low",), "held": True} | options
        bench = await Bench.open(target, control=ANYWHERE, **more)
        try:
            await asyncio.wait_for(scene(bench), PATIENCE)
        finally:
            await bench.close()

    asyncio.run(whole())


def _asked(url: str, verb: str, given: dict[str, object], token: str) -> tuple[int, Any]:
    connection = http.client.HTTPConnection(url.removeprefix("http://"), timeout=PATIENCE)
    headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {token}"} if token else {})
    connection.request("POST", f"/{verb}", json.dumps(given), headers)
    response = connection.getresponse()
    status, answer = response.status, json.loads(response.read())
    connection.close()
    return status, answer


async def ask(bench: Bench, verb: str, token: str = "", **given: object) -> Any:
    """What a program is answered."""
    assert bench.control_url is not None
    status, answer = await asyncio.to_thread(_asked, bench.control_url, verb, given, token)
    assert status == 200, answer
    return answer


async def refused(bench: Bench, verb: str, **given: object) -> str:
    """Why a program is not answered."""
    assert bench.control_url is not None
    status, answer = await asyncio.to_thread(_asked, bench.control_url, verb, given, "")
    assert 400 <= status < 500, answer
    return f"{answer['error']}; {answer['remedy']}"


def test_without_a_word_nobody_listens() -> None:
    async def scene() -> None:
        bench = await Bench.open("gs-c200s", held=True)
        assert bench.control_url is None
        await bench.close()

    asyncio.run(scene())


def test_what_a_program_sends_waits_in_the_queue_and_goes_out_in_the_instant_in_which_time_goes_on() -> None:
    async def scene(bench: Bench) -> None:
        unit = "gs-c200s"
        told = await ask(bench, "type", text="+1000")
        assert (told["paused"], told["waiting"], told["why"]) == (True, 1, "by hand")
        await bench.queue_type(unit, "V1")  # a window
        state = await bench.until(lambda state: len(state.queue) == 2)
        assert [(one.unit, one.text) for one in state.queue] == [(unit, "+1000"), (unit, "V1")]
        await ask(bench, "send", data="V2\\r")
        await bench.withdraw(state.queue[1].number)
        began = bench.state.now
        reached = await ask(bench, "wait", position=417, resume=True, pause=True)
        assert reached["reached"] is True
        state = await bench.until(lambda state: state.held)
        assert state.units[unit].axes[""].position == 417
        assert (state.queue, state.stopped_why) == ((), "by a program")
        journal = (await ask(bench, "journal"))["journal"]
        assert [(entry["deed"], entry["at_ns"]) for entry in journal] == [("Type", began), ("Send", began)]

    played(scene)


def test_what_waits_can_be_cleared() -> None:
    async def scene(bench: Bench) -> None:
        await ask(bench, "type", text="+1")
        await ask(bench, "clear")
        assert (await ask(bench, "state"))["waiting"] == 0
        await bench.until(lambda state: not state.queue)

    played(scene)


def test_actions_of_a_program_are_marked_and_can_be_gone_back_over() -> None:
    async def scene(bench: Bench) -> None:
        await ask(bench, "step", time="10 ms")
        await ask(bench, "set", pin="UI1", level=0)
        fault = (await ask(bench, "fault", where="gs-c200s", kind="bit-errors", rate=0.5))["fault"]
        await ask(bench, "step", time="10 ms")
        await ask(bench, "mend", fault=fault)
        state = await bench.until(lambda state: not state.faults and len(state.marks) == 3)
        assert [(mark.at, mark.unit, mark.text) for mark in state.marks] == [
            (10 * MS, "gs-c200s", "UI1 to 0"),
            (10 * MS, "", "bit-errors at gs-c200s"),
            (20 * MS, "", "fault 1 mended"),
        ]
        assert state.units["gs-c200s"].pins["UI1"] == 0
        await bench.rewind(15 * MS)
        state = await bench.until(lambda state: state.past)
        assert list(state.faults) == [fault]
        await bench.rewind(5 * MS)
        told = await ask(bench, "pins")
        assert told["pins"]["gs-c200s"]["UI1"]["level"] == 1, "a program sees what the windows show"

    played(scene)


def test_in_the_past_a_program_only_looks_and_what_it_sends_waits() -> None:
    async def scene(bench: Bench) -> None:
        await ask(bench, "step", time="20 ms")
        await bench.rewind(5 * MS)
        told = await ask(bench, "state")
        assert (told["time_ns"], told["past"], told["present_ns"]) == (5 * MS, True, 20 * MS)
        for verb, given in (
            ("set", {"pin": "UI1", "level": 0}),
            ("power", {"on": False}),
            ("fault", {"where": "line", "kind": "cable-out"}),
            ("resume", {}),
            ("step", {}),
            ("step", {"time": "1 ms"}),
            ("run-for", {"time": "1 ms"}),
            ("wait", {"time": "1 ms", "resume": True, "position": 5}),
        ):
            assert await refused(bench, verb, **given) == (
                "somebody looks back, at 0.005000 s of 0.020000 s; "
                "present takes the cell to its present; to go on from the past is for hands"
            )
        await ask(bench, "type", text="+5")
        await ask(bench, "pause")
        await ask(bench, "pace", pace=2)
        state = await bench.until(lambda state: bool(state.queue))
        assert (state.past, state.end, state.branches) == (True, 20 * MS, ()), "nothing of it is lost"
        assert (await ask(bench, "present"))["time_ns"] == 20 * MS
        await ask(bench, "wait", position=5, resume=True)

    played(scene)


def test_a_wait_is_not_met_by_what_somebody_looks_back_at() -> None:
    async def scene(bench: Bench) -> None:
        await ask(bench, "type", text="+10")
        await ask(bench, "wait", position=10, state="ready", resume=True, pause=True)
        waits = asyncio.create_task(ask(bench, "wait", position=0))
        await ask(bench, "state")
        await bench.rewind(0)
        assert (await ask(bench, "state"))["units"]["gs-c200s"]["axes"][""]["position"] == 0
        assert not waits.done()
        await bench.rewind(bench.state.end)
        await ask(bench, "type", text="-10")
        await ask(bench, "resume")
        assert (await waits)["reached"] is True

    played(scene, pace=None)


def test_a_step_ends_where_the_windows_let_the_cell_stop() -> None:
    async def scene(bench: Bench) -> None:
        unit = "gs-c200s"
        await bench.break_on_errors(True)
        await ask(bench, "type", text="Y")
        told = await ask(bench, "step", time="1 s")
        assert told["reached"] is False
        assert "refused 'Y'" in told["why"]
        assert told["time_ns"] < 1000 * MS
        assert unit in told["units"]

    played(scene)


def test_who_waits_is_told_when_the_cell_begins_anew() -> None:
    async def scene(bench: Bench) -> None:
        waits = asyncio.create_task(ask(bench, "wait", position=7))
        while not waits.done():  # it may be heard behind the first of them
            await ask(bench, "step", time="10 ms")
            await bench.restart()
        told = await waits
        assert (told["reached"], told["time_ns"]) == (False, 0)
        assert (await ask(bench, "pins"))["time_ns"] == 0

    played(scene)


def test_programs_find_the_cell_again_behind_a_crash_and_in_another_cell() -> None:
    async def scene(bench: Bench) -> None:
        url = bench.control_url
        await ask(bench, "type", text="+3")
        await bench.until(lambda state: bool(state.queue))
        assert bench.engine_pid is not None
        os.kill(bench.engine_pid, signal.SIGKILL)
        with pytest.raises(BenchError):
            await bench.until(lambda _: False)
        await bench.revive()
        assert bench.control_url == url
        assert (await ask(bench, "state"))["waiting"] == 1, "what waited still does"
        await bench.open_another("dcb-274")
        assert bench.control_url == url
        assert list((await ask(bench, "state"))["units"]) == ["dcb-274"]

    played(scene)


def test_a_token_is_asked_for() -> None:
    async def scene(bench: Bench) -> None:
        assert "a token is needed" in await refused(bench, "state")
        assert (await ask(bench, "state", token="something long"))["past"] is False

    played(scene, token="something long")


@pytest.mark.parametrize(
    ("address", "token", "error"),
    [
        (TcpAddress("0.0.0.0", 0), None, "open to other computers: give --token"),
        (ANYWHERE, "short", "too short; at least 8 characters"),
    ],
)
def test_a_place_that_is_open_to_others_needs_a_token(address: TcpAddress, token: str | None, error: str) -> None:
    async def scene() -> None:
        with pytest.raises(Problem, match=error):
            await Bench.open("gs-c200s", control=address, token=token)

    asyncio.run(scene())


def test_a_program_acts_on_the_machine_while_somebody_looks_back(tmp_path: Path) -> None:
    cell = tmp_path / "cell.toml"
    cell.write_text(CELL)

    async def scene(bench: Bench) -> None:
        await ask(bench, "type", text="+300")
        await ask(bench, "wait", position=300, state="ready")
        state = await bench.until(lambda state: state.units["x"].axes[""].position == 300)
        await bench.rewind(state.now // 2)
        await bench.until(lambda state: state.past)
        await ask(bench, "type", text="-100")
        assert (await ask(bench, "wait", position=200, state="ready"))["reached"] is True
        assert "real pins are driven" in await refused(bench, "pause")
        assert (await ask(bench, "board"))["axes"]["x"]["standing"] == "driven"
        await ask(bench, "stop")
        await ask(bench, "recover")
        journal = (await ask(bench, "journal"))["journal"]
        assert [entry["deed"] for entry in journal if entry["deed"] == "Send"] == ["Send", "Send"]

    played(scene, str(cell), real=True, straps=(), held=False, line_timing=False,
           endpoints=[EndpointSpec("tcp", "127.0.0.1:0")])  # fmt: skip
