"""``[boards.NAME]`` and ``[hardware.UNIT]``: which pin of which board is a pin of a unit.

Pins of boards are written as users of 3D printers write them: ``!`` active low, ``^`` pull-up, ``~`` pull-down before
the name. A cell runs everywhere with these tables; only a service that is told to drive real pins opens the boards.
"""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, model_validator

from detent.cell.fields import STRICT, DurationField, Flag, KeyFault, Names, NoFlag, Number
from detent.ticks import MS, SECOND, US, Ns, parse_duration

LEAST_LEAD: Ns = 3 * MS
MOST_LEAD: Ns = SECOND // 2
LEAST_MARGIN: Ns = 1 * MS
LEAST_WATCHDOG: Ns = 200 * MS
_PIN = re.compile(r"(?P<signs>[!^~ ]*)(?P<name>[^!^~\s]{1,64})")


def _signed(value: str) -> str:
    found = _PIN.fullmatch(value.strip())
    signs = found["signs"].replace(" ", "") if found else ""
    if (
        found is None
        or not found["name"].isprintable()
        or signs.count("!") > 1
        or signs.count("^") + signs.count("~") > 1
    ):
        raise ValueError("write a pin of a board like gpio7, !gpio7 (active low) or ^gpio7 (pull-up)")
    return signs + found["name"]


def _plain(value: str) -> str:
    value = _signed(value)
    if "^" in value or "~" in value:
        raise ValueError("an output has no pull: leave out ^ and ~")
    return value


def _error(value: object) -> Ns | Literal["exact"]:
    if value == "exact":
        return "exact"
    error = parse_duration(value) if isinstance(value, (str, int, float)) and not isinstance(value, bool) else -1
    if not 1 <= error <= 100 * US:
        raise ValueError("the error of a pulse is 'exact' (the nearest tick), or a time up to 100 us like '1 us'")
    return error


InputPin = Annotated[str, AfterValidator(_signed)]
OutputPin = Annotated[str, AfterValidator(_plain)]
ErrorField = Annotated[Ns | Literal["exact"], BeforeValidator(_error)]


class _Table(BaseModel):
    model_config = STRICT


class Board(_Table):
    """``[boards.NAME]``: a board with stock Klipper firmware, and how it is driven."""

    serial: str
    """The device: a name in `/dev/serial/by-id` stays the same whatever is plugged in when; `fake:` is a board of our
    own that moves nothing, with the switches of the cell file that have `machine = true`."""
    lead: DurationField = 30 * MS
    """What leaves the pins is so long behind the cell: 3 to 500 ms, the same on all boards of a cell."""
    margin: DurationField | None = None
    """A pulse that would be due in less is late, and the rest of its unit slips: 1 ms to a third of the lead; left out:
    4 ms, or a third of a shorter lead."""
    error: ErrorField = 1 * US
    """How far a pulse may be from its time, 100 us at most; `exact`: the nearest tick."""
    watchdog: DurationField = 2 * SECOND
    """Drivers are let go, and outputs fall to their levels at rest, when nobody has refreshed them for so long: 200 ms
    and four leads at least."""
    replies: Literal["held", "at once"] = "held"
    """Hosts hear what is said when nothing can change it any more, a lead and 5 ms later; or at once."""

    @model_validator(mode="after")
    def _sane(self) -> "Board":
        if not self.serial.strip() or not self.serial.isprintable():
            raise KeyFault("serial", "the device of the board: ls /dev/serial/by-id shows those that are plugged in")
        if not LEAST_LEAD <= self.lead <= MOST_LEAD:
            raise KeyFault("lead", f"{LEAST_LEAD // MS} to {MOST_LEAD // MS} ms; 30 ms do on every computer")
        if self.margin is not None and not LEAST_MARGIN <= self.margin <= self.lead // 3:
            most = f"{self.lead // 3 / MS:.3g} ms here: leave it out, or take a longer lead"
            raise KeyFault("margin", f"{LEAST_MARGIN // MS} ms to a third of the lead, {most}")
        least = max(LEAST_WATCHDOG, 4 * self.lead)
        if self.watchdog < least:
            raise KeyFault("watchdog", f"at least {least // MS} ms here: a busy computer needs that")
        return self


