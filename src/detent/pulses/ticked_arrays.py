"""The pulses of a ticked segment many at a time."""

from fractions import Fraction

import numpy as np

from detent.pulses import arrays
from detent.pulses.segment import Int64Array
from detent.pulses.ticked import Ticked
from detent.ticks import SECOND, Fixed


def fill(law: Ticked, out: Int64Array, first: int, start: Fixed) -> None:
    """Write the ns of the pulses first .. first + len(out) - 1."""
    done, i = 0, law.first + first
    while done < len(out):
        block = min(len(out) - done, arrays.CHUNK)
        out[done : done + block] = _times(law, np.arange(i, i + block, dtype=np.int64), start)
        done, i = done + block, i + block


def times_of(law: Ticked, n: Int64Array, start: Fixed) -> Int64Array:
    """The ns of the pulses `n` (1..steps each, any order)."""
    return _times(law, n + law.first, start)


def _times(law: Ticked, i: Int64Array, start: Fixed) -> Int64Array:
    """The ns of the pulses `i` of the whole law."""
    out = np.empty(len(i), np.int64)
    arrays.put_ticks(out, _ticks_of(law, i), 0, law.tick.numerator, law.tick.denominator, start + law.anchor)
    return out


def _ticks_of(law: Ticked, i: Int64Array) -> Int64Array:
    """`tick_of` for many: a float64 guess, proved in integers and stepped or looked up where it is wrong."""
    if not _fits(law):
        return np.fromiter((law.tick_of(n) for n in i.tolist()), np.int64, len(i))
    wanted = i * float(law.unit) - law.phase
    slope = float(2 * law.speed + law.change)
    root = np.sqrt(np.maximum(slope * slope + (8.0 * law.change) * wanted, 0.0))
    k: Int64Array = np.ceil(4.0 * wanted / (slope + root)).astype(np.int64)
    over = _excess(law, k, i)  # 0 <= over < speed on tick k, for the right k
    k += over < 0
    k -= over >= law.speed + law.change * k
    over = _excess(law, k, i)
    for at in np.flatnonzero((over < 0) | (over >= law.speed + law.change * k)):
        k[at] = law.tick_of(int(i[at]))
    return k


def counts_by(law: Ticked, t: Int64Array, start: Fixed) -> Int64Array:
    """How many pulses have their ns at or before each of `t` (any order)."""
    k = arrays.ticks_by(t, law.tick.numerator, law.tick.denominator, start + law.anchor)
    np.clip(k, 0, law.ticks, out=k)
    if _fits(law):
        x = k.astype(np.float64)
        i = ((law.phase + x * law.speed + (0.5 * law.change) * x * (x + 1.0)) / law.unit).astype(np.int64)
        i += _excess(law, k, i) // law.unit
    else:
        i = np.fromiter((law.position(n) // law.unit for n in k.tolist()), np.int64, len(k))
    last = law.total if law.last is None else law.last
    result: Int64Array = np.clip(i, law.first, last) - law.first
    return result


def rates_by(law: Ticked, t: Int64Array, start: Fixed) -> Int64Array:
    """The whole steps/s after the last tick that has its ns at or before each of `t` (any order)."""
    k = arrays.ticks_by(t, law.tick.numerator, law.tick.denominator, start + law.anchor)
    np.clip(k, 0, law.ticks, out=k)
    scale = Fraction(SECOND, law.unit) / law.tick
    speeds = law.speed + law.change * k
    if law.unit * scale.numerator < 1 << 62:
        rates: Int64Array = speeds * scale.numerator // scale.denominator
        return rates
    return np.array([speed * scale.numerator // scale.denominator for speed in speeds.tolist()], np.int64)


def _fits(law: Ticked) -> bool:
    """Whether `_excess` is exact: guesses are good to 2**-22 of the ticks, and differences stay small."""
    return law.unit * ((law.ticks >> 22) + 4) < 1 << 61


def _excess(law: Ticked, k: Int64Array, i: Int64Array) -> Int64Array:
    """The accumulator after k ticks less i units, modulo 2**64: right when it is small, as it is near i."""
    triangle = ((k + 1) >> 1) * (k | 1)  # k (k + 1) / 2
    excess: Int64Array = k * law.speed + law.phase + triangle * law.change - i * law.unit
    return excess
