"""A cell that drives pins, in a real browser: live panels, a look back, STOP on every page, recovery."""

from collections.abc import Callable
from typing import Any

import pytest
from tests.workbench.browser.test_access import findings, needs_axe
from tests.workbench.browser.windows import PHONE, WIDE, Served, Window, Windows

CELL = """
title = "A slide on real pins"
[units.x]
model = "gs-c200"
straps = { CHS = "low" }
[boards.b]
serial = "fake:rp2040"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
enable = "!gpio4"
inputs = { EOT = "^gpio10", HOME = "^gpio11" }
outputs = { UO1 = "gpio6" }
"""
PAGES = ("/", "/program", "/terminal", "/scope", "/motion")
STOP = "STOP"


@pytest.fixture
def driven(chromium: Any, serve: Callable[..., Served], tmp_path_factory: pytest.TempPathFactory) -> Served:
    place = tmp_path_factory.getbasetemp() / "driven-cell.toml"
    place.write_text(CELL)
    return serve(str(place), "--real", "--tcp", "127.0.0.1:0")


def opened(windows: Windows, served: Served, size: tuple[int, int] = WIDE) -> Window:
    window = windows.new(served, size=size, theme="light").open()
    if window.get("real") == "fault":
        window.call("recover")
    window.until("() => detent.get('real') === 'driven'")
    return window


def test_stop_stands_on_every_page_and_recover_goes_on(windows: Windows, driven: Served) -> None:
    window = opened(windows, driven)
    for path in PAGES:
        window.open(path)
        window.page.get_by_role("button", name=STOP, exact=True).wait_for()
    window.open("/")
    window.page.get_by_role("region", name="Unit x").wait_for()
    assert not window.page.get_by_text("Break it").is_visible(), "every fault is refused there"
    window.call("type", "x", "A1")
    window.call("type", "x", "+30000")
    window.until("() => detent.get('u.x.x..rate') > 0")
    window.picture("driven-wide-light")
    window.page.get_by_role("button", name=STOP, exact=True).click()
    window.until("() => detent.get('real') === 'fault'")
    window.page.get_by_text("x: emergency stop; at rest on their pins, whatever is shown: x.UO1").wait_for()
    window.until("() => detent.get('u.x.x..rate') === 0")
    window.picture("driven-stopped-wide-light")
    window.page.get_by_role("button", name="Recover").click()
    window.until("() => detent.get('real') === 'driven'")
    window.until("() => detent.get('marks').some(([at, kind, unit, text]) => text.includes('goes on at'))")


def test_the_debugger_offers_what_a_machine_can_do(windows: Windows, driven: Served) -> None:
    window = opened(windows, driven).open("/program")
    window.page.locator(".program[data-checked]").wait_for()
    keys = window.page.get_by_label("Program", exact=True)
    assert keys.get_by_role("button", name="Back", exact=True).is_visible(), "one may look back"
    for refused in ("Step", "To cursor", "Break", "On errors"):
        assert not keys.get_by_text(refused, exact=True).is_visible(), refused
    window.picture("driven-program")


def test_one_looks_back_and_the_machine_goes_on(windows: Windows, driven: Served) -> None:
    window = opened(windows, driven)
    window.until("() => detent.get('end') > 5e8")
    before = window.get("end")
    window.call("rewind", before // 2)
    window.until("() => detent.get('past')")
    for name, arguments in (("type", ["x", "+10"]), ("restart", []), ("pace", [2])):
        error = window.page.evaluate(
            "([name, args]) => detent.call(name, ...args).then(() => '', (error) => String(error.message ?? error))",
            [name, arguments],
        )
        assert "looking back" in error or "real pins are driven" in error
    window.call("go")
    window.until("(before) => !detent.get('past') && detent.get('end') > before", before)


def test_it_fits_a_phone(windows: Windows, driven: Served) -> None:
    window = opened(windows, driven, PHONE)
    window.page.get_by_role("button", name=STOP, exact=True).wait_for()
    assert window.page.evaluate("document.documentElement.scrollWidth") <= PHONE[0]
    window.picture("driven-phone-light")
    window.call("type", "x", "A1")
    window.page.get_by_role("button", name=STOP, exact=True).click()
    window.page.get_by_text("whatever is shown: x.UO1").wait_for()
    assert window.page.evaluate("document.documentElement.scrollWidth") <= PHONE[0]
    window.picture("driven-stopped-phone-light")


def test_without_real_pins_there_is_no_stop(window: Window) -> None:
    assert window.get("real") is None
    assert not window.page.get_by_role("button", name=STOP, exact=True).is_visible()


@needs_axe
@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_a_cell_on_real_pins_has_no_serious_finding_driven_or_stopped(
    windows: Windows, driven: Served, size: tuple[int, int]
) -> None:
    window = opened(windows, driven, size)
    window.page.locator(".unit").first.wait_for()
    assert findings(window) == []
    window.call("stop_motors")
    window.page.get_by_text("x: emergency stop").wait_for()
    assert findings(window) == []
    window.call("recover")
