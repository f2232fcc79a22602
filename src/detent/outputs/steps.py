"""Pulse trains as the runs of steps that a board executes, each pulse within an error that is kept.

Pulse k (1 to `steps`) of a run falls at base + k * interval + add * k * (k - 1) / 2 ticks of the board's clock. The
base is the tick of the last pulse of the run before, or, where that is too long ago, a fresh one.

**Windows.** The time t of a pulse is that of `Train.times`, rounded once to a ns. Its window is every tick within
t - error .. t + error; the error is cut down to a quarter of the gap to either neighbour, so that pulses keep their
order whatever they do within their windows; where no tick is inside, the nearest one is the window. "exact" is always
the nearest tick.

**Search.** Greedy: the longest run from the tick of the last pulse on. For one `add` the intervals that suit every
pulse so far are a range, kept point by point until it is empty; whether its lower or its upper end failed tells whether
a larger or a smaller `add` reaches farther. A run that fits is still fit when it is cut short, which is how `Runs.take`
gives only pulses that are certain, and goes on with the rest of the run.
"""

from collections.abc import Iterable, Iterator
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from detent.pulses import Train
from detent.pulses.segment import Int64Array
from detent.ticks import SECOND, Ns

Error: TypeAlias = Ns | Literal["exact"]

MOST_STEPS = 0xFFFF  # of a run
MOST_ADD = 0x7FFF
FAR = 1 << 28  # ticks between two pulses beyond which the second gets a base of its own
NEARER = 1 << 20  # ticks between that base and its pulse
AHEAD = 256  # pulses looked at in one go; more where a run reaches so far
_PRUNE = 12  # a little more than 6 + 4 sqrt 2
_WORTH = 6  # steps of a run from which on it pays to look where it ends
_PAIRS = 6  # pulses that are compared each with each, to know which `add` may suit


