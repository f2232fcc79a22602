"""Application pages of the datasheet: resistors for the phase currents, and the speed that a load needs.

The drive's current input is a divider: 10 kilo-ohm to 5 V inside, a resistor to ground inside, R3 beside it always,
R2 too at rest (Tr2), R1 to 5 V while ramping (Tr1). Two amperes a volt make the datasheet's formula for R3 with the
1.2 kilo-ohm of the GS-D200; a GS-D200S has 750 ohm there, and needs other resistors.
"""

from math import floor, log10, pi
from typing import NamedTuple

SUPPLY = 5.0  # V
PULL_UP = 10_000.0  # ohm, inside
TO_GROUND = {"GS-D200": 1_200.0, "GS-D200S": 750.0}  # ohm, inside
AMPS_PER_VOLT = 2.0

MOST = {"GS-D200": 2.0, "GS-D200S": 2.5}  # A a phase, what the drive can give
E24 = (1.0, 1.1, 1.2, 1.3, 1.5, 1.6, 1.8, 2.0, 2.2, 2.4, 2.7, 3.0, 3.3, 3.6, 3.9, 4.3, 4.7, 5.1, 5.6, 6.2, 6.8, 7.5,
       8.2, 9.1)  # fmt: skip

CONFLICT = (
    "the datasheet takes the GS-D200S as used for R1 = 4245 ohm, but its formulas for R2 and R3 have the 1.2 kilo-ohm "
    "of the GS-D200, which a GS-D200S with its 750 ohm turns into 0.22 A for 0.25 and 0.40 A for 0.5; here all three "
    "are those of the drive"
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
    """R1 to R3 of figure 11 for these phase currents (A), by the divider of the drive.

    ValueError for currents that no resistors give, and for more than the drive has.
    """
    inside = TO_GROUND[drive]
    most = AMPS_PER_VOLT * SUPPLY * inside / (inside + PULL_UP)
    if ramp > MOST[drive]:
        raise ValueError(f"a {drive} has {MOST[drive]:g} A a phase at most, not {ramp:g} A")
    if not 0 < rest < slew < ramp:
        raise ValueError(
            f"currents rise from rest to slew to ramp, each above the one before: {rest:g}, {slew:g}, {ramp:g} A do not"
        )
    if slew >= most:
        raise ValueError(f"{slew:g} A at slew is no less than the {most:.3g} A without any resistor: lower it")
    at_rest, at_slew = (_beside(inside, _to_ground(amps)) for amps in (rest, slew))
    parallel = _parallel(inside, at_slew)
    volts = ramp / AMPS_PER_VOLT
    if volts >= SUPPLY:
        raise ValueError(f"{ramp:g} A needs more than the {SUPPLY:g} V of the drive")
    return Resistors(_beside(PULL_UP, parallel * (SUPPLY / volts - 1)), _beside(at_slew, at_rest), at_slew)


def currents(found: Resistors, drive: str = "GS-D200") -> tuple[float, float, float]:
    """The phase currents (A) at rest, at slew and in the ramps that these resistors make."""
    to_ground = _parallel(TO_GROUND[drive], found.r3)

    def amps(below: float, above: float) -> float:
        return AMPS_PER_VOLT * SUPPLY * below / (below + above)

    return (
        amps(_parallel(to_ground, found.r2), PULL_UP),
        amps(to_ground, PULL_UP),
        amps(to_ground, _parallel(PULL_UP, found.r1)),
    )


def standard(ohms: float) -> float:
    """The nearest resistor of the E24 series."""
    decade = 10.0 ** floor(log10(ohms))
    return min(
        (round(value * decade * scale, 6) for value in E24 for scale in (1, 10)), key=lambda one: abs(one - ohms)
    )


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
