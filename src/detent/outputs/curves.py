"""What a figure draws, as arrays: positions, speeds, levels and instructions, no finer than its columns of pixels.

The work is bounded by the number of columns and of motions, whatever the number of pulses: trains are asked
where they are at chosen times, and speeds come from the laws of their segments.
"""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from detent.cell.recording import Entry, Recording, Span
from detent.cell.rounds import Rounds
from detent.controllers.device import Executing, Finished, Powered
from detent.outputs.axis_motion import Pulses
from detent.outputs.signals import Signals, UnitSignals
from detent.outputs.waves import Levels, Wave
from detent.outputs.windings import Driven
from detent.pulses import Accelerating, Uniform
from detent.pulses.segment import Int64Array
from detent.ticks import Fixed, Ns, round_fixed, to_fixed

EXACT = 1_500  # so many pulses are drawn one by one
MANY_TURNS = 100_000  # instructions of programs in loops
MANY_SEGMENTS = 64  # of a train; beyond that it is sampled as a whole
DENSE_LOOKS = 4  # motions of a column that are asked for their speed


class Trace(NamedTuple):
    """A curve: straight lines from point to point."""

    times: Int64Array  # ns
    values: npt.NDArray[np.float64]


class Lane(NamedTuple):
    """A logic level: from times[i] on it is levels[i]. Within `busy` it changes too often to be drawn."""

    times: Int64Array
    levels: Levels
    busy: Sequence[tuple[Ns, Ns]]


class Band(NamedTuple):
    """Something that lasts, with a word for it."""

    begin: Ns
    end: Ns
    label: str


