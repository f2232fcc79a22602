"""A cell behind real pins (a fake board) in the process of the workbench: what windows see, do, and may not do."""

import asyncio
import os
import signal
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from tests.workbench.patience import PATIENCE

from detent.cell.description import Problem
from detent.realtime.endpoints.spec import EndpointSpec
from detent.ticks import MS
from detent.workbench.client import Bench, BenchError
from detent.workbench.line_scripts import LineScripts
from detent.workbench.live import Live
from detent.workbench.stops import BOARDS, Asked, Overtaken, asked_by

CELL = """
[units.x]
model = "gs-c200"
straps = { CHS = "low" }
[boards.b]
serial = "fake:rp2040"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
inputs = { EOT = "^gpio10", HOME = "^gpio11" }
"""


def play(
    scene: Callable[[Bench], Awaitable[None]], tmp_path: Path, text: str = CELL, line_timing: bool = False
) -> None:
    async def whole() -> None:
        cell = tmp_path / "cell.toml"
        cell.write_text(text)
        bench = await Bench.open(
            str(cell), real=True, endpoints=[EndpointSpec("tcp", "127.0.0.1:0")], line_timing=line_timing
        )
        try:
            await asyncio.wait_for(scene(bench), PATIENCE)
        finally:
            await bench.close()

    asyncio.run(whole())


def position(bench: Bench) -> int:
    return bench.state.units["x"].axes[""].position


