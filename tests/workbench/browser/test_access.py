"""Every page for everybody: names for screen readers, contrast, sizes of type, the keyboard; by axe-core and by hand.

axe-core is taken from npm once (`make test` does that) and kept in ``.venv/axe``; without it these tests are skipped.
"""

import json
from pathlib import Path
from typing import Any

import pytest
from tests.workbench.browser.windows import LOOKS, PHONE, Served, Window, Windows, begun

ROOT = Path(__file__).parents[3]
AXE = ROOT / ".venv" / "axe" / "node_modules" / "axe-core" / "axe.min.js"
PAGES = ("/", "/program", "/terminal", "/scope", "/motion", "/unit", "/begin")
SERIOUS = ("serious", "critical")
LEAST_CONTRAST, LEAST_TYPE = 4.5, 11  # WCAG 2.1, 1.4.3; px

needs_axe = pytest.mark.skipif(not AXE.exists(), reason="axe-core is not there: make axe (npm) fetches it")


def findings(window: Window) -> list[str]:
    """What axe-core finds serious on the page as it stands."""
    if not window.page.evaluate("typeof axe !== 'undefined'"):
        window.page.evaluate(AXE.read_text())
    window.page.evaluate("scrollTo(0, 0)")
    found: dict[str, Any] = window.page.evaluate("axe.run(document, { resultTypes: ['violations'] })")
    return [
        f"{one['id']}: {node['html'][:120]} {[each['message'][:150] for each in node['any']][:1]}"
        for one in found["violations"]
        if one["impact"] in SERIOUS
        for node in one["nodes"][:3]
    ]


def settle(window: Window) -> None:
    """The page stands: the cell paused, no message, no help over anything."""
    window.call("hold")
    window.until("() => detent.get('held')")
    window.page.evaluate("document.getElementById('toasts')?.replaceChildren()")
    window.page.mouse.move(0, 0)


READY = {
    "/": ".unit",
    "/program": ".cm-content",
    "/terminal": ".rows",
    "/scope": ".scope canvas",
    "/motion": ".motion input[type=range]",
    "/unit": ".connect .list button",
    "/begin": ".place",
}


@needs_axe
@pytest.mark.parametrize("path", PAGES)
def test_no_page_has_a_serious_finding_in_any_size_or_theme(path: str, windows: Windows, workbench: Served) -> None:
    found = []
    for size, theme in LOOKS:
        window = windows.new(workbench, size=size, theme=theme).open(path)
        window.page.locator(READY[path]).first.wait_for()
        settle(window)
        window.picture(f"access{path.replace('/', '-')}-{size[0]}-{theme}")
        found += [f"{size[0]} {theme}: {finding}" for finding in findings(window)]
        assert window.page.evaluate("document.documentElement.scrollWidth") <= size[0], (
            f"{size[0]}: wider than the window"
        )
        windows.done(window)
    assert not found, json.dumps(found, indent=1)


TYPE = """(least) => {
    const found = new Set();
    for (const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT); walker.nextNode();) {
        const node = walker.currentNode, at = node.parentElement;
        if (!node.textContent.trim() || !at || at.closest('script, style, svg, option, [hidden]')) continue;
        if (!at.getClientRects().length) continue;
        const size = parseFloat(getComputedStyle(at).fontSize);
        if (size < least) found.add(`${at.className || at.tagName}: ${size} px: ${node.textContent}`);
    }
    return [...found];
}"""


@pytest.mark.parametrize("path", PAGES)
def test_no_type_is_too_small_to_read(path: str, windows: Windows, workbench: Served) -> None:
    # straps, notes, tabs on a phone: nothing under 11 px
    window = windows.new(workbench, size=PHONE, theme="dark").open(path)
    window.page.locator(READY[path]).first.wait_for()
    assert window.page.evaluate(TYPE, LEAST_TYPE) == []
    window.page.set_viewport_size({"width": 1280, "height": 800})
    assert window.page.evaluate(TYPE, LEAST_TYPE) == []
    windows.done(window)


