"""The motor: simulated seconds a second, alone and abreast, against scipy's solve_ivp at equal accuracy."""

import os
import subprocess
import sys
from bisect import bisect_right
from functools import partial
from math import cos, sin
from time import perf_counter
from typing import Any

import numpy as np

from bench.rows import Row, measure
from detent.motors import kernel
from detent.motors.curve import greatest, torque_curve
from detent.motors.damping import UNDAMPED
from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.move import simulate
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.motors.variants import SPREAD, Ensemble, draws, loss_rate
from detent.motors.winding import HALF
from detent.ticks import SECOND

PULSES, SETTLE_MS, VARIANTS = 1000, 29, 1024
GAIN = 200.0  # V/A of the smooth chopper that a general integrator can take

FIRST_CALL = """
import sys, time
import numba, numpy as np
from detent.motors.drive import Drive
from detent.motors.move import simulate
from detent.motors.named import motor
from detent.motors.rotor import Rig
rig, times = Rig(motor("qsh4218-35-10-027"), Drive(24, 1.0)), np.arange(1, 11) * 1_000_000
begin = time.perf_counter()
simulate(times, rig)
print(time.perf_counter() - begin)
"""


def rig() -> Rig:
    """The small motor with its own inertia again as load, 24 V; undamped, as scipy gets it."""
    found = motor("qsh4218-35-10-027")
    return Rig(found, Drive(24, 1.0, HALF), Load(inertia=found.rotor, torque=0.03), damping=UNDAMPED)


def move() -> Any:
    """1000 half steps in 0.36 s with ramps."""
    half = PULSES // 2
    n = np.arange(1, half + 1)
    up = 2 * n / (700 + np.sqrt(700.0**2 + (4600.0**2 - 700.0**2) * n / half))
    return np.round(np.concatenate((up, 2 * up[-1] - up[::-1][1:], [2 * up[-1]])) * SECOND).astype(np.int64)


def by_scipy(one: Rig, times: Any) -> float:
    """The end angle by LSODA: a proportional chopper with saturation, the pulses looked up as it goes."""
    from scipy.integrate import solve_ivp

    found, drive, load = one.motor, one.drive, one.load
    kt, p, ohm, henry = found.torque_constant, found.teeth, found.resistance, found.inductance
    inertia, volts = found.rotor + load.inertia, drive.supply
    pulses = (times * 1e-9).tolist()

    def rates(t: float, y: Any) -> list[float]:
        place = bisect_right(pulses, t) % 8
        want_a, want_b = HALF.a[place], HALF.b[place]
        x, w, ia, ib = y
        s, c = sin(x), cos(x)
        va = min(max(GAIN * (want_a - ia) + ohm * want_a - kt * w * s, -volts), volts)
        vb = min(max(GAIN * (want_b - ib) + ohm * want_b + kt * w * c, -volts), volts)
        return [p * w, (kt * (ib * c - ia * s) - load.torque) / inertia, (va - ohm * ia + kt * w * s) / henry,
                (vb - ohm * ib - kt * w * c) / henry]  # fmt: skip

    state = one.at_rest(0, 1.0)[0]
    begin = [state[kernel.X], 0.0, state[kernel.IA], state[kernel.IB]]
    end = pulses[-1] + SETTLE_MS * 1e-3
    return float(solve_ivp(rates, (0, end), begin, "LSODA", rtol=1e-5, atol=1e-7, max_step=2e-4).y[0, -1])


def rows() -> list[Row]:
    """Simulated seconds a second, each against scipy in this run; the first call; a torque curve."""
    one, times = rig(), move()
    settle = SETTLE_MS * 1_000_000
    seconds = int(times[-1]) * 1e-9 + SETTLE_MS * 1e-3
    tries = []
    for _ in range(3):
        begin = perf_counter()
        by_scipy(one, times)
        tries.append(perf_counter() - begin)
    baseline = seconds / min(tries)
    single = seconds / measure(partial(simulate, times, one, settle=settle), 15)
    many = Ensemble(one, draws(SPREAD.of(one), VARIANTS))
    lockstep = VARIANTS * seconds / measure(partial(many.judge, times, settle=settle))
    hard = np.round(times * 0.35).astype(np.int64)  # so steep that each loses it
    all_of_them = measure(partial(many.judge, hard))
    first_loss = measure(partial(many.survives, hard))
    loss_rates = measure(partial(loss_rate, times, one, tried=2048))
    command = [sys.executable, "-c", FIRST_CALL]
    # what an installed Python keeps: its bytecode, and numba's machine code
    env = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run(command, check=True, capture_output=True, env=env)
    first = float(subprocess.run(command, check=True, capture_output=True, text=True, env=env).stdout)

    def curve_anew() -> None:
        greatest.cache_clear()
        torque_curve(one.motor, one.drive, [250 * k for k in range(1, 12)])

    curve = measure(curve_anew)
    scipy = "scipy LSODA rtol 1e-5, s/s"
    return [
        Row("one motor, simulated s", single, "s/s", scipy, baseline, 500 * baseline),
        Row(f"{VARIANTS} motors abreast, simulated s", lockstep, "s/s", scipy, baseline, 8000 * baseline),
        Row(
            "first loss of a move too steep",
            first_loss * 1e3,
            "ms",
            "all variants to the end, ms",
            all_of_them * 1e3,
            None,
        ),
        Row("loss rate of 2048 variants and corners", loss_rates, "s", "allowed, s", 2.0, 2.0),
        Row("first call, compiled code kept", first, "s", "allowed, s", 0.5, 0.5),
        Row("torque curve of 11 points", curve * 1e3, "ms", "prototype, ms", 20.0, None),
    ]
