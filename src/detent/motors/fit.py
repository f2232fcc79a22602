"""A motor fitted to its published torque curve: a factor on the inductance, and viscous friction.

They are correlations over the speeds that were measured, not physics: the factor stands for saturation, eddy currents
and the losses of the drive. It is kept between 1 and 2.5, the friction at 0 or more.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from detent.motors.curve import GOLDEN, torque_curve
from detent.motors.drive import Drive
from detent.motors.motor import Motor, MotorError
from detent.motors.named import CURVES, motor
from detent.motors.winding import winding

LEAST_FACTOR, MOST_FACTOR = 1.0, 2.5
PRECISION = 0.005
LOOKS = 7

Point = tuple[float, float]


class Fit(NamedTuple):
    """The fitted motor, and how far its curve is from the points: rms, as a part of the holding torque."""

    motor: Motor
    rms: float
    sheet_rms: float  # of the sheet alone


def fit_from_curve(motor: Motor, drive: Drive, points: Sequence[Point], *, friction: bool = True) -> Fit:
    """The motor that comes nearest to the points (full steps/s, Nm), measured with `drive`.

    `friction` False: only the inductance is fitted. MotorError for fewer than three points, or impossible ones.
    """
    points = sorted(points)
    if len(points) < 3 or len({rate for rate, _ in points}) < 3:
        raise MotorError(f"a curve of {len(points)} points: give at least three speeds")
    for rate, torque in points:
        if not (rate > 0 and 0 <= torque <= 2 * motor.holding_torque):
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
    return Fit(plain.changed(inductance_factor=best, viscous=viscous), rms, residual(1.0, 0.0)[0])


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
