"""What a motor record shows and keeps: alarms, fields that contradict nothing, bad values, the axes of a cell."""

import asyncio
from contextlib import suppress
from typing import Any

import pytest
from tests.bridges.record_bench import ALL, Bench, failure, run

from detent.bridges.epics.cells import axes
from detent.bridges.epics.fields import COMMUNICATION, NO_ALARM, Settings, Status
from detent.bridges.epics.motor import PutFailed
from detent.cell.build import build
from detent.cell.description import parse


def test_a_cable_that_is_out_is_an_alarm_until_it_is_in_again() -> None:
    async def test() -> None:
        bench = Bench("dcb-274")
        record = await bench.begin()
        move = asyncio.create_task(record.put("VAL", 20))
        await bench.until(lambda: bench["RBV"] > 1)
        bench.port.out = True
        assert "the cable is out" in await failure(move)
        assert (bench["DMOV"], bench["MISS"]) == (1, 1)
        assert bench.shown.alarms == [COMMUNICATION]
        assert Status.NO_COMMUNICATION in bench.status()
        await record.look()
        assert "the cable is out" in await failure(record.put("VELO", 3))
        bench.port.out = False
        bench.cell.run_to(bench.cell.now + 5_000_000_000)
        await record.look()
        assert bench.shown.alarms == [COMMUNICATION, NO_ALARM]
        assert Status.NO_COMMUNICATION not in bench.status()
        assert bench["RBV"] == 20, "the unit has gone on"
        await record.put("SYNC", 1)
        assert (bench["VAL"], bench["MISS"]) == (20, 0)
        await record.put("VAL", 19)
        assert bench["RBV"] == 19

    run(test)


def test_a_record_that_is_watched_follows_a_hand_that_turns_the_shaft_elsewhere() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        watching = asyncio.create_task(record.watch())
        bench.cell.type("unit", "f+321")
        await bench.until(lambda: bench["RBV"] == 3.21)
        assert (bench["VAL"], bench["DIFF"]) == (0, -3.21)
        watching.cancel()

    run(test)


@pytest.mark.parametrize("model", ALL)
def test_what_is_shown_never_contradicts_itself(model: str) -> None:
    """VBAS, VELO and VMAX, whatever is put and however the unit rounds it."""

    async def test() -> None:
        bench = Bench(model)
        record = await bench.begin()
        top = bench.motor.fastest * 0.01
        for part in (1.0, 0.87, 0.8, 0.5, 0.333, 0.1):
            for field in ("VMAX", "VELO", "VBAS"):
                await record.put("VBAS", 0.07 * top)
                with suppress(PutFailed):
                    await record.put(field, part * top)
                assert bench["VBAS"] <= bench["VELO"] * (1 + 1e-9), (field, part)
                assert bench["VELO"] <= bench["VMAX"] * (1 + 1e-9) <= top * (1 + 2e-9), (field, part)

    run(test)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1e300, "abc", 1e12])
def test_what_is_no_number_of_a_field_fails_and_changes_nothing(value: Any) -> None:
    async def test() -> None:
        bench = Bench("dcb-274", Settings(resolution=0.01, velocity=10, base=2))
        record = await bench.begin()
        for field in ("VAL", "DVAL", "RVAL", "RLV", "SPMG", "DIR", "PREC"):
            before = dict(record.fields)
            await failure(record.put(field, value))
            assert record.fields == before, field

    run(test)


def test_fields_that_mean_nothing_here_are_kept() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        await record.put("TWV", 0.5)
        await record.put("BDST", 0.1)
        assert (bench["TWV"], bench["BDST"]) == (0.5, 0.1)
        assert record.takes("VAL")
        assert not record.takes("BDST")

    run(test)


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"resolution": 0.0}, "no resolution"),
        ({"low": 2.0, "high": 1.0}, "above the high limit"),
        ({"base": 9.0, "velocity": 5.0}, "go no slower than they begin"),
        ({"velocity": 5.0, "base": 1.0, "most": 4.0}, "above the largest"),
    ],
)
def test_settings_that_contradict_themselves_are_refused(wrong: dict[str, float], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Settings(**wrong)  # type: ignore[arg-type]


def test_every_axis_of_a_cell_is_found_with_what_its_driver_is_told() -> None:
    text = """
[units.a]
model = "gs-c200"
straps = { SEL2 = 0, SEL1 = 1, SEL0 = 1, CHS = "low" }
[units.b]
model = "gs-c200"
straps = { SEL2 = 1, SEL1 = 0, SEL0 = 1, BR0 = "low" }
[units.board]
model = "bs0610"
[units.x]
model = "dcb-274"
options = { name = "X" }
[units.adapter]
model = "sin-10"
[units.p]
model = "dcb-274"
options = { name = "P" }
straps = { PARTY = "high" }
[units.drive]
model = "supersigma"
options = { number = 7 }
[units.first]
model = "dcb-274"
[units.second]
model = "dcb-274"
[lines.multi]
units = ["a", "b"]
[lines.board]
units = ["board"]
[lines.computer]
units = ["adapter"]
[lines.bus]
units = ["x"]
host = "adapter"
[lines.party]
units = ["p"]
[lines.microbus]
units = ["drive"]
[lines.ring]
units = ["first", "second"]
kind = "daisy-chain"
"""
    description = parse(text, "cell")
    cell = build(description, lambda file: "")
    found = axes(description, cell)
    assert [(axis.title, dict(axis.options)) for axis in found] == [
        ("a", {"checksums": False, "address": 1, "revision": "2.2"}),
        ("b", {"checksums": True, "address": 2, "revision": "2.2"}),
        ("board X", {"motor": "X"}),
        ("board Y", {"motor": "Y"}),
        ("x", {"mode": "sin10", "name": "X"}),
        ("p", {"mode": "party", "name": "P"}),
        ("drive", {"drive": 7}),
        ("first", {"mode": "daisy", "first": "A", "name": "A"}),
        ("second", {"mode": "daisy", "first": "A", "name": "B"}),
    ]
    assert found[0].line == found[1].line != found[2].line == found[3].line
