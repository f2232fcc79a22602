"""The verb `workbench`: how it is asked wrongly, and what it prints when it is ready."""

import json
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from detent.cli import main
from detent.workbench.listening import Listening

pytest.importorskip("nicegui", reason="nicegui is not installed")

COMMAND = [sys.executable, "-c", "from detent.cli import main; main()", "workbench"]


def wrong(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The one line on stderr of a command that is asked wrongly."""
    with pytest.raises(SystemExit) as ended:
        main(["workbench", *map(str, arguments)])
    out, err = capsys.readouterr()
    assert ended.value.code == 2, err
    assert out == ""
    assert err.count("\n") == 1
    return err


def test_an_address_that_others_can_reach_needs_a_token(capsys: pytest.CaptureFixture[str]) -> None:
    assert "--token" in wrong(capsys, "--host", "0.0.0.0")
    assert "too short" in wrong(capsys, "--host", "0.0.0.0", "--token", "short")


def test_a_folder_that_is_none_is_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert "no folder" in wrong(capsys, "--folder", tmp_path / "nothing")


def test_a_port_that_is_taken_is_told_with_the_remedy(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        told = wrong(capsys, "--port", taken.getsockname()[1])
    assert "--port" in told


def test_a_pace_that_is_none_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert "--pace" in wrong(capsys, "--pace", "0")


def test_where_programs_are_let_in_is_checked_before_anything_is_opened(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert "--control: 'here' is no HOST:PORT" in wrong(capsys, "--control", "here")
    told = wrong(capsys, "gs-c200", "--control", "0.0.0.0:0", "--port", "0", "--state", tmp_path)
    assert "open to other computers" in told


def test_a_model_that_there_is_not_is_told_with_the_likeliest(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert "did you mean gs-c200" in wrong(capsys, "gs-c20", "--state", tmp_path)
    assert "cannot read" in wrong(capsys, tmp_path / "nothing.toml", "--state", tmp_path)


def test_it_says_what_to_open_and_a_signal_ends_it_cleanly(tmp_path: Path) -> None:
    command = [*COMMAND, "gs-c200", "--state", str(tmp_path), "--folder", str(tmp_path), "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    line = process.stdout.readline()
    facts = json.loads(line)
    assert facts["url"].startswith("http://127.0.0.1:")
    assert [(end["unit"], end["kind"]) for end in facts["endpoints"]] == [("gs-c200", "pty")]
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (0, "", "")


def test_a_page_has_an_address_with_the_token() -> None:
    listening = Listening(socket.socket(), "0.0.0.0", 8274)
    with listening.socket:
        assert listening.url("word", "unit") == "http://127.0.0.1:8274/unit?token=word"
        assert listening.url(None) == "http://127.0.0.1:8274/"
