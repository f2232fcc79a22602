"""The parts of a cell and what joins them: what reaches whom in one instant.

What the parts did is delivered in rounds: those from which wires lead in the order of their names, so that the order in
the file changes no pulse; before them the others, in file order. Outputs are delivered in the order they were made, and
never merged; what a round causes is delivered in the next. More than `MOST_DELIVERIES` in one instant, and of
one cause, are an oscillation, and an error that names its pins.
"""

from collections import Counter
from collections.abc import Sequence

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.copying import duplicate
from detent.cell.outside import Outside
from detent.cell.overhearing import overhearing
from detent.cell.recording import InputSet, Received, Recording
from detent.cell.switches import CONTACT
from detent.cell.wiring import Wiring
from detent.controllers.device import Device, DriveSet, EdgeSensitive, Output, Powered, StageSet, StoreImage
from detent.lines.line import EVERYBODY, Arrival, Line
from detent.pins import HIGH, LOW, Level, Net, PinSet, find_pin
from detent.ticks import NEVER, Ns
from detent.uart import Char, Chars, Format, Sent, heard_as

MOST_DELIVERIES = 1_000


class Oscillation(RuntimeError):
    """Outputs change each other without end in one instant."""


class _Order(tuple[int, ...]):
    """Never changed, and shared by copies."""

    __slots__ = ()

    def __deepcopy__(self, _: object) -> "_Order":
        return self


