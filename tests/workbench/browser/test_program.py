"""The Program page in a real browser."""

from typing import Any

import pytest
from tests.workbench.browser.windows import LOOKS, Served, Window, Windows, begun

CHECKED = "() => document.querySelector('.program')?.dataset.checked"


def at_program(window: Window) -> Window:
    """At the page Program with the program of the bar module, as the cell file has it, and no breakpoint."""
    for unit in ("bar", "drill"):
        window.call("forget_draft", unit)
        window.call("program_breaks", unit, [])
    window.page.get_by_role("link", name="Program").click()
    window.until(CHECKED)
    return window


@pytest.fixture
def program(window: Window) -> Window:
    return at_program(window)


def key(window: Window, name: str) -> Any:
    return window.page.locator(f"[data-key={name}]")


def line(window: Window, text: str) -> Any:
    """The first line of the editor with this text."""
    return window.page.locator(".cm-line", has_text=text).first


def type_behind(window: Window, text: str, typed: str) -> None:
    """Type a line behind the one with `text`."""
    line(window, text).click()
    window.page.keyboard.press("End")
    window.page.keyboard.press("Enter")
    window.page.keyboard.type(typed)


def checked(window: Window, how: str) -> None:
    window.until(f"() => document.querySelector('.program').dataset.checked === '{how}'")


def stands_at(window: Window, number: int) -> None:
    """Wait until the cell stands and the editor shows line `number` as the one that runs."""
    window.until(
        "(number) => detent.get('held') && document.querySelector('.program').dataset.line === String(number)", number
    )
    assert window.page.locator(".cm-stands").count() == 1


def break_at(window: Window, text: str) -> None:
    line(window, text).click()
    key(window, "break").click()
    window.page.locator(".cm-gutterElement:visible .cm-dot").wait_for()
    window.until("() => detent.get('u.bar.breaks').length === 1")


def test_the_program_of_the_cell_is_shown_with_addresses_and_memory_use(program: Window) -> None:
    """Datasheet, function table: U, W, L, A, D and C take two bytes, S, T, R and moves four: 52 of 119."""
    addresses = [text for text in program.page.locator(".cm-addresses .cm-gutterElement").all_inner_texts() if text]
    assert [*addresses[:4], addresses[-1]] == ["0", "2", "6", "10", "50"]
    assert program.page.locator(".program-used").inner_text() == "52 of 119 bytes"
    assert program.page.locator(".program-loaded").inner_text() == "as in program memory"
    assert program.page.locator(".cm-command").count() >= 15


def test_an_error_is_underlined_as_one_types_with_its_message(program: Window) -> None:
    type_behind(program, "T100", "T10000")
    checked(program, "errors")
    assert program.page.locator(".cm-wrong").inner_text() == "10000"
    told = program.page.locator(".program-errors").inner_text()
    assert told.startswith("6:10")
    assert "1 to 1000" in told
    program.page.locator(".cm-wrong").hover()
    program.page.locator(".cm-help-wrong").wait_for()
    assert "Set the slew speed." in program.page.locator(".cm-help").inner_text()  # and what the command is
    program.picture("program-error")
    for _ in "T10000":
        program.page.keyboard.press("Backspace")
    checked(program, "loaded")
    assert program.page.locator(".cm-wrong").count() == 0


def test_commands_and_labels_complete_from_the_table(program: Window) -> None:
    type_behind(program, "T100", "W")
    row = program.page.locator(".cm-tooltip-autocomplete li[aria-selected]")
    row.wait_for()
    assert row.inner_text().startswith("W")
    assert "Wait until an input is one." in row.inner_text()  # what it means, not what it takes
    program.page.locator(".cm-completionInfo").wait_for()
    assert "Wait until an input is one." in program.page.locator(".cm-completionInfo").inner_text()


def test_a_program_is_loaded_run_and_stopped_at_a_breakpoint_then_stepped_to_and_fro(program: Window) -> None:
    break_at(program, "L0")
    key(program, "run").click()
    stands_at(program, 9)
    assert program.page.locator(".program-line").inner_text().split() == ["20", "L0"]
    key(program, "step").click()
    stands_at(program, 10)  # A2
    key(program, "back").click()
    stands_at(program, 9)
    program.picture("program-break")
    line(program, "C2").click()
    key(program, "cursor").click()
    stands_at(program, 12)
    assert "round 1" in program.page.locator("[data-registers=bar]").inner_text()  # of the loop
    key(program, "go").click()
    stands_at(program, 9) if program.get("held") else program.until("() => !detent.get('held')")


