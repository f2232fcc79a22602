"""The scheduler: who is due when, and what reaches whom.

Order within one instant (the contract of `controllers.device`): units that are due are advanced in file
order, switches after them; what they did is delivered in rounds, parts in file order, their outputs in the
order they were made and never merged; what a round causes is delivered in the next. More than
`MOST_DELIVERIES` in one instant is an oscillation, and an error that names its pins.
"""

import copy
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Protocol, TypeAlias

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.breakage import Fault, Faults, find_pin
from detent.cell.deeds import (
    Action,
    Break,
    Deed,
    Load,
    Mend,
    PlaceSwitch,
    Power,
    Release,
    Send,
    SetPin,
    SetSwitch,
    Start,
)
from detent.cell.recording import InputSet, Log, Received, Recording
from detent.controllers.device import Controller, Device, DriveSet, Output, Powered, StageSet, StoreImage
from detent.lines.line import EVERYBODY, Line
from detent.pins import HIGH, LOW, Level, Net, PinKind, PinSet
from detent.ticks import NEVER, Ns
from detent.uart import Chars, Sent

MOST_DELIVERIES = 1_000

Store: TypeAlias = Callable[[str, bytes], bool]
"""Write the non-volatile image of a unit; say whether that succeeded."""


class Oscillation(RuntimeError):
    """Outputs change each other without end in one instant."""


class Follower(Protocol):
    """A part that follows the axis of a unit: a switch at a position, a motor with its load."""

    def follow(self, motion: MotionStarted | MotionCut | MotionEnded) -> None:
        """The axis does this."""

    def heed(self, told: DriveSet | StageSet | Powered) -> None:
        """The power stage of the unit is commanded so, or its supply is switched."""


class Talker(Protocol):
    """A unit as its host sees it: a controller, or an adapter in front of others."""

    def frame(self, text: str) -> bytes:
        """The bytes a host sends for a command line."""

    def answers(self, data: bytes) -> list[str]:
        """What a host reads in the bytes that came back."""


class Wiring(NamedTuple):
    """What never changes in a cell: copied by reference. Parts are meant by their index in `Cell.parts`."""

    names: tuple[str, ...]  # of all parts
    units: int  # the first so many parts are units: recorded, powered, on lines
    drives: tuple[Mapping[str, int], ...]  # part -> pin -> net
    reads: tuple[tuple[tuple[int, str], ...], ...]  # net -> (part, pin)
    followers: tuple[tuple[int, ...], ...]  # part -> parts that follow its axis
    lines: tuple[tuple[tuple[int, str], ...], ...]  # line -> units on it, each with the port it hears on
    line_names: tuple[str, ...]
    line_of: tuple[int, ...]  # unit -> line of its host; -1: none
    speaks: tuple[Mapping[str, tuple[int, int]], ...]  # unit -> port it sends from -> line, place on the line

    def __deepcopy__(self, _: object) -> "Wiring":
        return self


class Outside(NamedTuple):
    """What a cell reaches for outside: its copies reach for the same."""

    store: Store

    def __deepcopy__(self, _: object) -> "Outside":
        return self


class Script(tuple[Action, ...]):
    """Actions in order of time. Immutable, and shared by copies of a cell."""

    __slots__ = ()

    def __deepcopy__(self, _: object) -> "Script":
        return self


def no_store(unit: str, image: bytes) -> bool:
    """Images stay in the units' own memory: what a cell does that nobody gave a place for files."""
    return True


