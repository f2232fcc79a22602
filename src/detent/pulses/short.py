"""A short train as a whole: every pulse estimated in float64 from the start of the train, and all settled in one go.

It takes as many calls of NumPy for a move of three segments as `filling` takes for one of them.
"""

from bisect import bisect_right
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from detent.pulses.accelerating import BELOW_NS, NS_PER_FIXED, Accelerating
from detent.pulses.laws import AnySegment
from detent.pulses.segment import Int64Array
from detent.pulses.settling import GUARD, scale_for, settle
from detent.pulses.uniform import Uniform
from detent.ticks import FIXED_BITS, HALF_NS, Fixed, Ns

MOST = 1 << 13  # pulses
SEGMENTS = 8  # more of them, and columns are quicker
FAR = 2.0**34  # ns from the start, and from standstill: hardly any pulse comes too close

_COUNTING = np.arange(2 * MOST + 1, dtype=np.float64)


@lru_cache(maxsize=64)
def _roots(gain: float, square: float, most: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """The ns from standstill 0 .. most steps from the slow end of a ramp, up and down; a program has few ramps."""
    roots = np.sqrt(_COUNTING[: most + 1] * gain + square)
    both = roots, roots[::-1].copy()
    for each in both:
        each.flags.writeable = False
    return both


@lru_cache(maxsize=64)
def _multiples(period: float, most: int) -> npt.NDArray[np.float64]:
    """0 .. most periods; the same few speeds come again."""
    multiples = _COUNTING[: most + 1] * period
    multiples.flags.writeable = False
    return multiples


def fill(out: Int64Array, segments: Sequence[AnySegment], before: Sequence[int], start: Fixed) -> bool:
    """Write the ns of every pulse of a train; False if it is not short. `before`: the pulses before each segment."""
    if len(out) > MOST or len(segments) > SEGMENTS:
        return False
    estimate = np.empty(len(out))
    done, farthest = 0, 0.0
    for segment in segments:
        anchor = segment.anchor * NS_PER_FIXED
        if isinstance(segment, Accelerating):
            low, high = segment.low, segment.high
            if high > MOST:
                return False
            most = 1 << high.bit_length()
            ascending, descending = _roots(segment.gain_ns, segment.square_ns, most)
            part = estimate[done : done + high - low]
            if segment.up:
                np.add(ascending[low + 1 : high + 1], anchor - segment.slow_ns, part)
            else:
                np.subtract(anchor + segment.slow_ns, descending[most + 1 - high : most + 1 - low], part)
            far = abs(anchor) + descending.item(0)
            done += high - low
        elif isinstance(segment, Uniform):
            first, last = segment.first, segment.last
            if last is None or last > MOST:
                return False
            period = segment.numerator / segment.denominator
            part = estimate[done : done + last - first]
            np.add(_multiples(period, 1 << last.bit_length())[first + 1 : last + 1], anchor, part)
            far = abs(anchor) + last * period
            done += last - first
        else:
            return False
        if far > farthest:
            farthest = far
    if farthest > FAR:
        return False
    begin = start + HALF_NS
    scale = scale_for(farthest)
    np.add(estimate, scale.magic + ((begin & BELOW_NS) * NS_PER_FIXED + GUARD * scale.unit), estimate)

    def exact(i: int) -> Ns:
        k = bisect_right(before, i) - 1
        return (begin + segments[k].fixed(i + 1 - before[k])) >> FIXED_BITS

    settle(out, estimate, scale, begin >> FIXED_BITS, exact)
    return True
