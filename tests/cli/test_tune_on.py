"""`detent tune --on`: what is asked for, the log on disk, and a run over a pseudo-terminal."""

import json
from pathlib import Path

import pytest

from detent.cli import main
from detent.realtime.trial_log import LogUnusable, TrialLog


def said(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    with pytest.raises(SystemExit) as end:
        main(["tune", *words])
    return int(end.value.code or 0), capsys.readouterr().err


BASE = ["gs-c200", "--on", "/nowhere", "--moves", "300"]
BEGIN = ["--begin", "S=60", "T=400", "R=300"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], "--begin: say with which S, T, R to begin"),
        (["--begin", "S=60", "R=300"], "--begin: say with which T to begin"),
        (BEGIN, "--step: say what one step of the gs-c200 is for the motor"),
        ([*BEGIN, "--step", "half"], "--travel: say how many steps"),
        ([*BEGIN, "--step", "half", "--travel", "320"], "needs a travel of 348"),
        ([*BEGIN, "--step", "half", "--travel", "400"], "--witness: say which input"),
        ([*BEGIN, "--step", "half", "--travel", "400", "--witness", "UI1", "--unit", "color=red"], "--unit color=red"),
        ([*BEGIN, "--step", "half", "--travel", "400", "--reserve", "0.5"], "a reserve is a factor of 1 to 100"),
        ([*BEGIN, "--step", "half", "--travel", "400", "--behind", "10"], "10 steps of room behind"),
    ],
)
def test_what_is_missing_or_wrong_is_one_line(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, text = said([*BASE, *words], capsys)
    assert status == 2
    assert told in text
    assert text.count("\n") == 1


DCB = ["dcb-274", "--on", "/nowhere", "--moves", "300", "--travel", "4000", "--step", "half", "--begin"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["gs-c200", *BASE[1:], "--step", "half", "--travel", "400", "--begin", "S=60", "T=40", "R=300"],
         "a harder R changes nothing: T=40 is below S=60: a gs-c200 makes no ramp then, and all steps at 400 steps/s"),
        ([*DCB, "I=800", "V=60", "K=9"], "a harder K changes nothing: V=60 is below I=800"),
        ([*DCB, "I=100", "V=2000", "K=0"], "K=0 is no ramp at all"),
        ([*DCB, "I=100", "V=2000", "K=5,0"], "K=0 is no ramp at all"),
        (["bs0610", *DCB[1:7], "--step", "1/16", "--axis", "X", "--begin", "K=900", "R=800", "P=100"],
         "a harder P changes nothing: R=800 is below K=900"),
    ],
)  # fmt: skip
def test_settings_in_which_nothing_can_be_made_harder_are_refused(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, text = said(words, capsys)
    assert status == 2
    assert told in text
    assert text.count("\n") == 1


def test_trials_that_set_both_ramps_alike_begin_with_the_gentler() -> None:
    """K=5,9: 5 down, too, would be harder than what is known to be safe."""
    from detent.moves.laws import law
    from detent.tuner.machine.bench import knob_of

    assert knob_of(law("dcb-274")).gentlest({"K up": 5, "K down": 9}) == 9
    assert knob_of(law("bs0610", {}, "X")).gentlest({"P": 700}) == 700


class TestLog:
    def test_what_is_written_is_read_again_and_a_torn_line_is_taken_off(self, tmp_path: Path) -> None:
        path = tmp_path / "log"
        with TrialLog(path) as log:
            assert log.past == []
            log.write({"kind": "plan"})
            log.write({"kind": "trial", "lost": False})
        with path.open("a") as file:
            file.write('{"kind": "tri')
        with TrialLog(path) as log:
            assert [record["kind"] for record in log.past] == ["plan", "trial"]
            log.write({"kind": "end"})
        assert [json.loads(line)["kind"] for line in path.read_text().splitlines()] == ["plan", "trial", "end"]

    @pytest.mark.parametrize("text", ["a report\n", '{"kind": "trial"}\n', "no line at all", "[1]\n"])
    def test_another_file_is_left_alone(self, tmp_path: Path, text: str) -> None:
        path = tmp_path / "log"
        path.write_text(text)
        with pytest.raises(LogUnusable, match="choose another --log"):
            TrialLog(path)
        assert path.read_text() == text

    def test_two_runs_do_not_write_one_log(self, tmp_path: Path) -> None:
        with TrialLog(tmp_path / "log"), pytest.raises(LogUnusable, match="another run writes it"):
            TrialLog(tmp_path / "log")

    def test_a_place_that_is_none(self, tmp_path: Path) -> None:
        with pytest.raises(LogUnusable, match="choose another place"):
            TrialLog(tmp_path / "nowhere" / "log")
