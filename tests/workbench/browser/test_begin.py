"""The page Begin in a real browser."""

from collections.abc import Callable

import pytest
from tests.workbench.browser.windows import LOOKS, Served, Windows


@pytest.fixture
def bench(chromium: object, serve: Callable[..., Served]) -> Served:
    """A workbench of its own: it opens other cells."""
    return serve("bs0710")


def test_a_new_cell_is_drawn_saved_and_opened(windows: Windows, bench: Served) -> None:
    for size, theme in LOOKS:
        window = windows.new(bench, size=size, theme=theme).open("/begin")
        page = window.page
        page.locator("[data-role=unit-model] option").first.wait_for(state="attached")
        for name in ("bar", "drill"):
            page.get_by_role("textbox", name="Name of the unit").fill(name)
            window.click("Add a unit")
        window.click("Output bar.UO2")
        window.click("Input drill.UI2")
        window.until("() => document.querySelector('[data-role=text]').textContent.includes('to = \"drill.UI2\"')")
        page.get_by_role("searchbox", name="Search the commands").fill("home")
        page.locator("[data-role=commands] tr").first.wait_for()
        window.picture(f"begin-{size[0]}-{theme}")
        if size[0] < 500:
            page.evaluate("document.querySelector('.begin .new').scrollIntoView()")
            window.picture(f"begin-{size[0]}-{theme}-b")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.get_by_role("textbox", name="File of the new cell").fill("two")
    window.click("Save and open")
    page.get_by_role("region", name="Unit drill").wait_for()
    assert (bench.folder / "two.toml").is_file()
    assert page.get_by_role("region", name="Unit").count() == 2
