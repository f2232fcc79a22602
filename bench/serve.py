"""Serving in real time: the reply over a pseudo-terminal, the lateness of deadlines, the idle load.

What is measured and its baseline take short turns, so that both see the same machine.
"""

import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
import tty
from pathlib import Path
from statistics import median

from bench.rows import Row, print_table
from detent.cell.description import single
from detent.realtime.loop import wake_exactly
from detent.realtime.pace import Lateness
from detent.realtime.service import Service
from detent.ticks import MS, SECOND

TURNS, REPLIES = 20, 100
TURN = 250 * MS  # of the cell, then of the bare timer
IDLE_SECONDS = 3

_ECHO = """
import os, pty, tty
ours, theirs = pty.openpty()
tty.setraw(theirs)
print(os.ttyname(theirs), flush=True)
while True:
    os.write(ours, os.read(ours, 256))
"""


def rows() -> list[Row]:
    reply, echo = _replies()
    late, timer = _lateness()
    return [
        Row("reply to F over a pseudo-terminal", reply, "us", "bare echo", echo, 2 * echo),
        Row("lateness of deadlines, 99 % of them", late / MS, "ms", "bare timer, 99 %", timer / MS, 0.5),
        Row("processor time while idle", _idle(), "%", "all of it", 100, 1),
    ]


def _replies() -> tuple[float, float]:
    """Median time in microseconds of a reply, and of an echo of the same two characters."""
    with tempfile.TemporaryDirectory() as folder:
        served = _serve(folder)
        echoing = subprocess.Popen([sys.executable, "-c", _ECHO], stdout=subprocess.PIPE, text=True)
        assert echoing.stdout is not None
        try:
            terminals = [_open(_address(served)), _open(echoing.stdout.readline().strip())]
            times: list[list[int]] = [[], []]
            for _ in range(TURNS):
                for terminal, measured in zip(terminals, times, strict=True):
                    measured += [_exchange(terminal) for _ in range(REPLIES)]
            for terminal in terminals:
                os.close(terminal)
        finally:
            for process in (served, echoing):
                process.send_signal(signal.SIGTERM)
                process.communicate()
        reply, echo = (median(measured) / 1e3 for measured in times)
        return reply, echo


def _exchange(terminal: int) -> int:
    """Nanoseconds from sending ``F`` to the two characters that come back: ``R`` CR, or the echo."""
    begin = time.perf_counter_ns()
    os.write(terminal, b"F\r")
    wanted = 2
    while wanted > 0:
        wanted -= len(os.read(terminal, 16))
    return time.perf_counter_ns() - begin


def _lateness() -> tuple[int, int]:
    """99th percentiles in ns: of a module that executes an instruction a millisecond, and of a bare timer."""
    with Service(single("gs-c200", straps={"CHS": "low"}), _no_file) as service:
        # a program without an end: 1 ms an instruction
        for line in ("P", "A1", "C1", "U1", "E"):
            service.cell.type("gs-c200", line)
            service.cell.run_to(service.cell.now + 100 * MS)
        assert service.cell.next_event() is not None
        wake_exactly()
        timer = Lateness()
        for _ in range(TURNS):
            service.restart_clock()
            end = time.monotonic_ns() + TURN
            while time.monotonic_ns() < end:
                service.step()
            _timer(timer)
        assert service.lateness().deadlines > TURNS * TURN // MS // 2
        return service.lateness().p99, timer.percentile(99)


def _timer(lateness: Lateness) -> None:
    """One turn of a millisecond timer: select, and nothing else."""
    due = time.monotonic_ns()
    end = due + TURN
    while due < end:
        due += MS
        while (left := due - time.monotonic_ns()) > 0:
            select.select((), (), (), left / SECOND)
        lateness.note(time.monotonic_ns() - due)


def _no_file(name: str) -> str:
    raise FileNotFoundError(name)


def _idle() -> float:
    """Percent of a processor that a served module takes when nobody talks to it."""
    with tempfile.TemporaryDirectory() as folder:
        served = _serve(folder)
        try:
            _address(served)
            before = _processor_seconds(served.pid)
            time.sleep(IDLE_SECONDS)
            used = _processor_seconds(served.pid) - before
        finally:
            served.send_signal(signal.SIGTERM)
            served.communicate()
        return 100 * used / IDLE_SECONDS


def _serve(folder: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", "import sys; from detent.cli import main; main(sys.argv[1:])"]
    choices = ["serve", "gs-c200", "--no-line-timing", "--strap", "CHS=low", "--state", folder, "--json"]
    return subprocess.Popen([*command, *choices], stdout=subprocess.PIPE, text=True)


def _address(served: subprocess.Popen[str]) -> str:
    assert served.stdout is not None
    return str(json.loads(served.stdout.readline())["endpoints"][0]["address"])


def _open(path: str) -> int:
    terminal = os.open(path, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(terminal)
    return terminal


def _processor_seconds(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    print_table(rows())
