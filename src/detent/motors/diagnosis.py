"""Where a move is lost, and why: the moment, what the rotor had to give there, and what it had.

A count of the steps lost hangs on the last digit of every number; the moment of the loss does not, nor whether the
torque was there.
"""

from math import degrees, pi
from typing import NamedTuple

import numpy as np

from detent.motors import kernel
from detent.motors.curve import MOST_RATE, pull_out
from detent.motors.move import Pulses, chunks_of, parts_of, simulate
from detent.motors.rotor import Floats, Rig
from detent.ticks import MS, US, Ns

HALF_A_TURN = pi  # a rotor that hangs back by more is on its way out
LOOK = 64  # pulses either way that make a speed and its change
SAMPLE: Ns = 50 * US
MOST_ROWS = 2_000_000


class Loss(NamedTuple):
    """The moment from which the rotor did not come back, and the torques (Nm) there."""

    pulse: int  # the last before it
    time: float  # s since the first pulse's train began
    rate: float  # of the pulses, in steps of the drive's stepping
    acceleration: float  # steps/s2
    load_angle: float  # electrical degrees, + behind
    needed: float  # to accelerate and against friction and load
    available: float  # pull-out torque at that speed
    reason: str

    def __str__(self) -> str:
        side = "behind" if self.load_angle >= 0 else "ahead of"
        return (
            f"lost after pulse {self.pulse}, at {self.rate:.0f} steps/s, {abs(self.load_angle):.0f} degrees {side} its "
            f"command: {self.reason}"
        )


def diagnose(pulses: Pulses, rig: Rig, *, settle: Ns | None = None) -> Loss | None:
    """Where and why the move is lost; None if it is not. MotorError as `simulate`."""
    settle = rig.settle if settle is None else settle
    run = simulate(pulses, rig, settle=settle)
    if not run.verdict.lost:
        return None
    times, directions = _all(pulses)
    last = run.verdict.lost_pulse
    ends = int(times[min(last, len(times) - 1)]) if last is not None else int(times[-1]) + settle
    sample = max(SAMPLE, (ends - int(times[0])) // MOST_ROWS)
    some = [times[: last + 1]] if last is not None else [times]
    part = simulate(np.concatenate(some), rig, settle=settle if last is None else 5 * MS, sample=sample) if (
        (directions == 1).all()) else simulate(pulses, rig, settle=settle, sample=sample)  # fmt: skip
    return _at(part.trace, times, directions, rig, last)


def _all(pulses: Pulses) -> tuple[Floats, Floats]:
    found, ways = [], []
    for chunk, way in chunks_of(parts_of(pulses)):
        found.append(chunk.copy())
        ways.append(np.full(len(chunk), way))
    return np.concatenate(found), np.concatenate(ways)


def _at(trace: Floats, times: Floats, directions: Floats, rig: Rig, last: int | None) -> Loss:
    delta = trace[:, kernel.PHI_COLUMN] - trace[:, kernel.X_COLUMN]
    beyond = np.flatnonzero(np.abs(delta) > 2 * pi)
    end = int(beyond[0]) if len(beyond) else len(delta) - 1
    inside = np.flatnonzero(np.abs(delta[: end + 1]) < HALF_A_TURN)
    row = int(inside[-1]) if len(inside) else 0
    now = float(trace[row, kernel.T_COLUMN])
    pulse = int(np.searchsorted(times, now, side="right"))
    rate, acceleration = _motion(times, pulse)
    per_step = rig.drive.winding.steps
    radians = 2 * pi / rig.motor.steps / per_step
    load, motor = rig.load, rig.motor
    w = rate * radians
    way = float(directions[min(max(pulse - 1, 0), len(directions) - 1)])
    place = float(trace[row, kernel.X_COLUMN] - rig.drive.winding.offset) / motor.teeth
    pull = load.torque + load.torque_by_time.at(now * 1e-9) + load.torque_by_position.at(place)
    inertia = motor.rotor + load.inertia
    steady = load.friction + load.viscous * w + way * pull
    needed = inertia * acceleration * radians + steady
    full = rate / per_step
    available = pull_out(motor, rig.drive, min(max(full, 1.0), MOST_RATE)).torque
    angle = degrees(float(delta[min(row + 1, len(delta) - 1)])) * way
    return Loss(pulse, now * 1e-9, rate, acceleration, angle, needed, available,
                _reason(rig, pulse, full, needed, available, steady, acceleration, last, len(times)))  # fmt: skip


def _motion(times: Floats, pulse: int) -> tuple[float, float]:
    """Speed and acceleration of the pulses about one of them."""
    if len(times) < 2:
        return 0.0, 0.0
    if pulse >= len(times):
        return float(1e9 / (times[-1] - times[-2])), 0.0
    first, last = max(pulse - LOOK, 0), min(pulse + LOOK, len(times) - 1)
    gaps = np.diff(times[first : last + 1].astype(np.float64)) * 1e-9
    here = float(1.0 / gaps[min(max(pulse - 1 - first, 0), len(gaps) - 1)])
    if len(gaps) < 2:
        return here, 0.0
    begin, end = gaps[: len(gaps) // 2], gaps[len(gaps) // 2 :]
    span = (begin.sum() + end.sum()) / 2
    return here, float((len(end) / end.sum() - len(begin) / begin.sum()) / span)


def _reason(
    rig: Rig, pulse: int, rate: float, needed: float, available: float, steady: float, acceleration: float,
    last: int | None, count: int,
) -> str:  # fmt: skip
    needs, gives, still = (
        f"{value if abs(value) > 1e-3 * rig.motor.holding_torque else 0.0:.3g} Nm"
        for value in (abs(needed), max(available, 0.0), steady)
    )
    has = f"it needs {needs} there and has {gives}"
    natural = rig.motor.natural_frequency(rig.load.inertia)
    if available <= 1e-3 * rig.motor.holding_torque:
        return f"the motor has no torque at this speed: {has}"
    if pulse >= count:
        return "it runs on over the stop: stop from a lower speed, or with a longer ramp"
    if needed < 0 and -needed > max(available, 0.0):
        return f"it cannot brake so hard: {has}"
    if needed > max(available, 0.0):
        if steady > max(available, 0.0):
            return f"too little torque at this speed: {has}"
        return f"too steep: {has}, {still} of it without accelerating"
    if pulse < 16 and rate > natural:
        return f"it does not start into this speed ({has}): start at a lower one"
    if rate < 2.5 * natural:
        return (
            f"resonance: torque is there ({has}), but its swings of {natural:.0f} Hz grow at this speed; more friction "
            "or damping, finer steps, or another speed"
        )
    if needed > 0.7 * available and acceleration > 0:
        return f"hardly enough torque: {has}, and its swings take the rest"
    return (
        f"its swings grow (mid-band resonance): torque is there ({has}); more inertia or friction, another decay, or a "
        "steeper ramp through this speed"
    )
