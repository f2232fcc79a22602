"""Motor, drive and load from the command line: the options that every verb takes which judges a motor.

`RigOptions` is what may be given, `made` turns it into a `Rig` with a word on everything that was assumed.
"""

import errno
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from cyclopts import Group, Parameter

if TYPE_CHECKING:
    from detent.motors.drive import Drive
    from detent.motors.fit import Fit
    from detent.motors.load import Load
    from detent.motors.motor import Motor
    from detent.motors.rotor import Rig
    from detent.motors.variants import Spread
    from detent.motors.winding import Winding

LONGEST_FILE = 10_000_000  # bytes


@Parameter(name="*", group=Group("Drive and load", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class RigOptions:
    """Motor, drive and load.

    Parameters
    ----------
    supply
        Supply of the drive, V; 24 unless given.
    current
        Phase current with both phases on, A; the motor's own rating unless given.
    step
        full, wave, half, half-compensated, or 1/2 to 1/64; half, or what the controller does, unless given.
    decay
        fast (unless given), slow, mixed, or voltage (pulse width without current feedback).
    drive
        A drive by name: tmc2209, tmc5160, a4988, drv8825, l298; in place of --decay.
    wiring
        series, parallel or unipolar, of a motor that is sold for several.
    damping
        Damping ratio of the bare rotor about the speed of its pulses; 0.12 is assumed for choppers, 0.03 for voltage.
    ring_down
        The damping from a full step: overshoot as a part of the step (0.45), and settling time in s if known
        (0.45,0.03), or a CSV file of seconds and places.
    inertia
        Inertia of the load at the shaft, kg m2; unless given that of the rotor (where the maker gives none: of both).
    friction
        Coulomb friction at the shaft, Nm.
    viscous
        Viscous friction at the shaft, Nm s/rad.
    torque
        Torque at the shaft that pulls towards minus, Nm.
    mass
        What moves along, kg; needs --screw, --belt-radius or --rack-radius.
    screw
        Lead of a screw, m a turn.
    belt_radius
        Radius of the belt's pulley, m.
    rack_radius
        Radius of the pinion on a rack, m.
    gear
        Turns of the motor for one of what follows.
    slope
        Degrees that plus goes up; 90 is straight up, and the mass hangs.
    force
        Force against plus, N.
    drag
        Force against any motion, N.
    driven_inertia
        Inertia behind the gear, kg m2.
    efficiency
        Efficiency of gear and screw, above 0, at most 1.
    load_by
        CSV file of a load that changes: seconds (or turns, or m) and Nm, with a first line like 's, Nm'.
    fit
        Fit inductance and friction to the curve that the maker published, if there is one.
    curve
        CSV file of a measured torque curve (first line like 'half steps/s, Nm'), to fit the motor to.
    """

    supply: float | None = None
    current: float | None = None
    step: str | None = None
    decay: str | None = None
    drive: str | None = None
    wiring: str | None = None
    damping: float | None = None
    ring_down: str | None = None
    inertia: float | None = None
    friction: float = 0.0
    viscous: float = 0.0
    torque: float = 0.0
    mass: float = 0.0
    screw: float | None = None
    belt_radius: float | None = None
    rack_radius: float | None = None
    gear: float = 1.0
    slope: float = 0.0
    force: float = 0.0
    drag: float = 0.0
    driven_inertia: float = 0.0
    efficiency: float = 1.0
    load_by: Path | None = None
    fit: bool = False
    curve: Path | None = None


class Made(NamedTuple):
    """What the options make. `rig` is None where the motor's inertia is not known: then there is a curve only."""

    motor: "Motor"
    drive: "Drive"
    load: "Load"
    rig: "Rig | None"
    fit: "Fit | None"
    words: tuple[str, ...]  # what was assumed, and what is to be known of the fit and the damping


SUPPLY = 24.0  # V
Options = Annotated[RigOptions, Parameter(name="*")]


def made(name: str, options: RigOptions, winding: "Winding | None" = None) -> Made:
    """Motor, drive and load; `winding` is what a controller makes of the step that the options name, or of none.

    Its table for a step may have other currents than the usual one of that name. `name` is a motor's, or a TOML file of
    one's own. MotorError, OSError.
    """
    from dataclasses import replace

    from detent.motors.damping import given
    from detent.motors.motor import MotorError
    from detent.motors.rotor import FINE, Rig
    from detent.motors.winding import HALF
    from detent.motors.winding import winding as by_name

    if options.damping is not None and options.ring_down is not None:
        raise MotorError("--damping and --ring-down: give one of them")
    table = winding or (HALF if options.step is None else by_name(options.step))
    supply = SUPPLY if options.supply is None else options.supply
    motor, fit, words = _motor(name, options, table, supply)
    drive = _drive(options, supply, motor.current if options.current is None else options.current, table)
    drive.check(motor)
    motor, load, assumed = _load(motor, options)
    words += assumed
    if options.load_by is not None:
        load = _changing(load, options, motor)
        words.append(_change_in_words(load, options.load_by))
    damping = None if options.damping is None else given(options.damping)
    if motor.inertia is None:
        return Made(motor, drive, load, None, fit, tuple(words))
    rig = Rig(motor, drive, load, FINE, damping=damping)
    if options.ring_down is not None:
        found = _ring_down(rig, options.ring_down)
        rig = replace(rig, damping=found.damping)
        if found.words:
            words.append(found.words)
    words.insert(0, str(rig.damping))
    return Made(motor, drive, load, rig, fit, tuple(words))


def _motor(name: str, options: RigOptions, table: "Winding", supply: float) -> "tuple[Motor, Fit | None, list[str]]":
    from detent.motors import own
    from detent.motors.fit import fit_from_curve, fitted
    from detent.motors.motor import MotorError
    from detent.motors.named import motor as named

    if options.fit and options.curve is not None:
        raise MotorError("--fit and --curve: give one of them")
    published, fit = None, None
    if name.endswith(".toml"):
        file = Path(name)
        motor, published = own.read(text_of(file), name)
    else:
        motor = named(name)
    if options.curve is not None:
        if options.wiring is not None:
            motor = motor.wired(options.wiring)
        points = own.read_curve(text_of(options.curve), str(options.curve), step=table.name, steps=motor.steps)
        drive = _drive(options, supply, motor.current if options.current is None else options.current, table)
        fit = fit_from_curve(motor, drive, points)
    elif published is not None:
        found = published.points
        if published.file:
            beside = Path(name).parent / published.file
            found = own.read_curve(text_of(beside), str(beside), step=published.step, steps=motor.steps)
        fit = published.fit(motor, found)
    elif options.fit:
        fit = fitted(name) if not name.endswith(".toml") else None
        if fit is None:
            raise MotorError(f"{name}: no [curve] to fit it to: add one, or give --curve FILE")
    words = [] if fit is None else [f"fit {fit.reach}"]
    motor = motor if fit is None else fit.motor
    if options.wiring is not None and options.curve is None:  # a published curve is of the wiring that is published
        motor = motor.wired(options.wiring)
    return motor, fit, words


def _drive(options: RigOptions, supply: float, current: float, table: "Winding") -> "Drive":
    from detent.motors.drive import Drive
    from detent.motors.drives import drive as preset
    from detent.motors.motor import MotorError

    if options.drive is None:
        return Drive(supply, current, table, options.decay or "fast")  # type: ignore[arg-type]
    if options.decay is not None:
        raise MotorError("--drive and --decay: a drive by name has its own decay: give one of them")
    return preset(options.drive, supply, current, table)


def _load(motor: "Motor", options: RigOptions) -> "tuple[Motor, Load, list[str]]":
    from dataclasses import replace

    from detent.motors.mechanics import Mechanics

    words = []
    mechanics = Mechanics(
        options.screw, options.belt_radius, options.rack_radius, options.gear, options.mass, options.force,
        options.slope, options.drag, options.inertia or 0.0, options.driven_inertia, options.friction, options.viscous,
        options.efficiency,
    )  # fmt: skip
    load = mechanics.load()
    load = replace(load, torque=load.torque + options.torque)
    nothing_given = options.inertia is None and load.inertia == 0
    if motor.inertia is None and load.inertia > 0:
        motor, load = motor.changed(inertia=load.inertia), replace(load, inertia=0.0)
        words.append(f"inertia {motor.rotor:.3g} kg m2, of rotor and load together: its maker gives none of the rotor")
    elif motor.inertia is not None and nothing_given:
        load = replace(load, inertia=motor.inertia)
        words.append(f"inertia of the load {load.inertia:.3g} kg m2, that of the rotor again, as none is given")
    elif motor.inertia is not None:
        words.append(f"inertia of the load {load.inertia:.3g} kg m2")
    if load.friction == load.viscous == 0:
        words.append("no friction, as none is given")
    else:
        words.append(f"friction {load.friction:.3g} Nm" + (f", {load.viscous:.3g} Nm s/rad" if load.viscous else ""))
    if load.torque:
        words.append(f"load {load.torque:.3g} Nm")
    return motor, load, words


def _changing(load: "Load", options: RigOptions, motor: "Motor") -> "Load":
    from detent.motors.load import read_profile

    assert options.load_by is not None
    radians = {"turns": 6.283185307179586}
    radius = options.belt_radius if options.belt_radius is not None else options.rack_radius
    if options.screw is not None:
        radians["m"] = 6.283185307179586 * options.gear / options.screw
    elif radius is not None:
        radians["m"] = options.gear / radius
    return read_profile(load, text_of(options.load_by), str(options.load_by), radians)


def _change_in_words(load: "Load", file: Path) -> str:
    by_time = len(load.torque_by_time.values) > 1
    profile = load.torque_by_time if by_time else load.torque_by_position
    what = "time, from the start of each move" if by_time else "place, each move plus from where it is 0"
    low, high = min(profile.values) + load.torque, max(profile.values) + load.torque
    return f"load {low:.3g} to {high:.3g} Nm by {what} ({file.name})"


def _ring_down(rig: "Rig", text: str) -> Any:
    from detent.motors import ring_down
    from detent.motors.motor import MotorError

    if not text.strip():
        raise MotorError("--ring-down: give overshoot and settling time, like 0.45,0.03, or a CSV file")
    parts = [part.strip() for part in text.split(",")]
    try:
        numbers = [float(part.removesuffix("%")) / (100 if part.endswith("%") else 1) for part in parts]
    except ValueError:
        return ring_down.from_record(rig, *ring_down.read(text_of(Path(text)), text))
    if len(numbers) > 2:
        raise MotorError(f"--ring-down {text}: give overshoot and settling time: 0.45,0.03")
    return ring_down.from_overshoot(rig, *numbers)


def step_of(rig: RigOptions, model: str) -> str | None:
    """The stepping asked for. ValueError where that is a setting of the controller."""
    if rig.step is not None and model.lower().startswith("bs0") and rig.step not in ("O0", "O1", "O2"):
        raise ValueError(f"--step {rig.step}: the step size of a {model} is an option: --set step_size=4 is 1/16; "
                         "what --step takes is its step mode: O0, O1, O2")  # fmt: skip
    return rig.step


def read_by(name: str, options: RigOptions) -> list[Path]:
    """Every file that a motor and its options are read from: no output may go there."""
    from detent.motors import own

    files = [options.curve, options.load_by, None if options.ring_down is None else Path(options.ring_down)]
    if name.endswith(".toml"):
        files.append(Path(name))
        with suppress(OSError, ValueError):  # `made` tells what is wrong with it
            _, published = own.read(text_of(Path(name)), name)
            if published is not None and published.file:
                files.append(Path(name).parent / published.file)
    return [file for file in files if file is not None]


def text_of(file: Path) -> str:
    """What a file says. MotorError if it is no text, or much too long; OSError."""
    from detent.motors.motor import MotorError
    from detent.realtime.texts import read_whole

    try:
        data = read_whole(file, LONGEST_FILE)
    except OSError as error:
        if error.errno != errno.EFBIG:
            raise
        raise MotorError(f"{file}: more than {LONGEST_FILE // 1_000_000} MB: this is no such file") from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def spread_of(vary: list[str] | None) -> "Spread":
    """The ranges of the words NAME=PART (inertia=0.2) or NAME=LOW-HIGH (friction=0.3-2). MotorError."""
    from detent.motors.motor import MotorError
    from detent.motors.variants import SPREAD

    parts: dict[str, float | tuple[float, float]] = {}
    for word in (word for text in vary or () for word in text.split(",")):
        name, _, value = word.partition("=")
        try:
            low, dash, high = value.partition("-")
            parts[name.strip().replace("-", "_")] = (float(low), float(high)) if dash else float(low)
        except ValueError:
            raise MotorError(
                f"--vary {word}: write NAME=PART, like inertia=0.2, or NAME=LOW-HIGH, like friction=0.3-2"
            ) from None
    return SPREAD.changed(parts)
