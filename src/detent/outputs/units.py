"""What an output must know of a unit, and what the recording says of it pin by pin."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from detent.cell.cell import Cell
from detent.cell.recording import InputSet, Received
from detent.controllers.device import Powered
from detent.outputs.waves import UNKNOWN, Spoken, Wave, wave
from detent.pins import HIGH, Level, Pin, PinKind, PinSet, PulseOutput
from detent.ticks import Ns
from detent.uart import Format, Sent, SerialPort

USUAL_PORT = SerialPort("RXD", "TXD")


class UnitView(NamedTuple):
    """What an output must know of a unit to draw it."""

    name: str
    pins: Sequence[Pin] = ()
    pulse_output: PulseOutput | None = None
    line_format: Format | None = None  # None: its serial wires are not drawn
    inputs: Mapping[str, Level] = {}  # levels before the first `InputSet`; an input not named here rests
    powered: bool = False  # before the first `Powered`
    shaft: int = 0  # where the axis stands before its first motion, in steps
    port: SerialPort = USUAL_PORT
    axes: Sequence[str] = ("",)  # the names of its axes


def views(cell: Cell, shafts: Mapping[str, int] | None = None) -> list[UnitView]:
    """The views of all units of a cell. `shafts` are the places where axes stood at the start, if not at 0."""
    shafts = shafts or {}
    controllers = cell.controllers()
    found = []
    for name, part in zip(cell.wiring.names[: cell.wiring.units], cell.parts, strict=False):
        controller = controllers.get(name)
        if controller is None:
            found.append(UnitView(name, part.pins))
        else:
            output, form = controller.pulse_output, controller.line_format
            found.append(
                UnitView(name, part.pins, output, form, shaft=shafts.get(name, 0), port=controller.serial_port,
                         axes=controller.axes)
            )  # fmt: skip
    return found


class _Changes:
    """Changes of one pin as they are noted."""

    __slots__ = ("levels", "order", "times")

    def __init__(self) -> None:
        self.times: list[Ns] = []
        self.levels: list[int] = []
        self.order: list[int] = []

    def add(self, at: Ns, level: int, order: int) -> None:
        self.times.append(at)
        self.levels.append(level)
        self.order.append(order)


class UnitLog:
    """The entries of one unit, sorted by pin."""

    def __init__(self, view: UnitView) -> None:
        self.view = view
        self.characters: dict[str, list[Spoken]] = {}  # by port
        self._changes: dict[str, _Changes] = {}
        self._powered = _Changes()
        self._rests = {p.name: p.rest for p in view.pins if p.kind.drives and p.kind is not PinKind.WINDING}
        if view.line_format is not None:
            self._rests[view.port.sends] = HIGH

    def take(self, order: int, entry: object) -> None:
        """Note one entry of the recording, whose place in it is `order`."""
        match entry:
            case PinSet(at, pin, level):
                self._changes_of(pin).add(at, level, order)
            case InputSet(at, pin, level):
                if pin != self.view.port.receives:  # as a strap RXD is a voltage, not a logic level
                    self._changes_of(pin).add(at, level, order)
            case Sent(at, port, char, done):
                self.characters.setdefault(port, []).append(Spoken(at, done, char, order))
            case Received(at, port, char, began):
                self.characters.setdefault(port, []).append(Spoken(began, at, char, order))
            case Powered(at, on):
                self._powered.add(at, on, order)
                for pin, rest in self._rests.items():
                    self._changes_of(pin).add(at, rest if on else UNKNOWN, order)

    def wave(self, pin: str) -> Wave:
        """The changes of a pin that are entries of their own."""
        changes = self._changes.get(pin)
        return wave((), (), ()) if changes is None else wave(changes.times, changes.levels, changes.order)

    def power(self) -> Wave:
        """When the supply was switched."""
        return wave(self._powered.times, self._powered.levels, self._powered.order)

    def carries_pulses(self) -> bool:
        """Whether step pulses are entries of their own, because a wire takes them to another device."""
        output = self.view.pulse_output
        if output is None:
            return False
        logged = [self._changes[pin].levels for pin in output.clocks if pin in self._changes]
        return any(output.active in levels for levels in logged)

    def drawn(self) -> dict[str, Pin]:
        """Inputs and outputs; serial wires if their format is known; straps that are given a level."""
        return {pin.name: pin for pin in self.view.pins if self._is_drawn(pin)}

    def initial(self, pin: Pin) -> int:
        """The level before anything happened."""
        if pin.name in self._rests:
            return self._rests[pin.name] if self.view.powered else UNKNOWN
        return HIGH if pin.kind is PinKind.SERIAL else self.view.inputs.get(pin.name, pin.rest)

    def _is_drawn(self, pin: Pin) -> bool:
        if pin.kind is PinKind.SERIAL:
            return self.view.line_format is not None and pin.name in (self.view.port.sends, self.view.port.receives)
        if pin.kind is PinKind.WINDING:
            return pin.name in self._changes
        if pin.kind is PinKind.STRAP:
            return pin.name in self._changes or pin.name in self.view.inputs
        return pin.kind.drives or pin.kind is PinKind.INPUT

    def _changes_of(self, pin: str) -> _Changes:
        found = self._changes.get(pin)
        if found is None:
            found = self._changes[pin] = _Changes()
        return found
