"""Whether the hardware tables of a cell make sense: units, axes, pins, wires. What only a board can tell it tells."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from detent.cell.description import Description, Problem
from detent.controllers import catalogue
from detent.controllers.device import Controller
from detent.ticks import MS, show_duration

if TYPE_CHECKING:
    from detent.cell.hardware import Hardware

DRIVERS_SHARE = ("driver.uart", "driver.transmit", "driver.clock", "driver.mosi", "driver.miso")
HOLD = "8 ms"  # what a look at a pin and back takes, about
STEPS_LOST = (
    "and a board looks at its inputs once a millisecond: steps would be lost; leave it out, and give the pulses to the "
    "driver itself, or let a unit of this cell give them"
)


class Joined(NamedTuple):
    """What the cell itself has on an input: the names of the units, switches and motors that drive it."""

    drivers: Sequence[str]


def device_of(address: str) -> tuple[str, str]:
    """The device in the address of a board, and the baud rate behind an `@`; "": none is given."""
    device, at, baud = address.rpartition("@")
    return (device, baud) if at and baud.isdigit() else (address, "")


def bare(pin: str) -> str:
    """The name of a pin of a board without its signs."""
    return pin.lstrip("!^~")


def behind_pins(described: Description) -> Description:
    """The cell whose pins are driven: without the switches that stand for those of the machine, which are there."""
    return replace(described, switches={n: entry for n, entry in described.switches.items() if not entry.machine})


def check(described: Description, controllers: Mapping[str, Controller], joined: Callable[[str, str], Joined]) -> None:
    """Raise Problem for the first thing that cannot be. `joined` tells what drives an input within the cell."""
    used = {table.board for table in described.hardware.values()}
    leads = {name: board.lead for name, board in described.boards.items() if name in used}
    if len(set(leads.values())) > 1:
        other = next(name for name in leads if leads[name] != next(iter(leads.values())))
        what = f"it is {show_duration(leads[other])} here and {show_duration(next(iter(leads.values())))} elsewhere"
        raise Problem(described.file, f"boards.{other}.lead", f"{what}: what happens together has to leave together")
    _check_devices(described, used)
    taken: dict[tuple[str, str], str] = {}
    wired: dict[tuple[str, str], str] = {}
    for key, table in described.hardware.items():
        where = f"hardware.{key}"

        def problem(sub: str, message: str, where: str = where) -> Problem:
            return Problem(described.file, f"{where}.{sub}" if sub else where, message)

        unit, _, axis = key.partition(".")
        controller = controllers.get(unit)
        if controller is None:
            known = tuple(controllers)
            raise problem("", str(catalogue.unknown("controller", unit, known)))
        if axis and axis not in controller.axes:
            raise problem("", str(catalogue.unknown(f"axis of {unit}", axis, [a for a in controller.axes if a])))
        if not axis and len(controller.axes) > 1 and table.step is not None:
            names = " and ".join(f"[hardware.{unit}.{each}]" for each in controller.axes)
            raise problem("step", f"{unit} has several axes: give each a table, {names}")
        if axis and table.step is None:
            raise problem("step", f"say which pin steps {key}: step = 'PIN'")
        if table.board not in described.boards:
            raise problem("board", str(catalogue.unknown("board", table.board, tuple(described.boards))))
        for sub, pin in table.pins().items():
            place = (table.board, bare(pin))
            other = taken.setdefault(place, f"{where}.{sub}")
            if other != f"{where}.{sub}" and not (sub in DRIVERS_SHARE and other.endswith(sub)):
                raise problem(sub, f"pin {bare(pin)} of {table.board} is {other} already: take another for one of them")
        _check_outputs(table, controller, unit, problem)
        for pin in table.inputs:
            if (unit, pin) in wired:
                raise problem(f"inputs.{pin}", f"{unit}.{pin} is wired in {wired[unit, pin]} already: remove one")
            wired[unit, pin] = where
            _check_input(pin, controller, unit, joined(unit, pin), problem)
        width = controller.pulse_output.width
        if table.pulse is not None and table.pulse < width:
            raise problem("pulse", f"the pulses of a {controller.model} are {show_duration(width)} long: no shorter")
        if table.pulse is not None and table.pulse > 1 * MS:
            raise problem("pulse", f"{show_duration(table.pulse)} is longer than the steps are apart: 1 ms at most")
        gates = [d for d in joined(unit, "ENABLE").drivers if _model(described, d) == "step-detector"]
        if table.step is not None and gates:
            what = f"{gates[0]} lets every single pulse of {unit} through: on real pins each would take {HOLD}"
            raise problem("", f"{what} to be looked at; remove the wire to {unit}.ENABLE, or this table")
    _check_machine(described)
    for key, table in described.hardware.items():
        unit, _, axis = key.partition(".")
        if table.step is not None:
            _check_switches(described, key, controllers[unit], axis, joined)


def _check_machine(described: Description) -> None:
    """A switch that stands for one of the machine is at a driven axis, and at inputs that are wired to its board."""
    for name, entry in described.switches.items():
        if not entry.machine:
            continue
        where = f"switches.{name}"
        driven = [key for key, table in described.hardware.items() if table.step is not None]
        if entry.axis not in driven:
            what = str(catalogue.unknown("driven axis", entry.axis or "", driven)) if driven else "no axis is driven"
            raise Problem(described.file, f"{where}.axis", f"{what}; without machine = true it is a switch of the cell")
        for target in entry.drives:
            unit, _, pin = target.partition(".")
            mine = [table for key, table in described.hardware.items() if key.partition(".")[0] == unit]
            board = described.hardware[entry.axis].board
            if not any(pin in table.inputs and table.board == board for table in mine):
                what = f"{target} is no input that is wired to the board of {entry.axis}: wire it in [hardware.{unit}]"
                raise Problem(described.file, f"{where}.drives", f"{what}, or leave out machine")


def _check_devices(described: Description, used: set[str]) -> None:
    """No device is two things: two boards, or a board and the wire to a host."""
    devices: dict[str, str] = {}
    wires = {f"lines.{name}.endpoint": line.endpoint or "" for name, line in described.lines.items()}
    boards = {f"boards.{name}.serial": board.serial for name, board in described.boards.items() if name in used}
    for key, device in [*boards.items(), *((k, e.removeprefix("serial:")) for k, e in wires.items() if "serial:" in e)]:
        device = device_of(device)[0]
        other = devices.setdefault(device, key)
        if other != key and not device.startswith("fake:"):
            raise Problem(described.file, key, f"{device} is {other} already: each has a device of its own")


def _model(described: Description, part: str) -> str:
    return described.units[part].model if part in described.units else ""


def _check_outputs(
    table: "Hardware", controller: Controller, unit: str, problem: Callable[[str, str], Problem]
) -> None:
    clocks = set(controller.pulse_output.pins.values())
    outputs = [pin.name for pin in controller.pins if pin.kind.drives and pin.name not in clocks]
    for pin in table.outputs:
        if pin in clocks:
            raise problem(f"outputs.{pin}", f"{pin} carries the steps: name its pin with step")
        if pin not in outputs:
            raise problem(f"outputs.{pin}", str(catalogue.unknown(f"output of {unit}", pin, outputs)))


def _check_input(
    pin: str, controller: Controller, unit: str, joined: Joined, problem: Callable[[str, str], Problem]
) -> None:
    inputs = [found.name for found in controller.pins if found.kind.reads]
    if pin not in inputs:
        raise problem(f"inputs.{pin}", str(catalogue.unknown(f"input of {unit}", pin, inputs)))
    if pin in controller.step_inputs():
        raise problem(f"inputs.{pin}", f"every pulse on {unit}.{pin} is a step, {STEPS_LOST}")
    if joined.drivers:
        what = f"{unit}.{pin} is on a wire from {joined.drivers[0]} in this cell already: remove one of them"
        raise problem(f"inputs.{pin}", what)


def _check_switches(
    described: Description, key: str, controller: Controller, axis: str, joined: Callable[[str, str], Joined]
) -> None:
    """Every switch of a driven axis is there, on the board that steps it; or somebody says that there is none."""
    unit, table = key.partition(".")[0], described.hardware[key]
    switches = controller.switches(axis)
    mine = {name: each for name, each in described.hardware.items() if name.partition(".")[0] == unit}
    for pin in table.unwired:
        if pin not in switches:
            message = str(catalogue.unknown(f"switch of {key}", pin, switches))
            raise Problem(described.file, f"hardware.{key}.unwired", message)
    for pin in switches:
        at = next((name for name, each in mine.items() if pin in each.inputs), None)
        if at is not None and pin in table.unwired:
            raise Problem(described.file, f"hardware.{key}.unwired", f"{pin} is wired in hardware.{at}: leave it out")
        if at is not None and mine[at].board != table.board:
            what = (
                f"{pin} stops {key}, which is on {table.board}: a stop on another board comes too late; wire it there"
            )
            raise Problem(described.file, f"hardware.{at}.inputs.{pin}", what)
        if at is None and pin not in table.unwired and not joined(unit, pin).drivers:
            what = f"{key} has no {pin}: wire it, inputs = {{ {pin} = 'PIN' }}"
            remedy = f"or say that the machine has none, unwired = ['{pin}']"
            raise Problem(described.file, f"hardware.{key}.inputs", f"{what}, {remedy}")


def unreal(described: Description, controllers: Sequence[str], *, driven: bool) -> list[str]:
    """What of a cell with boards has no real pins, so that nobody waits for a motor that is none."""
    if not described.hardware:
        return []
    used = list(dict.fromkeys(table.board for table in described.hardware.values()))
    if not driven:
        return [f"No pin is driven: with --real the motors on {', '.join(used)} would move."]
    units = {key.partition(".")[0] for key in described.hardware}
    told = []
    alone = [unit for unit in controllers if unit not in units]
    if alone:
        told.append(f"Without real pins: {', '.join(alone)} ([hardware.{alone[0]}] would give it some)")
    spare = [name for name in described.boards if name not in used]
    if spare:
        told.append(f"Nothing hangs on {', '.join(spare)}")
    return told
