"""``make soak``: a day of virtual time and an hour of real time under noise: nothing grows, all is equal.

The virtual day is lived twice, by two processes: they must give the same pulses and the same last state, to the byte.
"""

import hashlib
import json
import os
import platform
import re
import resource
import select
import socket
import sys
import threading
import time
import urllib.request
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

from tests.controllers.laws.bench import Say
from tests.controllers.laws.models import MODELS
from tests.proofs.chaos import served

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.circuit import Oscillation
from detent.cell.description import parse
from detent.ticks import MS, SECOND, Ns

BY_NAME: Final = {model.name: model for model in MODELS}
MOST_GROWTH: Final = 24 << 20  # bytes, from the first tenth on
SAID: Final = (b"V1\r", b"+40\r", b"F\r", b"K\r", b" ", b"Z\r", b"X10G", b"\x02\x01\x0b\0")  # of clients
CELL: Final = """
[units.bar]
model = "gs-c200s"
straps = { SEL0 = 0, CHS = 0 }
[units.drill]
model = "gs-c200"
straps = { SEL1 = 0, CHS = 0 }
[units.slide]
model = "dcb-274"
[units.desk]
model = "bs0610"
[units.drive]
model = "supersigma"
[units.watch]
model = "step-detector"
[lines.bus]
units = ["bar", "drill"]
[lines.slide]
units = ["slide"]
[lines.desk]
units = ["desk"]
[lines.drive]
units = ["drive"]
[[wires]]
from = "bar.UO1"
to = "drill.UI1"
[[wires]]
from = "drill.CLOCK"
to = "watch.CLOCK"
[switches.end]
drives = "bar.EOT"
axis = "bar"
from = 900
[switches.home]
drives = "bar.HOME"
axis = "bar"
to = -40
[switches.hand]
drives = "drill.UI2"
"""


class Day(NamedTuple):
    """What a stretch of virtual time has come to."""

    pulses: dict[str, int]
    digest: str  # of the last state of everything
    lines: int  # said by the hosts
    grown: int  # bytes of memory, behind the first tenth
    largest: int  # bytes of memory, at most
    took: float  # seconds


def _no_file(name: str) -> str:
    raise FileNotFoundError(name)


def virtual(time_: Ns, seed: int, tell: Callable[[str], None]) -> Day:
    """Live through so much time, from number `seed`."""
    draw = Random(seed)
    cell = build(parse(CELL, "soak.toml"), _no_file, record=False)
    began, told, lines, first = time.monotonic(), time.monotonic(), 0, 0
    digest = hashlib.sha256()
    while cell.now < time_:
        lines += _noise(cell, draw)
        cell.run_to(min(cell.now + draw.choice((20 * MS, 300 * MS, 2 * SECOND, 5 * SECOND)), time_))
        for line in cell.lines:
            digest.update(repr(line.take()).encode())
        if not first and cell.now > time_ // 10:
            first = memory()
        if time.monotonic() - told > 10:
            told = time.monotonic()
            share = cell.now / time_
            left = (told - began) * (1 / share - 1)
            tell(f"virtual: {cell.now / 3600 / SECOND:.1f} h, {share:.0%}, about {left / 60:.0f} min left")
    pulses = {}
    for name, controller in cell.controllers().items():
        for axis in controller.axes:
            status = controller.status(cell.now, axis)
            pulses[f"{name} {axis}".strip()] = status.pulses
            digest.update(repr((name, status, controller.registers(cell.now), controller.program_memory())).encode())
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
    return Day(pulses, digest.hexdigest(), lines, memory() - first, largest, time.monotonic() - began)


def _noise(cell: Cell, draw: Random) -> int:
    """A host says something, a hand is at a switch, a supply fails for a moment."""
    unit = draw.choice(cell.serial_units())
    model = getattr(cell.parts[cell.unit(unit)], "model", "")
    said = [action.text for action in BY_NAME[model].actions(draw) if isinstance(action, Say)]
    try:
        for text in said:
            cell.type(unit, text)
        if draw.random() < 0.05:
            cell.set_switch("hand", draw.randrange(2))
        if draw.random() < 0.003:
            cell.power(unit, False)
            cell.power(unit, True)
        if draw.random() < 0.02:
            cell.send(cell.wiring.line_of[cell.unit(unit)], draw.randbytes(draw.randint(1, 9)))
    except Oscillation as error:
        raise AssertionError(f"the cell of the soak swings: {error}") from error
    return len(said)


def memory(process: int = 0) -> int:
    """Bytes in memory of a process, or of this one."""
    text = Path(f"/proc/{process or 'self'}/status").read_text()
    return int(re.search(r"VmRSS:\s*(\d+)", text)[1]) << 10  # type: ignore[index]


class Hour(NamedTuple):
    """What a stretch of real time has come to."""

    lines: int
    answers: int
    grown: int
    descriptors: tuple[int, int]  # behind the first tenth, and at the end
    late: dict[str, int]


