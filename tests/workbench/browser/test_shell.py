"""What stands around every page, in a real browser: tabs, theme, tour, the way in, a crash."""

import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.workbench.browser.windows import LOOKS, PHONE, Served, Window, Windows, begun
from tests.workbench.patience import PATIENCE

HOMING = Path(__file__).parents[3] / "examples" / "homing" / "cell.toml"
SMALL = """() => [...document.querySelectorAll('button, a, select, input')]
    .filter((one) => one.getClientRects().length && one.getBoundingClientRect().height < 36)
    .map((one) => one.outerHTML.slice(0, 120))"""
PAGES = {"Cell": "/", "Program": "/program", "Terminal": "/terminal", "Scope": "/scope", "Motion": "/motion"}


def test_every_page_opens_from_its_tab_and_loads_nothing_from_elsewhere(window: Window) -> None:
    for name, path in PAGES.items():
        window.page.get_by_role("link", name=name, exact=True).click()
        window.page.wait_for_url(f"**{path}")
        window.until("(name) => document.title.startsWith(name)", name)
        assert window.page.locator("nav.tabs a[aria-current=page]").inner_text() == name
        window.page.locator("main.page .panel, main.page section").first.wait_for()
        assert "produced an error" not in window.page.inner_text("main")
    assert window.foreign() == []


@pytest.mark.parametrize(("size", "theme"), LOOKS)
def test_the_pages_are_no_wider_than_the_window_and_large_enough_to_tap(
    windows: Windows, workbench: Served, size: tuple[int, int], theme: str
) -> None:
    window = begun(windows.new(workbench, size=size, theme=theme))
    assert window.page.evaluate("document.documentElement.dataset.theme") == theme
    for text in ("F", "Q7", "P"):
        window.call("type", "drill", text)
    window.until("() => detent.get('now') > 1e9 && document.querySelectorAll('.wires g').length === 4")
    window.call("rewind", 860_000_000)  # the drill goes down
    window.until("() => detent.get('now') === 860000000")
    for name, path in PAGES.items():
        window.page.get_by_role("link", name=name, exact=True).click()
        window.page.wait_for_url(f"**{path}")
        window.page.locator("main.page .panel, main.page section").first.wait_for()
        if name == "Terminal":
            window.page.get_by_role("tab", name="drill").click()
            window.until("() => document.querySelectorAll('.said').length >= 6")
        assert window.page.evaluate("document.documentElement.scrollWidth") <= size[0], name
        if size == PHONE and name in ("Cell", "Terminal"):
            assert window.page.evaluate(SMALL) == []
        window.picture(f"{name.lower()}-{size[0]}-{theme}")


def test_the_theme_is_chosen_and_remembered(window: Window) -> None:
    window.click("Light or dark")
    assert window.page.evaluate("document.documentElement.dataset.theme") == "dark"
    assert window.page.evaluate("detent.remembered('theme')") == "dark"
    window.click("Light or dark")
    assert window.page.evaluate("document.documentElement.dataset.theme") == "light"


def test_the_tour_is_shown_once_and_again_when_it_is_asked_for(windows: Windows, workbench: Served) -> None:
    window = windows.new(workbench, tour=True).open("/")
    tour = window.page.get_by_role("dialog", name="Guided tour")
    tour.wait_for()
    window.picture("tour")
    stops = 1
    while tour.locator(".next").inner_text() == "Next":
        tour.locator(".next").click()
        stops += 1
    tour.locator(".next").click()
    assert stops >= 5
    assert tour.count() == 0
    assert window.page.evaluate("detent.remembered('tour')") == "seen"
    window.click("Guided tour")
    tour.wait_for()
    window.page.keyboard.press("Escape")
    assert tour.count() == 0


def ask(url: str, *lines: str) -> str:
    """The first line of the answer to a request that no browser would send."""
    host, port = url.split("/")[2].split(":")
    with socket.create_connection((host, int(port)), timeout=PATIENCE) as connection:
        connection.sendall("\r\n".join([*lines, "", ""]).encode())
        return connection.makefile("rb").readline().decode()


UPGRADE = ("Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
           "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==")  # fmt: skip


def test_a_foreign_name_or_origin_is_refused_by_the_server_itself(workbench: Served) -> None:
    own = workbench.url.split("/")[2]
    token = workbench.url.partition("?")[2]
    assert " 303 " in ask(workbench.url, f"GET /?{token} HTTP/1.1", f"Host: {own}")
    assert " 401 " in ask(workbench.url, "GET / HTTP/1.1", f"Host: {own}"), "on loopback, too: others have a door there"
    assert " 403 " in ask(workbench.url, "GET / HTTP/1.1", "Host: evil.example")
    sockets = ("/live", "/scope-feed", "/_nicegui_ws/socket.io/?EIO=4&transport=websocket")
    for path in sockets:
        assert " 403 " in ask(
            workbench.url, f"GET {path} HTTP/1.1", f"Host: {own}", "Origin: http://evil.example", *UPGRADE
        )
        assert " 403 " in ask(workbench.url, f"GET {path} HTTP/1.1", f"Host: {own}", *UPGRADE)
    polling = "/_nicegui_ws/socket.io/?EIO=4&transport=polling"
    assert " 403 " in ask(workbench.url, f"POST {polling} HTTP/1.1", f"Host: {own}", "Origin: http://evil.example")
    for path in ("/assets/../server.py", "/assets/%2e%2e/server.py", "/../../etc/passwd"):
        assert " 200 " not in ask(workbench.url, f"GET {path} HTTP/1.1", f"Host: {own}", "Accept: text/x-python")