class Run(NamedTuple):
    """`steps` pulses from `base` on: the first after `interval` ticks, each further interval longer by `add`."""

    base: int
    interval: int
    steps: int
    add: int

    @property
    def last(self) -> int:
        """The tick of its last pulse."""
        return self.tick(self.steps)

    def tick(self, k: int) -> int:
        """The tick of its pulse k, 1 .. steps."""
        return self.base + k * self.interval + self.add * (k * (k - 1) // 2)

    def split(self, k: int) -> tuple["Run", "Run"]:
        """The first k pulses, 1 <= k < steps, and the others: at the same ticks."""
        rest = Run(self.tick(k), self.interval + k * self.add, self.steps - k, self.add)
        return Run(self.base, self.interval, k, self.add), rest


def ticks(runs: Iterable[Run]) -> Iterator[int]:
    """The tick of every pulse."""
    for run in runs:
        for k in range(1, run.steps + 1):
            yield run.tick(k)


class Scale(NamedTuple):
    """Time to ticks: time t is at `offset` + (t - `zero`) * `numerator` / `denominator` ticks, exactly."""

    numerator: int
    denominator: int = SECOND
    offset: int = 0
    zero: Ns = 0

    def tick(self, t: Ns) -> int:
        """The tick nearest to `t`; a tie goes to the later."""
        return self.offset + (2 * (t - self.zero) * self.numerator + self.denominator) // (2 * self.denominator)

    def time(self, tick: int) -> Ns:
        """The time of `tick`, rounded down to a ns."""
        return self.zero + (tick - self.offset) * self.denominator // self.numerator

    def later(self, ticks: int) -> "Scale":
        """The same, everything so many ticks later."""
        return self._replace(offset=self.offset + ticks)


class Runs:
    """The pulses of a train, or some of them, as runs on a board's clock; taken piece by piece.

    `base` is the tick of the pulse before, the first has to come behind it. No run is longer than `longest`, and no
    more pulses are looked at in one go, if that is given. ValueError where two pulses fall on one tick: the clock is
    too slow for the train.
    """

    __slots__ = ("_add", "_at", "_due", "_due_of", "_error", "_full", "_hi", "_last", "_lo", "_longest", "_made",
                 "_rest", "_scale", "_train", "base", "next")  # fmt: skip

    def __init__(self, train: Train, scale: Scale, error: Error, base: int, first: int = 1,
                 last: int | None = None, *, longest: int | None = None) -> None:  # fmt: skip
        self.base = base
        self.next = first  # the pulse that is taken next
        self._train, self._scale, self._error = train, scale, error
        self._last = train.steps if last is None else last  # None: without an end
        self._longest = MOST_STEPS if longest is None else longest
        self._rest: Run | None = None  # of the run found last
        self._due_of, self._due = 0, 0  # the pulse that was asked for last, and its tick
        self._made = first  # the first pulse that no run has been found for
        self._add = 0  # of the run found last: a good guess for the next
        self._full = first  # the first pulse without a window
        self._at = 0  # index of pulse `_made` in the windows, which are ticks behind `scale.offset`
        self._lo: list[int] = []
        self._hi: list[int] = []

    def take(self, upto: int | None = None) -> list[Run]:
        """The runs of every pulse from `next` up to `upto` (None: the last). Nothing if they were taken already."""
        if upto is None:
            if self._last is None:
                raise ValueError("the train is open-ended: say up to which pulse")
            upto = self._last
        elif self._last is not None:
            upto = min(upto, self._last)
        taken = []
        while self.next <= upto:
            taken.append(self.one(upto))
        return taken

    def one(self, upto: int) -> Run:
        """The next run, which ends at `upto` at the latest; `next` <= `upto`, and there is such a pulse."""
        run = self._rest or self._find()
        wanted = upto - self.next + 1
        if run.steps <= wanted:
            self._rest = None
        else:
            run, self._rest = run.split(wanted)
        self.next += run.steps
        self.base = run.last
        return run

    def due(self) -> int | None:
        """The tick nearest to the time of pulse `next`, which may be off by the error; None if there is none."""
        if self._last is not None and self.next > self._last:
            return None
        if self._due_of != self.next:
            self._due_of, self._due = self.next, self._scale.tick(self._train.time_of(self.next))
        return self._due

    def _find(self) -> Run:
        """The longest run from `base` on, whose pulses begin with `_made` == `next`."""
        wanted = min(AHEAD, self._longest)
        while True:
            self._look_ahead(wanted)
            at, offset = self._at, self._scale.offset
            base = self.base - offset
            lo, hi = self._lo, self._hi
            if lo[at] - base > FAR:
                base = (lo[at] + hi[at]) // 2 - NEARER
            elif lo[at] <= base:
                lo[at] = base + 1
                if hi[at] <= base:
                    raise _too_fast(self._scale)
            stop = min(len(lo), at + self._longest)
            if self._error == "exact":
                steps, interval, add = _exact(lo, at, stop, base)
            else:
                steps, interval, add = _best(lo, hi, at, stop, base, self._add)
            if at + steps < stop or stop - at >= self._longest or self._ends_at(len(lo)):
                break
            wanted = 4 * (stop - at)  # it may go on
        self._add = add
        self._at += steps
        self._made += steps
        return Run(base + offset, interval, steps, add if steps > 1 else 0)

    def _ends_at(self, index: int) -> bool:
        """Whether the windows up to `index` are all there are."""
        return self._last is not None and self._made + index - self._at > self._last

    def _look_ahead(self, wanted: int) -> None:
        """Have the windows of `wanted` pulses from `_made` on, as far as there are so many."""
        have = len(self._lo) - self._at
        if have >= wanted or self._ends_at(len(self._lo)):
            return
        del self._lo[: self._at], self._hi[: self._at]
        self._at = 0
        first = self._full
        last = first + max(wanted - have, min(AHEAD, self._longest)) - 1
        if self._last is not None:
            last = min(last, self._last)
        # a pulse more on either side, for the gaps
        before = max(first - 1, 1)
        after = last + 1 if self._train.steps is None or last < self._train.steps else last
        times = self._train.times(before, after)
        lows, highs = windows(times, self._scale, self._error)
        begin, end = first - before, last - before + 1
        self._lo += lows[begin:end]
        self._hi += highs[begin:end]
        self._full = last + 1


def _too_fast(scale: Scale) -> ValueError:
    rate = scale.numerator * SECOND // scale.denominator
    return ValueError(f"two pulses would fall on one tick: {rate} ticks a second are too few for this train")


def windows(times: Int64Array, scale: Scale, error: Error) -> tuple[list[int], list[int]]:
    """The first and last tick (behind `scale.offset`) of the window of each pulse, whose `times` rise.

    Where a neighbour is not in `times` its gap is not looked at. ValueError where two windows meet.
    """
    numerator, behind = scale.numerator, times - scale.zero
    if scale.denominator != SECOND or numerator >= 1 << 32:
        return _windows_of_any(behind.tolist(), scale, error)
    whole, rest = np.divmod(behind, SECOND)
    nearest = whole * numerator + (rest * (2 * numerator) + SECOND) // (2 * SECOND)  # a half goes up
    if (nearest[1:] <= nearest[:-1]).any():
        raise _too_fast(scale)
    if error == "exact":
        same: list[int] = nearest.tolist()
        return same, same.copy()
    allowed = np.full(len(times), error, np.int64)
    gaps = (times[1:] - times[:-1]) // 4
    np.minimum(allowed[1:], gaps, out=allowed[1:])
    np.minimum(allowed[:-1], gaps, out=allowed[:-1])
    whole, rest = np.divmod(behind - allowed, SECOND)
    low = whole * numerator - (-rest * numerator) // SECOND
    whole, rest = np.divmod(behind + allowed, SECOND)
    high = whole * numerator + rest * numerator // SECOND
    empty = low > high
    low[empty] = high[empty] = nearest[empty]
    return low.tolist(), high.tolist()


def _windows_of_any(times: list[int], scale: Scale, error: Error) -> tuple[list[int], list[int]]:
    """The same in integers of any size."""
    up, down = scale.numerator, scale.denominator
    low: list[int] = []
    high: list[int] = []
    for i, t in enumerate(times):
        nearest = (2 * t * up + down) // (2 * down)
        allowed = 0 if error == "exact" else error
        if i:
            allowed = min(allowed, (times[i] - times[i - 1]) // 4)
        if i + 1 < len(times):
            allowed = min(allowed, (times[i + 1] - times[i]) // 4)
        first, last = -(-(t - allowed) * up // down), (t + allowed) * up // down
        if error == "exact" or first > last:
            first = last = nearest
        if high and first <= high[-1]:
            raise _too_fast(scale)
        low.append(first)
        high.append(last)
    return low, high


class _Found(NamedTuple):
    """A run through windows, from some base on."""

    steps: int
    interval: int
    add: int

    def tick(self, k: int) -> int:
        """Its pulse k behind the base."""
        return k * self.interval + self.add * (k * (k - 1) // 2)


def _best(lo: list[int], hi: list[int], at: int, stop: int, base: int, guess: int) -> _Found:
    """The run to take through the windows from index `at` to before `stop`.

    The longest one ends at an edge of its window more often than not, and the next one, which begins there, may be
    shorter for it than this one gained. So it is also tried to end a little earlier (a cubic crosses the middle of the
    windows some 7 % before it leaves them), and this run and the next together decide.
    """
    reach = _longest(lo, hi, at, stop, base, guess)
    steps = reach.steps
    if steps < _WORTH:
        _, low, high, add = reach
        end = at + steps - 1
        interval = ((lo[end] + hi[end]) // 2 - base - add * (steps * (steps - 1) // 2)) // steps
        return _Found(steps, low if interval < low else high if interval > high else interval, add)
    longest = _centred(lo, hi, at, base, reach)
    if at + steps >= stop:
        return longest
    best, most = longest, 0
    for less in dict.fromkeys((0, max(1, steps // 20), max(1, steps // 10), steps // 6)):
        found = _centred(lo, hi, at, base, reach._replace(steps=steps - less)) if less else longest
        end = found.steps
        both = end + _longest(lo, hi, at + end, stop, base + found.tick(end), found.add).steps
        if both > most:
            best, most = found, both
    return best


def _centred(lo: list[int], hi: list[int], at: int, base: int, found: "_Reach") -> _Found:
    """Of the runs as long as `found`, with its `add` or a neighbour, the one that ends nearest to mid-window."""
    steps = found.steps
    end = at + steps - 1
    middle = (lo[end] + hi[end]) // 2 - base
    candidates = [(found.add, found.low, found.high)]
    for add in (found.add - 1, found.add + 1) if steps >= _WORTH else ():
        held = _hold(lo, hi, at, end, base, add)
        if held is not None:
            candidates.append((add, *held))
    best, nearest = _Found(1, 0, 0), 1 << 62
    for add, low, high in candidates:
        rise = add * (steps * (steps - 1) // 2)
        interval = min(max((middle - rise) // steps, low), high)
        off = abs(steps * interval + rise - middle)
        if off < nearest:
            best, nearest = _Found(steps, interval, add), off
    return best


def _hold(lo: list[int], hi: list[int], at: int, end: int, base: int, add: int) -> tuple[int, int] | None:
    """The least and the greatest interval with which `add` suits the windows `at` .. `end`; None if there is none."""
    low, high, rise, j = lo[at] - base, hi[at] - base, 0, 1
    for k in range(at + 1, end + 1):
        rise += add * j
        j += 1
        need, room = lo[k] - base - rise, hi[k] - base - rise
        if j * low < need:
            low = -(-need // j)
        if j * high > room:
            high = room // j
        if low > high:
            return None
    return low, high


def _two(low1: int, high1: int, low2: int, high2: int, least: int, most: int) -> "_Reach":
    """A run of two pulses, if there is one; no third one suits."""
    add = min(max((low2 + high2) // 2 - (low1 + high1), least), most)  # both in the middle
    low, high = max(low1, -((add - low2) // 2)), min(high1, (high2 - add) // 2)
    return _Reach(2, low, high, add) if low <= high and least <= most else _Reach(1, low1, high1, 0)


def _exact(lo: list[int], at: int, stop: int, base: int) -> _Found:
    """The longest run through windows of one tick each: the first two pulses leave no choice."""
    interval = lo[at] - base
    if stop - at == 1:
        return _Found(1, interval, 0)
    period = lo[at + 1] - lo[at]
    add = period - interval
    if not -MOST_ADD <= add <= MOST_ADD or period > FAR:
        return _Found(1, interval, 0)
    tick = lo[at + 1]
    for k in range(at + 2, stop):
        period += add
        tick += period
        if tick != lo[k]:
            return _Found(k - at, interval, add)
    return _Found(stop - at, interval, add)


class _Reach(NamedTuple):
    """How far a run reaches with `add`, and the intervals that do."""

    steps: int
    low: int
    high: int
    add: int


def _narrow(lo: list[int], hi: list[int], at: int, stop: int, base: int, least: int, most: int) -> tuple[int, int, int]:
    """What three pulses leave of `add`, narrowed by the next few; and before which pulse every run ends.

    Of pulses i < j, k * interval + add * k * (k - 1) / 2 within their windows is interval + add * (k - 1) / 2 within
    1/k of them: what suits each pair suits all.
    """
    before = [(1, lo[at] - base, hi[at] - base), (2, lo[at + 1] - base, hi[at + 1] - base),
              (3, lo[at + 2] - base, hi[at + 2] - base)]  # fmt: skip
    for j in range(4, min(stop - at, _PAIRS) + 1):
        low, high = lo[at + j - 1] - base, hi[at + j - 1] - base
        if low - before[-1][2] > FAR:
            break
        narrow_least, narrow_most = least, most
        for i, low_i, high_i in before:
            apart = i * j * (j - i)
            need, room = -(2 * (j * high_i - i * low) // apart), 2 * (i * high - j * low_i) // apart
            if need > narrow_least:
                narrow_least = need
            if room < narrow_most:
                narrow_most = room
        if narrow_least > narrow_most:
            return at + j - 1, least, most
        least, most = narrow_least, narrow_most
        before.append((j, low, high))
    return stop, least, most


def _longest(lo: list[int], hi: list[int], at: int, stop: int, base: int, guess: int) -> "_Reach":
    """The longest run through the windows from index `at` to before `stop`."""
    low1, high1 = lo[at] - base, hi[at] - base
    if stop - at == 1:
        return _Reach(1, low1, high1, 0)
    low2, high2 = lo[at + 1] - base, hi[at + 1] - base
    if low2 - high1 > FAR:
        return _Reach(1, low1, high1, 0)
    least, most = low2 - 2 * high1, high2 - 2 * low1
    if stop - at > 2 and lo[at + 2] - hi[at + 1] <= FAR:
        low3, high3 = lo[at + 2] - base, hi[at + 2] - base
        narrow_least = max(least, -((3 * high1 - low3) // 3), -((3 * high2 - 2 * low3) // 3))
        narrow_most = min(most, (high3 - 3 * low1) // 3, (2 * high3 - 3 * low2) // 3)
        if narrow_least > narrow_most:
            return _two(low1, high1, low2, high2, max(least, -MOST_ADD), min(most, MOST_ADD))
        least, most = narrow_least, narrow_most
        stop, least, most = _narrow(lo, hi, at, stop, base, least, most)
    least, most = max(least, -MOST_ADD), min(most, MOST_ADD)
    if least > most:
        return _Reach(1, low1, high1, 0)
    best, best_low, best_high, best_add = 0, low1, high1, 0
    add = min(max(guess, least), most)
    while True:
        # how far this `add` reaches, and which way to go
        low, high = low1, high1
        rise, j, deficit = 0, 1, 0
        for k in range(at + 1, stop):
            rise += add * j
            j += 1
            need = lo[k] - base - rise
            room = hi[k] - base - rise
            if j * low < need:
                need = -(-need // j)
                if need > high:
                    deficit = need - high
                    j -= 1
                    break
                low = need
            if j * high > room:
                room //= j
                if room < low:
                    deficit = room - low
                    j -= 1
                    break
                high = room
        if j > best:
            best, best_low, best_high, best_add = j, low, high, add
            if not deficit:
                break
            # no `add` farther away than this reaches so far
            span = _PRUNE * (hi[at + j - 1] - lo[at + j - 1] + 2) // (j * j) + 1
            least, most = max(least, add - span), min(most, add + span)
        if deficit > 0:
            least = add + 1
        else:
            most = add - 1
        if least > most:
            break
        add += 2 * deficit // j if deficit > 0 else -(-2 * deficit // j)
        if not least <= add <= most:
            add = (least + most) // 2
    # a pulse too far behind the one before gets a base of its own
    if hi[at + best - 1] - lo[at] > FAR:
        for k in range(at + 1, at + best):
            if lo[k] - hi[k - 1] > FAR:
                return _Reach(k - at, low1, high1, 0) if k == at + 1 else _longest(lo, hi, at, k, base, guess)
    return _Reach(best, best_low, best_high, best_add)
