"""Tables for a SUPERSIGMA drive from the torque of a motor: as steep at each speed as a part of the torque makes.

A ramp that uses all of the torque up to its end is left abruptly; so the speed is averaged over a few milliseconds,
which rounds both corners (a ramp that is steep at its end swings where it turns into constant speed).
"""

from collections import OrderedDict
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from detent.controllers import catalogue
from detent.controllers.supersigma import commands as supersigma
from detent.controllers.supersigma.program import OFFSET, Program
from detent.motors.rotor import Floats
from detent.moves.law import Law
from detent.moves.supersigma import of_program
from detent.ramps.differences import INTERVAL, CurveError, Differences, compiled
from detent.ramps.ways import Way
from detent.tuner.quasi_static import Torque

FASTEST = supersigma.LARGEST_SPEED * supersigma.SPEED_UNIT  # half steps/s
SMOOTHED = 2e-3  # s
INTERVALS = (INTERVAL, INTERVAL // 2, 2 * INTERVAL, INTERVAL // 4)  # clocks; the first that makes a table is taken
SPEEDS = 400  # points of a ramp
LESS = 0.9  # of the time that an ideal ramp takes: no table is so much faster than the curve that it is made of
KEPT = 64


class _Ramp(NamedTuple):
    """A ramp up, smoothed: speed (half steps/s) over time, and how far it has come."""

    times: Floats
    speeds: Floats
    far: Floats  # half steps

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.times[-1])


class Tables:
    """The ramps and tables of one torque curve. `options` are those of the model; without `short` it is exact."""

    def __init__(self, model: str, options: Mapping[str, object], torque: Torque) -> None:
        chosen = catalogue.option_values(catalogue.model(model), options)
        self.model, self.torque = model, torque
        self.short = Way(chosen["short"]) if "short" in options else Way.EXACT
        self.offset = int(chosen.get("offset", OFFSET))
        self._laws: OrderedDict[tuple[int, int, int], tuple[Differences, Law] | None] = OrderedDict()
        self.ramp = lru_cache(maxsize=4096)(self._ramp)

    def law(self, low: int, high: int, part: int) -> tuple[Differences, Law] | None:
        """From `low` to `high` half steps/s with `part` thousandths of the torque; None where no table can be that."""
        key = low, high, part
        if key not in self._laws:
            self._laws[key] = self._made(*key)
            if len(self._laws) > KEPT:
                self._laws.popitem(last=False)
        return self._laws[key]

    def least(self, low: int, high: int, part: int, steps: int) -> float:
        """Seconds that no movement of so many steps with that table is below; infinite where there is none."""
        ramp = self.ramp(low, high, part)
        if ramp is None:
            return float("inf")
        half = steps / 2
        if half < ramp.far[-1]:
            return LESS * min(2 * float(np.interp(half, ramp.far, ramp.times)), steps / low)
        return LESS * (2 * ramp.duration + (steps - 2 * float(ramp.far[-1])) / high)

    def _made(self, low: int, high: int, part: int) -> tuple[Differences, Law] | None:
        ramp = self.ramp(low, high, part)
        if ramp is None:
            return None
        for interval in INTERVALS:
            try:
                table = compiled(lambda t: float(np.interp(t, ramp.times, ramp.speeds)), ramp.duration, interval)
            except CurveError:
                continue
            program = Program(table=table, offset=self.offset, short=self.short)
            return table, of_program(program, self.model)
        return None

    def _ramp(self, low: int, high: int, part: int) -> _Ramp | None:
        torque = self.torque
        speeds = np.linspace(low, high, SPEEDS)
        spare = part / 1000 * np.interp(speeds, torque.speeds, torque.available) - np.interp(
            speeds, torque.speeds, torque.steady)  # fmt: skip
        if spare.min() <= 1e-3 * torque.holding:
            return None
        slowness = 1 / torque.acceleration(1.0) / spare
        times = np.concatenate(([0.0], np.cumsum((slowness[1:] + slowness[:-1]) / 2 * np.diff(speeds))))
        return _smoothed(times, speeds, low, high)


def _smoothed(times: Floats, speeds: Floats, low: int, high: int) -> _Ramp:
    """The mean of the speed over `SMOOTHED` about each instant, at `low` before the ramp and at `high` behind it."""
    end = float(times[-1])
    at = np.linspace(-SMOOTHED / 2, end + SMOOTHED / 2, 2 * SPEEDS)
    far = np.concatenate(([0.0], np.cumsum((speeds[1:] + speeds[:-1]) / 2 * np.diff(times))))

    def come(t: Floats) -> Floats:
        found: Floats = np.interp(t, times, far) + np.minimum(t, 0) * low + np.maximum(t - end, 0) * high
        return found

    mean = (come(at + SMOOTHED / 2) - come(at - SMOOTHED / 2)) / SMOOTHED
    mean = np.clip(mean, low, high)
    way = np.concatenate(([0.0], np.cumsum((mean[1:] + mean[:-1]) / 2 * np.diff(at))))
    return _Ramp(at - at[0], mean, way)