CONTRAST = """() => {
    const css = getComputedStyle(document.documentElement);
    const part = (text) => {
        const made = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
        made.fillStyle = text;
        made.fillRect(0, 0, 1, 1);
        return [...made.getImageData(0, 0, 1, 1).data].slice(0, 3);
    };
    const light = (name) => part(css.getPropertyValue(name)).map((v) => v / 255)
        .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
        .reduce((sum, v, n) => sum + v * [0.2126, 0.7152, 0.0722][n], 0);
    const ratio = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05);
    const pairs = [];
    for (const on of ['--ground', '--panel', '--panel-2', '--raised'])
        for (const ink of ['--ink', '--ink-2', '--ink-3']) pairs.push([ink, on]);
    for (const on of ['--panel', '--raised'])
        for (const ink of ['--accent', '--bad', '--warn', '--good']) pairs.push([ink, on]);
    pairs.push(['--lcd-ink', '--lcd'], ['--lcd-dim', '--lcd'], ['--bar-ink', '--bar'], ['--bar-ink-2', '--bar'],
        ['--bar-ink', '--bar-2'], ['--accent-ink', '--accent'], ['--bad', '--bad-soft'], ['--warn', '--warn-soft'],
        ['--ink', '--accent-soft'], ['--ink', '--warn-soft']);
    return pairs.map(([ink, on]) => [ink, on, ratio(ink, on)]);
}"""


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_every_ink_stands_out_from_what_it_is_written_on(theme: str, windows: Windows, workbench: Served) -> None:
    window = windows.new(workbench, theme=theme).open()
    low = [one for one in window.page.evaluate(CONTRAST) if one[2] < LEAST_CONTRAST]
    assert low == []
    windows.done(window)


def test_every_page_is_reached_and_left_by_the_keyboard_alone(window: Window) -> None:
    page = window.page
    for number, path in enumerate(PAGES, 1):
        page.keyboard.press("Escape")
        page.evaluate("document.activeElement.blur()")
        page.keyboard.press(str(number))
        page.wait_for_function("(path) => location.pathname === path", arg=path)
        page.locator(READY[path]).first.wait_for()
        seen = []
        for _ in range(12):
            page.keyboard.press("Tab")
            seen.append(
                page.evaluate("document.activeElement.getAttribute('aria-label') || document.activeElement.innerText")
            )
        assert len(set(seen)) > 6, f"{path}: the focus stands still: {seen}"


@pytest.mark.parametrize("focus", [".cm-content", "[data-unit=bar]", ".program-files button", "body"])
def test_control_s_saves_the_program_wherever_the_focus_is(window: Window, focus: str) -> None:
    window.page.get_by_role("link", name="Program", exact=True).click()
    window.page.locator(".program[data-checked=loaded]").wait_for()
    window.page.evaluate("(place) => (document.activeElement.blur(), document.querySelector(place).focus())", focus)
    window.page.keyboard.press("Control+s")
    window.page.locator("dialog.program-dialog[open]").wait_for()
    window.page.keyboard.press("Escape")
    window.page.locator("dialog.program-dialog:not([open])").wait_for(state="attached")


@pytest.mark.parametrize("key", ["F8", "F9", "F10", "F4"])
def test_the_keys_of_the_debugger_act_wherever_the_focus_is(window: Window, key: str) -> None:
    window.page.get_by_role("link", name="Program", exact=True).click()
    window.page.locator(".program[data-checked=loaded]").wait_for()
    window.page.get_by_role("tab", name="bar", exact=True).click()
    window.page.locator(".program[data-checked=loaded]").wait_for()
    window.call("hold")
    window.until("() => detent.get('held')")
    window.page.evaluate("document.activeElement.blur()")
    before = window.get("now")
    window.page.keyboard.press(key)
    if key == "F8":
        window.until("() => !detent.get('held')")
    elif key == "F9":
        window.until("() => detent.get('u.bar.breaks').length === 1")
        window.page.keyboard.press(key)
        window.until("() => detent.get('u.bar.breaks').length === 0")
    else:
        window.until("(before) => detent.get('now') > before", before)
    begun(window)
