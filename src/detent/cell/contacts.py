"""What a motor in a cell shows to wires: its pins, the contacts on its axis, the step detector."""

from math import inf, nextafter
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


class Edge(NamedTuple):
    """An edge lies between two neighbouring floats: the last angle on its lower side, the first on its upper.

    So every angle is on one side of it and on no other, and a rotor that stands there crosses nothing.
    """

    below: float
    above: float

    @classmethod
    def at(cls, angle: float, *, upper: bool) -> "Edge":
        """The edge at `angle`, which itself belongs to the upper side or to the lower one."""
        if abs(angle) == inf:
            return cls(angle, angle)
        return cls(nextafter(angle, -inf), angle) if upper else cls(angle, nextafter(angle, inf))


class Contact(NamedTuple):
    """A switch on the axis: at `inside` while the rotor is between `low` and `high`, in steps (or for ever).

    A cell file counts its places in `lead` to a step; `margin` steps are added at each end of what it says.
    """

    name: str
    low: float
    high: float
    inside: Level
    lead: float = 1.0
    margin: float = 0.0

    @property
    def range(self) -> tuple[float | None, float | None]:
        """Where it begins and ends, as a cell file counts; None: never."""
        ends = ((self.low + self.margin) * self.lead, (self.high - self.margin) * self.lead)
        low, high = min(ends), max(ends)
        return None if low == -inf else low, None if high == inf else high

    def moved(self, low: float | None, high: float | None) -> "Contact":
        """The same contact elsewhere, as a cell file counts. ValueError if it has no width, or ends before it begins.

        None: without end there.
        """
        if low is None and high is None:
            raise ValueError(f"switch {self.name} needs a place: an end at least")
        begin, end = -inf if low is None else low / self.lead, inf if high is None else high / self.lead
        if self.lead < 0:
            begin, end = (-inf if high is None else end), (inf if low is None else begin)
        begin, end = begin - self.margin, end + self.margin
        if not begin < end:  # or one of them is NaN
            raise ValueError(f"switch {self.name} has no width: give from and to, in this order")
        return self._replace(low=begin, high=end)

    @property
    def pin(self) -> Pin:
        """Its contact, as a pin of the mechanics."""
        return Pin(self.name, None, PinKind.OUTPUT, "contact on the axis")

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
