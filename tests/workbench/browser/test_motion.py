"""The Motion page in a real browser."""

from pathlib import Path
from typing import Any

import pytest
from tests.workbench.browser.windows import LOOKS, Served, Window, Windows, begun

CLOSED_LOOP = str(Path(__file__).parents[3] / "examples" / "closed-loop-motor" / "cell.toml")  # a motor is fitted


def at_motion(window: Window) -> Window:
    window.page.get_by_role("link", name="Motion").click()
    window.page.locator(".motion[data-drawn]").wait_for()
    return window


@pytest.fixture
def motion(window: Window) -> Window:
    return at_motion(window)


def fact(window: Window, name: str) -> str:
    return str(window.page.locator(f"[data-fact={name}]").inner_text())


def set_exactly(window: Window, name: str, number: int) -> None:
    """Write a number beside a slider and wait for the picture of it."""
    before = window.page.locator(".motion").get_attribute("data-drawn")
    window.page.locator(f'[data-exact="{name}"]').fill(str(number))
    window.until("(before) => document.querySelector('.motion').dataset.drawn !== before", before)


def commands(window: Window) -> list[str]:
    return [str(text) for text in window.page.locator(".motion-lines span").all_inner_texts()]


def test_numbers_change_with_the_settings_and_are_those_of_the_ramp(motion: Window) -> None:
    """Datasheet, example 2: S10 T100 R40. 40 steps at a mean of 550 steps/s, then slew at 1000, then down."""
    for name, number in (("S", 100), ("T", 1000), ("R", 40), ("steps", 500)):
        set_exactly(motion, name, number)
    assert fact(motion, "duration") == "565.455 ms"
    assert fact(motion, "peak") == "1000 steps/s"
    assert fact(motion, "up") == "72.7273 ms"
    assert commands(motion) == ["S10", "T100", "R40", "+500"]
    set_exactly(motion, "steps", 30)
    assert "short" in (motion.page.locator("[data-fact=peak]").get_attribute("class") or "")  # never at 1000
    motion.picture("motion-short")


def test_a_slider_that_is_moved_moves_the_picture(motion: Window) -> None:
    slider = motion.page.locator('input[data-setting="T"]')
    before, drawn = fact(motion, "peak"), motion.page.locator(".motion").get_attribute("data-drawn")
    slider.focus()
    slider.press("ArrowRight")
    motion.until("(drawn) => document.querySelector('.motion').dataset.drawn !== drawn", drawn)
    assert fact(motion, "peak") != before


def test_the_settings_are_sent_and_the_move_is_made(motion: Window) -> None:
    motion.call("power", "bar", False)
    motion.call("power", "bar", True)
    for name, number in (("S", 200), ("T", 2000), ("R", 50), ("steps", 321)):
        set_exactly(motion, name, number)
    motion.page.locator("[data-key=move]").click()
    motion.until("() => detent.get('u.bar.x..position') === 321 && detent.get('u.bar.state') === 'ready'")
    assert motion.get("u.bar.reg") | {"S": "20", "T": "200", "R": "50"} == motion.get("u.bar.reg")
    set_exactly(motion, "S", 100)
    motion.page.locator("[data-key=now]").click()
    motion.until("() => document.querySelector('[data-exact=S]').value === '200'")


def test_a_motor_is_judged_as_the_move_changes(motion: Window) -> None:
    for name, number in (("S", 100), ("T", 1500), ("R", 80), ("steps", 400)):
        set_exactly(motion, name, number)
    motion.page.locator("select[name=motor]").select_option("qsh4218-41-10-035")
    verdict = motion.page.locator(".motion-verdict")
    motion.until("() => document.querySelector('.motion-verdict').dataset.kind === 'good'")
    assert "by none of" in verdict.inner_text()
    motion.picture("motion-motor")
    motion.page.locator("input[name=friction]").fill("0.1")
    for name, number in (("T", 9000), ("R", 3)):
        set_exactly(motion, name, number)
    motion.until("() => document.querySelector('.motion-verdict').dataset.kind === 'bad'")
    assert "lost" in verdict.inner_text()


@pytest.mark.slow
def test_the_motor_of_the_cell_is_the_one_that_is_shown(windows: Windows, serve: Any) -> None:
    window = at_motion(windows.new(serve(CLOSED_LOOP)).open())
    assert window.page.locator("select[name=motor]").input_value() == "fitted"
    assert window.page.locator("input[name=supply]").input_value() == "24"
    assert window.page.locator("input[name=friction]").input_value() == "0.15"
    window.until("() => document.querySelector('.motion-verdict').dataset.kind")


def test_each_axis_has_the_law_and_the_commands_of_its_controller(windows: Windows, serve: Any) -> None:
    window = at_motion(windows.new(serve("bs0610")).open())
    window.page.get_by_role("tab", name="bs0610.Y").click()
    window.until("() => document.querySelector('.motion-lines').textContent.startsWith('Y')")
    assert commands(window)[2:] == ["400R", "8000P", "500S"] or commands(window)[2:] == ["800R", "8000P", "500S"]


@pytest.mark.parametrize(("size", "theme"), LOOKS)
def test_the_page_fits_its_window(windows: Windows, workbench: Served, size: tuple[int, int], theme: str) -> None:
    window = at_motion(begun(windows.new(workbench, size=size, theme=theme)))
    assert window.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    window.picture(f"motion-{size[0]}-{theme}")
