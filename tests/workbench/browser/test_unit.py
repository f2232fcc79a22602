"""The page Unit in a real browser: a DCB-274 that is served elsewhere is the real one, its emulation stands beside."""

from tests.workbench.browser.test_access import AXE, findings
from tests.workbench.browser.windows import KNOWN, LOOKS, Served, Windows


def test_the_panel_shows_what_the_unit_tells_and_a_hand_moves_it(windows: Windows, bench: Served, real: str) -> None:
    for size, theme in LOOKS:
        window = windows.new(bench, size=size, theme=theme).open("/unit")
        window.until(KNOWN)
        window.page.get_by_role("textbox", name="Line to send").fill("X")
        window.page.get_by_role("textbox", name="Line to send").press("Enter")
        window.page.locator(".answers td").first.wait_for()
        window.page.get_by_role("button", name="+ step, jog plus").click()
        window.until("() => document.querySelector('[data-role=sent]').textContent")
        window.picture(f"unit-{size[0]}-{theme}")
        assert window.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        if AXE.exists():
            assert findings(window) == []
        if size[0] < 500:
            window.page.evaluate("document.querySelector('.bench .talk').scrollIntoView()")
            window.picture(f"unit-{size[0]}-{theme}-b")
        window.page.evaluate("scrollTo(0, 0)")
        window.page.get_by_role("tab", name="Connect…").click()
        window.page.locator("[data-role=cell] button").first.wait_for()
        window.picture(f"unit-connect-{size[0]}-{theme}")


def test_the_same_line_goes_to_the_unit_and_to_its_emulation(windows: Windows, bench: Served) -> None:
    window = windows.new(bench).open("/unit")
    window.until(KNOWN)
    page = window.page
    if "dcb-274 (cell)" not in window.get("r.names"):
        page.get_by_role("tab", name="Connect…").click()
        page.locator("[data-role=cell] button").first.click()
    window.until("() => detent.get('r.dcb-274 (cell)')?.position === 0")
    page.get_by_role("combobox", name="Send to another unit, too").select_option(index=1)
    page.get_by_role("textbox", name="Line to send").fill("X")
    page.get_by_role("textbox", name="Line to send").press("Enter")
    page.locator(".answers .same").wait_for()
    window.picture("unit-beside")


def test_esc_twice_stops_a_unit_on_every_page(windows: Windows, bench: Served, real: str) -> None:
    window = windows.new(bench).open("/unit")
    window.until(KNOWN)
    name = next(name for name in window.get("r.names") if real in name)
    window.call("unit_say", name, "M 300")
    window.until("(name) => detent.get(`r.${name}`).moving", name)
    window.page.get_by_role("link", name="Scope").click()
    window.page.locator(".scope canvas").first.wait_for()
    now = window.page.evaluate("Date.now() / 1000")
    window.escape(now)
    window.escape(now + 0.3)
    window.until("(name) => detent.get(`r.${name}`).moving === false", name)
    assert window.get(f"r.{name}")["outcome"] == "stops by its ramp"


def test_a_key_that_is_held_runs_the_axis_until_it_is_let_go(windows: Windows, bench: Served, real: str) -> None:
    window = windows.new(bench).open("/unit")
    window.until(KNOWN)
    name = next(name for name in window.get("r.names") if real in name)
    window.page.get_by_role("tab", name=name).click()
    button = window.page.get_by_role("button", name="hold +: run plus")
    button.hover()
    window.page.mouse.down()
    window.until("(name) => detent.get(`r.${name}`).moving", name)
    window.page.mouse.up()
    window.until("(name) => detent.get(`r.${name}`).moving === false", name)


def test_another_measure_moves_nothing_and_is_the_same_on_the_page_motion(windows: Windows, bench: Served) -> None:
    window = windows.new(bench).open("/unit")
    window.until(KNOWN)
    page = window.page
    name = window.get("r.names")[0]
    page.get_by_role("tab", name=name, exact=True).click()
    by, lead = page.get_by_label("Jog by"), page.locator("[data-role=lead]")
    for measure in ("mm", "°"):
        page.get_by_label("Unit of length").select_option(measure)
        lead.fill("400")
        lead.press("Tab")
        assert by.input_value() == "0.25"
        page.get_by_label("Unit of length").select_option("")
        assert by.input_value() == "100"
    page.get_by_label("Unit of length").select_option("°")
    lead.fill("0")
    lead.press("Tab")
    before = window.get(f"r.{name}")["position"]
    page.get_by_role("button", name="+ step, jog plus").click()
    page.get_by_text("Write first how many steps a ° is").wait_for()
    assert window.get(f"r.{name}")["position"] == before
    lead.fill("0.8889")
    lead.press("Tab")
    page.get_by_role("link", name="Motion", exact=True).click()
    page.locator(".motion-units").get_by_role("tab", name=name, exact=True).click()
    window.until("() => document.querySelector('.motion [data-role=measure]').value === '°'")
    assert lead.input_value() == "0.8889"


def test_the_tour_takes_no_real_unit_for_one_that_can_be_taken_back(windows: Windows, bench: Served) -> None:
    window = windows.new(bench, tour=True).open("/")
    tour = window.page.get_by_role("dialog", name="Guided tour")
    tour.get_by_text("The real unit that is connected is on the page Unit").wait_for()


def test_a_program_that_is_written_for_a_unit_is_found_again(windows: Windows, bench: Served) -> None:
    window = windows.new(bench).open("/unit")
    window.until(KNOWN)
    source = window.page.get_by_role("textbox", name="Program source")
    source.fill("+ 100\n")
    window.page.get_by_role("link", name="Scope", exact=True).click()
    window.page.locator(".scope canvas").first.wait_for()
    window.page.get_by_role("link", name="Unit", exact=True).click()
    window.until(KNOWN)
    window.until("() => document.querySelector('[data-role=source]')?.value === '+ 100\\n'")


def test_a_unit_that_moves_is_not_left_at_the_first_click(windows: Windows, bench: Served, real: str) -> None:
    window = windows.new(bench).open("/unit")
    window.until(KNOWN)
    name = next(name for name in window.get("r.names") if real in name)
    window.page.get_by_role("tab", name=name).click()
    window.call("unit_say", name, "M 300")
    window.until("(name) => detent.get(`r.${name}`).moving", name)
    window.click("Leave")
    window.page.get_by_text("Click once more: it moves, and STOP does not reach it then.").wait_for()
    assert name in window.get("r.names")
    window.call("unit_stop", name)
