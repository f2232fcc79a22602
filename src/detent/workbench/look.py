"""A cell as it is drawn: the picture of what never changes, and a look at what does."""

from collections.abc import Mapping, Sequence

from detent.cell.build import Read
from detent.cell.cell import Cell
from detent.cell.description import Description
from detent.cell.history import History
from detent.cell.mechanics import Mechanics
from detent.cell.moments import Moment
from detent.cell.panel import Front
from detent.cell.parts import PARTS
from detent.cell.switches import AxisSwitch, Switch
from detent.controllers import catalogue
from detent.controllers.catalogue import Model
from detent.controllers.device import Controller
from detent.lines.line import Line
from detent.pins import Level, Pin
from detent.realtime import breaking, verbs
from detent.realtime.endpoints.endpoint import Endpoint
from detent.ticks import SECOND, Ns
from detent.workbench import rotors
from detent.workbench.messages import (
    AxisState,
    EndpointPicture,
    Fault,
    LinePicture,
    MotorPicture,
    MotorState,
    OptionPicture,
    Picture,
    PinPicture,
    Step,
    SwitchPicture,
    SwitchState,
    UnitPicture,
    UnitState,
    WirePicture,
)

BLIND = ("supersigma",)
"""Models that count no position: what is shown is where their pulses have taken the shaft."""


def picture(
    description: Description,
    target: str,
    cell: Cell,
    endpoints: Sequence[tuple[int, Endpoint]],
    reports: Sequence[str],
) -> Picture:
    """Everything there is to draw of a cell that was just built."""
    units = {name: _unit(description, cell, name) for name in description.units}
    switches = {name: _switch(description, name) for name in description.switches}
    motors = {
        cell.wiring.names[k]: _motor(description, cell.wiring.names[k], part)
        for k, part in enumerate(cell.parts)
        if isinstance(part, Mechanics)
    }
    wires = [WirePicture(wire.source, tuple(wire.to)) for wire in description.wires]
    wires += [WirePicture(name, tuple(entry.drives)) for name, entry in description.switches.items()]
    lines = {name: _line(description, cell, number, endpoints) for number, name in enumerate(cell.wiring.line_names)}
    return Picture(description.title, target, units, switches, motors, tuple(wires), lines, tuple(reports))


def sources(description: Description, read: Read) -> dict[str, str]:
    """The texts of the programs that a cell file names, by unit."""
    named = {name: unit.program or unit.eeprom for name, unit in description.units.items()}
    return {name: read(file) for name, file in named.items() if file is not None}


def _unit(description: Description, cell: Cell, name: str) -> UnitPicture:
    entry = description.units[name]
    index = cell.unit(name)
    device = cell.parts[index]
    found = catalogue.MODELS.get(entry.model) or PARTS[entry.model]
    wired = {pin for readers in cell.wiring.reads for part, pin in readers if part == index} | set(
        cell.wiring.drives[index]
    )
    chosen = {option.name: str(entry.options.get(option.name, option.default)) for option in found.options}
    options = [OptionPicture(option.name, chosen[option.name], option.takes, option.help) for option in found.options]
    line = next(
        (cell.wiring.line_names[n] for n, units in enumerate(cell.wiring.lines) if index in [u for u, _ in units]), None
    )
    language = found.language() if isinstance(found, Model) and found.language is not None else None
    return UnitPicture(
        name,
        found.name,
        found.title,
        tuple(_pin(pin, pin.name in wired) for pin in device.pins),
        dict(getattr(device, "straps", {})),
        tuple(options),
        tuple(getattr(device, "axes", ())),
        line,
        language is not None,
        sum(len(area) for area in language.areas) if language is not None else 0,
        isinstance(found, Model) and bool(found.saves),
        entry.program or entry.eeprom or "",
    )


def _pin(pin: Pin, wired: bool) -> PinPicture:
    return PinPicture(pin.name, pin.number, pin.kind.value, pin.help, pin.rest, wired)


def _switch(description: Description, name: str) -> SwitchPicture:
    entry = description.switches[name]
    low, high = entry.range
    motor = None
    if entry.axis is not None:
        unit, _, axis = entry.axis.partition(".")
        on_axis = (m for m, fitted in description.motors.items() if (fitted.unit, fitted.axis) == (unit, axis))
        motor = entry.axis if entry.axis in description.motors else next(on_axis, None)
    return SwitchPicture(name, tuple(entry.drives), entry.axis, low, high, entry.inside, motor)


def _motor(description: Description, name: str, motor: Mechanics) -> MotorPicture:
    entry = description.motors[name]
    teeth = motor.rig.motor.teeth
    return MotorPicture(
        name,
        entry.motor or motor.rig.motor.name,
        entry.unit,
        entry.axis,
        entry.lead,
        4 * teeth,
        teeth * motor.cycle,
        motor.contact_names,
    )


def _line(description: Description, cell: Cell, number: int, endpoints: Sequence[tuple[int, Endpoint]]) -> LinePicture:
    name = cell.wiring.line_names[number]
    entry, line = description.lines.get(name), cell.lines[number]
    host = entry.host if entry is not None else None
    units = tuple(cell.wiring.names[unit] for unit, _ in cell.wiring.lines[number])
    units = tuple(unit for unit in units if unit != host)
    found = tuple(EndpointPicture(each.kind, each.address) for at, each in endpoints if at == number)
    return LinePicture(name, units, str(line.format), host, kind_of(line), found)


