"""What happened in the cell, as the workbench was told: the recording, and the same sorted by what it is about.

The recording goes back as far as the engine keeps the past. What lay before is condensed to what still counts: the last
level of each pin, the last motion of each axis, drives and supplies.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping
from math import nan
from typing import Final, TypeAlias

from detent.axis import Displaced, MotionCut, MotionEnded, MotionStarted
from detent.cell.actions import Load, TimedAction
from detent.cell.moments import Cut
from detent.cell.recording import Batch, Entry, InputSet, Received, Recording, Span
from detent.controllers.device import DriveSet, Powered, Refused, StageSet
from detent.outputs.signals import Signals
from detent.outputs.units import UnitView
from detent.outputs.waves import Spoken, serial_wave
from detent.pins import HIGH, Level, PinKind, PinSet
from detent.pulses import Train
from detent.ticks import Ns
from detent.uart import Sent
from detent.workbench import rotors
from detent.workbench.columns import Changes, Rows
from detent.workbench.messages import Happened, Opened
from detent.workbench.sharing import Sharing

MOST_ROWS: Final = 1_000_000  # of all rotors, 56 MB: of a single one most of a minute of motion
MOST_ACTIONS: Final = 200_000  # with more, they cannot be done again
SLACK: Final = 4  # what is no longer needed is forgotten when it is so many-th of everything

STILL = Train(())  # of an axis that was found elsewhere, without a pulse
MotionEntry: TypeAlias = MotionStarted | MotionCut | MotionEnded | Displaced


class Axis:
    """The motions of an axis, and the spans of pulses that they make."""

    def __init__(self, shaft: int) -> None:
        self.initial = shaft  # where it stood before the first motion
        self.pulses = 0  # given before the first motion
        self.spans: list[Span] = []  # that are over
        self.motion: MotionStarted | None = None  # under way
        self._told: list[tuple[int, MotionEntry]] = []
        self._counts = [0]  # pulses of the first so many spans

    def take(self, batch: int, entry: MotionEntry) -> None:
        """The axis does this."""
        self._told.append((batch, entry))
        if isinstance(entry, MotionStarted):
            self._end(entry.at, entry.first - 1)
            self.motion = entry
        elif isinstance(entry, Displaced):
            self.spans.append(Span(entry.at, entry.at, STILL, 1, 0, 1, entry.shaft))
            self._counts.append(self._counts[-1])
        else:
            self._end(entry.at, entry.last)

    def _end(self, at: Ns, last: int) -> None:
        motion, self.motion = self.motion, None
        if motion is not None:
            span = Span(motion.at, at, motion.train, motion.first, last, motion.direction, motion.shaft)
            self.spans.append(span)
            self._counts.append(self._counts[-1] + max(last - motion.first + 1, 0))

    def reaching(self, begin: Ns, end: Ns) -> list[Span]:
        """The spans that reach into begin <= time <= end, or end or begin there; the one under way as far as `end`."""
        low = bisect_left(self.spans, begin, key=lambda span: span.ends)
        high = bisect_right(self.spans, end, key=lambda span: span.begins)
        found, motion = self.spans[low:high], self.motion
        if motion is not None and motion.at <= end:
            last = max(motion.train.steps_by(end), motion.first - 1)
            found.append(Span(motion.at, end, motion.train, motion.first, last, motion.direction, motion.shaft))
        return found

    def before(self, at: Ns) -> tuple[int, int]:
        """The place, and the pulses given, when the last motion that ended before `at` had."""
        index = bisect_left(self.spans, at, key=lambda span: span.ends)
        if index:
            last = self.spans[index - 1]
            return last.shaft + last.direction * last.last, self.pulses + self._counts[index]
        return self.initial, self.pulses

    def cut(self, batch: int) -> None:
        """What batches from this one on brought has not happened."""
        self._again([told for told in self._told if told[0] < batch])

    def drop(self, batch: int) -> None:
        """Forget the motions that were over before this batch."""
        gone = [told for told in self._told if told[0] < batch]
        while gone and isinstance(gone[-1][1], MotionStarted):  # under way then
            gone.pop()
        if gone:
            kept = self._told[len(gone) :]
            self._again(gone)
            if self.spans:
                self.initial, self.pulses = self.before(self.spans[-1].ends + 1)
            self._again(kept)

    def _again(self, told: list[tuple[int, MotionEntry]]) -> None:
        self.spans, self.motion, self._told, self._counts = [], None, [], [0]
        for batch, entry in told:
            self.take(batch, entry)


class Unit:
    """What happened to one unit, by pin and axis."""

    def __init__(self, view: UnitView, straps: Mapping[str, Level]) -> None:
        self.view = view
        self.changes: dict[str, Changes] = {}
        powered = view.line_format is None  # a part without a line tells nothing of its supply
        self._straps = frozenset(straps)
        self._rests: dict[str, float] = {}  # outputs
        self._ports: dict[str, list[Spoken]] = {}  # characters that are not yet bits
        for pin in view.pins:
            if pin.kind is PinKind.SERIAL and view.line_format is not None:
                self._ports[pin.name] = []
            if pin.name == view.port.sends and pin.name in self._ports:
                self._rests[pin.name] = float(HIGH)
            elif pin.kind.drives and pin.kind is not PinKind.WINDING:
                self._rests[pin.name] = float(pin.rest)
            if pin.name in self._rests:
                self.changes[pin.name] = Changes(self._rests[pin.name] if powered else nan)
            elif pin.name in self._ports:
                self.changes[pin.name] = Changes(float(HIGH))
            elif pin.kind.reads:
                self.changes[pin.name] = Changes(float(straps.get(pin.name, pin.rest)))
        self.axes = {axis: Axis(view.shaft) for axis in view.axes}
        output = view.pulse_output
        self.clocks = frozenset(output.clocks) if output is not None else frozenset()
        self.logged = False  # step pulses are entries of their own, because a wire carries them
        self.refused: list[tuple[int, Refused]] = []

    def take(self, batch: int, entry: Entry) -> None:
        """One entry of the recording."""
        match entry:
            case PinSet(at, pin, level):
                self._change(pin, at, level, batch)
                output = self.view.pulse_output
                if output is not None and pin in self.clocks and level == output.active:
                    self.logged = True
            case InputSet(at, pin, level):
                if pin != self.view.port.receives:
                    self._change(pin, at, level, batch)
            case Sent() | Received():
                self._hear(batch, entry)
            case MotionStarted() | MotionCut() | MotionEnded() | Displaced():
                self.axes[entry.axis].take(batch, entry)
            case Powered(at, on):
                self._put_bits()
                for pin, rest in self._rests.items():
                    self.changes[pin].add(at, rest if on else nan, batch)
            case Refused():
                self.refused.append((batch, entry))

    def cut(self, batch: int) -> None:
        """What batches from this one on brought has not happened."""
        self._put_bits()
        for changes in self.changes.values():
            changes.cut(batch)
        for axis in self.axes.values():
            axis.cut(batch)
        self.refused = [told for told in self.refused if told[0] < batch]

    def drop(self, batch: int) -> None:
        """Forget what batches before this one brought."""
        self._put_bits()
        for changes in self.changes.values():
            changes.drop(batch)
        for axis in self.axes.values():
            axis.drop(batch)
        self.refused = [told for told in self.refused if told[0] >= batch]

    def _change(self, pin: str, at: Ns, level: float, batch: int) -> None:
        changes = self.changes.get(pin)
        if changes is None:
            changes = self.changes[pin] = Changes(nan)  # a winding to which a wire leads
        changes.add(at, level, batch)

    def _hear(self, batch: int, entry: Sent | Received) -> None:
        if entry.port in self._ports:
            begin, end = (entry.at, entry.done) if isinstance(entry, Sent) else (entry.began, entry.at)
            self._ports[entry.port].append(Spoken(begin, end, entry.char, batch))

    def straps(self, at: Ns) -> dict[str, Level]:
        """How its straps were tied at a time."""
        names = (pin.name for pin in self.view.pins if pin.kind is PinKind.STRAP or pin.name in self._straps)
        return {name: int(self.changes[name].value_at(at)) for name in names if name in self.changes}

    def levels(self, pin: str) -> Changes:
        """The changes of a pin, those of characters as their bits. KeyError for a pin that is not drawn."""
        if self._ports.get(pin):
            self._put_bits()
        return self.changes[pin]

    def _put_bits(self) -> None:
        for pin, spoken in self._ports.items():
            if spoken and self.view.line_format is not None:
                bits = serial_wave(spoken, self.view.line_format)
                self.changes[pin].extend(bits.times, bits.levels, bits.order)
                spoken.clear()


class Mirror:
    """Everything that an engine has told since it was opened."""

    def __init__(self, opened: Opened) -> None:
        self.views = list(opened.views)
        self.units = [Unit(view, opened.picture.units[view.name].straps) for view in self.views]
        self.by_name = {unit.view.name: unit for unit in self.units}
        room = MOST_ROWS // max(len(opened.picture.motors), 1)
        self.motors = {name: Rows(rotors.COLUMNS, room) for name in opened.picture.motors}
        self.actions: list[TimedAction] = []
        self.complete = True  # the actions are all there ever were
        self.loaded: dict[str, TimedAction] = {}  # the program that was last loaded, by unit
        self.until: Ns = 0  # of what is told
        self.cuts = 0
        self.said: list[tuple[int, Sent | Received]] = []  # every character, with the number of the unit
        self.said_gone = 0  # characters before the first of them
        self._said_in: list[int] = []  # the batch of each
        self._before: list[Batch] = []  # what still counts of what is forgotten
        self._batches: list[Batch] = []
        self._first = 0  # the number of the first of them
        self._sharing = Sharing()

    def take(self, happened: Happened) -> None:
        """More has happened."""
        same, count = self._sharing.same, len(happened.batches)
        for number, (unit, told) in enumerate(happened.batches, happened.first):
            taking = self.units[unit].take
            entries = same(told, count)
            self._batches.append((unit, entries))
            for entry in entries:
                taking(number, entry)
                if type(entry) is Sent or type(entry) is Received:
                    self.said.append((unit, entry))
                    self._said_in.append(number)
        self.actions += happened.actions
        self.loaded |= {action.what.unit: action for action in happened.actions if isinstance(action.what, Load)}
        if len(self.actions) > MOST_ACTIONS:
            self.actions, self.complete = [], False
        for motor, rows in happened.rotors.items():
            self.motors[motor].extend(rows)
        gone = happened.kept - self._first
        if gone > max(len(self._batches) // SLACK, 1000):
            self._forget(gone)

    def cut(self, cut: Cut) -> None:
        """The past was changed."""
        del self._batches[cut.batches - self._first :]
        if self.complete:
            del self.actions[cut.actions :]
        for unit in self.units:
            unit.cut(cut.batches)
        for rows in self.motors.values():
            rows.cut(cut.at)
        kept = bisect_left(self._said_in, cut.batches)
        del self.said[kept:], self._said_in[kept:]
        self.cuts += 1

    def recording(self) -> Recording:
        """The recording, as far as it is kept; a copy that nobody changes."""
        made = Recording([view.name for view in self.views])
        for unit, entries in (*self._before, *self._batches):
            made.extend(unit, entries)
        return made

    def signals(self) -> Signals:
        """All its signals."""
        return Signals(self.recording(), self.views, self.until)

    def _forget(self, gone: int) -> None:
        self._before = _condensed((*self._before, *self._batches[:gone]))
        del self._batches[:gone]
        self._first += gone
        for unit in self.units:
            unit.drop(self._first)
        past = bisect_left(self._said_in, self._first)
        del self.said[:past], self._said_in[:past]
        self.said_gone += past


def _condensed(batches: Iterable[Batch]) -> list[Batch]:
    """What still counts of these batches, in order."""
    counts: dict[tuple[object, ...], tuple[int, int, Entry]] = {}
    for order, (unit, entries) in enumerate(batches):
        for entry in entries:
            key = _about(entry)
            if key is not None:
                counts[unit, *key] = order, unit, entry
    kept = sorted(counts.values(), key=lambda each: each[0])
    return [(unit, (entry,)) for _, unit, entry in kept]


def _about(entry: Entry) -> tuple[object, ...] | None:
    """What an entry tells of: the next about the same makes it void. None if it is over with its own time."""
    match entry:
        case PinSet() | InputSet():
            return "pin", entry.pin
        case MotionStarted():
            return "begins", entry.axis
        case MotionCut() | MotionEnded():
            return "ends", entry.axis
        case DriveSet():
            return "drive", entry.connector
        case StageSet():
            return "stage", entry.axis
        case Powered():
            return ("power",)
    return None
