"""Pulse trains: a run of segments from an instant on, and what can be asked of it."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from typing import Any

from detent.pulses.accelerating import NS_PER_FIXED
from detent.pulses.laws import AnySegment
from detent.pulses.segment import Immutable, Int64Array, State
from detent.pulses.shape import Shape
from detent.ticks import FIXED_BITS, HALF_NS, ONE_NS, Fixed, Ns, to_fixed

INT64 = range(-(1 << 63), 1 << 63)
EASY: Fixed = to_fixed(1 << 62)  # starts and ends below this stay within int64 together
BELOW_ONE = 1.0 - 2.0**-53


class Train(Immutable):
    """An immutable run of segments from an instant on. Copies are the train itself.

    Pulses are numbered 1..steps; step 0 is the start, where no pulse falls. Segments follow each other in
    time (gaps are allowed) and are relative to the start; only the last may be open-ended. Trains are equal
    when start and segments are. ValueError for segments that overlap.

    Scalar queries take integers of any size; array queries raise OverflowError beyond int64 ns (292 years).
    """

    __slots__ = ("_shape", "start")

    _shape: Shape
    start: Fixed

    def __init__(self, segments: Iterable[AnySegment], start: Fixed = 0) -> None:
        object.__setattr__(self, "_shape", Shape(tuple(segments)))
        object.__setattr__(self, "start", start)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a train is immutable: make another with at(), shifted(), head(), tail(), not {name} =")

    def __delattr__(self, name: str) -> None:
        raise AttributeError("a train is immutable")

    def __reduce__(self) -> tuple[Any, ...]:
        return Train, (self._shape.segments, self.start)

    def __repr__(self) -> str:
        return f"Train(segments={self._shape.segments!r}, start={self.start})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Train):
            return NotImplemented
        if self.start != other.start:
            return False
        return self._shape is other._shape or self._shape.segments == other._shape.segments

    def __hash__(self) -> int:
        return hash((self.start, self._shape.steps, len(self._shape.segments)))

    @property
    def segments(self) -> tuple[AnySegment, ...]:
        """The segments, relative to 0."""
        return self._shape.segments

    @property
    def steps(self) -> int | None:
        """How many pulses; None when it never ends."""
        return self._shape.steps

    @property
    def duration(self) -> Ns | None:
        """The rounded time of the last pulse less the rounded start; None when it never ends."""
        steps = self._shape.steps
        return None if steps is None else self.time_of(steps) - self.time_of(0)

    def at(self, start: Fixed) -> "Train":
        """The same train from another instant on. It shares everything, and costs next to nothing."""
        train: Train = _new(Train)
        _set(train, "_shape", self._shape)
        _set(train, "start", start)
        return train

    def shifted(self, by: Fixed) -> "Train":
        """The same train, `by` later."""
        return self.at(self.start + by)

    def fixed_time(self, n: int) -> Fixed:
        """The instant of pulse n (0: the start), floor. IndexError outside 0..steps."""
        shape, n = self._shape, int(n)
        if n <= 0:
            if n < 0:
                raise self._no_pulse(n)
            return self.start
        i = bisect_left(shape.through, n)
        if i == len(shape.segments):
            raise self._no_pulse(n)
        return self.start + shape.segments[i].fixed(n - shape.before[i])

    def time_of(self, n: int) -> Ns:
        """The ns of pulse n (0: of the start), rounded half up. IndexError outside 0..steps."""
        shape = self._shape
        if n <= 0:
            if n < 0:
                raise self._no_pulse(n)
            return (self.start + HALF_NS) >> FIXED_BITS
        i = bisect_left(shape.through, n)
        if i == len(shape.segments):
            raise self._no_pulse(n)
        return shape.segments[i].ns(n - shape.before[i], self.start)

    def steps_by(self, t: Ns) -> int:
        """How many pulses have their ns at or before `t`: 0 .. steps."""
        t = int(t)  # an element of an array would overflow
        # rounded half up, an instant is at or before t when it is before t + 1/2
        limit = (t << FIXED_BITS) + HALF_NS - self.start
        shape = self._shape
        i = bisect_left(shape.lasts, limit)
        if i == len(shape.segments):
            return shape.through[-1] if shape.through else 0
        return shape.before[i] + shape.segments[i].count_before(limit)

    def state_at(self, t: Ns) -> State:
        """Steps, phase and rate at `t`."""
        shape, instant = self._shape, (int(t) << FIXED_BITS) - self.start
        i = bisect_right(shape.begins, instant) - 1
        if i < 0:
            return State(self.steps_by(t), 0.0, 0.0)
        quick = (shape.quick or shape.make_quick())[i]
        if quick is not None:
            anchor, end, x, linear, square, low, high, before, rate, change = quick
            tau = (instant - anchor) * NS_PER_FIXED
            done = x + tau * (linear + square * tau)
            whole = int(done)
            phase = done - whole
            if low < phase < high and instant < end:
                return _state(State, (before + whole, phase, rate + change * tau))
        steps = self.steps_by(t)
        if i < len(shape.ends) and instant >= shape.ends[i]:
            return State(steps, 0.0, 0.0)  # in a gap, or after the end
        done, rate = shape.segments[i].progress(instant)
        # a pulse that rounding moved past t, or before it, belongs to `steps` and not to the phase
        phase = min(max(done - (steps - shape.before[i]), 0.0), BELOW_ONE)
        return State(steps, phase, rate)

    def head(self, n: int) -> "Train":
        """The first n steps. IndexError outside 0..steps."""
        shape = self._shape
        if n <= 0:
            if n < 0:
                raise self._no_pulse(n)
            return Train((), self.start)
        if n == shape.steps and shape.segments[-1].steps:
            return self
        i = bisect_left(shape.through, n)
        if i == len(shape.segments):
            raise self._no_pulse(n)
        return Train((*shape.segments[:i], shape.segments[i].part(0, n - shape.before[i])), self.start)

    def tail(self, n: int) -> "Train":
        """What follows the first n steps: a train from fixed_time(n) on, its pulses at exactly the times they had.

        IndexError outside 0..steps.
        """
        if n == 0:
            return self
        start = self.fixed_time(n)
        shape, back = self._shape, self.start - start
        i = bisect_left(shape.through, n)
        rest = shape.segments[i]
        rest = rest.part(n - shape.before[i], None)
        moved = [segment.moved(back) for segment in (rest, *shape.segments[i + 1 :])]
        if rest.steps == 0 and rest.begin == rest.end:
            del moved[0]
        return Train(moved, start)

    def times(self, first: int = 1, last: int | None = None, out: "Int64Array | None" = None) -> Int64Array:
        """The ns of the pulses first .. last (None: the last one) as int64, in `out` if given, else a new array.

        `out` is an int64 array of just that length. IndexError outside 1..steps, ValueError for an open-ended
        train without `last` and for a wrong `out`, OverflowError beyond int64.
        """
        import numpy as np

        last = self._last(last)
        if first < 1:
            raise self._no_pulse(first)
        count = max(last - first + 1, 0)
        if out is None:
            out = np.empty(count, np.int64)
        elif out.shape != (count,) or out.dtype != np.int64:
            raise ValueError(f"out is for {count} pulses: an int64 array of shape ({count},), "
                             f"not {out.dtype} of shape {out.shape}")  # fmt: skip
        if count:
            self._check_int64(first, last)
            self._shape.times(out, first, self.start)
        return out

    def chunks(self, size: int = 1 << 16, first: int = 1, last: int | None = None) -> Iterator[Int64Array]:
        """The same as `times`, `size` pulses at a time. Each array is valid until the next is asked for."""
        import numpy as np

        if size < 1:
            raise ValueError(f"a chunk has at least one pulse, not {size}")
        last = self._last(last)
        buffer = np.empty(min(size, max(last - first + 1, 0)), np.int64)
        while first <= last:
            count = min(size, last - first + 1)
            yield self.times(first, first + count - 1, buffer[:count])
            first += count

    def times_of(self, n: Int64Array) -> Int64Array:
        """`time_of` for an integer array of any shape. IndexError outside 0..steps."""
        import numpy as np

        n = np.asarray(n)
        if n.dtype.kind not in "iu":
            raise TypeError(f"pulses have whole numbers, not {n.dtype}")
        result = np.empty(n.shape, np.int64)
        if n.size and not self._shape.segments:
            self.time_of(int(n.max()))
            result[...] = self.time_of(int(n.min()))
        elif n.size:
            for end in (int(n.min()), int(n.max())):
                self.time_of(end)
                self._check_int64(end, end)
            whole, rest = self.start >> FIXED_BITS, self.start & (ONE_NS - 1)
            self._shape.columns(rest).times_of(n.ravel().astype(np.int64, copy=False), result.ravel(), whole)
        return result

    def counts_by(self, t: Int64Array) -> Int64Array:
        """`steps_by` for an integer array of any shape."""
        import numpy as np

        t = np.asarray(t)
        if t.dtype.kind not in "iu":
            raise TypeError(f"times are whole ns, not {t.dtype}")
        if t.dtype == np.uint64:
            t = np.minimum(t, np.uint64(INT64[-1]))
        result = np.zeros(t.shape, np.int64)
        if t.size and self._shape.segments:
            whole, rest = self.start >> FIXED_BITS, self.start & (ONE_NS - 1)
            # nothing happens before the start, nor after the end; between them differences fit int64
            steps, ends = self._shape.steps, self._shape.ends
            highest = int(t.max()) if steps is None else whole + (ends[-1] >> FIXED_BITS) + 2
            if whole - 1 not in INT64 or highest - whole not in INT64:
                raise OverflowError(f"a train that starts at {whole} ns has no int64 counts: use steps_by")
            relative = np.clip(t.ravel().astype(np.int64, copy=False), whole - 1, min(highest, INT64[-1]))
            relative -= whole
            self._shape.columns(rest).counts_by(relative, result.ravel())
        return result

    def _last(self, last: int | None) -> int:
        steps = self._shape.steps
        if last is None:
            if steps is None:
                raise ValueError("the train is open-ended: say up to which pulse")
            return steps
        if steps is not None and last > steps:
            raise self._no_pulse(last)
        return last

    def _check_int64(self, first: int, last: int) -> None:
        ends = self._shape.ends
        if -EASY < self.start < EASY and self._shape.steps is not None and ends[-1] < EASY:
            return
        for n in (first, last):
            t = self.time_of(n)
            if t not in INT64 or self.start >> FIXED_BITS not in INT64:
                raise OverflowError(f"pulse {n} comes at {t} ns, which int64 cannot hold: use time_of")

    def _no_pulse(self, n: int) -> IndexError:
        steps = self._shape.steps
        return IndexError(f"there is no pulse {n}: the train has {'endless' if steps is None else steps} steps")


_new = object.__new__
_state = tuple.__new__  # a named tuple's own takes as long as all the rest
_set = object.__setattr__
