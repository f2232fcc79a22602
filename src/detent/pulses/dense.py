"""The inner loops of long ramps, compiled by numba. Imported only when they are wanted: that takes a second.

The integers are those of the NumPy path, since both ask the exact law where float64 cannot tell. The loops
are written so that the compiler makes vector code of them: one form each, over a row, without a branch.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from detent.compiled import jit
from detent.pulses.accelerating import TINY
from detent.pulses.ramp_estimates import FROM_MIDDLE, SERIES, Chunk
from detent.pulses.segment import Int64Array
from detent.pulses.settling import Scale, shift_of
from detent.ticks import Ns

_WAYS = {"rooted": 0, "divided": 1, "rows": 2}

_compiled = partial(jit, fastmath={"contract"})


@_compiled
def _rooted(out, bits, j, sign, gain, square, plus, places, shift, mask):  # type: ignore[no-untyped-def]
    """Write the times of the pulses j, j + sign ... steps from the slow end; return how many came too close."""
    near = 0
    for i in range(len(out)):
        b = np.float64(plus + sign * np.sqrt(gain * (j + sign * i) + square)).view(np.int64)
        bits[i] = b
        out[i] = shift + (b >> places)
        near += 1 if b & mask == 0 else 0
    return near


@_compiled
def _divided(out, bits, j, sign, gain, square, root, plus, places, shift, mask):  # type: ignore[no-untyped-def]
    """The same by the form that stays exact far from standstill."""
    near = 0
    for i in range(len(out)):
        growth = gain * (j + sign * i)
        b = np.float64(plus + sign * (growth / (np.sqrt(growth + square) + root))).view(np.int64)
        bits[i] = b
        out[i] = shift + (b >> places)
        near += 1 if b & mask == 0 else 0
    return near


@_compiled
def _row(out, bits, steps, zeroth, first, second, third, fourth, places, shift, mask):  # type: ignore[no-untyped-def]
    """The same by a polynomial of the steps from the middle."""
    near = 0
    for i in range(len(out)):
        x = steps[i]
        b = np.float64(zeroth + x * (first + x * (second + x * (third + x * fourth)))).view(np.int64)
        bits[i] = b
        out[i] = shift + (b >> places)
        near += 1 if b & mask == 0 else 0
    return near


@_compiled
def _fill(out, close, steps, way, sign, gain, square, root, plus, places, shift, mask):  # type: ignore[no-untyped-def]
    """Write the times; return how many places in `close` hold the index of an estimate that came too close."""
    found = 0
    bits = np.empty(len(steps), np.int64)
    for begin in range(0, len(out), len(steps)):
        row = out[begin : begin + len(steps)]
        # steps from the slow end of the chunk: 1 .. len, or len - 1 .. 0
        j = 1.0 + begin if sign > 0.0 else len(out) - 1.0 - begin
        if way == 0:
            near = _rooted(row, bits, j, sign, gain, square, plus - sign * root, places, shift, mask)
        elif way == 1:
            near = _divided(row, bits, j, sign, gain, square, root, plus, places, shift, mask)
        else:
            growth = gain * (j - sign * steps[0])
            middle = growth + square
            base = np.sqrt(middle)
            u = sign * gain / middle  # of a step
            first, second = sign * base * u, sign * base * u * u
            near = _row(
                row, bits, steps, plus + sign * (growth / (base + root)), SERIES[0] * first, SERIES[1] * second,
                SERIES[2] * first * u * u, SERIES[3] * second * u * u, places, shift, mask,
            )  # fmt: skip
        if near:
            for i in range(len(row)):
                if bits[i] & mask == 0:
                    close[found] = begin + i
                    found += 1
    return found


def fill(
    block: Int64Array,
    close: Int64Array,
    way: str,
    chunk: Chunk,
    scale: Scale,
    base: Ns,
    exact: Callable[[int], Ns],
    guard: int,
) -> None:
    """Write a chunk of a ramp; `close` has room for as many, all else is said in `ramp_arrays` and `settling`."""
    found = _fill(
        block, close, FROM_MIDDLE, _WAYS[way], 1.0 if chunk.up else -1.0, chunk.gain, chunk.square,
        max(chunk.root, TINY), chunk.plus, scale.places, shift_of(base, scale), int(scale.masks[guard]),
    )  # fmt: skip
    for i in close[:found].tolist():
        block[i] = exact(i)
