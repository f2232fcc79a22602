"""What can be done to a cell from outside: by its script, by a host, by a hand. Each is data that can be kept."""

from typing import NamedTuple, Protocol, TypeAlias

from detent.pins import Level
from detent.ticks import Ns


class Doer(Protocol):
    """The cell, as deeds know it."""

    def send(self, line: int, data: bytes) -> None:
        """The host of a line sends `data`, now."""

    def type(self, unit: str, text: str) -> None:
        """The host of a unit sends it a command line, now."""

    def set_switch(self, name: str, level: Level) -> None:
        """Put a switch to a level, now."""

    def set_pin(self, unit: str, pin: str, level: Level) -> None:
        """Drive an input pin from outside, now."""

    def power(self, unit: str, on: bool) -> None:
        """Switch the supply of a unit, now."""

    def start(self, unit: str) -> None:
        """Start the program in a unit's memory, now."""


class Send(NamedTuple):
    """The host of a line sends bytes."""

    line: int
    data: bytes

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


class Power(NamedTuple):
    """The supply of a unit is switched."""

    unit: str
    on: bool

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.power(self.unit, self.on)


class Start(NamedTuple):
    """The program in a unit's memory is started."""

    unit: str

    def do(self, cell: Doer) -> None:
        """Do it, now."""
        cell.start(self.unit)


Deed: TypeAlias = Send | Type | SetSwitch | SetPin | Power | Start


class Action(NamedTuple):
    """A deed and its time: an entry of a script, or of a cell's journal."""

    at: Ns
    deed: Deed