def test_windows_see_what_the_machine_does_and_look_back_while_it_goes_on(tmp_path: Path) -> None:
    async def scene(bench: Bench) -> None:
        await bench.type("x", "+300")
        state = await bench.until(lambda _: position(bench) == 300)
        assert state.real is not None
        assert state.real.standing == "driven"
        await bench.rewind(state.now // 2)
        state = await bench.until(lambda state: state.past)
        assert state.stopped_why == "looking back; the machine goes on"
        assert 0 < position(bench) < 300
        for refused in (bench.type("x", "+3"), bench.restart(), bench.pace(2), bench.run_to("x", 0),
                        bench.set_breakpoints("x", [3]), bench.break_on_errors(True)):  # fmt: skip
            with pytest.raises(BenchError, match=r"looking back|real pins are driven"):
                await refused
        await bench.go()
        await bench.type("x", "-100")
        await bench.until(lambda _: position(bench) == 200)
        with pytest.raises(BenchError, match="its level is that of the pin"):
            await bench.set_pin("x", "EOT", 0)
        assert bench.state.units["x"].held_pins == frozenset()

    play(scene, tmp_path)


def test_stop_and_recover(tmp_path: Path) -> None:
    async def scene(bench: Bench) -> None:
        await bench.type("x", "+30000")
        await bench.until(lambda _: position(bench) > 100)
        await bench.stop_motors()
        state = await bench.until(lambda state: state.real is not None and state.real.standing == "fault")
        assert state.real is not None
        assert state.real.why == "x: emergency stop"
        await bench.recover()
        await bench.until(lambda state: any("goes on at" in mark.text for mark in state.marks))
        told = next(mark.text for mark in bench.state.marks if "goes on at" in mark.text)
        counted = int(told.split(" goes on at ")[1].split(",")[0])
        await bench.until(lambda _: position(bench) == counted)  # the view comes to where the board has counted
        await bench.type("x", "-50")
        await bench.until(lambda _: position(bench) == counted - 50)
        assert bench.crashed is None

    play(scene, tmp_path)


def test_outputs_that_a_stop_has_put_at_rest_are_told_where_the_panel_shows_what_the_cell_has(tmp_path: Path) -> None:
    async def scene(bench: Bench) -> None:
        await bench.type("x", "A1")
        await bench.until(lambda state: state.units["x"].pins.get("UO1") == 1)
        await bench.stop_motors()
        state = await bench.until(lambda state: state.real is not None and state.real.standing == "fault")
        assert state.real is not None
        assert state.real.why == "x: emergency stop; at rest on their pins, whatever is shown: x.UO1"
        await bench.recover()
        await bench.until(lambda state: state.real is not None and state.real.standing == "driven")
        assert bench.state.real is not None
        assert bench.state.real.why == ""

    play(scene, tmp_path, CELL + 'outputs = { UO1 = "gpio6", RDY = "gpio7" }\n')


def test_a_process_that_does_not_take_a_stop_is_ended_and_that_is_told(tmp_path: Path) -> None:
    """Boards stop when nobody drives them; one that hangs would go on with what it has planned when it wakes."""

    async def scene(bench: Bench) -> None:
        await bench.type("x", "+30000")
        await bench.until(lambda _: position(bench) > 100)
        pid = bench.engine_pid
        assert pid is not None
        os.kill(pid, signal.SIGSTOP)
        with pytest.raises(BenchError, match=r"did not answer .* was ended: .* switch off the supply"):
            await bench.stop_motors()
        assert bench.engine_pid is None
        assert bench.crashed is not None
        assert "switch off the supply" in bench.crashed
        with pytest.raises(BenchError, match="switch off the supply"):
            await bench.stop_motors()
        await bench.revive()
        assert bench.state.real is not None

    play(scene, tmp_path)


def test_a_script_ends_where_the_machine_is_stopped_and_sends_nothing_when_it_goes_on(tmp_path: Path) -> None:
    async def scene(bench: Bench) -> None:
        live = Live()
        scripts = LineScripts(bench, live)

        def told() -> Any:
            return live.get("script.x") or {}

        scripts.start("x", "x", "+20\n@ 200 ms\n-20\n@ 200 ms\n@ again")
        await bench.until(lambda _: told().get("line") == 3)
        await bench.stop_motors()
        await bench.until(lambda _: not told()["running"])
        assert "nothing more is sent, as the machine stands: x: emergency stop" in told()["told"]
        await bench.recover()
        await bench.until(lambda state: any("goes on at" in mark.text for mark in state.marks))
        assert not told()["running"]
        with pytest.raises(BenchError, match="which would stop wherever it is"):
            await bench.open_another("gs-c200")
        assert bench.crashed is None

    play(scene, tmp_path)


def test_a_board_that_is_not_there_is_said_as_by_serve(tmp_path: Path) -> None:
    async def scene(_: Bench) -> None:
        raise AssertionError("it was opened")

    with pytest.raises(Problem, match=r"boards\.b\.serial: .*plug it in"):
        play(scene, tmp_path, CELL.replace("fake:rp2040", "/dev/serial/by-id/usb-Klipper_x"))


def moves_of_a_window(bench: Bench) -> dict[str, Callable[[], Awaitable[Any]]]:
    """Whatever a window may ask of a machine that moves it, or what it does then."""
    return {
        "type": lambda: bench.queue_type("x", "+70"),
        "send": lambda: bench.queue_send("x", b"+70\r"),
        "start": lambda: bench.start("x"),
        "load": lambda: bench.load("x", b"\x00", 0),
        "save": lambda: bench.save("x"),
        "power": lambda: bench.power("x", False),
        "set_pin": lambda: bench.set_pin("x", "UI1", 0),
        "recover": bench.recover,
    }


def test_nothing_that_was_asked_of_a_machine_before_a_stop_is_done_behind_recover(tmp_path: Path) -> None:
    """However soon somebody says Recover: scripts that were between two lines, calls that were on their way."""

    async def scene(bench: Bench) -> None:
        live = Live()
        bench.check_moves = partial(live.stops.check, BOARDS)
        scripts = LineScripts(bench, live)
        with asked_by(Asked(live.stops.count)):
            scripts.start("x", "x", "+20\n@ 200 ms\n+20\n@ again")
            await bench.until(lambda _: (live.get("script.x") or {}).get("line") == 2)
            live.stops.stop(BOARDS)
            stopping = [asyncio.create_task(bench.stop_motors())]
            for what, move in moves_of_a_window(bench).items():
                with pytest.raises(Overtaken):
                    print(what, await move())
        await asyncio.gather(*stopping)
        with asked_by(Asked(live.stops.count)):
            await bench.recover()
            state = await bench.until(lambda state: state.real is not None and state.real.standing == "driven")
            await bench.until(lambda later: later.now > state.now + 300 * MS)  # what is seen is a moment late
            await bench.until(lambda _: not (live.get("script.x") or {})["running"])
            told: Any = live.get("script.x")
            assert "STOP came behind it" in told["told"] or "as the machine stands" in told["told"]
            stood = position(bench)
            await bench.queue_type("x", "+50")
            await bench.until(lambda _: position(bench) == stood + 50)

    play(scene, tmp_path)


def test_what_waits_on_a_line_when_a_machine_is_stopped_is_not_heard_when_it_goes_on(tmp_path: Path) -> None:
    async def scene(bench: Bench) -> None:
        await bench.send("x", b"+1\r" * 400)  # more than a second at 9600 baud
        await bench.until(lambda _: position(bench) > 3)
        await bench.stop_motors()
        await bench.until(lambda state: state.real is not None and state.real.standing == "fault")
        await bench.recover()
        state = await bench.until(lambda state: state.real is not None and state.real.standing == "driven")
        seen = await bench.until(lambda later: later.now > state.now + 500 * MS)  # what is seen is a moment late
        stood = position(bench)
        await bench.until(lambda later: later.now > seen.now + 1500 * MS)
        assert position(bench) - stood <= 1

    play(scene, tmp_path, line_timing=True)


def test_a_stop_that_comes_while_a_machine_is_begun_anew_ends_that(tmp_path: Path) -> None:
    """As soon as it lives a program that it keeps may move it."""

    async def scene(bench: Bench) -> None:
        live = Live()
        bench.check_moves = partial(live.stops.check, BOARDS)
        await bench.kill()
        with asked_by(Asked(live.stops.count)):
            reviving = asyncio.create_task(bench.revive())
        await asyncio.sleep(0)
        live.stops.stop(BOARDS)
        with pytest.raises(BenchError):
            await bench.stop_motors()
        with pytest.raises(Overtaken):
            await reviving
        assert bench.crashed is not None
        while bench.engine_pid is not None:
            await asyncio.sleep(0)
        await bench.revive()  # asked behind it
        assert bench.crashed is None

    play(scene, tmp_path)
