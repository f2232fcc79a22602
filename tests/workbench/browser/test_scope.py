"""The Scope page in a real browser."""

import struct
import zlib
from pathlib import Path
from typing import Any

import pytest
from tests.workbench.browser.windows import LOOKS, PHONE, Served, Window, Windows, begun

CLOSED_LOOP = str(Path(__file__).parents[3] / "examples" / "closed-loop-motor" / "cell.toml")  # a motor is fitted
SCOPE = "document.querySelector('.scope').scope"


def at_scope(window: Window) -> Window:
    """At the page Scope, with frames coming."""
    window.page.get_by_role("link", name="Scope").click()
    window.until("() => Number(document.querySelector('.scope')?.dataset.frames) > 0")
    return window


@pytest.fixture
def scope(window: Window) -> Window:
    return at_scope(window)


def value(window: Window, expression: str) -> Any:
    """Something of the page's scope, like view or cursors."""
    return window.page.evaluate(f"() => {SCOPE}.{expression}")


def frames(window: Window, more: int = 2) -> None:
    """Wait for some more frames."""
    now = int(window.page.locator(".scope").get_attribute("data-frames") or 0)
    window.until("(wanted) => Number(document.querySelector('.scope').dataset.frames) >= wanted", now + more)


def held_at(window: Window, seconds: float) -> None:
    """Wait until the cell has come so far, then hold it; a frame of that is shown."""
    window.until("(at) => detent.get('now') >= at", seconds * 1e9)
    window.call("hold")
    window.until(f"() => detent.get('held') && {SCOPE}.frame && {SCOPE}.frame.now === detent.get('now')")


def trace(window: Window, key: str) -> list[tuple[float, float]]:
    """The columns of a trace in the last frame, as (low, high); gaps are left out."""
    rows = window.page.evaluate(
        "(key) => { const trace = " + SCOPE + ".frame.traces.find(({id}) => id === key);"
        " return [...trace.low].map((low, i) => [trace.base + low, trace.base + trace.high[i]])"
        ".filter(([low]) => low === low); }", key,
    )  # fmt: skip
    return [(low, high) for low, high in rows]


