"""From a recording to named signals: what every wire of every unit carried, and every step pulse.

Logged changes are held whole. Step pulses, of which there may be any number, are made from their trains one
window of time at a time (:meth:`Signals.windows`): nothing here costs a Python step per pulse.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.cell import Cell
from detent.cell.recording import InputSet, Received, Recording
from detent.controllers.device import Powered
from detent.outputs.axis_motion import AxisMotion, Pulses
from detent.outputs.units import UnitLog, UnitView, views
from detent.outputs.waves import BEFORE_ALL, UNKNOWN, Wave, merge, serial_wave, wave
from detent.outputs.windings import Driven, connectors
from detent.pins import PinSet, PulseOutput
from detent.pulses.segment import Int64Array
from detent.ticks import Ns
from detent.uart import Sent

MOST_CHANGES = 20_000_000  # of outputs, by programs that turn in loops: they are held one by one
MOST_PULSES = 1_000_000_000  # of all units, where each is written: a file of tens of gigabytes
WINDOW = 1 << 14  # pulses of a unit, or changes of a pin, in one window
LATEST: Ns = (1 << 62) - 1  # later times, or sums of them, int64 does not hold

Watch: TypeAlias = Callable[[int, int], None]
"""Told how much of an output is done, of how much."""

_MOTION = (MotionStarted, MotionCut, MotionEnded)
_LOGGED = (PinSet, InputSet, Sent, Received, Powered)


def nobody_looks(done: int, total: int) -> None:
    """Nobody wants to know how far it is."""


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

    ValueError for a unit without a view, for a time that int64 cannot hold, and for too many changes to hold.
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
        _check_loops(recording)
        for order, (unit, entry) in enumerate(recording.with_kinds(*_LOGGED)):
            if type(entry) not in _MOTION and entry.at <= until:
                logs[unit].take(order, entry)
        found: list[UnitSignals] = []
        for log in logs:
            name, axes = log.view.name, log.view.axes
            motions = [AxisMotion(recording.motion(name, until, axis), until, log.view.shaft) for axis in axes]
            own = UnitSignals(log, motions[0], until)
            for connector in connectors(recording, name):
                own.add_windings(Driven(recording, name, connector, dict(zip(axes, motions, strict=True))))
            found.append(own)
            for axis, motion in zip(axes[1:], motions[1:], strict=True):  # each is one of its own, without the pins
                alone = UnitLog(UnitView(f"{name}.{axis}", shaft=log.view.shaft))
                found.append(UnitSignals(alone, motion, until, moves=True))
        self.units = tuple(found)

    def unit(self, name: str) -> "UnitSignals":
        """The signals of one unit. Raises KeyError."""
        for unit in self.units:
            if unit.name == name:
                return unit
        raise KeyError(f"no unit {name!r} was recorded: there are {', '.join(unit.name for unit in self.units)}")

    def pulse_count(self) -> int:
        """How many step pulses there are to write one by one. ValueError for more than can be."""
        total = sum(unit.motion.pulse_count for unit in self.units)
        if total > MOST_PULSES:
            raise ValueError(f"there are {total} pulses, and {MOST_PULSES} can be written: run for less")
        return total

    def windows(self, limit: int = WINDOW) -> Iterator[tuple[Ns, Ns]]:
        """Windows (begin, end), end excluded, that cover 0 .. until; none has more than `limit` pulses of a unit."""
        begin = 0
        for end in sorted({mark for unit in self.units for mark in unit.marks(limit) if 0 < mark <= self.until}):
            yield begin, end
            begin = end
        yield begin, self.until + 1


class UnitSignals:
    """The wires of one unit, and the motion of its axis.

    `pins` are those that carry something to draw, in the order of the pin table.
    `windings` are the winding ends that are driven, with what drives them, whether a wire leads from them or not.
    """

    def __init__(self, log: UnitLog, motion: AxisMotion, until: Ns, *, moves: bool = False) -> None:
        self.view, self.name = log.view, log.view.name
        axes = log.view.axes
        self.title = self.name if len(axes) == 1 else f"{self.name}.{axes[0]}"  # of the axis, for people
        self.moves = moves or log.view.pulse_output is not None or bool(motion.spans)  # it has an axis
        self.motion = motion
        self.pins = log.drawn()
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

    def logged(self, pin: str) -> Wave:
        """The changes of a pin that were recorded one by one: without those that follow from pulses."""
        return self._waves[pin]

    def pulses_for(self, begin: Ns, end: Ns) -> Pulses:
        """The pulses that can change a pin in a window: also those whose end falls into it."""
        return self.motion.pulses(begin - (self._output.width if self._output is not None else 0), end)

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
        return output.active if len(_times_on(pin, output, self.motion.pulses(t - output.width, t))) else level

    def marks(self, limit: int) -> Iterator[Ns]:
        """Times that cut the unit's signals into pieces of at most `limit` pulses, or changes of a pin."""
        room = limit
        for span in self.motion.spans:
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


def _check_loops(recording: Recording) -> None:
    """ValueError if programs in loops switch outputs more often than can be held."""
    for piece in recording.pieces():
        if not isinstance(piece, tuple) and PinSet in piece.kinds and piece.count > MOST_CHANGES:
            names = ", ".join(recording.units[unit] for unit in piece.units)
            raise ValueError(
                f"there are {piece.count} instructions and changes of outputs by programs in loops ({names}), and "
                f"{MOST_CHANGES} can be written: run for less"
            )


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
