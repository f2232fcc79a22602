"""What a motor in a cell shows to wires: its pins, the contacts on its axis, the step detector."""

from typing import NamedTuple

from detent.pins import HIGH, LOW, Level, Pin, PinKind
from detent.ticks import US, Ns

PINS: tuple[Pin, ...] = (
    Pin("MOV", None, PinKind.INPUT, "drive: 0 takes the current to rest (of a GS-C200)"),
    Pin("RAMP", None, PinKind.INPUT, "drive: 0 takes the current from ramp to slew"),
    Pin("ENABLE", None, PinKind.INPUT, "drive: 0 switches the windings off"),
    Pin("DECAY", None, PinKind.INPUT, "drive: 1 slow decay, 0 fast; not wired: as the drive is set"),
    Pin("HALF", None, PinKind.INPUT, "drive: 1 each pulse one place of the sequence, 0 two (full steps)"),
    Pin("CLOCK", None, PinKind.INPUT, "drive without a unit: a falling edge is a step"),
    Pin("DIR", None, PinKind.INPUT, "drive without a unit: 1 = plus"),
    Pin("DONE", None, PinKind.OUTPUT, "step detector: 1 while the rotor has made every step it was asked for"),
    Pin("X", None, PinKind.OUTPUT, "encoder on the rotor, a quarter cycle a step, ahead of Y in the direction plus"),
    Pin("Y", None, PinKind.OUTPUT, "encoder on the rotor"),
)
QUADRATURE = ((LOW, LOW), (HIGH, LOW), (HIGH, HIGH), (LOW, HIGH))


class Contact(NamedTuple):
    """A switch on the axis: at `inside` while the rotor is between `low` and `high`, in steps (or for ever)."""

    name: str
    low: float
    high: float
    inside: Level

    @property
    def pin(self) -> Pin:
        """Its contact, as a pin of the mechanics."""
        return Pin(self.name, None, PinKind.OUTPUT, "contact on the axis")

    def side(self, place: float) -> int:
        """Where the rotor is: -1 below, 0 within, 1 above."""
        return -1 if place < self.low else 1 if place > self.high else 0

    def level(self, side: int) -> Level:
        """The level of the contact there."""
        return HIGH + LOW - self.inside if side else self.inside

    def __deepcopy__(self, _: object) -> "Contact":
        return self


class Detector(NamedTuple):
    """The step detector: a step is made when the rotor is less than `window` steps short of it; told `delay` later."""

    window: float = 0.5
    delay: Ns = 1 * US

    def __deepcopy__(self, _: object) -> "Detector":
        return self


DETECTOR = Detector()
