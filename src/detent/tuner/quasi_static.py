"""What torque alone allows: pull-out torque against speed, and from it bounds, and settings as manuals make them.

Speeds are in steps of the drive's stepping, as a controller counts them; a rotor here follows its pulses rigidly.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import pi
from typing import NamedTuple

import numpy as np

from detent.motors.curve import MOST_RATE, pull_in_rate, pull_out
from detent.motors.motor import MotorError
from detent.motors.rotor import Floats, Rig
from detent.motors.variants import Spread, changed

SLOWEST = 100.0  # full steps/s, where the curve begins; below it torque is as there
RATIO = 1.2  # from one point of the curve to the next
FINE_POINTS = 4000
STARTED = 25  # full steps that a start must hold


class Torque(NamedTuple):
    """Torque of a rig over speed: speeds rise; `available` is pull-out, `steady` friction, and load as at the start.

    `less` and `more` (both 0 or above) is by how much a load that changes ever pulls less and more than at the start.
    """

    speeds: Floats  # steps/s
    available: Floats  # Nm
    steady: Floats  # Nm
    inertia: float  # kg m2, all of it
    radians: float  # of the shaft, a step
    holding: float  # Nm at the drive's current
    less: float = 0.0  # Nm
    more: float = 0.0  # Nm

    def speed_at(self, torque: float) -> float:
        """The highest speed at which so much is available; the lowest of the curve if it is nowhere."""
        enough = np.flatnonzero(self.available >= torque)
        if not len(enough):
            return float(self.speeds[0])
        at = int(enough[-1])
        if at + 1 == len(self.speeds):
            return float(self.speeds[-1])
        part = (self.available[at] - torque) / (self.available[at] - self.available[at + 1])
        return float(self.speeds[at] + part * (self.speeds[at + 1] - self.speeds[at]))

    def available_at(self, speed: float) -> float:
        """Pull-out torque at a speed."""
        return float(np.interp(speed, self.speeds, self.available))

    def steady_at(self, speed: float) -> float:
        """What turning evenly takes."""
        return float(np.interp(speed, self.speeds, self.steady))

    def acceleration(self, torque: float) -> float:
        """Steps/s2 that this torque makes."""
        return torque / self.inertia / self.radians

    @property
    def top(self) -> float:
        """The last speed of the curve at which something is left to accelerate, the load as at the start."""
        left = np.flatnonzero(self.available > self.steady)
        return float(self.speeds[left[-1]]) if len(left) else 0.0

    @property
    def highest(self) -> float:
        """The speed at which nothing is left, the load at its least."""
        left = self.available - self.steady + self.less
        some = np.flatnonzero(left > 0)
        if not len(some):
            return 0.0
        at = int(some[-1])
        if at + 1 == len(left):
            return float(self.speeds[-1])
        part = left[at] / (left[at] - left[at + 1])
        return float(self.speeds[at] + part * (self.speeds[at + 1] - self.speeds[at]))


def torque_of(rig: Rig, way: int = 1) -> Torque:
    """The curve of a rig, up to where nothing is left; `way` is the direction, for loads that pull to one side."""
    per_step = rig.drive.winding.steps
    load, motor = rig.load, rig.motor
    radians = 2 * pi / motor.steps / per_step
    speeds: list[float] = []
    available: list[float] = []
    rate = SLOWEST
    while rate <= MOST_RATE and (not available or available[-1] > 0):
        speeds.append(rate * per_step)
        available.append(pull_out(motor, rig.drive, rate).torque)
        rate *= RATIO
    at = np.array(speeds)
    steady = load.friction + load.viscous * at * radians + way * load.at_rest()
    torque = motor.torque_constant * 2**0.5 * rig.drive.current
    ends = sorted(way * end - way * load.at_rest() for end in load.ends())
    return Torque(at, np.array(available), np.broadcast_to(steady, at.shape).astype(np.float64),
                  motor.rotor + load.inertia, radians, torque, max(-ends[0], 0.0), max(ends[1], 0.0))  # fmt: skip


class Bound(NamedTuple):
    """Seconds of each move below which torque alone allows none, with the rig as given and at its worst corner."""

    nominal: tuple[float, ...]
    worst: tuple[float, ...]


def bound(rig: Rig, spread: Spread, distances: Sequence[int], *, both_ways: bool) -> Bound:
    """The time-optimal moves from and to standstill of a rotor that never lags.

    They use all of the torque all of the time, which no controller of the catalogue can.
    """
    nominal = _slowest([rig], distances, both_ways)
    return Bound(nominal, _slowest([rig, *worst_of(rig, spread)], distances, both_ways))


def worst_of(rig: Rig, spread: Spread) -> list[Rig]:
    """The corners of a spread that have the least torque for the most inertia, friction and load."""
    ranges = spread.of(rig)
    factors = {
        "inertia": ranges.inertia[1], "voltage": ranges.voltage[0], "inductance": ranges.inductance[1],
        "resistance": ranges.resistance[1], "friction": ranges.friction[1], "load": ranges.load[1],
    }  # fmt: skip
    return [_weakened(rig, {**factors, "torque_constant": constant}) for constant in ranges.torque_constant]


def _weakened(rig: Rig, factors: dict[str, float]) -> Rig:
    """With these factors; where so little voltage no longer drives the current through the winding, with less of it."""
    try:
        return changed(rig, **factors)
    except MotorError:
        part = factors["voltage"] / factors["resistance"]
        return changed(replace(rig, drive=replace(rig.drive, current=rig.drive.current * part)), **factors)


def _slowest(rigs: Sequence[Rig], distances: Sequence[int], both_ways: bool) -> tuple[float, ...]:
    times = [fastest(torque_of(rig, way), distances) for rig in rigs for way in ((1, -1) if both_ways else (1,))]
    return tuple(float(time) for time in np.max(times, axis=0))


def fastest(torque: Torque, distances: Sequence[int]) -> tuple[float, ...]:
    """Seconds for each distance (steps): up with all torque, on at the top, down with torque and friction.

    No rotor without lag is faster, wherever a load that changes pulls how much: it goes up as where it pulls least,
    and down as where it pulls most.
    """
    top = torque.highest
    if top <= 0:
        return tuple(float("inf") for _ in distances)
    speeds = np.linspace(0, top, FINE_POINTS)
    available = np.interp(speeds, torque.speeds, torque.available)
    steady = np.interp(speeds, torque.speeds, torque.steady)
    up = torque.acceleration(1.0) * (available - steady + torque.less)
    down = torque.acceleration(1.0) * (available + steady + torque.more)
    usable = up > 1e-3 * up.max()
    speeds, up, down = speeds[usable], up[usable], np.maximum(down[usable], 1e-9)
    if len(speeds) < 2:
        return tuple(float("inf") for _ in distances)
    t_up, t_down = _summed(1 / up, speeds), _summed(1 / down, speeds)
    x_up, x_down = _summed(speeds / up, speeds), _summed(speeds / down, speeds)
    both = x_up + x_down
    found = []
    for distance in distances:
        if distance >= both[-1]:
            found.append(float(t_up[-1] + t_down[-1] + (distance - both[-1]) / speeds[-1]))
        else:
            found.append(float(np.interp(distance, both, t_up + t_down)))
    return tuple(found)


def _summed(values: Floats, over: Floats) -> Floats:
    parts = (values[1:] + values[:-1]) / 2 * np.diff(over)
    found: Floats = np.concatenate(([0.0], np.cumsum(parts)))
    return found


class RuleOfThumb(NamedTuple):
    """Speeds (steps/s) and acceleration (steps/s2) by the rule of manuals."""

    start: float
    top: float
    acceleration: float


def rule_of_thumb(rig: Rig, torque: Torque) -> RuleOfThumb:
    """Start at half of the pull-in rate, slew where half of the holding torque is left, ramp with half of what is."""
    start = pull_in(rig) / 2
    top = max(torque.speed_at(torque.holding / 2), 2 * start)
    spare = torque.available_at(top) / 2 - torque.steady_at(top)
    return RuleOfThumb(max(start, 1.0), top, torque.acceleration(max(spare, 0.05 * torque.holding)))


def pull_in(rig: Rig) -> float:
    """The highest speed (steps/s) into which the rig starts without a ramp; an eighth of its resonance if into none."""
    found = pull_in_rate(rig.motor, rig.drive, rig.load, steps=STARTED, damping=rig.damping).pull_in
    return (found or rig.motor.natural_frequency(rig.load.inertia) / 8) * rig.drive.winding.steps
