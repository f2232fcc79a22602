"""The page Cell in a real browser: the drilling cell of the GS-C200 datasheet (example 2), running."""

import os
import select

from tests.workbench.browser.windows import PHONE, Served, Window, Windows

ENTER = "Enter"
DRILLED = 930_000_000  # ns: the drill has come down for the first hole, and waits until the lift is done


def at(window: Window, time: int) -> None:
    """The cell stands, as it was at that time."""
    window.call("rewind", time)
    window.until("(time) => detent.get('held') && detent.get('now') === time", time)


def test_it_opens_on_the_drilling_cell_running(window: Window) -> None:
    assert "Drilling" in window.page.get_by_role("heading", level=1).inner_text()
    for unit in ("bar", "drill"):
        assert window.page.get_by_role("region", name=f"Unit {unit}").is_visible()
    window.until("() => detent.get('now') > 1e9")
    # the bar has been moved to the first hole, 250 steps, and the drill went down by 150 (datasheet, example 2)
    at(window, DRILLED)
    assert window.get("u.bar.x..position") == 250
    assert window.get("u.drill.x..position") == 150
    assert window.page.locator("[data-unit=drill] output").inner_text() == "+150"
    assert window.page.locator("[data-unit=drill] .state").inner_text() == "running"


def test_the_power_switch_of_a_unit_switches_it_off_and_on(window: Window) -> None:
    power = window.page.get_by_role("switch", name="Power of bar")
    assert power.get_attribute("aria-checked") == "true"
    power.click()
    window.until("() => detent.get('u.bar.powered') === false")
    assert power.get_attribute("aria-checked") == "false"
    window.until("() => detent.get('marks').some(([at, kind, unit]) => kind === 'power' && unit === 'bar')")
    power.click()
    window.until("() => detent.get('u.bar.powered') === true && detent.get('u.bar.state') === 'ready'")


def test_a_click_at_a_switch_reaches_the_programs_that_wait_for_it(window: Window) -> None:
    window.until("() => detent.get('s.start.level') === 1")
    switch = window.page.get_by_role("switch", name="stop")
    switch.click()  # 0: stop behind this bar
    window.until("() => detent.get('s.stop.level') === 0 && detent.get('u.bar.pin.UI3') === 0")
    window.call("pace", None)
    window.until("() => detent.get('u.bar.running') === null && detent.get('u.drill.running') === null")


def test_a_wire_held_to_an_input_gives_it_the_other_level_until_it_is_taken_away(window: Window) -> None:
    pin = window.page.locator("[data-jack='bar.EOT']")
    assert window.get("u.bar.pin.EOT") == 1
    pin.click()
    window.until("() => detent.get('u.bar.pin.EOT') === 0")
    assert "held" in (pin.get_attribute("class") or "")
    pin.click()
    window.until("() => detent.get('u.bar.pin.EOT') === 1")
    window.until("() => !document.querySelector(\"[data-jack='bar.EOT']\").classList.contains('held')")


def test_a_strap_counts_from_the_next_power_on(window: Window) -> None:
    # BR0 = 1, BR1 = BR2 = 0: 4800 baud (datasheet, "Baud rate")
    window.page.get_by_role("switch", name="Strap BR0 of drill").click()
    window.until("() => detent.get('u.drill.pin.BR0') === 1")
    assert window.get("l.drill.format").startswith("9600")
    power = window.page.get_by_role("switch", name="Power of drill")
    power.click()
    window.until("() => detent.get('u.drill.powered') === false")
    power.click()
    window.until("() => detent.get('l.drill.format').startsWith('4800')")


def test_pause_single_events_back_and_on_by_keys(window: Window) -> None:
    window.until("() => detent.get('now') > 6e8")
    keyboard = window.page.keyboard
    keyboard.press(" ")
    window.until("() => detent.get('held')")
    stood = window.get("now")
    keyboard.press(".")
    window.until("(stood) => detent.get('now') > stood", stood)
    keyboard.press(",")
    window.until("(stood) => detent.get('now') <= stood", stood)
    keyboard.press(" ")
    window.until("(stood) => !detent.get('held') && detent.get('now') > stood", stood)


