"""The verb run: what it sends, how it ends, what it prints and writes, and what it says to wrong choices."""

import json
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from detent.cli import main
from detent.motors.motor import MotorError

EXAMPLES = Path(__file__).parents[2] / "examples"
DRILLING = str(EXAMPLES / "drilling" / "cell.toml")


def detent(*tokens: str) -> int | str | None:
    """Exit status of the command."""
    with pytest.raises(SystemExit) as caught:
        main(tokens)
    return caught.value.code


def result(capsys: pytest.CaptureFixture[str], *tokens: str) -> dict[str, object]:
    assert detent("run", *tokens, "--json") == 0
    return json.loads(capsys.readouterr().out)


def test_lines_are_sent_one_after_the_other_and_answers_shown_without_their_checksums(
    capsys: pytest.CaptureFixture[str],
) -> None:
    # 11 bit times a character at 9600 baud ("Communication port characteristics"): 4, 3, 4 and 4 of them
    found = result(capsys, "gs-c200", "--send", "I3", "--send", "V1")
    assert found == {
        "time_ns": sum(round(characters * 11 * 1e9 / 9600) for characters in (4, 3, 4, 4)),
        "ended": "idle",
        "units": {"gs-c200": {"position": 0, "pulses": 0, "state": "ready"}},
        "exchanges": [
            {"unit": "gs-c200", "sent": "I3", "answers": ["Y"]},
            {"unit": "gs-c200", "sent": "V1", "answers": ["V0"]},
        ],
    }


def test_a_move_of_999999_steps_runs_to_its_end(capsys: pytest.CaptureFixture[str]) -> None:
    found = result(capsys, "gs-c200s", "--send", "+999999", "--no-line-timing")
    assert found["units"] == {"gs-c200s": {"position": 999999, "pulses": 999999, "state": "ready"}}


def test_for_ends_a_move_that_has_no_end(capsys: pytest.CaptureFixture[str]) -> None:
    # S10 T100 R50: 90 909 091 ns for the ramp of 50 steps, then 1000 steps/s
    found = result(capsys, "gs-c200s", "--send", "g+", "--no-line-timing", "--for", "2 s")
    assert found["time_ns"] == 2_000_000_000
    assert found["units"] == {"gs-c200s": {"position": 1959, "pulses": 1959, "state": "running"}}


def test_a_line_that_begins_with_a_minus_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    found = result(capsys, "gs-c200s", "--send", "-100")
    assert found["units"] == {"gs-c200s": {"position": -100, "pulses": 100, "state": "ready"}}


def test_a_program_is_loaded_and_executed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program = tmp_path / "go.gsc"
    program.write_text("S10\nT100\nR50\nG500000 ; datasheet, example 1\n")
    found = result(capsys, "gs-c200", "--program", str(program))
    assert found["units"] == {"gs-c200": {"position": 500000, "pulses": 500000, "state": "ready"}}


def test_a_cell_runs_with_its_script_and_its_units_can_be_told_apart(capsys: pytest.CaptureFixture[str]) -> None:
    found = result(capsys, DRILLING, "--send", "bar:F", "--send", "drill:F")
    assert [exchange["answers"] for exchange in found["exchanges"]] == [["B"], ["B"]]  # type: ignore[index,attr-defined]
    units = found["units"]
    assert units == {
        "bar": {"position": 980, "pulses": 980, "state": "ready"},
        "drill": {"position": 0, "pulses": 1500, "state": "ready"},
    }


