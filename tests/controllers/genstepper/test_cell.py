"""A board in a cell: switches on either axis, results of `run`."""

import json

import pytest
from tests.controllers.genstepper.boards import Board

from detent.cell.description import Problem
from detent.ticks import SECOND

SWITCH = '[switches.end]\naxis = "board.{axis}"\nfrom = 500\ndrives = "board.L{axis}+"\n'


@pytest.mark.parametrize(("axis", "other"), [("X", "Y"), ("Y", "X")])
def test_a_switch_sits_on_the_axis_that_it_names(axis, other):
    board = Board(hard_stop="yes", toml=SWITCH.format(axis=axis))
    board.say("B1000G", 5 * SECOND)
    assert (board.position(axis), board.position(other)) == (500, 1000)


@pytest.mark.parametrize("axis", ["", "Z"])
def test_an_axis_that_is_not_there_is_a_problem_with_a_remedy(axis):
    text = SWITCH.format(axis="X").replace('axis = "board.X"', f'axis = "board{"." + axis if axis else ""}"')
    with pytest.raises(Problem, match=r"board\.X or board\.Y"):
        Board(toml=text)


def test_the_signals_of_a_line_without_its_time_are_all_there():
    board = Board()
    board.say("X100GY-50G", SECOND)
    spans = {axis: board.cell.recording.motion("board", board.cell.now, axis) for axis in "XY"}
    assert {axis: sum(span.last - span.first + 1 for span in found) for axis, found in spans.items()} == {
        "X": 100,
        "Y": 50,
    }


def test_run_tells_where_each_axis_is(capsys):
    from detent.cli import main

    with pytest.raises(SystemExit):
        main(["run", "bs0610", "--send", "X100GY-50GBI", "--json"])
    told = json.loads(capsys.readouterr().out)["units"]["bs0610"]
    assert told["position"] == 100
    assert told["axes"] == {"X": {"position": 100, "pulses": 100}, "Y": {"position": -50, "pulses": 50}}


def test_two_boards_cannot_share_a_line():
    toml = "[units.other]\nmodel = 'bs0710'\n[lines.bus]\nunits = ['board', 'other']\n"
    with pytest.raises(Problem, match="line of its own"):
        Board(toml=toml)


def test_both_axes_are_in_waveforms_arrays_and_figures(tmp_path):
    import numpy as np

    from detent.outputs import arrays, figures, signals, vcd

    board = Board(timed=True)
    board.say("X300GY-50GB", SECOND)
    seen = signals.of_cell(board.cell)
    vcd.write(tmp_path / "a.vcd", seen)
    text = (tmp_path / "a.vcd").read_text()
    assert "$scope module board $end" in text
    assert "$scope module board.Y $end" in text
    assert " RDY $end" in text
    assert " SO $end" in text
    assert " XWA1 $end" in text
    assert " YWB2 $end" in text
    arrays.write(tmp_path / "a.npz", seen)
    with np.load(tmp_path / "a.npz") as kept:
        assert len(kept["board/step_times"]) == 300
        assert kept["board.Y/positions"][-1] == -50
        assert (np.diff(kept["board/SO/levels"]) != 0).all()
    figures.write(tmp_path / "a.png", seen)
    assert [unit.title for unit in seen.units] == ["board.X", "board.Y"]


def test_the_windings_can_be_asked_for_at_every_step():
    from detent.controllers.genstepper.windings import NOTHING, table
    from detent.outputs.windings import duties

    board = Board()
    board.say("X40=4000R100G", 2 * SECOND)
    times = [at for at, _ in board.pulses()]
    asked = duties(board.cell.recording, "board", "X", [times[0] - 1, *times[:-1], times[-1] + 16_000])
    assert asked[0] == table(3, 0), "= moves no field (page 38)"
    assert asked[1:-1] == [table(3, 4 * step) for step in range(1, 60)]
    assert asked[-1] == NOTHING, "off when it is idle"
