"""The connectors J1, J2, J4 of the DCB-274, its jumpers, and what they select (manual, pages 6, 7 and 12).

Jumpers are straps: 1 (high) is fitted, 0 (low) is left off. `PLC` 1 is the three-pin jumper in the PLC position,
0 in the STD position.
"""

from collections.abc import Mapping, Sequence

from detent.pins import HIGH, LOW, Level, Pin, PinKind, PulseOutput
from detent.ramps.timer_table import TICK
from detent.ticks import US, Ns
from detent.uart import Format, SerialPort

STEP_LOW: Ns = TICK  # of the step output, "short negative going pulses" (page 45), and of STEPS
LEAST_STEP_LOW: Ns = 7 * US  # of the step input (page 10)
DIRECTION_HELD: Ns = 10 * US  # behind a rising edge of the step input, else the step is none (page 10)
DIRECTION_HOLD: Ns = 11 * US  # of the direction output, behind a rising step edge: more than those 10 us
LEAST_STEP_PERIOD: Ns = 62_500  # 16 000 steps a second (page 10)

_IN, _STRAP, _OUT = PinKind.INPUT, PinKind.STRAP, PinKind.OPEN_COLLECTOR

_BEFORE_P4 = (
    Pin("P1", 1, _IN, "port 1, input (J1)"),
    Pin("P2", 2, _IN, "port 2, input"),
    Pin("P3", 3, _IN, "port 3, input"),
)
_P4_OUT = Pin("P4", 4, _OUT, "port 4, output: 0 when on; step output with l 2")
_P4_IN = Pin("P4", 4, _IN, "port 4, input (jumpers JP1, JP2; l 16)")
_AFTER_P4 = (
    Pin("P5", 5, _OUT, "port 5, output: 0 when on; direction output with l 2, 0 while moving with l 4"),
    Pin("JOG1", 8, _IN, "jog in plus direction"),
    Pin("JOG-S", 9, _IN, "jog at the high speed"),
    Pin("JOG2", 10, _IN, "jog in minus direction"),
    Pin("STEP", 11, _IN, "step input: a rising edge is a step; encoder phase A"),
    Pin("DIR", 12, _IN, "direction input: 1 = plus; encoder phase B"),
    Pin("HOME", 1, _IN, "home switch (J4)"),
    Pin("LIMIT-A", 2, _IN, "limit of the plus direction"),
    Pin("LIMIT-B", 3, _IN, "limit of the minus direction"),
    Pin("GO", 4, _IN, "start the program at address 0"),
    Pin("SS", 5, _IN, "soft stop"),
    Pin("RX", 6, PinKind.SERIAL, "received data, RX+ and RX- (J2, pins 6 and 3)"),
    Pin("TX", 5, PinKind.SERIAL, "transmitted data, TX+ and TX- (J2, pins 5 and 4)"),
    Pin("PARTY", 8, _STRAP, "party select (J2): 1 = party line, 0 = single mode; read at reset", LOW),
    Pin("B1", None, _STRAP, "baud rate jumper", LOW),
    Pin("B2", None, _STRAP, "baud rate jumper", LOW),
    Pin("PLC", None, _STRAP, "0: STD, inputs pulled up; 1: PLC, inputs pulled down", LOW),
    Pin("STEPS", None, PinKind.OUTPUT, "steps as the drive gets them, inside the unit: low for 8 us"),
    Pin("GND", 6, PinKind.SUPPLY, "power common (J1 and J4)"),
    Pin("5V", 7, PinKind.SUPPLY, "logic power (J1), 5 V for the serial adapter (J2)"),
    Pin("VIO", 7, PinKind.SUPPLY, "reference of the inputs (J4)"),
)

PINS: tuple[Pin, ...] = (*_BEFORE_P4, _P4_OUT, *_AFTER_P4)
PINS_P4_INPUT: tuple[Pin, ...] = (*_BEFORE_P4, _P4_IN, *_AFTER_P4)

INPUTS: tuple[str, ...] = tuple(pin.name for pin in PINS_P4_INPUT if pin.kind is _IN)

STEPS_OUTPUT = PulseOutput({1: "STEPS", -1: "STEPS"}, STEP_LOW, LOW)

SERIAL_PORT = SerialPort("RX", "TX")

DEFAULT_STRAPS: Mapping[str, Level] = {"PARTY": LOW, "B1": LOW, "B2": LOW, "PLC": LOW}

_BAUD = {(LOW, LOW): 9_600, (HIGH, LOW): 460_800, (LOW, HIGH): 38_400, (HIGH, HIGH): 19_200}


def character_format(straps: Mapping[str, Level]) -> Format:
    """The line format that the baud rate jumpers B1 and B2 select: 8 data bits, no parity (page 12)."""
    return Format(_BAUD[straps["B1"], straps["B2"]])


def strap_line(units: Sequence[tuple[str, Mapping[str, Level]]]) -> list[dict[str, Level]]:
    """The straps of the units that share a line: those that are named, else `DEFAULT_STRAPS`.

    Several units on one line without an adapter are on a party line: PARTY is on unless it is named.
    """
    shared = {"PARTY": HIGH} if len(units) > 1 else {}
    return [{**DEFAULT_STRAPS, **shared, **named} for _, named in units]
