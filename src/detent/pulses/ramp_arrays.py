"""The times of the pulses of a ramp as an array.

t(x) = sqrt(gain x + slow**2) - slow ns from its slow end. A chunk is measured from its own slow end, in one of three
ways: by that root minus the root there; by gain x / (both added up), which loses nothing far from standstill; or, where
some hundred pulses change the speed little, row after row of pulses by a polynomial about the middle of each: no pulse
has a root of its own then.

Two ways to run the inner loops give the same integers: NumPy, and numba if it is installed.
"""

from importlib import import_module
from math import sqrt
from typing import Any

import numpy as np

from detent.pulses.accelerating import Accelerating
from detent.pulses.arrays import goes_to_numba, split
from detent.pulses.ramp_estimates import CHUNK, ROW, WAYS, Chunk
from detent.pulses.segment import Int64Array
from detent.pulses.settling import FARTHEST, GUARD, Scale, scale_for, settle
from detent.ticks import FIXED_BITS, HALF_NS, ONE_NS, Fixed, Ns

COMPILED_CHUNK = 1 << 16  # pulses whose times and work stay in the cache; NumPy's calls are worth it for twice as many
FEW = 8  # pulses for which the exact law is quicker than arrays

FAR = 2.0**36  # ns from the base at which one in 2**12 comes too close: a shorter chunk is quicker
SHORTEST = 256  # pulses of such a chunk, unless they take so long that none is safe
NEAR = 2.0**33  # ns from standstill below which the form without a division is good enough

COARSE = 2.0**30  # ns from the base up to which places are given up for more rows: hardly any pulse comes too close
ROWS_GUARD = 2 * GUARD  # units: a sum of five terms is rounded to places up to five times, and leaves out a bit


def fill_ramp(out: Int64Array, first: int, law: Accelerating, start: Fixed) -> None:
    """Write the ns of the pulses first .. of a ramp in a train that starts at `start`."""
    squares = (law.divisor * ONE_NS) ** 2  # (P x + Q**2) / squares is the square of the ns from standstill
    gain = law.gain_ns
    dense: Any = import_module("detent.pulses.dense") if goes_to_numba(len(out)) else None
    size = most = CHUNK if dense is None else COMPILED_CHUNK
    work = np.empty(min(size, len(out)))
    done = 0
    while done < len(out):
        count = min(size, len(out) - done)
        if count > ROW:
            count -= count % ROW
        n = first + done
        # the slow end of the chunk: before its first pulse (up), or at its last (down)
        low_n = n - 1 if law.up else n + count - 1
        low = law.low + low_n if law.up else law.high - low_n
        square = (law.root_gain * low + law.slow_root**2) / squares
        root = sqrt(square)
        top = sqrt(square + gain * count)
        reach = gain * count / (top + root)
        if (reach > FAR and count > SHORTEST) or (reach > FARTHEST and count > FEW):
            size = count // 2
            continue

        def exact(i: int, n: int = n) -> Ns:
            return (law.fixed(n + i) + start + HALF_NS) >> FIXED_BITS

        block = out[done : done + count]
        done, size = done + count, min(2 * size, most)
        if count <= FEW:
            block[:] = [exact(i) for i in range(count)]
            continue
        base, rest = split(law.fixed(low_n) + start)
        way, scale, guard = "rows", scale_for(max(reach, COARSE)), ROWS_GUARD
        if not _in_rows(count, gain, square, top, scale):
            way, scale, guard = "rooted", scale_for(top), GUARD
            if top > NEAR:
                way, scale = "divided", scale_for(reach)
        chunk = Chunk(count, law.up, gain, square, root, rest / ONE_NS + scale.magic + guard * scale.unit)
        if dense is not None:
            dense.fill(block, work.view(np.int64), way, chunk, scale, base, exact, guard)
        else:
            estimate = WAYS[way](chunk, work[:count])
            settle(block, estimate, scale, base, exact, guard)


def _in_rows(count: int, gain: float, square: float, top: float, scale: Scale) -> bool:
    """Whether what the polynomial leaves out is little in whole rows."""
    if count % ROW or gain * ROW > square:
        return False
    u = gain * (ROW / 2) / square  # 1/2 at most: all that the series leaves out is less than twice its next term
    return top * u**5 * (7 / 256) < scale.unit / 4
