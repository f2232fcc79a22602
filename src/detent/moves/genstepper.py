"""BS0610, BS0710: K, R and P, added up on a tick of 16 us."""

from collections.abc import Mapping

from detent.controllers import catalogue
from detent.controllers.genstepper import commands as genstepper
from detent.controllers.genstepper.link import LARGEST
from detent.motors.winding import Winding, microstep
from detent.motors.winding import genstepper as of_mode
from detent.moves.law import Commands, Law, Setting, Values
from detent.pulses import Train
from detent.ramps import tick_accumulator


def law(found: catalogue.Model, chosen: Mapping[str, object], axis: str) -> Law:
    """K, R and P (manual, pages 29, 31 and 32), accumulated on a tick of 16 us. They begin as after a reset."""
    after_reset = {option.keyword: int(option.default) for option in found.options if option.default.isdigit()}
    after_reset |= {name: value for name, value in chosen.items() if isinstance(value, int)}
    ops = (genstepper.Op.KEEP, genstepper.Op.RATE, genstepper.Op.SLOPE)

    def train(values: Values, steps: int) -> Train:
        keep, run, slope = (values[op.value] for op in ops)
        speed = min(keep, run) * tick_accumulator.UPDATES
        return tick_accumulator.toward(steps, 0, speed, run, slope, keep, slope).train

    def commands(values: Values, steps: int) -> Commands:
        choice = (axis,) if axis else ()  # X and Y are commands: the ones that follow are that motor's
        return Commands((*choice, *(f"{values[op.value]}{op.value}" for op in ops)), f"{steps}S")

    def rate(op: genstepper.Op, title: str, unit: str, option: str) -> Setting:
        return Setting(op.value, title, unit, 1, tick_accumulator.UPDATES, after_reset[option])

    def remark(values: Values) -> str:
        keep, run = values["K"], values["R"]
        if keep <= run:
            return ""
        return f"R={run} is below K={keep}: a {found.name} makes no ramp then, and all steps at {run} microsteps/s"

    size = after_reset["step_size"]
    return Law(
        found.name, "speed and position added up every 16 us", "microsteps", LARGEST,
        (
            rate(genstepper.Op.KEEP, "stop OK rate", "microsteps/s", "stop_rate"),
            rate(genstepper.Op.RATE, "run rate", "microsteps/s", "run_rate"),
            rate(genstepper.Op.SLOPE, "slope of the ramps", "microsteps/s\N{SUPERSCRIPT TWO}", "ramp"),
        ),
        train, commands, _windings(size), remark,
    )  # fmt: skip


def _windings(size: int) -> tuple[Winding, ...]:
    """What steps of size/64 do in the modes of O: 3, as after a reset, by its fraction of a step; then 0 to 2."""
    if 64 % size:
        return ()
    return (microstep(64 // size, amplitude=1.0), *(of_mode(mode).every(size) for mode in range(3)))
