"""The inner loop of long ramps, compiled by numba. Imported only when it is wanted: that takes a second.

The integers are those of the NumPy path, since both ask the exact law where float64 cannot tell. The loops
are written so that the compiler makes vector code of them: one form each, over a slice, without a branch.
"""

from collections.abc import Callable

import numba as nb
import numpy as np

from detent.pulses.segment import Int64Array
from detent.ticks import Ns

_BLOCK = 1024  # pulses between two looks at how close the estimates came


@nb.njit(cache=True, error_model="numpy")
def _rooted(out, j, sign, gain, square, shift, threshold, base):  # type: ignore[no-untyped-def]
    """Write the times of pulses j, j + sign ... steps from the slow end; return how many came too close."""
    near = 0
    for i in range(len(out)):
        y = sign * np.sqrt(gain * (j + sign * i) + square) + shift
        whole = np.floor(y)
        near += 1 if y - whole < threshold else 0
        out[i] = base + np.int64(whole)
    return near


@nb.njit(cache=True, error_model="numpy")
def _divided(out, j, sign, gain, square, root, lead, threshold, base):  # type: ignore[no-untyped-def]
    """The same by the form that stays exact far from standstill."""
    near = 0
    for i in range(len(out)):
        step = gain * (j + sign * i)
        y = sign * (step / (np.sqrt(step + square) + root)) + lead
        whole = np.floor(y)
        near += 1 if y - whole < threshold else 0
        out[i] = base + np.int64(whole)
    return near


@nb.njit(cache=True, error_model="numpy")
def _ramp(out, close, sign, gain, square, root, divide, lead, threshold, base):  # type: ignore[no-untyped-def]
    """Write the times; return how many places in `close` hold the index of an estimate that came too close."""
    found = 0
    for begin in range(0, len(out), _BLOCK):
        block = out[begin : begin + _BLOCK]
        # steps from the slow end of the chunk: 1 .. len, or len - 1 .. 0
        j = 1.0 + begin if sign > 0.0 else len(out) - 1.0 - begin
        if divide:
            near = _divided(block, j, sign, gain, square, root, lead, threshold, base)
        else:
            near = _rooted(block, j, sign, gain, square, lead - sign * root, threshold, base)
        if near:
            for i in range(len(block)):
                step = gain * (j + sign * i)
                if divide:
                    y = sign * (step / (np.sqrt(step + square) + root)) + lead
                else:
                    y = sign * np.sqrt(step + square) + (lead - sign * root)
                # with a margin, should the compiler have arranged this loop differently
                if y - np.floor(y) < 1.5 * threshold or y - np.floor(y) > 1.0 - threshold:
                    close[found] = begin + i
                    found += 1
    return found


def ramp(out: Int64Array, up: bool, gain: float, square: float, root: float, divide: bool, lead: float,
         guard: float, base: Ns, exact: Callable[[int], Ns]) -> None:  # fmt: skip
    """Write a chunk of a ramp; the meaning of the numbers is in `arrays.fill_ramp`."""
    close = np.empty(len(out), np.int64)
    slow = root if root > 0.0 else 1e-300  # 0 / 0 at standstill itself
    found = _ramp(out, close, 1.0 if up else -1.0, gain, square, slow, divide, lead, 2.0 * guard, base)
    for i in close[:found].tolist():
        out[i] = exact(i)
