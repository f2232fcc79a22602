"""A motor fitted to its published torque curve: a factor on the inductance, and viscous friction.

They are correlations over the speeds that were measured, not physics: the factor stands for saturation, eddy currents
and the losses of the drive. It is kept between 1 and 2.5, the friction at 0 or more.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from detent.motors.curve import GOLDEN, LEAST_RATE, MOST_RATE, pull_out, torque_curve
from detent.motors.drive import Drive
from detent.motors.motor import Motor, MotorError
from detent.motors.named import CURVES, motor
from detent.motors.winding import winding

LEAST_FACTOR, MOST_FACTOR = 1.0, 2.5
PRECISION = 0.005
LOOKS = 7
HARDLY = 0.01  # of the holding torque: an rms that is so little more fits as well
AMBIGUOUS = 0.06
POOR = 0.08

Point = tuple[float, float]


class Fit(NamedTuple):
    """The fitted motor, how far its curve is from the points (parts of the holding torque), and how far it reaches."""

    motor: Motor
    rms: float
    sheet_rms: float  # of the sheet alone
    low: float = 0.0  # full steps/s: the speeds that were measured, and for which it holds
    high: float = 0.0
    factors: tuple[float, float] = (
        1.0,
        1.0,
    )  # on the inductance, that fit hardly worse (`HARDLY`), with their friction
    spread: float = 0.0  # of the torque that those give at twice the highest speed

    @property
    def ambiguous(self) -> bool:
        """Whether the points leave open what the motor gives beyond them."""
        return self.spread > AMBIGUOUS

    @property
    def quality(self) -> str:
        """In words, how near it comes."""
        words = f"{self.rms:.1%} of the holding torque off (rms; the data alone {self.sheet_rms:.1%})"
        if self.rms > POOR:
            return f"POOR: {words}: check the data, the units, the wiring, and the drive it was measured with"
        return words

    @property
    def reach(self) -> str:
        """In words, for how much it holds."""
        words = f"{self.quality}; holds from {self.low:g} to {self.high:g} full steps/s, where it was measured"
        if self.ambiguous:
            low, high = self.factors
            words += (
                f"; AMBIGUOUS: with the inductance times {low:.2f} to {high:.2f} the points are met as well, and the "
                f"torque at {2 * self.high:g} full steps/s differs by {self.spread:.0%} of the holding torque: measure "
                "at higher speeds"
            )
        return words


def fit_from_curve(motor: Motor, drive: Drive, points: Sequence[Point], *, friction: bool = True) -> Fit:
    """The motor that comes nearest to the points (full steps/s, Nm), measured with `drive`.

    `friction` False: only the inductance is fitted. MotorError for fewer than three points, or impossible ones.
    """
    points = sorted(points)
    if len(points) < 3 or len({rate for rate, _ in points}) < 3:
        raise MotorError(f"a curve of {len(points)} points: give at least three speeds")
    for rate, torque in points:
        if not (LEAST_RATE <= rate <= MOST_RATE and 0 <= torque <= 2 * motor.holding_torque):
            raise MotorError(
                f"the point {rate:g} steps/s, {torque:g} Nm does not belong to a motor of {motor.holding_torque:g} Nm: "
                "give full steps/s and Nm"
            )
    rates = np.array([rate for rate, _ in points])
    torques = np.array([torque for _, torque in points])
    speeds = rates * 2 * np.pi / motor.steps  # rad/s
    plain = motor.changed(inductance_factor=1.0, viscous=0.0)

    def residual(factor: float, viscous: float | None = None) -> tuple[float, float]:
        candidate = plain.changed(inductance_factor=factor)
        computed = np.array([point.torque for point in torque_curve(candidate, drive, rates)])
        if viscous is None:
            # T(v) - B w: the best B is a division
            viscous = max(float(((computed - torques) * speeds).sum() / (speeds**2).sum()), 0.0) if friction else 0.0
        rest = computed - viscous * speeds - torques
        return sqrt(float((rest**2).mean())) / motor.holding_torque, viscous

    best = best_of([LEAST_FACTOR + (MOST_FACTOR - LEAST_FACTOR) * k / (LOOKS - 1) for k in range(LOOKS)],
                   lambda factor: residual(factor)[0])  # fmt: skip
    rms, viscous = residual(best)
    made = plain.changed(inductance_factor=best, viscous=viscous)
    factors, torques_beyond = [best], [_beyond(made, drive, points[-1][0])]
    for k in range(2 * LOOKS):
        factor = LEAST_FACTOR + (MOST_FACTOR - LEAST_FACTOR) * k / (2 * LOOKS - 1)
        other, its_viscous = residual(factor)
        if other < rms + HARDLY:
            factors.append(factor)
            candidate = plain.changed(inductance_factor=factor, viscous=its_viscous)
            torques_beyond.append(_beyond(candidate, drive, points[-1][0]))
    spread = (max(torques_beyond) - min(torques_beyond)) / motor.holding_torque
    return Fit(made, rms, residual(1.0, 0.0)[0], points[0][0], points[-1][0], (min(factors), max(factors)), spread)


def _beyond(motor: Motor, drive: Drive, rate: float) -> float:
    """The torque at twice that speed; what is no torque any more is 0."""
    return max(pull_out(motor, drive, min(2 * rate, MOST_RATE)).torque, 0.0)


def best_of(looks: Sequence[float], cost) -> float:  # type: ignore[no-untyped-def]
    """Where `cost` is least between the first and the last of `looks`: the best of them, then golden section."""
    costs = [cost(place) for place in looks]
    k = costs.index(min(costs))
    low, high = looks[max(k - 1, 0)], looks[min(k + 1, len(looks) - 1)]
    inner, outer = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_inner, at_outer = cost(inner), cost(outer)
    while high - low > PRECISION:
        if at_inner <= at_outer:
            high, outer, at_outer = outer, inner, at_inner
            inner = high - GOLDEN * (high - low)
            at_inner = cost(inner)
        else:
            low, inner, at_inner = inner, outer, at_outer
            outer = low + GOLDEN * (high - low)
            at_outer = cost(outer)
    candidates = [((low + high) / 2, cost((low + high) / 2)), (looks[k], costs[k])]
    return float(min(candidates, key=lambda pair: pair[1])[0])


def fitted(name: str) -> Fit:
    """A named motor fitted to the curve that its maker published. MotorError if there is none."""
    if name not in CURVES:
        raise MotorError(f"no published curve of {name!r} is known; there are: {', '.join(CURVES)}")
    curve = CURVES[name]
    table = winding(curve.winding)
    drive = Drive(curve.supply, curve.current, table)
    return fit_from_curve(motor(name), drive, [(rate / table.steps, torque) for rate, torque in curve.points])
