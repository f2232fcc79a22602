"""Queries by the million: a train's segments as columns, one formula for all of constant speed and of ramps.

The time of a pulse, x steps from where its law begins, all in ns:

    base + x * whole + floor(rest + 1/2 + sign * x * gain / (slow + sqrt(slow**2 + gain2 * x)))

A ramp has whole = 0 and gain2 = gain, a constant speed has slow = 1/2 and gain2 = 0, so that `gain` is the
period's fraction. Before the time `tau` since (or, slowing down, until) that instant lie
tau * (square * tau + linear) steps. What comes too close to a boundary is asked of the segment itself.
Tables and ticked segments answer for themselves.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from detent.pulses import table_arrays, ticked_arrays
from detent.pulses.accelerating import Accelerating
from detent.pulses.arrays import split
from detent.pulses.laws import AnySegment
from detent.pulses.segment import GUARD, Int64Array
from detent.pulses.table import Table
from detent.pulses.ticked import Ticked
from detent.pulses.uniform import Uniform
from detent.ticks import FIXED_BITS, HALF_NS, ONE_NS, Fixed, Ns

BLOCK = 1 << 14  # questions at a time
SORT_FROM = 1 << 12  # segments from which it pays to look queries up in order
BY_HAND = 16  # queries of one segment below which its scalar methods are quicker

ENDLESS = (1 << 63) - 1


class Columns:
    """The segments of a shape, one entry each, for a train that starts `rest` after ns 0."""

    def __init__(
        self, segments: Sequence[AnySegment], before: list[int], through: list[int], lasts: list[Fixed], rest: Fixed
    ) -> None:
        self._segments, self._rest = segments, rest
        self._before, self._through = _integers(before), _integers(through)
        self._last_ns = _integers([(last + rest + HALF_NS) >> FIXED_BITS for last in lasts])
        self._steps = _integers([ENDLESS if s.steps is None else s.steps for s in segments])
        self._other = np.array([not isinstance(s, Uniform | Accelerating) for s in segments], bool)
        self._any_other = bool(self._other.any())
        laws = [_law(segment, rest) for segment in segments]
        self._base, self._whole, self._sign, self._x0 = (_integers(c) for c in zip(*(i for i, _ in laws), strict=True))
        self._slow, self._gain, self._gain2, self._lead, self._square, self._linear = np.array(
            [f for _, f in laws]
        ).T.copy()
        self._slow2, self._float_sign = self._slow**2, self._sign.astype(np.float64)
        self._shift = self._x0 - self._sign * self._before
        self._all_rising = bool((self._sign == 1).all())
        self._no_whole = not self._whole.any()

    def times_of(self, n: Int64Array, out: Int64Array, start: Ns) -> None:
        """Write the ns of the pulses `n`, 0..steps in any order, of a train that starts at `start` or just after."""
        for at in _blocks(n, len(self._segments)):
            some = n[at]
            result = self._times(np.searchsorted(self._through, some), some)
            result[some == 0] = self._rest >= HALF_NS
            out[at] = result + start

    def run(self, first: int, out: Int64Array, start: Ns) -> None:
        """Write the ns of the pulses first .. first + len(out) - 1, likewise."""
        for done in range(0, len(out), BLOCK):
            block = out[done : done + BLOCK]
            low, high = first + done, first + done + len(block) - 1
            i, stop = (int(np.searchsorted(self._through, n)) for n in (low, high))
            ends = np.append(self._through[i:stop], high)
            segment = np.repeat(np.arange(i, stop + 1), np.diff(ends, prepend=low - 1))
            np.add(self._times(segment, np.arange(low, high + 1, dtype=np.int64)), start, out=block)

    def _times(self, segment: npt.NDArray[np.intp], n: Int64Array) -> Int64Array:
        x = (n if self._all_rising else n * self._sign[segment]) + self._shift[segment]
        steps = x.astype(np.float64)
        y = np.sqrt(self._slow2[segment] + self._gain2[segment] * steps)
        y += self._slow[segment]
        steps *= self._gain[segment]
        np.divide(steps, y, out=y)
        guard = y + 2.0
        guard *= 2.0 * GUARD
        if not self._all_rising:
            y *= self._float_sign[segment]
        y += self._lead[segment]
        y += guard
        floor = np.floor(y)
        result: Int64Array = floor.astype(np.int64)
        if not self._no_whole:
            x *= self._whole[segment]
            result += x
        result += self._base[segment]
        y -= floor
        guard *= 2.0
        self._settle(y < guard, result, segment, n - self._before[segment], _exact_times, _batch_times)
        return result

    def counts_by(self, t: Int64Array, out: Int64Array) -> None:
        """Write how many pulses come at or before the times `t`, counted from the ns at or before the start."""
        for at in _blocks(t, len(self._segments)):
            out[at] = self._counts(t[at])

    def _counts(self, t: Int64Array) -> Int64Array:
        segment = np.searchsorted(self._last_ns, t, side="right")
        over = segment == len(self._segments)
        any_over = bool(over.any())
        if any_over:
            segment[over] -= 1
        tau = (t - self._base[segment]).astype(np.float64)
        tau += 1.0 - self._lead[segment]  # lead is rest + 1/2
        if not self._all_rising:
            tau *= self._float_sign[segment]
        x = self._square[segment] * tau
        x += self._linear[segment]
        x *= tau
        x[tau < -0.01] = -0.5
        floor = np.floor(x)
        result: Int64Array = floor.astype(np.int64)
        result -= self._x0[segment]
        if not self._all_rising:
            np.subtract(-1, result, out=result, where=self._sign[segment] < 0)
        np.maximum(result, 0, out=result)
        np.minimum(result, self._steps[segment], out=result)
        if any_over:
            result[over] = self._steps[-1]
            x[over] = 0.5
            floor[over] = 0.0
        # the distance to the nearer of the two integers, against a guard that grows with x
        x -= floor
        floor += 1.0
        floor *= 8.0 * GUARD
        close = np.minimum(x, 1.0 - x) < floor
        self._settle(close, result, segment, t, _exact_counts, _batch_counts)
        result += self._before[segment]
        return result

    def _settle(
        self,
        close: npt.NDArray[np.bool_],
        result: Int64Array,
        segment: npt.NDArray[np.intp],
        asked: Int64Array,
        one: "Callable[[AnySegment, list[int], Fixed], list[int]]",
        many: "Callable[[Table | Ticked, Int64Array, Fixed], Int64Array]",
    ) -> None:
        """Have the close ones, and all that the formula does not cover, answered by their segments."""
        if self._any_other:
            other = self._other[segment]
            close &= ~other
            for i, places in _groups(segment, other):
                of = self._segments[i]
                if len(places) < BY_HAND or isinstance(of, Uniform | Accelerating):
                    result[places] = one(of, asked[places].tolist(), self._rest)
                else:
                    result[places] = many(of, asked[places], self._rest)
        for at in np.flatnonzero(close).tolist():
            result[at] = one(self._segments[segment[at]], [int(asked[at])], self._rest)[0]


def _exact_times(segment: AnySegment, n: list[int], rest: Fixed) -> list[int]:
    return [(rest + segment.fixed(k) + HALF_NS) >> FIXED_BITS for k in n]


def _exact_counts(segment: AnySegment, t: list[int], rest: Fixed) -> list[int]:
    return [segment.count_before((k << FIXED_BITS) + HALF_NS - rest) for k in t]


def _batch_times(segment: Table | Ticked, n: Int64Array, rest: Fixed) -> Int64Array:
    if isinstance(segment, Table):
        return table_arrays.times_of(segment, n, rest)
    return ticked_arrays.times_of(segment, n, rest)


def _batch_counts(segment: Table | Ticked, t: Int64Array, rest: Fixed) -> Int64Array:
    if isinstance(segment, Table):
        return table_arrays.counts_by(segment, t, rest)
    return ticked_arrays.counts_by(segment, t, rest)


def _law(of: AnySegment, rest: Fixed) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """(base, whole, sign, x0), (slow, gain, gain2, lead, square, linear); `lead` is rest + 1/2 ns after `base`."""
    if isinstance(of, Uniform):
        base, part = split(of.fixed(0) + rest)
        period, remainder = divmod(of.numerator, of.denominator)
        linear = of.denominator / of.numerator
        return (base, period, 1, 0), (0.5, remainder / of.denominator, 0.0, part / ONE_NS, 0.0, linear)
    if isinstance(of, Accelerating):
        base, part = split(of.anchor + rest)
        gain, slow = of.gain_ns, of.slow_ns
        sign, x0 = (1, of.low) if of.up else (-1, of.high)
        return (base, 0, sign, x0), (slow, gain, gain, part / ONE_NS, 1.0 / gain, 2.0 * slow / gain)
    return (0, 0, 1, 0), (0.5, 0.0, 0.0, 0.0, 0.0, 0.0)


def _blocks(asked: Int64Array, segments: int) -> "Iterator[slice | npt.NDArray[np.intp]]":
    """The places of the questions, as many at a time as stay in the cache; in rough order if there is much to look up.

    Sixteen bits of order keep the search among neighbours, and are sorted ten times quicker than all of them.
    """
    order = None
    if segments >= SORT_FROM and len(asked) > BLOCK:
        low = int(asked.min())
        shift = max((int(asked.max()) - low).bit_length() - 16, 0)
        order = np.argsort(((asked - low) >> shift).astype(np.uint16), kind="stable")
    for done in range(0, len(asked), BLOCK):
        part = slice(done, done + BLOCK)
        yield part if order is None else order[part]


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