class Cell:
    """Everything in one virtual time. Made by `detent.cell.build`."""

    def __init__(
        self,
        wiring: Wiring,
        parts: Sequence[Device],
        nets: Sequence[Net],
        lines: Sequence[Line],
        script: Sequence[Action] = (),
        *,
        store: Store = no_store,
        record: bool = True,
    ) -> None:
        self.wiring = wiring
        self.parts = list(parts)
        self.nets = list(nets)
        self.lines = list(lines)
        self.now: Ns = 0
        self._outside = Outside(store)
        self.recording: Recording | None = Recording(wiring.names[: wiring.units]) if record else None
        self.journal: Log[Action] = Log()  # what was done from outside, if the cell records: see `replay`
        self.journaling = False  # see `begin`
        self._script = Script(sorted(script, key=lambda action: action.at))
        self._next_action = 0
        self._acting = True  # it is being built, or the script is doing it
        self.faults = Faults()
        self._hands: dict[tuple[int, str], Level] = {}  # what inputs were given from outside
        self._supplied: set[int] = set()  # units that are switched on
        self._deadlines: list[Ns] = [NEVER] * len(parts)
        self._line_deadline: Ns = NEVER  # the earliest of all lines
        self._script_deadline: Ns = self._script[0].at if self._script else NEVER
        self._touched: set[int] = set()
        self._instant: Ns = -1
        self._deliveries: Counter[str] = Counter()  # of this instant, by pin

    def begin(self, *, journaling: bool) -> None:
        """It is built: what is done to it from now on comes from outside. Its journal has all of it, or nothing."""
        self._acting, self.journaling = False, journaling

    # -- time --------------------------------------------------------------------------------------------

    def next_event(self) -> Ns | None:
        """When something happens next by itself; None: nothing is left to do."""
        at = self._next()
        return None if at >= NEVER else at

    def run_to(self, until: Ns) -> None:
        """Let everything happen up to and including `until`; then it is `until`."""
        while (at := self._next()) <= until:
            self._advance(at)
        self.now = max(self.now, until)

    def step(self) -> Ns | None:
        """Let everything of the next eventful instant happen; return it, None if nothing is left to do."""
        at = self.next_event()
        if at is not None:
            self._advance(at)
        return at

    def _next(self) -> Ns:
        at = min(self._deadlines)
        if self._line_deadline < at:
            at = self._line_deadline
        return self._script_deadline if self._script_deadline < at else at

    def _advance(self, at: Ns) -> None:
        """One instant: the parts' own deadlines, then pins and power, then characters."""
        self.now = at
        units, contacts = self.wiring.units, False
        for index, deadline in enumerate(self._deadlines):
            if deadline <= at:
                if index < units:
                    self.parts[index].advance(at)
                    self._touched.add(index)
                else:
                    contacts = True
        self._settle()
        if contacts:  # a pulse that was held in this instant has crossed no switch
            for index in range(units, len(self.parts)):
                if self._deadlines[index] <= at:
                    self.parts[index].advance(at)
                    self._touched.add(index)
            self._settle()
        if self._script_deadline <= at:
            self._act(at)
        if self._line_deadline <= at:
            self._hear(at)

    # -- what the outside does ---------------------------------------------------------------------------

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now; characters may be damaged already."""
        if not self._acting:
            self._catch_up()
            self._keep(Send(line, data if isinstance(data, bytes) else tuple(data)))
        chars = self.lines[line].immediate(data)
        if chars:  # nothing waits on such a line: what is sent is heard
            for unit, port in self.wiring.lines[line]:
                if self.recording is not None:
                    self.recording.extend(unit, [Received(self.now, port, char, self.now) for char in chars])
                self.parts[unit].receive(port, chars, self.now)
                self._touched.add(unit)
            self._settle()
        else:
            self.lines[line].send(data, self.now)
            self._plan_lines()
        self._catch_up()

    def type(self, unit: str, text: str) -> None:
        """The host of the unit's line sends the command line `text` to that unit, now."""
        index = self.unit(unit)
        line = self.wiring.line_of[index]
        if line < 0:
            raise ValueError(f"unit {unit!r} is on no line")
        self.send(line, self.talker(unit).frame(text))

    def set_pin(self, unit: str, pin: str, level: Level) -> None:
        """Drive an input pin from outside, now: a hand with a wire. Other drivers of its net are not asked.

        It stays so until the wire changes, or `release`.
        """
        index = self.unit(unit)
        if not self._acting:
            self._catch_up()
            self._keep(SetPin(unit, pin, level))
        self._hands[index, pin] = level
        if not self.faults.holds(index, pin):
            self.give(index, pin, level)

    def release(self, unit: str, pin: str) -> None:
        """Leave an input that was driven from outside to its wire again, now; without a wire it rests.

        Raises ValueError for a strap without a wire: how it was tied is not known here.
        """
        index = self.unit(unit)
        found = find_pin(self.parts[index].pins, pin)
        if found is not None and found.kind is PinKind.STRAP and self.net_read(index, pin) is None:
            raise ValueError(f"{unit}.{pin} is a strap: set it to the level that it is tied to")
        if not self._acting:
            self._catch_up()
            self._keep(Release(unit, pin))
        self._hands.pop((index, pin), None)
        if not self.faults.holds(index, pin):
            self.give(index, pin, self.given(index, pin))

    def set_switch(self, name: str, level: Level) -> None:
        """Put a switch of the cell to `level`, now."""
        if not self._acting:
            self._catch_up()
            self._keep(SetSwitch(name, level))
        index = self.wiring.names.index(name, self.wiring.units)
        self.parts[index].set_pin("SET", level, self.now)
        self._touched.add(index)
        self._settle()

    def power(self, unit: str, on: bool) -> None:
        """Switch the supply of a unit, now."""
        index = self.unit(unit)
        if not self._acting:
            self._catch_up()
            self._keep(Power(unit, on))
        self.supply(index, on)

    def switch_on(self, part: int) -> None:
        """Let a part that is no unit (a contact) tell its level, now."""
        self.parts[part].power(True, self.now)
        self._touched.add(part)
        self._settle()

    def load(self, unit: str, image: bytes, base: int) -> None:
        """Put a program into the unit's memory from address `base` on, now. Raises ImageError."""
        if not self._acting:
            self._catch_up()
        self.controller(unit).load(image, base, self.now)
        self._keep(Load(unit, image, base))
        self._touched.add(self.unit(unit))
        self._settle()

    def place_switch(self, name: str, low: float | None, high: float | None) -> None:
        """Put a switch elsewhere on its axis, now: places as in a cell file. Raises KeyError, ValueError."""
        index = self._part_with_contact(name)
        if not self._acting:
            self._catch_up()
        self.parts[index].move_contact(name, low, high, self.now)  # type: ignore[attr-defined]
        self._keep(PlaceSwitch(name, low, high))
        self._touched.add(index)
        self._settle()

    def start(self, unit: str) -> None:
        """Start the program in the unit's memory, now."""
        if not self._acting:
            self._catch_up()
            self._keep(Start(unit))
        self.controller(unit).start(self.now)
        self._touched.add(self.unit(unit))
        self._settle()

    def breaks(self, fault: Fault, lasting: Ns | None = None) -> int:
        """Something breaks, now, for a time or until `mend`; the number of the fault.

        Raises ValueError or KeyError, with a remedy, for what cannot break so.
        """
        if not self._acting:
            self._catch_up()
        number = self.faults.begin(self, fault, lasting)
        if lasting is not None:
            self._schedule(Action(self.now + lasting, Mend(number)))
        self._keep(Break(fault, lasting))
        return number

    def mend(self, fault: int) -> None:
        """The fault of this number is mended, now, if it is not already. Raises KeyError for a number never given."""
        if not self._acting:
            self._catch_up()
        self.faults.mend(self, fault)
        self._keep(Mend(fault))

    def _keep(self, deed: Deed) -> None:
        """Note what is done from outside; it is done when everything else of this instant has happened."""
        if self.journaling and not self._acting:
            self.journal.append(Action(self.now, deed, True))

    def _schedule(self, action: Action) -> None:
        """Put an action that is to come into the script, before those of the same time."""
        left = self._script[self._next_action :]
        place = bisect_left(left, action.at, key=lambda other: other.at)
        self._script, self._next_action = Script((*left[:place], action, *left[place:])), 0
        self._script_deadline = self._script[0].at

    # -- what faults do to it ----------------------------------------------------------------------------

    def supply(self, part: int, on: bool) -> None:
        """Switch the supply of a unit, now."""
        if on:
            self._supplied.add(part)
        else:
            self._supplied.discard(part)
        self.parts[part].power(on, self.now)
        self._touched.add(part)
        if on:
            self._match_line(self.wiring.line_of[part])
        self._settle()

    def supplied(self, part: int) -> bool:
        """Whether a unit is switched on."""
        return part in self._supplied

    def give(self, part: int, pin: str, level: Level) -> None:
        """Give an input a level, now."""
        self._set_pin(part, pin, level)
        self._settle()

    def given(self, part: int, pin: str) -> Level:
        """The level that an input is given by its wire; without a wire, by a hand; else its level at rest."""
        net = self.net_read(part, pin)
        if net is not None:
            return self.nets[net].level
        found = find_pin(self.parts[part].pins, pin)
        return self._hands.get((part, pin), HIGH if found is None else found.rest)

    def drive(self, net: int, driver: tuple[int, str], level: Level) -> None:
        """Put a level on a net, now."""
        self._drive(net, driver, level)
        self._settle()

    def net_driven(self, part: int, pin: str) -> int | None:
        """The net that an output drives, if a wire leads from it."""
        return self.wiring.drives[part].get(pin)

    def net_read(self, part: int, pin: str) -> int | None:
        """The net that an input is wired to, stuck or not."""
        reader = part, pin
        for net, readers in enumerate(self.wiring.reads):
            if reader in readers or reader in self.faults.readers(net):
                return net
        return None

    def spare_net(self) -> int:
        """A new net, to which nothing is joined."""
        self.nets.append(Net())
        self.wiring = self.wiring._replace(reads=(*self.wiring.reads, ()))
        return len(self.nets) - 1

    def lead(self, part: int, pin: str, net: int) -> None:
        """Let an output that drives a net drive another one."""
        drives = list(self.wiring.drives)
        drives[part] = {**drives[part], pin: net}
        self.wiring = self.wiring._replace(drives=tuple(drives))

    def listen(self, net: int, pins: Sequence[tuple[int, str]]) -> None:
        """Let these inputs, and no others, read a net."""
        reads = list(self.wiring.reads)
        reads[net] = tuple(pins)
        self.wiring = self.wiring._replace(reads=tuple(reads))

    def exchange(self, line: int, other: Line) -> None:
        """Put another line in the place of a line."""
        self.lines[line] = other
        self._plan_lines()

    # -- looking -----------------------------------------------------------------------------------------

    @property
    def hands(self) -> Mapping[tuple[int, str], Level]:
        """The inputs that are given a level from outside, by unit and pin."""
        return self._hands

    def unit(self, name: str) -> int:
        """The index of a unit. Raises KeyError."""
        try:
            return self.wiring.names.index(name, 0, self.wiring.units)
        except ValueError:
            raise KeyError(f"no unit {name!r} in this cell") from None

    def controller(self, name: str) -> Controller:
        """The controller of that name. Raises KeyError, TypeError if the unit is none."""
        part = self.parts[self.unit(name)]
        if not hasattr(part, "status"):
            raise TypeError(f"unit {name!r} is not a controller")
        return part  # type: ignore[return-value]

    def talker(self, name: str) -> Talker:
        """The controller or adapter of that name. Raises KeyError, TypeError if it has no serial port."""
        part = self.parts[self.unit(name)]
        if not hasattr(part, "frame"):
            raise TypeError(f"unit {name!r} has no serial port")
        return part  # type: ignore[return-value]

    def talkers(self) -> list[str]:
        """The units to which a host outside can speak, in file order."""
        return [name for name, line in zip(self.wiring.names, self.wiring.line_of, strict=False) if line >= 0]

    def controllers(self) -> dict[str, Controller]:
        """All controllers by name, in file order."""
        names = self.wiring.names[: self.wiring.units]
        return {name: self.controller(name) for i, name in enumerate(names) if hasattr(self.parts[i], "status")}

    def copy(self) -> "Cell":
        """An independent cell that goes on exactly as this one would."""
        return copy.deepcopy(self)

    # -- what reaches whom -------------------------------------------------------------------------------

    def _settle(self) -> None:
        """Deliver in rounds until nobody has anything more to tell."""
        touched = self._touched
        while touched:
            if len(touched) == 1:  # nearly always
                index = touched.pop()
                self._deliver(index, self._drain(index))
            else:
                round_ = sorted(touched)
                touched.clear()
                for index, out in [(index, self._drain(index)) for index in round_]:
                    self._deliver(index, out)

    def _drain(self, index: int) -> Sequence[Output]:
        """What a part did, and when it wants to be advanced next."""
        part = self.parts[index]
        deadline = part.next_deadline()
        self._deadlines[index] = NEVER if deadline is None else deadline
        return part.drain()

    def _deliver(self, index: int, out: Sequence[Output]) -> None:
        if not out:
            return
        if index < self.wiring.units and self.recording is not None:
            self.recording.extend(index, out)
        drives = self.wiring.drives[index]
        for item in out:
            kind = type(item)
            if kind is PinSet:
                net = drives.get(item.pin)  # type: ignore[union-attr]
                if net is not None:
                    self._drive(net, (index, item.pin), item.level)  # type: ignore[union-attr]
            elif kind is Sent:
                place = self.wiring.speaks[index].get(item.port)  # type: ignore[union-attr]
                if place is not None:
                    line = self.lines[place[0]]
                    line.from_unit(place[1], item)  # type: ignore[arg-type]
                    if line.deadline < self._line_deadline:
                        self._line_deadline = line.deadline
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
                ok = self.faults.writable(name) and self._outside.store(name, item.image)  # type: ignore[union-attr]
                self.parts[index].stored(ok, self.now)
                self._touched.add(index)
            elif kind is Powered:
                for follower in self.wiring.followers[index]:
                    self.parts[follower].heed(item)  # type: ignore[attr-defined]
                    self._touched.add(follower)
                if not item.on:  # type: ignore[union-attr]
                    for pin, net in drives.items():
                        self._drive(net, (index, pin), HIGH)

    def _drive(self, net: int, driver: tuple[int, str], level: Level) -> None:
        wire = self.nets[net]
        if wire.drive(driver, level):
            for part, pin in self.wiring.reads[net]:
                self._set_pin(part, pin, wire.level)

    def _set_pin(self, index: int, pin: str, level: Level) -> None:
        if self._instant != self.now:
            self._instant = self.now
            self._deliveries.clear()
        name = f"{self.wiring.names[index]}.{pin}"
        self._deliveries[name] += 1
        if self._deliveries.total() > MOST_DELIVERIES:
            pins = ", ".join(pin for pin, count in self._deliveries.most_common(8) if count > 1)
            raise Oscillation(
                f"more than {MOST_DELIVERIES} level changes at {self.now} ns: {pins} change each other without end; "
                "break the loop or put something that takes time into it"
            )
        if index < self.wiring.units and self.recording is not None:
            self.recording.extend(index, (InputSet(self.now, pin, level),))
        self.parts[index].set_pin(pin, level, self.now)
        self._touched.add(index)

    def _match_line(self, number: int) -> None:
        """The host of a line speaks as all its units are strapped to hear, from the moment one is switched on."""
        if number < 0:
            return
        line = self.lines[number]
        forms = {self.parts[unit].line_format for unit, _ in self.wiring.lines[number]}  # type: ignore[attr-defined]
        if len(forms) == 1 and line.format not in forms:
            line.change(forms.pop())
            self._plan_lines()

    def _part_with_contact(self, name: str) -> int:
        """The part that the switch `name` on an axis belongs to: itself, or the motor that moves it."""
        for index in range(self.wiring.units, len(self.parts)):
            if name in getattr(self.parts[index], "contact_names", (self.wiring.names[index],)):
                if hasattr(self.parts[index], "move_contact"):
                    return index
                raise ValueError(f"switch {name!r} is on no axis: it has no place")
        raise KeyError(f"no switch {name!r} in this cell")

    def _plan_lines(self) -> None:
        earliest = NEVER
        for line in self.lines:
            if line.deadline < earliest:
                earliest = line.deadline
        self._line_deadline = earliest

    def _hear(self, at: Ns) -> None:
        """Characters whose stop bits end now reach the units of their lines."""
        for line, units in zip(self.lines, self.wiring.lines, strict=True):
            if line.deadline > at:
                continue
            for level in line.strobes(at):
                for unit, _ in units:
                    self._set_pin(unit, line.strobe, level)
            arrived = line.advance(at)
            if line.started():
                for unit, port in units:
                    self.parts[unit].set_pin(port, LOW, at)
                    self._touched.add(unit)
            places = {arrival.place for arrival in arrived}
            if not places:
                continue
            heard = [arrival.sent for arrival in arrived]
            chars = [sent.char for sent in heard]
            for place, (unit, port) in enumerate(units):
                if places != _ALL:  # not everything is for everybody
                    heard = [arrival.sent for arrival in arrived if arrival.place in (place, EVERYBODY)]
                    chars = [sent.char for sent in heard]
                if chars:
                    if self.recording is not None:
                        self.recording.extend(unit, [Received(s.done, port, s.char, s.at) for s in heard])
                    self.parts[unit].receive(port, chars, at)
                    self._touched.add(unit)
        self._plan_lines()
        self._settle()

    def _act(self, at: Ns) -> None:
        """Carry out the script's actions that are due."""
        while self._next_action < len(self._script) and self._script[self._next_action].at <= at:
            action = self._script[self._next_action]
            if action.outside and (min(self._deadlines) <= at or self._line_deadline <= at):
                return  # the rest of this instant comes before it
            self._next_action += 1
            self._acting = True
            action.deed.do(self)
            self._acting = False
        left = self._script[self._next_action :]
        self._script_deadline = left[0].at if left else NEVER

    def _catch_up(self) -> None:
        """What an action from outside makes due in this very instant happens in it."""
        now = self.now
        while self._next() <= now:
            self._advance(now)


_ALL = {EVERYBODY}
_MOTION = (MotionStarted, MotionCut, MotionEnded)
