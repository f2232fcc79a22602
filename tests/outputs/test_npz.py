import json

import numpy as np
import pytest
from tests.outputs.expected import level_changes, pulses, settled
from tests.outputs.recorded import BAR, DRILL, drilling, interrupted

from detent.cell.recording import Recording
from detent.outputs import arrays
from detent.outputs.signals import Signals


@pytest.mark.parametrize(("made", "views"), [(drilling, [BAR, DRILL]), (interrupted, [DRILL])])
@pytest.mark.parametrize("block", [7, 1 << 18])
def test_the_arrays_hold_the_times_of_the_trains_and_the_levels_of_the_pins(made, views, block, tmp_path, monkeypatch):
    monkeypatch.setattr(arrays, "BLOCK", block)
    recording, until = made()
    path = tmp_path / "run.npz"
    arrays.write(path, Signals(recording, views, until), {"title": "a run"})
    with np.load(path) as found:
        for view in views:
            columns = [found[f"{view.name}/{key}"] for key in ("step_times", "step_directions", "positions")]
            assert [column.dtype for column in columns] == [np.int64, np.int8, np.int64]
            given = list(zip(*(column.tolist() for column in columns), strict=True))
            assert given == pulses(recording, view.name, until)
            for pin, wanted in level_changes(recording, view, until).items():
                if pin == "CLOCK":
                    assert f"{view.name}/CLOCK/times" not in found
                    continue
                times, levels = found[f"{view.name}/{pin}/times"], found[f"{view.name}/{pin}/levels"]
                levels = np.where(levels == -1, 2, levels)
                assert settled(list(zip(times.tolist(), levels.tolist(), strict=True))) == wanted, pin
        meta = json.loads(str(found["meta"]))
    assert meta["title"] == "a run"
    assert meta["until_ns"] == until
    assert meta["units"]["drill"]["pulse_output"] == {
        "active": 0,
        "pins": {"+1": "CLOCK", "-1": "CLOCK"},
        "width_ns": 1700,
    }


def test_the_same_run_gives_the_same_file(tmp_path):
    recording, until = drilling()
    for name in ("one.npz", "other.npz"):
        arrays.write(tmp_path / name, Signals(recording, [BAR, DRILL], until))
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "other.npz").read_bytes()


def test_a_run_without_units_holds_its_end(tmp_path):
    arrays.write(tmp_path / "run.npz", Signals(Recording([]), [], 5))
    with np.load(tmp_path / "run.npz") as found:
        assert json.loads(str(found["meta"])) == {"units": {}, "until_ns": 5}
