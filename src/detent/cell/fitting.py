"""Motors fitted to a cell: from ``[motors.NAME]`` and the switches on its axis to a `Mechanics`."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, replace
from math import inf, pi
from typing import Any

from detent.cell.contacts import PINS, Contact, Detector
from detent.cell.description import Description, Problem
from detent.cell.mechanics import Mechanics
from detent.cell.tables import Current, Motor, Switch
from detent.motors import own
from detent.motors.damping import Damping, given
from detent.motors.drive import Currents, Drive
from detent.motors.drives import drive as by_name
from detent.motors.fit import fitted
from detent.motors.load import Load, profile
from detent.motors.mechanics import Mechanics as Mechanics_
from detent.motors.motor import Motor as Rated
from detent.motors.motor import MotorError
from detent.motors.named import motor as named
from detent.motors.rotor import Rig
from detent.motors.winding import COMMANDED, GRID, Winding, winding
from detent.nearest import did_you_mean

HALF_A_STEP = 0.5

_STEPPINGS = {  # places in a full step that a controller with its own sequence can command
    "supersigma": (2,),
    "dcb-274": (1, 2, 4, 8),
    "bs0610": (1, 2, 4, 8, 16, 32, 64),
    "bs0710": (1, 2, 4, 8, 16, 32, 64),
}


def motors_by_axis(description: Description) -> dict[tuple[str, str], str]:
    """Which motor sits on which axis (unit, axis). Raises Problem for a second one."""
    found: dict[tuple[str, str], str] = {}
    for name, entry in description.motors.items():
        if entry.unit is None:
            continue
        other = found.setdefault((entry.unit, entry.axis), name)
        if other != name:
            what = (
                f"{other} is on the axis of {entry.unit} already: a second one needs a unit, or step pulses, of its own"
            )
            raise Problem(description.file, f"motors.{name}.unit", what)
    return found


def split_axis(text: str) -> tuple[str, str]:
    """Unit and axis of ``UNIT`` or ``UNIT.AXIS``."""
    unit, _, axis = text.partition(".")
    return unit, axis


def mechanics(
    description: Description, name: str, switches: Mapping[str, Switch], shaft: int, record: bool
) -> Mechanics:
    """The mechanics of the motor `name`, with the switches that its rotor moves. Raises Problem."""
    entry = description.motors[name]
    check_stepping(description, name)
    try:
        model = "" if entry.unit is None else description.units[entry.unit].model
        rig = _rig(name, entry, COMMANDED.get(model, ()))
        step = GRID // winding(entry.step).steps if "step" in entry.model_fields_set else None
        contacts = [_contact(switch, place, entry) for switch, place in switches.items()]
        detector = Detector(entry.window)
        return Mechanics(rig, axis=entry.axis, shaft=float(shaft), reverse=entry.reverse, contacts=contacts,
                         detector=detector, record=record, step=step)  # fmt: skip
    except MotorError as error:
        raise Problem(description.file, f"motors.{name}", str(error)) from None


def with_own_motors(description: Description, read: Callable[[str], str]) -> Description:
    """The description with the data of motors that are files (motor = "my.toml") in place of their names.

    A curve that such a file names is read, too, and the motor fitted to it. Raises Problem.
    """
    files = {name: entry for name, entry in description.motors.items() if entry.motor.endswith(".toml")}
    motors = dict(description.motors)
    for name, entry in files.items():
        try:
            motors[name] = entry.model_copy(update={"motor": "", "data": {**_data_of(entry.motor, read), **entry.data}})
        except (MotorError, OSError, UnicodeDecodeError) as error:
            what = str(error) if isinstance(error, MotorError) else f"cannot read {entry.motor} or its curve: {error}"
            raise Problem(description.file, f"motors.{name}.motor", what) from None
    return replace(description, motors=motors) if files else description


def _data_of(file: str, read: Callable[[str], str]) -> dict[str, Any]:
    found, curve = own.read(read(file), file)
    if curve is not None:
        points = curve.points
        if curve.file:
            beside = "/".join([*file.split("/")[:-1], curve.file])
            points = own.read_curve(read(beside), beside, step=curve.step, steps=found.steps)
        found = curve.fit(found, points).motor
    names = [field.name for field in fields(Rated) if field.name not in ("name", "title", "source")]
    return {name: value for name in names if (value := getattr(found, name)) not in (None, "")}


def rated(name: str, entry: Motor) -> Rated:
    """The motor that an entry ``[motors.NAME]`` means: the named one, with its own numbers, or all of its own.

    Its windings are connected as the entry says. Raises MotorError.
    """
    found = _as_sold(name, entry)
    return found.wired(entry.wiring) if entry.wiring else found


def _as_sold(name: str, entry: Motor) -> Rated:
    known = {field.name: field for field in fields(Rated) if field.name not in ("name", "title", "source")}
    given: dict[str, Any] = {}
    for key, value in entry.data.items():
        if key not in known:
            hint = did_you_mean(key, known)
            raise MotorError(f"data: a motor has no {key!r}; {hint}there are: {', '.join(known)}")
        if isinstance(value, str) != isinstance(known[key].default, str):
            kind = "a word" if isinstance(known[key].default, str) else "a number"
            raise MotorError(f"data: {key} is {value!r}: give {kind}")
        given[key] = int(value) if key == "steps" and not isinstance(value, str) and value == int(value) else value
    if entry.motor:
        found = fitted(entry.motor).motor if entry.fitted else named(entry.motor)
        return found.changed(**given) if given else found
    if entry.fitted:
        raise MotorError("fitted is for a named motor, whose curve is known; leave it out: the data say what they say")
    missing = [key for key, field in known.items() if field.default is MISSING and key not in given]
    if missing:
        raise MotorError(f"data: a motor of your own needs {', '.join(missing)} too (in SI units: ohm, H, A, Nm)")
    return Rated(name, **given)


def check_stepping(description: Description, name: str) -> None:
    """Raise Problem if a motor's `step` is none that its unit can give, or its wires cannot choose its currents."""
    entry = description.motors[name]
    wired = {pin for wire in description.wires for target in wire.to
             for motor, _, pin in [target.partition(".")] if motor == name}  # fmt: skip
    wired |= {pin for switch in description.switches.values() for target in switch.drives
              for motor, _, pin in [target.partition(".")] if motor == name}  # fmt: skip
    key = f"motors.{name}"
    try:
        places = winding(entry.step).steps
    except MotorError as error:
        raise Problem(description.file, f"{key}.step", str(error)) from None
    if "HALF" in wired and places != 2:
        what = (
            f"{entry.step}: with a wire to HALF the drive is half-stepped, and 0 there makes two half steps of a pulse"
        )
        raise Problem(description.file, f"{key}.step", f"{what}: write step = 'half', or cut the wire")
    model = "" if entry.unit is None else description.units[entry.unit].model
    can = _STEPPINGS.get(model)
    if "step" in entry.model_fields_set and can is not None and places not in can:
        steppings = ", ".join(f"1/{each}" if each > 2 else {1: "full", 2: "half"}[each] for each in can)
        raise Problem(description.file, f"{key}.step", f"{entry.step}: a {model} steps its motor by {steppings}")
    current = entry.current
    if isinstance(current, Current) and current.ramp:
        needed = {
            "MOV": current.rest != current.ramp or current.slew != current.ramp,
            "RAMP": current.slew != current.ramp,
        }
        missing = [pin for pin, is_needed in needed.items() if is_needed and pin not in wired]
        if missing:
            unit = entry.unit or "UNIT"
            wires = " and ".join(f"{unit}.{pin} to {name}.{pin}" for pin in missing)
            what = f"ramp, slew and rest are chosen by the pins MOV and RAMP: wire {wires}, or give run, hold and after"
            raise Problem(description.file, f"{key}.current", what)


