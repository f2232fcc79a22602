"""STOP in a real browser: reached from everywhere, told where it is not confirmed, and two presses of Esc."""

import json
import os
import signal
from typing import Any

import pytest
from tests.workbench.browser.windows import KNOWN, PHONE, WIDE, Served, Window, Windows, served

PAGES = ("/", "/program", "/terminal", "/scope", "/motion", "/unit", "/begin")
REACHED = """() => {
    const keys = [...document.querySelectorAll('[data-part=stop]')];
    return keys.some((key) => {
        const { x, y, width, height } = key.getBoundingClientRect();
        return document.elementFromPoint(x + width / 2, y + height / 2) === key;
    });
}"""
"""Whether a STOP would take a click."""


STOPPED = """async ([name, since]) => {
    const talk = await detent.call('unit_talk', name, since);
    return talk.rows.some((row) => row.sender && row.parts[0][1] === '@');
}"""
"""A DCB-274 has answered its stop."""


def unit(window: Window, address: str) -> str:
    window.until(KNOWN)
    return next(name for name in window.get("r.names") if address in name)


@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_stop_is_reached_on_every_page_whatever_is_open(
    windows: Windows,
    bench: Served,
    size: tuple[int, int],
) -> None:
    window = windows.new(bench, size=size).open("/unit")
    window.until(KNOWN)
    for path in PAGES:
        window.open(path)
        window.until(REACHED)
        window.page.wait_for_function("() => document.querySelector('main.page')?.innerText.length > 20")
        for n in range(window.page.evaluate("document.querySelectorAll('dialog').length")):
            window.page.evaluate("(n) => document.querySelectorAll('dialog')[n].showModal()", n)
            assert window.page.evaluate(REACHED), f"{path}: dialog {n}"
            window.page.evaluate("(n) => document.querySelectorAll('dialog')[n].close()", n)
        window.page.evaluate("document.dispatchEvent(new CustomEvent('detent-tour'))")
        window.page.locator(".tour").wait_for()
        assert window.page.evaluate(REACHED), f"{path}: the tour"
        window.page.locator(".tour .skip").click()


def test_esc_twice_stops_and_two_that_are_far_apart_do_not(windows: Windows, bench: Served, real: str) -> None:
    window = windows.new(bench).open("/unit")
    name = unit(window, real)
    window.call("unit_say", name, "M 300")
    window.until("(name) => detent.get(`r.${name}`).moving", name)
    now = window.page.evaluate("Date.now() / 1000")
    window.escape(now)
    window.escape(now + 0.8)
    window.until(
        "(name) => { const it = detent.get(`r.${name}`); return it.moving && !it.stopping && !it.outcome; }", name
    )
    window.escape(now + 1.4)
    window.until("(name) => detent.get(`r.${name}`).moving === false", name)
    assert window.get(f"r.{name}")["outcome"] == "stops by its ramp"


def test_a_question_that_is_open_is_not_answered_by_stop(windows: Windows, bench: Served, real: str) -> None:
    window = windows.new(bench).open("/motion")
    name = unit(window, real)
    window.page.get_by_role("tab", name=name).click()
    window.page.get_by_role("button", name="Send and move").click()
    dialog = window.page.locator("dialog.motion-dialog")
    dialog.get_by_role("button", name="Send", exact=True).wait_for()
    before = window.get(f"r.{name}")["talk"]
    dialog.get_by_role("button", name="STOP").click()
    dialog.wait_for(state="hidden")
    window.until(STOPPED, [name, before])
    rows = window.call("unit_talk", name, before)["rows"]
    said = {row["parts"][0][1] for row in rows if not row["sender"] and not row["question"]}
    assert said <= {"@", "CR"}, "nothing of the move"


def test_a_stop_that_is_not_confirmed_stands_above_the_page(
    windows: Windows,
    chromium: Any,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    with served(tmp_path_factory.mktemp("hung"), "dcb-274") as hung:
        window, sent = windows.new(hung), list[str]()
        window.page.on("websocket", lambda socket: socket.on("framesent", lambda data: sent.append(str(data))))
        window.open("/")
        window.call("unit_connect", "dcb-274", hung.endpoints[0]["address"], "patience=10")
        window.page.locator("header").get_by_role("button", name="STOP", exact=True).wait_for()
        (asked,) = [json.loads(text) for text in sent if "unit_connect" in text]
        assert asked["heard"] > 0, "by it the server knows what comes late"
        os.kill(hung.process.pid, signal.SIGSTOP)
        try:
            window.page.locator("header").get_by_role("button", name="STOP", exact=True).click()
            window.page.get_by_text("STOP is not confirmed yet. If something moves, switch off the supply").wait_for()
            mute = window.page.locator(".alarm.mute")
            mute.get_by_text("No answer from the workbench since").wait_for()
            mute.get_by_text("STOP may reach nothing").wait_for()
            window.picture("mute")
        finally:
            os.kill(hung.process.pid, signal.SIGCONT)
        mute.wait_for(state="hidden")
        window.page.locator(".alarm.unconfirmed").wait_for(state="hidden")
        window.page.close()
        windows.opened.remove(window)
