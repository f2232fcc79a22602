"""Where a segment is at an instant, by one formula in float64 for constant speeds and for ramps.

tau ns after its anchor (before it: below 0) a segment has given x + tau * (linear + square * tau) steps. Closer than a
margin to a pulse, this is not certain to be on the right side of it.
"""

from typing import TypeAlias

from detent.pulses.accelerating import NS_PER_FIXED, Accelerating
from detent.pulses.laws import AnySegment
from detent.pulses.segment import GUARD
from detent.pulses.uniform import Uniform
from detent.ticks import SECOND, Fixed

MOST = 1 << 12  # segments of a train for which it is kept
LONGEST = 1 << 32  # steps: an endless segment is not asked later than that
WIDEST = 0.25  # margin

# anchor, end, x, linear, square; between which fractions of a step it is certain; pulses before the segment; and
# rate + change * tau is the speed in steps/s
Quick: TypeAlias = tuple[Fixed, Fixed, float, float, float, float, float, int, float, float]


def quick(segment: AnySegment, before: int) -> Quick | None:
    """The numbers of the formula up to an instant `end`; None for a segment that has none, or hardly any certainty."""
    if isinstance(segment, Accelerating):
        gain = segment.gain_ns
        square, linear = 1.0 / gain, 2.0 * segment.slow_ns / gain
        x = float(-segment.low)
        if not segment.up:
            square, x = -square, float(segment.high)
        far = max(abs(segment.begin - segment.anchor), abs(segment.end - segment.anchor)) * NS_PER_FIXED
        fastest, steps, end = linear + 2.0 * far / gain, segment.high, segment.end
    elif isinstance(segment, Uniform):
        linear, square, x = segment.denominator / segment.numerator, 0.0, float(-segment.first)
        steps = segment.first + LONGEST if segment.last is None else segment.last
        fastest, end = linear, segment.fixed(steps - segment.first)
    else:
        return None
    # a pulse that is not half a ns away may be rounded to the other side
    margin = GUARD * (2.0 * steps + 2.0) + fastest
    if margin > WIDEST:
        return None
    return segment.anchor, end, x, linear, square, margin, 1.0 - margin, before, SECOND * linear, 2.0 * SECOND * square
