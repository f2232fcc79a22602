"""What can be done to a cell from outside: by its script, by a host, by a hand. Each is data that can be kept."""

from typing import NamedTuple, Protocol, TypeAlias

from detent.cell.breakage import Fault
from detent.pins import Level
from detent.ticks import Ns
from detent.uart import Chars


class Doer(Protocol):
    """The cell, as deeds know it."""

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now."""

    def type(self, unit: str, text: str) -> None:
        """The host of a unit sends it a command line, now."""

    def set_switch(self, name: str, level: Level) -> None:
        """Put a switch to a level, now."""

    def set_pin(self, unit: str, pin: str, level: Level) -> None:
        """Drive an input pin from outside, now."""

    def release(self, unit: str, pin: str) -> None:
        """Leave an input pin to its wire again, now."""

    def power(self, unit: str, on: bool) -> None:
        """Switch the supply of a unit, now."""

    def load(self, unit: str, image: bytes, base: int) -> None:
        """Put a program into a unit's memory, now."""

    def start(self, unit: str) -> None:
        """Start the program in a unit's memory, now."""

    def place_switch(self, name: str, low: float | None, high: float | None) -> None:
        """Put a switch elsewhere on its axis, now."""

    def halt(self, unit: str) -> None:
        """Stop all axes of a unit at once, now."""

    def displace(self, unit: str, axis: str, by: int) -> None:
        """An axis at rest is found elsewhere, now."""

    def breaks(self, fault: Fault, lasting: Ns | None) -> int:
        """Something breaks, now; its number."""

    def mend(self, fault: int) -> None:
        """The fault of this number is mended, now."""


class Send(NamedTuple):
    """The host of a line sends characters."""

    line: int
    data: Chars

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.send(self.line, self.data)


class Type(NamedTuple):
    """The host of a unit sends it a command line; its link adds address, checksum and terminator."""

    unit: str
    text: str

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.type(self.unit, self.text)


class SetSwitch(NamedTuple):
    """A switch is put to a level."""

    switch: str
    level: Level

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.set_switch(self.switch, self.level)


class SetPin(NamedTuple):
    """An input is given a level from outside."""

    unit: str
    pin: str
    level: Level

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.set_pin(self.unit, self.pin, self.level)


class Release(NamedTuple):
    """An input that was given a level from outside is left to its wire."""

    unit: str
    pin: str

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.release(self.unit, self.pin)


class Power(NamedTuple):
    """The supply of a unit is switched."""

    unit: str
    on: bool

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.power(self.unit, self.on)


class Load(NamedTuple):
    """A program is put into the memory of a unit from address `base` on."""

    unit: str
    image: bytes
    base: int

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.load(self.unit, self.image, self.base)


class PlaceSwitch(NamedTuple):
    """A switch on an axis is put elsewhere: `low` to `high` as in a cell file, None without end."""

    switch: str
    low: float | None
    high: float | None

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.place_switch(self.switch, self.low, self.high)


class Start(NamedTuple):
    """The program in a unit's memory is started."""

    unit: str

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.start(self.unit)


class Halt(NamedTuple):
    """All axes of a unit stop at once, and its program: what moves them has failed."""

    unit: str

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.halt(self.unit)


class Displace(NamedTuple):
    """An axis at rest is found `by` steps from where it was commanded to."""

    unit: str
    axis: str
    by: int

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.displace(self.unit, self.axis, self.by)


class Break(NamedTuple):
    """Something breaks, for a time or until it is mended. Faults are numbered from 1, in the order of their begin."""

    fault: Fault
    lasting: Ns | None = None

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.breaks(self.fault, self.lasting)


class Mend(NamedTuple):
    """A fault is mended."""

    fault: int

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.mend(self.fault)


Deed: TypeAlias = (
    Send | Type | SetSwitch | SetPin | Release | Power | Start | Load | PlaceSwitch | Halt | Displace | Break | Mend
)


class Action(NamedTuple):
    """A deed and its time: an entry of a script, or of a cell's journal.

    What was done from `outside` comes when everything else of its instant has happened.
    """

    at: Ns
    deed: Deed
    outside: bool = False
