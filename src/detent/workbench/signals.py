"""Traces as functions of time: the least and the most in each of many columns, a value, when a level is crossed.

Column number k of a `width` is from k * width up to, and without, (k + 1) * width; nothing behind `until` counts.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import nan
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from detent.cell.course import SAMPLE
from detent.cell.recording import Span
from detent.pulses import Train
from detent.pulses.laws import AnySegment
from detent.pulses.rates import rates_at
from detent.pulses.segment import Int64Array
from detent.ticks import FIXED_BITS, Ns
from detent.workbench import rotors
from detent.workbench.columns import Rows
from detent.workbench.mirror import Axis, Unit

Floats = npt.NDArray[np.float64]
Columns = tuple[Floats, Floats]

FINE: Final = 8  # pulses of a clock are drawn one by one where a column is shorter than so many of their widths
MOST_EDGES: Final = 100_000  # pulses in one go
GRID: Final = 1 << 14  # places at which a curve is looked at to find where it crosses a level


class Curve(Protocol):
    """A trace."""

    def columns(self, width: Ns, first: int, last: int, until: Ns) -> Columns:
        """Least and most in each of the columns first .. last - 1; NaN where it has no value."""

    def value(self, at: Ns) -> float:
        """Its value at a time, what happens in that instant included; NaN if it has none."""

    def crossings(self, level: float, ways: Sequence[int], begin: Ns, end: Ns, most: int) -> list[Ns]:
        """When it comes to be above `level` (way 1) or below it (-1), begin <= time <= end, at most so many times."""


def _edges(width: Ns, first: int, last: int) -> Int64Array:
    """The beginnings of columns first .. last."""
    return np.arange(first, last + 1, dtype=np.int64) * width


def _of_changes(times: Int64Array, values: Floats, initial: float, edges: Int64Array) -> Columns:
    """Columns of what changes in steps; a NaN counts only where a column has nothing else."""
    index = np.searchsorted(times, edges, side="left")
    all_values = np.concatenate(([initial], values))
    before = all_values[index]  # just before each edge
    low, high = before[:-1].copy(), before[:-1].copy()
    begin, end = index[:-1], index[1:]
    changed = np.flatnonzero(end > begin)
    if len(changed):
        bounds = np.stack((begin[changed], end[changed]), axis=1).ravel()
        some = np.append(values[: end[changed[-1]]], nan)
        # a change at the very beginning of a column: nothing of what was before is in it
        replaced = changed[times[begin[changed]] == edges[:-1][changed]]
        low[replaced] = high[replaced] = nan
        low[changed] = np.fmin(low[changed], np.fmin.reduceat(some, bounds)[::2])
        high[changed] = np.fmax(high[changed], np.fmax.reduceat(some, bounds)[::2])
    return low, high


def _of_points(first: int, last: int, width: Ns, times: Int64Array, values: Floats) -> Columns:
    """Columns of chosen points, in any order."""
    low, high = np.full(last - first, np.inf), np.full(last - first, -np.inf)
    column = times // width - first
    inside = (column >= 0) & (column < last - first)
    np.minimum.at(low, column[inside], values[inside])
    np.maximum.at(high, column[inside], values[inside])
    none = low > high
    low[none] = high[none] = nan
    return low, high


class PinCurve:
    """The level of a pin; a step clock whose pulses are no entries of their own gets them from the trains."""

    def __init__(self, unit: Unit, pin: str) -> None:
        self._unit, self._pin = unit, pin

    def columns(self, width: Ns, first: int, last: int, until: Ns) -> Columns:
        """Least and most in each column."""
        edges = _edges(width, first, last)
        changes = self._unit.levels(self._pin)
        seen = int(np.searchsorted(changes.times, until, side="right"))
        times, values = changes.times[:seen], changes.values[:seen]
        low, high = _of_changes(times, values, changes.initial, edges)
        output = self._unit.view.pulse_output
        if output is None or self._pin not in self._unit.clocks or self._unit.logged:
            return low, high
        active = float(output.active)
        if width >= FINE * output.width:
            given = self._given(np.minimum(edges, until + 1) - 1)
            pulsing = (np.diff(given) > 0) & ~np.isnan(low)
            low[pulsing], high[pulsing] = np.minimum(low[pulsing], active), np.maximum(high[pulsing], active)
            return low, high
        begins = self._pulses(int(edges[0]) - output.width, min(int(edges[-1]), until + 1))
        for k in range(last - first):  # columns of a few hundred ns: there are few pulses
            touched = (begins < edges[k + 1]) & (begins + output.width > edges[k])
            if touched.any() and not np.isnan(low[k]):
                here = begins[touched]
                whole = bool(((here <= edges[k]) & (here + output.width >= edges[k + 1])).any())
                low[k] = active if whole else min(low[k], active)
                high[k] = active if whole else max(high[k], active)
        return low, high

    def value(self, at: Ns) -> float:
        """The level at a time."""
        level = self._unit.levels(self._pin).value_at(at)
        output = self._unit.view.pulse_output
        if output is None or self._pin not in self._unit.clocks or self._unit.logged or level != level:
            return level
        return float(output.active) if len(self._pulses(at - output.width + 1, at + 1)) else level

    def crossings(self, level: float, ways: Sequence[int], begin: Ns, end: Ns, most: int) -> list[Ns]:
        """Its edges."""
        changes = self._unit.levels(self._pin)
        low, high = np.searchsorted(changes.times, (begin, end + 1)).tolist()
        before = np.concatenate(([changes.initial], changes.values))[low:high]
        now, times = changes.values[low:high], changes.times[low:high]
        rises, falls = (before < level) & (now > level), (before > level) & (now < level)
        wanted = (rises if 1 in ways else False) | (falls if -1 in ways else np.zeros(len(now), bool))
        found: list[Ns] = times[wanted][:most].tolist()
        output = self._unit.view.pulse_output
        if output is None or self._pin not in self._unit.clocks or self._unit.logged:
            return found
        begins = self._pulses(begin - output.width, end + 1, most + 1)
        up, down = (begins, begins + output.width) if output.active else (begins + output.width, begins)
        edges = np.concatenate(([up] if 1 in ways else []) + ([down] if -1 in ways else []))
        return sorted({*found, *edges[(edges >= begin) & (edges <= end)].tolist()})[:most]

    def _axis(self) -> Axis:
        return next(iter(self._unit.axes.values()))

    def _mine(self, span: Span) -> bool:
        """Whether this pin carries the pulses of a span."""
        output = self._unit.view.pulse_output
        return output is not None and output.carries(self._pin, span.direction)

    def _given(self, times: Int64Array) -> Int64Array:
        """How many pulses the pin has carried up to each time; only differences count."""
        given = np.zeros(len(times), np.int64)
        for span in self._axis().reaching(int(times[0]), int(times[-1])):
            if self._mine(span):
                low, high = np.searchsorted(times, (span.begins, span.ends)).tolist()
                done = span.train.counts_by(times[low:high])
                given[low:high] += np.clip(done, span.first - 1, span.last) - (span.first - 1)
                given[high:] += span.last - span.first + 1
        return given

    def _pulses(self, begin: Ns, end: Ns, most: int = MOST_EDGES) -> Int64Array:
        """When its pulses begin, begin <= time < end."""
        found = [np.empty(0, np.int64)]
        for span in self._axis().reaching(begin, end):
            first = max(span.first, span.train.steps_by(begin - 1) + 1)
            last = min(span.last, span.train.steps_by(end - 1), first + most - 1)
            if first <= last and self._mine(span):
                found.append(span.train.times(first, last))
        return np.concatenate(found)


class PositionCurve:
    """The place that the pulses have commanded, in steps."""

    def __init__(self, axis: Axis) -> None:
        self._axis = axis

    def columns(self, width: Ns, first: int, last: int, until: Ns) -> Columns:
        """Least and most in each column."""
        edges = _edges(width, first, last)
        at = np.minimum(edges, until + 1) - 1
        places = self._at(at)
        low, high = np.minimum(places[:-1], places[1:]), np.maximum(places[:-1], places[1:])
        # where a span ends it may turn; a pulse at the beginning of a column leaves nothing of what was before in it
        turns = [(span.ends, place) for span in self._axis.reaching(int(edges[0]), int(at[-1]) + 1)
                 for place in (self._end(span),) if edges[0] <= span.ends <= until]  # fmt: skip
        if turns:
            times, values = np.array([t for t, _ in turns], np.int64), np.array([v for _, v in turns], np.float64)
            lower, higher = _of_points(first, last, width, times, values)
            low, high = np.fmin(low, lower), np.fmax(high, higher)
        return low, high

    def value(self, at: Ns) -> float:
        """The place at a time."""
        return float(self._at(np.array([at], np.int64))[0])

    def crossings(self, level: float, ways: Sequence[int], begin: Ns, end: Ns, most: int) -> list[Ns]:
        """The pulses that come to be above, or below, the level."""
        found: list[Ns] = []
        for span in self._axis.reaching(begin, end + 1):
            if span.direction not in ways or len(found) >= most:
                continue
            over = int(np.floor(level)) + 1 if span.direction > 0 else int(np.ceil(level)) - 1
            pulse = (over - span.shaft) * span.direction
            if span.first <= pulse <= span.last and begin <= (at := span.train.time_of(pulse)) <= end:
                found.append(at)
        return found

    def _end(self, span: Span) -> float:
        return float(span.shaft + span.direction * span.last)

    def _at(self, times: Int64Array) -> Floats:
        """The place at times in order, pulses of those instants included."""
        spans = self._axis.reaching(int(times[0]), int(times[-1]))
        begins = [span.begins for span in spans]
        places = np.empty(len(times))
        cuts = [0, *np.searchsorted(times, begins).tolist(), len(times)]
        places[: cuts[1]] = self._axis.before(int(times[0]))[0]
        for span, (low, high) in zip(spans, pairwise(cuts[1:]), strict=True):
            if low < high:
                given = np.clip(span.train.counts_by(times[low:high]), span.first - 1, span.last)
                places[low:high] = span.shaft + span.direction * given
        return places


class CountCurve:
    """Pulses given."""

    def __init__(self, axis: Axis) -> None:
        self._axis = axis

    def columns(self, width: Ns, first: int, last: int, until: Ns) -> Columns:
        """Least and most in each column."""
        edges = _edges(width, first, last)
        given = self._at(np.minimum(edges, until + 1) - 1)
        return given[:-1], given[1:]

    def value(self, at: Ns) -> float:
        """The count at a time."""
        return float(self._at(np.array([at], np.int64))[0])

    def crossings(self, level: float, ways: Sequence[int], begin: Ns, end: Ns, most: int) -> list[Ns]:
        """The pulse that comes to be above the level."""
        count = self._axis.before(begin)[1]
        for span in self._axis.reaching(begin, end) if 1 in ways else ():
            pulse = int(np.floor(level)) + 1 - count + span.first - 1
            if span.first <= pulse <= span.last and begin <= (at := span.train.time_of(pulse)) <= end:
                return [at]
            count += max(span.last - span.first + 1, 0)
        return []

    def _at(self, times: Int64Array) -> Floats:
        given = np.full(len(times), float(self._axis.before(int(times[0]))[1]))
        for span in self._axis.reaching(int(times[0]), int(times[-1])):
            low, high = np.searchsorted(times, (span.begins, span.ends)).tolist()
            done = span.train.counts_by(times[low:high])
            given[low:high] += np.clip(done, span.first - 1, span.last) - (span.first - 1)
            given[high:] += span.last - span.first + 1
        return given


class SpeedCurve:
    """The rate of the pulses in steps/s, with the sign of the direction; 0 at rest."""

    def __init__(self, axis: Axis) -> None:
        self._axis = axis

    def columns(self, width: Ns, first: int, last: int, until: Ns) -> Columns:
        """Least and most in each column: at its beginning, at its end, and where laws meet in between."""
        edges = _edges(width, first, last)
        begin, end = int(edges[0]), min(int(edges[-1]), until + 1)
        rates = self._at(np.minimum(edges, until))
        low, high = np.minimum(rates[:-1], rates[1:]), np.maximum(rates[:-1], rates[1:])
        points: list[tuple[Ns, float]] = []
        for span in self._axis.reaching(begin, end):
            marks = {t for segment in _segments(span, begin, end) for t in _ends_of(segment, span.train)}
            for mark in (*marks, span.begins, span.ends):
                points += [
                    (at, span.direction * float(int(span.train.state_at(at).rate)))  # whole, as `rates_at` has them
                    for at in (mark - 1, mark)
                    if max(begin, span.begins) <= at < min(end, span.ends)
                ]
            if begin <= span.ends < end:
                points.append((span.ends, float(self._at(np.array([span.ends], np.int64))[0])))
        if points:
            times, values = np.array([t for t, _ in points], np.int64), np.array([v for _, v in points], np.float64)
            lower, higher = _of_points(first, last, width, times, values)
            low, high = np.fmin(low, lower), np.fmax(high, higher)
        return low, high

    def value(self, at: Ns) -> float:
        """The rate at a time."""
        for span in reversed(self._axis.reaching(at, at + 1)):
            if span.begins <= at < span.ends:
                return span.direction * float(span.train.state_at(at).rate)
        motion = self._axis.motion
        if motion is not None and motion.at <= at:
            return motion.direction * float(motion.train.state_at(at).rate)
        return 0.0

    def crossings(self, level: float, ways: Sequence[int], begin: Ns, end: Ns, most: int) -> list[Ns]:
        """Where the rate comes to be above, or below, the level: to the nanosecond."""
        return _crossings(self._at, self.value, level, ways, begin, end, most)

    def _at(self, times: Int64Array) -> Floats:
        rates = np.zeros(len(times))
        for span in self._axis.reaching(int(times[0]), int(times[-1]) + 1):
            low, high = np.searchsorted(times, (span.begins, span.ends)).tolist()
            if low < high:
                rates[low:high] = span.direction * rates_at(span.train, times[low:high])
        return rates


class RotorCurve:
    """Something of a rotor, by the rows of its trace; between two rows far apart it was at rest."""

    def __init__(self, rows: Rows, pick: Callable[[Floats], Floats]) -> None:
        self._rows, self._pick = rows, pick

    def columns(self, width: Ns, first: int, last: int, until: Ns) -> Columns:
        """Least and most in each column."""
        edges = _edges(width, first, last)
        rows = self._rows.rows
        low, high = np.searchsorted(rows[:, rotors.TIME], (edges[0], edges[-1])).tolist()
        some = rows[max(low - 1, 0) : high + 1]
        if not len(some):
            return np.full(last - first, nan), np.full(last - first, nan)
        times, values = some[:, rotors.TIME].astype(np.int64), self._pick(some)
        at_edges = self._between(times, values, edges.astype(np.float64))
        lower, higher = _of_points(first, last, width, times, values)
        least, most = np.fmin(at_edges[:-1], at_edges[1:]), np.fmax(at_edges[:-1], at_edges[1:])
        return np.fmin(least, lower), np.fmax(most, higher)

    def value(self, at: Ns) -> float:
        """Its value at a time."""
        rows = self._rows.rows
        index = int(np.searchsorted(rows[:, rotors.TIME], at))
        some = rows[max(index - 1, 0) : index + 1]
        if not len(some):
            return nan
        return float(self._between(some[:, rotors.TIME].astype(np.int64), self._pick(some), np.array([float(at)]))[0])

    def crossings(self, level: float, ways: Sequence[int], begin: Ns, end: Ns, most: int) -> list[Ns]:
        """Where it comes to be above, or below, the level: between two rows along the straight line."""
        rows = self._rows.rows
        low, high = np.searchsorted(rows[:, rotors.TIME], (begin, end)).tolist()
        some = rows[max(low - 1, 0) : high + 1]
        if len(some) < 2:
            return []
        values = self._pick(some) - level
        before, after = values[:-1], values[1:]
        wanted = np.zeros(len(before), bool)
        if 1 in ways:
            wanted |= (before <= 0) & (after > 0)
        if -1 in ways:
            wanted |= (before >= 0) & (after < 0)
        at = np.flatnonzero(wanted)
        t0, t1 = some[at, rotors.TIME], some[at + 1, rotors.TIME]
        t0 = np.maximum(t0, t1 - SAMPLE)  # it was at rest before
        met = np.ceil(t0 + (t1 - t0) * before[at] / (before[at] - after[at])).astype(np.int64)
        found: list[Ns] = met[(met >= begin) & (met <= end)][:most].tolist()
        return found

    def _between(self, times: Int64Array, values: Floats, at: Floats) -> Floats:
        """Values at times in order: straight from row to row, the last value over a gap, NaN before the first row."""
        found = np.interp(at, times, values)
        index = np.searchsorted(times, at, side="right") - 1
        following = np.minimum(index + 1, len(times) - 1)
        gap = (index >= 0) & (times[following] - times[index] > 2 * SAMPLE) & (at < times[following])
        found[gap] = values[index[gap]]
        found[index < 0] = nan
        return found


AXIS: Final[dict[str, Callable[[Axis], Curve]]] = {
    "position": PositionCurve,
    "speed": SpeedCurve,
    "pulses": CountCurve,
}


def _segments(span: Span, begin: Ns, end: Ns) -> list[AnySegment]:
    """The segments of a span's train that reach into a stretch of time; none where there are too many to look at."""
    train = span.train
    found = [
        segment
        for segment in train.segments
        if (train.start + segment.begin) >> FIXED_BITS < end
        and (segment.end is None or (train.start + segment.end) >> FIXED_BITS >= begin)
    ]
    return found if len(found) <= GRID else []


def _ends_of(segment: AnySegment, train: Train) -> list[Ns]:
    """Begin and end of a segment, in whole ns."""
    instants = (segment.begin, segment.end)
    return [-(-(train.start + instant) >> FIXED_BITS) for instant in instants if instant is not None]


def _crossings(
    at: Callable[[Int64Array], Floats], value: Callable[[Ns], float], level: float, ways: Sequence[int],
    begin: Ns, end: Ns, most: int,
) -> list[Ns]:  # fmt: skip
    """Where a curve comes to be above, or below, a level: seen on a grid, then halved down to the nanosecond."""
    step = max((end - begin) // GRID, 1)
    grid = np.arange(begin, end + step, step, dtype=np.int64)
    grid[-1] = min(int(grid[-1]), end)
    values = at(grid)
    found: list[Ns] = []
    for k in np.flatnonzero((values[:-1] > level) != (values[1:] > level)).tolist():
        way = 1 if values[k + 1] > level else -1
        if way not in ways:
            continue
        low, high = int(grid[k]), int(grid[k + 1])
        while high - low > 1:
            middle = (low + high) // 2
            if (value(middle) > level) == (way > 0):
                high = middle
            else:
                low = middle
        found.append(high)
        if len(found) == most:
            break
    return found
