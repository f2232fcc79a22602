"""Pulse times many at a time: float64 with a guard, or int64, with the exact law's answer in every case.

Absolute ns never enter float64. A chunk of pulses is measured from one exact instant, its base: whole ns as
an integer, and a rest below 1. Each estimate carries a bound on its error; where it falls closer than that to
a rounding boundary, the pulse is asked of the exact law (`settling`).

Here are constant speeds and ticks; ramps have `ramp_arrays`, short trains as a whole `short`.
"""

from typing import Literal

import numpy as np

from detent.extras import installed, need
from detent.pulses.segment import Int64Array
from detent.pulses.settling import GUARD, scale_for, settle
from detent.ticks import FIXED_BITS, HALF_NS, ONE_NS, Fixed, Ns

CHUNK = 1 << 14  # pulses whose work arrays stay in the cache
DENSE_FROM = 2_000_000  # pulses for which importing numba (a second or so) pays

Path = Literal["auto", "numpy", "numba"]
_path: Path = "auto"


def use(path: Path) -> None:
    """Choose the inner loop: "numpy", "numba" (ImportError if absent), or "auto" (numba for long runs only)."""
    global _path
    if path == "numba":
        need("fast", 'the inner loop "numba" needs')
    _path = path


def goes_to_numba(pulses: int) -> bool:
    """Whether a run of so many pulses goes to the numba loop."""
    if _path == "auto":
        return pulses >= DENSE_FROM and installed("fast")
    return _path == "numba"


def split(instant: Fixed) -> tuple[Ns, Fixed]:
    """(whole ns, rest in 2**-60 ns) of an instant plus half a ns: the floor of the sum with more is its rounding."""
    return (instant + HALF_NS) >> FIXED_BITS, (instant + HALF_NS) & (ONE_NS - 1)


def fill_progression(out: Int64Array, first: int, numerator: int, denominator: int, anchor: Fixed) -> None:
    """Write the ns of anchor + i * numerator / denominator, i = first, first + 1 ...

    With anchor + 1/2 = base + rest, each is base + floor((i * numerator + floor(rest * denominator)) /
    denominator): integers only. The pattern of the remainders comes again every `denominator` pulses.
    """
    base, rest = split(anchor)
    whole, carry = divmod(first * numerator + (rest * denominator >> FIXED_BITS), denominator)
    base += whole
    repeats = -(-CHUNK // 2 // denominator)
    period = repeats * denominator
    worth = len(out) > period if period <= CHUNK else len(out) > 4 * period
    if worth and (period + 1) * numerator < 1 << 62:
        pattern = _floors(period, numerator, denominator, carry)
        whole_periods = len(out) // period
        for k in range(whole_periods):
            np.add(pattern, base + k * repeats * numerator, out=out[k * period : (k + 1) * period])
        rest_of = out[whole_periods * period :]
        np.add(pattern[: len(rest_of)], base + whole_periods * repeats * numerator, out=rest_of)
        return
    done = 0
    while done < len(out):
        count = min(CHUNK, len(out) - done)
        whole, left = divmod(carry + done * numerator, denominator)
        np.add(_floors(count, numerator, denominator, left), base + whole, out=out[done : done + count])
        done += count


def _floors(count: int, numerator: int, denominator: int, carry: int) -> Int64Array:
    """floor((j * numerator + carry) / denominator) for j = 0 .. count - 1; 0 <= carry < denominator."""
    j = np.arange(count, dtype=np.int64)
    if (count + 1) * max(numerator, denominator) < 1 << 62:
        j *= numerator
        j += carry
        return np.floor_divide(j, denominator, out=j)
    whole, part = divmod(numerator, denominator)
    scale = scale_for(count)
    estimate = j.astype(np.float64)
    estimate *= part / denominator
    estimate += carry / denominator + (scale.magic + GUARD * scale.unit)
    floors = np.empty(count, np.int64)
    settle(floors, estimate, scale, 0, lambda i: (i * part + carry) // denominator)
    j *= whole
    return np.add(floors, j, out=floors)


def put_ticks(out: Int64Array, ticks: Int64Array, base_ticks: int, numerator: int, denominator: int,
              anchor: Fixed) -> None:  # fmt: skip
    """Write the ns of anchor + (base_ticks + ticks) * numerator / denominator; `ticks` >= 0."""
    base, rest = split(anchor)
    whole, carry = divmod(base_ticks * numerator + (rest * denominator >> FIXED_BITS), denominator)
    if denominator == 1:
        np.multiply(ticks, numerator, out=out)
    elif numerator * denominator < 1 << 62:
        many, few = np.divmod(ticks, denominator)
        np.add(many * numerator, (few * numerator + carry) // denominator, out=out)
    else:
        out[:] = [(k * numerator + carry) // denominator for k in ticks.tolist()]
    out += base + whole


def ticks_by(t: Int64Array, numerator: int, denominator: int, anchor: Fixed) -> Int64Array:
    """How many ticks k = 1, 2 ... have the ns of anchor + k * numerator / denominator at or before each of `t`.

    Below 0 where t is before the anchor. `t` minus the anchor must fit int64.
    """
    # k * numerator / denominator < t + 1/2 - anchor
    whole, rest = (anchor - HALF_NS) >> FIXED_BITS, (anchor - HALF_NS) & (ONE_NS - 1)
    short = (rest * denominator >> FIXED_BITS) + 1
    elapsed = t - whole
    if denominator == 1:
        whole_ticks: Int64Array = (elapsed - short) // numerator
        return whole_ticks
    if numerator * denominator < 1 << 62:
        many, few = np.divmod(elapsed, numerator)
        result: Int64Array = many * denominator + (few * denominator - short) // numerator
        return result
    return np.array([(e * denominator - short) // numerator for e in elapsed.tolist()], np.int64)