def position_trace(unit: UnitSignals, until: Ns, columns: int) -> Trace:
    """The commanded position from 0 to `until`: a staircase if it has few steps."""
    if unit.motion.pulse_count <= EXACT:
        pulses = unit.motion.pulses(0, until + 1)
        times = np.concatenate(([0], np.repeat(pulses.times, 2), [until]))
        levels = np.concatenate(([unit.motion.start], pulses.positions)).astype(np.float64)
        return Trace(times, np.repeat(levels, 2))
    grid = {until * k // columns for k in range(columns + 1)}
    points: list[tuple[Ns, float]] = []
    for group in _groups(unit.motion.spans, until, columns):
        if len(group) == 1:
            grid |= {group[0].begins, group[0].ends}
            continue
        ends = [span.shaft + span.direction * n for span in group for n in (span.first - 1, span.last)]
        points += [(group[0].begins, min(ends)), (group[0].begins, max(ends))]
    points += [(t, unit.motion.position(t)) for t in grid]
    points.sort(key=lambda point: point[0])
    return _trace(points)


def speed_trace(unit: UnitSignals, until: Ns, columns: int) -> Trace:
    """The speed with its sign, in steps/s, from 0 to `until`, by the laws of the trains; 0 at rest."""
    points: list[tuple[Ns, float]] = [(0, 0.0)]
    before: Ns | None = None  # the end of the motion before
    for group in _groups(unit.motion.spans, until, columns):
        begin, end = group[0].begins, group[-1].ends
        if before is not None and before != begin:
            points.append((before, 0.0))
        if before != begin:
            points.append((begin, 0.0))
        if len(group) == 1:
            width = (end - begin) * columns // max(until, 1)
            points += _law(group[0], width)
        else:
            looks = group[:: max(len(group) // DENSE_LOOKS, 1)]
            speeds = [speed for span in looks for _, speed in _law(span, 0)]
            points += [(begin, min(0.0, *speeds)), (begin, max(0.0, *speeds)), (end, 0.0)]
        before = end
    if before is None or before < until:
        points += [(until if before is None else before, 0.0), (until, 0.0)]
    return _trace(points)


def envelope(trace: Trace, until: Ns, columns: int) -> tuple[Trace, Trace]:
    """The lowest and the highest value of a curve in each column, 0 .. columns, for one that bends too often."""
    edges = np.array([until * k // columns for k in range(columns + 1)], np.int64)
    through = np.interp(edges, trace.times, trace.values)
    low, high = through.copy(), through.copy()
    column = np.searchsorted(edges, trace.times, side="right") - 1
    np.minimum.at(low, column, trace.values)
    np.maximum.at(high, column, trace.values)
    return Trace(edges, low), Trace(edges, high)


def lane(unit: UnitSignals, pin: str, until: Ns, columns: int) -> Lane:
    """The level of a pin from 0 to `until`; of what happens at 0 only the outcome."""
    before = unit.level_before(pin, 1)
    busy: list[tuple[Ns, Ns]] = []
    if pin in unit.unlogged and unit.motion.pulse_count > EXACT:
        wave = unit.wave(pin, 1, pulses=_NO_PULSES)
        busy = _busy_with_pulses(unit, pin, until, columns)
    else:
        wave, busy = _thinned(unit.wave(pin, 1), until, columns)
    times = np.concatenate((np.zeros(1, np.int64), wave.times))
    levels = np.concatenate((np.array([before], np.uint8), wave.levels))
    return Lane(times, levels, busy)


def instructions(signals: Signals, name: str) -> list[Band]:
    """What the unit's program executed, and how long.

    An instruction lasts to the next one, or to the end of the program, of the supply, or of the run. Of a program in a
    loop, `MANY_TURNS` instructions and more are one band without a word.
    """
    bands: list[Band] = []
    if name not in signals.recording.units:  # a further axis of a unit
        return bands
    current: Executing | None = None
    for entry in _executed(signals.recording, signals.recording.units.index(name)):
        at = entry.begin if isinstance(entry, Band) else entry.at
        if at > signals.until:
            break
        if current is not None and isinstance(entry, Executing | Band):
            bands.append(Band(current.at, at, current.instruction))
            current = None
        match entry:
            case Band():
                bands.append(entry)
            case Executing():
                current = entry
            case Finished(at) | Powered(at, False) if current is not None:
                bands.append(Band(current.at, at, current.instruction))
                current = None
    if current is not None:
        bands.append(Band(current.at, signals.until, current.instruction))
    return bands


_OF_PROGRAMS = (Executing, Finished, Powered)


def _executed(recording: Recording, unit: int) -> Iterator[Entry | Band]:
    """The entries of a unit; a band for many turns of a loop."""
    for piece in recording.pieces():
        if isinstance(piece, tuple):
            if piece[0] == unit:
                yield from piece[1]
        elif isinstance(piece, Rounds):
            yield from piece.of(unit, _OF_PROGRAMS)
        elif piece.count < MANY_TURNS:
            yield from piece.of(unit)
        else:
            yield from (Band(turn.begins, piece.ends, "") for turn in piece.turns if turn.unit == unit)


def powers(driven: Driven, until: Ns) -> list[Band]:
    """The power of the windings at a connector, as long as they have any."""
    told = [*(one for one in driven.powers() if one[0] < until), (until, "")]
    return [Band(at, end, power) for (at, power), (end, _) in pairwise(told) if power != "off"]


_NO_PULSES = Pulses(*[np.empty(0, np.int64)] * 3)


def _trace(points: Sequence[tuple[Ns, float]]) -> Trace:
    return Trace(np.array([t for t, _ in points], np.int64), np.array([value for _, value in points], np.float64))


def _groups(spans: Sequence[Span], until: Ns, columns: int) -> Iterator[Sequence[Span]]:
    """The motions one by one, but those that lie within one column together."""
    if not spans:
        return
    begins = np.array([span.begins for span in spans]) * (columns / (until + 1))
    ends = np.array([span.ends for span in spans]) * (columns / (until + 1))
    first, last = begins.astype(np.int64), ends.astype(np.int64)
    apart = (first[1:] != first[:-1]) | (first[1:] != last[1:]) | (first[:-1] != last[:-1])
    cuts = [0, *(np.flatnonzero(apart) + 1).tolist(), len(spans)]
    for low, high in pairwise(cuts):
        yield spans[low:high]


def _law(span: Span, width: int) -> Iterator[tuple[Ns, float]]:
    """Times and speeds of a motion that is `width` columns wide, from its begin to its end."""
    train, begin, end = span.train, to_fixed(span.begins), to_fixed(span.ends)
    if len(train.segments) > MANY_SEGMENTS:
        points = max(width, 5)
        for k in range(points):
            t = span.begins + (span.ends - span.begins) * k // (points - 1)
            yield t, span.direction * train.state_at(t).rate
        return
    for segment in train.segments:
        low = max(train.start + segment.begin, begin)
        high = end if segment.end is None else min(train.start + segment.end, end)
        if low >= high:
            continue
        linear = isinstance(segment, Uniform | Accelerating)  # in time
        points = 2 if linear else min(max((high - low) * width // max(end - begin, 1), 4), 1_000)
        for k in range(points):
            at: Fixed = low + (high - low) * k // (points - 1)
            yield round_fixed(at), span.direction * segment.progress(at - train.start)[1]


def _busy_with_pulses(unit: UnitSignals, pin: str, until: Ns, columns: int) -> list[tuple[Ns, Ns]]:
    """The columns in which the pin carries a pulse, joined."""
    output = unit.view.pulse_output
    assert output is not None
    spans = [span for span in unit.motion.spans if output.carries(pin, span.direction)]
    counts = [0]
    for span in spans:
        counts.append(counts[-1] + span.last - span.first + 1)
    begins = [span.begins for span in spans]

    def by(t: Ns) -> int:
        index = bisect_right(begins, t) - 1
        if index < 0:
            return 0
        span = spans[index]
        return counts[index] + min(max(span.train.steps_by(t), span.first - 1), span.last) - span.first + 1

    busy: list[tuple[Ns, Ns]] = []
    before = 0
    for k in range(columns):
        low, high = until * k // columns, until * (k + 1) // columns
        now = by(high)
        if now > before:
            if busy and busy[-1][1] == low:
                low = busy.pop()[0]
            busy.append((low, high))
        before = now
    return busy


def _thinned(wave: Wave, until: Ns, columns: int) -> tuple[Wave, list[tuple[Ns, Ns]]]:
    """The changes without those in columns that have more than two, and where these are."""
    if not len(wave.times):
        return wave, []
    column = (wave.times * (columns / (until + 1))).astype(np.int64)
    _, where, counts = np.unique(column, return_inverse=True, return_counts=True)
    crowded = counts[where] > 2
    # a run of crowded columns is one busy stretch; its last change tells the level behind it
    begins = crowded & ~np.concatenate(([False], crowded[:-1] & (np.diff(column) <= 1)))
    ends = crowded & ~np.concatenate((crowded[1:] & (np.diff(column) <= 1), [False]))
    busy = list(zip(wave.times[begins].tolist(), wave.times[ends].tolist(), strict=True))
    return wave.where(~crowded | ends), busy
