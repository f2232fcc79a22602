"""What the pages say is run: the Python and console blocks of README.md and docs/**/*.md.

The blocks of one page are one session, in a folder of its own that holds a copy of `examples/`. A console block
has `$ ` before each command and below it what the command prints; `...` there stands for anything. A fence behind
`<!-- file: NAME -->` is written to that file first. What is not to be run has another language, like `sh`.
"""

import contextlib
import doctest
import gc
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any
from unittest import SkipTest

import pytest
from hypothesis import settings as hypothesis_settings
from sybil import Document, Example, Region, Sybil
from sybil.parsers.markdown import CodeBlockParser, PythonCodeBlockParser

import detent.cli

ROOT = Path(__file__).parent
PLAIN = re.compile(r"[^|&;<>$`*?~]+")  # a command that needs no shell
FILE = re.compile(r"<!-- file: (?P<name>\S+) -->\n+```\w*\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
BIN = Path(sys.executable).parent

# Generated cases are the same in every run: a test passes every time, or fails every time. `make test` tries a sixth.
hypothesis_settings.register_profile("all", derandomize=True, deadline=None, max_examples=100)
hypothesis_settings.register_profile("sixth", derandomize=True, deadline=None, max_examples=17)


def pytest_configure(config: pytest.Config) -> None:
    """How many cases are generated; a test whose settings have a number of their own asks `tests.generated`."""
    hypothesis_settings.load_profile("sixth" if config.getoption("markexpr") == "not slow" else "all")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Those that mostly wait (`waits`) begin first, so that others compute meanwhile and no worker ends long behind.

    Tests that share a fixture of their file run in one process under `pytest --dist loadgroup`: it is made once.

    A group is the end of a name, behind `@`: the file, or what a mark says (what xdist writes there for one, pytest 9
    does not read).
    """
    if not config.getoption("loadgroup", False):  # set in a worker only
        return
    items.sort(key=lambda item: item.get_closest_marker("waits") is None)
    for item in items:
        shared = getattr(item, "_fixtureinfo", None)
        fixtures = [found for all_ in shared.name2fixturedefs.values() for found in all_] if shared else []
        if any(one.scope in ("class", "module", "package") and one.baseid for one in fixtures):
            mark = item.get_closest_marker("xdist_group")
            named = f"{item.nodeid}@{mark.args[0] if mark else item.path.relative_to(ROOT)}"
            item._nodeid = named  # noqa: SLF001
            if hasattr(item, "_id"):  # pytest 9
                item._id = type(item._id).parse(named)  # noqa: SLF001


def pytest_collection_finish() -> None:
    """What stands now stays to the end: it is not looked through for garbage again and again while tests run.

    Ten thousand tests and what they import made that a seventh of the time of those that copy cells.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)


def python(document: Document) -> Iterable[Region]:
    """The Python blocks of a page, to be run in its folder."""
    for region in PythonCodeBlockParser()(document):
        region.evaluator = _in_folder(region.evaluator)
        yield region


def _in_folder(evaluate: Callable[[Example], Any]) -> Callable[[Example], Any]:
    def evaluated(example: Example) -> Any:
        with contextlib.chdir(example.namespace["page_folder"]):
            return evaluate(example)

    return evaluated


def console(example: Example) -> None:
    """Run the commands of one console block and compare what they print."""
    status = 0
    commands = list(_commands(example.parsed))
    for index, (command, expected) in enumerate(commands):
        if command == "echo $?":
            printed = f"{status}\n"
        else:
            status, printed = _run(command)
            told = index + 1 < len(commands) and commands[index + 1][0] == "echo $?"
            assert told or status == 0, f"$ {command}\nended with status {status} and printed\n{printed}"
        assert _alike(expected, printed), f"$ {command}\nprinted\n{printed}\nand not\n{expected}"


def _commands(block: str) -> Iterator[tuple[str, str]]:
    """Each command with what the page has below it."""
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        command, _, expected = part.replace("\\\n", "").partition("\n")
        yield command, expected


def _run(command: str) -> tuple[int, str]:
    """The status of a command and what it prints on both outputs."""
    words = shlex.split(command) if PLAIN.fullmatch(command) else []
    if words[:1] == ["detent"]:  # in this process, as a process of its own takes a second
        return _detent(words[1:])
    program = command.split()[0]
    if shutil.which(program) is None:
        raise SkipTest(f"{program} is not installed")
    done = subprocess.run(
        ["bash", "-c", command], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, timeout=300, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


def _detent(words: list[str]) -> tuple[int, str]:
    printed = io.StringIO()
    status: Any = 0
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        try:
            detent.cli.main(words)
        except SystemExit as end:
            status = end.code
    return int(status or 0), printed.getvalue()


def _alike(expected: str, printed: str) -> bool:
    wanted, got = ("\n".join(line.rstrip() for line in text.strip().splitlines()) for text in (expected, printed))
    return doctest.OutputChecker().check_output(wanted + "\n", got + "\n", doctest.ELLIPSIS)


def files(document: Document) -> Iterable[Region]:
    """The files that a page shows."""
    for match in FILE.finditer(document.text):
        end = match.start("name")  # ends before the fence, whose block may have a reader of its own
        yield Region(match.start(), end, (match["name"], match["text"]), _in_folder(_write))


def _write(example: Example) -> None:
    name, text = example.parsed
    Path(name).write_text(text)


def _setup(namespace: dict[str, Any]) -> None:
    folder = Path(tempfile.mkdtemp(prefix="detent-docs-"))
    shutil.copytree(ROOT / "examples", folder / "examples")
    environment = pytest.MonkeyPatch()
    environment.setenv("COLUMNS", "80")
    environment.setenv("PATH", str(BIN), prepend=os.pathsep)
    environment.setenv("XDG_STATE_HOME", str(folder / "state"))
    namespace.update(page_folder=folder, page_environment=environment)


def _teardown(namespace: dict[str, Any]) -> None:
    namespace["page_environment"].undo()
    shutil.rmtree(namespace["page_folder"])


class Pages(Sybil):
    """Sybil with names by which `pytest --dist loadgroup` keeps the blocks of one page in one process."""

    def identify(self, example: Example) -> str:
        """The line of the block, and its page as the group."""
        return f"line:{example.line}@{Path(example.path).relative_to(ROOT)}"


pytest_collect_file = Pages(
    parsers=[python, CodeBlockParser("console", _in_folder(console)), files],
    patterns=["README.md", "docs/**/*.md", "docs/*.md"],
    path=str(ROOT),
    setup=_setup,
    teardown=_teardown,
).pytest()
