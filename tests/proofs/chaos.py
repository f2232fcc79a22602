"""``make chaos``: what comes between: kills, failing calls, power failures, full disks, stopped processes, bad lines.

Each row is a kind of mishap, how often it came, and what was wrong afterwards: nothing, if all is well.
"""

import json
import os
import re
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

from tests.hosts import test_alike as drivers
from tests.proofs import saves
from tests.realtime.boards import test_failures as boards
from tests.realtime.boards import test_wire as wire
from tests.realtime.ticking import Client, TickingCell, Wall

from detent.realtime.loop import Loop
from detent.realtime.pace import Pace
from detent.ticks import MS, SECOND

NOISE: Final = ("random", "frames", "prompts", "letters", "nulls", "lines")
READY: Final = "Ctrl-C ends it"  # what a server says when it may be used
ENDS_WITHIN: Final = 2.0  # seconds, of whatever is served and gets SIGTERM, on a computer with nothing else to do


class Row(NamedTuple):
    """A kind of mishap: how often it came, what was wrong, and what else there is to say."""

    name: str
    tries: int
    wrong: list[str]
    note: str = ""


def rows(scale: int, folder: Path) -> Iterator[Row]:
    """Every kind; `scale` is how much of each, 1 for the short form and 40 for the full one."""
    for name, store in saves.STORES.items():
        place = folder / re.sub(r"\W+", "-", name)
        place.mkdir()
        yield _many(f"SIGKILL: {name}", 9 * scale, lambda n, s=store, p=place: saves.killed(s, p, Random(n)))
    for name, once in (("every call of a save fails", saves.every_call_fails),
                       ("power failure behind every step of a save", saves.power_fails),
                       ("full disk", saves.disk_is_full), ("vanished folder", saves.folder_vanishes)):  # fmt: skip
        yield _once(name, lambda once=once: once(folder / "store"))
    yield _many("jumping clock", 5 * scale, the_clock_jumps)
    yield _once("stopped (SIGSTOP), and on again", lambda: a_server_is_stopped(folder, min(scale * 1.5, 60.0)))
    yield _once("two servers, one state, one link", lambda: two_servers(folder))
    yield _ends(folder)
    yield _many("board link through a bad proxy", 5 * scale, lambda n: wire.converse(n, 0.25))
    yield _many("motion over a bad board link", 1 + scale // 4, boards.test_a_bad_wire_costs_no_step)
    yield _many("driver before a device that babbles or lies", len(drivers.DRIVERS) * len(NOISE), _babbles)


def _many(name: str, tries: int, once: Callable[[int], object]) -> Row:
    wrong = []
    for number in range(tries):
        try:
            once(number)
        except Exception as error:
            wrong.append(f"{number}: {_told(error)}")
    return Row(name, tries, wrong)


def _once(name: str, once: Callable[[], int]) -> Row:
    try:
        return Row(name, once(), [])
    except Exception as error:
        return Row(name, 1, [_told(error)])


def _told(error: Exception) -> str:
    where = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {str(error)[:300]} ({Path(where.filename).name}:{where.lineno})"


# -- time ----------------------------------------------------------------------------------------------------


def the_clock_jumps(seed: int) -> None:
    """A computer that sleeps, or does something else for long: every deadline is served, late, in its order."""
    draw = Random(seed)
    wall = Wall(seed)
    cell, client = TickingCell(MS), Client()
    pace = Pace(clock=wall)
    loop = Loop(cell, pace, [(0, client)], wait=wall.wait)
    began, jumped = wall.now, 0
    while cell.ticks < 3000:
        if draw.random() < 0.02:
            jumped += (jump := draw.choice((MS // 7, 30 * MS, SECOND)))
            wall.now += jump
        loop.step()
    while cell.ticks < (wall.now - began) // MS:  # what it is behind
        loop.step()
    loop.close()
    assert cell.ticks == client.heard, "a tick that no client heard"
    assert pace.lateness.count == cell.ticks
    assert not jumped or pace.lateness.most >= MS // 8


# -- servers -------------------------------------------------------------------------------------------------


@contextmanager
def served(
    *words: str, verb: str = "serve", ready: str = "Ctrl-C ends it"
) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A server of this project that runs, and what it has said."""
    command = [sys.executable, "-m", "detent", verb, *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    said = ""
    assert process.stdout is not None
    try:
        while not re.search(ready, said):
            line = process.stdout.readline()
            assert line, f"{' '.join(command)} ended: {said}"
            said += line
        yield process, said
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def a_server_is_stopped(folder: Path, seconds: float) -> int:
    """It is let stand for a while: then it answers as before, and has lost nothing that it was sent meanwhile."""
    with served("gs-c200", "--strap", "CHS=low", "--tcp", "127.0.0.1:0", "--state", str(folder / "stop")) as (
        process,
        said,
    ):
        host, port = re.search(r"TCP ([\d.]+):(\d+)", said).groups()  # type: ignore[union-attr]
        client = socket.create_connection((host, int(port)), timeout=60)
        _exchange(client, b"V1\r", b"V0\r")
        process.send_signal(signal.SIGSTOP)
        client.sendall(b"S20\rV1\r")
        time.sleep(seconds)
        process.send_signal(signal.SIGCONT)
        heard = b""
        while heard.count(b"\r") < 2:
            heard += client.recv(100)
        assert heard == b"Y\rV0\r", heard
        client.close()
    return 1


def _exchange(client: socket.socket, said: bytes, answer: bytes) -> None:
    client.sendall(said)
    heard = b""
    while len(heard) < len(answer):
        heard += client.recv(100)
    assert heard == answer, heard


def two_servers(folder: Path) -> int:
    """The second is told so in a line, and the first goes on."""
    link, state = folder / "link", str(folder / "shared")
    with served("gs-c200", "--strap", "CHS=low", "--pty", str(link), "--state", state):
        for words in (["--state", state], ["--state", f"{state}2", "--pty", str(link)]):
            command = [sys.executable, "-m", "detent", "serve", "gs-c200", *words]
            second = subprocess.run(command, capture_output=True, text=True, timeout=120)
            assert second.returncode == 2, second
            assert second.stderr.count("\n") == 1, second.stderr
        client = os.open(link, os.O_RDWR | os.O_NOCTTY)
        os.write(client, b"V1\r")
        heard = b""
        while len(heard) < 3:
            heard += os.read(client, 10)
        os.close(client)
        assert heard == b"V0\r"
    return 2


SERVERS: Final = (
    ("serve", ["gs-c200", "--tcp", "127.0.0.1:0", "--pty"], "Ctrl-C ends it"),
    ("serve", ["bs0610", "--rfc2217", "127.0.0.1:0", "--control", "127.0.0.1:0"], "Ctrl-C ends it"),
    ("serve", ["dcb-274", "--pace", "100000", "--tcp", "127.0.0.1:0", "--control", "127.0.0.1:0"], "Ctrl-C ends it"),
    ("workbench", ["gs-c200", "--port", "0"], "Ctrl-C"),
    ("epics", ["gs-c200", "--interfaces", "127.0.0.1", "--ca-port", "FREE"], "Ctrl-C|caput"),
)
ASKING: Final = (
    b"", b"GET /st", b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b'POST /wait HTTP/1.1\r\nHost: localhost\r\nContent-Length: 13\r\n\r\n{"time": 1e9}',
    b'POST /step HTTP/1.1\r\nHost: localhost\r\nContent-Length: 13\r\n\r\n{"time": 1e7}',
)  # fmt: skip


def _ends(folder: Path) -> Row:
    """SIGTERM ends whatever is served, whatever its clients are about."""
    wrong, slowest = [], 0.0
    for number, (verb, words, ready) in enumerate(SERVERS):
        with suppress(ModuleNotFoundError):
            state = [] if verb == "epics" else ["--state", str(folder / f"end{number}")]
            try:
                took = _ended(verb, [_free_port() if word == "FREE" else word for word in (*words, *state)], ready)
            except Exception as error:
                wrong.append(f"{verb} {' '.join(words)}: {_told(error)}")
                continue
            slowest = max(slowest, took)
    return Row("SIGTERM with clients in every stage", len(SERVERS), wrong,
               f"the slowest took {slowest:.2f} s of {ENDS_WITHIN:g} s")  # fmt: skip


def _ended(verb: str, words: list[str], ready: str) -> float:
    with served(*words, verb=verb, ready=ready) as (process, said):
        clients: list[Any] = []
        for host, port in re.findall(r"(127\.0\.0\.1)[: ](\d+)", said):
            for asking in ASKING:
                with suppress(OSError):
                    client = socket.create_connection((host, int(port)), timeout=5)
                    client.sendall(asking)
                    clients.append(client)
        clients += map(_flooded, re.findall(r"/dev/\S+", said))
        began = time.monotonic()
        process.terminate()
        code = process.wait(60)
        took = time.monotonic() - began
        assert code == 0, f"it ended with {code}"
        assert took < 10 * ENDS_WITHIN, f"it took {took:.1f} s"
        for client in clients:
            client.close() if isinstance(client, socket.socket) else os.close(client)
        return took


def _free_port() -> str:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return str(server.getsockname()[1])


def _flooded(device: str) -> int:
    descriptor = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    with suppress(BlockingIOError):
        while select.select([], [descriptor], [], 0)[1]:
            os.write(descriptor, b"F\r" * 100)
    return descriptor


# -- lines ---------------------------------------------------------------------------------------------------


def _babbles(number: int) -> None:
    models = list(drivers.DRIVERS)
    drivers.test_every_call_on_a_line_that_babbles_ends_in_time_with_a_short_error(
        models[number % len(models)], NOISE[number // len(models)]
    )


# -- the command ---------------------------------------------------------------------------------------------


def run(scale: int, tell: Callable[[str], None]) -> list[Row]:
    """All of it, in a folder of its own; `tell` hears of each row when it is done."""
    folder = Path(tempfile.mkdtemp(prefix="detent-chaos-"))
    found = []
    try:
        for row in rows(scale, folder):
            found.append(row)
            tell(f"{row.name}: {row.tries}, {len(row.wrong)} wrong")
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return found


def print_table(found: list[Row]) -> None:
    """A row a kind of mishap; what was wrong stands below."""
    print(f"{'':52}{'times':>8}{'wrong':>8}")
    for row in found:
        print(f"{row.name:52}{row.tries:8,}{len(row.wrong):8,}  {row.note}".rstrip())
    for row in found:
        for wrong in row.wrong[:5]:
            print(f"{row.name}: {wrong}")
    print(json.dumps({"rows": len(found), "times": sum(row.tries for row in found),
                      "wrong": sum(len(row.wrong) for row in found)}))  # fmt: skip
