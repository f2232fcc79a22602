"""Inputs on their way from boards into the cell: which levels it was given, and when."""

from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

from detent.cell.actions import SetPin
from detent.cell.cell import Cell
from detent.pins import Level
from detent.realtime.boards.axis_ledger import AxisLedger
from detent.realtime.boards.events import Stopped
from detent.realtime.boards.plan import Plan
from detent.ticks import Ns

KEPT = 256  # changes


class Change(NamedTuple):
    """An input of a unit was given a level, at this cell time."""

    at: Ns
    what: SetPin


class CellInputs:
    """The inputs of `cell` that hang on boards, by their names there."""

    def __init__(self, cell: Cell, plan: Plan) -> None:
        self._cell, self._plan = cell, plan
        self.name_of = {place: name for name, place in plan.inputs.items()}
        self._given: dict[str, Level] = {}  # as the cell was told
        self._changes: deque[Change] = deque(maxlen=KEPT)
        self._stopped_last: dict[str, tuple[AxisLedger, Ns]] = {}  # which axis an input stopped last, and when

    def begin(self, levels: Mapping[str, Level]) -> None:
        """The cell was built with these."""
        self._given = dict(levels)

    def differs(self, name: str, level: Level) -> bool:
        """Whether the cell has another level."""
        return self._given.get(name) != level

    def give(self, name: str, level: Level) -> None:
        """An input has another level, as far as the cell is concerned from now on."""
        unit, pin = self._plan.inputs[name]
        self._given[name] = level
        self._changes.append(Change(self._cell.now, SetPin(unit, pin, level)))
        self._cell.set_pin(unit, pin, level)

    def stopped_before(self, event: Stopped, ledger: AxisLedger) -> bool:
        """Whether the input of a stop has stopped another axis later than this: so the cell has been there already."""
        other, at = self._stopped_last.get(event.input, (ledger, event.at))
        return other is not ledger and event.at < at

    def taken_back(self, ledger: AxisLedger, event: Stopped, at: Ns) -> tuple[list[SetPin], set[Change]]:
        """An input has stopped an axis at `at`: what the cell is given there, and which later changes it never had.

        What the switches of this axis are at was so at the stop already: it stands, and reports take their time.
        """
        unit, pin = self._plan.inputs[event.input]
        switches = {(unit, other) for other in self._cell.controller(unit).switches(ledger.what.axis)}
        if (unit, pin) in switches:
            ledger.lost, ledger.known = False, True  # as far as a switch tells it
        others = {
            name: int(found)
            for name, found in event.levels.items()
            if name != event.input and self._plan.inputs[name] in switches
        }
        late = {self._plan.inputs[name] for name in (*others, event.input)}
        since = [change for change in self._changes if change.at > at]
        fresh = {(change.what.unit, change.what.pin) for change in since}
        actions: list[SetPin] = []
        for name, found in others.items():
            place = self._plan.inputs[name]
            if place in fresh or self._given[name] != found:
                actions.append(SetPin(*place, found))
                self._given[name] = found
        self._stopped_last[event.input] = ledger, at
        actions.append(SetPin(unit, pin, int(event.level)))
        self._given[event.input] = int(event.level)
        drop = {change for change in since if (change.what.unit, change.what.pin) in late}
        kept = [change for change in self._changes if change not in drop]
        self._changes = deque([*kept, *(Change(at, action) for action in actions)], maxlen=KEPT)
        return actions, drop
