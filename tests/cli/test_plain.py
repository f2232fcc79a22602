"""Outputs on a terminal without our signs or without columns, on a stream that is closed, on a disk that is full."""

import errno
import io
import os
import sys
from pathlib import Path
from subprocess import run

import pytest

from detent.cli import main, plain


def test_signs_that_a_terminal_lacks_are_written_with_those_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", terminal)
    with pytest.raises(SystemExit):
        main(["models", "dcb-274", "--markdown"])
    print("\N{PLUS-MINUS SIGN}40 \N{MICRO SIGN}s \N{SNOWMAN}")
    terminal.flush()
    printed = terminal.buffer.getvalue().decode("ascii")  # type: ignore[attr-defined]
    assert "| `@` |" in printed
    assert printed.endswith("+-40 us ?\n")


@pytest.mark.parametrize("line", ["motor", "motor qsh4218-41-10-035", "models dcb-274", "run no\udcff.toml", "--help"])
def test_the_c_locale_lacks_signs_too_and_keeps_bytes_that_are_none(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """There Python writes bytes of a file name as they were, and failed at a degree sign."""
    terminal = io.TextIOWrapper(io.BytesIO(), encoding="ascii", errors="surrogateescape")
    monkeypatch.setattr(sys, "stdout", terminal)
    with pytest.raises(SystemExit) as ended:
        main(line.split(" "))
    assert (ended.value.code or 0) == (2 if line.startswith("run") else 0)
    print("\N{PLUS-MINUS SIGN}\udcff\N{SNOWMAN}")
    terminal.flush()
    assert terminal.buffer.getvalue().endswith(b"+-\xff?\n")  # type: ignore[attr-defined]


def test_every_sign_is_spelt_with_signs_that_all_terminals_have() -> None:
    assert all(spelt.isascii() for spelt in plain.SIGNS.values())


@pytest.mark.parametrize("closed", ["stdin", "stdout", "stderr"])
@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("--help", 0), ("--version", 0), ("run --help", 0), ("models", 0), ("motor", 0), ("wiring", 0),
        ("models no-such", 2), ("models --no-such", 2), ("terminal gs-c200", 0),
        ("run gs-c200 --send F", 0), ("run gs-c200 --send T5000", 1),
    ],
)  # fmt: skip
def test_a_standard_stream_that_is_closed_leads_to_nowhere(
    line: str, status: int, closed: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    monkeypatch.setattr(sys, closed, None)
    with pytest.raises(SystemExit) as ended:
        main(line.split())
    assert (ended.value.code or 0) == status
    printed = capsys.readouterr()
    if closed == "stderr":  # what is wrong is not said among the answers
        assert "detent: " not in printed.out


@pytest.mark.skipif(sys.platform == "win32", reason="there a shell cannot close a stream")
def test_no_file_that_is_written_takes_the_place_of_a_closed_stream(tmp_path: Path) -> None:
    words = '"$0" -m detent run gs-c200 --send +10 --vcd pulses.vcd'
    closed = run(["sh", "-c", f"{words} <&- >&- 2>&-", sys.executable], cwd=tmp_path, check=False)
    assert closed.returncode == 0
    written = (tmp_path / "pulses.vcd").read_bytes()
    done = run(["sh", "-c", f"{words} --overwrite", sys.executable], cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 0
    assert written == (tmp_path / "pulses.vcd").read_bytes()


class Full(io.StringIO):
    """A file on a disk that is full."""

    encoding = "utf-8"

    def write(self, text: str) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("line", ["--help", "run --help", "models", "models --json", "size"])
def test_an_output_on_a_full_disk_is_told_in_a_line(
    line: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdout", Full())
    with pytest.raises(SystemExit) as ended:
        main(line.split())
    assert ended.value.code == 1
    assert capsys.readouterr().err == "detent: No space left on device\n"


class Unread(io.StringIO):
    """A pipe to `head` that has seen enough."""

    encoding = "utf-8"

    def __init__(self, descriptor: int) -> None:
        super().__init__()
        self._descriptor = descriptor

    def fileno(self) -> int:
        return self._descriptor

    def write(self, text: str) -> int:
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")


MOTOR = "--motor qsh4218-41-10-035 --moves 5 --variants 1"


@pytest.mark.parametrize(
    "line",
    [
        "--help", "asm --help", "models", "models --json", "examples", "demo menu --json", "run gs-c200",
        "run gs-c200 --json",
        "asm gs-c200 p.gsc", "list gs-c200 p.gsc", "list gs-c200 p.gsc --json", "disasm gs-c200 p.img", "motor",
        "motor qsh4218-41-10-035 --move 20", "motor qsh4218-41-10-035 --json", "table", "table --json", "size",
        "size dcb-274",
        "wiring", "service served.toml --user me", f"compare-moves gs-c200 S=48 S=50 {MOTOR}",
        pytest.param(f"tune gs-c200 {MOTOR}", marks=pytest.mark.slow),
        "terminal gs-c200",
    ],
)  # fmt: skip
def test_who_has_read_enough_of_an_output_is_told_nothing(
    line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "p.gsc").write_text("+100\n")
    (tmp_path / "p.img").write_bytes(bytes([0x44, 1]))
    (tmp_path / "served.toml").write_text(
        '[units.a]\nmodel = "gs-c200"\n[lines.a]\nunits = ["a"]\nendpoint = "serial:/dev/serial/by-id/usb-a"\n'
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO("F\n"))
    with open("output", "wb") as output:
        monkeypatch.setattr(sys, "stdout", Unread(output.fileno()))
        with pytest.raises(SystemExit) as ended:
            main(line.split())
    assert (ended.value.code, capsys.readouterr().err) == (1, "")


@pytest.mark.parametrize("columns", ["0", "00", ""])
@pytest.mark.parametrize("line", ["--help", "run --help"])
def test_a_terminal_that_is_said_to_have_no_columns_has_as_many_as_usual(
    line: str, columns: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def told() -> str:
        with pytest.raises(SystemExit):
            main(line.split())
        return capsys.readouterr().out

    monkeypatch.delenv("COLUMNS", raising=False)
    usual = told()
    monkeypatch.setenv("COLUMNS", columns)
    plain.find_columns()  # not what comes behind it, which took all of the memory
    assert "COLUMNS" not in os.environ
    assert told() == usual
