"""The workbench: what a host at a pseudo-terminal notices of it, and what the scope costs.

A program in a process of its own asks the drilling cell for its status, with the cell on the workbench - the state
pushed and three traces of 2 000 points made twenty times a second - and served alone, in short turns.
"""

import asyncio
import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter

from bench.rows import Row, measure
from detent.ticks import SECOND
from detent.workbench.client import Bench

DRILLING = Path(__file__).parents[1] / "examples" / "drilling" / "cell.toml"
TRACES = ("bar.position", "drill.speed", "bar.UO2")
TURNS, REPLIES = 10, 150
POINTS = 2_000

_HOST = """
import os, sys, time, tty
terminal = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
tty.setraw(terminal)
for line in sys.stdin:
    times = []
    for _ in range(int(line)):
        begin = time.perf_counter_ns()
        os.write(terminal, b"FV\\r")
        wanted = 3
        while wanted > 0:
            wanted -= len(os.read(terminal, 16))
        times.append(time.perf_counter_ns() - begin)
        time.sleep(0.0005)
    print(*times, flush=True)
"""


def rows() -> list[Row]:
    alone, shown = asyncio.run(_replies())
    draw, fresh = asyncio.run(_drawing())
    return [
        Row("reply to F, workbench open", _at(shown, 50), "us", "closed", _at(alone, 50), 1.5 * _at(alone, 50)),
        Row("the same, 99 % of them", _at(shown, 99), "us", "closed", _at(alone, 99), None),
        Row("3 traces x 2 000 points, following", draw * 1e3, "ms", "all made anew", fresh * 1e3, 10),
    ]


def _at(times: list[int], percent: int) -> float:
    """Microseconds that so many percent of the replies took at most."""
    return sorted(times)[len(times) * percent // 100] / 1e3 if percent != 50 else median(times) / 1e3


async def _replies() -> tuple[list[int], list[int]]:
    """Reply times in ns: of the cell served alone, and on the workbench."""
    with tempfile.TemporaryDirectory() as folder:
        served = subprocess.Popen(
            [sys.executable, "-m", "detent", "serve", str(DRILLING), "--no-line-timing", "--json", "--state", folder],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        bench = await Bench.open(str(DRILLING), line_timing=False)
        assert served.stdout is not None
        try:
            alone = json.loads(await asyncio.to_thread(served.stdout.readline))["endpoints"][0]["address"]
            shown = bench.picture.lines["bar"].endpoints[0].address
            stop = bench.on_change(lambda: _draw(bench))
            hosts = [_host(alone), _host(shown)]
            times: list[list[int]] = [[], []]
            for _ in range(TURNS):
                for host, measured in zip(hosts, times, strict=True):
                    measured += await asyncio.to_thread(_ask, host)
            for host in hosts:
                host.communicate()
            stop()
        finally:
            served.send_signal(signal.SIGTERM)
            await asyncio.to_thread(served.communicate)
            await bench.close()
    return times[0], times[1]


def _host(address: str) -> "subprocess.Popen[str]":
    return subprocess.Popen([sys.executable, "-c", _HOST, address], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                            text=True)  # fmt: skip


def _ask(host: "subprocess.Popen[str]") -> list[int]:
    assert host.stdin is not None
    assert host.stdout is not None
    host.stdin.write(f"{REPLIES}\n")
    host.stdin.flush()
    return [int(word) for word in host.stdout.readline().split()]


def _draw(bench: Bench) -> None:
    end = bench.state.end
    bench.scope(TRACES, end - 4 * SECOND, end, POINTS)


async def _drawing() -> tuple[float, float]:
    """Seconds for the traces while one looks on, and when everything is made anew."""
    bench = await Bench.open(str(DRILLING), pace=1)
    try:
        await bench.until(lambda state: state.now > 1 * SECOND)
        following: list[float] = []
        for _ in range(20):
            await bench.changed()
            following.append(measure(lambda: _draw(bench), 1))
        fresh = await _fresh(bench, lambda: _draw(bench))
        return median(following), fresh
    finally:
        await bench.close()


async def _fresh(bench: Bench, draw: Callable[[], None]) -> float:
    """The same with another past, of which nothing is known yet."""
    await bench.hold()
    times = []
    for _ in range(5):
        await bench.rewind(bench.state.end - 1)
        await bench.set_switch("stop", 1)  # the past is cut: nothing that was made holds
        begin = perf_counter()
        draw()
        times.append(perf_counter() - begin)
    return median(times)
