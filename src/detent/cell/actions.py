"""What can be done to a cell from outside: by its script, by a host, by a hand. Each is data that can be kept."""

from typing import NamedTuple, TypeAlias

from detent.cell.faults import Fault
from detent.pins import Level
from detent.ticks import Ns
from detent.uart import Chars


class Send(NamedTuple):
    """The host of a line sends characters."""

    line: int
    data: Chars


class Discard(NamedTuple):
    """The host of a line takes back what it has not begun to send."""

    line: int


class Type(NamedTuple):
    """The host of a unit sends it a command line; its link adds address, checksum and terminator."""

    unit: str
    text: str


class SetSwitch(NamedTuple):
    """A switch is put to a level."""

    switch: str
    level: Level


class SetPin(NamedTuple):
    """An input is given a level from outside."""

    unit: str
    pin: str
    level: Level


class Release(NamedTuple):
    """An input that was given a level from outside is left to its wire."""

    unit: str
    pin: str


class Power(NamedTuple):
    """The supply of a unit is switched."""

    unit: str
    on: bool


class Load(NamedTuple):
    """A program is put into the memory of a unit from address `base` on."""

    unit: str
    image: bytes
    base: int


class PlaceSwitch(NamedTuple):
    """A switch on an axis is put elsewhere: `low` to `high` as in a cell file, None without end."""

    switch: str
    low: float | None
    high: float | None


class Start(NamedTuple):
    """The program in a unit's memory is started."""

    unit: str


class Halt(NamedTuple):
    """All axes of a unit stop at once, and its program: what moves them has failed."""

    unit: str


class Displace(NamedTuple):
    """An axis at rest is found `by` steps from where it was commanded to."""

    unit: str
    axis: str
    by: int


class Break(NamedTuple):
    """Something breaks, for a time or until it is mended. Faults are numbered from 1, in the order of their begin."""

    fault: Fault
    lasting: Ns | None = None


class Mend(NamedTuple):
    """A fault is mended."""

    fault: int


Action: TypeAlias = (
    Send
    | Discard
    | Type
    | SetSwitch
    | SetPin
    | Release
    | Power
    | Start
    | Load
    | PlaceSwitch
    | Halt
    | Displace
    | Break
    | Mend
)


class TimedAction(NamedTuple):
    """An action and its time: an entry of a script, or of a cell's journal.

    What was done from `outside` comes when everything else of its instant has happened.
    """

    at: Ns
    what: Action
    outside: bool = False