def real(seconds: float, folder: Path, tell: Callable[[str], None]) -> Hour:
    """Serve a cell for so long, with clients that come and go and say what they like."""
    cell = folder / "soak.toml"
    cell.write_text(CELL)
    words = [str(cell), "--tcp", "127.0.0.1:0", "--control", "127.0.0.1:0", "--state", str(folder / "state")]
    with served(*words) as (process, said):
        ports = [int(port) for port in re.findall(r"TCP 127\.0\.0\.1:(\d+)", said)]
        control = re.search(r"http://\S+", said)[0]  # type: ignore[index]
        ending = threading.Event()
        counts = [[0, 0] for _ in ports]
        clients = [threading.Thread(target=_client, args=(port, number, counts[number], ending))
                   for number, port in enumerate(ports)]  # fmt: skip
        for client in clients:
            client.start()
        began, first, before = time.monotonic(), 0, 0
        while (gone := time.monotonic() - began) < seconds:
            time.sleep(min(1.0, seconds / 20))
            with urllib.request.urlopen(f"{control}/state", timeout=60) as answer:
                state: dict[str, Any] = json.load(answer)
            assert "stopped" not in state, state["stopped"]
            if not first and gone > seconds / 10:
                first, before = memory(process.pid), _descriptors(process.pid)
            tell(f"real: {gone:.0f} of {seconds:.0f} s")
        ending.set()
        for client in clients:
            client.join()
        grown, after = memory(process.pid) - first, _descriptors(process.pid)
        return Hour(sum(c[0] for c in counts), sum(c[1] for c in counts), grown, (before, after), state["late_ns"])


def _descriptors(process: int) -> int:
    return len(list(Path(f"/proc/{process}/fd").iterdir()))


def _client(port: int, seed: int, count: list[int], ending: threading.Event) -> None:
    """Connects, says some lines, listens, and leaves, sometimes in the middle of a line."""
    draw = Random(seed)
    while not ending.is_set():
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=60) as client:
                for _ in range(draw.randint(1, 30)):
                    client.sendall(
                        draw.choice((b"V1\r", b"+40\r", b"F\r", b"K\r", b" ", b"Z\r", b"X10G", b"\x02\x01\x0b\0"))
                    )
                    count[0] += 1
                    if select.select([client], [], [], draw.choice((0.0, 0.02, 0.1)))[0]:
                        count[1] += bool(client.recv(4096))
                    if ending.is_set():
                        break
        except OSError:
            continue  # another client has it still


def aloud(text: str) -> None:
    """Tell how far it is, in a line that the next one overwrites."""
    print(text, end="   \r", file=sys.stderr)


def silent(_: str) -> None:
    """Do not tell how far it is: another one does, or nobody looks."""


def run(hours: float, seconds: float, folder: Path, tell: Callable[[str], None]) -> bool:
    """Both; prints the table. Whether all is well. `tell` is `aloud` or `silent`: it goes to another process."""
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as beside:
        lived = [beside.submit(virtual, round(hours * 3600) * SECOND, 1, each) for each in (tell, silent)]
        first, second = (one.result() for one in lived)
    hour = real(seconds, folder, tell)
    late = [f"{hour.late[name] / 1e6:.3f}" for name in ("p50", "p99", "most")]
    grown = max(first.grown, second.grown)
    same = (first.pulses, first.digest) == (second.pulses, second.digest)
    rows = [
        ("machine", f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
                    f"{time.strftime('%Y-%m-%d')}", True),
        ("virtual time", f"{hours:g} h, twice, side by side, in {first.took:.0f} and {second.took:.0f} s", True),
        ("lines of the hosts", f"{first.lines:,}", True),
        ("pulses", f"{sum(first.pulses.values()):,}", bool(sum(first.pulses.values()))),
        ("the second run", "equal in pulses, answers and state" if same else "other pulses, answers or state", same),
        ("memory behind the first tenth", f"{grown / 1e6:+.1f} MB", grown < MOST_GROWTH),
        ("real time", f"{seconds:g} s, {hour.lines:,} lines, {hour.answers:,} times answers", hour.answers > 0),
        ("memory behind the first tenth", f"{hour.grown / 1e6:+.1f} MB", hour.grown < MOST_GROWTH),
        ("descriptors", f"{hour.descriptors[0]}, then {hour.descriptors[1]}",
         hour.descriptors[1] <= hour.descriptors[0] + 8),
        ("lateness of deadlines", f"{hour.late['deadlines']:,}: {late[0]} ms (half), {late[1]} ms (99 %), "
                                  f"{late[2]} ms (all)", True),
        ("largest memory of a process", f"{max(first.largest, second.largest) / 1e6:.0f} MB", True),
    ]  # fmt: skip
    for name, told, well in rows:
        print(f"{name:34} {told}{'' if well else '   <- wrong'}")
    return all(well for _, _, well in rows)
