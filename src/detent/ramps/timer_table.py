"""The DCB-274's ramp: a table of speeds, each made by a period counter with a tick of 8 036 ns.

A speed is a whole number of ticks from pulse to pulse: `count` ticks, times the divide factor D. The table
(our reading: the manual only says that it "approximates straight-line acceleration") has the speeds
v(i) = 1095.4 sqrt(i), i = 1, 2, ...; a ramp makes K steps at the initial speed and at each entry faster than it.
"""

from bisect import bisect_left, bisect_right
from functools import lru_cache
from math import isqrt
from typing import TYPE_CHECKING, Final, NamedTuple

from detent.pulses import Table, Train, Uniform
from detent.pulses.laws import AnySegment
from detent.ticks import FIXED_BITS, SECOND, Fixed, Ns

if TYPE_CHECKING:
    from detent.pulses.rows import Rows

TICK: Final[Ns] = 8_036
LEAST_COUNT: Final = 3  # 41 480 steps/s, the "42,000 SPS ceiling" (page 65)
SLOWEST: Final = 40  # steps/s; less is limited to it (page 65)
RUNG_SPEED: Final = 1095.4  # steps/s of the first entry
_SQUARE: Final = 119_990_116  # its square, times 100
_ENTRIES: Final = 1 << 10


def count_of(rate: int) -> int:
    """Ticks from pulse to pulse that the timer makes of `rate` steps/s (at least 1)."""
    return max(SECOND // (TICK * max(rate, SLOWEST)), LEAST_COUNT)


def rate_of(count: int) -> int:
    """The real rate in steps/s of `count` ticks, without its fraction: what X prints (page 52)."""
    return SECOND // (TICK * count)


def _table() -> tuple[int, ...]:
    """The counts of the entries, falling, down to the last above the least count."""
    counts = [isqrt(100 * SECOND * SECOND // (TICK * TICK * _SQUARE * i)) for i in range(1, _ENTRIES)]
    return tuple(count for count in counts if count > LEAST_COUNT)


TABLE: Final = _table()


class Speeds(NamedTuple):
    """What shapes a motion: counts of the initial and slew speed, K up and down, the divide factor D."""

    initial: int
    slew: int
    up: int
    down: int
    divide: int


class Ladder:
    """The rungs of one initial speed and divide factor: the initial speed, then the entries faster than it.

    `periods` are ticks from pulse to pulse, one for each rung, not rising. Immutable.
    """

    __slots__ = ("_falling", "periods")

    def __init__(self, initial: int, divide: int) -> None:
        counts = (initial, *(count for count in TABLE if count < initial))
        self.periods = tuple(count * divide for count in counts)
        self._falling = tuple(-period for period in self.periods)

    def slower(self, period: int) -> int:
        """How many rungs are truly slower than `period` ticks: the first so many."""
        return bisect_left(self._falling, -period)

    def not_faster(self, period: int) -> int:
        """How many rungs are slower than `period` ticks or just that."""
        return bisect_right(self._falling, -period)


@lru_cache(maxsize=256)
def ladder(initial: int, divide: int) -> Ladder:
    """The ladder, made once."""
    return Ladder(initial, divide)


@lru_cache(maxsize=256)
def _rows(initial: int, divide: int, each: int, rising: bool) -> "Rows":
    """The whole ladder as a table with `each` steps (1 or more) on every rung, from slow to fast if `rising`."""
    from detent.pulses.rows import Rows  # brings NumPy

    periods = ladder(initial, divide).periods
    merged: list[list[int]] = []
    for period in periods if rising else reversed(periods):
        if merged and merged[-1][0] == period:
            merged[-1][1] += each
        else:
            merged.append([period, each])
    return Rows([steps for _, steps in merged], [period for period, _ in merged])


def _climb(at: Fixed, speeds: Speeds, low: int, high: int) -> list[AnySegment]:
    """The rungs low .. high - 1 upwards, from the instant `at` on."""
    if not speeds.up or high <= low:
        return []
    rows = _rows(speeds.initial, speeds.divide, speeds.up, True)
    return [_part(at, rows, speeds.up * low, speeds.up * high)]


def _descend(at: Fixed, speeds: Speeds, low: int, high: int) -> list[AnySegment]:
    """The rungs high - 1 .. low downwards, from the instant `at` on."""
    if not speeds.down or high <= low:
        return []
    rows = _rows(speeds.initial, speeds.divide, speeds.down, False)
    rungs = len(ladder(speeds.initial, speeds.divide).periods)
    return [_part(at, rows, speeds.down * (rungs - high), speeds.down * (rungs - low))]


def _part(at: Fixed, rows: "Rows", first: int, last: int) -> Table:
    whole = Table(0, TICK, rows, first, last)
    return whole.moved(at - whole.begin)


def _steady(at: Fixed, period: int, steps: int | None) -> Uniform:
    return Uniform(at, TICK * period, 1, steps)


def _end(at: Fixed, segments: list[AnySegment]) -> Fixed:
    end = segments[-1].end if segments else at
    assert end is not None
    return end


class Move(NamedTuple):
    """A train that starts at 0, and the steps of its ramps: up ends at pulse `up`, down begins at steps - `down`."""

    train: Train
    up: int
    down: int


@lru_cache(maxsize=4096)
def index(speeds: Speeds, steps: int) -> Move:
    """A move of `steps` (1 or more) from rest to rest.

    The peak is the slew speed, or else the highest rung whose own K steps up and K steps down fit, with those of
    the rungs below it; what is left of the steps is made at the peak. Without any K, and with a slew speed no
    higher than the initial one, all steps are made at the slew speed.
    """
    rungs = ladder(speeds.initial, speeds.divide)
    slew = speeds.slew * speeds.divide
    below = rungs.slower(slew)
    both = speeds.up + speeds.down
    peak = min(below, max(steps // both - 1, 0)) if both else below
    up, down = speeds.up * peak, speeds.down * peak
    segments = _climb(0, speeds, 0, peak)
    period = slew if peak == below else rungs.periods[peak]
    segments.append(_steady(_end(0, segments), period, steps - up - down))
    segments += _descend(_end(0, segments), speeds, 0, peak)
    return Move(Train(segments), up, down)


class Change(NamedTuple):
    """What follows a pulse: the segments, the steps of the ramp in them, and whether they go on without end."""

    segments: tuple[AnySegment, ...]
    ramp: int


def change(at: Fixed, speeds: Speeds, now: int | None, then: int | None) -> Change:
    """From the instant `at` of a pulse on: from a period of `now` ticks to one of `then`, which goes on for ever.

    None is rest. The rungs truly between the two speeds take their K steps each; to rest the initial speed
    takes part, from rest as well.
    """
    rungs = ladder(speeds.initial, speeds.divide)
    if then is not None and (now is None or then <= now):
        segments = _climb(at, speeds, 0 if now is None else rungs.not_faster(now), rungs.slower(then))
    else:
        low = 0 if then is None else rungs.not_faster(then)
        segments = _descend(at, speeds, low, len(rungs.periods) if now is None else rungs.slower(now))
    ramp = sum(segment.steps or 0 for segment in segments)
    if then is not None:
        segments.append(_steady(_end(at, segments), then, None))
    return Change(tuple(segments), ramp)


def period_after(train: Train, pulse: int) -> int:
    """Ticks between `pulse` and the next one of a train that this module made."""
    return (train.fixed_time(pulse + 1) - train.fixed_time(pulse)) // (TICK << FIXED_BITS)