def test_a_breakpoint_follows_its_line_when_the_program_is_changed_and_loaded(program: Window) -> None:
    break_at(program, "L0")
    assert program.get("u.bar.breaks") == [20]
    type_behind(program, "T100", "A3")
    checked(program, "sound")
    assert program.page.locator(".program-used").inner_text() == "54 of 119 bytes"
    key(program, "load").click()
    checked(program, "loaded")
    program.until("() => JSON.stringify(detent.get('u.bar.breaks')) === '[22]'")  # A3 takes two bytes


def test_compare_shows_the_lines_that_memory_has_otherwise(program: Window) -> None:
    key(program, "compare").click()
    told = program.page.locator("[data-for=language] .program-told")
    program.until("() => document.querySelector('.program-told').textContent.includes('just this program')")
    line(program, "+250").click()
    program.page.keyboard.press("Home")
    program.page.keyboard.press("Shift+End")
    program.page.keyboard.type("+350")
    checked(program, "sound")
    key(program, "compare").click()
    program.until("() => document.querySelector('.program-told').textContent.includes('differs in 1 line')")
    assert told.first.get_attribute("data-kind") == "warn"
    assert program.page.locator(".cm-differs").count() == 1


def test_a_program_is_kept_in_eeprom_by_the_unit_s_own_command(program: Window) -> None:
    program.call("power", "bar", False)  # ends the program that runs: M is refused meanwhile (B)
    program.call("power", "bar", True)
    key(program, "load").click()
    program.until("() => document.querySelector('.program-told').textContent.includes('52 bytes loaded')")
    key(program, "keep").click()
    program.until("() => detent.get('u.bar.stored') >= 1")
    key(program, "compare-kept").click()
    program.until("() => document.querySelector('.program-told').textContent.includes('holds just this program')")


def test_files_are_saved_and_opened_within_the_chosen_folder(program: Window, workbench: Served) -> None:
    type_behind(program, "T100", "A3")
    key(program, "save").click()
    name = program.page.get_by_label("file name")
    name.fill("../out.gsc")
    name.press("Enter")
    program.page.locator(".toast.error").first.wait_for()
    name.fill("mine/bar.gsc")
    name.press("Enter")
    program.until("() => !document.querySelector('.program-dialog').open")
    assert "A3" in (workbench.folder / "mine" / "bar.gsc").read_text()
    assert program.page.locator(".program-file").inner_text() == "mine/bar.gsc"
    key(program, "revert").click()
    program.until("() => document.querySelector('.program-file').textContent === 'of the cell'")
    key(program, "open").click()
    program.page.locator(".program-dialog[open]").wait_for()
    program.page.locator(".program-list button", has_text="mine/bar.gsc").click()
    program.page.locator(".program-dialog [type=submit]").click()
    line(program, "A3").wait_for()


def test_a_draft_outlives_the_page(program: Window) -> None:
    type_behind(program, "T100", "A3")
    program.until("() => document.querySelector('.program').dataset.draft === 'kept'")
    assert "A3" in program.call("draft", "bar")["text"]
    program.page.reload()
    program.until(CHECKED)
    line(program, "A3").wait_for()
    assert "\u2022" in program.page.locator(".program-file").inner_text()


@pytest.mark.slow
def test_a_unit_without_programs_says_so_and_takes_a_script(windows: Windows, serve: Any) -> None:
    window = windows.new(serve("bs0610")).open()
    window.call("forget_draft", "script.bs0610")
    window.page.get_by_role("link", name="Program").click()
    window.page.locator(".program-why").wait_for()
    assert "holds no programs" in window.page.locator(".program-why").inner_text()
    window.page.locator(".cm-content").click()
    window.page.keyboard.type("X 400R ; run rate\n@ 100 ms\n250S\n")
    key(window, "send").click()
    window.until("() => detent.get('u.bs0610.x.X.pulses') === 250")
    assert window.page.locator("[data-for=language]").first.is_hidden()


@pytest.mark.parametrize(("size", "theme"), LOOKS)
def test_the_page_fits_its_window(windows: Windows, workbench: Served, size: tuple[int, int], theme: str) -> None:
    window = at_program(begun(windows.new(workbench, size=size, theme=theme)))
    assert window.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    window.picture(f"program-{size[0]}-{theme}")
