"""From a recording to named signals: what every wire of every unit carried, and every step pulse.

Logged changes are held whole. Step pulses, of which there may be any number, are made from their trains one
window of time at a time (:meth:`Signals.windows`): nothing here costs a Python step per pulse.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.cell import Cell
from detent.cell.recording import Recording, Span
from detent.outputs.units import UnitLog, UnitView, views
from detent.outputs.waves import BEFORE_ALL, UNKNOWN, Wave, merge, serial_wave, wave
from detent.outputs.windings import Driven, connectors
from detent.pins import PulseOutput
from detent.pulses.segment import Int64Array
from detent.ticks import Ns

WINDOW = 1 << 14  # pulses of a unit, or changes of a pin, in one window
LATEST: Ns = (1 << 62) - 1  # later times, or sums of them, int64 does not hold

Watch: TypeAlias = Callable[[int, int], None]
"""Told how much of an output is done, of how much."""

_MOTION = (MotionStarted, MotionCut, MotionEnded)


def nobody_looks(done: int, total: int) -> None:
    """Nobody wants to know how far it is."""


class Pulses(NamedTuple):
    """Step pulses of one unit: when each begins, its direction (+1, -1), the position behind it."""

    times: Int64Array
    directions: Int64Array
    positions: Int64Array


def of_cell(cell: Cell, shafts: Mapping[str, int] | None = None) -> "Signals":
    """What happened in a cell up to now. `shafts` are the places where axes stood at the start, if not at 0.

    Where nothing is left to do the end of the last pulse belongs to it. ValueError for a cell that was told not to
    record.
    """
    if cell.recording is None:
        raise ValueError("this cell keeps no recording: build it with record=True")
    seen = views(cell, shafts)
    until = cell.now
    if cell.next_event() is None:
        until = max(until, *(_last_edge(cell.recording, view, cell.now) for view in seen))
    return Signals(cell.recording, seen, until)


def _last_edge(recording: Recording, view: UnitView, now: Ns) -> Ns:
    """When the last step pulse of a unit ends; 0 if it gave none."""
    if view.pulse_output is None:
        return 0
    spans = [span for axis in view.axes for span in recording.motion(view.name, now, axis) if span.last >= span.first]
    return max((span.train.time_of(span.last) + view.pulse_output.width for span in spans), default=0)


class Signals:
    """All wires of a recording from 0 up to and including `until`.

    ValueError for a unit without a view, and for a time that int64 cannot hold.
    """

    def __init__(self, recording: Recording, views: Sequence[UnitView], until: Ns) -> None:
        if not 0 <= until <= LATEST:
            raise ValueError(f"signals end between 0 and {LATEST} ns (146 years), not at {until} ns")
        by_name = {one.name: one for one in views}
        missing = [name for name in recording.units if name not in by_name]
        if missing:
            raise ValueError(f"no view of {', '.join(missing)}: give a UnitView for every unit that was recorded")
        self.recording, self.until = recording, until
        logs = [UnitLog(by_name[name]) for name in recording.units]
        for order, (unit, entry) in enumerate(recording):
            if type(entry) not in _MOTION and entry.at <= until:
                logs[unit].take(order, entry)
        found: list[UnitSignals] = []
        for log in logs:
            first, *others = log.view.axes
            name = log.view.name
            own = len(found)
            found.append(UnitSignals(log, _clipped(recording.motion(name, until, first), until), until))
            for axis in others:  # each further axis of a unit is one of its own, without the pins
                alone = UnitLog(UnitView(f"{name}.{axis}", shaft=log.view.shaft))
                found.append(
                    UnitSignals(alone, _clipped(recording.motion(name, until, axis), until), until, moves=True)
                )
            for connector in connectors(recording, name):
                found[own].add_windings(Driven(recording, name, connector, found[own:]))
        self.units = tuple(found)

    def unit(self, name: str) -> "UnitSignals":
        """The signals of one unit. Raises KeyError."""
        for unit in self.units:
            if unit.name == name:
                return unit
        raise KeyError(f"no unit {name!r} was recorded: there are {', '.join(unit.name for unit in self.units)}")

    def windows(self, limit: int = WINDOW) -> Iterator[tuple[Ns, Ns]]:
        """Windows (begin, end), end excluded, that cover 0 .. until; none has more than `limit` pulses of a unit."""
        begin = 0
        for end in sorted({mark for unit in self.units for mark in unit.marks(limit) if 0 < mark <= self.until}):
            yield begin, end
            begin = end
        yield begin, self.until + 1


class UnitSignals:
    """The wires of one unit. `pins` are those that carry something to draw, in the order of the pin table.

    `windings` are the winding ends that are driven, with what drives them, whether a wire leads from them or not.
    """

    def __init__(self, log: UnitLog, spans: Sequence[Span], until: Ns, *, moves: bool = False) -> None:
        self.view, self.name = log.view, log.view.name
        axes = log.view.axes
        self.title = self.name if len(axes) == 1 else f"{self.name}.{axes[0]}"  # of the axis, for people
        self.moves = moves or log.view.pulse_output is not None or bool(spans)  # it has an axis
        self.spans = tuple(spans)
        self.pins = log.drawn()
        self._ends = [span.ends for span in spans]
        self._initial = {pin.name: log.initial(pin) for pin in self.pins.values()}
        self._power = log.power()
        self._until = until
        output = None if log.carries_pulses() else log.view.pulse_output
        self._output = output  # of pulses that are no entries of their own
        self.unlogged = frozenset(output.clocks) if output is not None else frozenset()
        self._waves = {pin: self._logged(log, pin) for pin in self.pins}
        self.windings: dict[str, Driven] = {}

    def add_windings(self, driven: Driven) -> None:
        """The windings at one of its connectors."""
        self.windings |= dict.fromkeys(driven.pins, driven)

    @property
    def pulse_count(self) -> int:
        """How many step pulses the unit gave."""
        return sum(span.last - span.first + 1 for span in self.spans)

    @property
    def start(self) -> int:
        """The position at 0."""
        if not self.spans:
            return self.view.shaft
        span = self.spans[0]
        return span.shaft + span.direction * (span.first - 1)

    def position(self, t: Ns) -> int:
        """The position at `t`, pulses of that instant included."""
        index = bisect_left(self._ends, t)
        if index < len(self.spans) and self.spans[index].begins <= t:
            span = self.spans[index]
            return span.shaft + span.direction * min(max(span.train.steps_by(t), span.first - 1), span.last)
        if index == 0:
            return self.start
        span = self.spans[index - 1]
        return span.shaft + span.direction * span.last

    def pulses(self, begin: Ns, end: Ns) -> Pulses:
        """The step pulses with begin <= time < end."""
        times, directions, positions = [], [], []
        for span, first, last in self.runs(begin, end):
            times.append(span.train.times(first, last))
            directions.append(np.full(last - first + 1, span.direction, np.int64))
            positions.append(span.shaft + span.direction * np.arange(first, last + 1, dtype=np.int64))
        none = np.empty(0, np.int64)
        return Pulses(*(np.concatenate(parts) if parts else none for parts in (times, directions, positions)))

    def runs(self, begin: Ns, end: Ns) -> Iterator[tuple[Span, int, int]]:
        """The motions that gave pulses with begin <= time < end, and the numbers of the first and last of these."""
        for index in range(bisect_left(self._ends, begin), len(self.spans)):
            span = self.spans[index]
            if span.begins >= end:
                break
            first = max(span.first, span.train.steps_by(begin - 1) + 1)
            last = min(span.last, span.train.steps_by(end - 1))
            if first <= last:
                yield span, first, last

    def logged(self, pin: str) -> Wave:
        """The changes of a pin that were recorded one by one: without those that follow from pulses."""
        return self._waves[pin]

    def pulses_for(self, begin: Ns, end: Ns) -> Pulses:
        """The pulses that can change a pin in a window: also those whose end falls into it."""
        return self.pulses(begin - (self._output.width if self._output is not None else 0), end)

    def wave(self, pin: str, begin: Ns = 0, end: Ns | None = None, pulses: Pulses | None = None) -> Wave:
        """The changes of a pin with begin <= time < end (None: all). KeyError for a pin that is not drawn.

        `pulses` are those of `pulses_for` in the same window, for a caller that has them already. A winding end
        to which no wire leads is 1 with current, like one with a wire.
        """
        end = self._until + 1 if end is None else end
        if pin not in self._waves and pin in self.windings:
            return self.windings[pin].levels(pin, begin, end)
        changes = self._waves[pin].between(begin, end)
        output = self._output
        if output is not None and pin in self.unlogged:
            times = _times_on(pin, output, self.pulses_for(begin, end) if pulses is None else pulses)
            edges = _edges(times, output).between(begin, end)
            changes = merge(edges.where(self._is_powered(edges.times)), changes)
        return changes.tidy(self.level_before(pin, begin))

    def level_before(self, pin: str, t: Ns) -> int:
        """The level of a pin just before `t`."""
        if pin not in self._waves and pin in self.windings:
            driven = self.windings[pin]
            return int(driven.counts(t - 1)[driven.pins.index(pin)] > 0)
        level = self._waves[pin].level_before(t, self._initial[pin])
        output = self._output
        if level == UNKNOWN or output is None or pin not in self.unlogged:
            return level
        return output.active if len(_times_on(pin, output, self.pulses(t - output.width, t))) else level

    def marks(self, limit: int) -> Iterator[Ns]:
        """Times that cut the unit's signals into pieces of at most `limit` pulses, or changes of a pin."""
        room = limit
        for span in self.spans:
            first = span.first
            while span.last - first >= room:
                first += room
                yield span.train.time_of(first)
                room = limit
            room -= span.last - first + 1
        for one in self._waves.values():
            yield from one.times[limit::limit].tolist()

    def _logged(self, log: UnitLog, pin: str) -> Wave:
        changes = log.wave(pin)
        form = self.view.line_format
        if form is not None and pin in log.characters:
            bits = serial_wave(log.characters[pin], form).between(0, self._until + 1)
            if pin == self.view.port.sends:
                bits = bits.where(self._is_powered(bits.times))
            changes = merge(bits, changes)
        return changes.tidy(self._initial[pin])

    def _is_powered(self, times: Int64Array) -> npt.NDArray[np.bool_]:
        states: npt.NDArray[np.bool_] = np.concatenate(([self.view.powered], self._power.levels)).astype(np.bool_)
        return states[np.searchsorted(self._power.times, times, side="right")]


