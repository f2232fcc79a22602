"""Completion of a shell: what it knows beyond the options, and what it changes."""

from pathlib import Path

import pytest

from detent.cli import application, main
from detent.cli.completing import KNOWN, with_choices


def test_models_motors_straps_options_verbs_and_examples_are_completed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    home = tmp_path / "home"
    home.mkdir()
    (home / ".bashrc").write_text("mine\n")
    monkeypatch.setenv("HOME", str(home))
    for shell in ("bash", "zsh", "fish"):
        script = tmp_path / f"script.{shell}"
        with pytest.raises(SystemExit) as ended:
            main(["--install-completion", "--shell", shell, "--output", str(script)])
        assert not ended.value.code, capsys.readouterr().err
        text = script.read_text()
        for word in ("gs-c200s", "dcb-274", "qsh4218-41-10-035", "CHS=", "closed-loop-motor", "gs-c200-slew"):
            assert word in text, (shell, word)
        assert "no-checksum" in text
    assert "fault" in (tmp_path / "script.fish").read_text()
    assert (home / ".bashrc").read_text() == "mine\n"
    assert [path.name for path in home.iterdir()] == [".bashrc"]


def test_the_choices_are_gone_again_and_each_has_its_parameter() -> None:
    from importlib import import_module

    from detent.cli import VERBS

    before = {}
    for verb, (place, _) in VERBS.items():
        module, name = place.split(":")
        before[verb] = dict(getattr(import_module(module), name).__annotations__)
    with with_choices():
        application("*")
    for verb, (place, _) in VERBS.items():
        module, name = place.split(":")
        assert getattr(import_module(module), name).__annotations__ == before[verb]
    for words in set(KNOWN.values()):
        assert any(words is known and parameter in before[verb] for (verb, parameter), known in KNOWN.items())
