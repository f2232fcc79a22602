"""The 38 pins of the module (datasheet, "Pin description"), its straps and what they select."""

from collections.abc import Mapping, Sequence

from detent.pins import HIGH, LOW, Level, Pin, PinKind, PulseOutput
from detent.uart import Format, SerialPort

CLOCK_LOW_NS = 1_700  # the step pulse (pin 28)
RESET_LOW_NS = 400_000  # the reset pulse (pin 27)
SUPPLY_V = (12.0, 40.0)  # pins 17 and 18
LOADS_A = {"5V": 0.1, "+VSL": 0.01, "-VSL": 0.01}  # the most that pins 20-21, 16 and 15 give

_IN, _STRAP, _OUT = PinKind.INPUT, PinKind.STRAP, PinKind.OUTPUT

PINS: tuple[Pin, ...] = (
    Pin("SEL0", 1, _STRAP, "protocol and address select, read with SEL1 and SEL2"),
    Pin("SEL1", 2, _STRAP, "protocol and address select"),
    Pin("SEL2", 3, _STRAP, "protocol and address select"),
    Pin("BR0", 4, _STRAP, "baud rate select, read with BR1 and BR2"),
    Pin("BR1", 5, _STRAP, "baud rate select"),
    Pin("BR2", 6, _STRAP, "baud rate select"),
    Pin("CHS", 7, _STRAP, "checksum: open = on, low = off"),
    Pin("GND", 8, PinKind.SUPPLY, "ground"),
    Pin("REC", 9, _STRAP, "low: recall the stored program at power-on, home, and run it"),
    Pin("TEST", 10, _STRAP, "test only: must be tied to pin 8"),
    Pin("RXD", 11, PinKind.SERIAL, "received data; its idle level at power-on chooses the homing direction", LOW),
    Pin("TXD", 12, PinKind.SERIAL, "transmitted data"),
    Pin("TXPD", 13, PinKind.SERIAL, "transmitted data pull-down: low is tied to TXD (one unit of a line), else open"),
    Pin("RDY", 14, PinKind.OPEN_COLLECTOR, "0 while a command or a program is in execution"),
    Pin("-VSL", 15, PinKind.SUPPLY, "-12 V out, 10 mA"),
    Pin("+VSL", 16, PinKind.SUPPLY, "+12 V out, 10 mA"),
    Pin("VS", 17, PinKind.SUPPLY, "supply 12 to 40 V (pins 17 and 18)"),
    Pin("5V", 20, PinKind.SUPPLY, "5 V out, 100 mA (pins 20 and 21)"),
    Pin("MOV", 22, _OUT, "1 while a movement is in execution", LOW),
    Pin("RAMP", 23, _OUT, "1 while an acceleration or deceleration ramp is in execution", LOW),
    Pin("ENABLE", 24, _IN, "0 holds the next step pulse until it is 1 again"),
    Pin("DIR", 26, _OUT, "direction: 1 = clockwise = plus"),
    Pin("RESET", 27, _OUT, "0 for 400 us at power-on and on I1 and I3"),
    Pin("CLOCK", 28, _OUT, "step clock: rests at 1, each step is a low pulse of 1.7 us"),
    Pin("HOME", 30, _IN, "0 at the home position"),
    Pin("UO1", 31, _OUT, "user output 1", LOW),
    Pin("EOT", 32, _IN, "0 at the end of travel"),
    Pin("UO2", 33, _OUT, "user output 2", LOW),
    Pin("UI1", 34, _IN, "user input 1"),
    Pin("UO3", 35, _OUT, "user output 3", LOW),
    Pin("UI2", 36, _IN, "user input 2"),
    Pin("UI3", 37, _IN, "user input 3"),
)

SEPARATE_CLOCKS: tuple[Pin, ...] = (
    Pin("CW", None, _OUT, "step clock, clockwise steps only (circuit of figure 10)"),
    Pin("CCW", None, _OUT, "step clock, counterclockwise steps only (circuit of figure 10)"),
)

PINS_SEPARATE_CLOCKS: tuple[Pin, ...] = PINS + SEPARATE_CLOCKS

