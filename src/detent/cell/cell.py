"""The scheduler: who is due when, and what is done to the cell from outside.

Order within one instant (the contract of `controllers.device`): units that are due are advanced in file order, switches
after them; then what they did is delivered (`cell.circuit`).
"""

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence

from detent.cell import idling
from detent.cell.actions import (
    Action,
    Break,
    Discard,
    Displace,
    Halt,
    Load,
    Mend,
    PlaceSwitch,
    Power,
    Release,
    Send,
    SetPin,
    SetSwitch,
    Start,
    TimedAction,
    Type,
)
from detent.cell.breakage import Breakage
from detent.cell.circuit import Circuit
from detent.cell.copying import duplicate
from detent.cell.cycles import Cycles
from detent.cell.faults import Fault
from detent.cell.outside import Outside, Store, Typed, no_store, nobody_asks
from detent.cell.recording import Log, Recording
from detent.cell.wiring import SerialUnit, Wiring
from detent.controllers.device import Controller, Device
from detent.lines.line import Line
from detent.pins import Level, Net, PinKind, find_pin
from detent.ticks import NEVER, Ns, show_duration
from detent.uart import Chars


class Script(tuple[TimedAction, ...]):
    """Actions in order of time. Immutable, and shared by copies of a cell."""

    __slots__ = ()

    def __deepcopy__(self, _: object) -> "Script":
        return self


def _switches_on(action: TimedAction) -> bool:
    """Whether the script switches a unit on."""
    return isinstance(action.what, Power) and action.what.on and not action.outside


