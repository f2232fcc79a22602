"""The quick help is, character for character, what cyclopts prints for the same command."""

import io

import pytest
from rich.console import Console

from detent.cli import COMPLETION, TITLE, VERBS, application, overview


@pytest.mark.parametrize("columns", [72, 80, 99, 100, 133, 200])
@pytest.mark.parametrize("colour", [False, True])
def test_it_is_what_cyclopts_prints(columns: int, colour: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR", "COLUMNS", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)
    printed = io.StringIO()
    system = "truecolor" if colour else None
    console = Console(file=printed, width=columns, force_terminal=colour, color_system=system, legacy_windows=False)
    application()(["--help"], console=console, exit_on_error=False, result_action="return_zero")
    verbs = [(name, line) for name, (_, line) in VERBS.items()]
    quick = overview.text(TITLE, verbs, COMPLETION, columns, colour=colour)
    assert [line.rstrip() for line in quick.splitlines()] == [line.rstrip() for line in printed.getvalue().splitlines()]


@pytest.mark.parametrize("tokens", [["run", "--help"], ["--version"], ["--install-completion"], ["hlep"]])
def test_everything_else_is_for_cyclopts(tokens: list[str]) -> None:
    assert not overview.is_asked_for(tokens)


def test_what_it_does_not_know_is_for_cyclopts(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(io.BytesIO(), encoding="utf-8"))
    assert overview.is_asked_for(["--help"])
    monkeypatch.setenv("COLUMNS", "40")
    assert not overview.is_asked_for(["--help"])
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("NO_COLOR", "1")
    assert not overview.is_asked_for(["--help"])
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    assert not overview.is_asked_for(["--help"])