CLOCK_OUTPUT = PulseOutput({1: "CLOCK", -1: "CLOCK"}, CLOCK_LOW_NS, LOW)
SEPARATE_CLOCK_OUTPUT = PulseOutput({1: "CW", -1: "CCW"}, CLOCK_LOW_NS, LOW, "CLOCK")

SERIAL_PORT = SerialPort("RXD", "TXD")

DEFAULT_STRAPS: Mapping[str, Level] = {
    "SEL0": HIGH, "SEL1": HIGH, "SEL2": HIGH,  # point to point
    "BR0": LOW, "BR1": LOW, "BR2": LOW,  # 9600 baud
    "CHS": HIGH, "REC": HIGH, "TEST": LOW, "RXD": LOW, "TXPD": LOW,
}  # fmt: skip
"""Detent's straps where a cell names none. RXD: LOW is the level of an open pin or of a line at rest, HIGH is
the pin tied to +5 V. TXPD: LOW is the pin tied to TXD (the pull-down works), HIGH is the pin left open."""

_ADDRESS = {(0, 0, 0): 7, (1, 0, 0): 6, (0, 1, 0): 5, (1, 1, 0): 4, (0, 0, 1): 3, (1, 0, 1): 2, (0, 1, 1): 1}
_BAUD = {(0, 0, 0): 9600, (1, 0, 0): 4800, (0, 1, 0): 2400, (1, 1, 0): 1200,
         (0, 0, 1): 600, (1, 0, 1): 300, (0, 1, 1): 150, (1, 1, 1): 110}  # fmt: skip


def address(straps: Mapping[str, Level]) -> int | None:
    """The unit's address 1-7 on a multipoint line; None on a point-to-point line ("Module address")."""
    return _ADDRESS.get((straps["SEL2"], straps["SEL1"], straps["SEL0"]))


def select(address: int | None) -> dict[str, Level]:
    """The SEL straps that give `address` (1-7), or a point-to-point line (None)."""
    for (sel2, sel1, sel0), value in _ADDRESS.items():
        if value == address:
            return {"SEL0": sel0, "SEL1": sel1, "SEL2": sel2}
    return {"SEL0": HIGH, "SEL1": HIGH, "SEL2": HIGH}


def strap_line(units: Sequence[tuple[str, Mapping[str, Level]]]) -> list[dict[str, Level]]:
    """The straps of the modules that share a line, from those that are named, in the order of the line.

    TXPD is tied to TXD on exactly one of them, where nothing is said of it on the last (pin 13). Several modules need
    a multipoint address each. Raises ValueError with the unit and the remedy.
    """
    straps = [{**DEFAULT_STRAPS, "TXPD": HIGH, **named} for _, named in units]
    silent = [place for place, (_, named) in enumerate(units) if "TXPD" not in named]
    if silent and all(strapped["TXPD"] == HIGH for strapped in straps):
        straps[silent[-1]]["TXPD"] = LOW
    names = [name for name, _ in units]
    tied = [name for name, strapped in zip(names, straps, strict=True) if strapped["TXPD"] == LOW]
    if len(tied) != 1:
        found = f"units {' and '.join(tied)} have it tied" if tied else "it is open on every unit"
        raise ValueError(f"TXPD must be tied to TXD on one unit of a line: {found}; set TXPD = low on {names[-1]} only")
    owners: dict[int, str] = {}
    for name, strapped in zip(names, straps, strict=True):
        if strapped["TEST"] == HIGH:
            raise ValueError(f"pin 10 (TEST) of {name} must be tied to ground: leave TEST out, or set it low")
        number = address(strapped)
        if number is None and len(units) > 1:
            raise ValueError(f"{name} is strapped point to point: give it an address (SEL0-SEL2) or a line of its own")
        if number is not None and number in owners:
            raise ValueError(f"{owners[number]} and {name} both have address {number}: change SEL0-SEL2 of one of them")
        if number is not None:
            owners[number] = name
    return straps


def character_format(straps: Mapping[str, Level]) -> Format:
    """The line format the BR straps select: 7 data bits, odd parity, 2 stop bits ("Baud rate")."""
    return Format(_BAUD[straps["BR0"], straps["BR1"], straps["BR2"]], 7, "odd", 2)
