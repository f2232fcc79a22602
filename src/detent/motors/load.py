"""What hangs on the shaft: inertia, friction, and a torque that may depend on time and place."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isfinite
from typing import NamedTuple

from detent.motors import columns
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
UNEVEN = 1000  # places of a profile whose points are not evenly apart


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

    def ends(self) -> tuple[float, float]:
        """A torque that it is never below, and one that it is never above."""
        profiles = self.torque_by_time.values, self.torque_by_position.values
        return self.torque + sum(map(min, profiles)), self.torque + sum(map(max, profiles))


NO_LOAD = Load()
MOST_POINTS = 100_000


def profile(points: Sequence[tuple[float, float]]) -> Profile:
    """Straight lines through these points, put on even places: exactly, where they are even; else 1000 of them."""
    if len(points) < 2 or any(not isfinite(value) for point in points for value in point):
        raise MotorError("a load that changes: give at least two points, of finite numbers")
    places = [place for place, _ in points]
    steps = [after - before for before, after in pairwise(places)]
    if min(steps) <= 0:
        raise MotorError("a load that changes: times or places rise from point to point")
    span = places[-1] - places[0]
    if max(steps) - min(steps) < 1e-9 * span:
        return Profile(places[0], span / len(steps), tuple(torque for _, torque in points))
    values, k = [], 0
    for n in range(UNEVEN):
        at = places[0] + span * n / (UNEVEN - 1)
        while k < len(steps) - 1 and at > places[k + 1]:
            k += 1
        part = (at - places[k]) / steps[k]
        values.append(points[k][1] + part * (points[k + 1][1] - points[k][1]))
    return Profile(places[0], span / (UNEVEN - 1), tuple(values))


def read_profile(load: Load, text: str, file: str, radians: Mapping[str, float]) -> Load:
    """The load with the torque that a CSV text gives: a first line 's, Nm', or a unit of `radians` (of the shaft).

    MotorError names the file, and the line if it is about one.
    """
    unit, points = "", []
    for k, words in columns.lines(text):
        if not unit:
            parts = columns.parted(words)
            unit = parts[0].lower()
            if unit not in ("s", *radians) or len(parts) != 2 or parts[1].lower() != "nm":
                known = ", ".join(f"'{name}, Nm'" for name in ("s", *radians))
                raise MotorError(f"{file}, line {k}: {words!r}: begin with one of {known}")
            continue
        try:
            place, torque = columns.numbers(words)
        except ValueError:
            raise MotorError(f"{file}, line {k}: {words!r}: {columns.WANTED}") from None
        points.append((place * radians.get(unit, 1.0), torque))
        if len(points) > MOST_POINTS:
            raise MotorError(f"{file}: more than {MOST_POINTS} points")
    try:
        made = profile(points)
    except MotorError as error:
        raise MotorError(f"{file}: {error}") from None
    return replace(load, **{"torque_by_time" if unit == "s" else "torque_by_position": made})  # type: ignore[arg-type]
