"""How things stand in a cell that is served, and what happened of late: a recording that keeps no past.

`Watch` takes the place of the cell's recording. It is told the same, and keeps the newest of it in a room that does not
grow, however long the cell is served.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from typing import Final, TypeVar

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.recording import Entry, InputSet, Log, Received, Recording
from detent.controllers.device import Executing, Finished, Powered, Refused, StoreImage
from detent.pins import Level, PinSet
from detent.uart import Sent

MOST_EVENTS: Final = 200  # kept
MOST_SAID: Final = 64  # characters of each unit kept
MOST_DEEDS: Final = 20_000  # in a journal that forgets

Event = Refused | Powered | StoreImage

T = TypeVar("T")


class UnitWatch:
    """How one unit stands, as far as it has told."""

    __slots__ = ("executing", "inputs", "motions", "outputs", "received", "refused", "said", "sent")

    def __init__(self) -> None:
        self.outputs: dict[str, Level] = {}  # driven ones
        self.inputs: dict[str, Level] = {}  # what they were given last
        self.motions: dict[str, MotionStarted] = {}  # in force, by axis
        self.executing: Executing | None = None
        self.refused: Refused | None = None
        self.received = 0  # characters, whether it understood them or not
        self.sent = 0
        self.said: deque[int] = deque(maxlen=MOST_SAID)

    def tell(self, entry: Entry) -> bool:
        """It did this, or this was done to it; whether it is an event worth keeping."""
        match entry:
            case PinSet(_, pin, level):
                self.outputs[pin] = level
            case InputSet(_, pin, level):
                self.inputs[pin] = level
            case Sent():
                self.sent += 1
                self.said.append(entry.char.value)
            case Received():
                self.received += 1
            case Executing():
                self.executing = entry
            case Finished():
                self.executing = None
            case MotionStarted():
                self.motions[entry.axis] = entry
            case MotionCut() | MotionEnded():
                self.motions.pop(entry.axis, None)
            case Refused():
                self.refused = entry
                return True
            case StoreImage():
                return True
            case Powered(_, on):
                self.executing = None
                if not on:
                    self.outputs.clear()
                return True
        return False


class Watch(Recording):
    """How each unit of a cell stands. `before` is what was recorded until now; it is not kept."""

    __slots__ = ("events", "of_unit")

    def __init__(self, units: Sequence[str], before: Iterable[tuple[int, Entry]] = ()) -> None:
        super().__init__(units)
        self.of_unit = [UnitWatch() for _ in units]
        self.events: deque[tuple[int, Event]] = deque(maxlen=MOST_EVENTS)  # the unit, and what it was
        for unit, entry in before:
            self.extend(unit, (entry,))

    def extend(self, unit: int, entries: Sequence[Entry]) -> None:
        """Take note of what one unit did."""
        watched = self.of_unit[unit]
        for entry in entries:
            if watched.tell(entry):
                self.events.append((unit, entry))  # type: ignore[arg-type]  # those are the ones worth keeping


class Lately(Log[T]):
    """A log that forgets its beginning when it grows beyond twice `most`; `forgotten` counts."""

    __slots__ = ("forgotten", "most")

    def __init__(self, most: int = MOST_DEEDS) -> None:
        super().__init__()
        self.most, self.forgotten = most, 0

    def append(self, item: T) -> None:
        """Add one item."""
        super().append(item)
        if self._size > 2 * self.most:
            self.forgotten += self._size - self.most
            self._items = self._items[self._size - self.most : self._size]
            self._size = self.most

    def __deepcopy__(self, memo: object) -> "Lately[T]":
        twin = super().__deepcopy__(memo)
        twin.most, twin.forgotten = self.most, self.forgotten
        return twin
