"""The verb run: what it sends, how it ends, what it prints and writes, and what it says to wrong choices."""

import json
import signal
import subprocess
import sys
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
    monkeypatch.setattr("detent.cli.sending.MOST_INSTANTS", 1000)
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
    with np.load(arrays) as archive:
        kept = dict(archive)
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
    assert detent("run", "gs-c200", "--send", "+100", "--steps", str(file), "--overwrite", *words) == 2
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
        (["gs-c200", "--program", ""], "--program: no file is named: write --program FILE"),
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


def test_a_folder_that_is_not_there_is_named_before_anything_is_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "no folder" / "out.vcd"
    assert detent("run", "gs-c200", "--vcd", str(target)) == 2
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
    monkeypatch.setattr("detent.cli.sending.Course.run", breaks)
    assert detent("run", "gs-c200") == 1
    assert capsys.readouterr().err.splitlines() == ["detent: the rotor runs away"] * 2


# -- what was lost, refused, answered ------------------------------------------------------------------------

ARM = """
[units.x]
model = "gs-c200s"
straps = { CHS = "low" }
[motors.arm]
motor = "qsh4218-41-10-035"
unit = "x"
supply = 24
load = { friction = 0.05, viscous = 1e-3 }
[[script]]
at = "1 ms"
send = ["S20", "T5000", "+100"]
to = "x"
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    file = tmp_path / "arm.toml"
    file.write_text(ARM)
    return file


def test_a_refused_line_of_a_script_is_told_with_its_time_its_answer_and_status_1(
    arm: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert detent("run", str(arm)) == 1
    printed = capsys.readouterr()
    assert [line for line in printed.out.splitlines() if line[0] in "1<"] == [
        "1 ms > S20", "< Y", "1 ms > T5000", "< E2", "1 ms > +100", "< Y",
    ]  # fmt: skip
    assert "detent: x refused 'T5000' at 12.46 ms: T takes a rate" in printed.err
    assert "it answered E2" in printed.err
    assert detent("run", str(arm), "--json") == 1
    found = json.loads(capsys.readouterr().out)
    assert [(line["sent"], line["answers"]) for line in found["script"]] == [
        ("S20", ["Y"]), ("T5000", ["E2"]), ("+100", ["Y"]),
    ]  # fmt: skip
    (refused,) = found["refused"]
    assert (refused["unit"], refused["line"], refused["answers"]) == ("x", "T5000", ["E2"])
    assert found["motors"]["arm"] == {"place": pytest.approx(100, abs=1), "commanded": 100, "lost": 0}


def test_a_refused_line_that_was_sent_ends_with_status_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert detent("run", "gs-c200", "--send", "A9") == 1
    assert "gs-c200 refused 'A9'" in capsys.readouterr().err


def test_a_line_that_an_adapter_turns_down_is_told_and_the_only_unit_may_be_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = tmp_path / "cell.toml"
    units = (
        '[units.ad]\nmodel = "sin-10"\n[units.x]\nmodel = "dcb-274"\noptions = { name = "X" }\nstraps = { PARTY = 1 }\n'
    )
    cell.write_text(f'{units}[lines.host]\nunits = ["ad"]\n[lines.bus]\nunits = ["x"]\nhost = "ad"\n')
    scan = ["--send", "ad:&", "--send", "@ 1 s"]
    assert detent("run", str(cell), *scan, "--send", "ad:X+ 50", "--send", "ZM 900", "--for", "3", "--json") == 1
    found = json.loads(capsys.readouterr().out)
    assert found["units"]["x"]["position"] == 50
    assert [(one["unit"], one["line"], one["answers"]) for one in found["refused"]] == [("ad", "ZM 900", ["#"])]


def test_a_line_that_a_busy_module_turns_down_is_told_and_one_that_waits_for_idle_is_not(
    capsys: pytest.CaptureFixture[str],
) -> None:
    lines = ["--send", "S20", "--send", "T50", "--send", "+100"]
    assert detent("run", "gs-c200", "--no-line-timing", *lines) == 1
    assert "gs-c200 refused '+100' at 0 ns: busy: nothing is done" in capsys.readouterr().err
    waiting = [part for line in lines[1::2] for part in ("--send", line, "--send", "@ idle")]
    assert detent("run", "gs-c200", "--no-line-timing", *waiting, "--json") == 0
    assert json.loads(capsys.readouterr().out)["units"]["gs-c200"]["position"] == 100


def test_what_the_script_says_in_the_first_instant_is_waited_for(capsys: pytest.CaptureFixture[str]) -> None:
    cell = "examples/multipoint/cell.toml"
    assert detent("run", cell, "--send", "@ idle", "--send", "u3:V1", "--send", "u7:V1") == 0
    assert capsys.readouterr().out.split("> u3: V1\n")[1].startswith("< V300\n> u7: V1\n< V700\n")


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (("supersigma", "--send", "limit +90 3"),
         "supersigma obeys 'limit +90 3' at 250 us: 300 half steps/s is below 650"),
        (("gs-c200", "--send", "H-", "--send", "@ 255ms", "--send", "K", "--send", "G0", "--for", "1"),
         "gs-c200 obeys 'G0' at 274.5 ms: a homing that was cut off has taken the counter below 0"),
    ],
)  # fmt: skip
def test_a_line_that_does_what_may_not_be_expected_is_told(
    tokens: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert detent("run", *tokens) == 0
    assert f"detent: {message}" in capsys.readouterr().err
    assert detent("run", *tokens, "--json") == 0
    (caution,) = json.loads(capsys.readouterr().out)["cautions"]
    assert caution["what"] in message or message.partition(": ")[2] in caution["what"]


def test_a_motor_that_loses_steps_is_told_and_ends_with_status_1(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A start at 2000 steps/s against a heavy load."""
    arm.write_text(
        ARM.replace("friction = 0.05", "inertia = 1e-3, friction = 0.05").replace(
            '["S20", "T5000", "+100"]', '["S100", "+99"]'
        )
    )
    assert detent("run", str(arm), "--json") == 1
    told = capsys.readouterr()
    motor = json.loads(told.out)["motors"]["arm"]
    assert motor["lost"] > 0
    assert motor["lost"] % 8 == 0
    assert motor["lost"] == pytest.approx(abs(motor["commanded"] - motor["place"]), abs=4)
    assert "arm lost" in told.err
    assert detent("run", str(arm), "--allow-loss") == 0
    assert "steps lost" in capsys.readouterr().out


