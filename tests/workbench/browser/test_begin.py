"""The page Begin in a real browser."""

from collections.abc import Callable

import pytest
from tests.workbench.browser.windows import LOOKS, Served, Windows

from detent.cell.description import parse


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


def test_what_a_new_cell_has_besides_its_wires_stands_in_the_file_as_a_person_would_write_it(
    windows: Windows, bench: Served
) -> None:
    window = windows.new(bench).open("/begin")
    page = window.page
    shows = "(words) => document.querySelector('[data-role=text]').textContent.includes(words)"
    page.locator("[data-role=unit-model] option").first.wait_for(state="attached")
    for name, model in (("slide", "gs-c200s"), ("board", "bs0610"), ("gone", "dcb-274")):
        page.get_by_role("textbox", name="Name of the unit").fill(name)
        page.get_by_role("combobox", name="Model of the unit").select_option(model)
        window.click("Add a unit")
    page.get_by_role("textbox", name="Name of the unit").fill("slide")
    window.click("Add a unit")
    page.get_by_text("There is a unit slide already").wait_for()
    window.click("Add a switch")
    window.click("Input slide.UI1")
    window.click("Output slide.UO1")
    window.click("Input gone.P1") if page.get_by_role("button", name="Input gone.P1").count() else None
    window.click("Take gone away")
    window.until("() => !document.querySelector('[data-role=text]').textContent.includes('gone')")
    (bench.folder / "slide.gsc").write_text("+100\n")
    for unit in ("slide", "board"):
        page.locator(".board section.panel", has=page.get_by_role("heading", name=unit)).locator("summary").click()
    page.get_by_role("combobox", name="CHS").select_option("low")
    window.until(shows, 'CHS = "low"')
    program = page.get_by_role("textbox", name="Program (a file beside the cell)")
    program.fill("nothing.gsc")
    program.press("Tab")
    page.locator("[data-role=text].bad").wait_for()  # there is no such file
    program.fill("slide.gsc")
    program.press("Tab")
    window.until(shows, 'program = "slide.gsc"')
    page.get_by_role("combobox", name="Motor Y").select_option("17hs8401")
    window.until(shows, "supply = 4.5")  # its board puts that through the winding
    lead = page.get_by_role("spinbutton", name="Lead, mm or ° a step")
    lead.fill("0.01")
    lead.press("Tab")
    window.until(shows, "lead = 0.01")
    page.get_by_role("textbox", name="File of the new cell").fill("mine")
    window.click("Save")
    page.get_by_text("Saved: mine.toml").wait_for()
    written = (bench.folder / "mine.toml").read_text()
    assert written == page.locator("[data-role=text]").inner_text(), "what is shown is what is saved"
    description = parse(written, "mine.toml")
    assert {name: unit.model for name, unit in description.units.items()} == {"slide": "gs-c200s", "board": "bs0610"}
    assert [(motor.unit, motor.axis, motor.lead) for motor in description.motors.values()] == [("board", "Y", 0.01)]
    assert [tuple(switch.drives) for switch in description.switches.values()] == [("slide.UI1",)]
    page.get_by_role("combobox", name="CHS").select_option("high")
    window.until(shows, 'CHS = "high"')
    window.click("Save")
    page.locator(".toast.error").last.wait_for()  # it is there already
    assert (bench.folder / "mine.toml").read_text() == written, "nothing is written over unasked"
    page.evaluate("document.getElementById('toasts').replaceChildren()")
    window.click("Save")
    window.until("() => document.querySelector('#toasts').textContent.includes('Saved: mine.toml')")
    assert 'CHS = "high"' in (bench.folder / "mine.toml").read_text()
    page.get_by_role("button", name="mine.toml").first.wait_for()


def test_a_cell_that_is_opened_is_shown_on_every_page_of_every_window(windows: Windows, bench: Served) -> None:
    """And the workbench is the host of no unit of the one before: another may be at that address by now."""
    window = windows.new(bench).open("/begin")
    window.call("open_place", "gs-c200")
    pages = {path: windows.new(bench).open(path) for path in ("/program", "/motion", "/scope", "/unit")}
    tabs = "(name) => document.querySelector('[role=tab][data-unit]')?.dataset.unit === name"
    shown = "(first) => document.querySelector('[data-part=scope]').scope?.shown[0] === first"
    for path in ("/program", "/motion"):
        pages[path].until(tabs, "gs-c200")
    pages["/scope"].until(shown, "gs-c200.position")
    pages["/unit"].page.locator("[data-role=cell] button").first.click()
    window.until("() => detent.get('r.names').length === 1 && detent.get('stop.able').length === 1")
    window.call("open_place", "dcb-274")
    for path in ("/program", "/motion"):
        pages[path].until(tabs, "dcb-274")
    pages["/scope"].until(shown, "dcb-274.position")
    assert pages["/scope"].page.locator(".toast.error").count() == 0
    window.until("() => !detent.get('r.names').length && !detent.get('stop.able').length")
    assert window.get("r.gs-c200 (cell)") is None
