"""What the Motion page computes: a move from its settings, by the law of a controller, and what a motor makes of it.

Settings count as the commands do (tens of steps a second for a GS-C200); `Setting.scale` makes units of them. Ranges,
units and spellings come from the controllers' own tables. Nothing here waits or draws.
"""

from collections.abc import Callable, Mapping, Sequence
from math import pi
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from detent.controllers import catalogue
from detent.controllers.dcb274 import commands as dcb274
from detent.controllers.dcb274.settings import Settings
from detent.controllers.genstepper import commands as genstepper
from detent.controllers.genstepper.link import LARGEST
from detent.controllers.gsc200 import commands as gsc200
from detent.controllers.gsc200.arguments import Number, Signed
from detent.controllers.gsc200.motion import STEPS_PER_SECOND
from detent.controllers.supersigma import commands as supersigma
from detent.controllers.supersigma.program import Program
from detent.motors.curve import PullOut, pull_out
from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.motor import Motor, MotorError
from detent.motors.move import Verdict, simulate
from detent.motors.rotor import Rig
from detent.motors.winding import CONTROLLERS, Winding, microstep
from detent.pulses import Train
from detent.ramps import constant_acceleration, tick_accumulator, timer_table
from detent.ramps.short_movements import movement
from detent.ticks import Ns

Floats = npt.NDArray[np.float64]
Values = Mapping[str, int]

COLUMNS: Final = 480  # points of a picture across
MOST_PULSES: Final = 2_000_000  # of a move that is judged while somebody waits
MOST_TIME: Final[Ns] = 120_000_000_000  # likewise
_CURVE: Final = 14  # speeds of a torque curve
_EDGE: Final = 24  # looks close to each end of a segment, where laws meet


class Setting(NamedTuple):
    """One number of a move, counted as its command counts."""

    name: str  # the command's letter
    title: str
    unit: str
    low: int
    high: int
    value: int  # to begin with
    scale: int = 1  # units a count


class Commands(NamedTuple):
    """The command lines that set a move up, and the one that makes it."""

    settings: tuple[str, ...]
    go: str


class Law(NamedTuple):
    """How one controller makes moves. `train` and `commands` take the settings by name, and steps (1 to `most`)."""

    model: str
    title: str
    unit: str  # of position: "steps"
    most: int
    settings: tuple[Setting, ...]
    train: Callable[[Values, int], Train]
    commands: Callable[[Values, int], Commands]
    windings: tuple[Winding, ...]  # what one pulse may turn the field by; the first is the usual one. None: unknown

    @property
    def values(self) -> dict[str, int]:
        """The settings to begin with."""
        return {setting.name: setting.value for setting in self.settings}


def law(model: str, options: Mapping[str, object] | None = None, axis: str = "") -> Law:
    """How an axis of `model`, with these options (as a cell file writes them), makes moves. Raises CatalogueError."""
    found = catalogue.model(model)
    chosen = catalogue.option_values(found, options or {})
    make = {
        "gs-c200": _gsc200, "gs-c200s": _gsc200, "dcb-274": _dcb274, "supersigma": _supersigma,
        "bs0610": _genstepper, "bs0710": _genstepper,
    }[found.name]  # fmt: skip
    return make(found, chosen, axis)


def in_force(law: Law, registers: Mapping[str, str], axis: str = "") -> dict[str, int]:
    """The settings that a unit has now, by its registers (`Controller.registers`); where it has none, `law.values`."""
    found: dict[str, int] = {}
    for setting in law.settings:
        letter, _, which = setting.name.partition(" ")
        text = registers.get(f"{axis} {letter}".strip(), "")
        part = text.split("/")[-1 if which == "down" else 0]
        if part.isdigit():
            found[setting.name] = int(part)
    return clipped(law, found)


def stepping(law: Law, registers: Mapping[str, str]) -> str:
    """What a pulse does to the windings, if registers tell (H of a DCB-274); else what is usual; "" if unknown."""
    names = [winding.name for winding in law.windings]
    told = registers.get("H", "").lower()
    return told if told in names else names[0] if names else ""


def clipped(law: Law, values: Values) -> dict[str, int]:
    """The settings with what is missing put in, and what is out of range brought into it."""
    return {
        setting.name: min(max(round(values.get(setting.name, setting.value)), setting.low), setting.high)
        for setting in law.settings
    }


# -- the laws --------------------------------------------------------------------------------------------------


def _gsc200(found: catalogue.Model, _: Mapping[str, object], axis: str) -> Law:
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

    move = gsc200.row(found.name, gsc200.Op.MOVE).argument
    assert isinstance(move, Signed)
    return Law(
        found.name, "constant acceleration", "steps", move.high,
        (
            number(gsc200.Op.START_STOP, "start-stop speed", "steps/s", 10, STEPS_PER_SECOND),
            number(gsc200.Op.TOP, "slew speed", "steps/s", 100, STEPS_PER_SECOND),
            number(gsc200.Op.RAMP, "ramp length", "steps", 40),
        ),
        train, commands, _usual_first(CONTROLLERS[found.name]),
    )  # fmt: skip


