"""Torque against speed: what the motor gives at a speed held constant, whatever its rotor would do.

The rotor is turned at the speed of the pulses and the currents settle; the mean torque over whole electrical cycles,
at the load angle where it is greatest, is the pull-out torque. No resonance and no inertia come into it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from math import ceil, degrees, floor, pi
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from detent.motors import engine, kernel
from detent.motors.damping import Damping
from detent.motors.drive import Drive
from detent.motors.load import NO_LOAD, Load
from detent.motors.motor import Motor, MotorError
from detent.motors.move import simulate
from detent.motors.rotor import SUBSTEP, Rig
from detent.ticks import SECOND

Floats = npt.NDArray[np.float64]

ANGLES = 37  # of a turn, of which some are looked at before the golden section
LIKELY = range(7, 21)  # of these: 68 to 195 degrees
GOLDEN = 0.6180339887498949
PRECISION = 1e-3  # rad, of the load angle
LEAST_RATE, MOST_RATE = 0.01, 1e6  # full steps/s: within these a step motor turns
STANDING = 5.0  # full steps/s: slower the torque is the same, as nothing but the resistance is left
SLOWEST_START = 20.0  # full steps/s, that is tried
MOST_WORK = 2e8  # substeps of one curve or one search for start rates


class PullOut(NamedTuple):
    """The most torque at a speed, and the load angle (electrical degrees behind the command) where it is given."""

    rate: float  # full steps/s
    torque: float  # Nm at the shaft, after the motor's own friction
    angle: float


def mean_torque(rate, angle, par, table_a, table_b, mode, level, settle, cycles, per_place, flat):  # type: ignore[no-untyped-def]
    """The mean torque (Nm, of the currents alone) of a rotor turned at `rate` el. rad/s, `angle` rad behind.

    `settle` places of the table pass first, then `cycles` turns of it are measured, `per_place` substeps to a place.
    `flat` is room for two floats.
    """
    r = float(par[0])
    ell = float(par[1])
    kt = float(par[2])
    teeth = float(par[3])
    volts = float(par[9])
    amps = float(par[10]) * level
    pitch = float(par[11])
    offset = float(par[12])
    gain = float(par[18])
    fall = float(par[21])
    glide = float(par[22])
    w = rate / teeth
    cycle = table_a.shape[1]
    h = pitch / rate / per_place
    z = h * r / ell
    phi2 = 0.5 - z * (1 / 6 - z * (1 / 24 - z * (1 / 120 - z * (1 / 720 - z * (1 / 5040 - z * (
        1 / 40320 - z * (1 / 362880 - z * (1 / 3628800 - z / 39916800))))))))  # fmt: skip
    g = h / ell * (1.0 - z * phi2)
    q = h / ell * phi2
    ia = 0.0
    ib = 0.0
    total = 0.0
    count = 0
    # the command moves on in places, the rotor evenly: its middle is half a place behind
    for n in range(settle + cycles * cycle):
        at = n % cycle
        want_a = amps * float(table_a[0, at])
        want_b = amps * float(table_b[0, at])
        before = (n - 1) % cycle
        for k in range(per_place):
            if glide > 0.0:
                part = 1.0 - (k + 0.5) / per_place
                want_a = amps * (float(table_a[0, at]) + part * (float(table_a[0, before]) - float(table_a[0, at])))
                want_b = amps * (float(table_b[0, at]) + part * (float(table_b[0, before]) - float(table_b[0, at])))
            x = offset + (n + (k + 0.5) / per_place - 0.5) * pitch - angle
            turns = float(floor(x * 0.6366197723675814 + 0.5))
            y = (x - turns * 1.5707963267341256) - turns * 6.0771005065061922e-11
            y2 = y * y
            sine = y - y * y2 * (1 / 6 - y2 * (1 / 120 - y2 * (1 / 5040 - y2 * (1 / 362880 - y2 * (
                1 / 39916800 - y2 * (1 / 6227020800 - y2 * (1 / 1307674368000)))))))  # fmt: skip
            cosine = 1.0 - y2 * (0.5 - y2 * (1 / 24 - y2 * (1 / 720 - y2 * (1 / 40320 - y2 * (1 / 3628800 - y2 * (
                1 / 479001600 - y2 * (1 / 87178291200 - y2 * (1 / 20922789888000))))))))  # fmt: skip
            pairs = float(floor(turns * 0.5))
            odd = turns - 2.0 * pairs
            flip = 1.0 - 2.0 * (pairs - 2.0 * float(floor(pairs * 0.5)))
            sn = flip * (odd * cosine + (1.0 - odd) * sine)
            cs = flip * ((1.0 - odd) * cosine - odd * sine)
            ea = -kt * w * sn
            eb = kt * w * cs
            if mode == 2:
                va = want_a * gain
                vb = want_b * gain
            else:
                va = ea + r * ia + (want_a - ia) / g
                vb = eb + r * ib + (want_b - ib) / g
                least_a = -volts
                most_a = volts
                least_b = -volts
                most_b = volts
                if mode == 1 or mode == 3:
                    lowest = 0.0
                    if mode == 3:
                        lowest = fall * volts
                    if want_a > 0.0:
                        least_a = lowest
                    elif want_a < 0.0:
                        most_a = -lowest
                    else:
                        least_a = min(lowest, 0.0)
                        most_a = -least_a
                    if want_b > 0.0:
                        least_b = lowest
                    elif want_b < 0.0:
                        most_b = -lowest
                    else:
                        least_b = min(lowest, 0.0)
                        most_b = -least_b
                va = min(max(va, least_a), most_a)
                vb = min(max(vb, least_b), most_b)
            ua = va - ea - r * ia
            ub = vb - eb - r * ib
            if n >= settle:
                total += kt * ((ib + ub * q) * cs - (ia + ua * q) * sn)
                count += 1
            ia += ua * g
            ib += ub * g
    flat[0] = total / count
    return flat[0]


def pull_out(motor: Motor, drive: Drive, rate: float, *, level: float = 1.0) -> PullOut:
    """The pull-out torque at `rate` full steps/s, `level` of the current flowing. MotorError for a rate that is none.

    The motor's own friction is subtracted, a load's is not: this is the torque that is there for it.
    """
    check_rate(rate)
    turned = max(rate, min(STANDING, 0.006 * motor.resistance / motor.real_inductance))
    # an inertia is not needed here, and not every maker gives one
    torque, angle = greatest(motor if motor.inertia is not None else motor.changed(inertia=1e-5), drive, turned, level)
    own = motor.viscous * rate * pi / 2 / motor.teeth
    return PullOut(rate, torque - own, degrees(angle))


@lru_cache(maxsize=4096)  # loads that differ have the same curve: a move that is tuned asks for it some ten times
def greatest(motor: Motor, drive: Drive, rate: float, level: float) -> tuple[float, float]:
    """The most torque (Nm) of the currents at `rate` full steps/s, and the load angle (rad) where it is given."""
    rig = Rig(motor, drive)
    turning = rate * pi / 2
    place_time = drive.winding.pitch / turning
    tau = motor.real_inductance / float(rig.parameters[kernel.R])
    per_place = max(ceil(place_time / min(SUBSTEP * 1e-9, rig.substep * 1e-9)), 4 if len(drive.winding) < 64 else 1)
    cycle = len(drive.winding)
    settle = ceil(6 * tau / place_time / cycle) * cycle
    cycles = max(1, min(4, ceil(2e-3 / (place_time * cycle))))
    decay = drive.mode
    if drive.decay == "auto":
        decay = 1 if rate < drive.decay_threshold else 0
    solve = engine.compiled(mean_torque)
    flat = np.zeros(2)
    engine.check_size((settle + cycles * cycle) * per_place * 60, f"the torque at {rate:g} steps/s")

    def torque(angle: float) -> float:
        value: float = solve(turning, angle, rig.parameters, rig.table_a, rig.table_b, decay, level, settle, cycles,
                             per_place, flat)  # fmt: skip
        return value

    # the greatest torque lies between 90 degrees and 180; at an end of what is likely, it is looked for everywhere
    step = 2 * pi / ANGLES
    best = max(LIKELY, key=lambda k: torque(k * step))
    if best in (LIKELY[0], LIKELY[-1]):
        best = max(range(ANGLES), key=lambda k: torque(k * step))
    low, high = best * step - step, best * step + step
    inner, outer = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_inner, at_outer = torque(inner), torque(outer)
    while high - low > PRECISION:
        if at_inner >= at_outer:
            high, outer, at_outer = outer, inner, at_inner
            inner = high - GOLDEN * (high - low)
            at_inner = torque(inner)
        else:
            low, inner, at_inner = inner, outer, at_outer
            outer = low + GOLDEN * (high - low)
            at_outer = torque(outer)
    angle = (low + high) / 2
    return torque(angle), angle


def torque_curve(motor: Motor, drive: Drive, rates: Iterable[float], *, level: float = 1.0) -> list[PullOut]:
    """The pull-out torque at each of these speeds (full steps/s)."""
    return [pull_out(motor, drive, rate, level=level) for rate in rates]


def check_rate(rate: float) -> None:
    """Raise MotorError for a speed (full steps/s) that is none."""
    if isinstance(rate, bool | str) or not LEAST_RATE <= rate <= MOST_RATE:
        raise MotorError(f"a speed is {LEAST_RATE:g} to {MOST_RATE:g} full steps/s, not {rate}")


class Starts(NamedTuple):
    """Whether a motor starts at once into each of these rates (full steps/s), from rest and without a ramp."""

    rates: tuple[float, ...]
    started: tuple[bool, ...]

    @property
    def pull_in(self) -> float:
        """The highest of the rates up to which it started into every one; 0 if not even into the first."""
        best = 0.0
        for rate, good in zip(self.rates, self.started, strict=True):
            if not good:
                break
            best = rate
        return best

    @property
    def holes(self) -> tuple[tuple[float, float], ...]:
        """Where it failed below the highest rate it started into (resonance): first and last rate of each."""
        found: list[tuple[float, float]] = []
        inside = False
        for rate, good in zip(self.rates, self.started, strict=True):
            if not good and rate < self.highest:
                found[-1:] = [(found[-1][0], rate)] if inside else [*found[-1:], (rate, rate)]
            inside = not good
        return tuple(found)

    @property
    def highest(self) -> float:
        """The highest rate it started into: above `pull_in` where resonance leaves holes."""
        return max((rate for rate, good in zip(self.rates, self.started, strict=True) if good), default=0.0)


def starts(rig: Rig, rates: Sequence[float], *, steps: int = 200) -> Starts:
    """Try to start into each rate for `steps` full steps. The end, without a ramp down, does not count."""
    if not 1 <= steps <= 100_000:
        raise MotorError(f"{steps!r} steps: try a start with 1 to 100000")
    for rate in rates:
        check_rate(rate)
    work = sum(steps / rate * 1e9 / rig.substep for rate in rates)
    if work > MOST_WORK:
        raise MotorError(f"starts at {min(rates):g} steps/s take too long to be looked at: try higher rates")
    started = []
    for rate in rates:
        per_pulse = SECOND / (rate * rig.drive.winding.steps)
        times = np.round(np.arange(1, steps * rig.drive.winding.steps + 1) * per_pulse).astype(np.int64)
        started.append(not simulate(times, rig, settle=0).verdict.lost)
    return Starts(tuple(rates), tuple(started))


def pull_in_rate(
    motor: Motor, drive: Drive, load: Load = NO_LOAD, *, steps: int = 200, damping: Damping | None = None
) -> Starts:
    """The start-stop rates in octaves of a twelfth, from `SLOWEST_START` to where nothing starts any more."""
    rig = Rig(motor, replace(drive), load, damping=damping)
    rates: list[float] = []
    good: list[bool] = []
    rate, misses = SLOWEST_START, 0
    while misses < 12 and rate < MOST_RATE:
        found = starts(rig, [rate], steps=steps)
        rates.append(rate)
        good += found.started
        misses = 0 if found.started[0] else misses + 1
        if rate > 400 and misses > 6:
            break
        rate *= 2 ** (1 / 12)
    return Starts(tuple(rates), tuple(good))
