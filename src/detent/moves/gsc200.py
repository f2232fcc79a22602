"""GS-C200, GS-C200S: S, T and R, constant acceleration."""

from collections.abc import Mapping

from detent.controllers import catalogue
from detent.controllers.gsc200 import commands as gsc200
from detent.controllers.gsc200.arguments import Number, Signed
from detent.controllers.gsc200.motion import STEPS_PER_SECOND
from detent.motors.winding import ANY_DRIVE
from detent.moves.law import Commands, Law, Setting, Values
from detent.pulses import Train
from detent.ramps import constant_acceleration


def law(found: catalogue.Model, _: Mapping[str, object], axis: str) -> Law:
    """S, T and R of the datasheet, constant acceleration. To begin with: those of its drilling example."""

    def number(op: gsc200.Op, title: str, unit: str, value: int, scale: int = 1) -> Setting:
        argument = gsc200.row(found.name, op).argument
        assert isinstance(argument, Number)
        return Setting(op.value, title, unit, argument.low, argument.high, value, scale)

    def train(values: Values, steps: int) -> Train:
        scale = STEPS_PER_SECOND
        return constant_acceleration.move(values["S"] * scale, values["T"] * scale, values["R"], steps).train

    def commands(values: Values, steps: int) -> Commands:
        ops = (gsc200.Op.START_STOP, gsc200.Op.TOP, gsc200.Op.RAMP)
        lines = (gsc200.spell(found.name, gsc200.Instruction(op, values[op.value])) for op in ops)
        return Commands(tuple(lines), gsc200.spell(found.name, gsc200.Instruction(gsc200.Op.MOVE, steps)))

    def remark(values: Values) -> str:
        start, top = values["S"], values["T"]
        if start <= top:
            return ""
        rate = STEPS_PER_SECOND * top
        return f"T={top} is below S={start}: a {found.name} makes no ramp then, and all steps at {rate} steps/s"

    move = gsc200.row(found.name, gsc200.Op.MOVE).argument
    assert isinstance(move, Signed)
    return Law(
        found.name, "constant acceleration", "steps", move.high,
        (
            number(gsc200.Op.START_STOP, "start-stop speed", "steps/s", 10, STEPS_PER_SECOND),
            number(gsc200.Op.TOP, "slew speed", "steps/s", 100, STEPS_PER_SECOND),
            number(gsc200.Op.RAMP, "ramp length", "steps", 40),
        ),
        train, commands, ANY_DRIVE, remark,
    )  # fmt: skip
