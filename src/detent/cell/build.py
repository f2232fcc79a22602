"""From a description to a cell that runs: models made, wires joined into nets, programs loaded, power on.

Whatever cannot be built is a `Problem` with the key and the remedy, and nothing is built.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from detent.assembler import Assembly, AssemblyFailed, ImageError, assemble
from detent.cell import real_pins
from detent.cell.actions import Power, SetSwitch, TimedAction, Type
from detent.cell.cell import Cell
from detent.cell.description import Description, Problem, Unit
from detent.cell.outside import Store, Typed, no_store, nobody_asks
from detent.cell.parts import PARTS, Part
from detent.cell.switches import AxisSwitch, Switch
from detent.cell.wiring import Wiring
from detent.controllers import catalogue
from detent.controllers.catalogue import NO_LIMITS, CatalogueError, Model
from detent.controllers.device import Controller, Device
from detent.lines.daisy_chain import DaisyChain
from detent.lines.line import Line
from detent.lines.microbus import Microbus
from detent.lines.party_line import PartyLine
from detent.lines.sin import Adapter
from detent.pins import HIGH, Level, Net, Pin, PinKind
from detent.ticks import SECOND, round_ratio

if TYPE_CHECKING:
    from detent.cell.mechanics import Mechanics
    from detent.cell.tables import Motor, ScriptEntry

LINES: Mapping[str, type[Line]] = {"serial": Line, "microbus": Microbus}

Read = Callable[[str], str]
"""The text of a file that the cell names (relative to the cell's own place). Raises OSError."""


def build(
    description: Description,
    read: Read,
    *,
    images: Mapping[str, bytes] | None = None,
    store: Store = no_store,
    record: bool = True,
    line_timing: bool = True,
    journal: Iterable[TimedAction] = (),
    typed: Typed = nobody_asks,
    inputs: Mapping[tuple[str, str], Level] | None = None,
) -> Cell:
    """The cell, switched on at time 0, with its programs started.

    `images` are the units' non-volatile memories as they were kept, `store` keeps them; `typed` is told of each command
    line before it is sent. `journal` is what was done to a cell like this one: with it, the same happens again.
    `inputs` are levels that pins of units (UNIT, PIN) have from outside before anything is switched on. Raises Problem.
    """
    return _Builder(description, read).cell(images or {}, store, record, line_timing, journal, typed, inputs or {})


class _End(NamedTuple):
    """A pin of a part, and how it is written in the file."""

    part: int
    pin: Pin
    text: str


class _Builder:
    def __init__(self, description: Description, read: Read) -> None:
        if description.motors:  # the motor model takes as long to load as all the rest
            from detent.cell.fitting import with_own_motors

            description = with_own_motors(description, read)
        self.description, self.read = description, read
        self.models: dict[str, Model | Part] = {}
        self.names: list[str] = []
        self.parts: list[Device] = []
        self.net_of: dict[tuple[int, str], int] = {}
        self.nets: list[list[_End]] = []
        self.axes: dict[int, int] = {}  # switch or motor -> the unit whose axis it follows
        self.contacts: dict[str, int] = {}  # switch that a rotor moves -> the motor
        self.remarks: list[str] = []

    def problem(self, key: str, message: str) -> Problem:
        return Problem(self.description.file, key, message)

    def cell(
        self, images: Mapping[str, bytes], store: Store, record: bool, line_timing: bool,
        journal: Iterable[TimedAction], typed: Typed, inputs: Mapping[tuple[str, str], Level],
    ) -> Cell:  # fmt: skip
        lines = self.line_units()
        self.make_units(lines, line_timing)
        self.make_motors(record)
        self.make_switches()
        self.join_wires()
        actions = [action for n, entry in enumerate(self.description.script, 1) for action in self.actions(n, entry)]
        self.check_nets()
        if self.description.hardware or any(entry.machine for entry in self.description.switches.values()):
            controllers = {name: self.controller(name) for name in self.axis_units()}
            real_pins.check(self.description, controllers, self.joined)
        cell = Cell(self.wiring(lines), self.parts, [Net() for _ in self.nets],
                    [self.line(name, units, line_timing) for name, units in lines.items()],
                    [*actions, *journal], store=store, record=record, typed=typed)  # fmt: skip
        for (unit, pin), level in inputs.items():
            cell.set_pin(unit, pin, level)
        self.switch_on(cell, images)
        cell.begin(journaling=record)
        return cell

    # -- units -------------------------------------------------------------------------------------------

    def make_units(self, lines: Mapping[str, list[str]], line_timing: bool) -> None:
        straps = self.straps(lines)
        for name, unit in self.description.units.items():
            key = f"units.{name}"
            found = self.models[name]
            self.check_electrics(key, found, unit)
            try:
                keywords = catalogue.option_values(found, unit.options)
            except CatalogueError as error:
                raise self.problem(f"{key}.options", str(error)) from None
            try:
                if isinstance(found, Model):
                    device: Device = found.make(straps[name], line_timing=line_timing, shaft=unit.shaft, **keywords)
                else:
                    device = found.make(**keywords, **({"line_timing": line_timing} if found.adapter else {}))
            except ValueError as error:  # each option is one, and together they make no unit
                raise self.problem(f"{key}.options", str(error)) from None
            self.names.append(name)
            self.parts.append(device)

    def check_electrics(self, key: str, found: Model | Part, unit: Unit) -> None:
        """The supply and the loads that the cell states are within what the model stands."""
        limits = found.limits if isinstance(found, Model) else NO_LIMITS
        low, high = limits.supply
        if unit.supply is not None and not low <= unit.supply <= high:
            raise self.problem(f"{key}.supply", f"{unit.supply:g} V: a {found.name} takes {low:g} to {high:g} V")
        for pin, load in unit.loads.items():
            if pin not in limits.loads:
                raise self.problem(f"{key}.loads", str(catalogue.unknown("supply output", pin, tuple(limits.loads))))
            if not 0 <= load <= limits.loads[pin]:
                most = f"{pin} gives at most {limits.loads[pin] * 1000:g} mA"
                raise self.problem(f"{key}.loads", f"{load * 1000:g} mA from {pin}: {most}")

    def check_motor_supply(self, name: str, entry: "Motor") -> None:
        """A motor on the power stage of a controller has a supply that this one stands."""
        found = self.models.get(entry.unit or "")
        if not isinstance(found, Model):
            return  # what any drive stands is its own to say
        low, high = found.limits.motor_supply
        if not low <= entry.supply <= high:
            what = f"{entry.supply:g} V: the motors of a {found.name} have {low:g} to {high:g} V"
            raise self.problem(f"motors.{name}.supply", what)

    def look_at_windings(self, name: str, entry: "Motor", made: "Mechanics") -> None:
        """Remark on a motor that draws more current than its power stage stands."""
        found = self.models.get(entry.unit or "")
        if entry.unit is None or not isinstance(found, Model):
            return
        amps, most = made.rig.most_current, found.limits.winding(self.controller(entry.unit))
        if amps > most * 1.0005:  # as much as is shown
            less = entry.supply * most / amps
            lower = f"lower the supply to {less:.2f} V, or" if less >= found.limits.motor_supply[0] else "so"
            self.remarks.append(
                f"{name}: {amps:.3g} A in each winding at {entry.supply:g} V, and this {found.name} stands {most:g} A, "
                f"beyond which a real one fails; {lower} give it a resistance"
            )

    def straps(self, lines: Mapping[str, list[str]]) -> dict[str, dict[str, Level]]:
        """The straps of every controller, completed line by line."""
        named: dict[str, dict[str, Level]] = {}
        for name, unit in self.description.units.items():
            self.models[name] = found = self.model(name, unit)
            named[name] = {}
            for pin, value in unit.straps.items():
                try:
                    named[name][pin] = catalogue.strap_level(found, pin, value)
                except CatalogueError as error:
                    raise self.problem(f"units.{name}.straps", str(error)) from None
            if isinstance(found, Part) and (unit.program or unit.eeprom):
                raise self.problem(f"units.{name}.program", f"a {found.name} holds no program: remove it")
        on_lines = {unit for units in lines.values() for unit in units}
        alone = {name: [name] for name, found in self.models.items() if isinstance(found, Model)}
        for line, units in {**{n: u for n, u in alone.items() if n not in on_lines}, **lines}.items():
            found = self.models[units[0]]
            if isinstance(found, Part):
                continue  # an adapter
            described = self.description.lines.get(line)
            if described is not None and described.host is not None:
                for each_unit in units:  # the wire of party select is high until the adapter pulls it low
                    named[each_unit] = ({"PARTY": HIGH} if "PARTY" in found.straps else {}) | named[each_unit]
            # the links of a daisy chain are lines of one unit each
            shared = [[unit] for unit in units] if described is not None and described.kind else [units]
            try:
                for each in shared:
                    named.update(zip(each, found.strap_line([(unit, named[unit]) for unit in each]), strict=True))
            except ValueError as error:
                key = f"lines.{line}.units" if line in self.description.lines else f"units.{units[0]}.straps"
                raise self.problem(key, str(error)) from None
        return named

    def model(self, name: str, unit: Unit) -> Model | Part:
        if unit.model in PARTS:
            return PARTS[unit.model]
        if unit.model in catalogue.MODELS:
            return catalogue.MODELS[unit.model]
        known = (*catalogue.MODELS, *PARTS)
        raise self.problem(f"units.{name}.model", str(catalogue.unknown("model", unit.model, known)))

    # -- lines -------------------------------------------------------------------------------------------

    def line_units(self) -> dict[str, list[str]]:
        """The units on each line. A cell that names no lines has one for each controller."""
        described = self.description
        if not described.lines:
            return {name: [name] for name, unit in described.units.items() if unit.model not in PARTS}
        seen: dict[str, str] = {}
        for line, entry in described.lines.items():
            if not entry.units:
                raise self.problem(f"lines.{line}.units", "a line needs at least one unit")
            for unit in entry.units:
                self.need_unit(f"lines.{line}.units", unit)
                part = PARTS.get(described.units[unit].model)
                if part is not None and part.adapter and len(entry.units) > 1:
                    raise self.problem(f"lines.{line}.units", f"{unit} has the line to its host for itself")
                if part is not None and not part.adapter:
                    raise self.problem(f"lines.{line}.units", f"{unit} has no serial port: remove it")
                if unit in seen:
                    raise self.problem(f"lines.{line}.units", f"{unit} is on line {seen[unit]} already: choose one")
                seen[unit] = line
            if entry.host is not None:
                self.check_host(line, entry.host)
        return {line: list(entry.units) for line, entry in described.lines.items()}

    def check_host(self, line: str, host: str) -> None:
        """The host of a line is an adapter that is the host of no other, and has a line to its own host."""
        key, described = f"lines.{line}.host", self.description
        self.need_unit(key, host)
        part = PARTS.get(described.units[host].model)
        if part is None or not part.adapter:
            adapters = ", ".join(name for name, part in PARTS.items() if part.adapter)
            raise self.problem(key, f"{host} is no adapter: a line is hosted by one of {adapters}")
        others = [name for name, entry in described.lines.items() if entry.host == host and name != line]
        if others:
            raise self.problem(key, f"{host} is the host of line {others[0]} already: choose one")
        if not any(host in entry.units for entry in described.lines.values()):
            raise self.problem(key, f"{host} has no line to its own host: add one with units = ['{host}']")

    def adapter(self, line: str) -> tuple[str, Adapter] | None:
        """The adapter that is the host of a line."""
        entry = self.description.lines.get(line)
        if entry is None or entry.host is None:
            return None
        device = self.parts[self.names.index(entry.host)]
        assert isinstance(device, Adapter)
        return entry.host, device

    def line(self, name: str, units: list[str], timed: bool) -> Line:
        """The line itself; all its units have the same character format."""
        kind = LINES[self.line_kind(units)]
        forms = {unit: self.controller(unit).line_format for unit in units}
        first = forms[units[0]]
        for unit, form in forms.items():
            if form != first:
                what = f"{units[0]} is strapped for {first}, {unit} for {form}: units on one line need the same"
                raise self.problem(f"units.{unit}.straps", what)
        entry = self.description.lines.get(name)
        if entry is not None and entry.kind:
            return DaisyChain(first, len(units), timed=timed)
        if (hosted := self.adapter(name)) is not None:
            host, adapter = hosted
            if adapter.downstream_format != first:
                what = f"{host} speaks {adapter.downstream_format} to the line, its units {first}: set the same"
                raise self.problem(f"units.{host}.options", what)
            return PartyLine(first, len(units), timed=timed)
        if isinstance(self.models[units[0]], Part):
            return Line(first, timed=timed)
        port = self.controller(units[0]).serial_port
        early = round_ratio(SECOND * port.early.numerator, first.baud * port.early.denominator)
        return kind(first, timed=timed, early=early, start_bits=port.start_bits)

    def line_kind(self, units: list[str]) -> str:
        """The kind of line that these units sit on, each told apart from the others."""
        models = {unit: found for unit in units if isinstance(found := self.models[unit], Model)}
        if not models:
            return "serial"
        first = next(iter(models.values()))
        owners: dict[object, str] = {}
        for unit, found in models.items():
            if found.line != first.line:
                what = f"a {first.name} and a {found.name} do not share a line: give {unit} one of its own"
                raise self.problem(f"units.{unit}.model", what)
            option = found.told_apart_by
            if option:
                value = getattr(self.controller(unit), option)
                other = owners.setdefault(value, unit)
                if other != unit:
                    what = f"{other} and {unit} both have the {option} {value}: change one of them"
                    raise self.problem(f"units.{unit}.options", what)
        return first.line

    # -- switches and wires ------------------------------------------------------------------------------

    def make_motors(self, record: bool) -> None:
        described = self.description
        if not described.motors:
            return
        from detent.cell.fitting import check_names, mechanics, motors_by_axis, split_axis

        check_names(described, [*described.units, *described.switches])
        on_axis = motors_by_axis(described)
        for name, entry in described.motors.items():
            if entry.unit is not None:
                self.need_unit(f"motors.{name}.unit", entry.unit)
                if entry.unit not in self.axis_units():
                    raise self.problem(f"motors.{name}.unit", f"{entry.unit} moves no axis: name a controller")
                axes = self.controller(entry.unit).axes
                if entry.axis not in axes:
                    raise self.problem(f"motors.{name}.axis", str(catalogue.unknown("axis", entry.axis, axes)))
            mine = {
                switch: where
                for switch, where in described.switches.items()
                if where.axis is not None and name in (where.axis, on_axis.get(split_axis(where.axis)))
            }
            shaft = described.units[entry.unit].shaft if entry.unit is not None else 0
            self.contacts |= dict.fromkeys(mine, len(self.parts))
            if entry.unit is not None:
                self.axes[len(self.parts)] = self.names.index(entry.unit)
            self.names.append(name)
            self.check_motor_supply(name, entry)
            made = mechanics(described, name, mine, shaft, record)
            self.look_at_windings(name, entry, made)
            self.parts.append(made)

    def make_switches(self) -> None:
        for name, entry in self.description.switches.items():
            if name in self.description.units:
                raise self.problem(f"switches.{name}", "a unit has this name already: choose another")
            if name in self.contacts:
                continue  # the rotor moves it
            switch = Switch(entry.level)
            if entry.axis is not None:
                if any(place is not None and place != int(place) for place in entry.range):
                    raise self.problem(f"switches.{name}", "places on an axis without a motor are whole steps")
                unit, axis = self.axis_of(f"switches.{name}.axis", entry.axis)
                low, high = (None if place is None else int(place) for place in entry.range)
                switch = AxisSwitch(low, high, entry.inside, self.description.units[unit].shaft, axis)
                self.axes[len(self.parts)] = self.names.index(unit)
            self.names.append(name)
            self.parts.append(switch)

    def join_wires(self) -> None:
        for name, entry in self.description.switches.items():
            key = f"switches.{name}.drives"
            if name in self.contacts:
                motor = self.parts[self.contacts[name]]
                pin = next(pin for pin in motor.pins if pin.name == name)
                contact = _End(self.contacts[name], pin, name)
            else:
                contact = _End(self.names.index(name), Switch.pins[0], name)
            for target in entry.drives:
                self.join(key, contact, self.end(key, target))
        for line, entry_of_line in self.description.lines.items():
            if entry_of_line.host is not None:  # the cable has a wire for party select
                key = f"lines.{line}.host"
                select = self.end(key, f"{entry_of_line.host}.PARTY")
                for unit in entry_of_line.units:
                    if any(pin.name == "PARTY" for pin in self.parts[self.names.index(unit)].pins):
                        self.join(key, select, self.end(key, f"{unit}.PARTY"))
        for n, wire in enumerate(self.description.wires, 1):
            source = self.end(f"wires[{n}].from", wire.source)
            if not source.pin.kind.drives:
                raise self.problem(f"wires[{n}].from", f"{wire.source} is no output: a wire starts at one")
            for target in wire.to:
                self.join(f"wires[{n}].to", source, self.end(f"wires[{n}].to", target))

    def end(self, key: str, text: str) -> _End:
        """The pin that ``UNIT.PIN`` names."""
        name, dot, pin = text.partition(".")
        if not dot:
            raise self.problem(key, f"{text!r} names no pin: write UNIT.PIN")
        if name not in self.description.motors:
            self.need_unit(key, name)
        wired = [p for p in self.parts[self.names.index(name)].pins if p.kind.drives or p.kind.reads]
        for found in wired:
            if found.name == pin:
                return _End(self.names.index(name), found, text)
        known = [found.name for found in wired]
        raise self.problem(key, str(catalogue.unknown(f"pin of {name} that takes a wire", pin, known)))

    def join(self, key: str, one: _End, other: _End) -> None:
        """Put both pins on one net, with everything that is on theirs."""
        if one == other:
            raise self.problem(key, f"{one.text} is wired to itself: remove the wire")
        first = self.net(one)
        second = self.net(other)
        if first != second:
            for end in self.nets[second]:
                self.net_of[end.part, end.pin.name] = first
            self.nets[first] += self.nets[second]
            self.nets[second] = []

    def net(self, end: _End) -> int:
        place = (end.part, end.pin.name)
        if place not in self.net_of:
            self.net_of[place] = len(self.nets)
            self.nets.append([end])
        return self.net_of[place]

    def check_nets(self) -> None:
        """One push-pull output at most on a net, and then nothing else that pulls."""
        for ends in self.nets:
            drivers = [end for end in ends if end.pin.kind.drives]
            if len(drivers) > 1 and any(end.pin.kind is not PinKind.OPEN_COLLECTOR for end in drivers):
                pins = " and ".join(end.text for end in drivers)
                raise self.problem("wires", f"{pins} drive the same wire: only open collectors may share one")

    def joined(self, unit: str, pin: str) -> real_pins.Joined:
        """What drives an input of a unit within the cell, and in its script."""
        part = self.names.index(unit)
        net = self.net_of.get((part, pin))
        ends = [] if net is None else self.nets[net]
        stands_in = {name for name, entry in self.description.switches.items() if entry.machine}
        named = [name for end in ends if end.pin.kind.drives and (name := self.names[end.part]) not in stands_in]
        scripted = ["the script" for entry in self.description.script if f"{unit}.{pin}" in entry.set]
        return real_pins.Joined([*named, *scripted])

    def wiring(self, lines: Mapping[str, list[str]]) -> Wiring:
        units = len(self.description.units)
        drives: list[dict[str, int]] = [{} for _ in self.parts]
        reads: list[tuple[tuple[int, str], ...]] = []
        for number, ends in enumerate(self.nets):
            for end in ends:
                if end.pin.kind.drives:
                    drives[end.part][end.pin.name] = number
            reads.append(tuple((end.part, end.pin.name) for end in ends if end.pin.kind.reads))
        for part, pins in enumerate(drives):
            for pin in pins:
                self.parts[part].watch(pin)
        for readers in reads:
            for part, pin in readers:
                if self.names[part] in self.description.motors:
                    cast("Mechanics", self.parts[part]).wired(pin)
        followers = [tuple(s for s, unit in self.axes.items() if unit == part) for part in range(len(self.parts))]
        hears: list[tuple[tuple[int, str], ...]] = []
        speaks: list[dict[str, tuple[int, int]]] = [{} for _ in range(units)]
        line_of = [-1] * units
        for line, names in enumerate(lines.values()):
            ports = [(self.names.index(name), self.controller(name).serial_port) for name in names]
            hears.append(tuple((unit, port.receives) for unit, port in ports))
            hosted = self.adapter(list(lines)[line])
            for place, (unit, port) in enumerate(ports):
                speaks[unit][port.sends] = line, place
                line_of[unit] = -1 if hosted is not None else line
            if hosted is not None:
                host, port = self.names.index(hosted[0]), hosted[1].downstream
                hears[-1] += ((host, port.receives),)
                speaks[host][port.sends] = line, len(ports)
        return Wiring(tuple(self.names), units, tuple(drives), tuple(reads), tuple(followers),
                      tuple(hears), tuple(lines), tuple(line_of), tuple(speaks), tuple(self.remarks))  # fmt: skip

    # -- script ------------------------------------------------------------------------------------------

    def actions(self, number: int, entry: "ScriptEntry") -> list[TimedAction]:
        """What one ``[[script]]`` entry does, in the order set, power, send."""
        key = f"script[{number}]"
        found = []
        for target, level in entry.set.items():
            name = self.settable(f"{key}.set", target)
            found.append(TimedAction(entry.at, SetSwitch(name, level)))
        for unit, on in entry.power.items():
            self.need_unit(f"{key}.power", unit)
            found.append(TimedAction(entry.at, Power(unit, on)))
        if entry.send:
            if entry.to is None:
                raise self.problem(f"{key}.to", "say which unit the line is for: to = 'UNIT'")
            self.need_unit(f"{key}.to", entry.to)
            line = next((line for line, units in self.line_units().items() if entry.to in units), None)
            if line is None:
                raise self.problem(f"{key}.to", f"{entry.to} is on no line: put it on one in [lines]")
            if line in self.description.lines and self.description.lines[line].host is not None:
                host = self.description.lines[line].host
                raise self.problem(f"{key}.to", f"{entry.to} is behind {host}: send to {host}")
            for text in entry.send:
                try:
                    self.controller(entry.to).frame(text)
                except ValueError as error:
                    raise self.problem(f"{key}.send", str(error)) from None
            found += [TimedAction(entry.at, Type(entry.to, text)) for text in entry.send]
        return found

    def settable(self, key: str, target: str) -> str:
        """The switch that the script sets: one of the cell, or one of its own on a free input."""
        if target in self.description.switches or target in self.names:
            if target in self.description.units:
                raise self.problem(key, f"{target} is a unit: write {target}.PIN")
            return target
        if "." not in target:
            known = [*self.description.switches, "UNIT.PIN"]
            raise self.problem(key, str(catalogue.unknown("switch", target, known)))
        end = self.end(key, target)
        if not end.pin.kind.reads:
            raise self.problem(key, f"{target} is an output: the unit sets it")
        drivers = [e.text for e in self.nets[self.net(end)] if e.pin.kind.drives]
        if drivers:
            raise self.problem(key, f"{drivers[0]} drives {target}: set that instead, or cut the wire")
        self.names.append(target)
        self.parts.append(Switch(HIGH))
        self.join(key, _End(len(self.parts) - 1, Switch.pins[0], target), end)
        return target

    # -- power -------------------------------------------------------------------------------------------

    def switch_on(self, cell: Cell, images: Mapping[str, bytes]) -> None:
        """Contacts first, so that every unit finds its inputs as they are; then units, then programs."""
        units = self.description.units
        for index in range(len(units), len(self.parts)):
            cell.switch_on(index)
        programs = {name: self.assembled(name, unit, "program") for name, unit in units.items() if unit.program}
        for name, unit in units.items():
            if unit.eeprom or name in images:
                image = images[name] if name in images else self.assembled(name, unit, "eeprom").whole
                try:
                    self.controller(name).restore(image)
                except ImageError as error:
                    raise self.problem(f"units.{name}", f"its stored image is damaged: {error}") from None
        hosts = [entry.host for entry in self.description.lines.values() if entry.host is not None]
        order = (*hosts, *(name for name in units if name not in hosts))  # axes look at PARTY at power-on
        cell.circuit.supply_all([cell.unit(name) for name in order if units[name].powered])
        for name, assembly in programs.items():
            self.controller(name).load(assembly.image, assembly.base, cell.now)
        cell.start_all(programs)

    def assembled(self, name: str, unit: Unit, key: str) -> Assembly[Any]:
        """The program in the file that `key` of the unit names."""
        file = getattr(unit, key)
        where = f"units.{name}.{key}"
        try:
            text = self.read(file)
        except (OSError, ValueError) as error:  # ValueError: no text, or a name that no file can have
            reason = getattr(error, "strerror", None) or error
            raise self.problem(where, f"cannot read {file}: {reason}") from None
        try:
            return assemble(catalogue.language(unit.model), text, file)
        except CatalogueError as error:
            raise self.problem(where, str(error)) from None
        except AssemblyFailed as error:
            first, more = error.errors[0], len(error.errors) - 1
            rest = f" (and {more} more: detent list {unit.model} {file})" if more else ""
            message = f"{file}:{first.line}:{first.column}: {first.message}{rest}"
            raise self.problem(where, message) from None

    # -- names -------------------------------------------------------------------------------------------

    def axis_of(self, key: str, text: str) -> tuple[str, str]:
        """The unit and the axis that ``UNIT``, or ``UNIT.AXIS`` where a unit has several, names."""
        unit, _, axis = text.partition(".")
        self.need_unit(key, unit)
        if unit not in self.axis_units():
            raise self.problem(key, f"{unit} moves no axis: name a controller")
        axes = self.controller(unit).axes
        if axis not in axes:
            if axis or len(axes) == 1:
                raise self.problem(key, f"{unit} has no axis {axis!r}: write {self.written(unit, axes)}")
            raise self.problem(key, f"{unit} has several axes: write {self.written(unit, axes)}")
        return unit, axis

    def written(self, unit: str, axes: Sequence[str]) -> str:
        """How the axes of a unit are written."""
        return " or ".join(f"{unit}.{axis}" if axis else unit for axis in axes)

    def axis_units(self) -> list[str]:
        return [name for name, found in self.models.items() if isinstance(found, Model)]

    def controller(self, name: str) -> Controller:
        device = self.parts[self.names.index(name)]
        assert isinstance(self.models[name], Model) or isinstance(device, Adapter)
        return device  # type: ignore[return-value]

    def need_unit(self, key: str, name: str) -> None:
        if name not in self.description.units:
            raise self.problem(key, str(catalogue.unknown("unit", name, tuple(self.description.units))))