class Driver(_Table):
    """How a stepper driver gets its current: a chip whose registers are set, or a plain one with an input for half."""

    kind: Literal["plain", "tmc2208", "tmc2209", "tmc2130", "tmc5160"]
    """A chip whose registers are set, or a plain driver with an input that halves its current."""
    half: OutputPin | None = None
    """Plain: high while half of the current will do."""
    amperes: Annotated[Number, Field(gt=0)] | None = None
    """A: of a phase, for full power; the most that the chip is told, where the controller commands amperes."""
    sense: Annotated[Number, Field(ge=0.005, le=5)] = 0.11
    """Ohm: the sense resistors."""
    microsteps: Annotated[Literal[1, 2, 4, 8, 16, 32, 64], NoFlag] | None = None
    """Pulses a full step, under a controller that commands none."""
    uart: InputPin | None = None
    """tmc2208, tmc2209: the pin of the UART."""
    transmit: OutputPin | None = None
    """The pin that sends, where it is not that of `uart`."""
    address: Annotated[int, NoFlag, Field(ge=0, le=3)] = 0
    """tmc2209: of several on one UART."""
    select: OutputPin | None = None
    """tmc2130, tmc5160: the pin that selects the chip; `bus` goes with it, or `clock`, `mosi` and `miso`."""
    bus: str | None = None
    """A name of the board's own SPI."""
    clock: OutputPin | None = None
    """SPI by three pins."""
    mosi: OutputPin | None = None
    """SPI by three pins."""
    miso: InputPin | None = None
    """SPI by three pins."""
    quiet: Flag = False
    """StealthChop instead of SpreadCycle."""
    interpolate: Flag = True
    """The chip makes 256 microsteps of those that it is given."""

    @model_validator(mode="after")
    def _fits(self) -> "Driver":
        if self.kind == "plain":
            if self.microsteps is not None:
                raise KeyFault("microsteps", "a plain driver has its own switches for them: leave this key out")
            if self.half is None:
                raise KeyFault(
                    "half", "a plain driver needs it, half = 'PIN', the input that halves its current; or no table"
                )
            return self
        if self.half is not None:
            raise KeyFault("half", f"a {self.kind} gets its current by its registers: leave this key out")
        if self.kind in ("tmc2208", "tmc2209"):
            if self.uart is None:
                raise KeyFault("uart", f"a {self.kind} is told by its UART: uart = 'PIN'")
        elif self.select is None:
            raise KeyFault("select", f"a {self.kind} is told by SPI: select = 'PIN', and bus or clock, mosi and miso")
        elif (self.bus is None) == (self.clock is None or self.mosi is None or self.miso is None):
            raise KeyFault("bus", "give bus = 'NAME' of the board's own SPI, or the pins clock, mosi and miso")
        return self

    def pins(self) -> dict[str, str]:
        """The pins of the board that it takes, by key."""
        keys = ("half", "uart", "transmit", "select", "clock", "mosi", "miso")
        return {key: pin for key in keys if (pin := getattr(self, key)) is not None}


class Hardware(_Table):
    """``[hardware.UNIT]``, ``[hardware.UNIT.AXIS]`` where it has several: the pins of a board behind an axis.

    A table of a unit with several axes, without an axis, has what they share: `inputs` and `outputs`.
    """

    board: str
    """The board they are on."""
    step: OutputPin | None = None
    """Step clock; left out in a table that a unit with several axes shares."""
    dir: OutputPin | None = None
    """Direction, high for plus."""
    minus: OutputPin | None = None
    """The clock of the minus direction, of a driver with two; `dir` then is a pin with nothing on it."""
    enable: OutputPin | None = None
    """Of the driver: on while the unit is."""
    pulse: DurationField | None = None
    """How long a step pulse is at least, and the direction holds behind it; left out: the controller's."""
    outputs: dict[str, OutputPin] = {}
    """Outputs of the controller, by its names."""
    inputs: dict[str, InputPin] = {}
    """Inputs of the controller; one that is wired here takes no wire, no script, and no switch but of the machine."""
    unwired: Names = []
    """Limit and home switches that this machine does not have."""
    sample: DurationField = 50 * US
    """An input that stops an axis is looked at so often: 10 us to 10 ms."""
    samples: Annotated[int, NoFlag, Field(ge=1, le=255)] = 2
    """And believed after so many looks that are alike."""
    driver: Driver | None = None
    """How a stepper driver gets its current: a table `driver`."""

    @model_validator(mode="after")
    def _whole(self) -> "Hardware":
        if self.step is None:
            for key in ("dir", "minus", "enable", "pulse", "driver"):
                if getattr(self, key) is not None:
                    raise KeyFault(key, "it is of an axis that is driven: give step = 'PIN' too")
        elif self.dir is None:
            what = "this key is missing: the firmware needs a pin for it, a spare one where there are two clocks"
            raise KeyFault("dir", what)
        if not 10 * US <= self.sample <= 10 * MS:
            raise KeyFault("sample", "10 us to 10 ms")
        return self

    def pins(self) -> dict[str, str]:
        """The pins of the board that it takes, by key."""
        found = {key: pin for key in ("step", "dir", "minus", "enable") if (pin := getattr(self, key)) is not None}
        found |= {f"outputs.{name}": pin for name, pin in self.outputs.items()}
        found |= {f"inputs.{name}": pin for name, pin in self.inputs.items()}
        if self.driver is not None:
            found |= {f"driver.{key}": pin for key, pin in self.driver.pins().items()}
        return found


def by_axis(tables: object) -> object:
    """The tables of axes within those of units, under names like ``slide.X``."""
    if not isinstance(tables, Mapping):
        return tables
    found: dict[str, Any] = {}
    for unit, table in tables.items():
        if not isinstance(table, Mapping):
            found[str(unit)] = table
            continue
        keys = Hardware.model_fields
        axes = {
            k: v for k, v in table.items() if isinstance(v, Mapping) and k not in keys and (not v or v.keys() & keys)
        }
        found |= {f"{unit}.{axis}": each for axis, each in axes.items()}
        if len(axes) < len(table) or not table:
            found[str(unit)] = {key: value for key, value in table.items() if key not in axes}
    return found