def test_the_cell_begins_anew_at_the_second_click_only(window: Window) -> None:
    window.until("() => detent.get('now') > 5e8")
    window.click("Begin anew")
    window.page.get_by_text("Click once more").wait_for()
    assert window.get("now") > 5e8
    window.click("Begin anew")
    window.until("() => detent.get('now') < 5e8")


@pytest.fixture
def guarded(windows: Windows, serve: Callable[..., Served]) -> Window:
    """A window at another workbench, which asks for a token: the slide of examples/homing with its three switches."""
    own = serve(str(HOMING), "--token", "a word of my own")
    window = windows.new(own)
    window.page.goto(own.url)
    window.until("() => window.detent && detent.get('now') !== undefined")
    window.process = own.process.pid
    return window


def test_with_a_token_the_address_that_is_printed_lets_in_and_no_other(guarded: Window) -> None:
    bare = guarded.url.split("?")[0]
    assert " 401 " in ask(bare, "GET / HTTP/1.1", f"Host: {bare.split('/')[2]}")
    assert "token" not in guarded.page.url


def test_a_switch_is_dragged_along_the_axis_and_moved_by_keys(guarded: Window) -> None:
    guarded.until("() => detent.get('s.sensor.low') === 250")
    flag = guarded.page.get_by_role("slider", name="Place of switch sensor")
    box = flag.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    guarded.page.mouse.move(x, y)
    guarded.page.mouse.down()
    guarded.page.mouse.move(x - 60, y, steps=4)
    guarded.page.mouse.up()
    guarded.until(
        "() => detent.get('s.sensor.low') < 230 && detent.get('s.sensor.high') === detent.get('s.sensor.low') + 10"
    )
    there = guarded.get("s.sensor.low")
    flag.press("ArrowRight")
    guarded.until("(there) => detent.get('s.sensor.low') === there + 1", there)


def test_what_is_no_byte_no_place_and_no_pace_is_refused_and_harms_nothing(guarded: Window) -> None:
    refused = """(call) => new Promise((told) => {  // numbers as only a hand-made call has them
        const socket = new WebSocket(`ws://${location.host}/live`);
        socket.onopen = () => socket.send(`{"id": 1, ${call}}`);
        socket.onmessage = ({ data }) => { const one = JSON.parse(data); if (one.id) told(one.error), socket.close(); };
    })"""
    for call, why in (
        ('"call": "send", "args": ["slide", "\\u20ac"]', "is no byte"),
        ('"call": "place_switch", "args": ["home", NaN, 0]', "finite number"),
        ('"call": "place_switch", "args": ["home", -Infinity, 0]', "finite number"),
        ('"call": "pace", "args": [1e-300]', "greater than"),
    ):
        assert why in guarded.page.evaluate(refused, call)
    assert guarded.get("crashed") is None


@pytest.mark.slow
def test_where_a_unit_is_the_host_of_a_line_no_command_is_offered(
    windows: Windows, serve: Callable[..., Served]
) -> None:
    window = windows.new(serve(str(HOMING.parents[1] / "xyz-party-line" / "cell.toml"))).open()
    assert window.page.get_by_label("Command to adapter").is_visible()
    assert window.page.get_by_label("Command to x", exact=True).count() == 0
    assert window.page.get_by_role("region", name="Unit x").get_by_text("adapter is the host").is_visible()
    assert window.page.get_by_role("switch", name="Power of adapter").count() == 0  # nothing tells of its supply
    window.page.get_by_role("link", name="Terminal", exact=True).click()
    window.page.get_by_role("tab", name="bus").click()
    field = window.page.get_by_role("combobox", name="Line to send")
    assert field.is_disabled()
    assert "send to adapter" in (field.get_attribute("placeholder") or "")
    assert window.page.get_by_role("button", name="Run").is_disabled()
    window.page.get_by_role("tab", name="computer").click()
    assert field.is_enabled()


def test_on_a_phone_the_pause_is_explained_and_the_alarm_fits(windows: Windows, serve: Callable[..., Served]) -> None:
    phone = windows.new(serve(str(HOMING), "--token", "a word of my own"), size=PHONE)
    phone.page.goto(phone.url)
    phone.until("() => window.detent && detent.get('now') !== undefined")
    phone.call("rewind", 0)
    phone.page.locator(".why").get_by_text("by hand").wait_for()
    phone.page.evaluate("document.documentElement.dataset.crashed = 'yes'")
    alarm = phone.page.get_by_role("alert").first.bounding_box()
    button = phone.page.get_by_role("button", name="Start the cell again").bounding_box()
    assert alarm is not None
    assert button is not None
    assert button["x"] + button["width"] <= alarm["x"] + alarm["width"] <= PHONE[0]
    phone.call("go")


def test_a_crash_of_the_cell_is_told_loses_no_draft_and_is_mended_with_a_click(guarded: Window) -> None:
    guarded.call("keep_draft", "slide", "+250 ; not yet loaded\n", "")
    children = Path(f"/proc/{guarded.process}/task/{guarded.process}/children").read_text().split()
    engine = next(pid for pid in children if b"workbench.process" in Path(f"/proc/{pid}/cmdline").read_bytes())
    os.kill(int(engine), signal.SIGKILL)
    guarded.page.get_by_role("alert").first.wait_for()
    assert guarded.call("draft", "slide")["text"] == "+250 ; not yet loaded\n"
    guarded.picture("crash")
    guarded.click("Start the cell again")
    guarded.until("() => detent.get('crashed') === null && detent.get('held')")
    guarded.click("Pause or go")
    guarded.until("(before) => detent.get('now') > before", guarded.get("now"))
    guarded.page.reload()
    guarded.until("() => window.detent && detent.get('now') !== undefined")
    assert guarded.call("draft", "slide")["text"] == "+250 ; not yet loaded\n"
