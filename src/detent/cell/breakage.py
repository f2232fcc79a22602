"""How what breaks in a cell begins, and how each is mended.

A fault costs nothing where there is none: a line is exchanged for a `FaultyLine`, a stuck contact or input is cut from
its net in the wiring. Faults have numbers, counted from 1 in each cell.
"""

from typing import NamedTuple

from detent.cell.circuit import Circuit
from detent.cell.faults import Fault, OnLine, StuckPin, StuckSwitch, SupplyDip, WriteFailure
from detent.lines.faults import FaultyLine, Strike, Tally
from detent.pins import HIGH, PinKind, find_pin
from detent.ticks import Ns


class _Cut(NamedTuple):
    """A contact cut from its net: it drives a spare one, where its own level can be read."""

    part: int
    pin: str
    net: int
    spare: int


class Breakage:
    """The faults of a circuit, by number."""

    def __init__(self, circuit: Circuit) -> None:
        self._circuit = circuit
        self.standing: dict[int, Fault] = {}
        self._count = 0  # so far
        self._cuts: dict[int, _Cut] = {}
        self._dips: dict[str, bool] = {}  # unit without supply -> whether its switch is on

    @property
    def last(self) -> int:
        """The number of the fault that came last; 0 if there was none."""
        return self._count

    def known(self, number: int) -> bool:
        """Whether there is, or was, a fault of this number."""
        return 0 < number <= self._count

    def begin(self, fault: Fault, lasting: Ns | None) -> int:
        """It breaks, now. The number of the fault. Raises ValueError or KeyError, and nothing is changed."""
        circuit = self._circuit
        if lasting is not None and lasting <= 0:
            raise ValueError("a fault lasts for a time above 0, or until it is mended")
        number = self._count + 1
        match fault:
            case OnLine():
                self._begin_on_line(number, fault)
            case StuckSwitch():
                self._stick_switch(number, fault)
            case StuckPin():
                self._stick_pin(number, fault)
            case WriteFailure(unit, times):
                circuit.wiring.unit(unit)
                if times < 0:
                    raise ValueError(f"{times} writes cannot fail; say how many do, or 0 for all")
                circuit.failing_writes[number] = unit, times or -1
            case SupplyDip(unit):
                if lasting is None:
                    raise ValueError("a supply dip ends by itself: say how long it lasts, or switch the unit off")
                index = circuit.wiring.unit(unit)
                if not circuit.supplied(index):
                    raise ValueError(f"{unit} is switched off: switch it on first")
                self._dips[unit] = True
                circuit.supply(index, False)
        self._count = number
        self.standing[number] = fault
        return number

    def mend(self, number: int) -> None:
        """It is whole again, now; nothing happens if it is already. Raises KeyError for a number never given."""
        circuit = self._circuit
        if not self.known(number):
            raise KeyError(f"there was no fault {number} in this cell")
        match self.standing.pop(number, None):
            case OnLine(line, _):
                faulty = circuit.lines[line]
                assert isinstance(faulty, FaultyLine)
                faulty.mend(number)
                if faulty.sound:
                    faulty.line.heard[:0] = faulty.take()
                    circuit.exchange(line, faulty.line)
            case StuckSwitch():
                cut = self._cuts.pop(number)
                circuit.lead(cut.part, cut.pin, cut.net)
                circuit.drive(cut.net, (cut.part, cut.pin), circuit.nets[cut.spare].level)
            case StuckPin(unit, pin, _):
                part = circuit.wiring.unit(unit)
                circuit.unstick(part, pin)
            case WriteFailure():
                del circuit.failing_writes[number]
            case SupplyDip(unit):
                if self._dips.pop(unit):
                    circuit.supply(circuit.wiring.unit(unit), True)

    def switches(self, unit: str, on: bool) -> bool:
        """The switch of a unit's supply is put on or off; whether the unit is without supply all the same."""
        if unit not in self._dips:
            return False
        self._dips[unit] = on
        return True

    def tally(self, number: int) -> Tally | None:
        """What a fault of a line has done; None for others."""
        circuit = self._circuit
        fault = self.standing[number]
        if not isinstance(fault, OnLine):
            return None
        line = circuit.lines[fault.line]
        return line.tally(number) if isinstance(line, FaultyLine) else None

    def strikes(self) -> list[tuple[int, Strike]]:
        """The newest characters that faults have changed, each with its line's number; of lines that have faults."""
        return [(n, strike) for n, line in enumerate(self._circuit.lines) if isinstance(line, FaultyLine)
                for strike in line.strikes]  # fmt: skip

    # -- each kind ---------------------------------------------------------------------------------------

    def _begin_on_line(self, number: int, fault: OnLine) -> None:
        circuit = self._circuit
        if not 0 <= fault.line < len(circuit.lines):
            raise ValueError(f"no line {fault.line}: this cell has {len(circuit.lines)}")
        line = circuit.lines[fault.line]
        if isinstance(line, FaultyLine):
            line.begin(number, fault.fault)
            return
        host_place = len(circuit.wiring.lines[fault.line]) - 1 if line.hosted else None
        fault.fault.check(line.format)
        faulty = FaultyLine(line, host_place)
        faulty.begin(number, fault.fault)
        circuit.exchange(fault.line, faulty)

    def _stick_switch(self, number: int, fault: StuckSwitch) -> None:
        circuit = self._circuit
        part, pin = circuit.contact(fault.switch)
        if any((cut.part, cut.pin) == (part, pin) for cut in self._cuts.values()):
            raise ValueError(f"{fault.switch} is stuck already: mend that first")
        net = circuit.net_driven(part, pin)
        assert net is not None
        spare = circuit.spare_net()
        circuit.lead(part, pin, spare)
        circuit.drive(spare, (part, pin), circuit.nets[net].levels.get((part, pin), HIGH))
        self._cuts[number] = _Cut(part, pin, net, spare)
        circuit.drive(net, (part, pin), fault.level)

    def _stick_pin(self, number: int, fault: StuckPin) -> None:
        circuit = self._circuit
        part = circuit.wiring.unit(fault.unit)
        pin = find_pin(circuit.parts[part].pins, fault.pin)
        if pin is None or not pin.kind.reads:
            raise ValueError(f"{fault.unit} has no input {fault.pin}")
        net = circuit.net_read(part, fault.pin)
        if pin.kind is PinKind.STRAP and net is None:
            raise ValueError(f"{fault.pin} is a strap, which is read at power-on alone: set it instead")
        if (part, fault.pin) in circuit.stuck:
            raise ValueError(f"{fault.unit}.{fault.pin} is stuck already: mend that first")
        circuit.stick(part, fault.pin, fault.level)
