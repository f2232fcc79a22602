"""What the Motion page asks of the server: the law of an axis, a move, and what a motor makes of it (see `motion`)."""

import asyncio
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from detent.cell.description import Description, Problem
from detent.cell.fitting import rated
from detent.cell.tables import Motor as Fitted
from detent.controllers import catalogue
from detent.motors.motor import Motor, MotorError
from detent.motors.named import MOTORS
from detent.motors.own import read as read_own
from detent.moves import laws
from detent.moves.law import Law, Setting, clipped, in_force, stepping
from detent.realtime.cell_source import find_cell
from detent.workbench import motion, rigs
from detent.workbench.answers import AxisFacts, DrawnMove, JudgedMove, MotorFacts, SettingFacts
from detent.workbench.beside import beside
from detent.workbench.live import Live
from detent.workbench.motion import Floats, Picture
from detent.workbench.rigs import Form, OwnMotor

if TYPE_CHECKING:
    from detent.workbench.client import Bench

Name = Annotated[str, Field(max_length=200)]
Values = Annotated[dict[str, int], Field(max_length=16)]
Options = Annotated[dict[str, Annotated[str, Field(max_length=4000)]], Field(max_length=16)]

FIRST_STEPS = 500  # of the move that a page begins with


class Place(BaseModel):
    """Which axis: of a unit of the cell, or (`real`) the unit that is connected under this name.

    `options` are those of its model that settings on trial need, in place of its own.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    unit: Name
    axis: Name = ""
    real: bool = False
    options: Options = {}


class Axis(Place):
    """An axis, and the move that it shall make."""

    values: Values = {}
    steps: Annotated[int, Field(ge=1)] = FIRST_STEPS


class Moves:
    """The calls of the Motion page, offered as ``motion_about`` and so on."""

    def __init__(self, bench: "Bench", live: Live) -> None:
        self._bench, self._live = bench, live
        self._one = asyncio.Lock()  # motors are simulated one after the other
        for call in (self.about, self.move, self.motor, self.own):
            live.offer(f"motion_{call.__name__}", call)

    def law(self, place: Place) -> Law:
        """How the axis makes moves as it is set up now. ValueError for none."""
        model, options, axis = self._unit(place)
        return laws.law(model, {**options, **place.options}, axis)

    def _unit(self, place: Place) -> tuple[str, dict[str, str], str]:
        """Model, options that are not as usual, and the name of the axis in the commands."""
        if place.real:
            told = self._told(place.unit)
            return str(told["model"]), {}, str(told["axis"])
        picture = self._bench.picture.units.get(place.unit)
        if picture is None or place.axis not in picture.axes:
            raise ValueError(f"there is no axis {place.unit} {place.axis}".rstrip())
        defaults = {option.name: option.default for option in catalogue.model(picture.model).options}
        chosen = {option.name: option.value for option in picture.options if option.value != defaults[option.name]}
        size = self._bench.state.units[place.unit].registers.get("!")  # a reset may have changed it since
        if size is not None:
            chosen.pop("step_size", None)
            chosen |= {} if size == defaults["step_size"] else {"step_size": size}
        return picture.model, chosen, place.axis

    def options(self, place: Place) -> dict[str, str]:
        """Those of its model as the unit is set up now, without those on trial."""
        return self._unit(place)[1]

    def axis(self, place: Place) -> str:
        """How its commands name the axis."""
        return self._unit(place)[2]

    def _told(self, name: str) -> Mapping[str, Any]:
        told = self._live.get(f"r.{name}")
        if not isinstance(told, Mapping):
            raise ValueError(f"no unit {name!r} is connected")
        return told

    def registers(self, place: Place, axis: str) -> Mapping[str, str]:
        """The settings that the unit has now, as far as it tells them."""
        if not place.real:
            return self._bench.state.units[place.unit].registers
        # "initial I", "500 steps/s": the letter ends the name, the number begins the value
        found = {str(fact[0]).rpartition(" ")[2]: str(fact[1]).split(" ")[0]
                 for fact in self._told(place.unit)["facts"] if fact[1] is not None}  # fmt: skip
        return found | {f"{axis} {letter}": value for letter, value in found.items()} if axis else found

    async def about(self, place: Place) -> AxisFacts:
        """The settings of an axis with their ranges and what is in force, the motors, and the one that is fitted."""
        law = self.law(place)
        _, _, axis = self._unit(place)
        registers = self.registers(place, axis)
        entry = self.entry(place)
        return {
            "unit": place.unit, "axis": place.axis, "real": place.real, "options": dict(place.options),
            "model": law.model, "law": law.title, "units": law.unit,
            "most": law.most, "steps": min(FIRST_STEPS, law.most),
            "settings": [_setting(setting) for setting in law.settings],
            "values": dict(in_force(law, registers, axis)),
            "steppings": [winding.name for winding in law.windings],
            "per_step": {winding.name: winding.steps for winding in law.windings},
            "stepping": stepping(law, registers, axis),
            "drives": rigs.DRIVES,
            "motors": [rigs.facts_of(name, motor) for name, motor in self.motors().items()],
            "fitted": None if entry is None else rigs.form_of(law, *entry),
        }  # fmt: skip

    async def move(self, wanted: Axis) -> DrawnMove:
        """The picture of a move, and the command lines that make it."""
        law = self.law(wanted)
        values, steps = clipped(law, wanted.values), min(wanted.steps, law.most)
        drawn = motion.picture(law.train(values, steps))
        commands = law.commands(values, steps)
        at, accelerations = drawn.accelerations
        return {
            "values": dict(values), "steps": steps, "times": _numbers(drawn.times, 9),
            "speeds": _numbers(drawn.speeds, 4), "positions": _numbers(drawn.positions, 4),
            "accelerations": [(round(t, 9), round(a, 1)) for t, a in zip(at.tolist(), accelerations.tolist(),
                                                                         strict=True)],
            "duration": drawn.duration, "peak": round(drawn.peak, 3), "mean": round(drawn.mean, 3),
            "up": drawn.ramps[0], "down": drawn.duration * 1e-9 - drawn.ramps[1], "reached": drawn.reached,
            "remark": law.remark(values),
            "settings": list(commands.settings), "go": commands.go,
        }  # fmt: skip

    async def motor(self, wanted: Axis, form: Form) -> JudgedMove:
        """What a motor makes of a move: its torque over speed, what the move asks of it, and the verdict."""
        law = self.law(wanted)
        async with self._one:
            return await beside(_judged, law, wanted, form, self.motors(), self.entry(wanted))

    async def own(self, files: OwnMotor) -> MotorFacts:
        """What a form begins with for a motor of somebody's own. MotorError says what is wrong with its file."""
        motor, _ = read_own(files.text, files.name)
        return rigs.facts_of(files.name, motor)

    def entry(self, place: Place) -> tuple[str, Fitted] | None:
        """The motor that the cell file has on an axis, with its name."""
        described = None if place.real else self._described()
        for name, entry in described.motors.items() if described is not None else ():
            one = len(self._bench.picture.units[place.unit].axes) == 1
            if entry.unit == place.unit and (entry.axis == place.axis or one):
                return name, entry
        return None

    def _described(self) -> Description | None:
        try:
            return find_cell(self._bench.picture.target).description
        except Problem:
            return None

    def motors(self) -> dict[str, Motor]:
        """The motors to choose from: those that are known, and those of the cell that have data of their own."""
        described = self._described()
        entries = {} if described is None else described.motors
        own = {name: rated(name, entry) for name, entry in entries.items() if rigs.named(name, entry) == name}
        return {**own, **MOTORS}


