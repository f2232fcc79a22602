"""From what a person writes on the Motion page, a motor with its drive and load, to a rig that is judged."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Literal, NamedTuple, get_args

from pydantic import BaseModel, ConfigDict, Field

from detent.cell.fitting import load_of, rated
from detent.cell.tables import Motor as Fitted
from detent.motors import own
from detent.motors.damping import CHOPPER, usual
from detent.motors.drive import Decay, Drive
from detent.motors.drives import PRESETS
from detent.motors.drives import drive as preset
from detent.motors.fit import fit_from_curve, fitted
from detent.motors.load import NO_LOAD
from detent.motors.mechanics import Mechanics
from detent.motors.motor import WIRINGS, Motor, MotorError
from detent.motors.named import CURVES
from detent.motors.rotor import Rig
from detent.motors.winding import Winding
from detent.moves.law import Law
from detent.workbench import motion
from detent.workbench.answers import FittedMotor, MotorFacts

Name = Annotated[str, Field(max_length=200)]
File = Annotated[str, Field(max_length=200_000)]
Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]

SUPPLY = 24.0  # V, of a motor that is not fitted
DRIVES = (*get_args(Decay), *PRESETS)
"""How currents fall, and drives by name."""


class OwnMotor(BaseModel):
    """A motor of one's own: its TOML, and the CSV of its torque curve, measured with the drive of the form."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    name: Name
    text: File
    curve: File = ""
    curve_name: Name = ""


class Moved(BaseModel):
    """What moves along a line: by mm a turn of a screw, or mm of radius of a pulley or pinion; kg, N, degrees."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    by: Literal["", "screw", "belt", "rack"] = ""
    size: Number = 0.0
    gear: Number = 1.0
    mass: Number = 0.0
    slope: Number = 0.0
    force: Number = 0.0
    drag: Number = 0.0

    @property
    def mechanics(self) -> Mechanics:
        """In SI units. MotorError."""
        way = {self.by: self.size * 1e-3} if self.by else {}
        return Mechanics(**way, gear=self.gear, mass=self.mass, slope=self.slope, force=self.force, drag=self.drag)


class Form(BaseModel):
    """A motor with its drive and load, as a person writes them: V, A, kg cm2, Nm.

    `drive` is how currents fall, or a drive by name; "" is that of the motor in the cell, or fast.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    motor: Name
    stepping: Name
    supply: Annotated[float, Field(gt=0, le=1000)]
    current: Annotated[float, Field(gt=0, le=100)]
    inertia: Annotated[float, Field(ge=0, le=1e4)]
    friction: Annotated[float, Field(ge=0, le=1e3)]
    damping: Annotated[float, Field(ge=0, le=2)] | None = None  # ratio; None: what is assumed
    drive: Name = ""
    wiring: Name = ""
    fit: bool = False  # to the curve that the maker published
    own: OwnMotor | None = None
    moved: Moved = Moved()


class Made(NamedTuple):
    """A rig, and what is to be known of its motor."""

    rig: Rig
    words: str  # how good a fit is; "" without one
    travel: float | None  # mm that a turn of the motor moves


def made(law: Law, form: Form, motors: Mapping[str, Motor], entry: tuple[str, Fitted] | None) -> Made:
    """The rig of a form; `entry` is the motor that the cell file has on the axis, with its name. MotorError."""
    windings = {winding.name: winding for winding in law.windings}
    if form.stepping not in windings:
        raise MotorError("the size of these microsteps divides no full step: no motor can be judged with it")
    winding = windings[form.stepping]
    # the motor of the cell keeps what the form does not ask for
    mine = entry[1] if entry is not None and form.own is None and form.motor == named(*entry) else None
    rest = NO_LOAD if mine is None else load_of(mine)
    name = form.drive or ("fast" if mine is None else mine.drive or mine.decay)
    motor, words = _motor(form, motors, name, winding)
    mechanics = form.moved.mechanics
    felt = mechanics.load()
    rig = motion.rig(
        motor, driven(name, form.supply, form.current, winding),
        inertia=form.inertia * 1e-4 + felt.inertia, friction=form.friction + felt.friction,
        damping=form.damping, rest=rest, pull=felt.torque,
    )  # fmt: skip
    travel = mechanics.travel
    if travel is None and mine is not None:
        travel = Mechanics(**mine.mechanics).travel
    return Made(rig, words, None if travel is None else travel * 1e3)