def test_status_of_a_drive_that_brakes_can_be_seen(capsys: pytest.CaptureFixture[str]) -> None:
    """'@ TIME' lets time pass between two lines, '@ idle' until everything rests."""
    lines = ["move +9000", "@ 300 ms", "stop", "status", "@ idle", "status"]
    found = result(capsys, "supersigma", *[word for line in lines for word in ("--send", line)])
    braking, still = [one["answers"] for one in found["exchanges"] if one["answers"]]  # type: ignore[index, attr-defined]
    assert "moving" in braking[0]
    assert "moving" not in still[0]
    assert found["ended"] == "idle"


def test_an_axis_that_moves_is_never_done(capsys: pytest.CaptureFixture[str]) -> None:
    assert detent("run", "dcb-274", "--send", "X", "--send", "M 500") == 0
    printed = capsys.readouterr().out
    assert "Nothing left to do" not in printed
    assert "dcb-274 runs on for ever: stop it, or name --for TIME" in printed


def test_for_holds_while_an_answer_is_awaited(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The one that is asked is off; another one's program goes on for ever."""
    (tmp_path / "endless.gsc").write_text("again: A1\n C1\n j again\n")
    cell = tmp_path / "cell.toml"
    off = '[units.off]\nmodel = "gs-c200"\npowered = false\n'
    cell.write_text('[units.busy]\nmodel = "gs-c200s"\nprogram = "endless.gsc"\n' + off)
    words = [str(cell), "--for", "50 ms", "--send", "off:F", "--send", "off:V1", "--json"]
    assert detent("run", *words) == 1
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert found["time_ns"] == 50_000_000
    assert [one["sent"] for one in found["exchanges"]] == ["F"]
    assert found["unsent"] == [{"unit": "off", "text": "V1"}]
    assert "before these were sent: 'V1'" in printed.err


def test_an_input_of_a_bare_model_is_held_from_before_the_supply_comes(capsys: pytest.CaptureFixture[str]) -> None:
    """EOT low: a GS-C200 stands in its limit when it homes, and goes back until HOME opens."""
    open_ = result(capsys, "gs-c200", "--send", "H-", "--for", "1")
    held = result(capsys, "gs-c200", "--send", "H-", "--for", "1", "--pin", "EOT=low")
    assert held["units"] != open_["units"]


@pytest.mark.parametrize(
    ("tokens", "said"),
    [
        (["gs-c200", "--pin", "EOTT=low"], "no input of the gs-c200 'EOTT'; did you mean EOT?"),
        (["gs-c200", "--pin", "EOT=down"], "a level is 0, 1, low or high"),
        (["gs-c200", "--pin", "CHS=low"], "CHS is a strap: give --strap CHS=low"),
        (["gs-c200", "--pin", "RDY=low"], "no input of the gs-c200 'RDY'"),
        ([DRILLING, "--pin", "EOT=low"], "write UNIT.PIN=LEVEL"),
        ([DRILLING, "--pin", "bar.UI1=low"], "a switch of the cell drives bar.UI1"),
        (["gs-c200", "--for", "1e22"], "longer than 1000000 years"),
        (["gs-c200", "--send", "@ soon"], "is no duration"),
        (["gs-c200", "--sr-rate", "1000"], "--sr-rate is for --sr"),
        (["gs-c200", "--vcd", "same", "--npz", "./same"], "two outputs cannot go to one file"),
        (["/dev/zero"], "larger than 16 MiB"),
    ],
)
def test_what_run_is_asked_wrongly(tokens: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert detent("run", *tokens) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("kind", ["vcd", "sr", "npz", "plot"])
def test_an_output_replaces_what_a_run_has_made_and_nothing_else_unasked(
    kind: str, arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / ("out.svg" if kind == "plot" else "out")
    file.write_text("mine")
    assert detent("run", "gs-c200", f"--{kind}", str(file)) == 2
    assert "is there: write to another file, or over it with --overwrite" in capsys.readouterr().err
    assert file.read_text() == "mine"
    assert detent("run", "gs-c200", f"--{kind}", str(file), "--overwrite") == 0
    assert detent("run", "gs-c200", f"--{kind}", str(file)) == 0
    if kind != "plot":
        assert detent("run", str(arm), f"--{kind}", str(arm)) == 2
        assert "is read here, and would be lost" in capsys.readouterr().err
        assert arm.read_text() == ARM


def test_a_device_that_is_full_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert detent("run", "gs-c200", "--vcd", "/dev/full") == 1
    assert capsys.readouterr().err == "detent: /dev/full: cannot write it: No space left on device\n"
    assert detent("run", "gs-c200", "--vcd", "/nonexistent/x.vcd") == 2
    assert capsys.readouterr().err == "detent: /nonexistent/x.vcd: cannot write it: there is no folder /nonexistent\n"


def test_a_large_file_is_told_beforehand_and_termination_leaves_no_part_of_it(tmp_path: Path) -> None:
    words = ["run", "gs-c200s", "--send", "S3", "--send", "R3", "--send", "T3", "--send", "g+", "--for", "200000"]
    command = [sys.executable, "-c", "import detent.cli; detent.cli.main()", *words, "--vcd", str(tmp_path / "big.vcd")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        said = process.stderr.readline()
        assert "pulses, about" in said
        process.terminate()
        assert process.wait(60) == 128 + signal.SIGTERM
    assert list(tmp_path.iterdir()) == []


def test_units_whose_names_a_vcd_cannot_have_or_makes_alike_get_others(tmp_path: Path) -> None:
    cell = tmp_path / "cell.toml"
    cell.write_text("".join(f'[units."{name}"]\nmodel = "gs-c200"\n' for name in ("$end", "a b", "a_b", "$scope")))
    assert detent("run", str(cell), "--vcd", str(tmp_path / "out.vcd")) == 0
    scopes = [line.split()[2] for line in (tmp_path / "out.vcd").read_text().splitlines() if line.startswith("$scope")]
    assert scopes == ["_end", "a_b", "a_b_2", "_scope"]