def _judged(
    law: Law, wanted: Axis, form: Form, motors: Mapping[str, Motor], fitted: tuple[str, Fitted] | None
) -> JudgedMove:
    """Everything that is shown of a motor. Raises MotorError."""
    found_rig = rigs.made(law, form, motors, fitted)
    rig = found_rig.rig
    train = law.train(clipped(law, wanted.values), min(wanted.steps, law.most))
    drawn: Picture = motion.picture(train)
    per_step = rig.drive.winding.steps
    curve = motion.torque_curve(rig, drawn.peak / per_step)
    asked = motion.demand(drawn, rig)
    found: JudgedMove = {
        "curve": [(point.rate * per_step, round(point.torque, 6)) for point in curve],
        "asked": [(float(speed), round(float(torque), 6)) for speed, torque in zip(*asked, strict=True)],
        "travel": found_rig.travel,
        "turn": rig.motor.steps,
        "verdict": None,
        "words": "",
    }
    try:
        judgement = motion.judgement(train, rig)
    except MotorError as error:
        return {**found, "words": str(error)}
    verdict, rate = judgement.verdict, judgement.rate
    return {
        **found,
        "verdict": {
            "lost": verdict.lost, "margin": verdict.margin, "angle": verdict.load_angle, "error": verdict.error,
            "often": 0 if rate is None else rate.lost + rate.corners_lost,
            "of": 0 if rate is None else rate.tried + rate.corners,
        },
        "words": " ".join(filter(None, (judgement.words(rig), found_rig.words and f"Motor: {found_rig.words}."))),
    }  # fmt: skip


def _setting(setting: Setting) -> SettingFacts:
    return {
        "name": setting.name, "title": setting.title, "unit": setting.unit, "low": setting.low, "high": setting.high,
        "value": setting.value, "scale": setting.scale,
    }  # fmt: skip


def _numbers(values: Floats, digits: int) -> list[float]:
    return [round(float(value), digits) for value in values]
