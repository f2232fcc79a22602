"""Estimates in float64 of the times of a ramp's pulses, a chunk at a time, in the three ways of `ramp_arrays`.

t(x) = sqrt(gain x + slow**2) - slow ns from the slow end of the ramp, and likewise from the slow end of a chunk.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from detent.pulses.accelerating import TINY

FloatArray: TypeAlias = npt.NDArray[np.float64]

CHUNK = 1 << 17  # pulses, at most
ROW = 256  # pulses about whose middle a polynomial is taken

_COUNTING = np.arange(CHUNK + 1, dtype=np.float64)
_COUNTING_DOWN = _COUNTING[::-1].copy()
FROM_MIDDLE = np.arange(ROW) - (ROW - 1) / 2
SERIES = (1 / 2, -1 / 8, 1 / 16, -5 / 128)  # sqrt(1 + u) = 1 + u / 2 - u**2 / 8 ...; the next is 7 / 256
_UP = np.array([np.ones(ROW), *(factor * FROM_MIDDLE ** (i + 1) for i, factor in enumerate(SERIES))])
_DOWN = _UP * [[1], [1], [-1], [1], [-1]]  # minus what it is where steps count down


class Chunk(NamedTuple):
    """Pulses that are estimated together, from the slow end of all of them; times are ns."""

    pulses: int
    up: bool
    gain: float
    square: float  # of the time from standstill to the slow end
    root: float  # that time
    plus: float  # what is added to every estimate


def _rooted(chunk: Chunk, work: FloatArray) -> FloatArray:
    """The root, less the root at the slow end."""
    np.multiply(_steps(chunk), chunk.gain, work)
    np.add(work, chunk.square, work)
    np.sqrt(work, work)
    return np.add(work, chunk.plus - chunk.root, work) if chunk.up else np.subtract(chunk.plus + chunk.root, work, work)


def _divided(chunk: Chunk, work: FloatArray) -> FloatArray:
    """What the square has grown by, over the sum of both roots."""
    growth = _steps(chunk) * chunk.gain
    np.add(growth, chunk.square, work)
    np.sqrt(work, work)
    np.add(work, max(chunk.root, TINY), work)
    np.divide(growth, work, work)
    return np.add(work, chunk.plus, work) if chunk.up else np.subtract(chunk.plus, work, work)


def _rows(chunk: Chunk, work: FloatArray) -> FloatArray:
    """Rows of a polynomial about the middle of each; a matrix product is all their sums of five terms in one go."""
    rows, gain, up = chunk.pulses // ROW, chunk.gain, chunk.up
    growth = _COUNTING[:rows] * (ROW * gain if up else -ROW * gain)
    growth += (ROW + 1) / 2 * gain if up else (chunk.pulses - (ROW + 1) / 2) * gain
    square = growth + chunk.square
    terms = np.empty((5, rows))
    root = np.sqrt(square, terms[1])
    growth /= root + chunk.root
    (np.add if up else np.subtract)(chunk.plus, growth, terms[0])
    a_step = np.divide(gain, square, square)  # of u
    root *= a_step
    np.multiply(root, a_step, terms[2])
    np.multiply(terms[2], a_step, terms[3])
    np.multiply(terms[3], a_step, terms[4])
    np.matmul(terms.T, _UP if up else _DOWN, out=work.reshape(rows, ROW))
    return work


def _steps(chunk: Chunk) -> FloatArray:
    """How many steps from the slow end each pulse is."""
    if chunk.up:
        return _COUNTING[1 : chunk.pulses + 1]
    return _COUNTING_DOWN[CHUNK + 1 - chunk.pulses :]


WAYS: dict[str, Callable[[Chunk, FloatArray], FloatArray]] = {"rooted": _rooted, "divided": _divided, "rows": _rows}
