"""Application pages of the datasheet: resistors for the phase currents, and the speed that a load needs.

The drive's current input is a divider: 10 kilo-ohm to 5 V inside, a resistor to ground inside, R3 beside it always,
R2 too at rest (Tr2), R1 to 5 V while ramping (Tr1). Two amperes a volt make the datasheet's formula for R3 with the
1.2 kilo-ohm of the GS-D200.
"""

from math import pi
from typing import NamedTuple

SUPPLY = 5.0  # V
PULL_UP = 10_000.0  # ohm, inside
TO_GROUND = {"GS-D200": 1_200.0, "GS-D200S": 750.0}  # ohm, inside
AMPS_PER_VOLT = 2.0

CONFLICT = (
    'the datasheet prints R1 = 4245 ohm "assuming the GS-D200S is used"; that is the value for the 1.2 kilo-ohm of '
    "the GS-D200"
)
SLEW_CONFLICT = (
    "the datasheet prints F L / (6000 t) = T N / 10, whose units do not agree; used here: "
    "F L / (6600 t) = 2 pi T N / 6 336 000 (1 hp = 33 000 ft lb/min)"
)


class Resistors(NamedTuple):
    """Ohm."""

    r1: float
    r2: float
    r3: float


def resistors(rest: float, slew: float, ramp: float, drive: str = "GS-D200") -> Resistors:
    """R1 to R3 of figure 11 for these phase currents (A). ValueError for currents that no resistors give.

    R2 and R3 by the printed formulas, whichever the drive; R1 by what is inside the drive.
    """
    printed = TO_GROUND["GS-D200"]  # what the printed formula for R3 and R2 stands for
    most = AMPS_PER_VOLT * SUPPLY * printed / (printed + PULL_UP)
    if not 0 < rest < slew < ramp:
        raise ValueError(f"currents rise from rest to slew to ramp: {rest:g}, {slew:g}, {ramp:g} A do not")
    if slew >= most:
        raise ValueError(f"{slew:g} A at slew is no less than the {most:.3g} A without any resistor: lower it")
    at_rest, at_slew = (_beside(printed, _to_ground(amps)) for amps in (rest, slew))
    parallel = _parallel(TO_GROUND[drive], at_slew)
    volts = ramp / AMPS_PER_VOLT
    if volts >= SUPPLY:
        raise ValueError(f"{ramp:g} A needs more than the {SUPPLY:g} V of the drive")
    return Resistors(_beside(PULL_UP, parallel * (SUPPLY / volts - 1)), _beside(at_slew, at_rest), at_slew)


def slew_rate(force: float, length: float, time: float, torque: float) -> float:
    """Turns a minute for a load moved `length` inches in `time` s against `force` lb by `torque` oz in."""
    if min(force, length, time, torque) <= 0:
        raise ValueError("force, length, time and torque are above 0")
    horse_power = force * length / (6600 * time)
    return horse_power * 33_000 * 16 * 12 / (2 * pi * torque)


def _to_ground(amps: float) -> float:
    """What the whole divider must have to ground for this current."""
    volts = amps / AMPS_PER_VOLT
    return PULL_UP * volts / (SUPPLY - volts)


def _parallel(one: float, other: float) -> float:
    return one * other / (one + other)


def _beside(present: float, wanted: float) -> float:
    """The resistor that makes `wanted` of `present`, in parallel."""
    return present * wanted / (present - wanted)
