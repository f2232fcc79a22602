"""What a history is made of: copies of the cell, what was cut off of it, futures that were left."""

from collections.abc import Sequence
from typing import NamedTuple

from detent.cell.actions import TimedAction
from detent.cell.cell import Cell
from detent.cell.panel import Panel
from detent.cell.recording import Batch
from detent.lines.line import Heard
from detent.ticks import NEVER, Ns


class PausedLine(NamedTuple):
    """A line while the cell stands in its past: the host's bytes wait outside."""

    heard: list[Heard]  # what the host is still to be told of the present that was left
    host_busy_until: Ns = NEVER

    def take(self) -> list[Heard]:
        """What had reached the host when the present was left; nothing more."""
        heard = self.heard.copy()
        self.heard.clear()
        return heard


class Cut(NamedTuple):
    """The past was changed: only the first `batches` and `actions`, and what rotors did up to `at`, still hold."""

    at: Ns
    batches: int
    actions: int


class News(NamedTuple):
    """What happened since it was last asked: see `History.news`."""

    cut: Cut | None
    first: int
    batches: Sequence[Batch]
    actions: Sequence[TimedAction]


class Branch(NamedTuple):
    """A future that was left: the cell went on from `at` otherwise. It had come as far as `end`, with these actions."""

    number: int
    at: Ns
    end: Ns
    actions: Sequence[TimedAction]
    first: int  # the number of the first of them: some of the instant `at` may have been done before


class Moment:
    """A cell at one time, with everything that is counted up to there."""

    __slots__ = ("actions", "batches", "broken", "cell", "panel", "writes")

    def __init__(self, cell: Cell, panel: Panel, batches: int = 0, actions: int = 0, writes: int = 0) -> None:
        self.cell, self.panel, self.batches, self.actions, self.writes = cell, panel, batches, actions, writes
        self.broken = ""  # why it cannot go on from there

    @property
    def now(self) -> Ns:
        """Its time."""
        return self.cell.now

    def copy(self) -> "Moment":
        """The same, and on its own from now on."""
        return Moment(self.cell.copy(), self.panel.copy(), self.batches, self.actions, self.writes)