def test_the_keys_of_time_act_at_the_time_line_too(window: Window) -> None:
    window.until("() => detent.get('now') > 3e8")
    line = window.page.get_by_role("slider", name="Time line")
    line.press(" ")
    window.until("() => detent.get('held')")
    stood = window.get("now")
    line.press(",")
    window.until("(stood) => detent.get('now') < stood", stood)
    before = window.get("now")
    line.press(".")
    window.until("(before) => detent.get('now') > before", before)
    line.press("]")
    window.until("() => detent.get('pace') === 2")
    line.press(" ")
    window.until("() => !detent.get('held')")


def test_the_pace_goes_from_a_hundredth_to_as_fast_as_it_goes(window: Window) -> None:
    pace = window.page.get_by_role("combobox", name="Pace")
    pace.select_option("0.01")
    window.until("() => detent.get('pace') === 0.01")
    window.click("Faster")
    window.until("() => detent.get('pace') === 0.02")
    window.click("Slower")
    window.until("() => detent.get('pace') === 0.01")
    pace.select_option("max")
    window.until("() => detent.get('pace') === null && detent.get('now') > 20e9")


def test_the_time_line_dragged_back_brings_the_cell_as_it_was_and_it_goes_on_from_there(window: Window) -> None:
    window.call("pace", 10)
    window.until("() => detent.get('now') > 12e9")
    line = window.page.get_by_role("slider", name="Time line")
    box = line.bounding_box()
    assert box is not None
    window.page.mouse.move(box["x"] + box["width"] - 12, box["y"] + 10)
    window.page.mouse.down()
    for part in (0.8, 0.6, 0.4):
        window.page.mouse.move(box["x"] + box["width"] * part, box["y"] + 10)
    window.until("() => detent.get('held') && detent.get('past')")
    window.page.mouse.up()
    window.until("() => detent.get('now') < 0.5 * detent.get('end')")
    then = window.get("now")
    was = [window.get(key) for key in ("u.bar.x..position", "u.drill.x..position", "u.bar.address")]
    at(window, DRILLED)
    assert (window.get("u.bar.x..position"), window.get("u.drill.x..position")) == (250, 150)
    at(window, then)
    assert [window.get(key) for key in ("u.bar.x..position", "u.drill.x..position", "u.bar.address")] == was
    window.picture("time-line")
    end = window.get("end")
    window.call("pace", 1)
    window.click("Pause or go")
    window.until(
        "([then, end]) => !detent.get('past') && detent.get('now') > then && detent.get('end') < end", [then, end]
    )


def test_the_time_line_is_moved_by_keys_too(window: Window) -> None:
    window.until("() => detent.get('now') > 1e9")
    line = window.page.get_by_role("slider", name="Time line")
    line.press("Home")
    window.until("() => detent.get('now') === detent.get('begin') && detent.get('past')")
    line.press("End")
    window.until("() => !detent.get('past')")


def test_several_windows_show_the_same_cell(window: Window, windows: Windows, workbench: Served) -> None:
    other = windows.new(workbench, size=PHONE, theme="dark").open("/")
    other.page.get_by_role("switch", name="Power of drill").click()
    for each in (window, other):
        each.until("() => detent.get('u.drill.powered') === false && detent.get('windows') >= 2")
    window.click("Pause or go")
    other.until("() => detent.get('held')")


def test_a_command_from_the_panel_is_answered_and_an_error_is_shown(window: Window) -> None:
    window.page.get_by_role("switch", name="Power of bar").click()
    window.page.get_by_role("switch", name="Power of bar").click()  # its program is gone, it is idle
    window.until("() => detent.get('u.bar.state') === 'ready'")
    field = window.page.get_by_role("textbox", name="Command to bar")
    field.fill("+200")
    field.press(ENTER)
    window.until("() => detent.get('u.bar.x..position') === 200")
    field.fill("Q7")
    field.press(ENTER)
    window.until("() => detent.get('u.bar.error') !== null")
    assert window.page.locator("[data-unit=bar] .fault").get_attribute("data-value") != ""


