"""The power stage: supply, phase current, how it is controlled, and how it is reduced when less will do.

* ``fast``: a chopper whose current may fall against the full supply (ideal: no ripple);
* ``slow``: a chopper that lets the current fall through the winding alone: it cannot follow a falling current, and
  damps;
* ``mixed``: fast for `fast_part` of each off-time and slow for the rest: a falling current has that part of the supply;
* ``auto``: slow below `decay_threshold`, fast above, slow at standstill (DCB-274, command b);
* ``voltage``: pulse width without current feedback (Norberg's boards): the duty gives `current` at standstill.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Literal, NamedTuple, TypeAlias

from detent.motors.motor import Motor, MotorError, Shared, need
from detent.motors.winding import HALF, Winding
from detent.ticks import NEVER, SECOND, Ns, round_ratio

Decay: TypeAlias = Literal["fast", "slow", "mixed", "auto", "voltage"]

FAST, SLOW, VOLTAGE, MIXED = 0, 1, 2, 3  # as the kernel knows them
_MODES = {"fast": FAST, "slow": SLOW, "mixed": MIXED, "auto": SLOW, "voltage": VOLTAGE}
MOST_SUPPLY = 1000.0  # V: no drive for step motors has more


class Currents(NamedTuple):
    """Factors on the phase current: at rest, slewing and ramping (MOV, RAMP), or run and hold with a delay."""

    ramp: float = 1.0
    slew: float = 1.0
    rest: float = 1.0
    after: Ns = 0  # from the last pulse to `rest`, where the drive itself decides


STEADY = Currents()


@dataclass(frozen=True, slots=True)
class Drive(Shared):
    """A drive for two phases, bipolar."""

    supply: float  # V
    current: float  # A in each phase with both on
    winding: Winding = HALF
    decay: Decay = "fast"
    decay_threshold: float = 0.0  # full steps/s, for `auto`
    currents: Currents = STEADY
    drop: float = 0.0  # V lost in the switches
    resistance: float = 0.0  # ohm of switches and wires
    fast_part: float = 0.3  # of the off-time, for `mixed`
    least_on: float = 0.0  # of each period, for `mixed`: blanking; a current below what that gives is not reached
    interpolation: bool = False  # the drive passes evenly from one place of the table to the next, a step behind
    name: str = ""  # of a drive that is known by name

    def __post_init__(self) -> None:
        need("drive", 0, MOST_SUPPLY, open_=True, supply=self.supply)
        need("drive", 0, 1000, open_=True, current=self.current)
        need("drive", 0, 1, fast_part=self.fast_part)
        need("drive", 0, 0.5, least_on=self.least_on)
        need("drive", 0, drop=self.drop, resistance=self.resistance, decay_threshold=self.decay_threshold)
        if self.decay not in _MODES:
            raise MotorError(f"drive: no decay {self.decay!r}; there are: {', '.join(_MODES)}")
        for name in ("ramp", "slew", "rest"):
            factor = getattr(self.currents, name)
            if not isfinite(factor) or not 0 <= factor <= 4:
                raise MotorError(f"drive: the current factor {name} is {factor!r}: give 0 to 4")
        if self.drop >= self.supply:
            raise MotorError(
                f"drive: a supply of {self.supply:g} V loses {self.drop:g} V in the switches: nothing is left"
            )

    @property
    def volts(self) -> float:
        """What the winding can get."""
        return self.supply - self.drop

    @property
    def fall(self) -> float:
        """`mixed`: the least mean voltage against a current that shall fall, as a part of `volts`; -1 is all of it."""
        return self.least_on - (1 - self.least_on) * self.fast_part

    @property
    def mode(self) -> int:
        """The decay as the kernel knows it; `auto` at standstill."""
        return _MODES[self.decay]

    @property
    def standstill(self) -> Ns:
        """After so long without a pulse an `auto` drive takes the motor to be slower than its threshold."""
        if self.decay != "auto" or self.decay_threshold <= 0:
            return NEVER
        per_second = self.decay_threshold * self.winding.steps
        return round_ratio(SECOND * 1_000_000, round(per_second * 1_000_000))

    def check(self, motor: Motor) -> None:
        """Raise MotorError if the supply cannot drive the current through the winding, or the motor would burn."""
        peak = self.current * max(self.currents[:3]) * max(map(abs, (*self.winding.a, *self.winding.b)))
        needed = peak * (motor.resistance + self.resistance)
        if needed > self.volts:
            raise MotorError(
                f"{self.volts:g} V cannot drive {peak:.3g} A through the {motor.resistance + self.resistance:.3g} "
                f"ohm of {motor.name}: "
                f"it needs {needed:.3g} V and several times that for speed; raise the supply, or lower the current to "
                f"{self.current * self.volts / needed:.3g} A"
            )
        if self.current * max(self.currents[:3]) > 4 * motor.current:
            raise MotorError(
                f"{self.current:g} A is more than four times the {motor.current:g} A of {motor.name}: check the units"
            )
