"""Hands that are quicker than the page: what windows show is a moment behind the cell, and no press is lost for it.

All presses of a test are made in one task of the browser, or while an answer is held back: nothing can come in between.
"""

from pathlib import Path
from typing import Any

import pytest
from tests.workbench.browser.test_program import at_program
from tests.workbench.browser.windows import Served, Window, Windows

ROOT = Path(__file__).parents[3]
HOMING = str(ROOT / "examples" / "homing" / "cell.toml")

TURNED = """() => [...document.querySelectorAll('[data-do][data-args*="\\\\"!"]')].map((one) =>
    JSON.parse(one.dataset.args).find((each) => typeof each === 'string' && each.startsWith('!')).slice(1))"""

PRESS = """([selector, times]) => {
    const one = document.querySelector(selector);
    for (let n = 0; n < times; n += 1) one.click();
}"""

KEY = """([name, times]) => {
    for (let n = 0; n < times; n += 1)
        document.body.dispatchEvent(new KeyboardEvent('keydown', { key: name, bubbles: true, cancelable: true }));
}"""

AT = """([selector, name, times]) => {
    const one = document.querySelector(selector);
    for (let n = 0; n < times; n += 1) one.dispatchEvent(new KeyboardEvent('keydown', { key: name, bubbles: true }));
}"""

QUIET = "() => !detent.turning()"


@pytest.fixture
def program(window: Window) -> Window:
    return at_program(window)


def settled(window: Window) -> None:
    """Everything that was asked for is done."""
    window.until(QUIET)


def pressed(window: Window, selector: str, times: int) -> None:
    window.page.evaluate(PRESS, [selector, times])
    settled(window)


def turns(window: Window, key: str, selector: str) -> None:
    """Two presses in a moment change nothing, three turn it over, and one more turns it back."""
    before = bool(window.get(key))
    pressed(window, selector, 2)
    assert bool(window.get(key)) is before, f"{key}: two presses"
    pressed(window, selector, 3)
    assert bool(window.get(key)) is not before, f"{key}: three presses"
    pressed(window, selector, 1)
    assert bool(window.get(key)) is before, f"{key}: one press"


def test_every_control_that_turns_something_over_counts_each_press(window: Window) -> None:
    window.call("hold")
    keys = window.page.evaluate(TURNED)
    assert {"u.bar.powered", "s.start.level", "u.drill.pin.BR0"} <= set(keys)
    for key in keys:
        turns(window, key, f"""[data-do][data-args*='"!{key}"']""")


def test_a_wire_held_to_an_input_counts_each_press(window: Window) -> None:
    window.call("hold")
    pin = "[data-part=input-pin][data-unit=bar][data-pin=EOT]"
    assert window.get("u.bar.pin.EOT") == 1
    for times, hand, level in ((2, [], 1), (3, ["EOT"], 0), (1, [], 1), (5, ["EOT"], 0), (1, [], 1)):
        pressed(window, pin, times)
        assert (window.get("u.bar.hand"), window.get("u.bar.pin.EOT")) == (hand, level)


@pytest.mark.parametrize("way", ["button", " ", "F8"])
def test_pause_and_go_count_each_press(window: Window, way: str) -> None:
    def press(times: int) -> None:
        if way == "button":
            window.page.evaluate(PRESS, ["[data-part=go]", times])
        else:
            window.page.evaluate(KEY, [way, times])
        settled(window)

    assert not window.get("held")
    press(2)
    assert not window.get("held")
    press(3)
    assert window.get("held")
    press(1)
    assert not window.get("held")


def test_a_step_and_a_go_in_one_moment_go_on(window: Window) -> None:
    window.call("hold")
    window.page.evaluate(KEY, [".", 1])
    window.page.evaluate(KEY, [" ", 1])
    settled(window)
    assert not window.get("held")


def test_every_press_of_slower_and_faster_is_a_notch(window: Window) -> None:
    window.page.evaluate(KEY, ["[", 3])
    window.until("() => detent.get('pace') === 0.1")
    window.page.evaluate(KEY, ["]", 2])
    window.until("() => detent.get('pace') === 0.5")


def test_a_command_line_is_free_for_the_next_command_at_once(window: Window) -> None:
    window.call("hold")
    field = window.page.get_by_label("Command to bar")
    held_back(window, "type")
    field.fill("V1")
    field.press("Enter")
    assert field.input_value() == ""
    field.type("V2")  # while the first is still under way
    released(window)
    window.until("() => detent.get('queue').length === 1")
    assert field.input_value() == "V2"
    field.press("Enter")
    window.until("() => detent.get('queue').length === 2")
    assert [one[3] for one in window.get("queue")] == ["V1", "V2"]


