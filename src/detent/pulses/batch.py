"""Queries by the million: a train's segments as columns, one formula for all of constant speed and of ramps.

The time of a pulse, x steps from where its law begins, all in ns:

    base + x * whole + floor(rest + 1/2 + sign * x * gain / (slow + sqrt(slow**2 + gain2 * x)))

A ramp has whole = 0 and gain2 = gain, a constant speed has slow = 1/2 and gain2 = 0, so that `gain` is the
period's fraction. Before the time `tau` since (or, slowing down, until) that instant lie
tau * (square * tau + linear) steps. What comes too close to a boundary is asked of the segment itself.
Tables and ticked segments answer for themselves.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from detent.pulses.accelerating import Accelerating
from detent.pulses.arrays import GUARD, split
from detent.pulses.segment import Int64Array
from detent.pulses.uniform import Uniform
from detent.ticks import FIXED_BITS, HALF_NS, ONE_NS, Fixed, Ns

if TYPE_CHECKING:
    from detent.pulses.shape import AnySegment

SORT_FROM = 1 << 12  # segments from which it pays to look queries up in order
BY_HAND = 16  # queries of one segment below which its scalar methods are quicker

Floats = npt.NDArray[np.float64]


class Columns:
    """The segments of a shape, one entry each, for a train that starts `rest` after ns 0."""

    def __init__(self, segments: Sequence["AnySegment"], before: list[int], through: list[int],
                 lasts: list[Fixed], rest: Fixed) -> None:  # fmt: skip
        self._segments, self._rest = segments, rest
        self._before = _integers(before)
        self._through = _integers(through)
        self._last_ns = _integers([(last + rest + HALF_NS) >> FIXED_BITS for last in lasts])
        self._steps = _integers([-1 if s.steps is None else s.steps for s in segments])
        self._other = np.array([not isinstance(s, Uniform | Accelerating) for s in segments], bool)
        self._any_other = bool(self._other.any())
        whole, self._floats = _laws(segments, rest)
        self._base, self._whole, self._sign, self._x0 = (_integers(column) for column in zip(*whole, strict=True))
        self._all_rising = bool((self._sign == 1).all())
        self._no_whole = not self._whole.any()

    def times_of(self, n: Int64Array) -> Int64Array:
        """The ns of pulses 0..steps in any order, from the ns at or before the start."""
        order = None
        if len(self._through) >= SORT_FROM:
            order = np.argsort(n)
            n = n[order]
        result = self._evaluate(np.searchsorted(self._through, n), n)
        result[n == 0] = self._rest >= HALF_NS
        return _unsorted(result, order)

    def run(self, first: int, count: int) -> Int64Array:
        """The ns of the pulses first .. first + count - 1, from the ns at or before the start."""
        last = first + count - 1
        i, stop = (int(np.searchsorted(self._through, n)) for n in (first, last))
        ends = self._through[i : stop + 1].copy()
        ends[stop - i :] = last
        if len(ends) < stop - i + 1:  # the endless segment
            ends = np.append(ends, last)
        segment = np.repeat(np.arange(i, stop + 1), np.diff(ends, prepend=first - 1))
        return self._evaluate(segment, np.arange(first, last + 1, dtype=np.int64))

    def _evaluate(self, segment: npt.NDArray[np.intp], n: Int64Array) -> Int64Array:
        n = n - self._before[segment]
        x = n if self._all_rising else n * self._sign[segment]
        x = x + self._x0[segment]
        slow, gain, gain2, lead, _, _ = self._floats[:, segment]
        steps = x.astype(np.float64)
        y = np.sqrt(slow * slow + gain2 * steps)
        y += slow
        np.divide(gain * steps, y, out=y)
        guard = GUARD * 2.0 * (y + 2.0)
        if not self._all_rising:
            y *= self._sign[segment]
        y += lead
        y += guard
        floor = np.floor(y)
        result: Int64Array = floor.astype(np.int64)
        if not self._no_whole:
            result += x * self._whole[segment]
        result += self._base[segment]
        close = y - floor < 2.0 * guard
        if self._any_other:
            other = self._other[segment]
            close &= ~other
            for i, places in _groups(segment, other):
                of = self._segments[i]
                if len(places) < BY_HAND or isinstance(of, Uniform | Accelerating):
                    result[places] = [self._exact_time(i, k) for k in n[places].tolist()]
                else:
                    result[places] = of.times_of(n[places], self._rest)
        for at in np.flatnonzero(close).tolist():
            result[at] = self._exact_time(int(segment[at]), int(n[at]))
        return result

    def counts_by(self, t: Int64Array) -> Int64Array:
        """How many pulses come at or before the times `t`, from the ns at or before the start."""
        order = None
        if len(self._through) >= SORT_FROM:
            order = np.argsort(t)
            t = t[order]
        segment = np.searchsorted(self._last_ns, t, side="right")
        over = segment == len(self._segments)
        any_over = bool(over.any())
        if any_over:
            segment[over] -= 1
        _, _, _, lead, square, linear = self._floats[:, segment]
        tau = (t - self._base[segment]).astype(np.float64)
        tau += 1.0 - lead  # lead is rest + 1/2
        if not self._all_rising:
            tau *= self._sign[segment]
        x = tau * (square * tau + linear)
        x[tau < -0.01] = -0.5
        floor = np.floor(x)
        result = floor.astype(np.int64) - self._x0[segment]
        if not self._all_rising:
            falling = self._sign[segment] < 0
            result[falling] = -1 - result[falling]
        close = np.abs(x - np.rint(x)) < 8.0 * GUARD * (np.abs(x) + 1.0)
        np.maximum(result, 0, out=result)
        steps = self._steps[segment]
        np.minimum(result, steps, out=result, where=steps >= 0)
        if self._any_other:
            other = self._other[segment]
            close &= ~other
            for i, places in _groups(segment, other):
                of = self._segments[i]
                if len(places) < BY_HAND or isinstance(of, Uniform | Accelerating):
                    result[places] = [self._exact_count(i, k) for k in t[places].tolist()]
                else:
                    result[places] = of.counts_by(t[places], self._rest)
        if any_over:
            close &= ~over
            result[over] = self._steps[-1]
        for at in np.flatnonzero(close).tolist():
            result[at] = self._exact_count(int(segment[at]), int(t[at]))
        result += self._before[segment]
        return _unsorted(result, order)

    def _exact_time(self, segment: int, n: int) -> Ns:
        return (self._rest + self._segments[segment].fixed(n) + HALF_NS) >> FIXED_BITS

    def _exact_count(self, segment: int, t: Ns) -> int:
        return self._segments[segment].count_before((t << FIXED_BITS) + HALF_NS - self._rest)


def _laws(segments: Sequence["AnySegment"], rest: Fixed) -> tuple[list[tuple[int, int, int, int]], Floats]:
    """(base, whole, sign, x0) and (slow, gain, gain2, lead, square, linear) of each segment."""
    whole: list[tuple[int, int, int, int]] = []
    floats = np.empty((len(segments), 6))
    for i, of in enumerate(segments):
        if isinstance(of, Uniform):
            base, part = split(of.fixed(0) + rest)
            period, remainder = divmod(of.numerator, of.denominator)
            whole.append((base, period, 1, 0))
            floats[i] = (0.5, remainder / of.denominator, 0.0, part / ONE_NS, 0.0, of.denominator / of.numerator)
        elif isinstance(of, Accelerating):
            base, part = split(of.anchor + rest)
            scale = of.divisor * ONE_NS
            gain, slow = of.root_gain / (scale * scale), of.slow_root / scale
            whole.append((base, 0, 1, of.low) if of.up else (base, 0, -1, of.high))
            floats[i] = (max(slow, 1e-300), gain, gain, part / ONE_NS, 1.0 / gain, 2.0 * slow / gain)
        else:
            whole.append((0, 0, 1, 0))
            floats[i] = (0.5, 0.0, 0.0, 0.0, 0.0, 0.0)
    return whole, np.ascontiguousarray(floats.T)


def _integers(values: Sequence[int]) -> Int64Array:
    try:
        return np.array(values, np.int64)
    except OverflowError:
        raise OverflowError("the train reaches beyond int64: ask it pulse by pulse") from None


def _groups(segment: npt.NDArray[np.intp], chosen: npt.NDArray[np.bool_]) -> Iterator[tuple[int, npt.NDArray[np.intp]]]:
    """Each segment among the chosen, with the places where it stands."""
    at = np.flatnonzero(chosen)
    if len(at):
        at = at[np.argsort(segment[at], kind="stable")]
        bounds = np.flatnonzero(np.diff(segment[at])) + 1
        for places in np.split(at, bounds):
            yield int(segment[places[0]]), places


def _unsorted(result: Int64Array, order: npt.NDArray[np.intp] | None) -> Int64Array:
    if order is None:
        return result
    back = np.empty_like(result)
    back[order] = result
    return back
