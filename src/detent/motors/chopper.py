"""The switching chopper, microsecond by microsecond: for a look at currents and their ripple, not for moves.

Fixed off-time: a phase gets the full supply until its current reaches what is wanted (not looked at during the blanking
behind each switching-on), then the off-time passes: with the winding shorted (slow), against the supply (fast), or
fast for the first part of it and slow for the rest (mixed). The rotor turns evenly at the speed of the pulses.
"""

from math import ceil, cos, exp, pi, sin
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from detent.motors import engine, kernel
from detent.motors.curve import check_rate
from detent.motors.drive import Drive
from detent.motors.motor import Motor, MotorError, need
from detent.motors.rotor import Rig

Floats = npt.NDArray[np.float64]

MICROSECOND = 1e-6
MOST_ROWS = 10_000_000


class Waveform(NamedTuple):
    """The currents at every microsecond, after they have settled."""

    times: Floats  # s
    ia: Floats
    ib: Floats
    reference_a: Floats
    reference_b: Floats
    torque: float  # Nm, the mean of it

    @property
    def ripple(self) -> float:
        """A, rms, of the currents against what was wanted."""
        both = np.concatenate((self.ia - self.reference_a, self.ib - self.reference_b))
        return float(np.sqrt((both**2).mean()))


def switch(par, table_a, table_b, places_per_s, angle, settle, off_us, fast_us, blank_us, out):  # type: ignore[no-untyped-def]
    """Fill `out` (rows of ia, ib, wanted a, wanted b) after `settle` us; return the mean torque."""
    r = float(par[0])
    ell = float(par[1])
    kt = float(par[2])
    teeth = float(par[3])
    volts = float(par[9])
    amps = float(par[10])
    pitch = float(par[11])
    offset = float(par[12])
    cycle = table_a.shape[1]
    w = places_per_s * pitch / teeth
    a = exp(-MICROSECOND * r / ell)
    g = (1.0 - a) / r
    ia = 0.0
    ib = 0.0
    off_a = 0
    off_b = 0
    on_a = 0
    on_b = 0
    total = 0.0
    for k in range(settle + len(out)):
        t = k * MICROSECOND
        place = int(t * places_per_s)
        want_a = amps * float(table_a[0, place % cycle])
        want_b = amps * float(table_b[0, place % cycle])
        x = offset + (t * places_per_s - 0.5) * pitch - angle
        sn = sin(x)
        cs = cos(x)
        sign_a = 1.0 if want_a > 0.0 else -1.0
        sign_b = 1.0 if want_b > 0.0 else -1.0
        # phase A
        if off_a > 0:
            off_a -= 1
            on_a = 0
        elif want_a == 0.0 or (ia * sign_a >= want_a * sign_a and (on_a == 0 or on_a >= blank_us)):
            off_a = off_us
            on_a = 0
        else:
            on_a += 1
        va = sign_a * volts
        if off_a > 0:
            va = 0.0
            if off_a > off_us - fast_us:
                va = -volts if ia > 0.0 else volts
        # phase B
        if off_b > 0:
            off_b -= 1
            on_b = 0
        elif want_b == 0.0 or (ib * sign_b >= want_b * sign_b and (on_b == 0 or on_b >= blank_us)):
            off_b = off_us
            on_b = 0
        else:
            on_b += 1
        vb = sign_b * volts
        if off_b > 0:
            vb = 0.0
            if off_b > off_us - fast_us:
                vb = -volts if ib > 0.0 else volts
        na = a * ia + g * (va + kt * w * sn)
        nb = a * ib + g * (vb - kt * w * cs)
        # a bridge that lets the current fall against the supply stops at zero
        if off_a > off_us - fast_us and na * ia < 0.0:
            na = 0.0
        if off_b > off_us - fast_us and nb * ib < 0.0:
            nb = 0.0
        ia = na
        ib = nb
        if k >= settle:
            out[k - settle, 0] = ia
            out[k - settle, 1] = ib
            out[k - settle, 2] = want_a
            out[k - settle, 3] = want_b
            total += kt * (ib * cs - ia * sn)
    return total / len(out)


def inspect(
    motor: Motor,
    drive: Drive,
    rate: float,
    *,
    decay: Literal["slow", "mixed", "fast"] = "slow",
    load_angle: float = 90.0,
    cycles: int = 2,
    off_time: float = 20e-6,
    blanking: float = 2e-6,
) -> Waveform:
    """The currents of a switching chopper at `rate` full steps/s, the rotor `load_angle` el. degrees behind."""
    check_rate(rate)
    if not 1 <= cycles <= 1000:
        raise MotorError(f"{cycles!r} cycles: look at 1 to 1000")
    if cycles * 4e6 / rate > MOST_ROWS:
        raise MotorError(
            f"{cycles} electrical cycles at {rate:g} steps/s are {cycles * 4 / rate:.3g} s, a row each microsecond: "
            f"more than {MOST_ROWS} rows; look at a higher rate"
        )
    need("chopper", 1e-6, 1e-3, off_time=off_time, blanking=blanking)
    if decay not in ("slow", "mixed", "fast"):
        raise MotorError(f"no decay {decay!r}: slow, mixed or fast")
    rig = Rig(motor if motor.inertia is not None else motor.changed(inertia=1e-5), drive)
    off = round(off_time * 1e6)
    fast = {"slow": 0, "mixed": max(off // 3, 1), "fast": off}[decay]
    settle = ceil(6e6 * float(rig.parameters[kernel.L] / rig.parameters[kernel.R]))
    rows = ceil(cycles * 4e6 / rate)
    engine.check_size(settle + rows, f"{cycles} electrical cycles at {rate:g} steps/s")
    out = np.empty((rows, 4))
    torque: float = engine.compiled(switch)(
        rig.parameters, rig.table_a, rig.table_b, rate * drive.winding.steps, load_angle * pi / 180, settle, off, fast,
        round(blanking * 1e6), out,
    )  # fmt: skip
    times = np.arange(rows, dtype=np.float64) * MICROSECOND
    return Waveform(times, out[:, 0], out[:, 1], out[:, 2], out[:, 3], torque)
