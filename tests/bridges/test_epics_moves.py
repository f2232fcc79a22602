"""Motor records of all four controllers: puts, stops, jogs, homing, and what holds them up.

What each field means is said by the motor record's reference (epics-modules/motor), and by `detent.bridges.epics`.
"""

import asyncio

import pytest
from tests.bridges.record_bench import ALL, Bench, failure, run

from detent.bridges.epics.fields import FAILED, NO_ALARM, STOPPED, Doing, Go, Settings, Status


@pytest.mark.parametrize("model", ALL)
def test_a_put_returns_when_the_motor_is_there_and_dmov_goes_down_and_up(model: str) -> None:
    async def test() -> None:
        bench = Bench(model)
        record = await bench.begin()
        await record.put("VAL", 2.5)
        assert bench.shaft() == 250
        assert (bench["RBV"], bench["DRBV"], bench["RRBV"]) == (2.5, 2.5, 250)
        assert (bench["VAL"], bench["DVAL"], bench["RVAL"]) == (2.5, 2.5, 250)
        assert (bench["DIFF"], bench["RDIF"], bench["MISS"], bench["LVIO"]) == (0, 0, 0, 0)
        for field in ("DMOV", "MOVN"):
            assert bench.shown.of(field) == [int(field == "MOVN"), int(field == "DMOV")]
        assert bench.shown.of("MIP") == [Doing.MOVE, Doing.NOTHING]
        assert bench.shown.posts[-1] == ("DMOV", 1), "everything else is what it should be before"
        assert bench.status() == Status.DONE | Status.PLUS
        await record.put("VAL", 1)
        assert (bench["RBV"], bench["TDIR"], bench.status()) == (1, 0, Status.DONE)
        assert bench.shown.alarms == []

    run(test)


@pytest.mark.parametrize("model", ALL)
def test_dmov_goes_down_and_up_even_if_there_is_nothing_to_move(model: str) -> None:
    async def test() -> None:
        bench = Bench(model)
        record = await bench.begin()
        await record.put("VAL", 0.0)
        assert bench.shown.of("DMOV") == [0, 1]
        assert bench["MISS"] == 0

    run(test)


@pytest.mark.parametrize("model", ["gs-c200s", "dcb-274", "supersigma", "bs0710"])
def test_a_stop_ends_the_move_and_says_that_it_did_not_arrive(model: str) -> None:
    async def test() -> None:
        bench = Bench(model)
        record = await bench.begin()
        move = asyncio.create_task(record.put("VAL", 40))
        await bench.until(lambda: bench["MOVN"] and bench.shaft() > 10)
        await record.put("STOP", 1)
        await move
        assert (bench["DMOV"], bench["MISS"], bench["STOP"]) == (1, 1, 0)
        assert 0 < bench["RBV"] < 40
        assert bench["VAL"] == bench["RBV"], "the target is where it stands"
        assert bench.shown.alarms == [STOPPED]
        await record.put("VAL", 1)
        assert (bench["RBV"], bench["MISS"]) == (1, 0)
        assert bench.shown.alarms == [STOPPED, NO_ALARM]

    run(test)


def test_a_stop_of_a_motor_that_stands_changes_nothing() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        await record.put("STOP", 1)
        assert bench.shown.posts == []

    run(test)


@pytest.mark.parametrize("model", ["dcb-274", "supersigma", "bs0710"])
def test_the_readback_is_shown_on_the_way(model: str) -> None:
    async def test() -> None:
        bench = Bench(model)
        record = await bench.begin()
        await record.put("VAL", 10)
        on_the_way = bench.shown.of("RBV")
        assert on_the_way == sorted(on_the_way)
        assert len(on_the_way) > 10
        assert on_the_way[-1] == 10

    run(test)


def test_a_module_that_tells_its_position_only_when_it_stands_is_shown_then() -> None:
    """GS-C200 datasheet: while busy only F, Z and K are answered."""

    async def test() -> None:
        bench = Bench("gs-c200")
        record = await bench.begin()
        await record.put("VAL", 10)
        assert bench.shown.of("RBV") == [10]

    run(test)


def test_a_new_target_takes_the_place_of_the_old_one() -> None:
    async def test() -> None:
        bench = Bench("bs0710")
        record = await bench.begin()
        first = asyncio.create_task(record.put("VAL", 40))
        await bench.until(lambda: bench["RBV"] > 1)
        await record.put("VAL", -2)
        await first
        assert (bench["RBV"], bench["VAL"], bench["MISS"], bench["DMOV"]) == (-2, -2, 0, 1)
        assert bench.shown.of("DMOV") == [0, 1], "it was one motion to whoever waits for it"
        assert bench.shown.alarms == []

    run(test)


