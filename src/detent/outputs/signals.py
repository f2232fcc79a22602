"""From a recording to named signals: what every wire of every unit carried, and every step pulse.

Logged changes are held whole. Step pulses, of which there may be any number, are made from their trains one
window of time at a time (:meth:`Signals.windows`): nothing here costs a Python step per pulse.
"""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.recording import InputSet, Received, Recording, Span
from detent.controllers.device import Powered
from detent.outputs.waves import BEFORE_ALL, UNKNOWN, Spoken, Wave, merge, serial_wave, wave
from detent.pins import HIGH, LOW, Level, Pin, PinKind, PinSet
from detent.pulses.segment import Int64Array
from detent.ticks import Ns
from detent.uart import Format, Sent

WINDOW = 1 << 14  # pulses of a unit, or changes of a pin, in one window
LATEST: Ns = (1 << 62) - 1  # later times, or sums of them, int64 does not hold
SENDS, HEARS = "TXD", "RXD"  # the serial pins of a controller

_MOTION = (MotionStarted, MotionCut, MotionEnded)


class PulseOutput(NamedTuple):
    """How a controller gives its step pulses: the pin for each direction, how long and at which level."""

    clockwise: str
    counterclockwise: str  # the same pin as `clockwise` where another pin tells the direction
    width: Ns
    active: Level = LOW


class UnitView(NamedTuple):
    """What an output must know of a unit to draw it."""

    name: str
    pins: Sequence[Pin] = ()
    pulse_output: PulseOutput | None = None
    line_format: Format | None = None  # None: its serial wires are not drawn
    inputs: Mapping[str, Level] = {}  # levels before the first `InputSet`; a pin not named here rests
    powered: bool = False  # before the first `Powered`


class Drawable(Protocol):
    """A device that says how its pulses and characters look."""

    pins: Sequence[Pin]

    @property
    def pulse_output(self) -> PulseOutput | None:
        """How it gives step pulses; None: it gives none."""

    @property
    def line_format(self) -> Format | None:
        """The format of the characters it sends and hears; None: it has no serial port."""


def view(name: str, device: Drawable, inputs: Mapping[str, Level] | None = None) -> UnitView:
    """The view of a device that says itself how it is to be drawn."""
    return UnitView(name, device.pins, device.pulse_output, device.line_format, inputs or {})


class Pulses(NamedTuple):
    """Step pulses of one unit: when each begins, its direction (+1, -1), the position behind it."""

    times: Int64Array
    directions: Int64Array
    positions: Int64Array


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
            raise ValueError(f"no view of the units {', '.join(missing)}: give a UnitView for every unit recorded")
        self.until = until
        logs = [_Log(by_name[name]) for name in recording.units]
        for order, (unit, entry) in enumerate(recording):
            if type(entry) not in _MOTION and entry.at <= until:
                logs[unit].take(order, entry)
        self.units = tuple(
            UnitSignals(log, _clipped(recording.motion(log.view.name, until), until), until) for log in logs
        )

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
    """The wires of one unit. `pins` are those that carry something to draw, in the order of the pin table."""

    def __init__(self, log: "_Log", spans: Sequence[Span], until: Ns) -> None:
        self.view, self.name = log.view, log.view.name
        self.spans = tuple(spans)
        self.pins = log.drawn()
        self._ends = [span.ends for span in spans]
        self._initial = {pin: log.initial(pin) for pin in self.pins}
        self._power = log.power()
        self._until = until
        output = self.view.pulse_output
        in_log = output is not None and log.has_pulses(output)  # a wire carries them: each is logged already
        self._pulse_output = None if in_log else output
        self._waves = {pin: self._logged(log, pin) for pin in self.pins}

    @property
    def unlogged(self) -> frozenset[str]:
        """The pins whose pulses are known from their trains only: no wire carries them to another device."""
        output = self._pulse_output
        return frozenset() if output is None else frozenset((output.clockwise, output.counterclockwise))

    @property
    def pulse_count(self) -> int:
        """How many step pulses the unit gave."""
        return sum(span.last - span.first + 1 for span in self.spans)

    @property
    def start(self) -> int:
        """The position at 0."""
        if not self.spans:
            return 0
        span = self.spans[0]
        return span.shaft + span.direction * (span.first - 1)

    def pulses(self, begin: Ns, end: Ns) -> Pulses:
        """The step pulses with begin <= time < end."""
        times, directions, positions = [], [], []
        for index in range(bisect_left(self._ends, begin), len(self.spans)):
            span = self.spans[index]
            if span.begins >= end:
                break
            first = max(span.first, span.train.steps_by(begin - 1) + 1)
            last = min(span.last, span.train.steps_by(end - 1))
            if first <= last:
                times.append(span.train.times(first, last))
                directions.append(np.full(last - first + 1, span.direction, np.int64))
                positions.append(span.shaft + span.direction * np.arange(first, last + 1, dtype=np.int64))
        none = np.empty(0, np.int64)
        return Pulses(*(np.concatenate(parts) if parts else none for parts in (times, directions, positions)))

    def wave(self, pin: str, begin: Ns = 0, end: Ns | None = None, pulses: Pulses | None = None) -> Wave:
        """The changes of a pin with begin <= time < end (None: all). KeyError for a pin that is not drawn.

        `pulses` spares making them again: those from one pulse width before `begin` on (`pulses_for`).
        """
        end = self._until + 1 if end is None else end
        logged = self._waves[pin].between(begin, end)
        output = self._pulse_output
        if output is not None and pin in self.unlogged:
            times = self._times_on(pin, self.pulses_for(begin, end) if pulses is None else pulses)
            edges = _pulse_edges(times, output).between(begin, end)
            logged = merge(edges.where(self._is_powered(edges.times)), logged)
        return logged.tidy(self.level_before(pin, begin))

    def level_before(self, pin: str, t: Ns) -> int:
        """The level of a pin just before `t`."""
        level = self._waves[pin].level_before(t, self._initial[pin])
        output = self._pulse_output
        if level == UNKNOWN or output is None or pin not in self.unlogged:
            return level
        under_way = self._times_on(pin, self.pulses(t - output.width, t))
        return output.active if len(under_way) else level

    def pulses_for(self, begin: Ns, end: Ns) -> Pulses:
        """The pulses that can change a pin in a window: also those that began before it."""
        return self.pulses(begin - (self._pulse_output.width if self._pulse_output else 0), end)

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

    def _logged(self, log: "_Log", pin: str) -> Wave:
        logged = log.wave(pin)
        form = self.view.line_format
        if form is not None and pin in log.characters:
            bits = serial_wave(log.characters[pin], form)
            if pin in log.sends:
                bits = bits.where(self._is_powered(bits.times))
            logged = merge(bits.between(0, self._until + 1), logged)
        return logged.tidy(self._initial[pin])

    def _is_powered(self, times: Int64Array) -> npt.NDArray[np.bool_]:
        states = np.concatenate(([self.view.powered], self._power.levels)).astype(np.bool_)
        return states[np.searchsorted(self._power.times, times, side="right")]

    def _times_on(self, pin: str, pulses: Pulses) -> Int64Array:
        """When the pulses begin that this pin carries."""
        output = self.view.pulse_output
        assert output is not None
        if output.clockwise == output.counterclockwise:
            return pulses.times
        return pulses.times[pulses.directions == (1 if pin == output.clockwise else -1)]