def kind_of(line: Line) -> str:
    """A word for the kind of a line."""
    return {"Microbus": "microbus", "PartyLine": "party line", "DaisyChain": "daisy-chain"}.get(
        type(line).__name__, "serial"
    )


def lines(history: History) -> dict[str, Line]:
    """The lines of the cell by their names."""
    cell = history.cell
    return dict(zip(cell.wiring.line_names, cell.lines, strict=True))


def breakpoints(history: History) -> dict[str, frozenset[int]]:
    """The addresses at which it stops, of each unit that has any."""
    found: dict[str, frozenset[int]] = {}
    for index, address in history.breakpoints:
        name = history.cell.wiring.names[index]
        found[name] = found.get(name, frozenset()) | {address}
    return found


def units(history: History) -> dict[str, UnitState]:
    """The units where the cell stands."""
    cell, names = history.cell, history.cell.wiring.names
    held: dict[int, set[str]] = {}
    for unit, pin in cell.forced:
        held.setdefault(unit, set()).add(pin)
    controllers = cell.controllers()
    return {
        names[k]: _state(controllers.get(names[k]), front, cell.now, frozenset(held.get(k, ())))
        for k, front in enumerate(history.panel.fronts)
    }


def _state(controller: Controller | None, front: Front, now: Ns, held: frozenset[str]) -> UnitState:
    refused = front.refused
    error = None if refused is None else Fault(refused.at, refused.frame, refused.reason)
    levels: Mapping[str, Level | None] = dict(front.levels)
    if controller is None:
        return UnitState(front.powered, "", {}, levels, held, None, {}, error, 0, False, front.stored)
    axes = {}
    for axis, travel in front.travels.items():
        status, (shaft, rate) = controller.status(now, axis), travel.at(now)
        position = status.position if controller.model not in BLIND else shaft
        axes[axis] = AxisState(position, shaft, status.pulses, rate)
    state = controller.status(now).state
    executing = front.executing if state not in ("ready", "waiting", "programming", "off") else None
    straps = controller.straps
    memory, kept = controller.program_memory(), controller.kept_memory()
    return UnitState(
        front.powered,
        state,
        axes,
        levels,
        held - straps.keys(),
        None if executing is None else Step(executing.at, executing.address, executing.instruction),
        controller.registers(now) if front.powered else {},
        error,
        hash(memory),
        memory != kept,
        front.stored,
    )


def switches(history: History) -> dict[str, SwitchState]:
    """The switches of the cell, those on a motor among them."""
    cell, found = history.cell, {}
    for k in range(cell.wiring.units, len(cell.parts)):
        part = cell.parts[k]
        if isinstance(part, Mechanics):
            for contact in part.contacts:
                driven = cell.wiring.drives[k].get(contact.name)
                level = cell.circuit.nets[driven].levels.get((k, contact.name), 1) if driven is not None else 1
                found[contact.name] = SwitchState(level, *contact.range)
        elif isinstance(part, Switch):
            low, high = part.range if isinstance(part, AxisSwitch) else (None, None)
            found[cell.wiring.names[k]] = SwitchState(part.level, low, high)
    return found


def differences(there: Moment, here: Moment) -> list[str]:
    """What two cells at one time do not have in common: states, positions, outputs."""
    at, names, found = f"at {here.now / SECOND:.6f} s", here.cell.wiring.names, list[str]()
    theirs = there.cell.controllers()
    for name, controller in here.cell.controllers().items():
        for axis in controller.axes:
            one, other = theirs[name].status(there.now, axis), controller.status(here.now, axis)
            place = f"{name}.{axis}" if axis else name
            if one.position != other.position:
                found.append(f"{at} {place} stands at {one.position} there, at {other.position} here")
            if one.state != other.state:
                found.append(f"{at} {place} is {one.state} there, {other.state} here")
    for unit, (left, right) in enumerate(zip(there.panel.fronts, here.panel.fronts, strict=True)):
        pins = [pin for pin, level in right.levels.items() if left.levels.get(pin) != level]
        if pins:
            found.append(f"{at} {names[unit]} has other levels at {', '.join(pins)}")
    return found or [f"{at} nothing is different: states, positions and levels are the same"]


def faults(history: History) -> dict[int, str]:
    """The faults that stand, in words."""
    cell, found = history.cell, {}
    for number, fault in cell.faults.standing.items():
        asked = breaking.arguments_of(cell, fault)
        kind, where = str(asked.pop("kind")), asked.pop("where")
        more = ", ".join(
            f"{name} {value}" for name, value in asked.items() if value not in (None, 0, "both") or name == "level"
        )
        found[number] = f"{where}: {verbs.FAULTS[kind].help}" + (f" ({more})" if more else "")
    return found


def motors(history: History) -> dict[str, MotorState]:
    """The motors where the cell stands."""
    cell, found = history.cell, {}
    for k in history.motors:
        motor = cell.parts[k]
        assert isinstance(motor, Mechanics)
        rotor = motor.catch_up(cell.now)
        place, command = float(motor.place_of(rotor.angle)), motor.command(cell.now)
        lost = round((command - place) / motor.cycle) * motor.cycle
        found[cell.wiring.names[k]] = MotorState(place, command, float(rotors.speed(motor, rotor.speed)), round(lost))
    return found
