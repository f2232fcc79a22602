"""The last moments of a cell, and how it is taken back to an instant and lives through what follows once more.

Copies are kept from time to time; between them the cell is run again with what was done to it (its journal), and does
the same again. The cell keeps its identity: whoever holds it sees it as it is now.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from detent.cell.actions import Action, TimedAction
from detent.cell.cell import Cell
from detent.realtime.watch import RecentLog
from detent.ticks import Ns

MANY_ACTIONS = 1_000  # behind which another moment is kept; the journal keeps 20 times as many


class Moment(NamedTuple):
    """A cell at one time, and how much its owner had counted up to there."""

    cell: Cell
    actions: int
    counts: tuple[int, ...]

    @property
    def now(self) -> Ns:
        """Its time."""
        return self.cell.now


class Past:
    """The past of `cell`, which keeps its journal for it from now on. `counts` are the owner's, of what it was told."""

    def __init__(self, cell: Cell, counts: Callable[[], tuple[int, ...]]) -> None:
        self.cell, self._counts = cell, counts
        cell.journal, cell.journaling = RecentLog(), True
        self.moments: list[Moment] = []

    @property
    def worn(self) -> bool:
        """Whether so much was done to the cell since a moment was kept that another one is due."""
        return not self.moments or _weighed(self.cell) - _weighed(self.moments[-1].cell) >= MANY_ACTIONS

    def keep(self) -> Moment:
        """Keep a copy of the cell as it is. Everything it did must have been taken over."""
        moment = Moment(self.cell.copy(), self.cell.journal.appended, self._counts())
        self.moments.append(moment)
        return moment

    def forget(self, before: Ns) -> Moment | None:
        """Nobody goes back to earlier than `before`; the oldest moment that is still needed."""
        while len(self.moments) > 1 and self.moments[1].now <= before:
            del self.moments[0]
        return self.moments[0] if self.moments else None

    def reaches(self, at: Ns) -> bool:
        """Whether a moment at or before `at` is kept, and everything that was done to the cell since."""
        base = self._base(at)
        return base is not None and base.actions >= self.cell.journal.forgotten

    def _base(self, at: Ns) -> Moment | None:
        """The last moment that is kept at or before `at`."""
        return next((moment for moment in reversed(self.moments) if moment.now <= at), None)

    def back(
        self,
        at: Ns,
        actions: Sequence[Action],
        drop: Callable[[TimedAction], bool],
        arrived: Callable[[Moment], None],
        lived: Callable[[], None],
    ) -> None:
        """The cell is as it was at `at`; `actions` are done there, and then it lives on to its present.

        What was done to it later is done again, but what is to `drop`. `arrived` is called at `at`, before the actions,
        with the moment from which it was run, `lived` behind each eventful instant from there on. Only where it
        `reaches`.
        """
        cell, present = self.cell, self.cell.now
        base = self._base(at)
        assert base is not None
        since = cell.journal.since(base.actions)
        vars(cell).update(vars(base.cell.copy()))
        later = [action for action in since if action.at > at and not drop(action)]
        for action in since:
            if action.at <= at:
                perform(cell, action)
        cell.run_to(at)
        arrived(base)
        self.moments = [moment for moment in self.moments if moment.now <= at]
        for action in (*(TimedAction(at, what) for what in actions), *later):
            _live(cell, action.at, lived)
            perform(cell, action)
            lived()
        _live(cell, present, lived)


def _weighed(cell: Cell) -> int:
    """How much was done to a cell whose journal is a `RecentLog`."""
    assert isinstance(cell.journal, RecentLog)
    return cell.journal.weighed


def _live(cell: Cell, until: Ns, lived: Callable[[], None]) -> None:
    while (at := cell.next_event()) is not None and at <= until:
        cell.run_to(at)
        lived()
    cell.run_to(until)


def perform(cell: Cell, action: TimedAction) -> None:
    """Do it, at its time, and let everything of that instant happen."""
    cell.run_to(action.at)
    cell.do(action.what)
    cell.run_to(cell.now)
