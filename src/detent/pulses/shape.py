"""What trains that differ only in their start share: segments, running sums, and arrays kept for next time."""

from bisect import bisect_left
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING

from detent.pulses.laws import AnySegment
from detent.pulses.quick import MOST, Quick, quick
from detent.pulses.segment import Int64Array
from detent.pulses.ticked import Ticked
from detent.ticks import FIXED_BITS, ONE_NS, Fixed

if TYPE_CHECKING:
    from detent.pulses.batch import Columns

SMALL = 1 << 13  # pulses of a shape whose times are kept
SHORT = 1 << 10  # pulses a segment, on average, below which columns are quicker than segment after segment


class Shape:
    """The segments of a train and their running sums. ValueError for segments that overlap or follow an endless one."""

    __slots__ = (
        "_asked",
        "_columns",
        "_kept",
        "before",
        "begins",
        "ends",
        "lasts",
        "quick",
        "segments",
        "steps",
        "through",
    )

    def __init__(self, segments: tuple[AnySegment, ...]) -> None:
        self.segments = segments
        self.steps: int | None = 0
        self.before: list[int] = []  # pulses before each segment
        self.begins: list[Fixed] = []
        # of each segment but an endless one:
        self.through: list[int] = []  # pulses up to its end
        self.lasts: list[Fixed] = []  # the instant of the last of these
        self.ends: list[Fixed] = []
        self._asked = False
        self._kept: tuple[Fixed, Int64Array] | None = None
        self._columns: tuple[Fixed, Columns] | None = None
        self.quick: list[Quick | None] | None = None  # of each segment, once `make_quick` was called
        pulses, last, end = 0, 0, 0
        for number, segment in enumerate(segments):
            if self.steps is None:
                raise ValueError(f"segment {number - 1} never ends: only the last segment may be open-ended")
            begin, its_end, steps = segment.begin, segment.end, segment.steps
            if begin < end:
                raise ValueError(f"segment {number} begins {end - begin} units of 2**-60 ns before the end of the "
                                 "one before it (or of the train's start)")  # fmt: skip
            self.before.append(pulses)
            self.begins.append(begin)
            if steps is None or its_end is None:
                self.steps = None
                continue
            if steps:
                last = segment.fixed(steps) if isinstance(segment, Ticked) else its_end
            pulses, end = pulses + steps, its_end
            self.steps = pulses
            self.through.append(pulses)
            self.lasts.append(last)
            self.ends.append(end)

    def make_quick(self) -> "list[Quick | None]":
        """Make and keep the quick formulas of all segments; none of trains that have very many."""
        few = len(self.segments) <= MOST
        self.quick = [
            quick(segment, before) if few else None for segment, before in zip(self.segments, self.before, strict=True)
        ]
        return self.quick

    def columns(self, rest: Fixed) -> "Columns":
        """The segments as columns, for a start `rest` after a whole ns; the last ones asked for are kept."""
        if self._columns is None or self._columns[0] != rest:
            from detent.pulses.batch import Columns

            self._columns = rest, Columns(self.segments, self.before, self.through, self.lasts, rest)
        return self._columns[1]

    def times(self, out: Int64Array, first: int, start: Fixed) -> None:
        """Write the ns of the pulses first .. first + len(out) - 1, which exist and fit int64.

        A small shape keeps all its times: the same ramps come again and again.
        """
        if self.steps is None or self.steps > SMALL:
            self._fill(out, first, start)
            return
        whole, rest = start >> FIXED_BITS, start & (ONE_NS - 1)
        kept = self._kept
        if not self._asked and len(out) == self.steps:
            self._asked = True  # whoever comes a second time will come again
            self._fill(out, first, start)
            return
        import numpy as np

        if kept is None or kept[0] != rest:
            times = np.empty(self.steps, np.int64)
            self._fill(times, 1, rest)
            self._kept = kept = rest, times
        np.add(kept[1][first - 1 : first - 1 + len(out)], whole, out)

    def _fill(self, out: Int64Array, first: int, start: Fixed) -> None:
        filling, short = _arrays()
        if len(out) == self.steps and short.fill(out, self.segments, self.before, start):
            return
        last = first + len(out) - 1
        i, stop = bisect_left(self.through, first), bisect_left(self.through, last)
        if stop - i > 8 and len(out) < SHORT * (stop - i):
            self.columns(start & (ONE_NS - 1)).run(first, out, start >> FIXED_BITS)
            return
        done = 0
        while done < len(out):
            n = first + done
            through = self.through[i] if i < len(self.through) else last
            count = min(last, through) - n + 1
            if count > 0:
                filling.fill(out[done : done + count], self.segments[i], n - self.before[i], start)
                done += count
            i += 1


@cache
def _arrays() -> tuple[ModuleType, ModuleType]:
    """What asks NumPy; loaded when the first array is asked for."""
    from detent.pulses import filling, short

    return filling, short
