"""Motor records over the drivers of all four controllers, in the virtual time of an emulated cell.

What each field means is said by the motor record's reference (epics-modules/motor), and by `detent.bridges.epics`.
"""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import AbstractAsyncContextManager, suppress
from typing import Any

import pytest

from detent.bridges.epics.cells import axes
from detent.bridges.epics.fields import COMMUNICATION, FAILED, NO_ALARM, STOPPED, Alarm, Doing, Go, Settings, Status
from detent.bridges.epics.motor import PutFailed
from detent.bridges.epics.record import MotorRecord
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.realtime.connect import connect_async

ALL = ["gs-c200", "gs-c200s", "dcb-274", "supersigma", "bs0710"]
SETTINGS = Settings(resolution=0.01, egu="mm", low=-50, high=50, velocity=10, base=2)


class VirtualPort:
    """The line of a cell for coroutines. Time passes for who waits; the others have their turn in between."""

    def __init__(self, cell: Cell, line: int) -> None:
        self._port = HostPort(cell, line)
        self._turn = asyncio.Lock()
        self.out = False  # the cable

    async def write(self, data: bytes) -> None:
        if self.out:
            raise OSError(5, "the cable is out")
        self._port.write(data)

    async def receive(self, timeout: float) -> bytes:
        await asyncio.sleep(0)
        return self._port.receive(timeout)

    def keep(self, data: bytes) -> None:
        self._port.keep(data)

    async def wait(self, seconds: float) -> None:
        self._port.wait(seconds)
        await asyncio.sleep(0)

    def clock(self) -> float:
        return self._port.clock()

    def turn(self) -> AbstractAsyncContextManager[object]:
        return self._turn

    async def close(self) -> None:
        pass


class Shown:
    """What a record has shown."""

    def __init__(self) -> None:
        self.posts: list[tuple[str, Any]] = []
        self.alarms: list[Alarm] = []

    async def post(self, field: str, value: Any) -> None:
        self.posts.append((field, value))

    async def alarm(self, alarm: Alarm) -> None:
        self.alarms.append(alarm)

    def of(self, field: str) -> list[Any]:
        return [value for name, value in self.posts if name == field]


class Bench:
    """A record over a unit of a cell that `text` describes, or of the only one of a model."""

    def __init__(self, text: str, settings: Settings = SETTINGS, axis: int = 0) -> None:
        text = text if "\n" in text else f'[units.unit]\nmodel = "{text}"\n'
        description = parse(text, "bench")
        self.cell = build(description, lambda file: "")
        self.axis = axes(description, self.cell)[axis]
        self.port = VirtualPort(self.cell, self.axis.line)
        self.shown = Shown()
        self._settings = settings

    async def begin(self) -> MotorRecord:
        self.motor = await connect_async(self.axis.model, self.port, **self.axis.options)
        self.record = MotorRecord(self.motor, self.shown, self._settings)
        await self.record.begin()
        self.shown.posts.clear()
        return self.record

    def __getitem__(self, field: str) -> Any:
        return self.record.fields[field]

    def status(self) -> Status:
        return Status(self["MSTA"])

    async def until(self, so: Callable[[], object]) -> None:
        while not so():
            await asyncio.sleep(0)

    def shaft(self) -> int:
        name = self.axis.title.partition(" ")[0]
        return self.cell.controller(name).status(self.cell.now).position


def run(test: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(test())


async def failure(put: Awaitable[None]) -> str:
    with pytest.raises(PutFailed) as caught:
        await put
    return str(caught.value)


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
        await bench.until(lambda: bench["MOVN"] and bench.cell.now > 1_000_000_000)
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


@pytest.mark.parametrize(("resolution", "digits"), [(1.0, 0), (0.0025, 4), (100.0, 0), (1e-12, 9), (-0.01, 2)])
def test_the_precision_shows_single_steps(resolution: float, digits: int) -> None:
    assert Settings(resolution=resolution).precision == digits


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
