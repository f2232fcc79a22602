"""What hangs on the shaft: inertia, friction, and a torque that may depend on time and place."""

from dataclasses import dataclass, replace
from math import isfinite
from typing import NamedTuple

from detent.motors.motor import MotorError, Shared, need


class Profile(NamedTuple):
    """Straight lines through values at `start`, `start` + `step`, ...; before and behind them the ends hold."""

    start: float
    step: float
    values: tuple[float, ...]

    def at(self, place: float) -> float:
        """The value there."""
        u = min(max((place - self.start) / self.step, 0.0), len(self.values) - 1.0)
        i = min(int(u), len(self.values) - 2) if len(self.values) > 1 else 0
        rest = u - i
        following = self.values[min(i + 1, len(self.values) - 1)]
        return self.values[i] + rest * (following - self.values[i])


NONE = Profile(0.0, 1.0, (0.0,))


@dataclass(frozen=True, slots=True)
class Load(Shared):
    """The load as the shaft feels it (gears and screws reduced to it).

    `torque` pushes towards minus, whatever the motion (a hanging weight); `friction` opposes motion and holds at rest
    (Coulomb); `viscous` grows with speed. `torque_by_time` (s) and `torque_by_position` (rad from the place where the
    rotor stood at the start) add to `torque`.
    """

    inertia: float = 0.0  # kg m2
    friction: float = 0.0  # Nm
    viscous: float = 0.0  # Nm s/rad
    torque: float = 0.0  # Nm
    torque_by_time: Profile = NONE
    torque_by_position: Profile = NONE

    def __post_init__(self) -> None:
        need("load", 0, inertia=self.inertia, friction=self.friction, viscous=self.viscous)
        need("load", -1e6, 1e6, torque=self.torque)
        for name, profile in (("time", self.torque_by_time), ("position", self.torque_by_position)):
            if not profile.values or not profile.step > 0 or not all(map(isfinite, (*profile.values, *profile[:2]))):
                raise MotorError(f"load: torque by {name}: give a start, a step above 0, and finite values")

    @property
    def is_steady(self) -> bool:
        """Whether the torque depends on nothing."""
        return len(self.torque_by_time.values) == len(self.torque_by_position.values) == 1

    def pulled(self, factor: float) -> "Load":
        """With every torque of it multiplied."""
        by_time, by_position = (
            profile._replace(values=tuple(value * factor for value in profile.values))
            for profile in (self.torque_by_time, self.torque_by_position)
        )
        return replace(self, torque=self.torque * factor, torque_by_time=by_time, torque_by_position=by_position)

    def at_rest(self) -> float:
        """The torque at the start."""
        return self.torque + self.torque_by_time.at(0.0) + self.torque_by_position.at(0.0)


NO_LOAD = Load()
