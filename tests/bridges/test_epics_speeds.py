"""Speeds and accelerations of a motor record, which are what the unit makes of them."""

import asyncio

import pytest
from tests.bridges.record_bench import ALL, Bench, run

from detent.bridges.epics.fields import Settings
from detent.bridges.epics.motor import PutFailed


def test_speeds_are_what_the_unit_makes_of_them() -> None:
    """GS-C200 datasheet: S and T in tens of steps/s."""

    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        await record.put("VELO", 12.34)
        assert bench["VELO"] == pytest.approx(12.3)
        await record.put("VMAX", 11)
        await record.put("VELO", 20)
        assert bench["VELO"] == 11
        await record.put("VELO", 0.5)
        assert bench["VELO"] == 2, "not below the base velocity"

    run(test)


def test_a_velocity_that_is_put_on_the_way_is_that_of_the_next_move() -> None:
    async def test() -> None:
        bench = Bench("bs0710")
        record = await bench.begin()
        move = asyncio.create_task(record.put("VAL", 10))
        await bench.until(lambda: bench["RBV"] > 1)
        await record.put("VELO", 5)
        await move
        began = bench.cell.now
        await record.put("VAL", 0)
        assert bench.cell.now - began > 2_000_000_000

    run(test)


@pytest.mark.parametrize("model", ALL)
def test_a_speed_that_is_refused_does_not_stay(model: str) -> None:
    async def test() -> None:
        bench = Bench(model)
        record = await bench.begin()
        await record.put("VMAX", 1e6)
        before = {name: bench[name] for name in ("VELO", "VBAS", "ACCL", "ACCS", "ACCU")}
        for field, value in (("VELO", 1e6), ("ACCL", -1), ("ACCS", -1), ("ACCS", 0), ("VELO", -1)):
            try:
                await record.put(field, value)
            except PutFailed:
                assert {name: bench[name] for name in before} == before, field
            else:
                made = bench[field]
                assert made <= bench.motor.fastest * 0.01 or field.startswith("ACC")
                before = {name: bench[name] for name in before}
        await record.put("VAL", 1)
        assert bench["RBV"] == 1

    run(test)


@pytest.mark.parametrize("model", ALL)
def test_the_largest_velocity_is_the_units_own(model: str) -> None:
    async def test() -> None:
        bench = Bench(model)
        record = await bench.begin()
        assert bench["VMAX"] == bench.motor.fastest * 0.01 > 0
        await record.put("VELO", bench["VMAX"])
        assert bench["VELO"] == pytest.approx(bench["VMAX"]), "and it can be had"
        await record.put("VMAX", 2 * bench["VMAX"])
        assert bench["VMAX"] == bench.motor.fastest * 0.01, "and no more"
        await record.put("VMAX", 0)
        assert bench["VMAX"] == bench.motor.fastest * 0.01

    run(test)


def test_a_largest_velocity_beyond_the_unit_is_refused_at_the_begin() -> None:
    async def test() -> None:
        with pytest.raises(ValueError, match="the unit does 100 at most"):
            await Bench("gs-c200", Settings(resolution=0.01, velocity=10, base=2, most=200)).begin()

    run(test)


def test_two_accelerations_are_one_and_the_one_that_was_put_last_stays() -> None:
    async def test() -> None:
        bench = Bench("dcb-274", Settings(resolution=0.01, velocity=10, base=2, acceleration=0.5))
        record = await bench.begin()
        assert bench["ACCS"] == pytest.approx(bench["VELO"] / bench["ACCL"])
        await record.put("ACCS", 40)
        assert (bench["ACCU"], bench["ACCL"]) == (1, pytest.approx(0.25, rel=0.1))
        await record.put("VELO", 20)
        assert bench["ACCL"] == pytest.approx(0.5, rel=0.1)
        await record.put("ACCL", 0.4)
        await record.put("VELO", 10)
        assert (bench["ACCU"], bench["ACCL"]) == (0, pytest.approx(0.4, rel=0.1))

    run(test)
