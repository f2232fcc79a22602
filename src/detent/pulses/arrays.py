"""Pulse times many at a time: float64 with a guard, or int64, with the exact law's answer in every case.

Absolute ns never enter float64. A chunk of pulses is measured from one exact instant, its base: whole ns as
an integer, and a rest below 1. Each estimate carries a bound on its error; where it falls closer than that to
a rounding boundary, the pulse is asked of the exact law.

Two ways to run the inner loop of long ramps give the same integers: NumPy, and numba if it is installed.
"""

from collections.abc import Callable
from importlib import import_module
from math import sqrt
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from detent.extras import installed, need
from detent.pulses.accelerating import Accelerating
from detent.pulses.segment import GUARD, Int64Array
from detent.ticks import FIXED_BITS, HALF_NS, ONE_NS, Fixed, Ns

CHUNK = 1 << 14  # pulses whose work arrays stay in the cache
DENSE_CHUNK = 1 << 17  # pulses a call of the numba loop is worth
DENSE_FROM = 2_000_000  # pulses for which importing numba (a second or so) pays
FEW = 8  # pulses for which the exact law is quicker than arrays

FAR = 2.0**37  # ns from the base at which one in 2000 comes too close: a shorter chunk is quicker
SHORTEST = 256  # pulses of such a chunk, unless they take so long that none is safe
TOO_FAR = 2.0**46
NEAR = 2.0**35  # ns from standstill below which the form without a division is good enough

_MAGIC = 1.5 * 2.0**52  # a float64 of this size has its integer part in its low bits
_MAGIC_BITS = int(np.float64(_MAGIC).view(np.int64))
_ASCENDING = np.arange(1, CHUNK + 1, dtype=np.float64)
_DESCENDING = np.arange(CHUNK - 1, -1, -1, dtype=np.float64)

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


def _dense() -> Any:
    return import_module("detent.pulses.dense")


def split(instant: Fixed) -> tuple[Ns, Fixed]:
    """(whole ns, rest in 2**-60 ns) of an instant plus half a ns: the floor of the sum with more is its rounding."""
    return (instant + HALF_NS) >> FIXED_BITS, (instant + HALF_NS) & (ONE_NS - 1)


def settle(out: Int64Array, estimate: npt.NDArray[np.float64], guard: float, base: Ns,
           exact: Callable[[int], Ns]) -> None:  # fmt: skip
    """Write base + floor(estimate); estimates already have `guard` added, and are used up.

    `estimate - guard` is within `guard` of the truth and below 2**50; `exact(i)` settles the close ones.
    """
    whole = np.floor(estimate)
    np.subtract(estimate, whole, out=estimate)
    whole += _MAGIC
    np.add(whole.view(np.int64), base - _MAGIC_BITS, out=out)
    if estimate.min() < 2.0 * guard:
        for i in np.flatnonzero(estimate < 2.0 * guard).tolist():
            out[i] = exact(i)


def fill_ramp(out: Int64Array, first: int, law: Accelerating, start: Fixed) -> None:
    """Write the ns of the pulses first .. of a ramp in a train that starts at `start`."""
    scale = (law.divisor * ONE_NS) ** 2  # (P x + Q**2) / scale is the square of the ns from standstill
    gain = law.gain_ns
    dense = _dense() if goes_to_numba(len(out)) else None
    done, size = 0, CHUNK if dense is None else DENSE_CHUNK
    while done < len(out):
        count = min(size, len(out) - done)
        n = first + done
        # the slow end of the chunk: before its first pulse (up), or at its last (down)
        low_n = n - 1 if law.up else n + count - 1
        low = law.low + low_n if law.up else law.high - low_n
        square = (law.root_gain * low + law.slow_root**2) / scale
        root = sqrt(square)
        top = sqrt(square + gain * count)
        reach = gain * count / (top + root)
        if (reach > FAR and count > SHORTEST) or (reach > TOO_FAR and count > FEW):
            size = count // 2
            continue
        if count <= FEW:
            for i in range(count):
                out[done + i] = (law.fixed(n + i) + start + HALF_NS) >> FIXED_BITS
            done += count
            continue
        base, rest = split(law.fixed(low_n) + start)
        divide = top > NEAR
        guard = GUARD * ((reach if divide else top) + 2.0)
        lead = rest / ONE_NS + guard
        block = out[done : done + count]

        def exact(i: int, n: int = n) -> Ns:
            return (law.fixed(n + i) + start + HALF_NS) >> FIXED_BITS

        if dense is not None:
            dense.ramp(block, law.up, gain, square, root, divide, lead, guard, base, exact)
        else:
            estimate = _ramp(count, law.up, gain, square, root, divide)
            estimate += lead if divide else (lead - root if law.up else lead + root)
            settle(block, estimate, guard, base, exact)
        done += count


def _ramp(count: int, up: bool, gain: float, square: float, root: float, divide: bool) -> npt.NDArray[np.float64]:
    """The ns of a chunk's pulses from its slow end (`divide`), or from standstill; negative on the way down."""
    steps = _ASCENDING[:count] if up else _DESCENDING[CHUNK - count :]
    work = steps * gain
    if not divide:
        work += square
        np.sqrt(work, out=work)
        return work if up else np.negative(work, out=work)
    below = work + square
    np.sqrt(below, out=below)
    below += root if root > 0.0 else 1e-300  # 0 / 0 at standstill itself
    np.divide(work, below, out=work)
    return work if up else np.negative(work, out=work)


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
    guard = GUARD * (count + 2)
    estimate = j.astype(np.float64)
    estimate *= part / denominator
    estimate += carry / denominator + guard
    floors = np.empty(count, np.int64)
    settle(floors, estimate, guard, 0, lambda i: (i * part + carry) // denominator)
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
