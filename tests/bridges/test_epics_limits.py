"""Soft limits of a motor record in three coordinates, and the limit switches of its axis."""

import asyncio

import pytest
from tests.bridges.record_bench import Bench, failure, run

from detent.bridges.epics.fields import FAILED, NO_ALARM, Settings, Status


@pytest.mark.parametrize(("field", "value"), [("VAL", 50.01), ("DVAL", -51), ("RVAL", 5001), ("RLV", 51.0)])
def test_a_target_beyond_the_limits_is_refused(field: str, value: float) -> None:
    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        text = await failure(record.put(field, value))
        assert "is outside the limits -50 to 50" in text
        assert (bench["LVIO"], bench["VAL"], bench["DMOV"], bench.shaft()) == (1, 0, 1, 0)
        await record.put("VAL", 50)
        assert (bench["LVIO"], bench["RBV"]) == (0, 50)

    run(test)


@pytest.mark.parametrize("model", ["gs-c200s", "supersigma"])
def test_a_jog_ends_at_the_soft_limit_even_if_nobody_takes_it_back(model: str) -> None:
    async def test() -> None:
        bench = Bench(model, Settings(resolution=0.01, low=-3, high=4, velocity=10, base=2))
        record = await bench.begin()
        await record.put("JOGF", 1)
        assert (bench["RBV"], bench["VAL"], bench["DMOV"]) == (4, 4, 1)
        await record.put("JOGR", 1)
        assert bench["RBV"] == -3

    run(test)


AT_A_LIMIT = """
[units.unit]
model = "bs0710"
[switches.end]
axis = "unit.X"
drives = ["unit.LX+"]
from = 1000
"""


def test_a_limit_switch_ends_the_move_with_an_alarm_and_is_shown() -> None:
    """GenStepper manual: a motor stops at its limit input."""

    async def test() -> None:
        bench = Bench(AT_A_LIMIT)
        record = await bench.begin()
        text = await failure(record.put("VAL", 40))
        assert "and not at 4000" in text
        assert (bench["HLS"], bench["LLS"], bench["RHLS"], bench["MISS"], bench["DMOV"]) == (1, 0, 1, 1, 1)
        assert bench["VAL"] == bench["RBV"] >= 10
        assert bench.status() >= Status.PLUS_LIMIT | Status.PROBLEM
        assert bench.shown.alarms == [FAILED]
        await record.put("VAL", 5)
        assert (bench["RBV"], bench["HLS"], bench["MISS"]) == (5, 0, 0)
        assert bench.shown.alarms == [FAILED, NO_ALARM]

    run(test)


def test_a_limit_of_a_user_who_looks_the_other_way_is_the_other_one() -> None:
    async def test() -> None:
        bench = Bench(AT_A_LIMIT)
        record = await bench.begin()
        await record.put("DIR", 1)
        await failure(record.put("VAL", -40))
        assert (bench["LLS"], bench["HLS"], bench["RHLS"]) == (1, 0, 1)

    run(test)


def test_limits_in_three_coordinates_and_the_wrong_way_round() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s", Settings(resolution=-0.01, low=-50, high=40, velocity=10, base=2))
        record = await bench.begin()
        assert (bench["RLLM"], bench["RHLM"]) == (-4000, 5000)
        await record.put("RHLM", 3000)
        assert (bench["DLLM"], bench["LLM"], bench["RHLM"]) == (-30, -30, 3000)
        for field, value in (("DLLM", 41), ("DHLM", -31), ("LLM", 40.5), ("HLM", -30.5), ("RHLM", -4001)):
            assert "above the high limit" in await failure(record.put(field, value)), field
            assert (bench["DLLM"], bench["DHLM"]) == (-30, 40)
        await record.put("MRES", -0.02)
        assert (bench["DLLM"], bench["DHLM"], bench["RHLM"]) == (-60, 80, 3000), "they stay in steps"
        assert bench["VELO"] == 20

    run(test)


def test_equal_limits_leave_one_place_and_zeros_are_none() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        await record.put("VAL", 5)
        await record.put("DLLM", 5)
        await record.put("DHLM", 5)
        assert "outside the limits" in await failure(record.put("VAL", 5.01))
        await record.put("DLLM", 0)
        assert bench["LVIO"] == 0
        await record.put("DHLM", 0)
        await record.put("VAL", 60)
        assert bench["RBV"] == 60

    run(test)


def test_a_violation_follows_the_limits() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        await record.put("VAL", 20)
        await record.put("HLM", 10)
        assert bench["LVIO"] == 1
        for field in ("JOGF", "TWF"):
            await failure(record.put(field, 1))
            assert bench.shaft() == 2000, "and least of all backwards"
        await record.put("HLM", 30)
        assert bench["LVIO"] == 0
        await failure(record.put("VAL", 31))
        assert bench["LVIO"] == 1
        await record.put("HLM", 31)
        assert bench["LVIO"] == 0

    run(test)


@pytest.mark.parametrize(("field", "value"), [("VAL", 40), ("JOGF", 1)])
def test_a_limit_moved_in_front_of_a_motion_stops_it(field: str, value: float) -> None:
    async def test() -> None:
        for low, high in ((-50, 50), (0, 0)):
            bench = Bench("bs0710", Settings(resolution=0.01, low=low, high=high, velocity=10, base=2))
            record = await bench.begin()
            move = asyncio.create_task(record.put(field, value))
            await bench.until(lambda bench=bench: bench["RBV"] > 1)
            await record.put("DHLM", 30)
            assert bench["LVIO"] == 1
            assert "the limits moved" in await failure(move)
            assert (bench["DMOV"], bench[field]) == (1, 0 if field == "JOGF" else bench["RBV"])
            assert 1 < bench["RBV"] < 10

    run(test)
