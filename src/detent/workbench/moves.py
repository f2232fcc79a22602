"""What the Motion page asks of the server: the law of an axis, a move, and what a motor makes of it (see `motion`)."""

import asyncio
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

from pydantic import BaseModel, ConfigDict, Field

from detent.cell.description import Description, Problem
from detent.cell.fitting import load_of, rated
from detent.cell.tables import Motor as Fitted
from detent.controllers import catalogue
from detent.motors.damping import CHOPPER, usual
from detent.motors.drive import Decay
from detent.motors.load import NO_LOAD
from detent.motors.motor import Motor, MotorError
from detent.motors.named import MOTORS
from detent.motors.rotor import Rig
from detent.moves import laws
from detent.moves.law import Law, clipped, in_force, stepping
from detent.realtime.cell_source import find_cell
from detent.workbench import motion
from detent.workbench.live import Live
from detent.workbench.motion import Floats, Picture

if TYPE_CHECKING:
    from detent.workbench.client import Bench

Name = Annotated[str, Field(max_length=200)]
Values = Annotated[dict[str, int], Field(max_length=16)]

FIRST_STEPS = 500  # of the move that a page begins with
SUPPLY = 24.0  # V, of a motor that is not fitted


class Axis(BaseModel):
    """Which axis, and the move that it shall make."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    unit: Name
    axis: Name = ""
    values: Values = {}
    steps: Annotated[int, Field(ge=1)] = FIRST_STEPS


class Form(BaseModel):
    """A motor with its drive and load, as a person writes them: V, A, kg cm2, Nm."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    motor: Name
    stepping: Name
    supply: Annotated[float, Field(gt=0, le=1000)]
    current: Annotated[float, Field(gt=0, le=100)]
    inertia: Annotated[float, Field(ge=0, le=1e4)]
    friction: Annotated[float, Field(ge=0, le=1e3)]
    damping: Annotated[float, Field(ge=0, le=2)] | None = None  # ratio; None: what is assumed


class Moves:
    """The calls of the Motion page, offered as ``motion_about`` and so on."""

    def __init__(self, bench: "Bench", live: Live) -> None:
        self._bench = bench
        self._one = asyncio.Lock()  # motors are simulated one after the other
        for call in (self.about, self.move, self.motor):
            live.offer(f"motion_{call.__name__}", call)

    def _law(self, unit: str, axis: str) -> Law:
        picture = self._bench.picture.units.get(unit)
        if picture is None or axis not in picture.axes:
            raise ValueError(f"there is no axis {unit} {axis}".rstrip())
        defaults = {option.name: option.default for option in catalogue.model(picture.model).options}
        chosen = {option.name: option.value for option in picture.options if option.value != defaults[option.name]}
        return laws.law(picture.model, chosen, axis)

    async def about(self, unit: Name, axis: Name = "") -> dict[str, object]:
        """The settings of an axis with their ranges and what is in force, the motors, and the one that is fitted."""
        law, state = self._law(unit, axis), self._bench.state.units[unit]
        return {
            "unit": unit, "axis": axis, "model": law.model, "law": law.title, "units": law.unit,
            "most": law.most, "steps": min(FIRST_STEPS, law.most),
            "settings": [setting._asdict() for setting in law.settings],
            "values": dict(in_force(law, state.registers, axis)),
            "steppings": [winding.name for winding in law.windings],
            "stepping": stepping(law, state.registers),
            "motors": [_facts(name, motor) for name, motor in self._motors().items()],
            "fitted": self._fitted(law, unit, axis),
        }  # fmt: skip

    async def move(self, wanted: Axis) -> dict[str, object]:
        """The picture of a move, and the command lines that make it."""
        law = self._law(wanted.unit, wanted.axis)
        values, steps = clipped(law, wanted.values), min(wanted.steps, law.most)
        drawn = motion.picture(law.train(values, steps))
        commands = law.commands(values, steps)
        return {
            "values": dict(values), "steps": steps, "times": _numbers(drawn.times, 9),
            "speeds": _numbers(drawn.speeds, 4), "positions": _numbers(drawn.positions, 4),
            "duration": drawn.duration, "peak": round(drawn.peak, 3), "mean": round(drawn.mean, 3),
            "up": drawn.ramps[0], "down": drawn.duration * 1e-9 - drawn.ramps[1], "reached": drawn.reached,
            "settings": list(commands.settings), "go": commands.go,
        }  # fmt: skip

    async def motor(self, wanted: Axis, form: Form) -> dict[str, object]:
        """What a motor makes of a move: its torque over speed, what the move asks of it, and the verdict."""
        law = self._law(wanted.unit, wanted.axis)
        async with self._one:
            entry = self._entry(wanted.unit, wanted.axis)
            return await asyncio.to_thread(_judged, law, wanted, form, self._motors(), entry)

    def _fitted(self, law: Law, unit: str, axis: str) -> dict[str, object] | None:
        """The motor that the cell file puts on an axis, as the form has it; None without one."""
        found = self._entry(unit, axis)
        return None if found is None else {"name": found[0], **_form(law, *found)}

    def _entry(self, unit: str, axis: str) -> tuple[str, Fitted] | None:
        described = self._described()
        for name, entry in described.motors.items() if described is not None else ():
            if entry.unit == unit and (entry.axis == axis or len(self._bench.picture.units[unit].axes) == 1):
                return name, entry
        return None

    def _described(self) -> Description | None:
        try:
            return find_cell(self._bench.picture.target).description
        except Problem:
            return None

    def _motors(self) -> dict[str, Motor]:
        """The motors to choose from: those that are known, and those of the cell that have data of their own."""
        described = self._described()
        entries = {} if described is None else described.motors
        own = {name: rated(name, entry) for name, entry in entries.items() if _named(name, entry) == name}
        return {**own, **MOTORS}


