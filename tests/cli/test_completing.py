"""Completion of a shell: what it knows beyond the options, and what it changes."""

import shutil
import subprocess
from pathlib import Path

import pytest

from detent.cli import application, main
from detent.cli.completing import KNOWN, with_choices
from detent.controllers.catalogue import MODELS

SHELLS = ("bash", "zsh", "fish")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the completion of each shell, `script.SHELL`, and the home of who made it."""
    folder = tmp_path_factory.mktemp("completion")
    home = folder / "home"
    home.mkdir()
    (home / ".bashrc").write_text("mine\n")
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("HOME", str(home))
        for shell in SHELLS:
            with pytest.raises(SystemExit) as ended:
                main(["--install-completion", "--shell", shell, "--output", str(folder / f"script.{shell}")])
            assert not ended.value.code
    return folder


def test_models_motors_straps_options_verbs_and_examples_are_completed(place: Path) -> None:
    home = place / "home"
    for shell in SHELLS:
        text = (place / f"script.{shell}").read_text()
        for word in ("gs-c200s", "dcb-274", "qsh4218-41-10-035", "CHS=", "closed-loop-motor", "gs-c200-slew"):
            assert word in text, (shell, word)
        assert "no-checksum" in text
    assert "fault" in (place / "script.fish").read_text()
    assert (home / ".bashrc").read_text() == "mine\n"
    assert [path.name for path in home.iterdir()] == [".bashrc"]


def test_straps_and_options_are_those_of_the_model_that_was_typed(place: Path) -> None:
    expected: dict[tuple[str, ...], list[str]] = {("serve", "gs-c200", "--strap", "CH"): ["CHS="]}
    for verb in ("serve", "run", "workbench", "epics"):
        for name, model in MODELS.items():
            expected[verb, name, "--strap", ""] = [f"{strap}=" for strap in model.straps]
            expected[verb, name, "--set", ""] = [f"{option.name}=" for option in model.options]
    anything, motor = ("run", "cell.toml", "--strap", ""), ("tune", "gs-c200", "--motor", "qsh")
    asked = [*expected, anything, motor]
    lines = [f"source {place / 'script.bash'}"]
    for words in asked:  # each in a shell of its own
        typed = " ".join(f"'{word}'" for word in words)
        lines.append(f"(COMP_WORDS=(detent {typed}); COMP_CWORD={len(words)}; _detent; echo ${{COMPREPLY[@]}})")
    done = subprocess.run(["bash", "-c", "\n".join(lines)], capture_output=True, text=True, check=True)
    found = dict(zip(asked, (line.split() for line in done.stdout.splitlines()), strict=True))
    assert {words: found[words] for words in expected} == expected
    assert set(found[anything]) == {f"{strap}=" for model in MODELS.values() for strap in model.straps}
    assert "qsh4218-41-10-035" in found[motor]


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_the_functions_of_the_other_shells_know_the_model(shell: str, place: Path) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    script = place / f"script.{shell}"
    assert "@" not in [line for line in script.read_text().splitlines() if "_detent_strap" in line][-1]
    line = {
        "zsh": f"compdef() {{ }}; _arguments() {{ }}; . {script} 2>&-; print -l $(_detent_strap detent run dcb-274)",
        "fish": f"source {script}; complete -C 'detent run dcb-274 --strap '",
    }[shell]
    done = subprocess.run([shell, "-c", line], capture_output=True, text=True, check=True)
    assert sorted(word.split()[0] for word in done.stdout.splitlines()) == ["B1=", "B2=", "PARTY=", "PLC="]


OPTIONS = {"gs-c200": {"--address", "--no-checksum", "--revision"}, "supersigma": {"--drive"}, "bs0610": {"--motor"},
           "dcb-274": {"--name", "--mode", "--first"}}  # fmt: skip


@pytest.mark.parametrize("shell", SHELLS)
def test_options_of_a_unit_are_those_of_the_model_that_was_typed(shell: str, place: Path) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    script = place / f"script.{shell}"
    every = {flag for flags in OPTIONS.values() for flag in flags}
    for typed, expected in {**OPTIONS, "": every}.items():
        line = {
            "bash": f"source {script}; COMP_WORDS=(detent send {typed} --); COMP_CWORD={3 if typed else 2}; _detent; "
            "printf '%s\n' \"${COMPREPLY[@]}\"",
            "zsh": "_arguments() { [[ $1 == -C ]] && { state=args; return }; print -l -- ${${@#\\*}%%[\\[:]*} }; "
            f"words=(send {typed}); . {script}",  # which calls its own function, as at the first Tab
            "fish": f"source {script}; complete -C 'detent send {typed} --'",
        }[shell]
        done = subprocess.run([shell, "-c", line], capture_output=True, text=True, check=False)
        found = {word.split()[0] for word in done.stdout.splitlines() if word.strip()}
        assert found & every == expected, (typed, done.stderr)
        assert {"--baud", "--patience", "--raw"} <= found
    assert "--motor" in script.read_text()


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
