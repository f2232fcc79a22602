"""The verb `boards`: what is plugged in, and the check of a machine, on the fake board."""

import io
import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from detent.cli import main
from detent.cli.boards import ranges

EXAMPLES = Path(__file__).parents[2] / "examples" / "replacement"
CELLS = sorted(EXAMPLES.glob("*.toml"))


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    status: object = 0
    try:
        main(words)
    except SystemExit as end:
        status = end.code
    told = capsys.readouterr()
    return int(str(status or 0)), told.out, told.err


@pytest.fixture(autouse=True)
def nobody_types(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(""))


def test_a_board_says_what_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "boards", "fake:rp2040")
    assert status == 0
    assert "fake, 12 MHz" in out
    assert "gpio0 to gpio29" in out
    assert 'serial = "fake:rp2040"' in out
    status, out, _ = run(capsys, "boards", "fake:", "fake:stm32", "--json")
    first, second = json.loads(out)
    assert (status, first["frequency"], first["reserved"]) == (0, 16_000_000, {"gpio0": "serial", "gpio1": "serial"})
    assert second["pins"][16] == "PB0"
    assert second["missing"] == []


def test_no_board_and_what_is_none(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("detent.realtime.boards.ports.candidates", list)
    status, out, err = run(capsys, "boards")
    assert (status, out) == (1, "")
    assert "no board calls itself Klipper" in err
    assert run(capsys, "boards", "--json") == (1, "[]\n", "")
    status, _, err = run(capsys, "boards", "/dev/null")
    assert status == 1
    assert "/dev/null is no serial device" in err
    status, _, err = run(capsys, "boards", "fake:atari")
    assert status == 1
    assert "there are fake:, fake:rp2040, fake:stm32" in err


def test_pins_in_a_row_are_one_range() -> None:
    assert ranges(["PA0", "PA1", "PA2", "PB7", "PB9", "ADC"]) == ["PA0 to PA2", "PB7", "PB9", "ADC"]


@pytest.mark.parametrize("cell", CELLS, ids=[cell.stem for cell in CELLS])
def test_every_example_is_checked_and_jogged(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("boards", "check", str(cell), "--yes", "--steps", "20", "--speed", "400", "--json")
    status, out, err = run(capsys, *words)
    assert (status, err) == (0, "")
    told = json.loads(out)
    assert told["wrong"] is None
    assert told["inputs"]
    for legs in told["jogs"].values():
        assert [(leg["direction"], leg["made"], leg["why"]) for leg in legs] == [(1, 20, ""), (-1, 20, "")]


def test_nothing_is_jogged_unasked(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    cell = str(EXAMPLES / "pico-gs-c200.toml")
    status, out, _ = run(capsys, "boards", "check", cell)
    assert status == 0
    assert "Nothing moves." in out
    assert "slide.EOT" in out
    assert "pulses plus" not in out
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    status, out, _ = run(capsys, "boards", "check", cell, "--jog")
    assert status == 0
    assert "THE MOTOR WILL MOVE" in out
    assert "Not jogged." in out
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    status, out, _ = run(capsys, "boards", "check", cell, "--jog", "--steps", "10", "--speed", "400")
    assert status == 0
    assert "plus  10 of 10 pulses, as many as were asked" in out
    assert "minus 10 of 10 pulses" in out


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (("check",), "say which cell: detent boards check CELL.toml"),
        (("--yes",), "are for a check"),
        (("check", "CELL", "--axis", "slid"), "--axis: no axis 'slid'; did you mean slide"),
        (("check", "CELL", "--speed", "9000"), "--speed: 9000: 1 to 2000 pulses a second"),
        (("check", "CELL", "--steps", "0"), "--steps: 0: 1 to 1000000 pulses"),
        (("check", "CELL", "--watch", "-1"), "--watch: -1: 0 to 86400 seconds"),
        (("check", str(EXAMPLES.parent / "drilling" / "cell.toml")), "no pin of this cell is real"),
    ],
)
def test_asked_wrongly(words: tuple[str, ...], error: str, capsys: pytest.CaptureFixture[str]) -> None:
    cell = str(EXAMPLES / "pico-gs-c200.toml")
    status, out, err = run(capsys, "boards", *(cell if word == "CELL" else word for word in words))
    assert (status, out) == (2, "")
    assert error in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_whatever_ends_it_no_motor_turns_on(number: int) -> None:
    """Ctrl-C, `kill`, a terminal that is closed: the board is stopped before the process goes."""
    cell = EXAMPLES / "pico-gs-c200.toml"
    words = [sys.executable, "-m", "detent", "boards", "check", str(cell), "--watch", "0", "--yes", "--speed", "20"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=0) as process:
        assert process.stdout is not None
        told = ""
        while not told.endswith("  plus  "):
            told += process.stdout.read(1)
        process.send_signal(number)
        _, wrong = process.communicate(timeout=60)
    assert process.returncode == (130 if number == signal.SIGINT else 128 + number)
    assert wrong == "detent: stopped by hand; the boards are shut down, and their outputs off\n"