def _times_on(pin: str, output: PulseOutput, pulses: Pulses) -> Int64Array:
    """When the pulses begin that this pin carries."""
    ways = [direction for direction in output.pins if output.carries(pin, direction)]
    if len(ways) == len(output.pins):
        return pulses.times
    times: Int64Array = pulses.times[np.isin(pulses.directions, ways)]
    return times


def _edges(times: Int64Array, output: PulseOutput) -> Wave:
    """Both edges of the pulses that begin at `times`. Pulses that touch are one."""
    if not len(times):
        return wave((), (), ())
    apart = np.diff(times) > output.width
    begins = times[np.concatenate(([True], apart))]
    ends = times[np.concatenate((apart, [True]))] + output.width
    both = np.empty(2 * len(begins), np.int64)
    both[0::2], both[1::2] = begins, ends
    levels = np.empty(len(both), np.uint8)
    levels[0::2], levels[1::2] = output.active, 1 - output.active
    return Wave(both, levels, np.full(len(both), BEFORE_ALL, np.int64))


def _clipped(spans: Sequence[Span], until: Ns) -> list[Span]:
    """The spans as far as they lie before `until`, or in it."""
    clipped = []
    for span in spans:
        if span.begins > until:
            break
        if span.ends > until:
            span = span._replace(ends=until, last=min(span.last, span.train.steps_by(until)))
        clipped.append(span)
    return clipped
