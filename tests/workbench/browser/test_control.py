"""`--control` beside the workbench: what programs do to the cell is seen, queued, marked and mended in the window."""

import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from tests.cli.test_control import run
from tests.workbench.browser.windows import Served, Windows

ACTION = "(text) => (detent.get('marks') || []).some((mark) => mark[3] === text)"


@pytest.fixture
def served_too(chromium: Any, serve: Callable[..., Served]) -> Served:
    return serve("--control", "127.0.0.1:0", "--hold")


@pytest.fixture
def control(served_too: Served, capsys: pytest.CaptureFixture[str]) -> Iterator[Callable[..., dict[str, Any]]]:
    assert served_too.control is not None

    def do(*words: str) -> dict[str, Any]:
        status, out, err = run(capsys, str(served_too.control), *words, "--json")
        assert (status, err) == (0, "")
        told: dict[str, Any] = json.loads(out)
        return told

    yield do
    do("present")
    do("mend")


def test_what_a_program_does_shows_in_the_window_like_everything_else(
    windows: Windows, served_too: Served, control: Callable[..., dict[str, Any]]
) -> None:
    window = windows.new(served_too).open()
    page = window.page
    told = page.get_by_role("button", name=f"detent control {served_too.control}", exact=True)
    told.scroll_into_view_if_needed()
    window.picture("cell-control")
    control("fault", "bar", "lost", "--rate", "0.5")
    page.get_by_role("button", name="1 fault: mend").click()
    window.until("() => !detent.get('faults').length")
    assert control("faults")["faults"] == [], "a click mends what a program has broken"
    control("set", "bar.UI2", "low")
    window.until("() => detent.get('u.bar.pin.UI2') === 0")
    window.until(ACTION, "UI2 to 0")
    control("type", "V1", "--unit", "bar")
    page.get_by_text("1 command waits").wait_for()
    control("step")
    window.until("() => !detent.get('queue').length")
    control("resume")
    window.until("() => !detent.get('held')")
    control("pause")
    window.until("() => detent.get('held') && detent.get('why') === 'by a program'")


def test_a_program_waits_for_a_person_who_looks_back(
    windows: Windows, served_too: Served, control: Callable[..., dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    window = windows.new(served_too).open()
    control("step", "20 ms")
    control("pause")
    window.until("() => detent.get('held')")
    window.page.get_by_role("slider", name="Time").press("Home")
    window.until("() => detent.get('past')")
    status, _, err = run(capsys, str(served_too.control), "resume")
    assert status == 2
    assert "somebody looks back" in err
    assert control("present")["past"] is False
    window.until("() => !detent.get('past')")
    capsys.readouterr()
    assert run(capsys, str(served_too.control), "pause")[1].endswith("paused by hand\n")