def test_a_command_that_is_turned_down_comes_back_to_be_mended(window: Window) -> None:
    field = window.page.get_by_label("Command to bar")
    field.fill("+250\N{DEGREE SIGN}")
    field.press("Enter")
    window.page.locator(".toast.error").first.wait_for()
    assert field.input_value() == "+250\N{DEGREE SIGN}"


def test_the_arrow_keys_move_a_switch_by_each_press(windows: Windows, serve: Any) -> None:
    window = windows.new(serve(HOMING)).open()
    window.call("hold")
    flag = "[data-flag=home]"
    high = window.get("s.home.high")
    window.page.evaluate(AT, [flag, "ArrowLeft", 5])
    settled(window)
    assert window.get("s.home.high") == high - 5
    window.page.evaluate(AT, [flag, "ArrowRight", 7])
    settled(window)
    assert window.get("s.home.high") == high + 2


# -- the page Program -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["F9", "button"])
def test_every_press_of_break_counts(program: Window, way: str) -> None:
    program.page.locator(".cm-line", has_text="L0").first.click()
    for times, found in ((1, [20]), (2, [20]), (3, []), (4, [])):
        if way == "F9":
            program.page.evaluate(KEY, [way, times])
        else:
            program.page.evaluate(PRESS, ["[data-key=break]", times])
        settled(program)
        program.until("(found) => JSON.stringify(detent.get('u.bar.breaks')) === found", str(found).replace(" ", ""))
        assert program.page.locator(".cm-gutterElement:visible .cm-dot").count() == len(found)


def test_a_breakpoint_that_another_window_sets_stays(program: Window) -> None:
    program.page.locator(".cm-line", has_text="L0").first.click()
    held_back(program, "program_breakpoint")
    program.page.keyboard.press("F9")
    program.call("program_breaks", "bar", [0])  # by somebody else, before it is there
    released(program)
    program.until("() => JSON.stringify(detent.get('u.bar.breaks')) === '[0,20]'")
    program.until("() => document.querySelectorAll('.cm-gutterElement .cm-dot').length >= 2")


def test_a_key_that_is_pressed_while_a_unit_is_turned_to_acts_on_that_unit(program: Window) -> None:
    held_back(program, "draft")
    program.page.get_by_role("tab", name="drill", exact=True).click()
    program.page.keyboard.press("F9")
    released(program)
    program.until("() => detent.get('u.drill.breaks').length === 1")
    assert program.get("u.bar.breaks") == []


def test_what_is_typed_while_another_unit_is_turned_to_is_in_the_draft_of_the_first(program: Window) -> None:
    program.page.locator(".cm-line", has_text="L0").first.click()
    held_back(program, "draft")
    program.page.evaluate("document.querySelector('.program-units [data-unit=drill]').click()")
    program.page.keyboard.press("Home")
    program.page.keyboard.type("; mine ")
    released(program)
    program.until("() => document.querySelector('.program').dataset.checked === 'loaded'")
    program.until("async () => (await detent.call('draft', 'bar'))?.text.includes('; mine ')")
    kept = program.call("draft", "bar")["text"]
    assert "A2" in kept
    assert kept != program.page.evaluate("document.querySelector('.program').program.editor.text")
    assert program.call("draft", "drill") is None


def test_a_question_about_one_file_is_no_question_about_another(program: Window, workbench: Served) -> None:
    for name in ("one.gsc", "two.gsc"):
        (workbench.folder / name).write_text("; as it was\n")
    program.page.locator("[data-key=save]").click()
    name = program.page.get_by_label("file name")
    name.fill("one.gsc")
    held_back(program, "write_file")
    name.press("Enter")
    name.fill("two.gsc")  # before the answer is there
    name.press("Enter")
    released(program)
    program.page.locator(".program-asks", has_text="two.gsc is there already").wait_for()
    assert (workbench.folder / "two.gsc").read_text() == "; as it was\n"
    program.page.locator(".program-dialog button", has_text="Cancel").click()


# -- answers that are held back -------------------------------------------------------------------------------------

HOLD_BACK = """(name) => {
    const send = WebSocket.prototype.send;
    const kept = [];
    WebSocket.prototype.send = function (text) {
        if (JSON.parse(text).call === name) kept.push([this, text]);
        else send.call(this, text);
    };
    window.letGo = () => {
        WebSocket.prototype.send = send;
        for (const [socket, text] of kept) send.call(socket, text);
    };
}"""


def held_back(window: Window, name: str) -> None:
    """Calls of this name leave the page no more until `released`."""
    window.page.evaluate(HOLD_BACK, name)


def released(window: Window) -> None:
    window.page.evaluate("letGo()")
