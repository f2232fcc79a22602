"""What the Motion page asks of the server: the law of an axis, a move, and what a motor makes of it (see `motion`)."""

import asyncio
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

from pydantic import BaseModel, ConfigDict, Field

from detent.cell.description import Description, Problem
from detent.cell.description import Motor as Fitted
from detent.cell.fitting import rated
from detent.controllers import catalogue
from detent.motors.load import Load
from detent.motors.motor import Motor, MotorError
from detent.motors.named import MOTORS
from detent.motors.rotor import Rig
from detent.moves import laws
from detent.moves.law import Law, clipped, in_force, stepping
from detent.realtime.target import target
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
            return await asyncio.to_thread(_judged, law, wanted, form, self._motors())

    def _fitted(self, law: Law, unit: str, axis: str) -> dict[str, object] | None:
        """The motor that the cell file puts on an axis, as the form has it; None without one."""
        described = self._described()
        for name, entry in described.motors.items() if described is not None else ():
            if entry.unit == unit and (entry.axis == axis or len(self._bench.picture.units[unit].axes) == 1):
                return {"name": name, **_form(law, name, entry)}
        return None

    def _described(self) -> Description | None:
        try:
            return target(self._bench.picture.target).description
        except Problem:
            return None

    def _motors(self) -> dict[str, Motor]:
        """The motors to choose from: those that are known, and those of the cell that have data of their own."""
        described = self._described()
        own = {} if described is None else {n: rated(n, entry) for n, entry in described.motors.items() if entry.data}
        return {**own, **MOTORS}


def _form(law: Law, name: str, entry: Fitted) -> dict[str, object]:
    """The form for a motor as a cell file has it."""
    current = entry.current
    if current is None:
        amps = rated(name, entry).current
    else:
        amps = current if isinstance(current, int | float) else max(current.run, current.ramp)
    steppings = [winding.name for winding in law.windings]
    load = Load(**{str(name): value for name, value in entry.load.items()})  # type: ignore[arg-type]
    return {
        "motor": name if entry.data else entry.motor,
        "stepping": entry.step if entry.step in steppings else (steppings or [""])[0],
        "supply": entry.supply, "current": amps, "inertia": load.inertia * 1e4, "friction": load.friction,
    }  # fmt: skip


def _facts(name: str, motor: Motor) -> dict[str, object]:
    return {
        "name": name, "title": motor.title, "supply": SUPPLY, "current": motor.current,
        "inertia": round((motor.inertia or 1e-5) * 1e4, 5), "torque": motor.holding_torque,
    }  # fmt: skip


def _rig(law: Law, form: Form, motors: Mapping[str, Motor]) -> Rig:
    windings = {winding.name: winding for winding in law.windings}
    if form.stepping not in windings:
        raise MotorError("the size of these microsteps divides no full step: no motor can be judged with it")
    if form.motor not in motors:
        raise MotorError(f"no motor {form.motor!r}; there are: {', '.join(motors)}")
    return motion.rig(
        motors[form.motor], windings[form.stepping], supply=form.supply, current=form.current,
        inertia=form.inertia * 1e-4, friction=form.friction,
    )  # fmt: skip


def _judged(law: Law, wanted: Axis, form: Form, motors: Mapping[str, Motor]) -> dict[str, object]:
    """Everything that is shown of a motor. Raises MotorError."""
    rig = _rig(law, form, motors)
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
        verdict = motion.judged(train, rig)
    except MotorError as error:
        return found | {"verdict": None, "words": str(error)}
    return found | {
        "verdict": {
            "lost": verdict.lost, "margin": verdict.margin, "angle": verdict.load_angle, "steps": verdict.steps_lost,
            "error": verdict.error,
        },
        "words": str(verdict),
    }  # fmt: skip


def _numbers(values: Floats, digits: int) -> list[float]:
    return [round(float(value), digits) for value in values]