def test_a_host_program_is_served_at_the_address_that_the_panel_shows(window: Window, workbench: Served) -> None:
    address = next(end["address"] for end in workbench.endpoints if end["unit"] == "drill")
    shown = window.page.locator("[data-unit=drill] .endpoint")
    assert shown.get_attribute("data-copy") == address  # a long one is shown by its end
    assert shown.inner_text().removeprefix("…/") in address
    client = os.open(address, os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(client, b"F\x76\r")  # F and its checksum
        answer = b""
        while not answer.endswith(b"\r"):
            assert select.select([client], [], [], 60)[0]
            answer += os.read(client, 100)
    finally:
        os.close(client)
    window.page.goto(workbench.url.replace("/?", "/terminal?"))
    window.page.get_by_role("tab", name="drill").click()
    window.page.locator(".said.host").first.wait_for()


def test_everything_that_can_be_clicked_has_a_name(window: Window) -> None:
    nameless = window.page.evaluate(
        """() => [...document.querySelectorAll('button, a, select, input, [role=slider]')]
            .filter((one) => !(one.getAttribute('aria-label') || one.textContent.trim()))
            .map((one) => one.outerHTML.slice(0, 120))"""
    )
    assert nameless == []


def test_something_breaks_stands_in_sight_and_is_mended_with_one_click(window: Window) -> None:
    window.call("mend")
    box = window.page.get_by_role("region", name="Break it")
    box.get_by_label("What breaks").select_option("stuck")
    box.get_by_label("Where").select_option("stop")
    box.get_by_role("button", name="Break").click()
    window.until("() => detent.get('u.bar.pin.UI3') === 0")  # its own lever is at 1 still
    assert window.get("s.stop.level") == 1
    window.page.get_by_role("button", name="1 fault: mend").wait_for()  # on every page
    box.get_by_role("button", name="Mend stop: a contact or an input stays at a level (level 0)").click()
    window.until("() => detent.get('u.bar.pin.UI3') === 1 && !detent.get('faults').length")


def test_a_fault_that_cannot_be_says_why_and_breaks_nothing(window: Window) -> None:
    box = window.page.get_by_role("region", name="Break it")
    box.get_by_label("What breaks").select_option("lost")
    box.get_by_label("rate").fill("7")
    box.get_by_role("button", name="Break").click()
    window.page.locator(".toast.error").first.wait_for()
    assert window.get("faults") == []
    window.page.evaluate("document.getElementById('toasts').replaceChildren()")


def test_what_is_sent_while_the_cell_stands_waits_in_sight_and_is_sent_when_it_goes_on(window: Window) -> None:
    window.call("hold")
    window.until("() => detent.get('held')")
    for text, told in (("V1", "1 command waits"), ("V2", "2 commands wait")):
        field = window.page.get_by_label("Command to bar")
        field.fill(text)
        field.press(ENTER)
        window.page.get_by_text(told).wait_for()
        window.until("() => document.querySelector('[aria-label=\"Command to bar\"]').value === ''")
    window.call("withdraw", window.get("queue")[0][0])
    window.page.get_by_text("1 command waits").wait_for()
    stood = window.get("now")
    window.call("go")
    window.until("(stood) => !detent.get('queue').length && detent.get('now') > stood", stood)


def test_a_future_that_was_left_is_compared_and_taken_again(window: Window) -> None:
    window.until("() => detent.get('now') > 1e9")
    window.call("hold")
    window.until("() => detent.get('held')")
    end = window.get("now")
    at(window, 500_000_000)
    window.call("set_switch", "start", 0)
    window.call("go")
    window.until("(end) => detent.get('now') > end", end)
    window.call("hold")
    window.page.get_by_role("button", name="1 other future").click()
    futures = window.page.get_by_role("dialog", name="Other futures")
    futures.get_by_role("button", name="Compare").click()
    futures.get_by_text("has other levels at").first.wait_for()
    futures.get_by_role("button", name="Take it again").click()
    window.until("(end) => detent.get('held') && detent.get('now') === end && detent.get('s.start.level') === 1", end)
    window.page.get_by_role("button", name="1 other future").wait_for()  # the one that was left for it