class Cell:
    """Everything in one virtual time. Made by `detent.cell.build`.

    It knows the time, the script and what is done from outside; `circuit` are its parts and what joins them, `faults`
    what is broken of them.
    """

    def __init__(
        self,
        wiring: Wiring,
        parts: Sequence[Device],
        nets: Sequence[Net],
        lines: Sequence[Line],
        script: Sequence[TimedAction] = (),
        *,
        store: Store = no_store,
        record: bool = True,
        typed: Typed = nobody_asks,
    ) -> None:
        recording = Recording(wiring.names[: wiring.units]) if record else None
        self.circuit = Circuit(wiring, parts, nets, lines, Outside(store, typed), recording)
        self.faults = Breakage(self.circuit)
        self.journal: Log[TimedAction] = Log()  # what was done from outside, if it records: `build` takes it
        self.journaling = False  # see `begin`
        self._script = Script(sorted(script, key=lambda action: action.at))
        self._next_action = 0
        self._acting = True  # it is being built, or the script is doing it
        self._script_deadline: Ns = NEVER
        self._note_next_action()

    def begin(self, *, journaling: bool) -> None:
        """It is built: what is done to it from now on comes from outside. Its journal has all of it, or nothing."""
        self._acting, self.journaling = False, journaling

    # -- time --------------------------------------------------------------------------------------------

    def next_event(self) -> Ns | None:
        """When something happens next by itself; None: nothing is left to do."""
        at = self._next()
        return None if at >= NEVER else at

    def run_to(self, until: Ns) -> None:
        """Let everything happen up to and including `until`; then it is `until`.

        ValueError for a time that this cell cannot reach: beyond `latest`.
        """
        if until > self.latest:
            raise ValueError(f"this cell runs to {show_duration(self.latest)} at most, and not to {until} ns")
        instants, look, most = 0, idling.FIRST, idling.LEAST
        cycles: Cycles | None = None  # looked for when some instants have been run through
        longest, before = NEVER, self.now
        try:
            while (at := self._next()) <= until:
                if at - before >= longest:
                    assert cycles is not None
                    passed = cycles.meet(at - before, until + 1, self._script_deadline)
                    longest = cycles.longest
                    if passed:
                        before = self.now
                        continue
                self._advance(at)
                before = at
                instants += 1
                if instants == look:
                    if cycles is None:
                        cycles = Cycles(self.circuit)
                    cycles.passed(instants)
                    instants, (look, most) = 0, self._look_for_loops(until, most, cycles)
                    longest = cycles.longest
        finally:
            if cycles is not None:
                cycles.close()
        self.circuit.now = max(self.now, until)

    def _look_for_loops(self, until: Ns, most: int, cycles: Cycles) -> tuple[int, int]:
        """Pass over programs that turn in loops of at most `most` instants; when to look again, and for which."""
        circuit = self.circuit
        stirred, circuit.stirred = circuit.stirred, False
        if stirred:
            return idling.FIRST, idling.LEAST
        cycles.again()  # nothing stirs: what there is to be passed over are programs in loops
        if idling.pass_over(circuit, min(until, self._script_deadline), most):
            return idling.FIRST, idling.LEAST
        most = min(2 * most, idling.MOST)
        return most * idling.PATIENCE, most

    def step(self) -> Ns | None:
        """Let everything of the next eventful instant happen; return it, None if nothing is left to do."""
        at = self.next_event()
        if at is not None:
            self._advance(at)
        return at

    def _next(self) -> Ns:
        circuit = self.circuit
        return min(min(circuit.deadlines), circuit.line_deadline, self._script_deadline)  # nothing is asked more often

    def _advance(self, at: Ns) -> None:
        """One instant: the parts' own deadlines, then pins and power, then characters."""
        circuit = self.circuit
        circuit.now = at
        circuit.advance(at)
        if self._script_deadline <= at:
            self._act(at)
        if circuit.line_deadline <= at:
            circuit.hear(at)

    def _act(self, at: Ns) -> None:
        """Carry out the script's actions that are due; what one makes due in the parts comes before the next."""
        while self._script_deadline <= at:
            action = self._script[self._next_action]
            if action.outside and self.circuit.next() <= at:
                return  # the rest of this instant comes before it
            self._next_action += 1
            self._note_next_action()
            self._acting = True
            self.circuit.another_cause()
            if _switches_on(action):
                names = self._switched_on_with(action)
                self.circuit.supply_all([self.unit(name) for name in names if not self.faults.switches(name, True)])
            else:
                self.do(action.what)
            self._acting = False
            while self.circuit.parts_due <= at:
                self.circuit.advance(at)

    def _switched_on_with(self, action: TimedAction) -> list[str]:
        """The units that the script switches on in one go: that of `action`, and those of the actions behind it."""
        units = [action.what.unit]  # type: ignore[union-attr]
        while self._next_action < len(self._script):
            following = self._script[self._next_action]
            if following.at != action.at or not _switches_on(following):
                break
            units.append(following.what.unit)  # type: ignore[union-attr]
            self._next_action += 1
            self._note_next_action()
        return units

    def _note_next_action(self) -> None:
        left = self._next_action < len(self._script)
        self._script_deadline = self._script[self._next_action].at if left else NEVER

    def _catch_up(self) -> None:
        """What an action from outside makes due in this very instant happens in it."""
        self.circuit.another_cause()
        now = self.now
        while self._next() <= now:
            self._advance(now)

    # -- what the outside does ---------------------------------------------------------------------------

    def do(self, action: Action) -> None:
        """Do what is kept as data, now. Raises what the method of that name raises."""
        match action:
            case Send(line, data):
                self.send(line, data)
            case Discard(line):
                self.discard(line)
            case Type(unit, text):
                self.type(unit, text)
            case SetSwitch(switch, level):
                self.set_switch(switch, level)
            case SetPin(unit, pin, level):
                self.set_pin(unit, pin, level)
            case Release(unit, pin):
                self.release(unit, pin)
            case Power(unit, on):
                self.power(unit, on)
            case Load(unit, image, base):
                self.load(unit, image, base)
            case PlaceSwitch(switch, low, high):
                self.place_switch(switch, low, high)
            case Start(unit):
                self.start(unit)
            case Halt(unit):
                self.halt(unit)
            case Displace(unit, axis, by):
                self.displace(unit, axis, by)
            case Break(fault, lasting):
                self.breaks(fault, lasting)
            case Mend(fault):
                self.mend(fault)

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now; characters may be damaged already. Raises ValueError without a host."""
        if self._line(line).hosted:
            raise ValueError("the host of this line is a unit of the cell: send to that unit")
        if not self._acting:
            self._catch_up()
            if self.journaling:
                self._keep(Send(line, data if isinstance(data, bytes) else tuple(data)))
        self.circuit.send(line, data)
        if not self._acting:
            self._catch_up()

    def discard(self, line: int) -> None:
        """The host of a line takes back what it has not begun to send, now; a character that has begun goes on."""
        self._line(line)
        if not self._acting:
            self._catch_up()
            self._keep(Discard(line))
        self.circuit.discard(line)

    def type(self, unit: str, text: str) -> None:
        """The host of the unit's line sends the command line `text` to that unit, now."""
        line = self.hosted_line(unit)
        if not self._acting:
            self._catch_up()
        data = self.serial_unit(unit).frame(text)
        self.circuit.outside.typed(unit, text)
        self.send(line, data)

    def hosted_line(self, unit: str) -> int:
        """The line of a unit, which has a host outside. Raises KeyError, ValueError without one."""
        line = self.wiring.line_of[self.unit(unit)]
        if line < 0:
            raise ValueError(f"unit {unit!r} is on no line with a host outside: a unit that is its host can send to it")
        return line

    def set_pin(self, unit: str, pin: str, level: Level) -> None:
        """Drive an input pin from outside, now: a hand with a wire. Other drivers of its net are not asked.

        It stays so until the wire changes, or `release`. Raises KeyError, ValueError for what is no input.
        """
        index = self._input(unit, pin)
        if not self._acting:
            self._catch_up()
            self._keep(SetPin(unit, pin, level))
        self.circuit.force(index, pin, level)

    def release(self, unit: str, pin: str) -> None:
        """Leave an input that was driven from outside to its wire again, now; without a wire it rests.

        Raises ValueError for a strap without a wire: how it was tied is not known here; and as `set_pin` does.
        """
        index = self._input(unit, pin)
        found = find_pin(self.parts[index].pins, pin)
        if found is not None and found.kind is PinKind.STRAP and self.circuit.net_read(index, pin) is None:
            raise ValueError(f"{unit}.{pin} is a strap: set it to the level that it is tied to")
        if not self._acting:
            self._catch_up()
            self._keep(Release(unit, pin))
        self.circuit.release(index, pin)

    def set_switch(self, name: str, level: Level) -> None:
        """Put a switch of the cell to `level`, now. Raises KeyError."""
        if name not in self.wiring.names[self.wiring.units :]:
            raise KeyError(f"no switch {name!r} in this cell")
        index = self.wiring.names.index(name, self.wiring.units)
        if not self._acting:
            self._catch_up()
            self._keep(SetSwitch(name, level))
        self.parts[index].set_pin("SET", level, self.now)
        self.circuit.settle(index)

    def power(self, unit: str, on: bool) -> None:
        """Switch the supply of a unit, now."""
        index = self.unit(unit)
        if not self._acting:
            self._catch_up()
            self._keep(Power(unit, on))
        if not self.faults.switches(unit, on):
            self.circuit.supply(index, on)

    def switch_on(self, part: int) -> None:
        """Let a part that is no unit (a contact) tell its level, now."""
        self.parts[part].power(True, self.now)
        self.circuit.settle(part)

    def load(self, unit: str, image: bytes, base: int) -> None:
        """Put a program into the unit's memory from address `base` on, now. Raises ImageError."""
        if not self._acting:
            self._catch_up()
        self.controller(unit).load(image, base, self.now)
        self._keep(Load(unit, image, base))
        self.circuit.settle(self.unit(unit))

    def place_switch(self, name: str, low: float | None, high: float | None) -> None:
        """Put a switch elsewhere on its axis, now: places as in a cell file. Raises KeyError, ValueError."""
        index = self._part_with_contact(name)
        if not self._acting:
            self._catch_up()
        self.parts[index].move_contact(name, low, high, self.now)  # type: ignore[attr-defined]
        self._keep(PlaceSwitch(name, low, high))
        self.circuit.settle(index)

    def start(self, unit: str) -> None:
        """Start the program in the unit's memory, now. Raises KeyError, TypeError."""
        if not self._acting:
            self._catch_up()
        self.controller(unit).start(self.now)
        self._keep(Start(unit))
        self.circuit.settle(self.unit(unit))

    def start_all(self, units: Iterable[str]) -> None:
        """Start the programs of several units in one instant: each finds its inputs as they were before."""
        started = list(units)
        for unit in started:
            self.controller(unit).start(self.now)
        self.circuit.settle(*map(self.unit, started))

    def halt(self, unit: str) -> None:
        """Stop all axes of a unit at once, and its program, now. Raises KeyError, TypeError."""
        if not self._acting:
            self._catch_up()
        self.controller(unit).halt(self.now)
        self._keep(Halt(unit))
        self.circuit.settle(self.unit(unit))
        self._catch_up()

    def displace(self, unit: str, axis: str, by: int) -> None:
        """An axis at rest is found `by` steps from where it was commanded to, now. Raises RuntimeError if it moves."""
        if not self._acting:
            self._catch_up()
        self.controller(unit).displace(by, self.now, axis)
        self._keep(Displace(unit, axis, by))
        self.circuit.settle(self.unit(unit))
        self._catch_up()

    def breaks(self, fault: Fault, lasting: Ns | None = None) -> int:
        """Something breaks, now, for a time or until `mend`; the number of the fault.

        Raises ValueError or KeyError, with a remedy, for what cannot break so.
        """
        if not self._acting:
            self._catch_up()
        number = self.faults.begin(fault, lasting)
        if lasting is not None:
            self._schedule(TimedAction(self.now + lasting, Mend(number)))
        self._keep(Break(fault, lasting))
        return number

    def mend(self, fault: int) -> None:
        """The fault of this number is mended, now, if it is not already. Raises KeyError for a number never given."""
        if not self._acting:
            self._catch_up()
        self.faults.mend(fault)
        self._withdraw(Mend(fault))
        self._keep(Mend(fault))

    def _line(self, line: int) -> Line:
        """The line of that number. Raises ValueError."""
        if not 0 <= line < len(self.lines):
            raise ValueError(f"no line {line}: this cell has {len(self.lines)}")
        return self.lines[line]

    def _input(self, unit: str, pin: str) -> int:
        """The unit, if that is an input of it. Raises KeyError, ValueError."""
        index = self.unit(unit)
        found = find_pin(self.parts[index].pins, pin)
        if found is None:
            raise ValueError(f"{unit} has no pin {pin!r}")
        strapped = pin in getattr(self.parts[index], "straps", ())  # RXD of a GS-C200 is one
        if found.kind not in (PinKind.INPUT, PinKind.STRAP) and not strapped:
            raise ValueError(f"{unit}.{pin} is no input ({found.kind.value}): only inputs are given a level")
        return index

    def _keep(self, action: Action) -> None:
        """Note what is done from outside; it is done when everything else of this instant has happened."""
        if self.journaling and not self._acting:
            self.journal.append(TimedAction(self.now, action, True))

    def _schedule(self, action: TimedAction) -> None:
        """Put an action that is to come into the script, before those of the same time."""
        left = self._script[self._next_action :]
        place = bisect_left(left, action.at, key=lambda other: other.at)
        self._script, self._next_action = Script((*left[:place], action, *left[place:])), 0
        self._note_next_action()

    def _withdraw(self, action: Action) -> None:
        """What was to come by itself is done already."""
        left = self._script[self._next_action :]
        if any(coming.what == action and not coming.outside for coming in left):
            left = Script(coming for coming in left if coming.outside or coming.what != action)
            self._script, self._next_action = Script(left), 0
            self._note_next_action()

    # -- looking -----------------------------------------------------------------------------------------

    @property
    def now(self) -> Ns:
        """What time it is."""
        return self.circuit.now

    @property
    def latest(self) -> Ns:
        """The time up to which it can run."""
        return self.circuit.latest

    @property
    def parts(self) -> Sequence[Device]:
        """The units, and behind them contacts and motors."""
        return self.circuit.parts

    @property
    def lines(self) -> Sequence[Line]:
        """The lines that join hosts and units."""
        return self.circuit.lines

    @property
    def wiring(self) -> Wiring:
        """How the parts are joined."""
        return self.circuit.wiring

    @property
    def recording(self) -> Recording | None:
        """What happened; None if it does not record. Another one may be put in its place."""
        return self.circuit.recording

    @recording.setter
    def recording(self, recording: Recording | None) -> None:
        self.circuit.recording = recording

    @property
    def forced(self) -> Mapping[tuple[int, str], Level]:
        """The inputs that are given a level from outside, by unit and pin."""
        return self.circuit.forced

    def unit(self, name: str) -> int:
        """The index of a unit. Raises KeyError."""
        return self.wiring.unit(name)

    def controller(self, name: str) -> Controller:
        """The controller of that name. Raises KeyError, TypeError if the unit is none."""
        part = self.parts[self.unit(name)]
        if not hasattr(part, "status"):
            raise TypeError(f"unit {name!r} is not a controller")
        return part  # type: ignore[return-value]

    def serial_unit(self, name: str) -> SerialUnit:
        """The controller or adapter of that name. Raises KeyError, TypeError if it has no serial port."""
        part = self.parts[self.unit(name)]
        if not hasattr(part, "frame"):
            raise TypeError(f"unit {name!r} has no serial port")
        return part  # type: ignore[return-value]

    def serial_units(self) -> list[str]:
        """The units to which a host outside can speak, in file order."""
        return [name for name, line in zip(self.wiring.names, self.wiring.line_of, strict=False) if line >= 0]

    def controllers(self) -> dict[str, Controller]:
        """All controllers by name, in file order."""
        names = self.wiring.names[: self.wiring.units]
        return {name: self.controller(name) for i, name in enumerate(names) if hasattr(self.parts[i], "status")}

    def copy(self) -> "Cell":
        """An independent cell that goes on exactly as this one would."""
        return duplicate(self)

    def _part_with_contact(self, name: str) -> int:
        """The part that the switch `name` on an axis belongs to: itself, or the motor that moves it."""
        for index in range(self.wiring.units, len(self.parts)):
            if name in getattr(self.parts[index], "contact_names", (self.wiring.names[index],)):
                if hasattr(self.parts[index], "move_contact"):
                    return index
                raise ValueError(f"switch {name!r} is on no axis: it has no place")
        raise KeyError(f"no switch {name!r} in this cell")
