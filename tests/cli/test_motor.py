"""The verb `motor`: lists, curves, judged moves, figures, and what it says to nonsense."""

import json
import os
from pathlib import Path

import pytest

from detent.cli import main
from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.move import simulate
from detent.motors.named import MOTORS, motor
from detent.motors.rotor import FINE, Rig
from detent.moves.laws import law
from detent.realtime import texts


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
    assert set(facts["sensitivity"]) == {"inertia", "friction", "voltage", "damping"}
    assert picture.stat().st_size > 10_000
    assert "no step lost" in said(capsys, *move, "--slew", "3000", "--sensitivity")
    assert "steps lost after pulse" in said(capsys, *move, "--slew", "9000", "--inertia", "1e-4")


def test_a_verdict_says_what_was_assumed_and_how_often_variants_lose(capsys: pytest.CaptureFixture[str]) -> None:
    move = ("qsh4218-41-10-035", "--move", "400", "--slew", "2500", "--variants", "64")
    text = said(capsys, *move)
    assert "damping 0.12 (assumed for a chopper, not measured" in text
    assert "that of the rotor again, as none is given" in text
    assert "no friction, as none is given" in text
    assert "away from the resonance" in text
    assert "lost by 0 of 64 variants (below 4.6 % at 95 % confidence) and by 0 of 64 corners" in text
    facts = json.loads(said(capsys, *move, "--friction", "0.02", "--vary", "inertia=0.3", "voltage=0.8-1.1", "--json"))
    assert facts["variants"]["corners"] == 128
    assert facts["variants"]["ranges"]["inertia"] == [0.7, 1.3]
    assert facts["variants"]["ranges"]["voltage"] == [0.8, 1.1]
    assert facts["damping"]["ratio"] == 0.12
    assert "not measured" in facts["damping"]["source"]
    assert "0.2 (given)" in said(capsys, *move, "--damping", "0.2")
    assert "from an overshoot of 45%" in said(capsys, *move, "--ring-down", "45%")


def test_a_loss_says_where_and_why(capsys: pytest.CaptureFixture[str]) -> None:
    facts = json.loads(said(capsys, "qsh4218-41-10-035", "--move", "900", "--start", "400", "--slew", "4000", "--ramp",
                            "400", "--friction", "0.25", "--variants", "0", "--json"))  # fmt: skip
    assert facts["verdict"]["lost"]
    assert 2500 < facts["loss"]["rate"] < 4000
    assert "needs" in facts["loss"]["reason"]


def test_a_move_may_be_that_of_a_controller(capsys: pytest.CaptureFixture[str]) -> None:
    """GS-C200: S20 T200 R40 is 200 to 2000 steps/s in ramps of 40."""
    by_law = json.loads(said(capsys, "as1010", "--move", "500", "--as", "gs-c200", "S=20", "T=200", "R=40",
                             "--variants", "0", "--json"))  # fmt: skip
    plain = json.loads(said(capsys, "as1010", "--move", "500", "--start", "200", "--slew", "2000", "--ramp", "40",
                            "--variants", "0", "--json"))  # fmt: skip
    assert by_law["duration_s"] == plain["duration_s"]
    assert by_law["verdict"] == plain["verdict"]
    assert "as dcb-274 I=800 V=6000 K=7,5" in said(
        capsys, "as1010", "--move", "500", "--as", "dcb-274", "I=800", "V=6000", "K=7,5", "--variants", "0"
    )


