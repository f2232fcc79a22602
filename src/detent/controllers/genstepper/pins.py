"""The connectors of the two boards (manual, pages 59 to 63), their jumpers, what the order chose (pages 11 to 13)."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from detent.pins import HIGH, LOW, Level, Pin, PinKind, PulseOutput
from detent.uart import Format, SerialPort

BS0610 = "bs0610"
BS0710 = "bs0710"

AXES = ("X", "Y")

_IN, _STRAP, _OUT = PinKind.INPUT, PinKind.STRAP, PinKind.OUTPUT

WINDINGS = ("WB2", "WB1", "WA2", "WA1")  # as on the connector, and in the stepping table


def winding(axis: str, name: str) -> str:
    """The pin of a winding end on the connector of an axis, like XWA1."""
    return axis + name


_MOTOR_HELP = {
    "WB2": "winding B, pin 2", "WB1": "winding B, pin 1", "WA2": "winding A, pin 2", "WA1": "winding A, pin 1",
}  # fmt: skip

LIMITS = ("LY-", "LY+", "LX-", "LX+")  # in the order of their bits in T, L... and in memory location 5
SLEWS = ("Y-", "Y+", "X-", "X+")  # in the order of their bits in E and in memory location 6

_COMMON: tuple[Pin, ...] = (
    Pin("RST", None, _IN, "low: resets the board, and keeps it so"),
    Pin("LY-", None, _IN, "low: minimum limit of Y reached (T inverts it)"),
    Pin("LY+", None, _IN, "low: maximum limit of Y reached"),
    Pin("LX-", None, _IN, "low: minimum limit of X reached"),
    Pin("LX+", None, _IN, "low: maximum limit of X reached"),
    Pin("Y-", None, _IN, "low: slew Y negative; a step request in E mode"),
    Pin("Y+", None, _IN, "low: slew Y positive; a step request in E mode"),
    Pin("X-", None, _IN, "low: slew X negative; a step request in E mode"),
    Pin("X+", None, _IN, "low: slew X positive; a step request in E mode"),
    Pin("NXT", None, _IN, "going low: next rate of the list, for both motors"),
    Pin("RDY", None, _OUT, "1: both motors idle; 0: one moves, or E mode"),
    Pin("SI", None, PinKind.SERIAL, "serial input as the processor sees it, from the host"),
    Pin("SO", None, PinKind.SERIAL, "serial output of the processor, to the host"),
    Pin("VC", None, _IN, "logic supply: low stands for less than 4.2 V, which resets the board"),
    Pin("VM", None, PinKind.SUPPLY, "motor supply, 4.5 to 34 V"),
    Pin("GND", None, PinKind.SUPPLY, "ground"),
    *(
        Pin(winding(axis, name), None, PinKind.WINDING, f"{axis} motor, {_MOTOR_HELP[name]}: 1 with current", LOW)
        for axis in AXES
        for name in WINDINGS
    ),
    Pin("JS", None, _STRAP, "low (installed): the host is on RS-232 or USB; open: on SI and SO, at TTL levels"),
)  # fmt: skip

_HALF = "low (installed): half power after a reset, or a quarter of the baud rate with DUALBAUD"
_DOUBLE = Pin("R1K", None, _STRAP, "low (installed): one motor with double current on both connectors")

_FUL = "low (installed): full power after a reset, on artwork GR, which has it beside HLF"
_EARLY = "low (installed): what HLF does, on artworks before GR"

PINS: Mapping[str, tuple[Pin, ...]] = {
    BS0610: (*_COMMON, Pin("S1K", None, _STRAP, _HALF), _DOUBLE),
    BS0710: (*_COMMON, Pin("HLF", None, _STRAP, _HALF), Pin("FUL", None, _STRAP, _FUL),
             Pin("S1K", None, _STRAP, _EARLY), _DOUBLE),
}  # fmt: skip
HALF_JUMPERS = ("S1K", "HLF")  # one jumper with two names, by artwork (page 67)

DEFAULT_STRAPS: Mapping[str, Mapping[str, Level]] = {
    model: {pin.name: LOW if pin.name == "JS" else HIGH for pin in table if pin.kind is _STRAP}
    for model, table in PINS.items()
}

NO_STEP_CLOCK = PulseOutput({}, 0, HIGH)  # the drivers are on the board: steps leave it as winding currents

SERIAL_PORT = SerialPort("SI", "SO", early=Fraction(3, 4), start_bits=True)
"""A character is recognised a quarter into its stop bit (page 22)."""


class Order(NamedTuple):
    """What was chosen when the board was ordered: its state after power-on and reset."""

    step_size: int = 4  # in 1/64 of a full step
    stop_rate: int = 80
    ramp: int = 8000
    run_rate: int = 800
    auto_rate: int = 3072
    auto_mode: int = 2
    high_power: int = 0  # the H of a board without the half power jumper
    low_power: int = 1  # and with it
    idle_windings: int = 0
    hard_stop: bool = False
    e_mode: int = 0
    double_current: bool = False  # whatever the jumper R1K says
    slew_inputs: bool = True
    dual_baud: bool = False
    baud: int = 9600

    def __deepcopy__(self, _: object) -> "Order":
        return self


def half_installed(straps: Mapping[str, Level]) -> bool:
    """Whether the half power jumper is installed, under either name."""
    return any(straps.get(name) == LOW for name in HALF_JUMPERS)


def character_format(order: Order, straps: Mapping[str, Level]) -> Format:
    """Characters on the line: 8N1, at a quarter of the rate with DUALBAUD and the half power jumper (page 13)."""
    slow = order.dual_baud and half_installed(straps)
    return Format(order.baud // 4 if slow else order.baud, 8, "none", 1)


def strap_line(model: str, units: Sequence[tuple[str, Mapping[str, Level]]]) -> list[dict[str, Level]]:
    """The straps of the board on a line: one board has a line to itself. Raises ValueError."""
    if len(units) > 1:
        names = " and ".join(name for name, _ in units)
        raise ValueError(f"{names} cannot share a line: these boards have no addresses, give each a line of its own")
    for _, named in units:
        _check_jumpers(named)
    return [{**DEFAULT_STRAPS[model], **named} for _, named in units]


def _check_jumpers(named: Mapping[str, Level]) -> None:
    """Raise ValueError for jumpers that no board has together (page 67)."""
    if "S1K" in named and named.keys() & {"HLF", "FUL"}:
        raise ValueError("a BS0710 has S1K, or from artwork GR on HLF in its place: name the one that it has (page 67)")
    full = named.get("FUL")
    if full is not None and (full == LOW) == half_installed(named):
        raise ValueError(
            "of FUL and HLF exactly one must be installed; on a board without FUL name HLF alone (page 67)"
        )
