"""Work beside the loop of the pages."""

import asyncio
import subprocess
import sys
import threading

import pytest

from detent.workbench.beside import MOST, beside

ENDS = """
import asyncio, threading
from detent.workbench.beside import beside

async def main():
    begun = threading.Event()
    def for_ever():
        begun.set()
        threading.Event().wait()
    for _ in range(20):
        asyncio.create_task(beside(for_ever))
    while not begun.is_set():
        await asyncio.sleep(0)

asyncio.run(main())
"""


def test_what_is_done_beside_is_answered_or_raises() -> None:
    async def run() -> None:
        assert await beside(divmod, 7, 2) == (3, 1)
        with pytest.raises(ZeroDivisionError):
            await beside(divmod, 7, 0)
        assert sorted(await asyncio.gather(*(beside(pow, n, 2) for n in range(50)))) == [n * n for n in range(50)]

    asyncio.run(run())
    asyncio.run(run())  # another loop


def test_so_much_is_done_at_once_and_what_nobody_waits_for_any_more_is_not_begun() -> None:
    go_on, under_way, begun = threading.Event(), threading.Semaphore(0), []

    def held(number: int) -> None:
        begun.append(number)
        under_way.release()
        go_on.wait()

    async def run() -> None:
        tasks = [asyncio.create_task(beside(held, number)) for number in range(3 * MOST)]
        await asyncio.sleep(0)
        for _ in range(MOST):
            under_way.acquire()
        for task in tasks[MOST:]:
            task.cancel()
        await asyncio.wait(tasks[MOST:])
        go_on.set()
        await asyncio.wait(tasks[:MOST])
        assert await beside(abs, -1) == 1

    asyncio.run(run())
    assert sorted(begun) == list(range(MOST))


def test_a_process_ends_whatever_is_still_done_beside() -> None:
    done = subprocess.run([sys.executable, "-c", ENDS], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")
