"""The search of the Motion page: beside the loop, with progress, stopped with the best so far, picked from its map."""

import asyncio
import io
import json
import sys
from collections.abc import Callable
from typing import Any

import pytest

from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.tuner.task import Task, moves_of
from detent.workbench import tuning_process
from detent.workbench.client import Bench
from detent.workbench.live import Live
from detent.workbench.moves import Axis, Moves, Place
from detent.workbench.pipe import packed
from detent.workbench.rigs import Form, OwnMotor
from detent.workbench.tuning import Asked, Tuning, ranges_of

FORM = Form(motor="qsh4218-41-10-035", stepping="half", supply=24, current=1, inertia=0.15, friction=0.02)
LITTLE = "inertia=0.1, voltage=0.05, torque_constant=0, inductance=0, resistance=0, damping=0"
PATIENCE = 120.0  # s, of tests alone


async def until(what: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not what():
            await asyncio.sleep(0.02)


def told(live: Live) -> dict[str, Any]:
    found = live.get("tuning")
    assert isinstance(found, dict)
    return found


def with_bench(model: str, do: Callable[[Moves, Tuning, Live], Any]) -> None:
    async def run() -> None:
        bench = await Bench.open(model, pace=1e3)
        try:
            await bench.until(lambda state: all(unit.state != "starting" for unit in state.units.values()))
            live = Live()
            moves = Moves(bench, live)
            await do(moves, Tuning(moves, live), live)
        finally:
            await bench.close()

    asyncio.run(run())


def test_a_search_tells_how_far_it_is_and_its_map_is_picked_from() -> None:
    async def do(moves: Moves, tuning: Tuning, live: Live) -> None:
        axis = Axis(unit="gs-c200", steps=60)
        await tuning.begin(axis, FORM, Asked(moves="60", variants=64, vary=LITTLE))
        with pytest.raises(ValueError, match="under way"):
            await tuning.begin(axis, FORM, Asked(moves="60"))
        await until(lambda: told(live)["state"] in ("done", "failed", "stopped"))
        assert told(live)["state"] == "done", told(live)
        found, map_ = live.get("tuning.found"), live.get("tuning.map")
        assert isinstance(found, dict)
        assert isinstance(map_, dict)
        assert found["check"]["lost"] == 0 < found["check"]["variants"] == 64
        assert [line[0] for line in found["commands"]] == ["S", "T", "R"]
        assert map_["labels"] == ["T: slew speed, 10 steps/s", "R: ramp length, steps"]
        assert len(map_["lost"]) == len(map_["y"])
        picked = await tuning.pick(map_["x"][2], map_["y"][-1])
        assert picked["commands"][1:] == [f"T{map_['x'][2]}", f"R{map_['y'][-1]}"]
        assert picked["time"] == pytest.approx(map_["times"][-1][2], rel=1e-6)
        # the same settings are the same move on the page
        drawn = await moves.move(axis.model_copy(update={"values": picked["settings"]}))
        assert drawn["settings"] == picked["commands"]
        assert drawn["duration"] == pytest.approx(picked["time"] * 1e9)

    with_bench("gs-c200", do)


def test_a_search_that_is_stopped_tells_what_is_known_by_then() -> None:
    async def do(moves: Moves, tuning: Tuning, live: Live) -> None:
        await tuning.begin(Axis(unit="gs-c200"), FORM, Asked(moves="200,1000,5000"))
        await until(lambda: told(live)["best"] is not None or told(live)["state"] != "searching")
        await tuning.stop()
        await until(lambda: told(live)["state"] not in ("searching", "mapping"))
        assert told(live)["state"] == "stopped", told(live)
        found = live.get("tuning.found")
        assert isinstance(found, dict)
        assert not found["complete"]
        assert "no fresh ones yet" in found["check"]["words"]
        assert live.get("tuning.map") is None

    with_bench("gs-c200", do)


def test_a_load_that_nothing_turns_is_said_to_be_one() -> None:
    async def do(moves: Moves, tuning: Tuning, live: Live) -> None:
        heavy = FORM.model_copy(update={"friction": 2.0})
        await tuning.begin(Axis(unit="gs-c200"), heavy, Asked(moves="60"))
        await until(lambda: told(live)["state"] not in ("searching", "mapping"))
        assert told(live)["state"] == "failed"
        assert "does not turn this load" in told(live)["words"]
        with pytest.raises(ValueError, match="search first"):
            await tuning.pick(100, 100)
        with pytest.raises(ValueError, match=r"^moves many: .*200,1000x3"):
            await tuning.begin(Axis(unit="gs-c200"), FORM, Asked(moves="many"))
        with pytest.raises(ValueError, match="write inertia"):
            await tuning.begin(Axis(unit="gs-c200"), FORM, Asked(moves="60", vary="inertia=much"))

    with_bench("gs-c200", do)


def test_ranges_are_read_as_people_write_them() -> None:
    assert ranges_of("inertia=0.2, friction=0.3-2") == {"inertia": 0.2, "friction": (0.3, 2.0)}
    assert ranges_of(" ") == {}


def test_an_axis_is_shown_as_its_unit_is_set_up_now() -> None:
    """BS0610 manual: n! resets the board to microsteps of n/64; O is the step mode; DCB-274, page 40: H 1 is 1/4."""

    async def board(moves: Moves, tuning: Tuning, live: Live) -> None:
        bench = moves._bench
        place = Place(unit="bs0610", axis="Y")
        about = await moves.about(place)
        assert about["stepping"] == "1/16"
        assert about["steppings"] == ["1/16", "O0", "O1", "O2"]
        await bench.type("bs0610", "8!")
        await until(lambda: bench.state.units["bs0610"].registers.get("!") == "8")
        assert (await moves.about(place))["stepping"] == "1/8"
        tried = await moves.about(place.model_copy(update={"options": {"step_size": "2"}}))
        assert tried["stepping"] == "1/32"

    async def indexer(moves: Moves, tuning: Tuning, live: Live) -> None:
        about = await moves.about(Place(unit="dcb-274"))
        assert about["stepping"] == "1/4"
        assert set(about["steppings"]) == {"1/8", "1/4", "half", "full", "1/2", "wave"}  # type: ignore[call-overload]

    with_bench("bs0610", board)
    with_bench("dcb-274", indexer)


TOML = "resistance = 4.5\ninductance = 7.5e-3\ncurrent = 1\ntorque = 0.35\ninertia = 5.4e-6\n"
CURVE = "half steps/s, Nm\n1000, 0.299\n2000, 0.273\n4000, 0.178\n6000, 0.11\n"


def test_a_motor_of_ones_own_is_judged_and_the_fit_to_its_curve_told() -> None:
    async def do(moves: Moves, tuning: Tuning, live: Live) -> None:
        axis = Axis(unit="gs-c200", values={"S": 10, "T": 150, "R": 60}, steps=300)
        files = OwnMotor(name="my.toml", text=TOML, curve=CURVE, curve_name="my.csv")
        form = FORM.model_copy(update={"motor": "own", "own": files})
        found = await moves.motor(axis, form)
        assert "holds from 500 to 3000 full steps/s" in str(found["words"])
        assert found["verdict"] is not None
        with pytest.raises(ValueError, match="torque missing"):
            await moves.own(OwnMotor(name="my.toml", text="resistance = 4.5\ninductance = 1\ncurrent = 1\n"))

    with_bench("gs-c200", do)


def test_what_moves_along_a_line_is_inertia_and_pull_at_the_shaft() -> None:
    """0.2 kg on a belt over a pulley of 8 mm: 0.2 * 0.008**2 kg m2; straight up it pulls with its weight."""

    async def do(moves: Moves, tuning: Tuning, live: Live) -> None:
        axis = Axis(unit="gs-c200", values={"S": 10, "T": 150, "R": 60}, steps=300)
        up = {"by": "belt", "size": 8.0, "mass": 0.2, "slope": 90.0}
        form = Form.model_validate(FORM.model_dump() | {"inertia": 0.0, "moved": up})
        found = await moves.motor(axis, form)
        assert found["travel"] == pytest.approx(2 * 3.14159265 * 8)
        asked = found["asked"]
        weight = 0.2 * 9.80665 * 0.008
        assert asked[0][1] > weight + 0.02  # type: ignore[index]
        wrong = Form.model_validate(FORM.model_dump() | {"moved": {"by": "", "mass": 1.0}})
        with pytest.raises(ValueError, match="screw, belt or rack"):
            await moves.motor(axis, wrong)
        with pytest.raises(ValueError, match="no drive"):
            await moves.motor(axis, FORM.model_copy(update={"drive": "tmc"}))

    with_bench("gs-c200", do)


def test_a_move_without_the_ramp_that_was_meant_says_so() -> None:
    async def do(moves: Moves, tuning: Tuning, live: Live) -> None:
        axis = Axis(unit="gs-c200", values={"S": 60, "T": 40, "R": 60}, steps=300)
        assert "makes no ramp" in str((await moves.move(axis))["remark"])
        assert (await moves.move(axis.model_copy(update={"values": {"S": 40, "T": 60, "R": 60}})))["remark"] == ""

    with_bench("gs-c200", do)


def test_a_search_that_wants_numba_says_so_on_the_page(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its process ended without a word, and the page said no more than that."""
    task = Task("gs-c200", Rig(motor("as1010"), Drive(24, 1.0), Load()), moves_of("200"))
    sent = io.BytesIO(packed(tuning_process.Order(task, map=False)))
    monkeypatch.setattr(tuning_process, "_read", sent.read)
    monkeypatch.setattr(tuning_process, "_hear", lambda stopped: None)
    monkeypatch.setattr("os.nice", lambda more: 0)
    monkeypatch.setitem(sys.modules, "numba", None)
    assert tuning_process.main() == 0
    assert "needs numba, which is not installed: " in json.loads(capsys.readouterr().out)["problem"]
