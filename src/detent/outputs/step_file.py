"""Step files: the pulses of a recording as the runs that a board executes, a row each.

CSV with the columns `axis,direction,base,interval,count,add`, all in ticks of one clock whose tick 0 is time 0. Pulse k
(1 to count) of a row is due at base + k * interval + add * k * (k - 1) / 2; the base is the last pulse of the axis's
row before, unless that is long ago. Rows of an axis are in order of time, one axis after the other.
"""

import codecs
import csv
from collections.abc import Iterator
from pathlib import Path

from detent.outputs.files import open_whole
from detent.outputs.signals import Signals, UnitSignals
from detent.outputs.steps import Error, Run, Runs, Scale

COLUMNS = ("axis", "direction", "base", "interval", "count", "add")
BLOCK = 1 << 20  # pulses made at a time


def write(path: Path, signals: Signals, frequency: int, error: Error) -> None:
    """Write the file, whole or not at all, in ticks of `frequency` Hz, every pulse within `error`.

    ValueError where the clock is too slow to keep two pulses apart, and for more pulses than can be written; OSError if
    it cannot be.
    """
    signals.pulse_count()
    scale = Scale(frequency)
    with open_whole(path) as file:
        rows = csv.writer(codecs.getwriter("utf-8")(file), lineterminator="\n")
        rows.writerow(COLUMNS)
        for unit in signals.units:
            for direction, run in _runs(unit, scale, error):
                rows.writerow((unit.title, f"{direction:+d}", run.base, run.interval, run.steps, run.add))


def _runs(unit: UnitSignals, scale: Scale, error: Error) -> Iterator[tuple[int, Run]]:
    """The runs of an axis, each with its direction."""
    base: int | None = None
    for span in unit.motion.spans:
        if span.last < span.first:
            continue
        if base is None:
            base = min(0, scale.tick(span.train.time_of(span.first)) - 1)
        runs = Runs(span.train, scale, error, base, span.first, span.last)
        for upto in range(span.first + BLOCK - 1, span.last + BLOCK, BLOCK):
            for run in runs.take(upto):
                yield span.direction, run
        base = runs.base