def _dcb274(found: catalogue.Model, _: Mapping[str, object], axis: str) -> Law:
    """I, V, K and D of the manual (pages 37, 40, 41, 50), by the counts of its timer."""
    factory = Settings("A")
    up, down = dcb274.ROWS[dcb274.Op.RAMP].arguments
    (divide,) = dcb274.ROWS[dcb274.Op.DIVIDE].arguments
    fastest = timer_table.rate_of(timer_table.LEAST_COUNT)

    def rate(op: dcb274.Op, title: str, count: int) -> Setting:
        return Setting(op.value, title, "steps/s", timer_table.SLOWEST, fastest, timer_table.rate_of(count))

    def train(values: Values, steps: int) -> Train:
        initial, slew = timer_table.count_of(values["I"]), timer_table.count_of(values["V"])
        speeds = timer_table.Speeds(initial, slew, values["K up"], values["K down"], values["D"])
        return timer_table.index(speeds, steps).train

    def commands(values: Values, steps: int) -> Commands:
        ramp = f"K {values['K up']} {values['K down']}"
        return Commands((f"I {values['I']}", f"V {values['V']}", ramp, f"D {values['D']}"), f"+ {steps}")

    return Law(
        found.name, "table of speeds of an 8 036 ns timer", "steps", dcb274.ROWS[dcb274.Op.PLUS].arguments[0].high,
        (
            rate(dcb274.Op.INITIAL, "initial speed", factory.initial),
            rate(dcb274.Op.SLEW, "slew speed", factory.slew),
            Setting("K up", "ramp up, steps each", "steps", up.low, up.high, factory.ramp[0]),
            Setting("K down", "ramp down, steps each", "steps", down.low, down.high, factory.ramp[1]),
            Setting("D", "speeds divided by", "", divide.low, divide.high, factory.divide),
        ),
        train, commands, _usual_first(tuple(reversed(CONTROLLERS[found.name]))),
    )  # fmt: skip


