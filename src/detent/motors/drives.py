"""Drives by name: what of a chip makes a difference to a rotor. Modelled after their data sheets, and not the chips.

What differs: how the current falls (decay), how long the bridge must be on each period (blanking: a current below what
that gives is not reached), whether the drive passes between the microsteps by itself, and the resistance of its
switches. The rest of a chip (protection, ripple, current regulation by back EMF) is not modelled.
"""

from typing import Any, NamedTuple

from detent.motors.drive import Decay, Drive
from detent.motors.motor import MotorError
from detent.motors.winding import Winding
from detent.nearest import did_you_mean


class Preset(NamedTuple):
    """A drive by name."""

    decay: Decay
    resistance: float  # ohm of the switches in series
    fast_part: float = 0.3
    least_on: float = 0.0
    interpolation: bool = False
    about: str = ""


PRESETS: dict[str, Preset] = {
    # spreadCycle: the fast phase is as long as the current needs, within its hysteresis; 1/256 between the steps
    "tmc2209": Preset("mixed", 0.34, 0.6, 0.05, True, "spreadCycle, steps interpolated"),
    "tmc5160": Preset("mixed", 0.05, 0.6, 0.05, True, "spreadCycle, steps interpolated, outer transistors"),
    # fixed off-time; mixed decay while the current falls
    "a4988": Preset("mixed", 0.64, 0.31, 0.03, about="fixed off-time, 31 % of it fast"),
    "drv8825": Preset("mixed", 0.4, 0.75, 0.12, about="fixed off-time, mixed decay, long blanking"),
    "l298": Preset("voltage", 2.0, about="bridges without current control"),
}  # fmt: skip


def drive(name: str, supply: float, current: float, winding: Winding, **more: Any) -> Drive:
    """The drive of that name; `more` as in `Drive`, and above what the name says. MotorError for another name."""
    preset = PRESETS.get(name.lower())
    if preset is None:
        hint = did_you_mean(name.lower(), PRESETS)
        raise MotorError(f"no drive {name!r}; {hint}there are: {', '.join(PRESETS)}")
    if preset.interpolation and winding.steps < 4:
        # between coarser places a straight line is no circle
        raise MotorError(f"{name} interpolates sine steps: give a stepping of 1/4 or finer, like 1/16")
    values: dict[str, Any] = {
        "decay": preset.decay, "resistance": preset.resistance, "fast_part": preset.fast_part,
        "least_on": preset.least_on, "interpolation": preset.interpolation, "name": name.lower(),
    }  # fmt: skip
    return Drive(supply, current, winding, **{**values, **more})
