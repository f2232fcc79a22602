"""The drilling cell in continuous production, with the recorder on; copies of it while it runs."""

from dataclasses import replace
from functools import partial
from heapq import heappop, heappush
from pathlib import Path

from bench.rows import Row, measure
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
    """Speed of the cell against a bare heap of callbacks; copies against a copy of the young cell."""
    entries = len(produce(SECONDS).recording or ())
    took = measure(partial(produce, SECONDS))
    heap = entries / measure(partial(bare_heap, entries))
    young, old = produce(10), produce(SECONDS)
    copy_young, copy_old = measure(young.copy, 30), measure(old.copy, 30)
    return [
        Row("events recorded a second", entries / took, "1/s", "bare heap of events, 1/s", heap, 200_000),
        Row("virtual seconds a second", SECONDS / took, "s/s", "real time, s/s", 1.0, 1500),
        Row(f"copy after {SECONDS} s of recording", copy_old * 1e3, "ms", "copy after 10 s, ms", copy_young * 1e3, 1.0),
    ]