def drag(window: Window, begin: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag on the canvas, from and to given parts of its width and px of its height."""
    box = window.page.locator(".scope canvas").bounding_box()
    mouse = window.page.mouse
    mouse.move(box["x"] + begin[0] * box["width"], box["y"] + begin[1])
    mouse.down()
    mouse.move(box["x"] + (begin[0] + end[0]) / 2 * box["width"], box["y"] + end[1])
    mouse.move(box["x"] + end[0] * box["width"], box["y"] + end[1])
    mouse.up()


def test_it_opens_on_the_drilling_cell_following_the_present(scope: Window) -> None:
    """Datasheet, example 2: the bar moves at T100, 1000 steps/s; UO2 calls the drill."""
    names = scope.page.locator(".scope-name .scope-title").all_inner_texts()
    assert any(name.startswith("bar speed") for name in names)
    assert any(name.startswith("bar UO2") for name in names)
    held_at(scope, 4.2)
    assert max(high for _, high in trace(scope, "bar.speed")) == pytest.approx(1000, rel=1e-3)
    assert {low for low, _ in trace(scope, "bar.UO2")} == {0, 1}
    assert value(scope, "following") is True
    assert value(scope, "view.end") == scope.get("now")
    scope.picture("scope")


def test_frames_come_while_the_cell_runs_and_none_while_it_stands(scope: Window) -> None:
    frames(scope, 5)
    held_at(scope, 1.0)
    before = scope.page.locator(".scope").get_attribute("data-frames")
    scope.call("step_event")
    scope.until("(before) => document.querySelector('.scope').dataset.frames !== before", before)


def test_traces_are_added_and_removed_and_remembered(scope: Window) -> None:
    scope.page.locator(".scope-traces summary").click()
    scope.page.get_by_label("search traces").fill("drill.ramp")
    scope.page.locator(".scope-list label:visible").first.click()
    scope.page.locator('[data-trace="drill.RAMP"]').wait_for()
    scope.page.keyboard.press("Escape")
    scope.page.locator('[data-trace="bar.position"]').hover()
    scope.click("remove bar.position")
    assert scope.page.locator('[data-trace="bar.position"]').count() == 0
    scope.page.reload()
    scope.page.locator('[data-trace="drill.RAMP"]').wait_for()
    assert scope.page.locator('[data-trace="bar.position"]').count() == 0


def test_the_wheel_zooms_about_the_pointer_and_a_drag_pans(scope: Window) -> None:
    held_at(scope, 5)
    drag(scope, (0.2, 150), (0.3, 150))
    scope.until(f"() => !{SCOPE}.following && {SCOPE}.input.drag === null")
    before = value(scope, "view")
    drag(scope, (0.5, 150), (0.4, 150))
    scope.until(f"(begin) => {SCOPE}.view.begin > begin && {SCOPE}.input.drag === null", before["begin"])
    panned = value(scope, "view")
    assert panned["end"] - panned["begin"] == pytest.approx(before["end"] - before["begin"])
    box = scope.page.locator(".scope canvas").bounding_box()
    scope.page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 150)
    place = f"{SCOPE}.plot.t({SCOPE}.view, 0.25 * {box['width']})"
    there = scope.page.evaluate(place)
    scope.page.mouse.wheel(0, -400)
    scope.until(f"(span) => {SCOPE}.view.end - {SCOPE}.view.begin < span * 0.7", panned["end"] - panned["begin"])
    assert scope.page.evaluate(place) == pytest.approx(there, abs=5e6)  # a pixel
    scope.page.get_by_role("button", name="Follow the present").click()
    assert value(scope, "following") is True


def test_a_drag_on_the_time_axis_shows_just_that_range(scope: Window) -> None:
    held_at(scope, 5)
    view, width = value(scope, "view"), value(scope, "plot.width")
    box = scope.page.locator(".scope canvas").bounding_box()
    drag(scope, (0.25, 10), (0.5, 10))
    left, right = (view["begin"] + part * box["width"] / width * (view["end"] - view["begin"]) for part in (0.25, 0.5))
    scope.until(f"(begin) => {SCOPE}.view.begin !== begin && {SCOPE}.input.drag === null", view["begin"])
    zoomed = value(scope, "view")
    assert zoomed["begin"] == pytest.approx(left, abs=2e7)
    assert zoomed["end"] == pytest.approx(right, abs=2e7)


def test_two_cursors_show_times_and_values_with_their_differences(scope: Window) -> None:
    """Between two calls of the drill lie 120 steps of the bar (datasheet, example 2)."""
    held_at(scope, 5)
    rises = scope.page.evaluate("""async () => {
        const scope = document.querySelector('.scope').scope;
        const found = [];
        for (let from = 0; found.length < 2;) {
            scope.feed.say({find: {source: 'bar.UO2', edge: 'rise', from, direction: 1}});
            const hear = scope.hear.bind(scope);
            from = await new Promise(resolve => { scope.hear = news => resolve(news.found); });
            scope.hear = hear;
            found.push(from);
        }
        return found;
    }""")
    scope.page.get_by_role("button", name="Two cursors with their differences").click()
    for index, at in enumerate(rises):
        scope.page.evaluate(f"([index, at]) => {SCOPE}.moveCursor(index, at)", [index, at])
    cell = scope.page.locator('[data-trace="bar.position"] .scope-value')
    scope.until(
        "() => document.querySelector('[data-trace=\"bar.position\"] .scope-value').textContent.includes('\u0394 120')"
    )
    assert cell.inner_text().split()[0] == "250"
    strip = scope.page.locator(".scope-strip").inner_text()
    assert "\u0394t" in strip
    assert "Hz" in strip
    scope.page.get_by_role("button", name="All: everything since the beginning").click()
    scope.until(f"() => {SCOPE}.view.begin < {SCOPE}.cursors[0]")
    scope.picture("scope-cursors")
    before = value(scope, "cursors[1]")
    width = value(scope, "plot.width")
    box = scope.page.locator(".scope canvas").bounding_box()
    at = scope.page.evaluate(f"{SCOPE}.plot.x({SCOPE}.view, {SCOPE}.cursors[1])")
    drag(scope, (at / box["width"], 200), ((at - 0.1 * width) / box["width"], 200))
    scope.until(f"(before) => {SCOPE}.cursors[1] < before", before)


def test_a_trigger_on_a_pin_holds_the_view_and_finds_the_next_edge(scope: Window) -> None:
    scope.until("() => detent.get('now') > 3.5e9")
    scope.page.locator(".scope-trigger summary").click()
    scope.page.get_by_label("trigger source").select_option("bar.UO2")
    scope.page.get_by_label("trigger mode").select_option("normal")
    view = value(scope, "view")
    span = view["end"] - view["begin"]
    scope.until(f"() => {SCOPE}.frame.trigger !== null && {SCOPE}.frame.trigger !== undefined")
    begin, at = scope.page.evaluate(f"() => [{SCOPE}.view.begin, {SCOPE}.frame.trigger]")
    assert begin == pytest.approx(at - span / 4, abs=10)
    scope.page.get_by_label("trigger mode").select_option("off")
    scope.call("hold")
    scope.page.get_by_role("button", name="Go to the trigger before").click()
    scope.until(f"() => !{SCOPE}.following")
    first = value(scope, "view.begin")
    scope.page.get_by_role("button", name="Go to the trigger before").click()
    scope.until(f"(first) => {SCOPE}.view.begin < first", first)
    # an edge stands at the quarter: low before, high behind
    scope.until(f"() => {SCOPE}.frame.from === Math.round({SCOPE}.view.begin)")
    before, behind = scope.page.evaluate(
        "() => { const {frame, view} = " + SCOPE + ", {low} = frame.traces.find(({id}) => id === 'bar.UO2');"
        " const at = Math.floor((view.begin + (view.end - view.begin) / 4 - frame.begin) / frame.width);"
        " return [low[at - 2], low[at + 2]]; }"
    )  # fmt: skip
    assert (before, behind) == (0, 1)


def test_an_error_is_found_as_a_trigger(scope: Window) -> None:
    scope.call("type", "bar", "Q7")  # Q takes no argument: E2
    scope.until("() => detent.get('u.bar.error') !== null")
    scope.call("hold")
    scope.page.locator(".scope-trigger summary").click()
    scope.page.get_by_label("trigger source").select_option("error")
    scope.page.get_by_role("button", name="Go to the trigger before").click()
    scope.until("() => document.querySelector('.scope-trigger output').textContent.startsWith('at')")
    error = scope.get("u.bar.errorat")
    view = value(scope, "view")
    assert view["begin"] == pytest.approx(error - (view["end"] - view["begin"]) / 4, abs=10)


def exported(window: Window, kind: str) -> bytes:
    window.page.locator(".scope-export summary").click()
    with window.page.expect_download() as download:
        window.page.locator(f".scope-file[data-kind={kind}]").click()
    assert download.value.suggested_filename.endswith(f".{kind}")
    return Path(download.value.path()).read_bytes()


def test_the_vcd_export_has_the_wires_with_their_edges(scope: Window) -> None:
    held_at(scope, 3)
    text = exported(scope, "vcd").decode()
    header, _, body = text.partition("$enddefinitions $end")
    assert "$timescale 1 ns $end" in header
    variables = [line.split() for line in header.splitlines() if line.startswith("$var")]
    codes = {name: code for _, _, _, code, name, *_ in variables}
    assert {"UO1", "UO2", "MOV"} <= set(codes)
    times = [int(line[1:]) for line in body.splitlines() if line.startswith("#")]
    assert times == sorted(times)
    assert len(times) > 20


def test_the_csv_export_has_the_traces_that_are_shown(scope: Window) -> None:
    held_at(scope, 3)
    rows = exported(scope, "csv").decode().splitlines()
    shown = value(scope, "shown")
    assert all(any(key in cell for cell in rows[0].split(",")) for key in shown)
    assert len(rows) > 20
    assert {len(row.split(",")) for row in rows} == {len(rows[0].split(","))}


def test_the_png_export_is_a_picture_of_what_is_seen(scope: Window) -> None:
    held_at(scope, 3)
    data = exported(scope, "png")
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, at = [], 8
    while at < len(data):
        (length,) = struct.unpack_from(">I", data, at)
        name, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", data, at + 8 + length)[0] == zlib.crc32(name + body)
        chunks.append((name, body))
        at += 12 + length
    width, height, depth, colour = struct.unpack_from(">IIBB", chunks[0][1])
    assert width > value(scope, "plot.width")  # the labels stand beside it
    pixels = zlib.decompress(b"".join(body for name, body in chunks if name == b"IDAT"))
    assert len(pixels) == height * (1 + width * {2: 3, 6: 4}[colour] * depth // 8)
    assert len(set(pixels)) > 20


def test_a_motor_has_currents_angle_and_torque(windows: Windows, serve: Any) -> None:
    window = windows.new(serve(CLOSED_LOOP)).open()
    at_scope(window)
    ids = window.page.evaluate(f"() => {SCOPE}.catalogue.map(({{id}}) => id)")
    assert {"slide.current_a", "slide.current_b", "slide.torque", "slide.place"} <= set(ids)
    for key in ("slide.current_a", "slide.current_b"):
        window.page.evaluate(f"(key) => {SCOPE}.show(key, true)", key)
    assert value(window, "plot.lanes.find(({name}) => name === 'slide.current').traces.length") == 2


def test_two_fingers_zoom_on_a_phone(windows: Windows, workbench: Served) -> None:
    window = at_scope(begun(windows.new(workbench, size=PHONE)))
    held_at(window, 3)
    box = window.page.locator(".scope canvas").bounding_box()
    session = window.page.context.new_cdp_session(window.page)
    lane = value(window, "plot.lanes[0]")
    y = box["y"] + lane["top"] + 0.8 * lane["height"]  # below its label, in which there is a button

    def touch(kind: str, *places: float) -> None:
        points = [{"x": box["x"] + x, "y": y, "id": k} for k, x in enumerate(places)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    view = value(window, "view")
    for places in ((150,), (150, 200)):
        touch("touchStart", *places)
        window.until(f"(fingers) => {SCOPE}.input.pointers.size === fingers", len(places))
    touch("touchMove", 100, 250)
    touch("touchMove", 75, 275)
    quarter = (view["end"] - view["begin"]) / 4
    window.until(f"(span) => Math.abs({SCOPE}.view.end - {SCOPE}.view.begin - span) < 0.02 * span", quarter)
    touch("touchEnd")
    window.until(f"() => {SCOPE}.input.pointers.size === 0")
    assert value(window, "following") is False


@pytest.mark.parametrize(("size", "theme"), LOOKS)
def test_the_page_fits_its_window(windows: Windows, workbench: Served, size: tuple[int, int], theme: str) -> None:
    window = at_scope(begun(windows.new(workbench, size=size, theme=theme)))
    held_at(window, 4.2)
    window.until("(width) => document.documentElement.scrollWidth <= width", size[0])
    window.picture(f"scope-{size[0]}-{theme}")
    window.page.locator(".scope-traces summary").click()
    panel = window.page.locator(".scope-traces .scope-panel").bounding_box()
    assert panel["x"] >= 0
    assert panel["x"] + panel["width"] <= size[0]
    window.picture(f"scope-traces-{size[0]}-{theme}")