def check_names(description: Description, taken: Sequence[str]) -> None:
    """Raise Problem if a motor has a name that is something else's, or a switch has that of one of its pins."""
    pins = {pin.name for pin in PINS}
    for name in description.motors:
        if name in taken:
            raise Problem(description.file, f"motors.{name}", "a unit or switch has this name already: choose another")
    for name, switch in description.switches.items():
        if switch.axis is not None and name in pins:
            raise Problem(description.file, f"switches.{name}", "a pin of every motor has this name: choose another")


def _rig(name: str, entry: Motor, sequences: tuple[Winding, ...]) -> Rig:
    found = rated(name, entry)
    load = load_of(entry)
    current = entry.current
    if isinstance(current, (int, float)):
        amps, currents = float(current), Currents()
    elif current is None:
        amps, currents = found.current, Currents()
    else:
        amps = max(current.run, current.ramp)
        if current.run:
            currents = Currents(1.0, 1.0, current.hold / amps, max(current.after, 1))
        else:
            currents = Currents(current.ramp / amps, current.slew / amps, current.rest / amps)
    if sequences:
        return _commanded(entry, found, load, sequences, amps)
    return Rig(found, _drive(entry, amps, currents), load, damping=_damping(entry))


def _drive(entry: Motor, amps: float, currents: Currents) -> Drive:
    if not entry.drive:
        return Drive(entry.supply, amps, winding(entry.step), entry.decay, entry.threshold, currents, entry.drop,
                     entry.resistance)  # fmt: skip
    given_too = {"decay", "threshold"} & entry.model_fields_set
    if given_too:
        raise MotorError(f"drive: {entry.drive} has a decay of its own: leave out {' and '.join(sorted(given_too))}")
    made = by_name(entry.drive, entry.supply, amps, winding(entry.step), currents=currents, drop=entry.drop)
    return replace(made, resistance=made.resistance + entry.resistance)