def _form(law: Law, name: str, entry: Fitted) -> dict[str, object]:
    """The form for a motor as a cell file has it."""
    current = entry.current
    if current is None:
        amps = rated(name, entry).current
    else:
        amps = current if isinstance(current, int | float) else max(current.run, current.ramp)
    steppings = [winding.name for winding in law.windings]
    load = load_of(entry)
    return {
        "motor": _named(name, entry),
        "stepping": entry.step if entry.step in steppings else (steppings or [""])[0],
        "supply": entry.supply, "current": amps, "inertia": load.inertia * 1e4, "friction": load.friction,
        "damping": _damping(entry, rated(name, entry)),
    }  # fmt: skip


def _named(name: str, entry: Fitted) -> str:
    """By which name the page knows the motor of an entry: its own where it is not one of those with names."""
    return name if entry.data or entry.wiring or entry.fitted else entry.motor


def _damping(entry: Fitted, motor: Motor) -> float:
    own = motor.damping if entry.damping is None else entry.damping
    return usual(entry.decay).ratio if own is None else own


def _facts(name: str, motor: Motor) -> dict[str, object]:
    return {
        "name": name, "title": motor.title, "supply": SUPPLY, "current": motor.current,
        "inertia": round((motor.inertia or 0.0) * 1e4, 5), "torque": motor.holding_torque,
        "damping": CHOPPER.ratio if motor.damping is None else motor.damping,
    }  # fmt: skip


def _rig(law: Law, form: Form, motors: Mapping[str, Motor], fitted: tuple[str, Fitted] | None) -> Rig:
    windings = {winding.name: winding for winding in law.windings}
    if form.stepping not in windings:
        raise MotorError("the size of these microsteps divides no full step: no motor can be judged with it")
    if form.motor not in motors:
        raise MotorError(f"no motor {form.motor!r}; there are: {', '.join(motors)}")
    # the motor of the cell keeps what the form does not ask for
    entry = fitted[1] if fitted is not None and form.motor == _named(*fitted) else None
    rest = NO_LOAD if entry is None else load_of(entry)
    decay: Decay = "fast" if entry is None else entry.decay
    return motion.rig(
        motors[form.motor], windings[form.stepping], supply=form.supply, current=form.current,
        inertia=form.inertia * 1e-4, friction=form.friction, damping=form.damping, rest=rest, decay=decay,
    )  # fmt: skip


def _judged(
    law: Law, wanted: Axis, form: Form, motors: Mapping[str, Motor], fitted: tuple[str, Fitted] | None
) -> dict[str, object]:
    """Everything that is shown of a motor. Raises MotorError."""
    rig = _rig(law, form, motors, fitted)
    train = law.train(clipped(law, wanted.values), min(wanted.steps, law.most))
    drawn: Picture = motion.picture(train)
    per_step = rig.drive.winding.steps
    curve = motion.torque_curve(rig, drawn.peak / per_step)
    asked = motion.demand(drawn, rig)
    found: dict[str, object] = {
        "curve": [[point.rate * per_step, round(point.torque, 6)] for point in curve],
        "asked": [[float(speed), round(float(torque), 6)] for speed, torque in zip(*asked, strict=True)],
    }
    try:
        judgement = motion.judgement(train, rig)
    except MotorError as error:
        return found | {"verdict": None, "words": str(error)}
    verdict, rate = judgement.verdict, judgement.rate
    return found | {
        "verdict": {
            "lost": verdict.lost, "margin": verdict.margin, "angle": verdict.load_angle, "error": verdict.error,
            "often": 0 if rate is None else rate.lost + rate.corners_lost,
            "of": 0 if rate is None else rate.tried + rate.corners,
        },
        "words": judgement.words(rig),
    }  # fmt: skip


def _numbers(values: Floats, digits: int) -> list[float]:
    return [round(float(value), digits) for value in values]
