"""A workbench as a process, and windows of a browser at it: what the tests here share."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from tests.workbench.patience import PATIENCE

COMMAND = [sys.executable, "-c", "from detent.cli import main; main()", "workbench"]
NOTHING = "silence.js"  # a small file of the workbench; shown, it is a text
WIDE, PHONE = (1280, 800), (390, 844)
THEMES = ("light", "dark")
PICTURES = os.environ.get("DETENT_PICTURES")
EVERY_LOOK = [(size, theme) for size in (WIDE, PHONE) for theme in THEMES]
LOOKS = EVERY_LOOK if PICTURES else [(WIDE, "light"), (PHONE, "dark")]
"""Windows in which every page is looked at: all of them when pictures are wanted."""


KNOWN = "() => { const it = detent.get('r.names'); return it.length && detent.get(`r.${it[0]}`).position !== null; }"
"""The first unit that is connected has told where it stands."""


class Served(NamedTuple):
    """A workbench that serves."""

    url: str
    endpoints: list[dict[str, str]]
    folder: Path  # the chosen one
    state: Path
    process: subprocess.Popen[str]
    control: str | None = None  # where programs look and meddle


@contextmanager
def served(place: Path, *arguments: str) -> Iterator[Served]:
    """`detent workbench ARGUMENTS`, its files below `place`."""
    folder, state = place / "chosen", place / "state"
    folder.mkdir(exist_ok=True)
    command = [*COMMAND, *arguments, "--port", "0", "--json", "--folder", str(folder), "--state", str(state)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=place)
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line, process.communicate()[1]
        facts = json.loads(line)
        yield Served(facts["url"], facts["endpoints"], folder, state, process, facts["control"])
    finally:
        process.terminate()
        try:
            _, err = process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
    assert process.returncode == 0, err
    assert "Traceback" not in err, err


class Window:
    """A window of the browser: a Playwright page, with what tests of the workbench do often."""

    def __init__(self, page: Any, url: str) -> None:
        self.page, self.url = page, url
        self.kept = False  # for the next test, at the page where it is
        self.shows = False  # a page of the workbench
        self.own = False  # the test has changed what stays with its tab
        self.process = 0  # the workbench, for who wants to know it
        self.errors: list[str] = []
        self.requests: list[str] = []
        self._heard = {
            "pageerror": lambda error: self.errors.append(str(error)),
            "console": lambda message: self.errors.append(message.text) if message.type == "error" else None,
            "request": lambda request: self.requests.append(request.url),
        }
        for event, hear in self._heard.items():
            page.on(event, hear)

    def open(self, path: str = "/") -> "Window":
        """Load a page and wait until it shows live values."""
        self.shows = True
        base, _, token = self.url.partition("?")
        self.page.goto(base.rstrip("/") + path + ("&" if "?" in path else "?") + token)
        self.page.wait_for_function("window.detent && detent.get('now') !== undefined")
        return self

    def call(self, name: str, *arguments: object) -> Any:
        """Make a call of the live socket (see `detent.workbench.board`)."""
        return self.page.evaluate("([name, args]) => detent.call(name, ...args)", [name, list(arguments)])

    def get(self, key: str) -> Any:
        """A value of the live table."""
        return self.page.evaluate("(key) => detent.get(key)", key)

    def until(self, condition: str, argument: object = None) -> None:
        """Wait until the JavaScript function `condition` is true; `detent.get(KEY)` tells values."""
        self.page.wait_for_function(condition, arg=argument)

    def click(self, name: str, role: str = "button") -> None:
        """Click what has this name for a screen reader."""
        self.page.get_by_role(role, name=name, exact=True).click()

    def escape(self, at: float) -> None:
        """Press Esc as if it were at `at`, in seconds since 1970: tests of two presses do not hang on the load."""
        session = self.page.context.new_cdp_session(self.page)
        key = {"key": "Escape", "code": "Escape", "windowsVirtualKeyCode": 27, "timestamp": at}
        for kind in ("keyDown", "keyUp"):
            session.send("Input.dispatchKeyEvent", {"type": kind, **key})
        session.detach()

    def leave(self) -> bool:
        """Lead the tab to a file that does nothing, where nothing is remembered; False: it cannot be used again."""
        from playwright.sync_api import Error

        for event, hear in self._heard.items():
            self.page.remove_listener(event, hear)
        if self.own or self.errors or not self.page.url.startswith("http"):
            return False
        try:
            answer = self.page.goto("/".join([*self.url.split("/")[:3], "assets", NOTHING]))
        except Error:  # the workbench is gone
            return False
        if answer is None or not answer.ok:
            return False
        self.page.evaluate("localStorage.clear(), sessionStorage.clear()")
        return True

    def foreign(self) -> list[str]:
        """Requests to other places than the workbench."""
        own = self.url.split("/")[2]
        return [
            url
            for url in self.requests
            if url.split(":")[0] in ("http", "https", "ws", "wss") and url.split("/")[2] != own
        ]

    def picture(self, name: str) -> None:
        """Write a picture of what is seen, if pictures are wanted."""
        if PICTURES:
            Path(PICTURES).mkdir(parents=True, exist_ok=True)
            self.page.screenshot(path=str(Path(PICTURES) / f"{name}.png"))


class Windows:
    """Opens windows of one workbench, and looks at them when the test is over.

    Windows of one size and theme share a profile of the browser, so that it loads what never changes once, and one
    after the other its tabs: to open one costs as much as three pages.
    """

    def __init__(self, chromium: Any, profiles: dict[object, Any], tabs: dict[object, list[Any]]) -> None:
        self._chromium, self._profiles, self._tabs = chromium, profiles, tabs
        self.opened: list[Window] = []

    def new(self, served: Served, *, size: tuple[int, int] = WIDE, theme: str = "light", tour: bool = False) -> Window:
        """A window, not yet at a page."""
        window = Window(self._tab(size, theme, tour), served.url)
        self.opened.append(window)
        return window

    def usual(self, served: Served) -> Window:
        """The window that tests use one after the other, at the page where the last one left it."""
        kept = ("usual", served.url)
        if kept not in self._profiles:
            self._profiles[kept] = Window(self._tab(WIDE, "light", False), served.url)
        window: Window = self._profiles[kept]
        window.kept = True
        window.page.bring_to_front()  # the page of a tab that is behind another is drawn rarely
        self.opened.append(window)
        return window

    def done(self, window: Window) -> None:
        """The test needs it no longer."""
        self.opened.remove(window)
        self._leave(window)

    def close(self) -> list[tuple[list[str], list[str]]]:
        """Close all of them but the usual one; what each asked of other hosts, and its errors."""
        found = [(window.foreign(), list(window.errors)) for window in self.opened]
        for window in self.opened:
            if window.kept and not window.errors:
                window.page.evaluate("localStorage.clear()")
                window.requests.clear()
            else:
                self._leave(window)
        return found

    def rest(self) -> None:
        """Leave the usual ones, whose pages draw; the cell of each stands."""
        for kept in [kept for kept, window in self._profiles.items() if isinstance(window, Window)]:
            self._profiles[kept].call("hold")
            self._leave(self._profiles[kept])

    def _leave(self, window: Window) -> None:
        if window.kept:
            del self._profiles["usual", window.url]
        kind = next(kind for kind, profile in self._profiles.items() if profile is window.page.context)
        if window.leave():
            self._tabs.setdefault(kind, []).append(window.page)
        else:
            window.page.close()

    def _tab(self, size: tuple[int, int], theme: str, tour: bool) -> Any:
        """A tab that a test before has left, or a new one."""
        kind = (size, theme, tour)
        profile = self._profile(size, theme, tour)
        if not self._tabs.get(kind):
            return profile.new_page()
        tab = self._tabs[kind].pop()
        tab.bring_to_front()
        if tab.viewport_size != (there := {"width": size[0], "height": size[1]}):
            tab.set_viewport_size(there)
        return tab

    def _profile(self, size: tuple[int, int], theme: str, tour: bool) -> Any:
        kind = (size, theme, tour)
        if kind not in self._profiles:
            phone = size[0] < 600
            self._profiles[kind] = self._chromium.new_context(
                viewport={"width": size[0], "height": size[1]}, color_scheme=theme, has_touch=phone, is_mobile=phone,
                permissions=["clipboard-read", "clipboard-write"],
            )  # fmt: skip
            self._profiles[kind].set_default_timeout(1000 * PATIENCE)
            if not tour:
                self._profiles[kind].add_init_script("localStorage.setItem('detent.tour', 'seen')")
        return self._profiles[kind]


def begun(window: Window) -> Window:
    """The window at the page Cell, its cell begun anew and running in real time."""
    if not window.shows:
        window.open()
    else:
        window.page.get_by_role("link", name="Cell", exact=True).click()
        window.page.locator(".cell").wait_for()
    window.call("pace", 1)
    window.call("break_on_errors", False)
    for unit in ("bar", "drill"):  # the cell is shared with tests that stop its programs
        if window.get(f"u.{unit}.breaks"):
            window.call("program_breaks", unit, [])
    window.page.evaluate("document.querySelector('.cell').dataset.old = 'yes'")
    window.call("restart")
    window.until("() => document.querySelector('.cell:not([data-old])')")  # the page is drawn anew, forms and all
    window.until("() => detent.get('now') < 60e9 && !detent.get('past')")
    if window.get("held"):
        window.call("go")
    window.until("() => !detent.get('held')")
    return window
