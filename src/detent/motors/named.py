"""Named motors: makers' numbers, and where each row was read.

Static data except where a fit is named. The two QSH4218 have published torque curves (`curves`), from which their
factor on the inductance and their viscous friction come; for every other motor the sheet stands alone, and torque at
speed is optimistic by 10 to 20 percent of the holding torque: fit your own curve (`fit.fit_from_curve`).
"""

from typing import NamedTuple

from detent.motors.motor import Motor, MotorError
from detent.nearest import did_you_mean

TRINAMIC = "Trinamic QSH4218 manual V1.03 (2007-11-13), table 4.1 and figures 4.1 to 4.3"
MOTIONKING = "MotionKing MK1106 catalogue, revision 4, 17HS series"
BECKHOFF = "Beckhoff AS1000 manual, technical data"
HOBBYCNC = "HobbyCNC 23-305-DS8A sheet"
LDO = "LDO-42STH48-2504AC sheet, as listed by its maker"


def _motor(
    name: str, title: str, source: str, amps: float, ohms: float, millihenry: float, torque: float,
    gram_cm2: float | None = None, detent: float = 0.0, wiring: str = "",
) -> Motor:  # fmt: skip
    inertia = None if gram_cm2 is None else gram_cm2 * 1e-7
    return Motor(
        name, ohms, millihenry * 1e-3, amps, torque, inertia, detent, wiring=wiring, title=title, source=source
    )


MOTORS: dict[str, Motor] = {
    motor.name: motor
    for motor in (
        _motor("qsh4218-35-10-027", "NEMA 17, 35 mm", TRINAMIC, 1.0, 5.3, 6.6, 0.27, 35),
        _motor("qsh4218-41-10-035", "NEMA 17, 41 mm", TRINAMIC, 1.0, 4.5, 7.5, 0.35, 54),
        _motor("17hs4401", "NEMA 17, 40 mm", MOTIONKING, 1.7, 1.5, 2.8, 0.40, 54, 0.022),
        _motor("17hs8401", "NEMA 17, 48 mm", MOTIONKING, 1.7, 1.8, 3.2, 0.52, 68),
        _motor("ldo-42sth48-2504ac", "NEMA 17, 48 mm", LDO, 2.5, 1.2, 1.5, 0.55, 84.5),
        _motor("as1010", "NEMA 17", BECKHOFF, 1.0, 4.10, 9.5, 0.38, 56),
        _motor("as1030", "NEMA 23", BECKHOFF, 1.5, 0.80, 3.8, 0.60, 210),
        _motor("as1050", "NEMA 23", BECKHOFF, 5.0, 0.28, 0.86, 1.2, 360),
        _motor("as1060", "NEMA 34", BECKHOFF, 5.0, 0.36, 2.8, 5.0, 3000, 0.18),
        _motor("23-305-ds8a-series", "NEMA 23, windings in series", HOBBYCNC, 2.12, 2.8, 12.8, 3.0, wiring="series"),
        _motor(
            "23-305-ds8a-parallel", "NEMA 23, windings in parallel", HOBBYCNC, 4.2, 0.7, 3.2, 3.0, wiring="parallel"
        ),
    )
}


class Measured(NamedTuple):
    """A published pull-out curve: (half steps/s, Nm), and the drive it was measured with."""

    motor: str
    supply: float
    current: float
    winding: str
    points: tuple[tuple[float, float], ...]
    source: str


_FIGURES = "marker centroids of the manual's figures, +-0.002 Nm; resonance points not depicted there"

CURVES: dict[str, Measured] = {
    curve.motor: curve
    for curve in (
        Measured(
            "qsh4218-35-10-027", 24.0, 1.0, "half",
            ((500, .220), (1000, .200), (1500, .196), (2000, .200), (2500, .190), (3000, .190), (4000, .164),
             (5000, .144), (6000, .120)),
            f"{TRINAMIC}: {_FIGURES}",
        ),
        Measured(
            "qsh4218-41-10-035", 24.0, 1.0, "half",
            ((500, .281), (1000, .299), (2000, .273), (3000, .235), (4000, .178), (5000, .130), (6000, .110),
             (7000, .101), (8000, .093), (9000, .078), (10000, .057)),
            f"{TRINAMIC}: {_FIGURES}",
        ),
    )
}  # fmt: skip


def motor(name: str) -> Motor:
    """The motor of that name. MotorError with the likeliest other name."""
    found = MOTORS.get(name.lower())
    if found is None:
        hint = did_you_mean(name.lower(), MOTORS)
        raise MotorError(f"no motor {name!r}; {hint}there are: {', '.join(MOTORS)}")
    return found
