"""What damps a rotor beyond friction and EMF: a torque towards the mean speed of the pulses.

    T = D (w_pulses - w),   D = D0 / (1 + (f / f1)**2),   D0 = 2 z0 sqrt(p Th J_rotor)

in proportion to the current that flows (Th is that at the drive's current).
`f` is the rate of the pulses in full steps/s. At standstill this is a damping ratio z0 of the bare rotor; with a load
of k times the rotor's inertia it is z0 / sqrt(1 + k). It is no drag: a rotor that turns evenly with its pulses feels
none of it, so that the torque curve is the same with and without.

This is phenomenology. In a real motor it is iron losses and the ripple of the current control, which no data sheet
gives. A viscous friction of the same ratio would eat the torque at speed that makers measure; Coulomb friction does
not damp about a mean speed; without the roll-off no motor had mid-band resonance, which real ones have.
"""

from typing import NamedTuple

from detent.motors.motor import MotorError, need

MOST_RATIO = 2.0
ROLL_OFF = 1000.0  # full steps/s


class Damping(NamedTuple):
    """Damping ratio of the bare rotor at standstill, the pulse rate where it has halved, and where that is from."""

    ratio: float
    roll_off: float = ROLL_OFF  # full steps/s
    source: str = "given"

    def __str__(self) -> str:
        return f"damping {self.ratio:.3g} ({self.source})"


CHOPPER = Damping(0.12, source="assumed for a chopper, not measured: give yours, or a ring-down")
VOLTAGE = Damping(0.03, source="assumed for a drive without current control, not measured: give yours, or a ring-down")
UNDAMPED = Damping(0.0, source="none")


def given(ratio: float, source: str = "given") -> Damping:
    """A damping ratio that somebody knows. MotorError for one that is none."""
    need("damping", 0, MOST_RATIO, ratio=ratio)
    return Damping(float(ratio), source=source)


def usual(decay: str) -> Damping:
    """What is assumed of a drive with this decay when nobody says."""
    return VOLTAGE if decay == "voltage" else CHOPPER


def checked(damping: Damping) -> Damping:
    """The damping. MotorError for numbers that are none."""
    need("damping", 0, MOST_RATIO, ratio=damping.ratio)
    need("damping", 0, 1e6, open_=True, roll_off=damping.roll_off)
    if not isinstance(damping, Damping):
        raise MotorError("damping is a Damping: see detent.motors.damping.given")
    return damping