def test_a_jog_runs_until_it_is_taken_back() -> None:
    async def test() -> None:
        bench = Bench("dcb-274", Settings(resolution=0.01, velocity=10, base=2))
        record = await bench.begin()
        jog = asyncio.create_task(record.put("JOGF", 1))
        await bench.until(lambda: bench["RBV"] > 3)
        assert (bench["JOGF"], bench["DMOV"], bench["MIP"]) == (1, 0, Doing.JOG_FORWARD)
        await record.put("JOGF", 0)
        await jog
        assert (bench["JOGF"], bench["DMOV"], bench["MISS"]) == (0, 1, 0)
        assert bench["VAL"] == bench["RBV"] > 3
        assert bench.shown.alarms == []
        jog = asyncio.create_task(record.put("JOGR", 1))
        await bench.until(lambda: bench["RBV"] < 2)
        await record.put("STOP", 1)
        await jog
        assert (bench["JOGR"], bench["TDIR"]) == (0, 0)

    run(test)


HOMING = """
[units.unit]
model = "gs-c200s"
[switches.home]
axis = "unit"
drives = ["unit.HOME"]
from = -2
to = 2
[switches.end]
axis = "unit"
drives = ["unit.EOT"]
to = -60
"""


def test_homing_ends_at_home() -> None:
    """GS-C200 datasheet, H: to the end of travel and back to HOME, which is position 0."""

    async def test() -> None:
        bench = Bench(HOMING)
        record = await bench.begin()
        await record.put("VAL", 0.3)
        await record.put("HOMR", 1)
        assert (bench["RRBV"], bench["VAL"], bench["ATHM"], bench["HOMR"], bench["DMOV"]) == (0, 0, 1, 0, 1)
        assert Status.HOMED in bench.status()
        assert bench.shown.of("MIP")[-2:] == [Doing.HOME_REVERSE, Doing.NOTHING]
        await record.put("VAL", 0.1)
        assert bench["ATHM"] == 0

    run(test)


@pytest.mark.parametrize(("model", "field", "why"), [("supersigma", "HOMF", "backward"), ("bs0710", "HOMR", "search")])
def test_a_search_that_a_unit_cannot_make_fails_with_an_alarm(model: str, field: str, why: str) -> None:
    async def test() -> None:
        bench = Bench(model)
        record = await bench.begin()
        assert why in await failure(record.put(field, 1))
        assert (bench["DMOV"], bench[field]) == (1, 0)
        assert bench.shown.alarms == [FAILED]
        assert Status.PROBLEM in bench.status()
        await record.put("VAL", 1)
        assert bench.shown.alarms == [FAILED, NO_ALARM]
        assert Status.PROBLEM not in bench.status()

    run(test)


def test_spmg_stops_pauses_and_goes_on() -> None:
    async def test() -> None:
        bench = Bench("bs0710")
        record = await bench.begin()
        move = asyncio.create_task(record.put("VAL", 20))
        await bench.until(lambda: bench["RBV"] > 1)
        await record.put("SPMG", Go.PAUSE)
        assert "SPMG became Pause before it arrived" in await failure(move)
        assert bench["RBV"] < 20
        assert bench["VAL"] == 20, "it knows where to go on to"
        assert "SPMG is Pause: it goes there when SPMG is Go" in await failure(record.put("VAL", 15))
        assert bench["RBV"] < 15
        await record.put("SPMG", Go.GO)
        assert (bench["RBV"], bench["MISS"]) == (15, 0)
        await record.put("SPMG", Go.STOP)
        assert "SPMG is Stop: put Go to SPMG first" in await failure(record.put("VAL", 1))
        assert (bench["VAL"], bench["RBV"]) == (15, 15), "stopped is stopped"
        await record.put("SPMG", Go.MOVE)
        await record.put("VAL", 14)
        assert (bench["RBV"], bench["SPMG"]) == (14, Go.PAUSE)

    run(test)


def test_a_record_that_is_held_moves_by_no_put_at_all() -> None:
    async def test() -> None:
        bench = Bench("gs-c200s")
        record = await bench.begin()
        for held in (Go.STOP, Go.PAUSE):
            await record.put("SPMG", held)
            for field, value in (("VAL", 1), ("DVAL", 1), ("RVAL", 100), ("RLV", 1), ("TWF", 1), ("TWR", 1),
                                 ("JOGF", 1), ("JOGR", 1), ("HOMF", 1), ("HOMR", 1)):  # fmt: skip
                assert f"SPMG is {held.name.capitalize()}" in await failure(record.put(field, value))
                assert (bench.shaft(), bench["DMOV"], bench["JOGF"], bench["HOMF"]) == (0, 1, 0, 0)
        await failure(record.put("VAL", 3))
        assert bench["VAL"] == 3
        await record.put("SPMG", Go.STOP)
        assert bench["VAL"] == 0, "a stop forgets where it was to go"
        await record.put("SPMG", Go.GO)
        assert bench.shaft() == 0

    run(test)
