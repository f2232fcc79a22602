"""The signals of one drive's board (the paper's figures 8 and 9).

The paper names T0, P23 and P24 and the two lines of the handshake; it leaves open which bit is /ANSWER READY, what
the two status lines say, and how the two emergency inputs are called: those names and meanings are ours.
"""

from collections.abc import Mapping, Sequence

from detent.pins import HIGH, LOW, Level, Pin, PinKind, PulseOutput
from detent.uart import Format, SerialPort

BUS, T0, ANSWER, MOVING, ATTENTION = "BUS", "T0", "ANSWER", "P23", "P24"
RAIL, FORCE, DIRECTION, STEP = "RAIL", "FORCE", "DIR", "OUT0"

STEP_LOW_NS = 500  # counter 0 of the 8253 takes its output low for one clock a period

PINS: tuple[Pin, ...] = (
    Pin(BUS, None, PinKind.BUS, "MICROBUS, eight lines: every drive sees every byte of the CCU"),
    Pin(T0, 1, PinKind.INPUT, "/DATA READY: 0 while the CCU has a byte on the bus"),
    Pin(ANSWER, None, PinKind.OPEN_COLLECTOR, "/ANSWER READY: 0 while this drive has a byte on the bus"),
    Pin(MOVING, 24, PinKind.OUTPUT, "status line: 1 while the motor moves", LOW),
    Pin(ATTENTION, 35, PinKind.OUTPUT, "status line: 1 while a flag of status wants attention (02h, 04h, 10h)", LOW),
    Pin(RAIL, None, PinKind.INPUT, "0 at the end of the rail: emergency braking; the limit switch of origination"),
    Pin(FORCE, None, PinKind.INPUT, "0 under excessive force: emergency braking"),
    Pin(DIRECTION, None, PinKind.OUTPUT, "direction: 1 = forward", HIGH),
    Pin(STEP, None, PinKind.OUTPUT, "pulse train of the 8253's counter 0: rests at 1, each step is a low of 500 ns"),
)

STEP_OUTPUT = PulseOutput({1: STEP, -1: STEP}, STEP_LOW_NS, LOW)

PORT = SerialPort(BUS, BUS)

BUS_FORMAT = Format(200_000)
"""How fast the bus is (our assumption): a byte takes 50 us, as ten bits at 200 000 baud would. In its second half
the strobe is low, /DATA READY or /ANSWER READY; the byte has been taken when the strobe goes high."""

DEFAULT_STRAPS: Mapping[str, Level] = {}


def strap_line(units: Sequence[tuple[str, Mapping[str, Level]]]) -> list[dict[str, Level]]:
    """The board has no straps."""
    return [{} for _ in units]
