"""The verb models: the tables of a controller, for people, as JSON and in Markdown."""

import json
import re

import pytest

from detent.cli import main
from detent.controllers.catalogue import MODELS


def detent(*tokens: str) -> int | str | None:
    with pytest.raises(SystemExit) as caught:
        main(tokens)
    return caught.value.code


def test_all_models_are_listed_with_a_line_to_go_on_with(capsys: pytest.CaptureFixture[str]) -> None:
    assert detent("models") == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in MODELS)
    assert "detent serve gs-c200" in printed


@pytest.mark.parametrize("model", MODELS)
def test_json_has_every_pin_strap_option_and_command_of_the_tables(
    model: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert detent("models", model, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    table = MODELS[model]
    assert [pin["pin"] for pin in found["pins"]] == [pin.name for pin in table.pins]
    assert [strap["strap"] for strap in found["straps"]] == list(table.straps)
    assert [option["option"] for option in found["options"]] == [option.name for option in table.options]
    assert [row["command"] for row in found["commands"]] == [row.command for row in table.commands()]


@pytest.mark.parametrize("model", MODELS)
def test_the_tables_for_people_and_in_markdown_have_them_too(model: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert detent("models", model) == 0
    shown = capsys.readouterr().out
    assert detent("models", model, "--markdown") == 0
    markdown = capsys.readouterr().out
    for pin in MODELS[model].pins:
        assert pin.name in shown
        assert f"| `{pin.name}` |" in markdown


def test_a_model_that_is_none_exits_with_2_and_says_which_was_meant(capsys: pytest.CaptureFixture[str]) -> None:
    assert detent("models", "gs-c200x") == 2
    assert "did you mean gs-c200" in capsys.readouterr().err


@pytest.mark.parametrize("model", MODELS)
def test_the_tables_can_be_read_aloud(model: str, capsys: pytest.CaptureFixture[str]) -> None:
    """No sentence breaks off, nothing is said twice, no punctuation meets another."""
    with pytest.raises(SystemExit):
        main(["models", model, "--json"])
    tables = json.loads(capsys.readouterr().out)
    for name in ("pins", "straps", "options", "commands"):
        for row in tables.get(name, []):
            for text in (str(value) for column, value in row.items() if column != "command"):
                assert not re.search(r";,|,;|,,|;;|[^.]\.\.$|  |\w \b(and|or|the|a|of|to|then|with|for)\.?$", text), (
                    text
                )
                assert not re.match(r"\d.*, -?\d+ to \d+$", text), text
                assert text.count("(") == text.count(")"), text
    for row in tables["commands"]:
        assert row["what"].endswith("."), row
