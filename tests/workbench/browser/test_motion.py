"""The Motion page in a real browser."""

import csv
from pathlib import Path
from typing import Any

import pytest
from tests.workbench.browser.windows import EVERY_LOOK, LOOKS, PHONE, Served, Window, Windows, begun

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
    assert "too short for the slew speed" in fact(motion, "peak")
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


def limit(window: Window, name: str) -> str:
    return str(window.page.locator(f'.motion-slider:has([data-exact="{name}"]) .motion-limit').inner_text())


def test_a_number_that_is_brought_into_its_range_or_rounded_is_said_to_be(motion: Window) -> None:
    set_exactly(motion, "T", 99999999)
    assert limit(motion, "T") == "takes 10 to 10000 steps/s: 10000 is meant"
    set_exactly(motion, "T", 1004)
    assert limit(motion, "T") == "counts in steps of 10: 1000 is meant"
    set_exactly(motion, "T", 1000)
    assert limit(motion, "T") == ""


def test_lengths_are_shown_in_mm_where_a_lead_is_given(motion: Window) -> None:
    for name, number in (("S", 100), ("T", 1000), ("R", 40), ("steps", 500)):
        set_exactly(motion, name, number)
    motion.page.locator("[data-role=measure]").select_option("mm")
    lead = motion.page.locator("[data-role=lead]")
    lead.fill("80")
    lead.press("Tab")
    motion.until("() => document.querySelector('[data-fact=peak]').textContent === '12.5 mm/s'")
    assert fact(motion, "accelerates") == "154.7 mm/s\u00b2"  # 12 375 / 80, (1000**2 - 100**2) / 80 steps/s2
    motion.picture("motion-mm")
    motion.page.locator("[data-role=measure]").select_option("\u00b0")
    assert float(lead.input_value()) == pytest.approx(400 / 360)  # half steps of a motor with 200 steps
    motion.page.locator("[data-role=measure]").select_option("")


def test_a_move_is_kept_and_what_is_changed_compared_with_it(motion: Window) -> None:
    for name, number in (("S", 100), ("T", 1000), ("R", 40), ("steps", 500)):
        set_exactly(motion, name, number)
    motion.page.locator("[data-key=keep]").click()
    set_exactly(motion, "T", 2000)
    rows = motion.page.locator(".motion-both tbody tr")
    assert "S10 T100 R40 +500" in rows.nth(0).inner_text()
    assert "S10 T200 R40 +500" in rows.nth(1).inner_text()
    assert "\u2212" in rows.nth(1).inner_text()
    motion.picture("motion-both")
    motion.page.locator("[data-key=swap]").click()
    motion.until("() => document.querySelector('[data-exact=T]').value === '1000'")
    motion.until("() => document.querySelectorAll('.motion-both tbody tr')[0].textContent.includes('T200')")
    motion.page.locator("[data-key=drop]").click()
    assert motion.page.locator(".motion-both").is_hidden()


def test_the_curves_are_kept_as_a_table_and_as_a_picture(motion: Window, tmp_path: Path) -> None:
    for name, number in (("S", 100), ("T", 1000), ("R", 40), ("steps", 500)):
        set_exactly(motion, name, number)
    with motion.page.expect_download() as table:
        motion.page.locator("[data-key=csv]").click()
    table.value.save_as(tmp_path / "move.csv")
    rows = list(csv.DictReader((tmp_path / "move.csv").read_text().splitlines()))
    assert table.value.suggested_filename == "bar-move.csv"
    assert float(rows[-1]["steps"]) == 500
    assert float(rows[-1]["s"]) == pytest.approx(0.565455, abs=1e-6)
    assert rows[0]["commands"] == "S10 T100 R40 +500"
    assert max(float(row["steps/s2"]) for row in rows) == pytest.approx(12375, rel=0.01)
    with motion.page.expect_download() as picture:
        motion.page.locator("[data-key=png]").click()
    picture.value.save_as(tmp_path / "move.png")
    assert (tmp_path / "move.png").read_bytes().startswith(b"\x89PNG")


LITTLE = "inertia=0.1, voltage=0.05, torque_constant=0, inductance=0, resistance=0, damping=0"


