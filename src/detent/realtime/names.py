"""What is named in a request to a cell: units, axes, pins, lines. AskedWrongly tells the names that there are."""

from collections.abc import Mapping, Sequence

from detent.cell.cell import Cell
from detent.cell.mechanics import Mechanics
from detent.cell.switches import Switch
from detent.realtime import verbs
from detent.realtime.verbs import AskedWrongly


class Names:
    """The names of one cell."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell

    @property
    def switches(self) -> Sequence[str]:
        """Contacts: switches, and those that a rotor moves."""
        wiring, found = self.cell.wiring, list[str]()
        for name, part in zip(wiring.names, self.cell.parts, strict=True):
            if isinstance(part, Switch):
                found.append(name)
            elif isinstance(part, Mechanics):
                found += part.contact_names
        return found

    @property
    def units(self) -> Sequence[str]:
        """Units."""
        return self.cell.wiring.names[: self.cell.wiring.units]

    def unit(self, given: Mapping[str, object]) -> str:
        """The unit that is named; the only one, if none is."""
        name = given.get("unit")
        if name is None:
            if len(self.units) > 1:
                raise AskedWrongly("which unit", f"name one of: {', '.join(self.units)}")
            return self.units[0]
        if name not in self.units:
            raise verbs.unknown("unit", str(name), self.units)
        return str(name)

    def axis(self, unit: str, given: Mapping[str, object]) -> str:
        """The axis of a unit that is named; the first, if none is."""
        if unit not in self.cell.controllers():
            raise AskedWrongly(f"{unit} moves no axis", f"name one of: {', '.join(self.cell.controllers())}")
        axes = self.cell.controller(unit).axes
        axis = given.get("axis", axes[0])
        if axis not in axes:
            if len(axes) == 1:
                raise AskedWrongly(f"{unit} has no axis {str(axis)!r}", "it has only one: leave the axis out")
            raise verbs.unknown(f"axis of {unit}", str(axis), axes)
        return str(axis)

    def pin(self, given: Mapping[str, object], *, outputs: bool = False) -> tuple[str, str]:
        """The unit and the pin that UNIT.PIN, or PIN of the only unit, names: an input, or an output too."""
        text = str(given["pin"])
        unit, dot, pin = text.rpartition(".")
        unit = self.unit({"unit": unit} if dot else given)
        pins = self.cell.parts[self.cell.unit(unit)].pins
        known = [other.name for other in pins if other.kind.reads or (outputs and other.kind.drives)]
        if pin not in known:
            raise verbs.unknown(f"{'pin' if outputs else 'input'} of {unit}", pin, known)
        return unit, pin

    def line(self, name: object) -> int:
        """The line that is named, itself or by a unit on it; the only one, if none is."""
        wiring = self.cell.wiring
        names = wiring.line_names
        if name is None:
            if len(names) > 1:
                raise AskedWrongly("which line", f"name one of: {', '.join(names)}")
            return 0
        if name in names:
            return names.index(str(name))
        if name in self.units and wiring.line_of[self.units.index(str(name))] >= 0:
            return wiring.line_of[self.units.index(str(name))]
        raise verbs.unknown("line", str(name), names)
