"""From a mass on a screw, belt, rack or drum to what the shaft feels; gears between; a weight that hangs."""

from dataclasses import dataclass
from math import isfinite, pi, radians, sin

from detent.motors.load import Load
from detent.motors.motor import MotorError, need

GRAVITY = 9.80665  # m/s2


@dataclass(frozen=True, slots=True)
class Mechanics:
    """What hangs on the motor, in SI units; at most one of `screw`, `belt` and `rack`.

    `screw` is the lead, m a turn; `belt` and `rack` the radius of pulley or pinion, m. `gear` counts turns of the motor
    for one of what follows. `mass` (kg) moves along; `force` (N) pushes against plus, and so does the weight of the
    mass on a slope of `slope` degrees (90: straight up is plus). `drag` (N) opposes motion. `inertia` (kg m2) is at the
    motor's own shaft, `driven_inertia` behind the gear, `friction` (Nm) and `viscous` (Nm s/rad) at the motor's shaft.
    `efficiency` is that of gear and screw together, for what is moved.
    """

    screw: float | None = None
    belt: float | None = None
    rack: float | None = None
    gear: float = 1.0
    mass: float = 0.0
    force: float = 0.0
    slope: float = 0.0
    drag: float = 0.0
    inertia: float = 0.0
    driven_inertia: float = 0.0
    friction: float = 0.0
    viscous: float = 0.0
    efficiency: float = 1.0

    def __post_init__(self) -> None:
        ways = {name: value for name in ("screw", "belt", "rack") if (value := getattr(self, name)) is not None}
        if len(ways) > 1:
            raise MotorError(f"mechanics: {' and '.join(ways)}: give one of screw, belt and rack")
        need("mechanics", 0, 100, open_=True, **ways)
        need("mechanics", 1e-6, 1e6, gear=self.gear)
        need("mechanics", 0, 1e6, mass=self.mass, drag=self.drag, inertia=self.inertia, friction=self.friction,
             driven_inertia=self.driven_inertia, viscous=self.viscous)  # fmt: skip
        need("mechanics", -1e6, 1e6, force=self.force)
        need("mechanics", -90, 90, slope=self.slope)
        need("mechanics", 0, 1, open_=True, efficiency=self.efficiency)
        if not ways and (self.mass or self.force or self.drag):
            raise MotorError("mechanics: a mass, force or drag needs what moves it: screw, belt or rack (in m)")

    @property
    def travel(self) -> float | None:
        """M that a turn of the motor moves; None where nothing moves along a line."""
        if self.screw is not None:
            return self.screw / self.gear
        radius = self.belt if self.belt is not None else self.rack
        return None if radius is None else 2 * pi * radius / self.gear

    def load(self) -> Load:
        """What the motor's shaft feels.

        A mass m that moves by s in a radian is an inertia m s**2, a force F a torque F s; behind a gear of i an
        inertia counts by 1 / i**2. Losses (1 - efficiency) are taken as friction of the torque that is carried.
        """
        along = 0.0 if self.travel is None else self.travel / (2 * pi)
        inertia = self.inertia + self.driven_inertia / self.gear**2 + self.mass * along**2
        pull = (self.force + self.mass * GRAVITY * sin(radians(self.slope))) * along
        lost = (1 / self.efficiency - 1) * (abs(pull) + self.drag * along)
        values = (inertia, self.friction + self.drag * along + lost, self.viscous, pull)
        if not all(map(isfinite, values)):
            raise MotorError("mechanics: these numbers do not go together")
        return Load(*values)

    def place(self, turns: float) -> float:
        """M for turns of the motor; MotorError where nothing moves along a line."""
        if self.travel is None:
            raise MotorError("mechanics: nothing moves along a line: give screw, belt or rack")
        return turns * self.travel
