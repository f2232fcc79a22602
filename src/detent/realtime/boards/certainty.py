"""What of a driven cell's past is certain: no stop in the firmware can take it back any more."""

from collections.abc import Callable, Sequence

from detent.cell.cell import Cell
from detent.realtime.boards.axis_ledger import AxisLedger
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.plan import Plan
from detent.realtime.pace import WallNs
from detent.ticks import MS, Ns

CERTAIN: Ns = 5 * MS  # a stop is known so long after it happened, unless the computer was late
REPORTING: Ns = 1 * MS  # what a board takes to tell a stop, while it acknowledges something


class Certainty:
    """As far as the pulses of `ledgers` have left the pins, and their boards were heard of since."""

    def __init__(
        self, cell: Cell, boards: Boards, plan: Plan, ledgers: Sequence[AxisLedger], wall: Callable[[], WallNs]
    ) -> None:
        self._cell, self._boards, self._plan, self._ledgers, self._wall = cell, boards, plan, ledgers, wall

    @property
    def guarded(self) -> bool:
        """Whether an input may stop an axis at present."""
        return any(ledger.guard.armed for ledger in self._ledgers)

    @property
    def lag(self) -> Ns:
        """How much later than the lead the pins are at present: the latest axis."""
        return max((ledger.stepper.behind(self._cell.now) for ledger in self._ledgers), default=0)

    @property
    def behind(self) -> Ns:
        """So long after the cell said something it may be heard."""
        return self._plan.lead + self.lag + CERTAIN if self._plan.held else 0

    def horizon(self) -> Ns:
        """What the cell said up to then may be heard."""
        return self.until() if self._plan.held else self._cell.now

    def until(self) -> Ns:
        """What the cell did up to then is certain: no stop can be earlier that is not known."""
        left = min((self.left(ledger) for ledger in self._ledgers), default=self._cell.now - self._plan.lead)
        return left - max(CERTAIN, self._unheard())

    def left(self, ledger: AxisLedger) -> Ns:
        """The cell time up to which every pulse of an axis has left the pins: sent, and a lead and its lag ago."""
        due = ledger.stepper.next_pulse()
        sent = self._cell.now if due is None else min(due - 1, self._cell.now)
        return sent - self._plan.lead - ledger.stepper.behind(self._cell.now)

    def told(self) -> Ns:
        """What was to leave the pins up to this cell time has left them, or the boards have told that it did not."""
        return self._cell.now - self._unheard()

    def _unheard(self) -> Ns:
        """How long ago a stop may have happened of which nothing was heard: what a late computer has yet to read."""
        heard = self._boards.heard()
        return 0 if heard is None else self._wall() - heard + REPORTING

    def may_stop(self) -> bool:
        """Whether a stop may yet take back what the cell does now."""
        return self.guarded or self._boards.heard() is not None

    def inquire(self, first: Ns, staged: Ns) -> None:
        """Hear of what the boards did lately, where something waits for nothing else.

        What the cell said first, at `first`, or a power stage that counts when the pins are at cell time `staged`.
        """
        said = self._plan.held and first <= self._cell.now - self.behind and first > self.horizon()
        if said or self.told() < staged <= self._cell.now:
            self._boards.inquire(self._wall())