class Circuit:
    """The parts of a cell, and the nets and lines that join them. `now` is set by who knows the time (`Cell`).

    Parts are meant by their index in `parts`, nets and lines by theirs.
    """

    def __init__(
        self, wiring: Wiring, parts: Sequence[Device], nets: Sequence[Net], lines: Sequence[Line],
        outside: Outside, recording: Recording | None,
    ) -> None:  # fmt: skip
        self.wiring = wiring
        self.parts = list(parts)
        self.nets = list(nets)
        self.lines = list(lines)
        self.now: Ns = 0
        self.latest: Ns = min((getattr(part, "latest", NEVER - 1) for part in parts), default=NEVER - 1)
        self.recording = recording
        self.outside = outside
        self.forced: dict[tuple[int, str], Level] = {}  # what inputs were given from outside
        self._built = wiring  # with the inputs that are stuck by now
        self.stuck: list[tuple[int, str]] = []  # inputs that read a level whatever they are given
        self.failing_writes: dict[int, tuple[str, int]] = {}  # by number: of whose memory, how many; -1: all
        self._supplied: set[int] = set()  # units that are switched on
        self._strange: dict[int, Format] = {}  # units that speak in another format than their line
        self._driving: set[tuple[int, str]] = set()  # outputs that drive their nets: the others let them float
        self.deadlines: list[Ns] = [NEVER] * len(parts)  # when each part is to be advanced next
        self.line_deadline: Ns = NEVER  # the earliest of all lines
        # by line: who need not hear what is for others; None where everybody hears everything
        self._overhearing = [overhearing(parts, units) for units in wiring.lines]
        self._turn_away = [named for named in self._overhearing if named is not None]
        self.stirred = False  # a part did something that is more than its own business; whoever looks puts it back
        self._touched: set[int] = set()
        self._instant: Ns = -1
        self._deliveries: Counter[tuple[int, str]] = Counter()  # of this instant, by part and pin
        self._delivered = 0  # how many these are
        wired = [(bool(drives), wiring.names[part] if drives else "") for part, drives in enumerate(wiring.drives)]
        order = sorted(range(len(parts)), key=wired.__getitem__)
        self.turn_of = _Order(map(order.index, range(len(parts))))  # whose turn it is in a round

    # -- time --------------------------------------------------------------------------------------------

    @property
    def inside(self) -> Sequence[object]:
        """What it keeps for itself, but for what happens within an instant."""
        return self._built, self._supplied, self._strange, self._driving, self._overhearing

    def next(self) -> Ns:
        """When something happens next by itself; NEVER: nothing is left to do."""
        at, line = min(self.deadlines), self.line_deadline
        return line if line < at else at

    def advance(self, at: Ns) -> None:
        """The deadlines of the parts that are due at `at`, which is now, and what follows from them."""
        deadlines = self.deadlines
        earliest = min(deadlines)
        if earliest > at:
            return
        if earliest == at and deadlines.count(at) == 1:  # nearly always
            index = deadlines.index(at)
            part = self.parts[index]
            following = part.advance(at)
            if following is None:
                following = part.next_deadline()
            deadlines[index] = NEVER if following is None else following
            if out := part.drain():
                self._deliver(index, out)
            if self._touched:
                self._settle()
            return
        units, contacts = self.wiring.units, False
        for index, deadline in enumerate(deadlines):
            if deadline <= at:
                if index < units:
                    self.parts[index].advance(at)
                    self._touched.add(index)
                else:
                    contacts = True
        self._settle()
        if contacts:  # a pulse that was held in this instant has crossed no switch
            for index in range(units, len(self.parts)):
                if self.deadlines[index] <= at:
                    self.parts[index].advance(at)
                    self._touched.add(index)
            self._settle()

    @property
    def parts_due(self) -> Ns:
        """When a part is to be advanced next."""
        return min(self.deadlines)

    # -- what reaches whom -------------------------------------------------------------------------------

    def settle(self, *parts: int) -> None:
        """Deliver what `parts` have done, and what follows."""
        self._touched.update(parts)
        self._settle()

    def _settle(self) -> None:
        """Deliver in rounds, until nobody has anything more to tell."""
        touched = self._touched
        while touched:
            if len(touched) == 1:  # nearly always
                index = touched.pop()
                if out := self._drain(index):
                    self._deliver(index, out)
            else:
                round_ = sorted(touched, key=self.turn_of.__getitem__)
                touched.clear()
                for index, out in [(index, self._drain(index)) for index in round_]:
                    if out:
                        self._deliver(index, out)

    def _drain(self, index: int) -> Sequence[Output]:
        """What a part did, and when it wants to be advanced next."""
        part = self.parts[index]
        for named in self._turn_away:
            if index in named.away:  # something was done to it
                named.call(index, self.parts)
        deadline = part.next_deadline()
        self.deadlines[index] = NEVER if deadline is None else deadline
        return part.drain()

    def _deliver(self, index: int, out: Sequence[Output]) -> None:
        """Give what a part did, which is something, to the recording and to whomever it leads to."""
        if self.recording is not None and index < self.wiring.units:
            self.recording.extend(index, out)
        drives = self.wiring.drives[index]
        for item in out:
            kind = type(item)
            if kind not in _LEADS_ON:
                continue
            if kind is PinSet:
                net = drives.get(item.pin)  # type: ignore[union-attr]
                if net is None:
                    continue
                driver = index, item.pin  # type: ignore[union-attr]
                begins = driver not in self._driving
                self._driving.add(driver)
                self._drive(net, driver, item.level, edge=not begins)  # type: ignore[union-attr]
            elif kind is Sent:
                place = self.wiring.speaks[index].get(item.port)  # type: ignore[union-attr]
                if place is not None:
                    line = self.lines[place[0]]
                    if index in self._strange:
                        item = _as_heard(item, self._strange[index], line.format)  # type: ignore[arg-type]
                    line.from_unit(place[1], item)  # type: ignore[arg-type]
                    if line.deadline < self.line_deadline:
                        self.line_deadline = line.deadline
            elif kind in _MOTION:
                for follower in self.wiring.followers[index]:
                    self.parts[follower].follow(item)  # type: ignore[attr-defined]
                    self._touched.add(follower)
            elif kind is DriveSet or kind is StageSet:
                for follower in self.wiring.followers[index]:
                    self.parts[follower].heed(item)  # type: ignore[attr-defined]
                    self._touched.add(follower)
            elif kind is StoreImage:
                name = self.wiring.names[index]
                ok = self._may_write(name) and self.outside.store(name, item.image)  # type: ignore[union-attr]
                self.parts[index].stored(ok, self.now)
                self._touched.add(index)
            elif kind is Powered:
                for follower in self.wiring.followers[index]:
                    self.parts[follower].heed(item)  # type: ignore[attr-defined]
                    self._touched.add(follower)
                if not item.on:  # type: ignore[union-attr]
                    for pin, net in drives.items():
                        self._driving.discard((index, pin))
                        self._drive(net, (index, pin), HIGH, edge=False)

            self.stirred = True

    def _may_write(self, unit: str) -> bool:
        """Whether a write of the unit's memory that is made now may succeed; a failure is counted."""
        for number, (whose, left) in self.failing_writes.items():
            if whose == unit and left:
                self.failing_writes[number] = whose, left - 1 if left > 0 else left
                return False
        return True

    def _drive(self, net: int, driver: tuple[int, str], level: Level, *, edge: bool = True) -> None:
        """An output puts a level on its net. That it begins to drive it, or lets go, is no edge."""
        wire = self.nets[net]
        if wire.drive(driver, level):
            for part, pin in self.wiring.reads[net]:
                self._set_pin(part, pin, wire.level, edge=edge)

    def _set_pin(self, index: int, pin: str, level: Level, *, edge: bool = True) -> None:
        if self._instant != self.now:
            self._instant = self.now
            self.another_cause()
        self._deliveries[index, pin] += 1
        self._delivered += 1
        if self._delivered > MOST_DELIVERIES:
            raise self._oscillation()
        if index < self.wiring.units and self.recording is not None:
            self.recording.extend(index, (InputSet(self.now, pin, level),))
        part = self.parts[index]
        if not edge and isinstance(part, EdgeSensitive):
            part.take_level(pin, level, self.now)
        else:
            part.set_pin(pin, level, self.now)
        self._touched.add(index)

    def another_cause(self) -> None:
        """What follows in this instant has a cause of its own, outside: its level changes are counted by themselves."""
        if self._delivered:
            self._deliveries.clear()
            self._delivered = 0

    def _oscillation(self) -> Oscillation:
        """The error that names the inputs which change without end, each with the outputs that drive it."""
        names = self.wiring.names
        loops: list[str] = []
        for part, pin in [where for where, count in self._deliveries.most_common(8) if count > 1]:
            name, net = f"{names[part]}.{pin}", self.net_read(part, pin)
            drivers = self.nets[net].levels if net is not None else ()
            driven = " and ".join(f"{names[driver]}.{output}" for driver, output in drivers)
            loops.append(f"{name} (driven by {driven})" if driven else name)
        return Oscillation(
            f"more than {MOST_DELIVERIES} level changes at {self.now} ns: {', '.join(loops)} change without end; "
            "break the loop or put something that takes time into it"
        )

    def _match_line(self, number: int) -> None:
        """The host of a line speaks as all its units are strapped to hear, from the moment one is switched on."""
        if number < 0:
            return
        line = self.lines[number]
        forms = {self.parts[unit].line_format for unit, _ in self.wiring.lines[number]}  # type: ignore[attr-defined]
        if len(forms) == 1 and line.format not in forms:
            line.change(forms.pop())
            self._plan_lines()
        for unit, _ in self.wiring.lines[number]:
            form = self.parts[unit].line_format  # type: ignore[attr-defined]
            if form == line.format or line.hosted:
                self._strange.pop(unit, None)
            else:
                self._strange[unit] = form

    def _plan_lines(self) -> None:
        earliest = NEVER
        for line in self.lines:
            if line.deadline < earliest:
                earliest = line.deadline
        self.line_deadline = earliest

    def hear(self, at: Ns) -> None:
        """Characters whose stop bits end now reach the units of their lines."""
        for number, line in enumerate(self.lines):
            if line.deadline > at:
                continue
            if line.strobe:
                for level in line.strobes(at):
                    for unit, _ in self.wiring.lines[number]:
                        self._set_pin(unit, line.strobe, level)
            arrived = line.advance(at)
            if line.started():
                for unit, port in self.wiring.lines[number]:
                    self.parts[unit].set_pin(port, LOW, at)
                    self._touched.add(unit)
            if arrived:
                self._arrive(arrived, number, at)
        self._plan_lines()
        if self._touched:
            self._settle()

    def _arrive(self, arrived: Sequence[Arrival], number: int, at: Ns) -> None:
        """Give what has arrived on a line to those units that it is for."""
        line, units = self.lines[number], self.wiring.lines[number]
        everybody = all(arrival.place == EVERYBODY for arrival in arrived)
        sent = [arrival.sent for arrival in arrived]
        strange, recording = self._strange, self.recording
        if everybody and not strange:
            if recording is not None:
                for unit, port in units:
                    recording.extend(unit, [Received(one.done, port, one.char, one.at) for one in sent])
            self._reach_all(number, [one.char for one in sent], at)
            return
        if (named := self._overhearing[number]) is not None:
            named.call_all(self.parts)
        for place, (unit, port) in enumerate(units):
            if not everybody:
                sent = [arrival.sent for arrival in arrived if arrival.place in (place, EVERYBODY)]
            as_heard = [_as_heard(one, line.format, strange[unit]) for one in sent] if unit in strange else sent
            if recording is not None and as_heard:
                recording.extend(unit, [Received(one.done, port, one.char, one.at) for one in as_heard])
            heard = [one.char for one in as_heard]
            if heard and self.parts[unit].receive(port, heard, at) is not False:
                self._touched.add(unit)

    def _reach_all(self, number: int, chars: Sequence[Char], at: Ns) -> None:
        """Give characters of one instant to all units of a line."""
        parts, touched, named = self.parts, self._touched, self._overhearing[number]
        if named is None:
            units = self.wiring.lines[number]
            touched.update([unit for unit, port in units if parts[unit].receive(port, chars, at) is not False])
            return
        skipped: list[tuple[int, str]] = []
        for place in named.calls(chars, parts):
            unit, port = place
            if parts[unit].receive(port, chars, at) is False:
                skipped.append(place)
            else:
                touched.add(unit)
        if skipped:
            named.turn_away(skipped, parts)

    # -- what the outside does to it ---------------------------------------------------------------------

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now; characters may be damaged already."""
        chars = self.lines[line].immediate(data)
        if not chars:
            self.lines[line].send(data, self.now)
            self._plan_lines()
            return
        if self.recording is not None:
            for unit, port in self.wiring.lines[line]:
                self.recording.extend(unit, [Received(self.now, port, char, self.now) for char in chars])
        self._reach_all(line, chars, self.now)  # nothing waits on such a line: what is sent is heard
        self._settle()

    def discard(self, line: int) -> None:
        """The host of a line takes back what it has not begun to send, now."""
        self.lines[line].discard()
        self._plan_lines()

    def force(self, part: int, pin: str, level: Level) -> None:
        """Give an input a level from outside, now, whatever its net is at."""
        self.forced[part, pin] = level
        if (part, pin) not in self.stuck:
            self._give(part, pin, level)

    def release(self, part: int, pin: str) -> None:
        """Leave an input that was forced to its net again, now; without a net it rests."""
        self.forced.pop((part, pin), None)
        if (part, pin) not in self.stuck:
            self._give(part, pin, self.given(part, pin))

    def supply(self, part: int, on: bool) -> None:
        """Switch the supply of a unit, now."""
        if on:
            self.supply_all([part])
            return
        self._supplied.discard(part)
        self.parts[part].power(False, self.now)
        self.settle(part)

    def supply_all(self, parts: Sequence[int]) -> None:
        """Switch on several units in one instant: each finds its inputs as all of them drive their wires at first."""
        for part in parts:
            if not self.supplied(part):
                self._put_first_levels(part)
        for part in parts:
            self._supplied.add(part)
            self.parts[part].power(True, self.now)
            self._touched.add(part)
            self._match_line(self.wiring.line_of[part])
        self._settle()

    def _put_first_levels(self, part: int) -> None:
        """Put on its nets what a unit without supply will drive them to: a twin of it is switched on to see that."""
        drives = self.wiring.drives[part]
        if not drives:
            return
        twin = duplicate(self.parts[part])
        twin.power(True, self.now)
        for item in twin.drain():
            if isinstance(item, PinSet) and item.pin in drives and (part, item.pin) not in self._driving:
                self._driving.add((part, item.pin))
                self._drive(drives[item.pin], (part, item.pin), item.level, edge=False)

    def supplied(self, part: int) -> bool:
        """Whether a unit is switched on."""
        return part in self._supplied

    # -- what breaks of it -------------------------------------------------------------------------------

    def stick(self, part: int, pin: str, level: Level) -> None:
        """Let an input read a level, now, whatever is wired to it or given to it."""
        self.stuck.append((part, pin))
        self._listen(self.net_read(part, pin))
        self._give(part, pin, level)

    def unstick(self, part: int, pin: str) -> None:
        """Let a stuck input read its net again, now."""
        self.stuck.remove((part, pin))
        self._listen(self.net_read(part, pin))
        self._give(part, pin, self.given(part, pin))

    def drive(self, net: int, driver: tuple[int, str], level: Level) -> None:
        """Put a level on a net, now."""
        self._drive(net, driver, level)
        self._settle()

    def spare_net(self) -> int:
        """A new net, to which nothing is joined."""
        self.nets.append(Net())
        self.wiring = self.wiring.with_net()
        return len(self.nets) - 1

    def lead(self, part: int, pin: str, net: int) -> None:
        """Let an output that drives a net drive another one."""
        self.wiring = self.wiring.led(part, pin, net)

    def exchange(self, line: int, other: Line) -> None:
        """Put another line in the place of a line."""
        self.lines[line] = other
        self._plan_lines()

    def _listen(self, net: int | None) -> None:
        """Let the inputs that are wired to a net read it, but for those that are stuck."""
        if net is not None:
            hearing = [reader for reader in self._built.reads[net] if reader not in self.stuck]
            self.wiring = self.wiring.heard_by(net, hearing)

    def _give(self, part: int, pin: str, level: Level) -> None:
        self._set_pin(part, pin, level)
        self._settle()

    def given(self, part: int, pin: str) -> Level:
        """The level that an input is given by its wire; without a wire, from outside; else its level at rest."""
        net = self.net_read(part, pin)
        if net is not None:
            return self.nets[net].level
        found = find_pin(self.parts[part].pins, pin)
        return self.forced.get((part, pin), HIGH if found is None else found.rest)

    # -- looking -----------------------------------------------------------------------------------------

    def net_driven(self, part: int, pin: str) -> int | None:
        """The net that an output drives, if a wire leads from it."""
        return self.wiring.drives[part].get(pin)

    def net_read(self, part: int, pin: str) -> int | None:
        """The net that an input is wired to, stuck or not."""
        return next((net for net, readers in enumerate(self._built.reads) if (part, pin) in readers), None)

    def contact(self, switch: str) -> tuple[int, str]:
        """The part and the pin that are the contact of a switch. Raises KeyError."""
        names, units = self.wiring.names, self.wiring.units
        for part in range(units, len(names)):
            if names[part] == switch and self.net_driven(part, CONTACT) is not None:
                return part, CONTACT
            if names[part] != switch and self.net_driven(part, switch) is not None:
                return part, switch  # a rotor moves it
        raise KeyError(f"no switch {switch!r} in this cell")


def _as_heard(sent: Sent, form: Format, read: Format) -> Sent:
    """A character as it is taken for one of another format: damaged, if not another."""
    heard = heard_as((sent.char,), form, read)
    return sent._replace(char=heard[0] if heard else sent.char._replace(framing_ok=False))


_MOTION = (MotionStarted, MotionCut, MotionEnded)
_LEADS_ON = frozenset((*_MOTION, PinSet, Sent, DriveSet, StageSet, StoreImage, Powered))  # to others, or to an answer
