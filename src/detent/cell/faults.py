"""What can break in a cell: lines, contacts, inputs, memories, supplies. Each is data that can be kept."""

from typing import NamedTuple, TypeAlias

from detent.lines.faults import LineFault
from detent.pins import Level


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
