"""A real browser at a real workbench: `detent workbench` as a process, Debian's Chromium driven by Playwright.

One workbench serves all tests (`workbench`); each test gets the cell begun anew and a window of its own (`window`),
which fails the test if a page asked another host for anything or raised an error. With DETENT_PICTURES set, pictures
are written to that folder.
"""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from tests.workbench.browser.windows import Served, Window, Windows, begun, served

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytest.importorskip("nicegui", reason="nicegui is not installed")

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The files by turns in one of two workers: those of one share its workbench, and no worker ends long behind."""
    here = Path(__file__).parent
    own = [item for item in items if item.path.parent == here]
    files = sorted({item.path for item in own})
    for item in own:
        item.add_marker(pytest.mark.xdist_group(f"browser {files.index(item.path) % 2}"))


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """The browser. While it is open this thread counts as one with an event loop: other modules need it without."""
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def serve(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Served]]:
    """Start a workbench with arguments (a cell file, options); it serves until the tests of the file are done.

    No longer, as each of them is a cell in real time that takes its share of the processor.
    """
    with ExitStack() as stack:
        running: dict[tuple[str, ...], Served] = {}

        def start(*arguments: str) -> Served:
            if arguments not in running:
                place = tmp_path_factory.mktemp("workbench")
                running[arguments] = stack.enter_context(served(place, *arguments))
            return running[arguments]

        yield start


@pytest.fixture(scope="package")
def drilling(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """The workbench as it opens without a word: the drilling cell, running until the tests of this folder are done."""
    with served(tmp_path_factory.mktemp("workbench")) as found:
        yield found


@pytest.fixture
def workbench(chromium: Any, drilling: Served) -> Served:
    """The workbench of the drilling cell; without a browser none is started."""
    return drilling


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a DCB-274 that is served elsewhere: to the workbench it is a real one."""
    serving = [sys.executable, "-c", "from detent.cli import main; main()", "serve", "dcb-274", "--tcp", "127.0.0.1:0"]
    state = str(tmp_path_factory.mktemp("real"))
    with subprocess.Popen([*serving, "--json", "--state", state], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        yield json.loads(process.stdout.readline())["endpoints"][0]["address"]
        process.terminate()


@pytest.fixture
def bench(chromium: object, serve: Callable[..., Served], real: str) -> Served:
    """A workbench with that unit, and the same model by the book."""
    return serve("dcb-274", real, "--patience", "10")  # a loaded computer pauses between two characters


@pytest.fixture(scope="module")
def browser(chromium: Any) -> Callable[[], Windows]:
    """Windows of tests that share the profiles of the browser, and their tabs."""
    profiles: dict[object, Any] = {}
    tabs: dict[object, list[Any]] = {}
    return lambda: Windows(chromium, profiles, tabs)


@pytest.fixture(scope="module")
def resting(browser: Callable[[], Windows]) -> Iterator[None]:
    """When the tests of a file are done nothing of theirs is drawn on."""
    yield
    browser().rest()


@pytest.fixture
def windows(browser: Callable[[], Windows], resting: None) -> Iterator[Windows]:
    """Windows of this test; at its end none of them may have asked another host, or raised an error."""
    opened = browser()
    yield opened
    found = opened.close()
    assert found == [([], [])] * len(found)


@pytest.fixture
def window(windows: Windows, workbench: Served) -> Window:
    """A window at the page Cell, the cell begun anew and running in real time."""
    return begun(windows.usual(workbench))
