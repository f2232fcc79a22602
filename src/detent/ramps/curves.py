"""Curves V(t) from which tables of differences are compiled: speeds in half steps/s over seconds."""

import math
from collections.abc import Sequence
from itertools import pairwise

from detent.ramps.differences import Curve, CurveError

PAPER_SINE = (15_000.0, 4.54426, 0.2097)  # peak, angular speed, phase
PAPER_DURATION = 0.3
PAPER_LOW, PAPER_HIGH = 650.0, 15_000.0


def sine_squared(peak: float, angular: float, phase: float) -> Curve:
    """V = peak sin^2(angular t + phase), the paper's law (equation 3).

    The paper prints a peak of 14 000, which gives neither of its own end points; 15 000 gives both: 650 at 0 s and
    15 000 at 0.3 s.
    """
    return lambda t: peak * math.sin(angular * t + phase) ** 2


def linear(low: float, high: float, duration: float) -> Curve:
    """From `low` to `high` at constant acceleration."""
    return lambda t: low + (high - low) * t / duration


def through(points: Sequence[tuple[float, float]]) -> Curve:
    """Straight lines through the points (t, V), which rise in t; V is constant outside. Raises CurveError."""
    if len(points) < 2:
        raise CurveError("a curve needs two points t,V at least")
    for (t, _), (later, _) in pairwise(points):
        if not later > t:
            raise CurveError(f"the points must rise in t: {later:g} s comes behind {t:g} s")

    def curve(t: float) -> float:
        for (t0, v0), (t1, v1) in pairwise(points):
            if t <= t1:
                return v0 + (v1 - v0) * max(t - t0, 0.0) / (t1 - t0)
        return points[-1][1]

    return curve