@pytest.mark.parametrize("model", ["gs-c200", "dcb-274", "supersigma", "bs0610"])
def test_the_step_of_a_controller_is_its_own_whether_it_is_named_or_not(
    model: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """H of a DCB-274 and O of a board have currents of their own (DCB-274 manual, page 40; BS0610 manual, page 30)."""
    controller = law(model)
    words = ["as1010", "--move", "320", "--variants", "0", "--json", "--as", model]
    usual = json.loads(said(capsys, *words))
    for winding in controller.windings:
        named = json.loads(said(capsys, *words, "--step", winding.name))
        assert named["step"] == winding.name
        rig = Rig(motor("as1010"), Drive(24, motor("as1010").current, winding), Load(motor("as1010").rotor), FINE)
        verdict = simulate(controller.train(controller.values, 320), rig).verdict
        assert named["verdict"]["load_angle"] == verdict.load_angle
        if winding == controller.windings[0]:
            assert named == usual


def test_a_motor_of_ones_own_with_its_curve_and_its_mechanics(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "my.csv").write_text("rpm; torque (Ncm)\n75;110\n300;105\n600;96\n900;85\n1500;55\n")
    (tmp_path / "my.toml").write_text(
        "resistance = 1.1\ninductance = 3.6e-3\ncurrent = 2.8\ntorque = 1.26\ninertia = 3e-5\nwiring = 'parallel'\n"
        "[curve]\nfile = 'my.csv'\nsupply = 48\n"
    )
    mine = str(tmp_path / "my.toml")
    facts = json.loads(said(capsys, mine, "--supply", "48", "--json"))
    assert facts["fit"]["rms"] < 0.05
    assert (facts["fit"]["from"], facts["fit"]["to"]) == (250, 5000)
    assert "not measured" in said(capsys, mine, "--supply", "48")
    rewired = json.loads(said(capsys, mine, "--wiring", "series", "--move", "300", "--variants", "0", "--json"))
    assert rewired["current"] == pytest.approx(1.4)
    hung = json.loads(said(capsys, mine, "--move", "300", "--mass", "2", "--screw", "0.005", "--slope", "90", "--gear",
                           "2", "--variants", "0", "--json"))  # fmt: skip
    along = 0.005 / 2 / 6.283185307
    assert hung["torque"] == pytest.approx(2 * 9.80665 * along)
    assert hung["inertia"] == pytest.approx(3e-5 + 2 * along**2)


@pytest.mark.parametrize("tokens", [["nosuch.toml"], ["as1010", "--curve", "nosuch.csv"]])
def test_a_file_that_is_not_there_is_named(tokens: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["motor", *tokens])
    assert caught.value.code == 1
    assert capsys.readouterr().err == f"detent: {tokens[-1]}: No such file or directory\n"


@pytest.mark.parametrize("inertia", [1.0, 30.0, 1e3])
def test_a_load_that_is_far_too_heavy_is_no_speed_that_nobody_gave(
    inertia: float, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["qsh4218-41-10-035", "--inertia", f"{inertia:g}"]
    told = said(capsys, *words, "--pull-in")
    assert "into no speed of 40 steps/s or more" in told
    assert "up to 0 steps/s" not in told
    assert "steps lost after pulse" in said(capsys, *words, "--move", "20", "--slew", "100", "--variants", "0")


def test_a_small_inertia_is_a_number_like_others(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("23-305-ds8a-series", "--supply", "40", "--inertia", "1e-5")
    assert "Starts without a ramp" in said(capsys, *words, "--pull-in")
    assert "steps in" in said(capsys, *words, "--move", "200", "--variants", "0")
    both = said(capsys, "as1010", "--move", "200", "--pull-in", "--variants", "0")
    assert "Starts without a ramp" in both
    assert "200 steps in" in both


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
        (["as1010", "--move", "0"], "a whole number, 1 to"),
        (["as1010", "--move", "10000000"], "judge a shorter one"),
        (["as1010", "--move", "1000.5"], "a whole number, 1 to"),
        (["as1010", "--move", "nan"], "a whole number, 1 to"),
        (["as1010", "--move", "100", "--slew", "nan"], "whole steps/s"),
        (["as1010", "--inertia", "680000", "--move", "100"], "check the unit"),
        (["as1010", "--move", "100", "--slew", "50", "--start", "100"], "is below --start"),
        (["as1010", "--supply", "1e9"], "at most 1000"),
        (["as1010", "--supply", "nan"], "supply is nan"),
        (["as1010", "--start", "100"], "add --move"),
        (["as1010", "--as", "gs-c200"], "add --move"),
        (["as1010", "--move", "100", "--as", "gs-c200", "S=9999"], "S takes 1 to 1000"),
        (["as1010", "--move", "100", "--as", "gs-c20", "S=9"], "did you mean gs-c200"),
        (["as1010", "--move", "100", "--as", "gs-c200", "--start", "9"], "settings of its own"),
        (["as1010", "--move", "99", "--as", "gs-c200", "S=2", "--step", "1/7"], "does no '1/7'"),
        (["as1010", "--move", "99", "--vary", "luck=1"], "no variation of 'luck'"),
        (["as1010", "--move", "99", "--vary", "inertia"], "write NAME=PART"),
        (["as1010", "--damping", "3"], "ratio is 3"),
        (["as1010", "--damping", "0.1", "--ring-down", "0.4"], "give one of them"),
        (["as1010", "--ring-down", "1.4"], "above 0 and below 1"),
        (["as1010", "--mass", "2"], "what moves it"),
        (["as1010", "--mass", "2", "--screw", "0.005", "--belt-radius", "0.01"], "give one of"),
        (["as1010", "--drive", "tmc2208"], "did you mean tmc2209"),
        (["as1010", "--drive", "tmc2209"], "1/4 or finer"),
        (["as1010", "--wiring", "series"], "do not say how"),
        (["23-305-ds8a-series", "--supply", "40", "--pull-in"], "gives no rotor inertia"),
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


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without pipes that have names")
@pytest.mark.parametrize(
    "tokens", [["FILE"], ["MOTOR", "--curve", "FILE"], ["MOTOR", "--load-by", "FILE"], ["MOTOR", "--ring-down", "FILE"]]
)
def test_a_pipe_to_which_nobody_writes_is_not_waited_for(
    tokens: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(texts, "PIPE", 0.01)
    os.mkfifo(tmp_path / "pipe.toml")
    words = [{"FILE": str(tmp_path / "pipe.toml"), "MOTOR": "as1010"}.get(one, one) for one in tokens]
    with pytest.raises(SystemExit) as ended:
        main(["motor", *words])
    assert ended.value.code in (1, 2)
    assert "it is a pipe, and nobody writes to it" in capsys.readouterr().err


def test_settings_that_contradict_each_other_are_told_with_what_the_unit_makes_of_them(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["--move", "50", "--variants", "0", "--as", "dcb-274", "V=600"]
    assert "V=600 is below I=8000: a dcb-274 makes no ramp then" in said(
        capsys, "as1010", *words, "I=8000", "--inertia", "1e-5"
    )
    facts = json.loads(said(capsys, "as1010", *words, "I=8000", "--inertia", "1e-5", "--json"))
    assert facts["remark"].startswith("V=600 is below")
    assert "remark" not in json.loads(said(capsys, "as1010", *words, "I=60", "--inertia", "1e-5", "--json"))


def test_no_number_of_the_list_of_motors_is_cut_where_the_terminal_is_narrow(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = []
    for columns in ("200", "60"):
        monkeypatch.setenv("COLUMNS", columns)
        with pytest.raises(SystemExit):
            main(["motor"])
        told = capsys.readouterr().out
        assert "…" not in told
        whole.append([word for word in told.split() if word.replace(".", "").isdigit() and float(word) < 1000])
    assert whole[0] == whole[1]
