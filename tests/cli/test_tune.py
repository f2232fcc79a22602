"""`detent tune` and `compare-moves`, as their users type them."""

import csv
import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from detent.cli import main
from detent.cli import tune as verb
from detent.motors import chance
from detent.motors.winding import DCB_274, Winding
from detent.tuner import batch as batching
from detent.tuner import tune as tuning
from detent.tuner.judge import Job, Judge, Lost
from detent.tuner.search import Progress
from detent.tuner.spaces import Space, space
from detent.tuner.task import Task

RIG = ["--motor", "qsh4218-41-10-035", "--inertia", "1.5e-5", "--friction", "0.02"]


def run(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> str:
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    told = capsys.readouterr()
    assert (ended.value.code or 0) == code, told.err
    return told.out if not code else told.err


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """A grid of a few settings in the place of thousands."""

    def made(task: Task) -> Space:
        whole = space(task)
        values = ((40, 90), (200, 400, 600), (20, 40, 80, 160))
        return whole._replace(
            dimensions=tuple(one._replace(values=some) for one, some in zip(whole.dimensions, values, strict=True))
        )

    monkeypatch.setattr("detent.tuner.judge.space", made)


@pytest.mark.usefixtures("few")
def test_a_tuned_move_is_told_with_what_is_proved_of_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    program, table = tmp_path / "tuned.gsc", tmp_path / "map.csv"
    words = ["tune", "gs-c200", *RIG, "--moves", "60", "--variants", "64", "--into", str(program), "--json",
             "--vary", "inertia=0.1,voltage=0.05,torque_constant=0,inductance=0,resistance=0,damping=0"]  # fmt: skip
    found = json.loads(run(capsys, *words))
    assert found["complete"]
    assert [line[0] for line in found["commands"]] == ["S", "T", "R"]
    assert found["check"]["variants"] == 64
    assert (found["check"]["lost"], found["check"]["corners_lost"], found["check"]["corners"]) == (0, 0, 8)
    (move,) = found["moves"]
    assert move["steps"] == 60
    assert move["bound_s"]["nominal"] <= move["bound_s"]["worst"] < move["time_s"] == found["time_s"]
    assert program.read_text().split() == [*found["commands"], "+60"]
    assert any("damping 0.12 (assumed" in word for word in found["assumed"])
    assert not table.exists()
    assert "over it with --overwrite" in run(capsys, *words, code=2)


@pytest.mark.parametrize(
    ("model", "sets"),
    [
        ("gs-c200", "S20\nT50\nR100\n+60\n"),
        ("dcb-274", "I 200\nV 1500\nK 10 10\nD 1\n+ 60\n"),
        pytest.param("bs0710", "X\n8!\n100K\n800R\n1000P\n60G\n", marks=pytest.mark.slow),  # their spaces take
        pytest.param("supersigma", 'table = "0:1"\nshort = "off"\n', marks=pytest.mark.slow),  # long to be made
    ],
)
def test_a_file_that_sets_nothing_is_told_before_the_work(
    model: str,
    sets: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def work(*_: Any, **__: Any) -> None:
        raise ValueError("the work begins")

    monkeypatch.setattr("detent.tuner.tune.tune", work)
    source, into = tmp_path / "source", tmp_path / "into"
    axis = ["--axis", "X"] if model == "bs0710" else []
    words = ["tune", model, *RIG, *axis, "--moves", "60", "--from", str(source), "--into", str(into)]
    source.write_text("; nothing\n")
    assert "source: nothing there sets what" in run(capsys, *words, code=2)
    source.write_text(sets)
    assert "the work begins" in run(capsys, *words, code=2)
    if model == "supersigma":
        words = [word for word in words if word not in ("--from", str(source))]
        assert "runs no programs" in run(capsys, *words, code=2)
    assert not into.exists()


@pytest.mark.parametrize(
    ("words", "remedy"),
    [
        (["tune", "gs-c200", "--moves", "100"], "--motor"),
        (["tune", "gs-c200", *RIG, "--moves", "1.5"], "200,1000x3"),
        (["tune", "gs-c200", *RIG, "--moves", "100", "--from", "x"], "--into"),
        (["tune", "gs-c200", *RIG, "--moves", "100", "--map", "map.xyz"], "png"),
        (["tune", "gs-c200", *RIG, "--moves", "100", "--set", "x"], "OPTION=VALUE"),
        (["tune", "gs-c200", *RIG, "--moves", "100", "--travel", "9"], "--on PORT"),
        (["tune", "gs-c200", *RIG, "--moves", "100", "--each-move", "--map", "a.png"], "--each-move"),
        (["tune", "bs0610", *RIG, "--moves", "100", "--step", "half"], "step_size"),
        (["tune", "gs-c200", *RIG, "--moves", "100", "--axis", "X"], "one axis"),
        (["tune", "gs-c200", *RIG, "--moves", "100", "--scheduler", "nowhere"], "tcp://HOST:PORT"),
        (["tune", "gs-c2000", *RIG, "--moves", "100"], "gs-c200"),
        (["compare-moves", "gs-c200", "S=48", *RIG, "--moves", "100"], "two to 6"),
        (["compare-moves", "gs-c200", "S=48", "Q=1", *RIG, "--moves", "100"], "there are"),
    ],
)
def test_what_was_asked_wrongly_is_told_with_the_remedy(
    words: list[str], remedy: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert remedy in run(capsys, *words, code=2)


def test_settings_are_compared_with_the_same_variants(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    picture = tmp_path / "compared.png"
    words = ["compare-moves", "gs-c200", "S=48 T=603 R=201", "S=102 T=403 R=20", *RIG, "--moves", "200,400",
             "--variants", "64"]  # fmt: skip
    gentle, rough = json.loads(run(capsys, *words, "--json"))["settings"]
    assert gentle["check"]["lost"] <= rough["check"]["lost"]
    assert {row["check"]["looks"] for row in (gentle, rough)} == {2}
    assert gentle["torque_used"] < rough["torque_used"]
    assert gentle["moves"][1]["time_s"] > gentle["moves"][0]["time_s"]
    assert "torque used" in run(capsys, *words, "--plot", str(picture))
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("few")
def test_a_batch_answers_row_by_row_and_a_row_without_answer_says_why(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    rows = tmp_path / "machines.csv"
    rows.write_text("inertia,friction,moves\n1.5e-5,0.02,60\n1.5e-5,0.7,60\n")
    words = ["tune", "gs-c200", "--batch", str(rows), "--motor", "qsh4218-41-10-035", "--variants", "32",
             "--no-corners", "--no-gpu"]  # fmt: skip
    found, none = [json.loads(line) for line in run(capsys, *words, "--json").splitlines()]
    assert found["given"] == {"inertia": "1.5e-5", "friction": "0.02", "moves": "60"}
    assert (found["lost"], found["of"], found["problem"]) == (0, 32, "")
    assert found["below"] == chance.bound(0, 32, looks=found["looks"])
    assert [line[0] for line in found["commands"]] == ["S", "T", "R"]
    assert "does not turn this load" in none["problem"]
    table = list(csv.DictReader(run(capsys, *words).splitlines()))
    assert [row["settings"] for row in table] == [found["settings"], ""]
    assert table[1]["problem"] == none["problem"]
    assert [row["looks"] for row in table] == [str(found["looks"]), ""]


def test_a_row_of_a_batch_may_name_the_step_of_its_controller(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The currents of that step are the controller's, and what it does not do is told with its line."""

    def known(task: Task, _: object) -> batching.Answer:
        asked.append(task.rig.drive.winding)
        return batching.Answer()

    asked: list[Winding] = []
    monkeypatch.setattr(batching, "answer", known)
    rows = tmp_path / "machines.csv"
    words = ["tune", "dcb-274", "--batch", str(rows), *RIG, "--moves", "60", "--no-gpu"]
    rows.write_text("supply,step\n24,\n24,1/4\n24,half\n")
    run(capsys, *words)
    quarter, half = DCB_274[1], DCB_274[2]
    assert asked == [quarter, quarter, half]
    rows.write_text("supply,step\n24,\n24,1/16\n")
    assert "line 3: a dcb-274 does no '1/16'; there are: 1/4," in run(capsys, *words, code=2)


def test_processes_that_share_the_work_take_no_gpu(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["tune", "gs-c200", *RIG, "--moves", "60", "--gpu", "--workers", "2"]
    assert "leave one of them out" in run(capsys, *words, code=2)


SMALL = ["--variants", "64", "--no-corners", "--no-gpu"]


@pytest.fixture
def planted(few: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """A few settings, of which no motor is asked: what has a ramp below 60 is lost."""

    def answer(_: Judge, job: Job) -> Lost:
        lost = job.variants if job.point[2] < 60 else ()
        return lost if job.to_the_end else lost[:1]

    monkeypatch.setattr(Judge, "answer", answer)
    monkeypatch.setattr(tuning, "models", lambda *_: ())
    monkeypatch.setattr(tuning, "fails", lambda *_: ())


@pytest.fixture
def ctrl_c(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Presses Ctrl-C, for real, when the work says that it is at a stage (how what it does begins)."""

    def at(stage: str) -> None:
        @contextmanager
        def watched() -> Iterator[Callable[[Progress], None]]:
            def watch(step: Progress) -> None:
                if step.doing.startswith(stage) and (stage != "looking" or step.best is not None) and not pressed:
                    pressed.append(step)
                    os.kill(os.getpid(), signal.SIGINT)

            yield watch

        monkeypatch.setattr(verb, "_watch", watched)

    pressed: list[Progress] = []
    return at


@pytest.mark.parametrize(
    ("stage", "proved"),
    [
        ("looking", False),
        ("at ", False),
        ("comparing", True),
        ("map", True),
    ],
)
@pytest.mark.usefixtures("planted")
def test_ctrl_c_loses_nothing_that_is_known(
    stage: str, proved: bool, ctrl_c: Callable[[str], None], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    ctrl_c(stage)
    program, picture = tmp_path / "tuned.gsc", tmp_path / "map.csv"
    with pytest.raises(SystemExit) as ended:
        main(
            ["tune", "gs-c200", *RIG, "--moves", "60", *SMALL, "--map", str(picture), "--into", str(program), "--json"]
        )
    assert ended.value.code == 130
    told = capsys.readouterr()
    found = json.loads(told.out)
    assert found["complete"] is proved
    assert [line[0] for line in found["commands"]] == ["S", "T", "R"]
    (line,) = told.err.splitlines()
    assert line.startswith("detent: stopped; ")
    assert line.endswith(" not written")
    assert str(picture) in line
    assert not picture.exists()
    # what nothing has proved goes into no program
    assert program.exists() is proved
    assert (str(program) in line) is not proved


@pytest.mark.usefixtures("planted")
def test_ctrl_c_before_anything_is_known_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @contextmanager
    def pressed() -> Iterator[Callable[[], bool]]:
        yield lambda: True

    monkeypatch.setattr(verb, "_interruptible", pressed)
    told = run(capsys, "tune", "gs-c200", *RIG, "--moves", "60", *SMALL, code=130)
    assert told == "detent: stopped before any setting without loss was known\n"


@pytest.mark.usefixtures("planted")
def test_ctrl_c_between_moves_keeps_what_is_known_of_the_first(
    ctrl_c: Callable[[str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    ctrl_c("comparing")
    with pytest.raises(SystemExit) as ended:
        main(["tune", "gs-c200", *RIG, "--moves", "60,90", "--each-move", *SMALL, "--json"])
    assert ended.value.code == 130
    told = capsys.readouterr()
    (first,) = json.loads(told.out)["each_move"]
    assert first["complete"]
    assert told.err == "detent: stopped; nothing is known of moves of 90 steps\n"
