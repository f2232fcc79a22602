"""The verb `motor`: lists, curves, judged moves, figures, and what it says to nonsense."""

import json
from pathlib import Path

import pytest

from detent.cli import main
from detent.motors.named import MOTORS


def said(capsys: pytest.CaptureFixture[str], *tokens: str) -> str:
    with pytest.raises(SystemExit) as caught:
        main(["motor", *tokens])
    assert not caught.value.code
    return capsys.readouterr().out


def test_without_a_name_it_lists_the_motors_with_their_makers(capsys: pytest.CaptureFixture[str]) -> None:
    listed = said(capsys)
    assert all(name in listed for name in MOTORS)
    found = json.loads(said(capsys, "--json"))["motors"]
    assert [motor["name"] for motor in found] == list(MOTORS)
    assert all(motor["source"] for motor in found)


def test_a_name_gives_torque_against_speed(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    picture = tmp_path / "curve.png"
    facts = json.loads(said(capsys, "qsh4218-41-10-035", "--fit", "--json", "--plot", str(picture)))
    assert picture.stat().st_size > 10_000
    assert facts["fit"]["rms"] < 0.03
    torques = [point["torque"] for point in facts["curve"]]
    assert torques == sorted(torques, reverse=True)
    assert facts["curve"][0]["rate"] == 2 * facts["curve"][0]["full_steps_per_s"]
    assert "turns/min" in said(capsys, "23-305-ds8a-parallel", "--supply", "40")  # needs no inertia


def test_a_move_is_judged_and_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    picture = tmp_path / "move.svg"
    move = ("qsh4218-41-10-035", "--move", "600", "--start", "500", "--ramp", "150", "--friction", "0.02")
    facts = json.loads(said(capsys, *move, "--slew", "3000", "--sensitivity", "--json", "--plot", str(picture)))
    assert facts["verdict"]["lost"] is False
    assert set(facts["sensitivity"]) == {"inertia", "friction", "voltage"}
    assert picture.stat().st_size > 10_000
    assert "no step lost" in said(capsys, *move, "--slew", "3000", "--sensitivity")
    assert "steps lost: the rotor falls" in said(capsys, *move, "--slew", "9000", "--inertia", "1e-4")


def test_pull_in_tells_the_start_stop_speed_and_the_holes_of_resonance(capsys: pytest.CaptureFixture[str]) -> None:
    facts = json.loads(said(capsys, "qsh4218-41-10-035", "--friction", "0.02", "--pull-in", "--json"))
    assert 1500 < facts["highest_start"] < 5000
    assert all(low <= high for low, high in facts["holes"])


@pytest.mark.parametrize(
    ("tokens", "words"),
    [
        (["qsh4218"], "did you mean"),
        (["as1010", "--supply", "2"], "2 V cannot drive"),
        (["as1010", "--step", "third"], "no stepping"),
        (["as1010", "--move", "0"], "at least one step"),
        (["as1010", "--sensitivity"], "add --move"),
        (["as1010", "--plot", "a.txt"], "figure is one of"),
        (["as1010", "--decay", "quick"], "no decay"),
        (["as1010", "--inertia", "-1"], "inertia is -1"),
        (["23-305-ds8a-series", "--supply", "40", "--move", "100"], "gives no rotor inertia"),
        (["as1010", "--move", "5", "--torque", "9"], "more than the"),
    ],
)
def test_nonsense_is_refused_in_one_line(tokens: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["motor", *tokens])
    assert caught.value.code == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
