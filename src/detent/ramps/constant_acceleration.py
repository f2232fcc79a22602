"""The GS-C200's ramp: constant acceleration, v**2 = S**2 + (T**2 - S**2) n / R after n steps."""

from fractions import Fraction
from functools import lru_cache
from math import isqrt
from typing import NamedTuple

from detent.pulses import Accelerating, Train, Uniform
from detent.pulses.laws import AnySegment
from detent.ticks import ONE_NS, SECOND, Fixed

ONE_SECOND: Fixed = SECOND * ONE_NS


class Move(NamedTuple):
    """A train that starts at 0, and the steps of its ramps.

    The ramp up ends at pulse `up`; the ramp down begins at pulse steps - `down`. Both are 0 without ramps.
    """

    train: Train
    up: int
    down: int


@lru_cache(maxsize=4096)
def move(start_stop: int, slew: int, ramp: int, steps: int | None) -> Move:
    """A move of `steps` (None: without end) from `start_stop` to `slew` steps/s and back, ramps of `ramp` steps.

    With fewer than 2 * `ramp` steps the ramp is reversed half way; an odd step in the middle has the peak
    speed. A slew no higher than the start-stop speed means no ramp: all at `slew`. The first pulse comes one
    interval after the start, the last one ends the move. Moves that agree on the other arguments give the
    same times as far as they both speed up, or both go on at the slew speed.

    ValueError unless the speeds are positive, the ramp has a step or more, and steps is not negative.
    """
    if start_stop < 1 or slew < 1 or ramp < 1 or (steps is not None and steps < 0):
        raise ValueError("a move has speeds and a ramp of at least 1, and 0 steps or more: "
                         f"not start-stop {start_stop}, slew {slew}, ramp {ramp}, steps {steps}")  # fmt: skip
    if steps == 0:
        return Move(Train(()), 0, 0)
    if slew <= start_stop:
        return Move(Train((Uniform.at_rate(0, slew, steps),)), 0, 0)
    up = ramp if steps is None else min(ramp, steps // 2)
    segments: list[AnySegment] = []
    now: Fixed = 0
    if up:
        rising, falling = _ramps(start_stop, slew, ramp, up)
        segments.append(rising)
        now = rising.end
    if steps is None:
        return Move(Train((*segments, Uniform.at_rate(now, slew, None))), up, 0)
    if steps > 2 * up:
        if up == ramp:
            middle = Uniform.at_rate(now, slew, steps - 2 * up)
        else:
            middle = Uniform.fixed_period(now, _period(start_stop, _gain(start_stop, slew, ramp), up), 1)
        segments.append(middle)
        now = middle.fixed(steps - 2 * up)
    if up:
        segments.append(falling.moved(now))
    return Move(Train(segments), up, up)


@lru_cache(maxsize=256)
def _ramps(start_stop: int, slew: int, ramp: int, up: int) -> tuple[Accelerating, Accelerating]:
    """The first `up` steps of a ramp, from instant 0 on, and the same down, which begins at instant 0.

    The same settings come again with other distances: only the instant of the ramp down differs then.
    """
    gain = _gain(start_stop, slew, ramp)
    return Accelerating(0, start_stop, gain, 0, up), Accelerating.down_from(0, start_stop, gain, up)


def _gain(start_stop: int, slew: int, ramp: int) -> Fraction:
    """What each step of the ramp adds to the square of the speed."""
    return Fraction(slew * slew - start_stop * start_stop, ramp)


def _period(start_stop: int, gain: Fraction, n: int) -> Fixed:
    """The floor of the time between pulses at the speed the ramp has after n steps."""
    # 1e9 / v with v**2 = square / denominator
    square = start_stop * start_stop * gain.denominator + gain.numerator * n
    return isqrt(ONE_SECOND * ONE_SECOND * gain.denominator // square)
