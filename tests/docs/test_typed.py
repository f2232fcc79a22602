"""What a page has a reader type and no test runs (it needs a device, or does not end) is at least understood."""

import re
import shlex
from pathlib import Path

import pytest
from cyclopts import CycloptsError

from detent.cli import application

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted(page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts)]
APP = application("*")


def typed() -> list[tuple[str, str]]:
    """Page and line of each `detent ...` in blocks of `sh`."""
    found = []
    for page in PAGES:
        for block in re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL):
            lines = block.replace("\\\n", " ").splitlines()
            found += [(str(page.relative_to(ROOT)), line) for line in lines if line.startswith("detent ")]
    return found


def test_there_is_something_to_type() -> None:
    assert len(typed()) > 30


@pytest.mark.parametrize(("page", "line"), typed())
def test_a_line_that_no_test_runs_is_understood(page: str, line: str) -> None:
    words = [word for word in shlex.split(line, comments=True)[1:] if word != "..."]
    words = words[: min((words.index(end) for end in (">", "|", "&") if end in words), default=len(words))]
    try:
        APP.parse_args(words, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        pytest.fail(f"{page}: {line}: {error}")
