"""A process of the cell that hangs: it is told, and can be ended; what was done is done again by the next one."""

import asyncio
import os
import signal

import pytest
from tests.workbench.patience import PATIENCE
from tests.workbench.test_units import Shown

from detent.workbench import board
from detent.workbench.client import Bench


async def shows(live: Shown, key: str, *, something: bool) -> object:
    while bool(live.get(key)) is not something:
        await live.changed()
    return live.get(key)


def test_a_process_that_says_nothing_is_told_and_can_be_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(board, "SILENT", 1.0)

    async def scene(bench: Bench) -> None:
        live = Shown()
        board.Board(bench, live)
        end = live._calls["end_silent"]
        await bench.type("gs-c200", "+70")
        await bench.until(lambda state: state.units["gs-c200"].axes[""].position == 70)
        before = bench.engine_pid
        assert before is not None
        await end()
        assert bench.engine_pid == before, "it was ended without a reason"
        os.kill(before, signal.SIGSTOP)
        await shows(live, "silent", something=True)
        os.kill(before, signal.SIGCONT)
        await shows(live, "silent", something=False)
        os.kill(before, signal.SIGSTOP)
        await shows(live, "silent", something=True)
        await end()
        assert bench.engine_pid not in (before, None)
        assert bench.crashed is None
        assert bench.state.units["gs-c200"].axes[""].position == 70
        await shows(live, "silent", something=False)

    async def whole() -> None:
        bench = await Bench.open("gs-c200", line_timing=False)
        try:
            await asyncio.wait_for(scene(bench), PATIENCE)
        finally:
            await bench.close()

    asyncio.run(whole())


def test_a_cell_that_stands_and_is_asked_nothing_is_not_silent() -> None:
    async def whole() -> None:
        bench = await Bench.open("gs-c200", held=True)
        try:
            await bench.until(lambda state: state.held)
            bench._heard -= 3600
            assert bench.silent == 0.0
            await bench.step_event()
            assert bench.silent == 0.0
        finally:
            await bench.close()

    asyncio.run(whole())
