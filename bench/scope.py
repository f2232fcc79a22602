"""The Scope page in a real browser: how many frames a second it paints, and what share of a processor they cost.

The workbench with the drilling cell serves it in its two processes (pages, cell); a window without a screen shows three
traces in 2 000 columns and follows the present. The baseline is the same workbench with nobody looking.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from bench.rows import Row

TRACES = ["bar.position", "bar.speed", "drill.speed"]
POINTS = 2_000
SECONDS = 6.0
FRAMES = 19.0  # a second, at least: the cell tells its state 20 times a second
_SCOPE = "document.querySelector('.scope')"


def rows() -> list[Row]:
    chromium = next((path for name in ("chromium", "google-chrome") if (path := shutil.which(name))), None)
    if chromium is None:
        print("no chromium on this machine: nothing measured")
        return []
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "detent", "workbench", "--json", "--folder", folder, "--state", folder]
        served = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert served.stdout is not None
        try:
            url = json.loads(served.stdout.readline())["url"]
            idle = _share(served.pid)
            frames, busy, painting = _looked_at(chromium, url, served.pid)
        finally:
            served.send_signal(signal.SIGTERM)
            served.communicate()
    return [
        Row("frames, 3 traces x 2 000 points", frames, "1/s", "told by the cell", 20.0, FRAMES),
        Row("share of a processor, pages and cell", 100 * busy, "%", "nobody looks", 100 * idle, None),
        Row("painting a frame in the browser", painting, "ms", "a frame's time", 50.0, 10.0),
    ]


def _looked_at(chromium: str, url: str, pid: int) -> tuple[float, float, float]:
    """Frames a second, the share of a processor meanwhile, ms of script for a frame."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": POINTS + 260, "height": 900})
        page.add_init_script("localStorage.setItem('detent.tour', 'seen')")
        page.goto(urlsplit(url)._replace(path="/scope").geturl())
        page.wait_for_function(f"() => Number({_SCOPE}?.dataset.frames) > 0")
        page.evaluate(f"(shown) => {{ const {{scope}} = {_SCOPE}; scope.shown = shown; scope.arrange(); }}", TRACES)
        page.wait_for_function(f"() => {_SCOPE}.scope.frame.traces.length === 3")
        columns = page.evaluate(f"() => {_SCOPE}.scope.plot.width")
        assert columns >= POINTS, columns
        before = _frames(page)
        begin = time.perf_counter()
        share = _share(pid)
        frames = (_frames(page) - before) / (time.perf_counter() - begin)
        painting = page.evaluate(
            f"""() => {{ const {{scope}} = {_SCOPE}, begin = performance.now();
            for (let k = 0; k < 50; k++) scope.plot.paint(scope.view, scope.frame, scope.cursors, null);
            return (performance.now() - begin) / 50; }}"""
        )
        browser.close()
    return frames, share, float(painting)


def _frames(page: Any) -> int:
    return int(page.get_attribute(".scope", "data-frames"))


def _share(pid: int) -> float:
    """The part of one processor that a process and its children take, over some seconds."""
    before, begin = _used(pid), time.perf_counter()
    time.sleep(SECONDS)
    return (_used(pid) - before) / (time.perf_counter() - begin)


def _used(pid: int) -> float:
    """Seconds of processor that a process and its children have taken."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    ticks = int(fields[11]) + int(fields[12])
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return ticks / os.sysconf("SC_CLK_TCK") + sum(_used(int(child)) for child in children)
