"""What can break in a cell: lines, contacts, inputs, memories, supplies; and how each is mended.

A fault costs nothing where there is none: a line is exchanged for a `FaultyLine`, a stuck contact or input is cut from
its net in the wiring. Faults have numbers, counted from 1 in each cell.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from detent.cell.switches import CONTACT
from detent.lines.faults import FaultyLine, LineFault, Strike, Tally
from detent.pins import HIGH, Level, Pin, PinKind
from detent.ticks import Ns

if TYPE_CHECKING:
    from detent.cell.cell import Cell


class OnLine(NamedTuple):
    """A fault of the line of this number."""

    line: int
    fault: LineFault


class StuckSwitch(NamedTuple):
    """A contact stays at a level, whatever moves it."""

    switch: str
    level: Level


class StuckPin(NamedTuple):
    """An input reads a level, whatever is wired to it."""

    unit: str
    pin: str
    level: Level


class WriteFailure(NamedTuple):
    """The next `times` writes of a unit's non-volatile memory fail; 0: all of them."""

    unit: str
    times: int = 0


class SupplyDip(NamedTuple):
    """A unit is without supply, whatever its switch is at; afterwards it is as the switch is then."""

    unit: str


Fault: TypeAlias = OnLine | StuckSwitch | StuckPin | WriteFailure | SupplyDip


class _Cut(NamedTuple):
    """A contact cut from its net: it drives a spare one, where its own level can be read."""

    part: int
    pin: str
    net: int
    spare: int


