"""Pins, levels and nets: what a wire carries, and who may drive it.

A level is the plain integer 0 or 1, as the manuals print it. A `Pin` is one row of a controller's
pin table; the netlist, the help, the documentation and the recordings read the same rows.
"""

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import NamedTuple, Protocol, TypeAlias

from detent.ticks import Ns

Level: TypeAlias = int

LOW: Level = 0
HIGH: Level = 1


class PinKind(Enum):
    """What a pin does on a net."""

    INPUT = "input"  # TTL input with a pull-up: reads 1 when nothing drives it
    STRAP = "strap"  # an input that the firmware reads at power-on only
    OUTPUT = "output"  # push-pull
    OPEN_COLLECTOR = "open collector"  # pulls to 0 or lets go; the net's pull-up makes it 1
    WINDING = "winding"  # push-pull, feeds a motor; its level is told only if a wire leads to another device
    SERIAL = "serial"  # carries characters, belongs to a line
    BUS = "bus"  # carries characters on several wires at once, belongs to a line
    SUPPLY = "supply"  # power in or out, ground, not connected

    @property
    def drives(self) -> bool:
        """Whether a pin of this kind can set the level of a net."""
        return self in (PinKind.OUTPUT, PinKind.OPEN_COLLECTOR, PinKind.WINDING)

    @property
    def reads(self) -> bool:
        """Whether a pin of this kind follows the level of a net."""
        return self in (PinKind.INPUT, PinKind.STRAP)


class Pin(NamedTuple):
    """One pin of a device: the manual's name and number, its kind, its level at rest, one line of help.

    `rest` is the level an output has when powered and idle, and what an input reads when nothing drives it.
    """

    name: str
    number: int | None
    kind: PinKind
    help: str
    rest: Level = HIGH


def find_pin(pins: Sequence[Pin], name: str) -> Pin | None:
    """The pin of that name."""
    return next((pin for pin in pins if pin.name == name), None)


class PulseOutput(NamedTuple):
    """How step pulses leave a controller: the pin for each direction (+1, -1), `width` ns at level `active`.

    `common` is a further pin, if there is one, with the pulses of both directions.
    """

    pins: Mapping[int, str]
    width: Ns
    active: Level
    common: str = ""

    @property
    def clocks(self) -> tuple[str, ...]:
        """Every pin that carries step pulses, once each."""
        return tuple(dict.fromkeys((*self.pins.values(), *([self.common] if self.common else []))))

    def given_by(self, direction: int) -> tuple[str, ...]:
        """The pins on which a step in `direction` is a pulse."""
        return (self.pins[direction], self.common) if self.common else (self.pins[direction],)

    def carries(self, pin: str, direction: int) -> bool:
        """Whether a step in `direction` is a pulse on `pin`."""
        return pin in (self.pins[direction], self.common)

    def __deepcopy__(self, _: object) -> "PulseOutput":
        return self


class PinSet(NamedTuple):
    """An output pin takes a level. Only changes are reported, and every change is."""

    at: Ns
    pin: str
    level: Level


class Outbox(Protocol):
    """Where a pin driver tells what it does: its owner's list of outputs."""

    def append(self, item: PinSet, /) -> None:
        """Take the next change."""


class PinDriver:
    """The output pins of one device: their levels, and a `PinSet` for every change."""

    __slots__ = ("_out", "levels")

    def __init__(self, out: Outbox) -> None:
        self.levels: dict[str, Level] = {}
        self._out = out

    def set(self, pin: str, level: Level, now: Ns) -> None:
        """Drive `pin` to `level`."""
        if self.levels.get(pin) != level:
            self.levels[pin] = level
            self._out.append(PinSet(now, pin, level))

    def release(self) -> None:
        """Let go of every pin: the device has lost its supply."""
        self.levels.clear()


class Net:
    """Pins joined by wire. The level is 0 as soon as one driver pulls it to 0, else 1.

    That is the truth for open collectors with a pull-up; a net has at most one push-pull driver
    (:meth:`conflict` names the second), so it holds for that one too. A driver without power lets go.
    """

    __slots__ = ("level", "levels")

    def __init__(self) -> None:
        self.levels: dict[tuple[int, str], Level] = {}
        self.level: Level = HIGH

    def drive(self, driver: tuple[int, str], level: Level) -> bool:
        """Note the level a driver puts on the net; say whether the net's own level changed."""
        self.levels[driver] = level
        before = self.level
        self.level = HIGH if all(self.levels.values()) else LOW
        return self.level != before
