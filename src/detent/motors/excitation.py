"""From pulses and current commands to what the windings are asked for, change by change.

Pulses are times (ns) and directions. A `Sequencer` keeps what a drive remembers between them: its place in the
winding table, the rate it measures, the factor on the current. It makes the columns that `kernel.advance` takes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from detent.motors.drive import FAST, SLOW, Drive
from detent.ticks import NEVER, Ns

Int64 = npt.NDArray[np.int64]


class Changes(NamedTuple):
    """Changes of excitation, in order of time: when, and what holds from then on."""

    times: Int64
    places: Int64
    levels: npt.NDArray[np.float64]
    rows: npt.NDArray[np.int64]
    modes: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.times)

    def between(self, first: int, end: int) -> "Changes":
        """Those from `first` to before `end`."""
        return Changes(self.times[first:end], self.places[first:end], self.levels[first:end], self.rows[first:end],
                       self.modes[first:end])  # fmt: skip


class Sequencer:
    """The logic between pulses and power stage, for a drive that decides about its decay and its current by itself.

    `level` may be set by whoever has a wire to the drive (MOV and RAMP). Feed pulses in order of time; what falls due
    by itself behind the last of them (standstill, hold current) comes with the next pulses, or with `up_to`.
    """

    __slots__ = ("_base", "_held", "_slowed", "drive", "last", "level", "measured", "mode", "moving", "on", "place",
                 "row", "slows_by", "stride")  # fmt: skip

    def __init__(self, drive: Drive, place: int = 0, stride: int = 1) -> None:
        self.drive = drive
        self.place, self.row, self.mode = place, 0, drive.mode
        self.on = True  # the windings have current at all
        self._base = drive.mode
        self.stride = stride  # places a pulse
        self.level = drive.currents.rest if drive.currents.after else drive.currents.ramp
        self.last: Ns = -NEVER  # the last pulse
        self.moving = False  # somebody outside says that a motion is under way: no hold current before its end
        self.measured: Ns | None = None  # between the last two steps, if they come one by one from outside
        self.slows_by: Ns = NEVER  # somebody outside says until when decay may be fast
        self._held = True
        self._slowed = True

    def pulses(self, times: Int64, directions: Int64 | int) -> Changes:
        """The changes up to and including these pulses."""
        count = len(times)
        if not count:
            return NOTHING
        first = self.up_to(int(times[0]))
        places = self.place + self.stride * np.cumsum(np.broadcast_to(np.asarray(directions, np.int64), (count,)))
        levels = np.full(count, self._running())
        modes = np.full(count, self._base, np.int64)
        standstill = self.drive.standstill
        if standstill < NEVER:
            before = np.concatenate(([max(self.last, int(times[0]) - 2 * standstill)], times[:-1]))
            modes[times - before < standstill] = FAST
        change = Changes(times, places, levels, np.full(count, self.row, np.int64), modes)
        after = self.drive.currents.after
        wanted = min(standstill, after or NEVER)
        gaps = np.flatnonzero(np.diff(times) > wanted) if wanted < NEVER else np.empty(0, np.int64)
        self.place, self.level, self.mode = int(places[-1]), float(levels[-1]), int(modes[-1])
        self.last = int(times[-1])
        self._held, self._slowed = not after, self.mode == self._base
        if len(gaps):
            change = self._with_pauses(change, gaps)
        return joined(first, change)

    def up_to(self, until: Ns) -> Changes:
        """What the drive does by itself between the last pulse and `until`, which is included."""
        due = [(at, what) for at, what in ((self.slows_at, "slow"), (self.holds_at, "hold")) if at <= until]
        rows = []
        for at, what in sorted(due):
            if what == "slow":
                self._slowed, self.mode = True, SLOW
            else:
                self._held = True
                self.level = self.drive.currents.rest if self.on else 0.0
            rows.append((at, self.place, self.level, self.row, self.mode))
        return _changes(*zip(*rows, strict=True)) if rows else NOTHING

    def set_level(self, level: float, at: Ns) -> Changes:
        """Somebody outside sets the factor on the current."""
        first = self.up_to(at)
        self.level = level
        return joined(first, at_once(at, self.place, level, self.row, self.mode))

    @property
    def slows_at(self) -> Ns:
        """When an `auto` drive notices that the motor stands."""
        return NEVER if self._slowed else min(self.slows_by, self.last + self.drive.standstill)

    @property
    def holds_at(self) -> Ns:
        """When the current falls to its hold value."""
        return NEVER if self._held or self.moving else self.last + self.drive.currents.after

    @property
    def own_level(self) -> float:
        """The factor that a drive with currents of its own (run and hold) gives now."""
        return self.drive.currents.rest if self._held else self.drive.currents.ramp

    def set_mode(self, mode: int) -> None:
        """Somebody outside chooses the decay."""
        self._base = self.mode = mode
        self._slowed = True

    def set_fast(self, until: Ns) -> None:
        """Decay is fast, and slow again at `until`."""
        self.mode, self._slowed, self.slows_by = FAST, until >= NEVER, until

    def run_from(self, at: Ns) -> None:
        """The current rises to its run value; what it falls to behind is counted from `at` on."""
        self.last, self._held = at, not self.drive.currents.after

    def _running(self) -> float:
        if not self.on:
            return 0.0
        return self.drive.currents.ramp if self.drive.currents.after else self.level

    def _with_pauses(self, change: Changes, gaps: Int64) -> Changes:
        """Add what falls due in pauses between these pulses."""
        parts, begin = [], 0
        mine = (self.place, self.level, self.mode, self.last, self._held, self._slowed)
        for gap in gaps.tolist():
            parts.append(change.between(begin, gap + 1))
            self.place, self.level, self.mode = (
                int(change.places[gap]),
                float(change.levels[gap]),
                int(change.modes[gap]),
            )
            self.last = int(change.times[gap])
            self._held, self._slowed = not self.drive.currents.after, self.mode == self._base
            parts.append(self.up_to(int(change.times[gap + 1])))
            begin = gap + 1
        parts.append(change.between(begin, len(change)))
        self.place, self.level, self.mode, self.last, self._held, self._slowed = mine
        return joined(*parts)


def joined(*parts: Changes) -> Changes:
    """One run of changes after the other."""
    some = [part for part in parts if len(part)]
    if len(some) == 1:
        return some[0]
    return Changes(*(np.concatenate(columns) for columns in zip(*some, strict=True))) if some else parts[0]


def at_once(at: Ns, place: int, level: float, row: int, mode: int) -> Changes:
    """One change."""
    return _changes([at], [place], [level], [row], [mode])


def _changes(
    times: Sequence[int], places: Sequence[int], levels: Sequence[float], rows: Sequence[int], modes: Sequence[int]
) -> Changes:
    return Changes(np.array(times, np.int64), np.array(places, np.int64), np.array(levels, np.float64),
                   np.array(rows, np.int64), np.array(modes, np.int64))  # fmt: skip


NOTHING = _changes([], [], [], [], [])
