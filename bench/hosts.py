"""Exchanges a second of the drivers, over a pseudo-terminal without line timing.

Against bare pyserial with the same bytes: it writes a question and reads as many bytes as the answer has. Both take
short turns at the same served unit, so that they see the same machine. What the unit itself needs is part of both.
"""

import asyncio
import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import median
from typing import NamedTuple

import serial  # type: ignore[import-untyped]

from bench.rows import Row, print_table
from detent.realtime.connect import connect, connect_async

TURNS, EXCHANGES = 8, 100


class Question(NamedTuple):
    """A call of a driver, and the same as bytes: what goes out in parts, each with the length of its answer."""

    model: str
    call: str
    parts: tuple[tuple[bytes, int], ...]


QUESTIONS = (
    Question("gs-c200", "position", ((b"V1\x17\r", 4),)),
    # character by character, each when the echo of the last has come (page 25)
    Question("dcb-274", "moving_status", ((b"^", 1), (b"\r", 6))),
    Question("bs0610", "position", ((b"X-1?", 11),)),
    Question("supersigma", "status", ((b"\x01\x05", 3),)),
)


def rows() -> list[Row]:
    measured = []
    for question in QUESTIONS:
        with _served(question.model) as address:
            turns = [[way(question, address) for way in (_driver, _coroutines, _bare)] for _ in range(TURNS)]
        driver, coroutines, bare = (1 / median(times) for times in zip(*turns, strict=True))
        name = f"{question.model} {question.call}()"
        measured.append(Row(f"{name}, driver", driver, "1/s", "bare pyserial", bare, bare / 2))
        measured.append(Row(f"{name}, driver with coroutines", coroutines, "1/s", "bare pyserial", bare, None))
    return measured


def _driver(question: Question, address: str) -> float:
    """Seconds of an exchange."""
    with connect(question.model, address) as unit:
        call: Callable[[], object] = getattr(unit, question.call)
        call()  # signs on, and knows from here on that nothing stale comes
        begin = time.perf_counter()
        for _ in range(EXCHANGES):
            call()
        return (time.perf_counter() - begin) / EXCHANGES


def _coroutines(question: Question, address: str) -> float:
    async def measure() -> float:
        async with await connect_async(question.model, address) as unit:
            call = getattr(unit, question.call)
            await call()
            begin = time.perf_counter()
            for _ in range(EXCHANGES):
                await call()
            return (time.perf_counter() - begin) / EXCHANGES

    return asyncio.run(measure())


def _bare(question: Question, address: str) -> float:
    with serial.Serial(address, 9600, timeout=10) as port:
        begin = time.perf_counter()
        for _ in range(EXCHANGES):
            for data, length in question.parts:
                port.write(data)
                answer = port.read(length)
                assert len(answer) == length, answer
        return (time.perf_counter() - begin) / EXCHANGES


@contextmanager
def _served(model: str) -> Iterator[str]:
    """A unit without line timing, in a process of its own; its address."""
    command = [sys.executable, "-c", "import sys; from detent.cli import main; main(sys.argv[1:])"]
    # commands of a DCB-274 take half a millisecond of their own, which is none of the driver's
    own = ["--set", "execution_times=off"] if model == "dcb-274" else []
    with tempfile.TemporaryDirectory() as folder:
        choices = ["serve", model, "--no-line-timing", "--state", folder, "--json", *own]
        with subprocess.Popen([*command, *choices], stdout=subprocess.PIPE, text=True) as served:
            assert served.stdout is not None
            address = str(json.loads(served.stdout.readline())["endpoints"][0]["address"])
            time.sleep(0.5)  # a board is deaf for a quarter of a second
            try:
                yield address
            finally:
                served.send_signal(signal.SIGTERM)
                served.communicate()


if __name__ == "__main__":
    print_table(rows())