class _Log:
    """What the recording says of one unit, pin by pin."""

    def __init__(self, view: UnitView) -> None:
        self.view = view
        self.characters: dict[str, list[Spoken]] = {}
        self.sends: set[str] = set()  # the ports the unit speaks on
        self._changes: dict[str, tuple[list[Ns], list[int], list[int]]] = {}
        self._powered: tuple[list[Ns], list[int], list[int]] = ([], [], [])
        self._outputs = [pin for pin in view.pins if pin.kind.drives]

    def take(self, order: int, entry: object) -> None:
        """Note one entry of the recording."""
        match entry:
            case PinSet(at, pin, level):
                self._change(pin, at, level, order)
            case InputSet(at, pin, level) if pin != HEARS:  # as a strap RXD is a voltage, not a logic level
                self._change(pin, at, level, order)
            case Sent(at, port, char, done):
                self.sends.add(port)
                self.characters.setdefault(port, []).append(Spoken(at, done, char, order))
            case Received(at, port, char, began):
                self.characters.setdefault(port, []).append(Spoken(began, at, char, order))
            case Powered(at, on):
                for column, value in zip(self._powered, (at, on, order), strict=True):
                    column.append(value)
                for output in self._outputs:
                    self._change(output.name, at, output.rest if on else UNKNOWN, order)
                if self.view.line_format is not None:
                    self._change(SENDS, at, HIGH if on else UNKNOWN, order)

    def wave(self, pin: str) -> Wave:
        """The logged changes of a pin."""
        return wave(*self._changes.get(pin, ((), (), ())))

    def power(self) -> Wave:
        """When the supply was switched."""
        return wave(*self._powered)

    def has_pulses(self, output: PulseOutput) -> bool:
        """Whether the step pulses are among the logged changes."""
        return any(
            output.active in self._changes.get(pin, ((), (), ()))[1]
            for pin in (output.clockwise, output.counterclockwise)
        )

    def drawn(self) -> dict[str, Pin]:
        """Inputs and outputs; serial wires if their format is known; straps that are told or moved."""
        drawn = {}
        for pin in self.view.pins:
            serial = pin.kind is PinKind.SERIAL and self.view.line_format is not None and pin.name in (SENDS, HEARS)
            strap = pin.kind is PinKind.STRAP and (pin.name in self._changes or pin.name in self.view.inputs)
            if pin.kind.drives or pin.kind is PinKind.INPUT or serial or strap:
                drawn[pin.name] = pin
        return drawn

    def initial(self, pin: str) -> int:
        """The level before anything happened."""
        row = next(row for row in self.view.pins if row.name == pin)
        if row.kind.drives or pin == SENDS:
            rest = HIGH if pin == SENDS else row.rest
            return rest if self.view.powered else UNKNOWN
        return HIGH if row.kind is PinKind.SERIAL else self.view.inputs.get(pin, row.rest)

    def _change(self, pin: str, at: Ns, level: int, order: int) -> None:
        columns = self._changes.get(pin)
        if columns is None:
            columns = self._changes[pin] = ([], [], [])
        columns[0].append(at)
        columns[1].append(level)
        columns[2].append(order)


def _pulse_edges(times: Int64Array, output: PulseOutput) -> Wave:
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
        if span.last >= span.first:
            clipped.append(span)
    return clipped