def _genstepper(found: catalogue.Model, chosen: Mapping[str, object], axis: str) -> Law:
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

    size = after_reset["step_size"]
    return Law(
        found.name, "speed and position added up every 16 us", "microsteps", LARGEST,
        (
            rate(genstepper.Op.KEEP, "stop OK rate", "microsteps/s", "stop_rate"),
            rate(genstepper.Op.RATE, "run rate", "microsteps/s", "run_rate"),
            rate(genstepper.Op.SLOPE, "slope of the ramps", "microsteps/s\N{SUPERSCRIPT TWO}", "ramp"),
        ),
        train, commands, () if 64 % size else (microstep(64 // size, amplitude=1.0),),
    )  # fmt: skip


def _supersigma(found: catalogue.Model, chosen: Mapping[str, object], axis: str) -> Law:
    """The table of differences in its EPROM, and the speed that `limit` allows."""
    program = Program(**{name: value for name, value in chosen.items() if name in Program._fields})  # type: ignore[arg-type]
    most = supersigma.LARGEST_SPEED

    def train(values: Values, steps: int) -> Train:
        entries = program.table.entries_up_to(values["limit"] * supersigma.SPEED_UNIT)
        return movement(program.table, steps, program.offset, program.short, entries).train

    def commands(values: Values, steps: int) -> Commands:
        whole = values["limit"] * supersigma.SPEED_UNIT >= _fastest(program)
        command = supersigma.Command(supersigma.Op.MOVE, 1, steps) if whole else supersigma.Command(
            supersigma.Op.LIMIT, 1, steps, values["limit"])  # fmt: skip
        return Commands((), supersigma.spell(command))

    title = f"table of {len(program.table.differences)} differences; short movements: {program.short.value}"
    limit = Setting("limit", "speed limit", "half steps/s", 1, most, most, supersigma.SPEED_UNIT)
    return Law(found.name, title, "half steps", supersigma.LARGEST_STEPS, (limit,), train, commands,
               CONTROLLERS[found.name])  # fmt: skip


def _fastest(program: Program) -> float:
    """Half steps/s at the end of the table."""
    return 2e6 / (program.table.counts()[-1] + 1)


def _usual_first(windings: Sequence[Winding]) -> tuple[Winding, ...]:
    """Half steps first where there are any: with them a controller is usually wired."""
    return tuple(sorted(windings, key=lambda winding: winding.name != "half"))


# -- the picture of a move --------------------------------------------------------------------------------------


class Picture(NamedTuple):
    """A move as it is drawn: times in s, speeds in units/s, positions in units, one of each a point."""

    times: Floats
    speeds: Floats
    positions: Floats
    steps: int
    duration: Ns
    peak: float  # the highest speed, units/s
    ramps: tuple[float, float]  # s: the end of the way up to the peak, and the begin of the way down
    reached: bool  # whether a part of the move is made at constant speed

    @property
    def mean(self) -> float:
        """Mean speed, units/s."""
        return self.steps / (self.duration * 1e-9) if self.duration else 0.0


def picture(train: Train, columns: int = COLUMNS) -> Picture:
    """How a train that ends is drawn, in about `columns` points. ValueError for one without end, or without pulses."""
    duration, steps = train.duration, train.steps
    if duration is None or not steps:
        raise ValueError("a picture shows a move with an end, of at least one step")
    first, grid = train.time_of(0), {duration * k // columns for k in range(columns + 1)}
    before = 0
    for segment in train.segments[: columns // 8]:
        after = before + (segment.steps or 0)
        for pulse in (before, before + 1, after - 1, after):
            if 0 <= pulse <= steps:
                at = train.time_of(pulse) - first
                grid |= {at, min(at + 1, duration), max(at - 1, 0)}
        before = after
    times = sorted(grid)
    states = [train.state_at(first + t) for t in times]
    speeds = np.array([state.rate for state in states])
    if len(speeds) > 1:
        speeds[-1] = speeds[-2]  # behind the last pulse there is no speed
    positions = np.array([state.steps + state.phase for state in states])
    seconds = np.array(times, np.float64) * 1e-9
    peak = float(speeds.max())
    top = np.flatnonzero(speeds >= peak * (1 - 1e-6))
    ramps = float(seconds[top[0]]), float(seconds[top[-1]])
    return Picture(seconds, speeds, positions, steps, duration, peak, ramps, ramps[1] - ramps[0] > 2.5 / peak)


# -- what a motor makes of it ----------------------------------------------------------------------------------


class Demand(NamedTuple):
    """What a move asks of the motor: torque (Nm) over speed (units/s), in the order of the move."""

    speeds: Floats
    torques: Floats


def rig(motor: Motor, winding: Winding, *, supply: float, current: float, inertia: float, friction: float) -> Rig:
    """Motor, drive and load: V, A a phase, kg m2 of the load, Nm. MotorError where they do not go together."""
    if motor.inertia is None:
        # with the load's inertia as the whole; the maker gives no rotor
        if inertia <= 0:
            raise MotorError(f"the maker of {motor.name} gives no rotor inertia: give one for rotor and load together")
        motor, inertia = motor.changed(inertia=inertia), 0.0
    return Rig(motor, Drive(supply, current, winding), Load(inertia, friction))


def judged(train: Train, rig: Rig) -> Verdict:
    """Whether the motor follows the whole train. MotorError for a move too long to be waited for."""
    duration, steps = train.duration, train.steps
    if duration is None or steps is None or steps > MOST_PULSES or duration > MOST_TIME:
        raise MotorError("this move is too long to be judged while you wait: make it shorter, or use detent motor")
    return simulate(train, rig).verdict


def torque_curve(rig: Rig, top: float) -> list[PullOut]:
    """Pull-out torque at speeds (full steps/s) from a tenth of `top` to a good deal above it, to where none is left."""
    points: list[PullOut] = []
    for rate in np.geomspace(max(top / 20, 5.0), max(top * 1.8, 100.0), _CURVE):
        points.append(pull_out(rig.motor, rig.drive, float(rate)))
        if points[-1].torque <= 0:
            break
    return points


def demand(drawn: Picture, rig: Rig) -> Demand:
    """The torque that inertia and friction ask for while the move speeds up: what the curve must lie above."""
    per_turn = rig.motor.steps * rig.drive.winding.steps
    radians = 2 * pi / per_turn
    rising = drawn.times <= drawn.ramps[0]
    seconds, speeds = drawn.times[rising], drawn.speeds[rising]
    load = rig.load
    steady = load.friction + load.torque
    if len(seconds) < 3 or speeds[-1] <= speeds[0]:
        speeds = np.array([0.0, drawn.peak])
        return Demand(speeds, steady + (load.viscous + rig.motor.viscous) * speeds * radians)
    # the laws of counters rise in stairs: a slope is taken over a good part of the ramp
    knots = np.linspace(seconds[0], seconds[-1], 12)
    at_knots = np.interp(knots, seconds, speeds)
    slopes = np.diff(at_knots) / np.diff(knots)
    middles = (at_knots[1:] + at_knots[:-1]) / 2
    inertia = rig.motor.rotor + load.inertia
    torques = inertia * slopes * radians + steady + (load.viscous + rig.motor.viscous) * middles * radians
    ends = np.concatenate(([speeds[0]], middles, [speeds[-1]]))
    return Demand(ends, np.concatenate((torques[:1], torques, torques[-1:])))