@pytest.mark.parametrize(
    ("size", "theme"), [EVERY_LOOK[0], *(pytest.param(*look, marks=pytest.mark.slow) for look in EVERY_LOOK[1:])]
)
def test_the_fastest_settings_are_searched_picked_and_sent_by_keys_alone(
    windows: Windows, workbench: Served, size: tuple[int, int], theme: str
) -> None:
    """From the choice of the motor to the unit that has the settings: no pointer is used."""
    window = at_motion(begun(windows.new(workbench, size=size, theme=theme)))
    page = window.page
    page.locator("select[name=motor]").focus()
    page.keyboard.type("qsh4218-41")
    window.until("() => document.querySelector('.motion-verdict').dataset.kind")
    for name, text in (("inertia", "0.15"), ("friction", "0.02")):
        page.locator(f"input[name={name}]").fill(text)
    for name, text in (("moves", "200"), ("variants", "64"), ("vary", LITTLE)):
        page.locator(f".motion-search input[name={name}]").fill(text)
    page.locator(".motion-search input[name=vary]").press("Enter")
    window.until("() => ['searching', 'mapping'].includes(detent.get('tuning').state)")
    page.wait_for_function("() => detent.get('tuning.map') && detent.get('tuning').state === 'done'", timeout=120_000)
    found = window.get("tuning.found")
    assert "0 of 64" in page.locator(".motion-known").inner_text()
    field = page.locator(".motion-map-field")
    field.scroll_into_view_if_needed()
    field.focus()
    for _ in range(40):
        page.keyboard.press("ArrowUp")  # the gentlest ramp of the map
    assert "0 of 32 lost" in page.locator(".motion-map-told").inner_text()
    window.picture(f"motion-map-{size[0]}-{theme}")
    page.keyboard.press("Enter")
    window.until("() => document.querySelector('.motion-map-told').textContent.startsWith('taken over')")
    gentle = window.get("tuning.map")["y"][-1]
    assert page.locator("[data-exact=R]").input_value() == str(gentle)
    page.locator("[data-key=send-found]").press("Enter")
    dialog = page.locator(".motion-dialog")
    assert dialog.locator("li").all_inner_texts() == found["commands"]
    window.picture(f"motion-send-{size[0]}-{theme}")
    assert page.evaluate("document.activeElement.value") == "cancel"
    page.keyboard.press("Enter")
    assert not dialog.is_visible()
    for on in (False, True):
        window.call("power", "bar", on)  # its program ends, and it takes settings
    before = window.get("u.bar.reg")
    page.locator("[data-key=send-found]").press("Enter")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    wanted = {name: str(value) for name, value in found["settings"].items()}
    window.until(
        "(wanted) => Object.entries(wanted).every(([name, value]) => detent.get('u.bar.reg')[name] === value)", wanted
    )
    assert {**before, **wanted} == window.get("u.bar.reg")
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]


def test_a_search_without_a_motor_is_not_begun(motion: Window) -> None:
    motion.page.locator("select[name=motor]").select_option("")
    motion.page.locator("[data-key=search]").click()
    motion.until("() => document.querySelector('#toasts').textContent.includes('Choose a motor first')")
    assert motion.page.evaluate("document.activeElement.name") == "motor"


def test_no_label_stands_on_a_curve(windows: Windows, workbench: Served) -> None:
    """On a phone, too: units and names stand above the place that curves are drawn in."""
    window = at_motion(begun(windows.new(workbench, size=PHONE)))
    window.page.locator("[data-key=keep]").click()
    words = window.page.evaluate("""() => Object.values(document.querySelector('.motion').motion.charts).map((one) => {
        const chart = one, at = [], pen = chart.pen, wrote = pen.fillText;
        pen.fillText = (text, x, y) => { at.push([text, x, y, pen.textAlign]); };
        chart.paint();
        pen.fillText = wrote;
        return { at, width: chart.canvas.clientWidth, height: chart.canvas.clientHeight, note: chart.what.note };
    })""")
    for chart in words:
        for text, x, y, align in chart["at"]:
            above, below = y < 24, y > chart["height"] - 24
            assert chart["note"] or above or below or (align == "right" and x < 58), (text, x, y)


def test_settings_go_to_a_unit_that_is_connected_when_they_have_been_seen(windows: Windows, serve: Any) -> None:
    """A unit behind a port, as the Unit page connects it: its tab is on this page, its lines are shown before."""
    served = serve("dcb-274", "--tcp", "127.0.0.1:0")
    window = at_motion(windows.new(served).open())
    address = served.endpoints[0]["address"]
    window.call("unit_connect", "dcb-274", address, "", "mine")
    window.until("() => (detent.get('r.mine') || {facts: []}).facts.some((fact) => fact[0] === 'initial I' && fact[1])")
    window.page.get_by_role("tab", name="mine").click()
    window.until("() => document.querySelector('.motion').motion.about.real")
    assert window.page.locator("select[name=stepping]").input_value() == "1/4"
    # the key in the same breath as the number: what is meant is shown, not what was drawn last
    window.page.evaluate("""() => {
        const exact = document.querySelector('[data-exact="V"]');
        exact.value = "5000";
        exact.dispatchEvent(new Event("input", { bubbles: true }));
        document.querySelector("[data-key=send]").click();
    }""")
    window.until("() => document.querySelector('.motion-dialog').open")
    dialog = window.page.locator(".motion-dialog")
    assert "real unit" in dialog.inner_text()
    assert dialog.locator("li").nth(1).inner_text() == "V 5000"
    dialog.locator("[value=send]").click()
    window.until("() => document.querySelector('.motion-told').textContent.startsWith('sent')")
    peak = fact(window, "peak").split(".")[0].split(" ")[0]  # what the timer makes of it
    window.until(
        "(peak) => detent.get('r.mine').facts.some((fact) => fact[0] === 'slew V' && fact[1] === `${peak} steps/s`)",
        peak,
    )
    window.call("unit_leave", "mine")
    window.until("() => !document.querySelector('.motion').motion.about.real")
