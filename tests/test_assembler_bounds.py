"""Work and report of the assembler grow no faster than the source, whatever stands in it, in every language."""

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

import pytest

from detent.assembler import (
    LONGEST_LABEL,
    LONGEST_LINE,
    LONGEST_SOURCE,
    MOST_ERRORS,
    AssemblyFailed,
    Language,
    assemble,
    disassemble,
)
from detent.controllers import catalogue

LANGUAGES = {name: model.language() for name, model in catalogue.MODELS.items() if model.language is not None}
JUMPS = {"gs-c200": "j", "gs-c200s": "j", "dcb-274": "G"}
WAITS = {"gs-c200": "+1", "gs-c200s": "+1", "dcb-274": "W 1"}

SOURCES: dict[str, Callable[[str, int], str]] = {
    "a label again and again on a line": lambda model, n: "x:" * n,
    "the same on lines of its own": lambda model, n: "x:\n" * n,
    "other labels": lambda model, n: "".join(f"x{i}:\n" for i in range(n)),
    "other labels, and an instruction each": lambda model, n: "".join(f"x{i}: {WAITS[model]}\n" for i in range(n)),
    "labels with a place behind each": lambda model, n: "".join(f"x{i}:\nP 0\n" for i in range(n)),
    "jumps to no label": lambda model, n: f"x: {JUMPS[model]} nowhere\n" + f"{JUMPS[model]} somewhere\n" * n,
    "labels and jumps to similar ones": lambda model, n: "".join(
        f"label{'s' * 30}{i}: {JUMPS[model]} labels{'s' * 30}{i}\n" for i in range(n)
    ),
    "jumps to labels that are there": lambda model, n: "".join(f"x{i}: {JUMPS[model]} x{i // 2}\n" for i in range(n)),
    "no commands": lambda model, n: "nonsense\n" * n,
    "no commands, on one line": lambda model, n: "nonsense " * n,
    "words behind a jump": lambda model, n: f"{JUMPS[model]} " + "a " * n,
    "commas behind a jump": lambda model, n: f"{JUMPS[model]} " + "a," * n,
    "figures": lambda model, n: "9" * n,
    "colons": lambda model, n: ":" * n,
    "blanks": lambda model, n: " " * n,
    "empty lines": lambda model, n: "\r\n" * n,
    "the end of a DOS file": lambda model, n: "\x1a" * n + "x",
    "comments": lambda model, n: ";" * n,
    "places": lambda model, n: "".join(f"P {i}\n" for i in range(n)),
    "ends": lambda model, n: "P\n" * n,
    "control characters": lambda model, n: "\0\x07\x1b" * n,
}


def lines_executed(function: Callable[[], object]) -> int:
    """How many lines of Python `function` executes: its work, whatever else the computer has to do."""
    count = 0

    def within(frame: FrameType, event: str, argument: Any) -> Any:
        nonlocal count
        count += 1
        return within

    before = sys.gettrace()
    sys.settrace(within)
    try:
        function()
    finally:
        sys.settrace(before)
    return count


def report(language: Language[Any], source: str) -> str:
    try:
        assemble(language, source)
    except AssemblyFailed as failed:
        return str(failed)
    return ""


@pytest.mark.parametrize("kind", SOURCES)
@pytest.mark.parametrize("model", LANGUAGES)
def test_twice_the_source_is_at_most_twice_the_work(model: str, kind: str) -> None:
    language, made = LANGUAGES[model], SOURCES[kind]
    told = report(language, made(model, 1000))
    assert len(told) <= MOST_ERRORS * 1200
    once, twice = (lines_executed(lambda n=n: report(language, made(model, n))) for n in (1000, 2000))
    assert twice <= 2.2 * once + 2000


@pytest.mark.parametrize("kind", SOURCES)
@pytest.mark.parametrize("model", LANGUAGES)
def test_the_longest_source_of_a_kind_has_a_short_report(model: str, kind: str) -> None:
    source = SOURCES[kind](model, LONGEST_SOURCE // 12)
    assert len(report(LANGUAGES[model], source)) <= MOST_ERRORS * 1200


def test_what_is_too_long_for_a_source_is_refused_unread() -> None:
    language = LANGUAGES["dcb-274"]
    told = report(language, "W 1\n" * LONGEST_SOURCE)
    assert told.startswith(f"program:1:1: {4 * LONGEST_SOURCE} characters are too many: at most {LONGEST_SOURCE}")
    assert report(language, ";" * LONGEST_SOURCE) == ""


def test_a_line_and_a_label_have_a_bound_and_a_comment_counts_for_neither() -> None:
    language = LANGUAGES["dcb-274"]
    assert "is too long: at most 1000" in report(language, "W 1" + " " * LONGEST_LINE + "2")
    assert report(language, "W 1 ;" + "x" * 10 * LONGEST_LINE) == ""
    assert report(language, f"{'x' * LONGEST_LABEL}: W 1") == ""
    assert "is too long; at most 80" in report(language, f"{'x' * (LONGEST_LABEL + 1)}: W 1")


def test_of_very_many_errors_the_first_hundred_are_told_and_that_there_may_be_more() -> None:
    with pytest.raises(AssemblyFailed) as raised:
        assemble(LANGUAGES["gs-c200"], "nonsense\n" * 500)
    assert [error.line for error in raised.value.errors] == list(range(1, MOST_ERRORS + 1))
    assert str(raised.value).endswith("these are 100 errors; mend them, then the rest is looked at")


def test_the_caret_of_a_report_stands_under_its_column_far_to_the_right() -> None:
    with pytest.raises(AssemblyFailed) as raised:
        assemble(LANGUAGES["gs-c200"], "a:" * 450 + "nonsense")
    last = str(raised.value).splitlines()[-4:-1]  # of the hundredth error
    error = raised.value.errors[-1]
    _, source, caret = last
    assert source[caret.index("^")] == "a"
    assert error.column == 201


@pytest.mark.parametrize("model", LANGUAGES)
def test_an_image_is_read_back_in_work_that_grows_with_it(model: str) -> None:
    language = LANGUAGES[model]
    code = assemble(language, WAITS[model]).image
    room = len(language.areas[0]) // len(code) // 2
    once, twice = (lines_executed(lambda n=n: disassemble(language, code * n)) for n in (room, 2 * room))
    assert twice <= 2.2 * once + 500
