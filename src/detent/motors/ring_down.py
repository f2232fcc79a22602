"""Damping from a ring-down: a single full step of the real motor, and how far it overshoots, or its whole record.

The EMF and the friction damp in the model as they do in the motor; what is looked for is what they leave: the ratio
with which the model's step overshoots as the measured one did.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from detent.motors import columns
from detent.motors import damping as damping_
from detent.motors.damping import Damping, given
from detent.motors.fit import best_of
from detent.motors.motor import MotorError
from detent.motors.move import simulate
from detent.motors.own import MOST_POINTS
from detent.motors.rotor import FINE, Rig
from detent.motors.winding import FULL
from detent.ticks import MS, US, Ns

Floats = npt.NDArray[np.float64]

BAND = 0.05  # of the step: settled is what stays within
LONGEST: Ns = 1000 * MS
PRECISION = 0.002
MOST_RATIO = damping_.MOST_RATIO


class RingDown(NamedTuple):
    """The damping found, and what the model makes of the step with it."""

    damping: Damping
    overshoot: float  # part of the step
    settling: float  # s until it stays within 5 %
    frequency: float  # Hz of its swing; 0 if it makes none
    rms: float | None  # of a record, part of the step; None where there was none
    words: str  # what does not agree, if something does not


class Step(NamedTuple):
    """A single full step of the model: s since the pulse, and the place as a part of the step."""

    times: Floats
    places: Floats

    @property
    def overshoot(self) -> float:
        """Part of the step."""
        return max(float(self.places.max()) - 1.0, 0.0)

    @property
    def settling(self) -> float:
        """S, until it stays within the band."""
        outside = np.flatnonzero(np.abs(self.places - 1.0) > BAND)
        return float(self.times[outside[-1]]) if len(outside) else 0.0

    @property
    def frequency(self) -> float:
        """Hz of its swing; 0 if it makes none."""
        off = self.places - 1.0
        noise = float(off[-max(len(off) // 10, 1) :].std())
        swings = np.flatnonzero(np.abs(off) > max(BAND, 4 * noise))  # what is smaller is none
        above = off[swings] > 0
        up = swings[1:][above[1:] & ~above[:-1]]
        return float((len(up) - 1) / (self.times[up[-1]] - self.times[up[0]])) if len(up) > 1 else 0.0

    @property
    def half(self) -> float:
        """S, until it has first made half of the step."""
        return float(self.times[int(np.argmax(self.places >= 0.5))])


def step(rig: Rig, ratio: float, lasts: float = 0.2) -> Step:
    """The rig's single full step, two phases on, with that damping ratio."""
    drive = replace(rig.drive, winding=FULL, interpolation=False)
    one = Rig(rig.motor, drive, rig.load, FINE, damping=given(ratio))
    run = simulate(np.array([MS]), one, settle=min(round(lasts * 1e9), LONGEST), sample=50 * US)
    later = run.trace[:, 0] >= MS
    places = run.rotor[later] - run.rotor[0]
    return Step(run.times[later] - 1e-3, places)


def from_overshoot(rig: Rig, overshoot: float, settling: float | None = None) -> RingDown:
    """The damping with which a full step overshoots by `overshoot` (a part of the step: 0.45 is 45 %).

    `settling` (s until it stays within 5 % of the step) is compared with what comes out. MotorError where no damping
    does it.
    """
    if not (isfinite(overshoot) and 0 < overshoot < 1):
        raise MotorError(f"an overshoot of {overshoot!r}: give a part of the step above 0 and below 1, like 0.45")
    if settling is not None and not (isfinite(settling) and 0 < settling < 10):
        raise MotorError(f"a settling time of {settling!r}: give seconds until the rotor stays within 5 % of the step")
    free = step(rig, 0.0).overshoot
    if overshoot > free + 0.01:
        raise MotorError(
            f"{overshoot:.0%} is more than the {free:.0%} by which this motor overshoots with its EMF and the friction "
            "given alone: check drive, friction and inertia"
        )
    low, high = 0.0, 1.5
    if step(rig, high).overshoot > overshoot:
        raise MotorError(f"an overshoot of {overshoot:.1%} needs a damping ratio above {high}: no rotor is damped so")
    while high - low > PRECISION / 4:
        middle = (low + high) / 2
        if step(rig, middle).overshoot > overshoot:
            low = middle
        else:
            high = middle
    ratio = (low + high) / 2
    made = step(rig, ratio)
    words = ""
    if settling is not None and not 0.67 < made.settling / settling < 1.5:
        words = (
            f"with it the step settles in {made.settling * 1e3:.3g} ms, not {settling * 1e3:.3g} ms: overshoot and "
            "settling do not belong to one damping of this inertia and friction"
        )
    source = f"from an overshoot of {overshoot:.0%}"
    return RingDown(given(ratio, source), made.overshoot, made.settling, made.frequency, None, words)


