"""What a long move of a GenStepper board costs beside a short one: planned, run and queried, in time and memory."""

import tracemalloc
from functools import partial

from bench.rows import Row, measure
from detent.cell.build import build
from detent.cell.description import single
from detent.ramps.tick_accumulator import UPDATES, toward

SHORT, LONG = 1_000, 1_000_000_000
QUERIES = 200
READY = 300_000_000  # ns


def plan(steps: int) -> None:
    """A hundred moves near `steps` from 1 to 62 500 microsteps/s and back, none of them kept from before."""
    for n in range(steps - 100, steps):
        toward.__wrapped__(n, 0, UPDATES, UPDATES, 2, 1, 2)


def run(steps: int) -> None:
    """A whole move on an emulated board, asked where it is on its way."""
    cell = build(single("bs0610"), lambda file: "", line_timing=False)
    cell.run_to(READY)
    cell.send(0, b"X1K2P62500R%dG" % steps)
    (line,) = cell.lines
    begun = cell.now
    duration = toward(steps, 0, UPDATES, UPDATES, 2, 1, 2).ticks * 16_000
    for n in range(QUERIES):
        cell.run_to(begun + duration * n // QUERIES)
        cell.send(0, b"0?")
    cell.run_to(begun + duration + READY)
    assert cell.controller("bs0610").status(cell.now).position == steps
    line.take()


def memory(steps: int) -> float:
    """The peak of memory during a run, in KiB."""
    tracemalloc.start()
    run(steps)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1024


def rows() -> list[Row]:
    """Each with the short move as its baseline; a ratio above 1.5 is too much."""
    made = []
    for name, what, scale, unit in (("planning", plan, 1e4, "us"), ("run, asked 200 times", run, 1e3, "ms")):
        short, long = measure(partial(what, SHORT)) * scale, measure(partial(what, LONG)) * scale
        made.append(Row(f"{name}: 10^9 microsteps", long, unit, f"10^3 microsteps, {unit}", short, 1.5 * short))
    run(SHORT)
    short, long = memory(SHORT), memory(LONG)
    made.append(Row("memory of a run: 10^9 microsteps", long, "KiB", "10^3 microsteps, KiB", short, 1.5 * short))
    return made
