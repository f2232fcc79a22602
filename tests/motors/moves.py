"""Pulse trains and rigs for tests of motors."""

import numpy as np
import numpy.typing as npt

from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.motors.winding import HALF

SMALL, LARGE = motor("qsh4218-35-10-027"), motor("qsh4218-41-10-035")


def even(rate: float, count: int) -> npt.NDArray[np.int64]:
    """Pulses at a constant rate."""
    found: npt.NDArray[np.int64] = np.round(np.arange(1, count + 1) * (1e9 / rate)).astype(np.int64)
    return found


def ramped(pulses: int, v0: float, v1: float) -> npt.NDArray[np.int64]:
    """Times of a constant acceleration from v0 to v1 over half the pulses, and back."""
    half = pulses // 2
    n = np.arange(1, half + 1)
    up = 2 * n / (v0 + np.sqrt(v0**2 + (v1**2 - v0**2) * n / half))
    times = np.concatenate((up, 2 * up[-1] - up[::-1][1:], [2 * up[-1]]))
    found: npt.NDArray[np.int64] = np.round(times * 1e9).astype(np.int64)
    return found


def rig(**load: float) -> Rig:
    """A small motor at 24 V with twice its own inertia."""
    return Rig(SMALL, Drive(24, 1.0, HALF), Load(**{"inertia": 3.5e-6, "friction": 0.01, **load}))  # type: ignore[arg-type]