def from_record(rig: Rig, times: Sequence[float], places: Sequence[float]) -> RingDown:
    """The damping whose step comes nearest to a record: s since the pulse, and places in any unit, the step whole.

    The first place is where the rotor stood, the last where it comes to rest. A record that began well before the step
    is taken from there. MotorError for what is no record of a step.
    """
    t, x = np.asarray(times, np.float64), np.asarray(places, np.float64)
    if t.ndim != 1 or t.shape != x.shape or len(t) < 8 or not (np.isfinite(t).all() and np.isfinite(x).all()):
        raise MotorError("a record of a ring-down: at least eight times (s) and places, all of them numbers")
    if (np.diff(t) <= 0).any() or not 0 < t[-1] - t[0] <= 10:
        raise MotorError("a record of a ring-down: times rise, in seconds, at most 10 of them")
    rest = float(x[-max(len(x) // 10, 1) :].mean())
    if abs(rest - x[0]) < 1e-12:
        raise MotorError("a record of a ring-down: the rotor ends where it began; begin with it before the step")
    t, x = t - t[0], (x - x[0]) / (rest - x[0])
    expected = step(rig, 0.1).half
    early = Step(t, x).half - expected
    if early > expected:  # it began before the pulse
        stood = float(x[t < early].mean())
        t, x = t[t >= early] - early, (x[t >= early] - stood) / (1 - stood)
    best = best_of([0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.2], _off(rig, t, x))
    made, measured = step(rig, best, float(t[-1])), Step(t, x)
    rms = _off(rig, t, x)(best)
    words = ""
    if made.frequency and measured.frequency and not 0.9 < made.frequency / measured.frequency < 1.1:
        words = (
            f"the record swings at {measured.frequency:.3g} Hz, the model at {made.frequency:.3g} Hz: the inertia is "
            f"{(made.frequency / measured.frequency) ** 2:.2g} times what was given"
        )
    return RingDown(given(best, "from a recorded ring-down"), made.overshoot, made.settling, made.frequency, rms, words)


def _off(rig: Rig, times: Floats, places: Floats) -> Callable[[float], float]:
    """How far the model's step is from the record: rms of the envelope first, so that a frequency a bit off is none."""
    wanted = _envelope(times, places)

    def off(ratio: float) -> float:
        model = step(rig, ratio, float(times[-1]))
        found = np.interp(times, model.times, _envelope(model.times, model.places))
        return float(np.sqrt(((found - wanted) ** 2).mean()))

    return off


def _envelope(times: Floats, places: Floats) -> Floats:
    """The largest distance from the rest place that is still to come."""
    return np.maximum.accumulate(np.abs(places - 1.0)[::-1])[::-1]


def read(text: str, file: str) -> tuple[list[float], list[float]]:
    """Times and places of a CSV text, seconds first; a first line of words is left out. MotorError names the line."""
    times: list[float] = []
    places: list[float] = []
    for row, (k, line) in enumerate(columns.lines(text)):
        try:
            t, x = columns.numbers(line)
        except ValueError:
            if not row and line.lstrip('"')[:1].isalpha():
                continue
            raise MotorError(f"{file}, line {k}: {line!r}: seconds and the place: {columns.WANTED}") from None
        times.append(t)
        places.append(x)
        if len(times) > MOST_POINTS * 100:
            raise MotorError(f"{file}: more than {MOST_POINTS * 100} points: record less often")
    return times, places
