"""How things stand in a cell that is served, and what happened of late: a recording that keeps no past.

`Watch` takes the place of the cell's recording. It is told the same, and keeps the newest of it in a room that does not
grow, however long the cell is served.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final, TypeVar

from detent.cell.cell import Cell
from detent.cell.panel import Front, Panel
from detent.cell.recording import Entry, Log, Received, Recording, Repeated
from detent.controllers.device import Cautioned, Executing, Powered, Refused, StoreImage
from detent.uart import Sent

MOST_EVENTS: Final = 200  # kept
MOST_SAID: Final = 64  # characters of each unit kept
MOST_ACTIONS: Final = 20_000  # in a journal that forgets
WEIGHT: Final = 100  # characters of an action that count as one more

Event = Refused | Cautioned | Powered | StoreImage

T = TypeVar("T")


class UnitWatch:
    """How one unit stands: its panel, and what went over its line."""

    __slots__ = ("front", "received", "said", "sent")

    def __init__(self, front: Front) -> None:
        self.front = front
        self.received = 0  # characters, whether it understood them or not
        self.sent = 0
        self.said: deque[int] = deque(maxlen=MOST_SAID)

    def tell(self, entry: Entry) -> bool:
        """It did this, or this was done to it; whether it is an event worth keeping."""
        match entry:
            case Sent():
                self.sent += 1
                self.said.append(entry.char.value)
            case Received():
                self.received += 1
            case _:
                return self.front.take(entry) and not isinstance(entry, Executing)
        return False


class Watch(Recording):
    """How each unit of `cell` stands. It goes on from the recording of the cell, of which it keeps nothing else."""

    __slots__ = ("_passes_on", "events", "of_unit")

    def __init__(self, cell: Cell, *, passes_on: bool = False) -> None:
        """One that `passes_on` keeps what it was told for somebody who will `take` it.

        ValueError for a cell that does not record.
        """
        if cell.recording is None:
            raise ValueError("this cell keeps no recording to go on from: build it with record=True")
        super().__init__(cell.recording.units)
        self._passes_on = passes_on
        self.of_unit = [UnitWatch(front) for front in Panel(cell, {}).fronts]
        self.events: deque[tuple[int, Event]] = deque(maxlen=MOST_EVENTS)  # the unit, and what it was
        for unit, entry in cell.recording:
            self.extend(unit, (entry,))

    def extend(self, unit: int, entries: Sequence[Entry]) -> None:
        """Take note of what one unit did."""
        if self._passes_on:
            super().extend(unit, entries)
        watched = self.of_unit[unit]
        for entry in entries:
            if watched.tell(entry):
                self.events.append((unit, entry))  # type: ignore[arg-type]  # those are the ones worth keeping

    def turn(self, turns: Repeated) -> None:
        """Programs turned in loops, or the cell in rounds: the last of them shows how things are."""
        if self._passes_on:
            super().turn(turns)
        for unit, entry in turns.last():
            self.of_unit[unit].tell(entry)


class RecentLog(Log[T]):
    """A log that forgets its beginning when it grows beyond twice `most`; `forgotten` counts.

    An action with many characters counts as several: `WEIGHT` of them as one more.
    """

    __slots__ = ("_weight", "forgotten", "most", "weighed")

    def __init__(self, most: int = MOST_ACTIONS) -> None:
        super().__init__()
        self.most, self.forgotten = most, 0
        self._weight = self.weighed = 0  # as how many counts what is kept, and everything up to now

    def append(self, item: T) -> None:
        """Add one item."""
        super().append(item)
        weight = _weight(item)
        self._weight += weight
        self.weighed += weight
        if self._weight > 2 * self.most:
            kept, weight = 0, 0
            while kept < self._size and weight + _weight(self._items[self._size - 1 - kept]) <= self.most:
                weight += _weight(self._items[self._size - 1 - kept])
                kept += 1
            self.forgotten += self._size - kept
            self._items = self._items[self._size - kept : self._size]
            self._size, self._weight = kept, weight

    def __deepcopy__(self, memo: object) -> "RecentLog[T]":
        twin = super().__deepcopy__(memo)
        twin.most, twin.forgotten = self.most, self.forgotten
        twin._weight, twin.weighed = self._weight, self.weighed  # noqa: SLF001 (its own class)
        return twin


def _weight(item: object) -> int:
    return 1 + len(getattr(getattr(item, "what", item), "data", ())) // WEIGHT
