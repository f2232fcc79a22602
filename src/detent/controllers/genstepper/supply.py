"""Power supplies for a BS0610 or BS0710 (manual, pages 10, 14, 28, 62 to 68): currents, limits, warnings."""

from collections.abc import Iterator
from typing import NamedTuple

LOGIC_CURRENT = 0.3  # A, page 65
WINDING_CURRENT = 1.0  # A, page 8: the driver's limit; double with double current
FAN_CURRENTS = (0.4, 0.6)  # A: page 10 says 0.4, pages 14 and 63 say 0.6
FAN_VOLTAGE = 15.0
MOTOR_VOLTS = (4.5, 34.0)
SINGLE_VOLTS = (6.5, 15.0)
TAP_CURRENT, TAP_FAN_CURRENT = 0.5, 0.1  # A drawn from the board's 5 V
DRIVER_DROP = (1.1, 2.0)  # V lost in the drivers, page 78

SUPPLIES = ("SS", "DS", "5VO")  # the power selection jumper


class StepMode(NamedTuple):
    """A row of the table on page 64: factors on the winding current for a motor's supply."""

    name: str
    absolute: float
    recommended: float


STEP_MODES = (
    StepMode("single winding full step", 1.0, 1.4),
    StepMode("half step, alternate 1/2 windings", 2.0, 2.5),
    StepMode("full step, 2 windings at a time", 2.0, 2.5),
    StepMode("microstep", 1.7, 2.3),
)
EXAMPLE = (
    "the worked example on page 64 takes 2 x 0.4 A for a motor of 0.4 A in mode 3, where the table has 1.7 and 2.3"
)


class Question(NamedTuple):
    """What is to be supplied."""

    voltage: float  # V of the motor supply
    resistance: float  # ohm of one winding
    mode: int = 3
    motors: int = 1
    supply: str = "SS"
    logic_voltage: float | None = None  # V at Vc with two supplies
    half_power: bool = False
    double_current: bool = False
    tap: float = 0.0  # A from the 5 V for a fan or other logic


class Sheet(NamedTuple):
    """The answer: currents in A, and what the manual warns of."""

    winding_current: float
    motor_volts: tuple[float, float]  # what the drivers leave of the supply: least, most
    motor_current: tuple[float, float]  # of all motors: absolute, recommended
    logic_current: float
    supply_current: tuple[float, float]  # of the motor supply: with a single one, logic included
    warnings: tuple[str, ...]


def size(question: Question) -> Sheet:
    """Currents of motors and supplies. ValueError for what is no supply at all."""
    if question.voltage <= 0 or question.resistance <= 0:
        raise ValueError("voltage and resistance are greater than 0")
    if question.mode not in range(len(STEP_MODES)) or question.motors not in (1, 2) or question.tap < 0:
        raise ValueError("mode is 0 to 3, motors 1 or 2, tap a current")
    if question.supply not in SUPPLIES:
        raise ValueError(f"supply is the jumper's position: {', '.join(SUPPLIES)}")
    if question.double_current and question.motors == 2:
        raise ValueError("with double current both connectors drive one motor: motors = 1")
    winding = question.voltage / question.resistance
    if question.half_power:
        winding /= 2
    mode = STEP_MODES[question.mode]
    motors = (winding * mode.absolute * question.motors, winding * mode.recommended * question.motors)
    logic = LOGIC_CURRENT + question.tap
    single = question.supply == "SS"
    whole = (motors[0] + logic, motors[1] + logic) if single else motors
    left = max(question.voltage - DRIVER_DROP[1], 0.0), max(question.voltage - DRIVER_DROP[0], 0.0)
    return Sheet(winding, left, motors, logic, whole, tuple(_warnings(question, winding)))


def voltage_for(current: float, resistance: float) -> float:
    """The motor voltage that gives a winding its current, V = I R (page 65)."""
    return current * resistance


def _warnings(question: Question, winding: float) -> Iterator[str]:
    most = WINDING_CURRENT * (2 if question.double_current else 1)
    per_connector = winding / (2 if question.double_current else 1)
    if winding > most:
        yield f"{winding:.3g} A a winding, the board has {most:g} A: product failure will result (page 7)"
    if per_connector > FAN_CURRENTS[0]:
        yield "above 0.4 A a winding an external cooling fan must be used (page 10; pages 14 and 63 say above 0.6 A)"
    if question.voltage > FAN_VOLTAGE:
        yield "above 15 V of motor supply fan based cooling of the board is required (pages 14, 63)"
    low, high = SINGLE_VOLTS if question.supply == "SS" else MOTOR_VOLTS
    if not low <= question.voltage <= high:
        two = question.supply == "SS" and question.voltage <= MOTOR_VOLTS[1]
        remedy = "; use two supplies (DS or 5VO)" if two else ""
        limits = f"{question.supply} is {low:g} to {high:g} V (page 68)"
        yield f"the motor supply with {limits}, not {question.voltage:g} V{remedy}"
    elif question.supply == "SS" and question.voltage < 7.5:
        yield "a single supply below 7.5 V leaves little for the 5 V regulator: pages 10 and 62 ask for 7.5 to 15 V"
    if question.supply == "SS" and question.logic_voltage is not None:
        yield "with SS nothing is to be connected to Vc: it is not used (page 63)"
    if question.supply == "DS":
        volts = question.logic_voltage
        if volts is None or not SINGLE_VOLTS[0] <= volts <= SINGLE_VOLTS[1]:
            yield "DS needs 6.5 to 15 V at Vc, low rather than high: below the board resets, above it fails (page 65)"
    if question.supply == "5VO":
        volts = question.logic_voltage
        if volts is None or volts != 5.0:
            yield "5VO needs exactly 5 V at Vc: 6 V damage the board, 4.2 V reset it (pages 63, 66)"
    if question.voltage <= DRIVER_DROP[1]:
        yield "the drivers drop 1.1 to 2 V: nothing is left for the motor (page 78)"
    if question.tap > TAP_CURRENT:
        yield "do not take more than 500 mA from the board's 5 V (page 65)"
    elif question.tap > TAP_FAN_CURRENT:
        yield "more than 100 mA from the board's 5 V: the board must be fan cooled (page 65)"
    if question.half_power:
        yield (
            "above A, at first 3072 microsteps/s, both windings are at full power whatever H says: 0A or a run rate "
            "below it (page 24), or a supply for full power"
        )
    if question.mode == 3:
        yield EXAMPLE
