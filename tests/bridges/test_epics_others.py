"""Motor records while another host moves their motors: a stop is one for whoever has begun the motion."""

import asyncio
from typing import Any

import pytest
from tests.bridges.record_bench import ALL, Bench, run

from detent.bridges.epics.fields import Go
from detent.bridges.epics.motor import PutFailed
from detent.realtime.connect import connect_async

MOVES = ["move", "run", "home"]


async def moved_by_another(bench: Bench, how: str) -> Any:
    """Another host, which knows nothing of the record, begins a motion."""
    other = await connect_async(bench.axis.model, bench.port, **bench.axis.options)
    match how:
        case "run" if bench.axis.model != "supersigma":
            await other.run_at(300)
        case "home" if bench.axis.model != "bs0710":
            await other.home(-1 if bench.axis.model == "supersigma" else 1)
        case _:
            await other.move_by(30000)
    await bench.port.wait(0.3)
    return other


def stands(bench: Bench) -> bool:
    bench.cell.run_to(bench.cell.now + 5_000_000_000)
    before = bench.shaft()
    bench.cell.run_to(bench.cell.now + 5_000_000_000)
    return before == bench.shaft()


@pytest.mark.parametrize("put", [("STOP", 1), ("SPMG", Go.STOP), ("SPMG", Go.PAUSE)])
@pytest.mark.parametrize("how", MOVES)
@pytest.mark.parametrize("model", ALL)
def test_a_stop_stops_what_another_host_has_begun(model: str, how: str, put: tuple[str, int]) -> None:
    async def test() -> None:
        bench = Bench(model)
        record = await bench.begin()
        await moved_by_another(bench, how)
        await record.put(*put)
        assert bench.shaft() != 0
        assert stands(bench)
        assert bench["STOP"] == 0
        if model not in ("supersigma",) and how != "home":  # its driver counts its own movements only
            assert bench["RRBV"] == bench.shaft()
            assert put[1] == Go.PAUSE or bench["VAL"] == bench["RBV"]

    run(test)


@pytest.mark.parametrize("field", ["VAL", "JOGF", "HOMF", "HOMR"])
@pytest.mark.parametrize("how", MOVES)
@pytest.mark.parametrize("model", ALL)
def test_a_put_while_another_host_moves_does_what_it_says_or_fails(model: str, how: str, field: str) -> None:
    async def test() -> None:
        bench = Bench(model)
        record = await bench.begin()
        await moved_by_another(bench, how)
        task = asyncio.create_task(record.put(field, 5 if field == "VAL" else 1))
        for _ in range(50):
            await asyncio.sleep(0)
        if field == "VAL" and how != "home":  # which, without switches, never ends
            try:
                await task
            except PutFailed:
                assert bench["DMOV"] == 1
            else:
                assert model == "supersigma" or bench.shaft() == 500
        await record.put("STOP", 1)
        with_error = await asyncio.gather(task, return_exceptions=True)
        assert all(one is None or isinstance(one, PutFailed) for one in with_error)
        assert stands(bench)
        assert (bench["DMOV"], bench["MOVN"]) == (1, 0)

    run(test)