class Faults:
    """The faults of a cell, by number."""

    def __init__(self) -> None:
        self.standing: dict[int, Fault] = {}
        self._count = 0  # so far
        self._cuts: dict[int, _Cut] = {}
        self._deaf: dict[tuple[int, str], int] = {}  # stuck input -> fault
        self._readers: dict[int, Sequence[tuple[int, str]]] = {}  # of nets with stuck inputs: all of them
        self._writes_left: dict[int, int] = {}  # fault -> writes that it still spoils; -1: all
        self._dips: dict[str, bool] = {}  # unit without supply -> whether its switch is on

    @property
    def last(self) -> int:
        """The number of the fault that came last; 0 if there was none."""
        return self._count

    def known(self, number: int) -> bool:
        """Whether there is, or was, a fault of this number."""
        return 0 < number <= self._count

    def begin(self, cell: "Cell", fault: Fault, lasting: Ns | None) -> int:
        """It breaks, now. The number of the fault. Raises ValueError or KeyError, and nothing is changed."""
        if lasting is not None and lasting <= 0:
            raise ValueError("a fault lasts for a time above 0, or until it is mended")
        number = self._count + 1
        match fault:
            case OnLine():
                self._begin_on_line(cell, number, fault)
            case StuckSwitch():
                self._stick_switch(cell, number, fault)
            case StuckPin():
                self._stick_pin(cell, number, fault)
            case WriteFailure(unit, times):
                cell.unit(unit)
                if times < 0:
                    raise ValueError(f"{times} writes cannot fail; say how many do, or 0 for all")
                self._writes_left[number] = times or -1
            case SupplyDip(unit):
                if lasting is None:
                    raise ValueError("a supply dip ends by itself: say how long it lasts, or switch the unit off")
                index = cell.unit(unit)
                if not cell.supplied(index):
                    raise ValueError(f"{unit} is switched off: switch it on first")
                self._dips[unit] = True
                cell.supply(index, False)
        self._count = number
        self.standing[number] = fault
        return number

    def mend(self, cell: "Cell", number: int) -> None:
        """It is whole again, now; nothing happens if it is already. Raises KeyError for a number never given."""
        if not self.known(number):
            raise KeyError(f"there was no fault {number} in this cell")
        match self.standing.pop(number, None):
            case OnLine(line, _):
                faulty = cell.lines[line]
                assert isinstance(faulty, FaultyLine)
                faulty.mend(number)
                if faulty.sound:
                    faulty.line.heard[:0] = faulty.take()
                    cell.exchange(line, faulty.line)
            case StuckSwitch():
                cut = self._cuts.pop(number)
                cell.lead(cut.part, cut.pin, cut.net)
                cell.drive(cut.net, (cut.part, cut.pin), cell.nets[cut.spare].level)
            case StuckPin(unit, pin, _):
                part = cell.unit(unit)
                net = cell.net_read(part, pin)
                del self._deaf[part, pin]
                self._listen(cell, net)
                cell.give(part, pin, cell.given(part, pin))
            case WriteFailure():
                del self._writes_left[number]
            case SupplyDip(unit):
                if self._dips.pop(unit):
                    cell.supply(cell.unit(unit), True)

    def holds(self, part: int, pin: str) -> bool:
        """Whether an input is stuck."""
        return (part, pin) in self._deaf

    def readers(self, net: int) -> Sequence[tuple[int, str]]:
        """The inputs that are stuck, and the others on their net; none for a net without stuck inputs."""
        return self._readers.get(net, ())

    def switches(self, unit: str, on: bool) -> bool:
        """The switch of a unit's supply is put on or off; whether the unit is without supply all the same."""
        if unit not in self._dips:
            return False
        self._dips[unit] = on
        return True

    def writable(self, unit: str) -> bool:
        """Whether a write of the unit's memory that is made now may succeed; a failure is counted."""
        for number, left in self._writes_left.items():
            fault = self.standing[number]
            if isinstance(fault, WriteFailure) and fault.unit == unit and left:
                self._writes_left[number] = left - 1 if left > 0 else left
                return False
        return True

    def tally(self, cell: "Cell", number: int) -> Tally | None:
        """What a fault of a line has done; None for others."""
        fault = self.standing[number]
        if not isinstance(fault, OnLine):
            return None
        line = cell.lines[fault.line]
        return line.tally(number) if isinstance(line, FaultyLine) else None

    def strikes(self, cell: "Cell") -> list[tuple[int, Strike]]:
        """The newest characters that faults have changed, each with its line's number; of lines that have faults."""
        return [(n, strike) for n, line in enumerate(cell.lines) if isinstance(line, FaultyLine)
                for strike in line.strikes]  # fmt: skip

    # -- each kind ---------------------------------------------------------------------------------------

    def _begin_on_line(self, cell: "Cell", number: int, fault: OnLine) -> None:
        line = cell.lines[fault.line]
        if isinstance(line, FaultyLine):
            line.begin(number, fault.fault)
            return
        host_place = len(cell.wiring.lines[fault.line]) - 1 if line.hosted else None
        fault.fault.check(line.format)
        faulty = FaultyLine(line, host_place)
        faulty.begin(number, fault.fault)
        cell.exchange(fault.line, faulty)

    def _stick_switch(self, cell: "Cell", number: int, fault: StuckSwitch) -> None:
        part, pin = contact(cell, fault.switch)
        if any((cut.part, cut.pin) == (part, pin) for cut in self._cuts.values()):
            raise ValueError(f"{fault.switch} is stuck already: mend that first")
        net = cell.net_driven(part, pin)
        assert net is not None
        spare = cell.spare_net()
        cell.lead(part, pin, spare)
        cell.drive(spare, (part, pin), cell.nets[net].levels.get((part, pin), HIGH))
        self._cuts[number] = _Cut(part, pin, net, spare)
        cell.drive(net, (part, pin), fault.level)

    def _stick_pin(self, cell: "Cell", number: int, fault: StuckPin) -> None:
        part = cell.unit(fault.unit)
        pin = find_pin(cell.parts[part].pins, fault.pin)
        if pin is None or not pin.kind.reads:
            raise ValueError(f"{fault.unit} has no input {fault.pin}")
        net = cell.net_read(part, fault.pin)
        if pin.kind is PinKind.STRAP and net is None:
            raise ValueError(f"{fault.pin} is a strap, which is read at power-on alone: set it instead")
        if self.holds(part, fault.pin):
            raise ValueError(f"{fault.unit}.{fault.pin} is stuck already: mend that first")
        self._deaf[part, fault.pin] = number
        if net is not None:
            self._readers.setdefault(net, cell.wiring.reads[net])
        self._listen(cell, net)
        cell.give(part, fault.pin, fault.level)

    def _listen(self, cell: "Cell", net: int | None) -> None:
        if net is not None:
            cell.listen(net, [reader for reader in self._readers[net] if reader not in self._deaf])


def find_pin(pins: Sequence[Pin], name: str) -> Pin | None:
    """The pin of that name."""
    return next((pin for pin in pins if pin.name == name), None)


def contact(cell: "Cell", switch: str) -> tuple[int, str]:
    """The part and the pin that are the contact of a switch. Raises KeyError."""
    names, units = cell.wiring.names, cell.wiring.units
    for part in range(units, len(names)):
        if names[part] == switch and cell.net_driven(part, CONTACT) is not None:
            return part, CONTACT
        if names[part] != switch and cell.net_driven(part, switch) is not None:
            return part, switch  # a rotor moves it
    raise KeyError(f"no switch {switch!r} in this cell")
