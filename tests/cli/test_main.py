"""The command as a whole: help, exit status, what it says to a wrong call."""

import re
import shlex
import subprocess
import sys
from importlib import import_module
from inspect import getdoc, signature
from pathlib import Path

import pytest
from tests.realtime.served import address, served

from detent.cli import VERBS, application, main
from detent.realtime.endpoints.spec import EndpointSpec


def status(*tokens: str) -> int | str | None:
    with pytest.raises(SystemExit) as caught:
        main(tokens)
    return caught.value.code


@pytest.mark.parametrize("name", VERBS)
def test_the_line_that_help_shows_is_the_first_of_the_verbs_own_help(name: str) -> None:
    place, line = VERBS[name]
    module, function = place.split(":")
    doc = getdoc(getattr(import_module(module), function))
    assert doc is not None
    assert doc.splitlines()[0] == line


@pytest.mark.parametrize("name", VERBS)
def test_every_verb_has_help_and_offers_json(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert status(name, "--help") == 0
    assert "--json" in capsys.readouterr().out


@pytest.mark.parametrize("name", VERBS)
def test_every_parameter_of_a_verb_has_help(name: str) -> None:
    parameters = application(name)[name].assemble_argument_collection(parse_docstring=True)
    assert len(parameters)
    without = [each.names for each in parameters if each.names != ("*",) and not each.parameter.help]
    assert not without


@pytest.mark.parametrize("name", VERBS)
def test_the_help_of_a_verb_has_an_example_that_can_be_typed(name: str) -> None:
    place, _ = VERBS[name]
    module, function = place.split(":")
    doc = getdoc(getattr(import_module(module), function)) or ""
    examples = [shlex.split(words) for words in re.findall(r"(?:For example|Or):\s+`detent ([^`]*)`", doc)]
    assert examples
    for verb, *words in examples:
        assert verb == name
        application(verb)[verb].parse_args(words, exit_on_error=False, print_error=False)
    assert {words.split()[1] for words in re.findall(r"`(detent [^`]*)`", doc)} <= set(VERBS)


def test_a_wrong_call_exits_with_2_and_names_the_verb_that_was_meant(capsys: pytest.CaptureFixture[str]) -> None:
    assert status("modles") == 2
    assert 'Did you mean "models"?' in capsys.readouterr().err


QUICK = {
    "help": ["--help"],
    "models": ["models"],
    "run": ["run", "gs-c200", "--send", "F", "--send", "+10"],
    "run with choices": ["run", "bs0610", "--set", "baud=9600", "--send", "?"],
    "send": ["send", "gs-c200", "{port}", "F"],
}
"""Verbs that a person or a script calls again and again."""


@pytest.mark.parametrize("name", QUICK)
def test_a_quick_verb_loads_nothing_that_takes_long(name: str) -> None:
    code = (
        "import sys; from detent.cli import main\n"
        "try: main(sys.argv[1:])\n"
        "except SystemExit as end: print(end.code)\n"
        "heavy = {'numpy', 'pydantic', 'rich', 'asyncio', 'matplotlib', 'numba', 'nicegui'} & set(sys.modules)\n"
        "print('heavy:', ', '.join(sorted(heavy)))"
    )
    with served("gs-c200", endpoints=[EndpointSpec("tcp", "127.0.0.1:0")]) as gate:
        words = [word.format(port=address(gate)) for word in QUICK[name]]
        done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=False)
    assert (done.stdout.splitlines()[-1], done.stderr) == ("heavy: ", "")


@pytest.mark.parametrize("name", VERBS)
def test_help_shows_every_default_that_says_something(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    place, _ = VERBS[name]
    module, function = place.split(":")
    assert status(name, "--help") == 0
    shown = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for parameter in signature(getattr(import_module(module), function)).parameters.values():
        default = parameter.default
        if isinstance(default, bool) or not isinstance(default, (str, int, float, Path)) or default in ("", 0):
            continue
        told = f"{default:g}" if isinstance(default, float) else str(default)
        assert f"[default: {told}]" in shown, parameter.name
