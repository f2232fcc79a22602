"""The drilling cell in continuous production, with the recorder on; copies of it while it runs."""

from copy import deepcopy
from dataclasses import replace
from functools import partial
from heapq import heappop, heappush
from pathlib import Path

from bench.rows import Row, least
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.ticks import SECOND

PLACE = Path(__file__).parents[1] / "examples" / "drilling"
SECONDS = 200


def drilling() -> Cell:
    """The cell with its stop switch left alone: bar after bar."""
    description = parse((PLACE / "cell.toml").read_text(), "cell.toml")
    script = [entry for entry in description.script if "stop" not in entry.set]
    return build(replace(description, script=script), lambda file: (PLACE / file).read_text())


def produce(seconds: int) -> Cell:
    """The cell after so many virtual seconds of production."""
    cell = drilling()
    cell.run_to(seconds * SECOND)
    return cell


def bare_heap(events: int) -> None:
    """The least a discrete-event kernel can do: pop a deadline, call back, push the next."""
    heap = [(0, 0)]
    for _ in range(events):
        at, who = heappop(heap)
        heappush(heap, (at + 1000, who))


def rows() -> list[Row]:
    """Speed of the cell against a bare heap of callbacks; copies against one of the young cell, and `copy.deepcopy`."""
    entries = len(produce(SECONDS).recording or ())
    took = least(partial(produce, SECONDS))
    heap = entries / least(partial(bare_heap, entries))
    young, old = produce(10), produce(SECONDS)
    copy_young, copy_old = least(young.copy, 100), least(old.copy, 100)
    plain = least(partial(deepcopy, old), 30)
    young_ms, old_ms = copy_young * 1e3, copy_old * 1e3
    return [
        Row("events recorded a second", entries / took, "1/s", "bare heap of events, 1/s", heap, 400_000),
        Row("virtual seconds a second", SECONDS / took, "s/s", "real time, s/s", 1.0, 1500),
        Row(f"copy after {SECONDS} s of recording", old_ms, "ms", "copy after 10 s, ms", young_ms, 0.25),
        Row("the same", old_ms, "ms", "copy.deepcopy of it, ms", plain * 1e3, 0.25),
    ]
