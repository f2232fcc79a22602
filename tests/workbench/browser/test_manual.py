"""Manual control of the axes of the page Cell, panels of many units, the commands beside the editor."""

from collections.abc import Callable
from typing import Any

import pytest
from tests.workbench.browser.test_access import findings, needs_axe, settle
from tests.workbench.browser.windows import PHONE, Served, Window, Windows

MODELS = ("gs-c200", "gs-c200s", "dcb-274", "bs0610", "bs0710", "supersigma", "gs-c200")
PLACE = "detent.get('u.gs-c200.x..position')"


@pytest.fixture
def seven(chromium: Any, serve: Callable[..., Served], tmp_path_factory: pytest.TempPathFactory) -> Served:
    place = tmp_path_factory.getbasetemp() / "seven.toml"
    place.write_text(
        "".join(f'[units.{name}]\nmodel = "{model}"\n' for name, model in zip("abcdefg", MODELS, strict=True))
    )
    return serve(str(place))


@pytest.fixture
def alone(windows: Windows, serve: Callable[..., Served]) -> Window:
    """A GS-C200 alone, its manual control open."""
    window = windows.new(serve("gs-c200")).open()
    window.call("restart")
    window.until("() => detent.get('now') < 60e9")
    window.page.locator(".manual summary").click()
    return window


def moved(window: Window, steps: int) -> None:
    window.until(f"(steps) => {PLACE} === steps && detent.get('u.gs-c200.x..rate') === 0", steps)


def test_an_axis_is_jogged_sent_and_set_to_zero_in_the_commands_of_its_unit(alone: Window) -> None:
    alone.page.get_by_label("Distance or position of gs-c200").fill("120")
    alone.click("Jog plus of gs-c200")
    moved(alone, 120)
    alone.until("() => document.querySelector('.manual .sent').textContent.includes('120')")
    alone.page.wait_for_function("() => !document.querySelector('[data-jog]').disabled")
    alone.click("Jog minus of gs-c200")
    moved(alone, 0)
    alone.click("Go to, gs-c200")
    moved(alone, 120)
    alone.click("Set zero, gs-c200")
    moved(alone, 0)
    alone.picture("manual")


def test_a_stop_overtakes_a_jog_that_waits_for_its_first_connection(alone: Window) -> None:
    if alone.get("r.gs-c200 (cell)"):
        alone.call("unit_leave", "gs-c200 (cell)")
    place = alone.get("u.gs-c200.x..position")
    alone.page.get_by_label("Distance or position of gs-c200").fill("120")
    alone.page.evaluate("""() => {
        document.querySelector('.manual [data-jog="1"]').click();
        document.querySelector('.manual [data-role=stop]').click();
    }""")
    alone.page.get_by_text("STOP came behind it").wait_for()
    alone.page.locator(".manual .sent").get_by_text("stop").wait_for()
    alone.picture("overtaken")
    assert alone.get("u.gs-c200.x..position") == place


def test_an_axis_runs_as_long_as_a_key_is_held_and_stops_when_it_is_let_go(alone: Window) -> None:
    key = alone.page.get_by_role("button", name="Hold plus of gs-c200")
    alone.page.get_by_label("Distance or position of gs-c200").fill("1")
    alone.click("Jog plus of gs-c200")  # the first touch connects
    alone.until("() => detent.get('r.gs-c200 (cell)')?.position !== undefined")
    moved(alone, 1)
    alone.page.wait_for_function("() => !document.querySelector('[data-hold]').disabled")
    key.focus()
    alone.page.keyboard.down(" ")
    alone.until("() => detent.get('u.gs-c200.x..rate') > 0")
    alone.page.keyboard.up(" ")
    alone.until("() => detent.get('u.gs-c200.x..rate') === 0 && !detent.get('held')")


def test_seven_units_fit_a_laptop(windows: Windows, seven: Served) -> None:
    window = windows.new(seven, size=(1280, 800)).open()
    window.page.locator(".cell.compact .unit").nth(6).wait_for()
    bottom = window.page.evaluate(
        "Math.max(...[...document.querySelectorAll('.unit')].map((one) => one.getBoundingClientRect().bottom))"
    )
    assert bottom <= window.page.evaluate("document.querySelector('footer').getBoundingClientRect().top")
    window.picture("seven-wide-light")
    window.click("Compact")
    window.page.locator(".pins").first.wait_for()
    window.page.reload()
    window.page.locator(".cell:not(.compact) .unit").first.wait_for()  # as it was chosen
    window.click("Compact")


@needs_axe
@pytest.mark.parametrize("size", [(1280, 800), PHONE])
def test_manual_control_small_panels_and_a_unit_that_is_connected_have_no_serious_finding(
    windows: Windows, seven: Served, size: tuple[int, int]
) -> None:
    window = windows.new(seven, size=size, theme="light" if size == PHONE else "dark").open()
    for one in window.page.locator(".manual summary").all():
        one.click()
    settle(window)
    assert findings(window) == []
    assert window.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    window.picture(f"manual-seven-{size[0]}")
    window.call("go")
    window.open("/unit")
    window.page.locator("[data-role=cell] button").first.click()
    window.until("() => document.querySelector('[data-role=position]').textContent.match(/\\d/)")
    settle(window)
    assert findings(window) == []
    window.picture(f"unit-connected-{size[0]}")
    window.call("unit_leave", window.get("r.names")[0])
    window.call("go")


def test_the_commands_of_the_unit_are_searched_beside_its_program(window: Window) -> None:
    window.page.get_by_role("link", name="Program", exact=True).click()
    window.page.locator(".program[data-checked]").wait_for()
    window.page.locator(".program-commands summary").click()
    window.page.get_by_label("Search the commands").fill("wait input")
    rows = window.page.locator(".program-commands tr")
    assert rows.count() == 1
    assert "Wait until an input is one." in rows.inner_text()
