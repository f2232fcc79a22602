"""What is kept of the past takes the memory that the bound counts with, however finely it is told."""

import gc
import pickle
import tracemalloc
from collections.abc import Callable

import pytest
from tests.workbench.told import EXAMPLES, Told, alone

from detent.cell.actions import Action, Type
from detent.cell.description import parse
from detent.outputs.units import views
from detent.ticks import MS, SECOND, Ns
from detent.workbench.memory import BATCH
from detent.workbench.messages import Happened, Opened
from detent.workbench.mirror import Mirror

TICK, SHIFT = 50 * MS, 20 * SECOND
"""How finely a cell is told at the pace of real time, and one that runs as fast as it goes."""


def drilling() -> Told:
    """Bar after bar: a loop without an end."""
    path = EXAMPLES / "drilling" / "bar-after-bar.toml"
    return Told(parse(path.read_text(), str(path)), path.parent)


CELLS: dict[str, tuple[Callable[[], Told], Action | None, Ns]] = {
    "a program": (drilling, None, 240 * SECOND),
    "a host that polls": (lambda: alone("gs-c200"), Type("gs-c200", "F"), 60 * SECOND),
    "a host that polls a board": (lambda: alone("bs0610"), Type("bs0610", "?"), 20 * SECOND),
}


def bytes_a_batch(made: Callable[[], Told], asked: Action | None, until: Ns, step: Ns) -> float:
    """What a batch takes in the process of the pages, told every `step`, as it comes over the pipe."""
    told = made()
    mirror = Mirror(Opened(told.picture, {}, views(told.cell)))
    messages, batches = [], 0
    while told.history.now < until:
        for _ in range(step // TICK):
            if asked is not None:
                told.history.do(asked)
            told.history.run_to(told.history.now + TICK)
        news = told.history.news()
        batches += len(news.batches)
        messages.append(pickle.dumps(Happened(news.first, news.batches, (), {}, 0), pickle.HIGHEST_PROTOCOL))
    assert batches > 1000
    gc.collect()
    tracemalloc.start()
    try:
        for message in messages:
            mirror.take(pickle.loads(message))
        gc.collect()
        return tracemalloc.get_traced_memory()[0] / batches
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("kind", CELLS)
def test_the_past_takes_no_more_than_the_bound_counts_with_at_any_pace(kind: str) -> None:
    fine, coarse = (bytes_a_batch(*CELLS[kind], step) for step in (TICK, SHIFT))
    assert fine <= BATCH, kind
    assert coarse <= BATCH, kind
    assert fine <= 1.25 * coarse
