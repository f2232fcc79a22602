"""The motion of one axis, as recorded: spans of trains, and the pulses in any window of time."""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from detent.cell.recording import Span
from detent.pulses.segment import Int64Array
from detent.ticks import Ns


class Pulses(NamedTuple):
    """Step pulses of one unit: when each begins, its direction (+1, -1), the position behind it."""

    times: Int64Array
    directions: Int64Array
    positions: Int64Array


class AxisMotion:
    """The spans of an axis up to and including `until`. `standing` is where its shaft is while it has never moved."""

    def __init__(self, spans: Sequence[Span], until: Ns, standing: int) -> None:
        self.spans = tuple(_clipped(spans, until))
        self._ends = [span.ends for span in self.spans]
        self._standing = standing

    @property
    def pulse_count(self) -> int:
        """How many step pulses the unit gave."""
        return sum(span.last - span.first + 1 for span in self.spans)

    @property
    def start(self) -> int:
        """The position at 0."""
        if not self.spans:
            return self._standing
        span = self.spans[0]
        return span.shaft + span.direction * (span.first - 1)

    def position(self, t: Ns) -> int:
        """The position at `t`, pulses of that instant included."""
        index = bisect_left(self._ends, t)
        if index < len(self.spans) and self.spans[index].begins <= t:
            span = self.spans[index]
            return span.shaft + span.direction * min(max(span.train.steps_by(t), span.first - 1), span.last)
        if index == 0:
            return self.start
        span = self.spans[index - 1]
        return span.shaft + span.direction * span.last

    def pulses(self, begin: Ns, end: Ns) -> Pulses:
        """The step pulses with begin <= time < end."""
        times, directions, positions = [], [], []
        for span, first, last in self.runs(begin, end):
            times.append(span.train.times(first, last))
            directions.append(np.full(last - first + 1, span.direction, np.int64))
            positions.append(span.shaft + span.direction * np.arange(first, last + 1, dtype=np.int64))
        none = np.empty(0, np.int64)
        return Pulses(*(np.concatenate(parts) if parts else none for parts in (times, directions, positions)))

    def runs(self, begin: Ns, end: Ns) -> Iterator[tuple[Span, int, int]]:
        """The motions that gave pulses with begin <= time < end, and the numbers of the first and last of these."""
        for index in range(bisect_left(self._ends, begin), len(self.spans)):
            span = self.spans[index]
            if span.begins >= end:
                break
            first = max(span.first, span.train.steps_by(begin - 1) + 1)
            last = min(span.last, span.train.steps_by(end - 1))
            if first <= last:
                yield span, first, last


def _clipped(spans: Sequence[Span], until: Ns) -> list[Span]:
    """The spans as far as they lie before `until`, or in it."""
    clipped = []
    for span in spans:
        if span.begins > until:
            break
        if span.ends > until:
            span = span._replace(ends=until, last=min(span.last, span.train.steps_by(until)))
        clipped.append(span)
    return clipped
