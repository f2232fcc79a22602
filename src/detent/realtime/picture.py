"""A cell that is served, as plain data: its time, units, pins, lines, switches, motors and recent events."""

from collections.abc import Sequence
from typing import TypeVar

from detent.cell.cell import Cell
from detent.cell.faults import StuckPin, StuckSwitch
from detent.cell.mechanics import Mechanics
from detent.cell.switches import Switch
from detent.controllers.device import Cautioned, Powered, Refused
from detent.pins import Level, Pin
from detent.realtime.boards.driven import Driven
from detent.realtime.plain import as_json
from detent.realtime.subject import Subject
from detent.realtime.verbs import Answer, Json
from detent.realtime.watch import Event, Watch

F = TypeVar("F", StuckPin, StuckSwitch)


def time_of(subject: Subject) -> Answer:
    """The time of the cell, and whether it stands."""
    pace = subject.pace
    factor = None if pace.free else float(pace.factor)
    stopped: Answer = {"stopped": subject.stopped} if subject.stopped else {}
    return {"time_ns": subject.cell.now, "paused": pace.held, "pace": factor, **subject.standing(), **stopped}


def whole_state(subject: Subject) -> Answer:
    """Everything but the faults."""
    cell, late = subject.cell, subject.lateness()
    names = cell.wiring.names[: cell.wiring.units]
    return {
        **time_of(subject),
        "late_ns": {"deadlines": late.deadlines, "p50": late.p50, "p99": late.p99, "most": late.most},
        "units": {name: unit_state(subject, name) for name in names},
        "lines": {name: _line(subject, number) for number, name in enumerate(cell.wiring.line_names)},
        "switches": switches_of(subject),
        "motors": {
            cell.wiring.names[n]: _motor(cell, part) for n, part in enumerate(cell.parts) if isinstance(part, Mechanics)
        },
        "events": _events(subject),
        **({} if subject.driven is None else {"real": real_state(subject.driven)}),
    }


def real_state(driven: Driven) -> Answer:
    """How the axes with real pins stand, and their boards."""
    axes: dict[str, Json] = {}
    for state in driven.axes():
        told = as_json(state._replace(standing=state.standing.value))  # type: ignore[arg-type]
        axes[f"{state.unit}.{state.axis}" if state.axis else state.unit] = told
    boards: dict[str, Json] = {state.board: as_json(state) for state in driven.board_states()}
    return {"axes": axes, "boards": boards, "escaped": driven.rollback.escaped, "stops": driven.rollback.rewinds}


def unit_state(subject: Subject, name: str) -> Answer:
    """How a unit stands."""
    cell, watch = subject.cell, _watch(subject)
    index = cell.unit(name)
    seen = watch.of_unit[index]
    front = seen.front
    found: Answer = {
        "model": subject.description.units[name].model,
        "powered": cell.circuit.supplied(index),
        "pins": {pin.name: front.levels[pin.name] for pin in _pins(cell, index)},
        "received": seen.received,
        "sent": seen.sent,
        "said": bytes(value & 0xFF for value in seen.said).decode("latin-1"),
        "refused": None if front.refused is None else as_json(front.refused),
    }
    if name not in cell.controllers():
        return found
    controller = cell.controller(name)
    axes: dict[str, Json] = {}
    for axis, travel in front.travels.items():
        status, (_, rate) = controller.status(cell.now, axis), travel.at(cell.now)
        axes[axis] = {"position": status.position, "pulses": status.pulses, "rate": rate, "state": status.state}
    return found | {
        "state": controller.status(cell.now).state,
        "axes": axes,
        "executing": None if front.executing is None else as_json(front.executing),
        "image_bytes": len(controller.kept_memory()),
    }


def pins_of(subject: Subject, name: str) -> dict[str, dict[str, Json]]:
    """The inputs, straps and outputs of a unit; the level is None where an output is let go, or nobody has asked."""
    cell, circuit = subject.cell, subject.cell.circuit
    index, stuck = cell.unit(name), {f.pin for f in _faults(cell, StuckPin) if f.unit == name}
    return {
        pin.name: {
            "level": level_of(subject, name, pin.name),
            "kind": pin.kind.value,
            "wired": (circuit.net_driven if pin.kind.drives else circuit.net_read)(index, pin.name) is not None,
            "stuck": pin.name in stuck,
        }
        for pin in _pins(cell, index)
    }


def level_of(subject: Subject, name: str, pin: str) -> Level | None:
    """The level of a pin of a unit; None where an output is let go, or nobody has asked."""
    return _watch(subject).of_unit[subject.cell.unit(name)].front.levels[pin]


def switches_of(subject: Subject) -> dict[str, Json]:
    """The contacts of the cell: the level that each gives, and whether it is stuck there."""
    cell = subject.cell
    names = dict.fromkeys(subject.description.switches)
    names |= dict.fromkeys(n for n, part in zip(cell.wiring.names, cell.parts, strict=True) if isinstance(part, Switch))
    stuck = {fault.switch: fault.level for fault in _faults(cell, StuckSwitch)}
    found: dict[str, Json] = {}
    for name in names:
        part, pin = cell.circuit.contact(name)
        net = cell.circuit.net_driven(part, pin)
        level = None if net is None else cell.circuit.nets[net].levels.get((part, pin))
        found[name] = {"level": stuck.get(name, level), "stuck": name in stuck}
    return found


def _pins(cell: Cell, unit: int) -> list[Pin]:
    """The inputs, straps and outputs of a unit."""
    return [pin for pin in cell.parts[unit].pins if pin.kind.drives or pin.kind.reads]


def _watch(subject: Subject) -> Watch:
    assert subject.watch is not None
    return subject.watch


def _faults(cell: Cell, kind: type[F]) -> Sequence[F]:
    return [fault for fault in cell.faults.standing.values() if isinstance(fault, kind)]


def _line(subject: Subject, number: int) -> Answer:
    cell, watch = subject.cell, _watch(subject)
    line, units = cell.lines[number], [unit for unit, _ in cell.wiring.lines[number]]
    return {
        "format": str(line.format),
        "units": [cell.wiring.names[unit] for unit in units],
        "endpoints": [f"{kind} {address}" for at, kind, address in subject.addresses() if at == number],
        "received": max(watch.of_unit[unit].received for unit in units),
        "sent": sum(watch.of_unit[unit].sent for unit in units),
    }


def _motor(cell: Cell, motor: Mechanics) -> Answer:
    rotor = motor.rotor_at(cell.now)
    return {"place": float(motor.place_of(rotor.angle)), "command": motor.command(cell.now), "rad_per_s": rotor.speed}


def _events(subject: Subject) -> list[Json]:
    """The newest, in order of time: refusals and cautions, supplies, images, characters that faults have changed."""
    cell = subject.cell
    found = [(event.at, cell.wiring.names[unit], _event(event)) for unit, event in _watch(subject).events]
    for number, strike in cell.faults.strikes():
        told = as_json(strike) | {"event": "lost" if strike.after is None else "damaged"}
        found.append((strike.at, cell.wiring.line_names[number], told))
    found.sort(key=lambda event: event[0])
    return [{"where": where, **told} for _, where, told in found]


def _event(event: Event) -> dict[str, Json]:
    if isinstance(event, Refused):
        return {"event": "refused", **as_json(event)}
    if isinstance(event, Cautioned):
        return {"event": "caution", **as_json(event)}
    if isinstance(event, Powered):
        return {"event": "on" if event.on else "off", "at": event.at}
    return {"event": "image", "at": event.at, "bytes": len(event.image)}