def driven(name: str, supply: float, current: float, winding: Winding) -> Drive:
    """The drive of a name of `DRIVES`. MotorError."""
    if name in get_args(Decay):
        return Drive(supply, current, winding, name)  # type: ignore[arg-type]
    return preset(name, supply, current, winding)


def _motor(form: Form, motors: Mapping[str, Motor], drive: str, winding: Winding) -> tuple[Motor, str]:
    if form.own is not None:
        found, words = own_motor(form.own, form.supply, form.current, drive, winding)
    elif form.motor not in motors:
        raise MotorError(f"no motor {form.motor!r}; there are: {', '.join(motors)}")
    elif form.fit:
        fit = fitted(form.motor) if form.motor in CURVES else None
        if fit is None:
            raise MotorError(f"nobody has published a torque curve of {form.motor}: leave the fit out")
        found, words = fit.motor, f"fit {fit.reach}"
    else:
        found, words = motors[form.motor], ""
    return (found.wired(form.wiring) if form.wiring else found), words


@lru_cache(maxsize=8)
def own_motor(files: OwnMotor, supply: float, current: float, drive: str, winding: Winding) -> tuple[Motor, str]:
    """The motor of somebody's files, and how good the fit to its curve is. MotorError."""
    motor, published = own.read(files.text, files.name)
    if files.curve:
        points = own.read_curve(files.curve, files.curve_name, step=winding.name, steps=motor.steps)
        fit = fit_from_curve(motor, driven(drive, supply, current, winding), points)
    elif published is not None and published.file:
        raise MotorError(f"{files.name}: its curve is in {published.file}: choose that file beside it")
    elif published is not None:
        fit = published.fit(motor)
    else:
        return motor, ""
    return fit.motor, f"fit {fit.reach}"


# -- what a form begins with ------------------------------------------------------------------------------------


def form_of(law: Law, name: str, entry: Fitted) -> FittedMotor:
    """The form for a motor as a cell file has it."""
    current = entry.current
    if current is None:
        amps = rated(name, entry).current
    else:
        amps = current if isinstance(current, int | float) else max(current.run, current.ramp)
    load = load_of(entry)
    travel = Mechanics(**entry.mechanics).travel
    return {
        "name": name,
        "motor": named(name, entry),
        "stepping": entry.step if entry.step in [winding.name for winding in law.windings] else "",
        "supply": entry.supply, "current": amps, "inertia": load.inertia * 1e4, "friction": load.friction,
        "damping": _damping(entry, rated(name, entry)), "travel": None if travel is None else travel * 1e3,
        "steps": rated(name, entry).steps, "wirings": [],
    }  # fmt: skip


def facts_of(name: str, motor: Motor) -> MotorFacts:
    """The form for a motor by name."""
    return {
        "name": name, "title": motor.title, "supply": SUPPLY, "current": motor.current,
        "inertia": round((motor.inertia or 0.0) * 1e4, 5), "torque": motor.holding_torque,
        "damping": CHOPPER.ratio if motor.damping is None else motor.damping, "steps": motor.steps,
        "curve": name in CURVES, "wiring": motor.wiring, "wirings": list(WIRINGS) if motor.wiring else [],
    }  # fmt: skip


def named(name: str, entry: Fitted) -> str:
    """By which name the page knows the motor of an entry: its own where it is not one of those with names."""
    return name if entry.data or entry.wiring or entry.fitted else entry.motor


def _damping(entry: Fitted, motor: Motor) -> float:
    ratio = motor.damping if entry.damping is None else entry.damping
    return usual(entry.decay).ratio if ratio is None else ratio
