"""The coordinates of a motor record: user, dial and steps; offset, direction, resolution, and setting a position."""

import pytest
from tests.bridges.record_bench import Bench, failure, run

from detent.bridges.epics.fields import Settings


def test_all_coordinates_are_one_target() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        for field, value, user in (
            ("DVAL", 3.0, 3.0), ("RVAL", 120, 1.2), ("RLV", 0.8, 2.0), ("RLV", -0.5, 1.5), ("TWV", 0.25, 1.5),
            ("TWF", 1, 1.75), ("TWR", 1, 1.5), ("TWR", 0, 1.5),
        ):  # fmt: skip
            await record.put(field, value)
            assert (bench["VAL"], bench["RBV"], bench["RVAL"]) == (user, user, round(user * 100)), field
            assert (bench["RLV"], bench["TWF"], bench["TWR"]) == (0, 0, 0)

    run(test)


def test_an_offset_and_a_direction_are_of_the_user_alone() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s", Settings(resolution=0.01, low=-50, high=40, velocity=10, base=2))
        record = await bench.begin()
        await record.put("VAL", 5)
        await record.put("OFF", 100)
        assert (bench["VAL"], bench["RBV"], bench["DRBV"], bench["HLM"], bench["LLM"]) == (105, 105, 5, 140, 50)
        await record.put("DIR", 1)
        assert (bench["VAL"], bench["OFF"], bench["DRBV"]) == (105, 110, 5), "a variable offset keeps VAL"
        assert (bench["HLM"], bench["LLM"], bench["DHLM"], bench["DLLM"]) == (160, 70, 40, -50)
        await record.put("VAL", 106)
        assert (bench["DRBV"], bench.shaft()) == (4, 400)
        await record.put("HLM", 120)
        assert (bench["HLM"], bench["DLLM"]) == (120, -10)
        assert "outside" in await failure(record.put("VAL", 121))
        await record.put("FOFF", 1)
        await record.put("DIR", 0)
        assert (bench["OFF"], bench["VAL"], bench["RBV"]) == (110, 114, 114)

    run(test)


def test_a_negative_resolution_counts_the_other_way() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s", Settings(resolution=-0.01, low=-50, high=50, velocity=10, base=2))
        record = await bench.begin()
        await record.put("VAL", 2)
        assert (bench.shaft(), bench["RBV"], bench["RRBV"]) == (-200, 2, -200)

    run(test)


def test_set_with_a_variable_offset_changes_the_offset_and_with_a_frozen_one_the_counter() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        await record.put("VAL", 5)
        await record.put("SET", 1)
        await record.put("VAL", 7)
        assert (bench["RBV"], bench["OFF"], bench["DRBV"], bench.shaft()) == (7, 2, 5, 500)
        await record.put("OFF", 0)
        await record.put("FOFF", 1)
        await record.put("VAL", 7)
        assert (bench["VAL"], bench["RBV"], bench["OFF"], bench.shaft()) == (7, 7, 0, 700)
        await record.put("FOFF", 0)
        await record.put("DVAL", 1)
        assert (bench["VAL"], bench["DVAL"], bench["OFF"], bench.shaft()) == (7, 1, 6, 100)
        await record.put("SUSE", 1)
        assert bench["SET"] == 0
        assert bench.shown.of("DMOV") == [0, 1], "nothing has moved but the first time"

    run(test)


def test_a_counter_that_cannot_be_set_so_fails_the_put() -> None:
    """GS-C200 datasheet: I clears the counter; f, which sets it, is of the GS-C200S."""

    async def test() -> None:
        bench = Bench("gs-c200")
        record = await bench.begin()
        await record.put("VAL", 5)
        await record.put("SET", 1)
        await record.put("FOFF", 1)
        assert "can only be cleared" in await failure(record.put("VAL", 7))
        assert (bench["VAL"], bench["RBV"]) == (5, 5)
        await record.put("VAL", 0)
        assert (bench["VAL"], bench["RBV"], bench.shaft()) == (0, 0, 0)

    run(test)


def test_a_status_update_and_a_new_resolution() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        await record.put("VAL", 5)
        bench.cell.type("unit", "f+321")
        await record.put("STUP", 1)
        assert (bench["RBV"], bench["STUP"]) == (3.21, 0)
        await record.put("MRES", 0.02)
        assert (bench["RBV"], bench["VAL"], bench["RRBV"]) == (6.42, 6.42, 321)
        assert "no resolution" in await failure(record.put("MRES", 0))

    run(test)


@pytest.mark.parametrize(("resolution", "digits"), [(1.0, 0), (0.0025, 4), (100.0, 0), (1e-12, 9), (-0.01, 2)])
def test_the_precision_shows_single_steps(resolution: float, digits: int) -> None:
    assert Settings(resolution=resolution).precision == digits