def test_an_endless_program_is_stopped_and_said_to_be_endless(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("detent.cli.run.MOST_INSTANTS", 1000)
    program = tmp_path / "endless.gsc"
    program.write_text("again: A1\n C1\n j again\n")
    assert detent("run", "gs-c200s", "--program", str(program)) == 0
    printed = capsys.readouterr()
    assert "running" in printed.out
    assert "looks endless" in printed.err
    assert "--for TIME" in printed.err


def test_a_motor_that_turns_on_without_further_events_is_said_to_be_at_work(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert detent("run", "gs-c200s", "--send", "g-") == 0
    assert "gs-c200s still at work" in capsys.readouterr().out


def test_waveforms_arrays_and_figures_are_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {flag: tmp_path / f"out.{flag}" for flag in ("vcd", "sr", "npz", "png")}
    flags = [word for flag, file in files.items() for word in (f"--{flag.replace('png', 'plot')}", str(file))]
    assert detent("run", "gs-c200", "--send", "+100", *flags) == 0
    printed = capsys.readouterr().out
    assert all(str(file) in printed for file in files.values())
    assert b"$timescale 1 ns $end" in files["vcd"].read_bytes()
    assert files["png"].read_bytes().startswith(b"\x89PNG")
    assert "metadata" in ZipFile(files["sr"]).namelist()
    assert "gs-c200/step_times.npy" in ZipFile(files["npz"]).namelist()


def test_steps_are_written_as_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each pulse of the run, computed from the rows as they are documented, is within the error of its time."""
    file, arrays = tmp_path / "out.csv", tmp_path / "out.npz"
    words = ["--steps", str(file), "--steps-frequency", "16000000", "--npz", str(arrays)]
    assert detent("run", "gs-c200s", "--send", "-300", *words) == 0
    assert str(file) in capsys.readouterr().out
    header, *rows = file.read_text().splitlines()
    assert header == "axis,direction,base,interval,count,add"
    ticks, directions = [], []
    for row in rows:
        axis, direction, *numbers = row.split(",")
        base, interval, count, add = map(int, numbers)
        assert axis == "gs-c200s"
        ticks += [base + k * interval + add * k * (k - 1) // 2 for k in range(1, count + 1)]
        directions += [int(direction)] * count
    kept = np.load(arrays)
    assert directions == kept["gs-c200s/step_directions"].tolist() == [-1] * 300
    for tick, time in zip(ticks, kept["gs-c200s/step_times"].tolist(), strict=True):
        assert abs(tick * 1000 - time * 16) <= 16 * 1000


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--steps-frequency", "0"], "--steps-frequency 0: a clock has 1 tick a second or more"),
        (["--steps-frequency", "150"], "150 ticks a second are too few for this train; take a faster clock"),
        (["--steps-error", "2us"], 'Choose from: "exact"'),
    ],
)
def test_steps_that_cannot_be_written_leave_the_file_alone(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "out.csv"
    file.write_text("mine\n")
    assert detent("run", "gs-c200", "--send", "+100", "--steps", str(file), "--force", *words) == 2
    assert said in " ".join(capsys.readouterr().err.replace("\u2502", " ").split())
    assert file.read_text() == "mine\n"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    ("tokens", "said"),
    [
        (["gs-c20"], "no model 'gs-c20'; did you mean gs-c200?"),
        (["nowhere.toml"], "nowhere.toml: cannot read it: No such file or directory"),
        (["gs-c200", "--strap", "CHSS=low"], "no strap of the gs-c200 'CHSS'; did you mean CHS?"),
        (["gs-c200", "--strap", "CHS=up"], "strap CHS cannot be 'up'; it takes low (0), high (1) or open"),
        (["gs-c200", "--strap", "CHS"], "--strap: 'CHS': write NAME=VALUE"),
        (["gs-c200", "--strap", "TEST=high"], "pin 10 (TEST) of gs-c200 must be tied to ground"),
        (["gs-c200", "--set", "revison=2.1"], "no option of the gs-c200 'revison'; did you mean revision?"),
        (["gs-c200", "--set", "instruction_time=1"], ""),
        (["gs-c200", "--set", "instruction_time=0"], "instruction_time cannot be '0'; it takes a duration of at least"),
        (["gs-c200", "--for", "soon"], "'soon' is no duration: write it like"),
        (["gs-c200", "--program", "none.gsc"], "program: cannot read none.gsc: No such file or directory"),
        ([DRILLING, "--send", "F"], "a cell has several units, write UNIT:LINE"),
        ([DRILLING, "--send", "bra:F"], "no unit 'bra'; did you mean bar?"),
        ([DRILLING, "--strap", "CHS=low"], "a cell has several units, write UNIT.NAME=VALUE"),
        ([DRILLING, "--set", "dril.clock=separate"], "no unit 'dril'; did you mean drill?"),
        (["gs-c200", "--plot", "x.bmp"], "a figure is one of .png, .svg, .pdf, not '.bmp'"),
    ],
)
def test_a_wrong_choice_is_one_line_with_the_remedy_and_exit_status_2(
    tokens: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert detent("run", *tokens) == (2 if said else 0)
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == (1 if said else 0)


def test_a_file_that_cannot_be_written_exits_with_1_and_names_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "no folder" / "out.vcd"
    assert detent("run", "gs-c200", "--vcd", str(target)) == 1
    assert str(target.parent) in capsys.readouterr().err


def test_straps_and_options_of_a_cells_unit_are_changed_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    found = result(capsys, DRILLING, "--set", "bar.instruction_time=2ms", "--set", "drill.instruction_time=2ms")
    assert found["units"]["bar"]["position"] == 980  # type: ignore[index,call-overload]
    slower = found["time_ns"]
    assert slower > result(capsys, DRILLING)["time_ns"]  # type: ignore[operator]


def test_a_motor_that_breaks_the_equations_ends_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def breaks(*_: object, **__: object) -> None:
        raise MotorError("the rotor runs away")

    monkeypatch.setattr("detent.cli.exports.write", breaks)
    assert detent("run", "gs-c200", "--plot", str(tmp_path / "a.png")) == 1
    monkeypatch.setattr("detent.cli.run._Course.run", breaks)
    assert detent("run", "gs-c200") == 1
    assert capsys.readouterr().err.splitlines() == ["detent: the rotor runs away"] * 2
