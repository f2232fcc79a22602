"""Draws that everybody can make again, and what a count of losses proves.

A draw is a function of its seed, its number and its dimension (SplitMix64: Steele, Lea, Flood, "Fast splittable
pseudorandom number generators", 2014): the same on every machine, and in whatever order the work is divided. The
bound on a rate is that of Clopper and Pearson (1934), which holds for independent draws, as these are.
"""

from collections.abc import Sequence
from math import log, log1p

import numpy as np
import numpy.typing as npt

from detent.motors.motor import MotorError

_GAMMA = np.uint64(0x9E3779B97F4A7C15)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
MOST_DIMENSIONS = 64


def uniform(seed: int, count: int, dimensions: int, first: int = 0) -> npt.NDArray[np.float64]:
    """Numbers in [0, 1), `count` rows of `dimensions`: rows `first`, `first` + 1, ... of the sequence of `seed`."""
    if not 0 < dimensions <= MOST_DIMENSIONS:
        raise MotorError(f"draws have 1 to {MOST_DIMENSIONS} dimensions, not {dimensions}")
    rows = np.arange(first, first + count, dtype=np.uint64)[:, None]
    columns = np.arange(dimensions, dtype=np.uint64)[None, :]
    start = _mixed(np.array([seed & (1 << 64) - 1], np.uint64))
    with np.errstate(over="ignore"):
        z = _mixed(start + _GAMMA * (rows * np.uint64(MOST_DIMENSIONS) + columns + np.uint64(1)))
    return (z >> np.uint64(11)).astype(np.float64) * 2.0**-53


def _mixed(z: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    with np.errstate(over="ignore"):
        z = (z ^ (z >> np.uint64(30))) * _FIRST
        z = (z ^ (z >> np.uint64(27))) * _SECOND
    return z ^ (z >> np.uint64(31))


def corners(ranges: Sequence[tuple[float, float]]) -> npt.NDArray[np.float64]:
    """Every combination of ends, a row each; a range without width has one end."""
    rows: list[tuple[float, ...]] = [()]
    for low, high in ranges:
        rows = [(*row, end) for row in rows for end in ((low, high) if low != high else (low,))]
    return np.array(rows, np.float64)


def bound(lost: int, tried: int, *, looks: int = 1, confidence: float = 0.95) -> float:
    """The rate of losses is below this, with `confidence`, when `lost` of `tried` independent draws were.

    Whoever looks `looks` times at fresh draws, and stops at a look that pleases, has that many chances to be wrong:
    each gets its part of them. MotorError for counts that are none.
    """
    if not (0 <= lost <= tried and tried > 0 and looks > 0 and 0 < confidence < 1):
        raise MotorError(f"{lost} lost of {tried} in {looks} looks: counts that cannot be")
    chance = (1 - confidence) / looks
    if lost == tried:
        return 1.0
    if lost == 0:
        return -float(np.expm1(log(chance) / tried))
    ways, counts = _ways(lost, tried), np.arange(lost + 1)
    low, high = lost / tried, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        if middle < 1 and _at_most(ways, counts, tried, middle) > chance:
            low = middle
        else:
            high = middle
    return high


def _ways(lost: int, tried: int) -> npt.NDArray[np.float64]:
    """The logarithm of how many ways there are to lose 0, 1, ... `lost` of them."""
    k = np.arange(1, lost + 1, dtype=np.float64)
    return np.concatenate(([0.0], np.cumsum(np.log((tried - k + 1) / k))))


def _at_most(ways: npt.NDArray[np.float64], counts: npt.NDArray[np.int64], tried: int, rate: float) -> float:
    """The chance of so few in `tried`."""
    return float(np.exp(ways + counts * log(rate) + (tried - counts) * log1p(-rate)).sum())
