"""The page Terminal in a real browser."""

import pytest
from tests.workbench.browser.windows import Served, Window


@pytest.fixture
def terminal(window: Window) -> Window:
    """At the page Terminal, with the line of the bar module, which is idle."""
    window.call("power", "bar", False)
    window.call("power", "bar", True)
    window.page.get_by_role("link", name="Terminal").click()
    window.page.get_by_role("tab", name="bar").click()
    window.page.get_by_role("combobox", name="Line to send").wait_for()
    return window


def send(window: Window, text: str) -> None:
    field = window.page.get_by_role("combobox", name="Line to send")
    field.fill(text)
    field.press("Enter")


def rows(window: Window) -> list[str]:
    return [text.replace("\n", " ") for text in window.page.locator(".said").all_inner_texts()]


def test_a_line_that_is_sent_is_shown_with_what_every_byte_of_it_was(terminal: Window) -> None:
    send(terminal, "+200")
    terminal.page.locator(".said:not(.host)").first.wait_for()
    sent = terminal.page.locator(".said.host").first
    chips = sent.locator(".chip")
    kinds = [(chips.nth(n).get_attribute("class") or "").split()[1] for n in range(chips.count())]
    # a frame of a point-to-point line: instruction, checksum, CR (datasheet, "Communication protocol")
    assert kinds[0] == "command"
    assert "checksum" in kinds
    assert kinds[-1] == "end"
    assert all(chips.nth(n).get_attribute("data-help") for n in range(chips.count()))


def test_an_error_is_explained_in_words(terminal: Window) -> None:
    send(terminal, "Q7")
    wrong = terminal.page.locator(".said.wrong").first
    wrong.wait_for()
    assert len(wrong.locator(".note").inner_text()) > 5
    terminal.picture("terminal-error")


def test_bytes_are_sent_as_they_are(terminal: Window) -> None:
    terminal.page.get_by_role("combobox", name="To", exact=True).select_option("raw")
    send(terminal, "F\\x76\\r")
    terminal.page.locator(".said.host").first.wait_for()
    terminal.page.locator(".said:not(.host)").first.wait_for()


def test_what_was_sent_comes_back_with_the_arrow_up(terminal: Window) -> None:
    send(terminal, "+200")
    send(terminal, "F")
    field = terminal.page.get_by_role("combobox", name="Line to send")
    field.press("ArrowUp")
    assert field.input_value() == "F"
    field.press("ArrowUp")
    assert field.input_value() == "+200"


def test_help_comes_from_the_command_table_as_one_types(terminal: Window) -> None:
    terminal.page.get_by_role("combobox", name="Line to send").fill("+")
    assert "step" in terminal.page.locator("[data-role=hint]").inner_text()


def test_a_script_is_sent_line_by_line_and_kept_as_a_draft(terminal: Window, workbench: Served) -> None:
    script = terminal.page.get_by_role("textbox", name="Script")
    script.fill("+100 ; there\n@ 300 ms\n@ answer\n-100 ; and back\n")
    terminal.click("Run")
    terminal.until("() => { const how = detent.get('script.bar'); return how && !how.running && how.told === 'done'; }")
    terminal.until("() => document.querySelectorAll('.said.host').length >= 2")
    sent = [row for row in rows(terminal) if "host" in row]
    assert ["100" in row for row in sent] == [True, True]
    drafts = (terminal.call("draft", "script.bar") for _ in range(2000))  # each takes a trip to the server
    assert any(draft and "back" in draft["text"] for draft in drafts)
    terminal.page.reload()
    terminal.until("() => document.querySelector('[data-role=script]')?.value.includes('back')")


def test_a_script_with_a_mistake_says_the_line_and_sends_nothing(terminal: Window) -> None:
    terminal.page.get_by_role("textbox", name="Script").fill("+100\n@ soon\n")
    terminal.click("Run")
    terminal.until("() => document.querySelector('[data-role=told]').textContent.startsWith('line 2')")
    assert terminal.page.locator(".said").count() == 0


def test_a_tab_that_is_chosen_again_takes_nothing_back_that_is_typed(terminal: Window) -> None:
    """Each choice asks for the draft: the answer to the first opens no field that the next overwrites."""
    terminal.call("keep_draft", "script.bar", "+1\n", "")
    terminal.page.evaluate("""async () => {
        const [tab, script] = ["[data-line=bar]", "[data-role=script]"].map((one) => document.querySelector(one));
        tab.click();
        tab.click();
        const opened = new Promise((done) => new MutationObserver(done).observe(script, { attributes: true }));
        while (script.readOnly) await opened;
        script.value = "+2\\n";
        script.dispatchEvent(new Event("input", { bubbles: true }));
    }""")
    terminal.call("draft", "script.bar")  # answered behind the others
    assert terminal.page.get_by_role("textbox", name="Script").input_value() == "+2\n"


def test_scripts_are_opened_and_saved_in_the_chosen_folder_only(terminal: Window, workbench: Served) -> None:
    script, file = (
        terminal.page.get_by_role("textbox", name="Script"),
        terminal.page.get_by_role("combobox", name="File"),
    )
    script.fill("+1\n")
    file.fill("moves.txt")
    terminal.click("Save")
    terminal.page.get_by_text("Saved: moves.txt").wait_for()
    assert (workbench.folder / "moves.txt").read_text() == "+1\n"
    script.fill("")
    terminal.click("Open")
    terminal.until("() => document.querySelector('[data-role=script]').value === '+1\\n'")
    (workbench.folder.parent / "outside.txt").write_text("secret")
    for name in ("../outside.txt", "/etc/passwd"):
        for button in ("Open", "Save"):
            file.fill(name)
            terminal.click(button)
            terminal.until("() => document.querySelector('.toast.error')")
            terminal.page.evaluate("document.getElementById('toasts').remove()")
    assert (workbench.folder.parent / "outside.txt").read_text() == "secret"
    assert "secret" not in script.input_value()


def test_a_script_is_kept_when_one_goes_to_another_line_at_once(terminal: Window) -> None:
    terminal.page.get_by_role("textbox", name="Script").fill("+7 ; of the bar\n")
    terminal.page.get_by_role("tab", name="drill").click()
    terminal.until("() => !document.querySelector('[data-role=script]').value.includes('bar')")
    terminal.page.get_by_role("tab", name="bar").click()
    terminal.until("() => document.querySelector('[data-role=script]').value.includes('+7 ; of the bar')")


def test_a_line_that_is_chosen_while_the_cell_stands_shows_what_was_said(terminal: Window) -> None:
    """Nothing moves the page to look again: also who chooses faster than the workbench answers sees his line."""
    says = "(unit) => [...document.querySelectorAll('.said .who')].some((who) => who.textContent === `${unit}:`)"
    for unit in ("bar", "drill"):
        terminal.call("power", unit, False)
        terminal.call("power", unit, True)
        terminal.page.locator(f"[data-line={unit}]").click()
        send(terminal, "F")
        terminal.until(says, unit)
    terminal.call("hold")
    for unit in ("bar", "drill", "bar", "drill"):  # until the page has seen that it stands
        terminal.page.locator(f"[data-line={unit}]").click()
        terminal.until(says, unit)
    hurried = "() => { for (const n of [0, 1]) document.querySelectorAll('[data-line]')[n].click(); }"
    terminal.page.evaluate(hurried)
    terminal.until(says, "drill")
    terminal.call("go")
