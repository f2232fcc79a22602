"""Outputs on a terminal without our signs."""

import io
import sys

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


def test_every_sign_is_spelt_with_signs_that_all_terminals_have() -> None:
    assert all(spelt.isascii() for spelt in plain.SIGNS.values())
