"""The page Unit in a real browser: a DCB-274 that is served elsewhere is the real one, its emulation stands beside."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest
from tests.workbench.browser.windows import LOOKS, Served, Windows

SERVE = [sys.executable, "-c", "from detent.cli import main; main()", "serve", "dcb-274", "--tcp", "127.0.0.1:0"]
KNOWN = "() => { const it = detent.get('r.names'); return it.length && detent.get(`r.${it[0]}`).position !== null; }"


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a unit."""
    state = str(tmp_path_factory.mktemp("real"))
    with subprocess.Popen([*SERVE, "--json", "--state", state], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        yield json.loads(process.stdout.readline())["endpoints"][0]["address"]
        process.terminate()


@pytest.fixture
def bench(chromium: object, serve: Callable[..., Served], real: str) -> Served:
    return serve("dcb-274", real)


def test_look(windows: Windows, bench: Served, real: str) -> None:
    for size, theme in LOOKS:
        window = windows.new(bench, size=size, theme=theme).open("/unit")
        window.until(KNOWN)
        window.page.get_by_role("textbox", name="Line to send").fill("X")
        window.page.get_by_role("textbox", name="Line to send").press("Enter")
        window.page.locator(".answers td").first.wait_for()
        window.page.get_by_role("button", name="Jog plus by steps").click()
        window.until("() => document.querySelector('[data-role=sent]').textContent")
        window.picture(f"unit-{size[0]}-{theme}")
        if size[0] < 500:
            window.page.evaluate("document.querySelector('.bench .talk').scrollIntoView()")
            window.picture(f"unit-{size[0]}-{theme}-b")
        window.page.evaluate("scrollTo(0, 0)")
        window.page.get_by_role("tab", name="Connect…").click()
        window.page.locator("[data-role=cell] button").first.wait_for()
        window.picture(f"unit-connect-{size[0]}-{theme}")
