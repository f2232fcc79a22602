"""The marks on the time line: what units say of themselves, and in words what is done to the cell from outside."""

from detent.cell.actions import (
    Action,
    Break,
    Discard,
    Load,
    Mend,
    PlaceSwitch,
    Release,
    SetPin,
    SetSwitch,
    Start,
)
from detent.cell.cell import Cell
from detent.cell.recording import Entry
from detent.controllers.device import Cautioned, Powered, Refused, StoreImage
from detent.realtime import breaking
from detent.ticks import Ns
from detent.workbench.messages import MOST_MARKS, Mark


class Marks:
    """The newest of them, in the order in which they came."""

    def __init__(self) -> None:
        self._marks: list[Mark] = []
        self._told: tuple[Mark, ...] = ()

    def put(self, at: Ns, kind: str, text: str, unit: str = "") -> None:
        """One more."""
        self._marks.append(Mark(at, kind, unit, text))

    def entry(self, unit: str, entry: Entry) -> None:
        """What a unit did, if it is worth one."""
        match entry:
            case Refused():
                self.put(entry.at, "error", f"{entry.frame}: {entry.reason}", unit)
            case Cautioned():
                self.put(entry.at, "caution", f"{entry.frame}: {entry.what}", unit)
            case Powered() if entry.at:
                self.put(entry.at, "power", "on" if entry.on else "off", unit)
            case StoreImage():
                self.put(entry.at, "stored", f"{len(entry.image)} bytes kept", unit)

    def action(self, cell: Cell, action: Action) -> None:
        """What was done to `cell`, now, if it does not show itself as a character or a supply does."""
        unit, text = _told(cell, action)
        if text:
            self.put(cell.now, "action", text, unit)

    def cut(self, at: Ns) -> None:
        """What came after `at` has not happened."""
        self._marks = [mark for mark in self._marks if mark.at <= at]

    def news(self, begin: Ns) -> tuple[Mark, ...] | None:
        """Those from `begin` on, if they are others than the last time."""
        marks = tuple(mark for mark in self._marks if mark.at >= begin)[-MOST_MARKS:]
        if marks == self._told:
            return None
        self._marks, self._told = list(marks), marks
        return marks


def _told(cell: Cell, action: Action) -> tuple[str, str]:
    """The unit that it is done to, "" for the whole cell, and the words; "" for what needs none."""
    match action:
        case SetSwitch(name, level):
            return "", f"{name} to {level}"
        case PlaceSwitch(name, low, high):
            ends = " to ".join("..." if place is None else f"{place:g}" for place in (low, high))
            return "", f"{name} at {ends}"
        case SetPin(unit, pin, level):
            return unit, f"{pin} to {level}"
        case Release(unit, pin):
            return unit, f"{pin} released"
        case Load(unit, image, _):
            return unit, f"{len(image)} bytes loaded"
        case Start(unit):
            return unit, "started"
        case Discard(line):
            return "", f"what waited on line {cell.wiring.line_names[line]} is dropped"
        case Break(fault, _):
            broken = breaking.arguments_of(cell, fault)
            return "", f"{broken['kind']} at {broken['where']}"
        case Mend(number):
            return "", f"fault {number} mended"
    return "", ""
