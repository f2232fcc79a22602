"""What the windings of a motor got: from the recorded drives and the trains, exact at every step.

`duties` answers for chosen times, one by one; `Driven` gives every change of a stretch of time as arrays.
"""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np

from detent.cell.recording import Recording
from detent.controllers.device import DriveSet, Powered
from detent.outputs.axis_motion import AxisMotion
from detent.outputs.waves import BEFORE_ALL, Wave
from detent.pulses.rates import rates_at
from detent.pulses.segment import Int64Array
from detent.ticks import Ns

Setting: TypeAlias = DriveSet | Powered  # `Powered`: off, so that no winding gets anything


def duties(recording: Recording, unit: str, connector: str, times: Sequence[Ns], shaft: int = 0) -> list[Sequence[int]]:
    """The PWM counts of the winding ends at a connector, at each of `times`, steps of that instant included.

    They are 0 before the first drive and while there is no supply. `shaft` is where the axis stood at the start.
    ValueError for a connector of which no drive was recorded.
    """
    settings = _settings(recording, unit, connector)
    told = next((entry for entry in settings if isinstance(entry, DriveSet)), None)
    if told is None:
        raise ValueError(f"no drive at connector {connector!r} of {unit} was recorded")
    spans = recording.motion(unit, max(times, default=0), told.axis)
    begins, since = [span.begins for span in spans], [entry.at for entry in settings]
    found: list[Sequence[int]] = []
    for at in times:
        place, rate = shaft, 0
        index = bisect_right(begins, at) - 1
        if index >= 0:
            span = spans[index]
            given = min(max(span.train.steps_by(at), span.first - 1), span.last)
            place = span.shaft + span.direction * given
            rate = int(span.train.state_at(at).rate)
        index = bisect_right(since, at) - 1
        setting = settings[index] if index >= 0 else None
        if isinstance(setting, DriveSet):
            found.append(setting.drive.duties(place - setting.origin, rate))
        else:
            found.append((0,) * len(told.drive.ends))
    return found


class Changes(NamedTuple):
    """Moments at which counts can change, and the counts of all winding ends from then on: a row a moment."""

    times: Int64Array
    counts: Int64Array


class Driven:
    """The windings at one connector. `pins` are their ends, in the order of the counts."""

    def __init__(self, recording: Recording, unit: str, connector: str, axes: Mapping[str, AxisMotion]) -> None:
        """`axes` are the motions of the unit's axes, by name.

        ValueError for a connector of which no drive was recorded.
        """
        self.connector = connector
        self._settings = _settings(recording, unit, connector)
        told = next((entry for entry in self._settings if isinstance(entry, DriveSet)), None)
        if told is None:
            raise ValueError(f"no drive at connector {connector!r} of {unit} was recorded")
        self._axis = axes[told.axis]
        self.pins = tuple(connector + end for end in told.drive.ends)
        self._since = np.array([entry.at for entry in self._settings], np.int64)
        self._begins = np.array([span.begins for span in self._axis.spans], np.int64)
        self._kept: tuple[tuple[Ns, Ns], Changes] | None = None  # of the last stretch that was asked for

    def counts(self, t: Ns) -> Sequence[int]:
        """The counts at `t`, steps of that instant included."""
        setting = self._setting(t)
        if not isinstance(setting, DriveSet):
            return (0,) * len(self.pins)
        index = int(np.searchsorted(self._begins, t, side="right")) - 1
        rate = int(self._axis.spans[index].train.state_at(t).rate) if index >= 0 else 0
        return setting.drive.duties(self._axis.position(t) - setting.origin, rate)

    def powers(self) -> list[tuple[Ns, str]]:
        """When the power of the drive changes, and to what; "off" without supply."""
        found: list[tuple[Ns, str]] = []
        for setting in self._settings:
            power = setting.drive.power if isinstance(setting, DriveSet) else "off"
            if found and found[-1][0] == setting.at:
                found.pop()
            if not found or found[-1][1] != power:
                found.append((setting.at, power))
        return found

    def changes(self, begin: Ns, end: Ns) -> Changes:
        """All steps and settings with begin <= time < end."""
        if self._kept is None or self._kept[0] != (begin, end):
            self._kept = (begin, end), self._changes(begin, end)
        return self._kept[1]

    def wave(self, pin: str, begin: Ns, end: Ns) -> tuple[Int64Array, Int64Array]:
        """When the count of a winding end changes, and to what, begin <= time < end."""
        column = self.pins.index(pin)
        found = self.changes(begin, end)
        values = found.counts[:, column]
        differs = np.diff(values, prepend=self.counts(begin - 1)[column]) != 0
        return found.times[differs], values[differs]

    def levels(self, pin: str, begin: Ns, end: Ns) -> Wave:
        """When a winding end is given current, and when no more, begin <= time < end."""
        times, values = self.wave(pin, begin, end)
        before = self.counts(begin - 1)[self.pins.index(pin)] > 0
        levels = (values > 0).astype(np.uint8)
        return Wave(times, levels, np.full(len(times), BEFORE_ALL, np.int64)).tidy(int(before))

    def _setting(self, t: Ns) -> Setting | None:
        index = int(np.searchsorted(self._since, t, side="right")) - 1
        return self._settings[index] if index >= 0 else None

    def _changes(self, begin: Ns, end: Ns) -> Changes:
        times, counts = [np.empty(0, np.int64)], [np.empty((0, len(self.pins)), np.int64)]
        for span, first, last in self._axis.runs(begin, end):
            at = span.train.times(first, last)
            places = span.shaft + span.direction * np.arange(first, last + 1, dtype=np.int64)
            times.append(at)
            counts.append(self._counts_at(at, places, rates_at(span.train, at)))
        stepped = np.concatenate(times)
        # what is set, and what begins, in the instant of a step counts in that instant
        marks = (marks[slice(*np.searchsorted(marks, (begin, end)))] for marks in (self._since, self._begins))
        set_at = np.unique(np.concatenate(list(marks)))
        chosen = np.array([self.counts(t) for t in set_at.tolist()], np.int64).reshape(-1, len(self.pins))
        alone = ~np.isin(stepped, set_at)
        together = np.concatenate((stepped[alone], set_at))
        order = np.argsort(together, kind="stable")
        return Changes(together[order], np.concatenate((np.concatenate(counts)[alone], chosen))[order])

    def _counts_at(self, times: Int64Array, places: Int64Array, rates: Int64Array) -> Int64Array:
        """The counts at steps, which are in order of time."""
        counts = np.zeros((len(times), len(self.pins)), np.int64)
        which = np.searchsorted(self._since, times, side="right") - 1
        cuts = [0, *(np.flatnonzero(np.diff(which)) + 1).tolist(), len(times)]
        for low, high in pairwise(cuts):
            setting = self._settings[int(which[low])] if which[low] >= 0 else None
            if isinstance(setting, DriveSet):
                counts[low:high] = setting.drive.duties_at(places[low:high] - setting.origin, rates[low:high])
        return counts


def connectors(recording: Recording, unit: str) -> list[str]:
    """The connectors of a unit of which a drive was recorded, in the order in which they were first told."""
    return list(dict.fromkeys(entry.connector for entry in recording.of(unit, DriveSet) if isinstance(entry, DriveSet)))


def _settings(recording: Recording, unit: str, connector: str) -> list[Setting]:
    return [
        entry
        for entry in recording.of(unit, DriveSet, Powered)
        if (isinstance(entry, DriveSet) and entry.connector == connector)
        or (isinstance(entry, Powered) and not entry.on)
    ]
