"""From estimates in float64 to whole ns: the floor of each, and which of them come too close to tell.

A large number (`magic`) added to an estimate leaves it with a fixed number of binary places, its `places`, as an
integer in the low bits of the sum. So its floor is a shift, and its fraction a mask. The more places, the smaller the
estimates that have room: what is estimated has to lie within a known reach of its base. One unit, 2**-places ns, is at
least 2**-51 of that reach then, so that 8 rounding errors, each 2**-53 of it, are 2 units at most.
"""

from collections.abc import Callable, Mapping
from math import frexp
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from detent.pulses.segment import Int64Array
from detent.ticks import Ns

MOST_PLACES = 40
LEAST_PLACES = 4
MANY = 2000  # estimates of which NumPy finds the least, which is 0 or more, sooner than it counts those that are not 0
GUARD = 4  # units: twice what 8 rounding errors and the rounding to places can make


class Scale(NamedTuple):
    """What makes estimates within a reach integers: `magic` is added to them, together with a guard for their error."""

    places: int
    magic: float
    offset: int  # what the shift leaves of the magic
    unit: float  # ns
    # as NumPy takes them quickest: the places; and for each guard, in units, the bits of which one is set unless an
    # estimate that had it added is within it of a whole ns
    shift: npt.NDArray[np.int64]
    masks: Mapping[int, npt.NDArray[np.int64]]


def _scale(places: int) -> Scale:
    magic = 1.5 * 2.0 ** (52 - places)
    offset = int(np.float64(magic).view(np.int64)) >> places
    masks = {guard: np.array((1 << places) - 2 * guard) for guard in (GUARD, 2 * GUARD)}
    return Scale(places, magic, offset, 2.0**-places, np.array(places), masks)


_SCALES = tuple(_scale(places) for places in range(MOST_PLACES + 1))
FARTHEST = 2.0 ** (51 - LEAST_PLACES) - 8.0  # ns


def scale_for(reach: float) -> Scale:
    """The most places that estimates have room for which lie within `reach` ns of their base, FARTHEST at most."""
    return _SCALES[min(51 - frexp(reach + 8.0)[1], MOST_PLACES)]


def shift_of(base: Ns, scale: Scale) -> int:
    """What is added to the shifted sum so that it is base + floor(estimate), in int64 that runs over."""
    shift = base - scale.offset
    return shift if shift >= -(1 << 63) else shift + (1 << 64)


def settle(
    out: Int64Array,
    estimate: npt.NDArray[np.float64],
    scale: Scale,
    base: Ns,
    exact: Callable[[int], Ns],
    guard: int = GUARD,
) -> None:
    """Write base + floor(estimate); estimates have `scale.magic` and `guard` units added already, and are used up.

    Without these they are within `guard` units of the truth, and `scale` has room for them; `exact(i)` settles those
    that come too close.
    """
    bits = estimate.view(np.int64)
    np.right_shift(bits, scale.shift, out)
    np.add(out, shift_of(base, scale), out)
    np.bitwise_and(bits, scale.masks[guard], bits)
    if (bits.min() == 0) if len(bits) > MANY else (np.count_nonzero(bits) < len(bits)):
        for i in np.flatnonzero(bits == 0).tolist():
            out[i] = exact(i)
