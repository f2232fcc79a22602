"""The drilling cell in continuous production, with the recorder on; copies of it while it runs."""

from copy import deepcopy
from dataclasses import replace
from functools import partial
from heapq import heappop, heappush
from pathlib import Path

from bench.rows import Row, alternately, least
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.ticks import SECOND

PLACE = Path(__file__).parents[1] / "examples" / "drilling"
SECONDS = 200


SHIFT = 8 * 3600  # s
STRAY = '[units.stray]\nmodel = "gs-c200"\nprogram = "stray.gsc"\n'  # its rounds and those of the drilling never meet
STRAY_PROGRAM = "U1\nS17\nT91\nR33\n+71\nD1\n"


def drilling(more: str = "") -> Cell:
    """The cell with its stop switch left alone: bar after bar."""
    description = parse((PLACE / "cell.toml").read_text() + more, "cell.toml")
    script = [entry for entry in description.script if "stop" not in entry.set]
    description = replace(description, script=script)
    return build(description, lambda file: STRAY_PROGRAM if file == "stray.gsc" else (PLACE / file).read_text())


def produce(seconds: int, more: str = "") -> Cell:
    """The cell after so many virtual seconds of production, asked for in one go."""
    cell = drilling(more)
    cell.run_to(seconds * SECOND)
    return cell


def second_by_second(seconds: int, more: str = "") -> Cell:
    """The same as it is when nobody asks for more at once: every instant is run through."""
    cell = drilling(more)
    for second in range(1, seconds + 1):
        cell.run_to(second * SECOND)
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
    took, through, heap = alternately(
        partial(produce, SECONDS), partial(second_by_second, SECONDS), partial(bare_heap, entries)
    )
    never, never_through = alternately(
        partial(produce, SECONDS, STRAY), partial(second_by_second, SECONDS, STRAY), repeat=15
    )
    shift = least(partial(produce, SHIFT), 3)
    recording = produce(SHIFT).recording
    assert recording is not None
    held = sum(len(piece[1]) for piece in recording.pieces() if isinstance(piece, tuple))
    young, old = produce(10), second_by_second(SECONDS)
    copy_young, copy_old = least(young.copy, 100), least(old.copy, 100)
    plain = least(partial(deepcopy, old), 30)
    young_ms, old_ms = copy_young * 1e3, copy_old * 1e3
    return [
        Row("events recorded a second", entries / took, "1/s", "bare heap of events, 1/s", entries / heap, 400_000),
        Row("the same, every instant run through", entries / through, "1/s", "bare heap, 1/s", entries / heap, None),
        Row("virtual seconds a second", SECONDS / took, "s/s", "every instant, s/s", SECONDS / through, 1500),
        Row("a cell that never repeats itself", never, "s", "every instant, s", never_through, 1.02 * never_through),
        Row("a shift of 8 h", shift, "s", "200 s, s", took, None),
        Row("entries held of it", held, "", "told", len(recording), None),
        Row(f"copy after {SECONDS} s of recording", old_ms, "ms", "copy after 10 s, ms", young_ms, 0.25),
        Row("the same", old_ms, "ms", "copy.deepcopy of it, ms", plain * 1e3, 0.25),
    ]