def load_of(entry: Motor) -> Load:
    """What the shaft of an entry ``[motors.NAME]`` feels: its load, its mechanics, and what changes on the way.

    Raises MotorError.
    """
    load = Load(**{str(name): value for name, value in entry.load.items()})  # type: ignore[arg-type]
    known = {field.name for field in fields(Mechanics_)}
    for key in entry.mechanics:
        if key not in known:
            hint = did_you_mean(key, known)
            raise MotorError(f"mechanics: there is no {key!r}; {hint}there are: {', '.join(sorted(known))}")
    mechanics = Mechanics_(**entry.mechanics)
    felt = mechanics.load()
    load = Load(load.inertia + felt.inertia, load.friction + felt.friction, load.viscous + felt.viscous,
                load.torque + felt.torque)  # fmt: skip
    if len(entry.load_by) > len({unit == "s" for unit in entry.load_by}):
        raise MotorError("load_by: a load changes with turns or with m: give one of them")
    for unit, points in entry.load_by.items():
        if unit == "s":
            load = replace(load, torque_by_time=profile(points))
            continue
        if unit == "m" and mechanics.travel is None:
            raise MotorError("load_by: m needs what moves along a line: give mechanics with screw, belt or rack")
        radians = 2 * pi / (mechanics.travel or 1.0 if unit == "m" else 1.0)
        load = replace(load, torque_by_position=profile([(place * radians, torque) for place, torque in points]))
    return load


def _commanded(entry: Motor, found: Rated, load: Load, sequences: tuple[Winding, ...], amps: float) -> Rig:
    """With a controller that commands the power stage: what stands here is the base of that.

    A DCB-274 commands amperes. The boards have no feedback: full power is the supply (BS0610 manual, page 64).
    """
    if entry.drive:
        raise MotorError("drive: this controller has a power stage of its own: leave the key out")
    finest = max(sequences, key=lambda table: len({*zip(table.a, table.b, strict=True)}))
    decay = entry.decay
    given = entry.model_fields_set
    if sequences == COMMANDED["dcb-274"]:
        amps = max(found.current, 1.0)
    elif "decay" not in given:
        decay = "voltage"
        if "current" not in given:
            amps = (entry.supply - entry.drop) / (found.resistance + entry.resistance)
    drive = Drive(entry.supply, amps, finest, decay, entry.threshold, drop=entry.drop, resistance=entry.resistance)
    return Rig(found, drive, load, sequences=sequences, damping=_damping(entry))


def _damping(entry: Motor) -> Damping | None:
    return None if entry.damping is None else given(entry.damping, "from the cell file")


def _contact(name: str, entry: Switch, motor: Motor) -> Contact:
    if entry.axis is not None and split_axis(entry.axis) == (motor.unit, motor.axis):
        # in whole steps, as without a motor: the rotor is at a step while it is nearer to it than to the next
        unplaced = Contact(name, -inf, inf, entry.inside, margin=HALF_A_STEP)
    else:
        unplaced = Contact(name, -inf, inf, entry.inside, lead=motor.lead or 1.0)
    try:
        return unplaced.moved(*entry.range)
    except ValueError as error:
        raise MotorError(str(error)) from None
