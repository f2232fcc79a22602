"""The settings of each controller as points of a grid, and the profile that a point is."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from detent.controllers import catalogue
from detent.controllers.genstepper.commands import Op
from detent.motors.rotor import Rig
from detent.motors.winding import Winding
from detent.moves.law import Law, Setting, Values
from detent.moves.laws import law
from detent.moves.spelling import spelled
from detent.pulses import Train
from detent.ramps import tick_accumulator, timer_table
from detent.tuner import tables
from detent.tuner.grid import Dimension, logarithmic
from detent.tuner.quasi_static import RuleOfThumb, Torque, rule_of_thumb, torque_of, worst_of
from detent.tuner.task import Task, TunerError

Point = tuple[int, ...]
"""A value for each dimension of a space."""


class Profile(NamedTuple):
    """Settings of a controller, with the law that makes pulses of them.

    `part` of the steps of this law are one step of those in which the moves are given (a coarser microstep makes one
    step of several). `before` are lines to send first, `again` those that set what they reset and no setting is,
    `options` what the model must be set up with, as cell files write it.
    """

    law: Law
    values: Values
    winding: Winding
    part: tuple[int, int] = (1, 1)
    before: tuple[str, ...] = ()
    options: Mapping[str, str] = {}
    again: tuple[str, ...] = ()

    def steps(self, distance: int) -> int:
        """The distance in steps of this law."""
        return distance * self.part[0] // self.part[1]

    def train(self, distance: int) -> Train:
        """The pulses of a move."""
        return self.law.train(self.values, self.steps(distance))

    @property
    def settings(self) -> tuple[str, ...]:
        """The lines that set it up."""
        lines = self.law.commands(self.values, 1).settings
        choice = tuple(line for line in lines if line in ("X", "Y"))
        return (*self.before, *choice, *self.again, *(line for line in lines if line not in choice))

    def go(self, distance: int) -> str:
        """The line that makes a move."""
        return self.law.commands(self.values, self.steps(distance)).go

    def __str__(self) -> str:
        words = [f"{name}={value}" for name, value in self.options.items() if len(value) <= 12]
        return " ".join([spelled(self.law, self.values), *words])


class Space(NamedTuple):
    """What may be chosen.

    `plane` are the two dimensions of a map: the slew speed, and what makes ramps longer; `labels` say what they count.
    `least` is seconds below which no move of a point is, where its pulses cost much to compute; None: they do not.
    `slower` makes the ramps of a point longer by a factor.
    """

    dimensions: tuple[Dimension, ...]
    profile: Callable[[Point], Profile | None]
    hand: Point
    slower: Callable[[Point, float], Point]
    plane: tuple[str, str]
    labels: tuple[str, str]
    admits: Callable[[Point], bool] = lambda _: True
    least: Callable[[Point], tuple[float, ...]] | None = None

    def place(self, name: str) -> int:
        """Where in a point a dimension is."""
        return [dimension.name for dimension in self.dimensions].index(name)

    def on_plane(self, point: Point, x: int, y: int) -> Point:
        """The point with other values on the plane; a ramp down keeps its part of the ramp up."""
        numbers, (first, second) = list(point), map(self.place, self.plane)
        if self.plane[1] == "K up":
            numbers[second + 1] = max(round(y * point[second + 1] / max(point[second], 1)), 1)
        numbers[first], numbers[second] = x, y
        return tuple(numbers)


def space(task: Task) -> Space:
    """The space of a task's model. TunerError where nothing can be tuned."""
    rig = task.rig
    torques = [torque_of(rig, way) for way in ((1, -1) if task.both_ways else (1,))]
    torque = min(torques, key=lambda one: one.top)
    if torque.top <= 0:
        raise TunerError(_too_heavy(rig, torque))
    hand = rule_of_thumb(rig, torque)
    return _MAKE[catalogue.model(task.model).name](task, torque, hand)


def _too_heavy(rig: Rig, torque: Torque) -> str:
    takes, has = torque.steady_at(0), torque.available_at(0)
    words = (
        f"{rig.motor.name} with {rig.drive.supply:g} V and {rig.drive.current:g} A does not turn this load at any speed"
    )
    if has <= 0:
        return f"{words}: its own friction takes all of its torque; check the motor's data"
    load = rig.load
    of_it = [
        f"{name} {part:.3g}" for name, part in (("friction", load.friction), ("pull", abs(load.at_rest()))) if part
    ]
    parts = f" ({', '.join(of_it)})" if len(of_it) > 1 else ""
    factor = takes / has
    gear = f", a gear of {1.5 * factor:.2g} or more" if factor < 1000 else ""
    return (
        f"{words}: to move it takes {takes:.3g} Nm{parts}, {factor:.3g} times the {has:.3g} Nm that the motor has at "
        f"slow speed; less friction or load{gear}, or another motor (or is a number in the wrong unit?)"
    )


class _Speeds(NamedTuple):
    """Where the grid of start speeds, slew speeds and accelerations begins and ends, in steps/s and steps/s2."""

    start: tuple[float, float]
    slew: tuple[float, float]
    acceleration: tuple[float, float]

    @classmethod
    def of(cls, torque: Torque, hand: RuleOfThumb) -> "_Speeds":
        most = torque.acceleration(max(torque.available_at(hand.start) - torque.steady_at(hand.start),
                                       0.02 * torque.holding))  # fmt: skip
        slew = max(hand.top, 2 * hand.start)
        return cls((hand.start / 5, 2 * hand.start), (slew / 2, max(torque.top, slew)), (most / 16, most))


def _gsc200(task: Task, torque: Torque, hand: RuleOfThumb) -> Space:
    made, winding = task.law, task.rig.drive.winding
    start, slew, ramp = made.settings
    speeds = _Speeds.of(torque, hand)
    tens = start.scale
    low, high = speeds.slew[0], min(speeds.slew[1], slew.high * tens)
    long = [speed**2 / 2 / acceleration for speed in (low, high) for acceleration in speeds.acceleration]
    dimensions = (
        logarithmic("S", start.low, start.high, speeds.start[0] / tens, speeds.start[1] / tens, 10),
        logarithmic("T", slew.low, slew.high, low / tens, high / tens, 20),
        logarithmic("R", ramp.low, ramp.high, long[1], min(long[2], ramp.high), 20),
    )

    def profile(point: Point) -> Profile:
        return Profile(made, dict(zip("STR", point, strict=True)), winding)

    s, t = round(hand.start / tens), round(hand.top / tens)
    r = ((t * tens) ** 2 - (s * tens) ** 2) / 2 / hand.acceleration
    best = (_within(s, start), _within(t, slew), _within(r, ramp))

    def slower(point: Point, factor: float) -> Point:
        return (point[0], point[1], _within(point[2] * factor + 1, ramp))

    return Space(
        dimensions, profile, best, slower, ("T", "R"), (_label(slew), _label(ramp)), lambda point: point[0] < point[1]
    )


def _dcb274(task: Task, torque: Torque, hand: RuleOfThumb) -> Space:
    made, winding = task.law, task.rig.drive.winding
    settings = {setting.name: setting for setting in made.settings}
    speeds = _Speeds.of(torque, hand)
    up, down = settings["K up"], settings["K down"]
    square = timer_table.RUNG_SPEED**2 / 2  # a rung more is so much of v**2 / 2; K steps each
    k_low, k_high = (max(square / acceleration, 1) for acceleration in reversed(speeds.acceleration))

    def rates(name: str, ends: tuple[float, float], count: int) -> Dimension:
        setting = settings[name]
        grid = logarithmic(name, setting.low, setting.high, *ends, count)
        return grid._replace(values=tuple(sorted({timer_table.rate_of(timer_table.count_of(v)) for v in grid.values})))

    dimensions = (
        rates("I", speeds.start, 8),
        rates("V", (speeds.slew[0], min(speeds.slew[1], settings["V"].high)), 16),
        logarithmic("K up", up.low, up.high, k_low, k_high, 12),
        logarithmic("K down", down.low, down.high, k_low / 2, k_high, 12),
    )

    def profile(point: Point) -> Profile:
        return Profile(made, {**dict(zip(("I", "V", "K up", "K down"), point, strict=True)), "D": 1}, winding)

    k = square / hand.acceleration
    best = (
        _within(hand.start, settings["I"]),
        _within(hand.top, settings["V"]),
        _within(k + 0.999, up),
        _within(k + 0.999, down),
    )

    def slower(point: Point, factor: float) -> Point:
        return (*point[:2], _within(point[2] * factor + 0.5, up), _within(point[3] * factor + 0.5, down))

    def admits(point: Point) -> bool:
        return point[0] < point[1] and point[2] <= 2 * point[3] and point[3] <= point[2]

    labels = _label(settings["V"]), _label(up)
    return Space(dimensions, profile, best, slower, ("V", "K up"), labels, admits)


def _genstepper(task: Task, torque: Torque, hand: RuleOfThumb) -> Space:
    given = int(str(task.options.get("step_size", _default(task.model, "step_size"))))
    distances = [move.steps * given for move in task.moves]  # in 1/64 of a full step
    sizes = [size for size in (1, 2, 4, 8, 16, 32, 64) if all(distance % size == 0 for distance in distances)]
    if "step_size" in task.options or given not in sizes:
        sizes = [given]
    mode = next((k for k, one in enumerate(task.law.windings) if one.name == task.rig.drive.winding.name), 0)
    laws = {size: law(task.model, {**task.options, "step_size": str(size)}, task.axis) for size in sizes}
    most = tick_accumulator.UPDATES
    speeds = _Speeds.of(torque, hand)
    # the dimensions are in full steps, thousandths of them for a start: so that they are the same for every size
    full = task.rig.drive.winding.steps

    limit = most * max(sizes) / 64  # of the coarsest step that may be chosen

    def scaled(ends: tuple[float, float], least: float) -> tuple[float, float]:
        high = min(max(ends[1] / full, 2 * least), limit)
        return min(max(ends[0] / full, least), limit / 4), high

    start, slew, slope = scaled(speeds.start, 1.0), scaled(speeds.slew, 2.0), scaled(speeds.acceleration, 2.0)
    dimensions = (
        Dimension("step size", min(sizes), max(sizes), tuple(sizes), fixed=True),
        logarithmic("K", 1, most, *start, 7),
        logarithmic("R", 1, most, *slew, 12),
        logarithmic("P", 1, most, *slope, 12),
    )

    def numbers(point: Point) -> Point:
        """K, R and P in microsteps of the size."""
        size, *rest = point
        return tuple(round(value * 64 / size) for value in rest)

    def profile(point: Point) -> Profile | None:
        size, values = point[0], numbers(point)
        if max(values) > most:
            return None
        found = laws[size]
        before = () if sizes == [given] and "step_size" not in task.options else (f"{size}{Op.RESET.value}",)
        # a reset leaves the step mode that is usual, O3; the others follow it in the order of their numbers
        again = (f"{mode - 1}{Op.MODE.value}",) if before and mode else ()
        return Profile(found, dict(zip("KRP", values, strict=True)), found.windings[mode], (given, size), before,
                       {"step_size": str(size)}, again)  # fmt: skip

    size = given if given in sizes else sizes[0]
    limit = most * size // 64
    best = (size, *(min(max(round(value / full), 1), limit) for value in hand))

    def slower(point: Point, factor: float) -> Point:
        return (*point[:3], max(round(point[3] / factor), 1))

    labels = "R: run rate, full steps/s", "P: slope of the ramps, full steps/s\N{SUPERSCRIPT TWO}"
    return Space(dimensions, profile, best, slower, ("R", "P"), labels, lambda point: point[1] < point[2])


def _supersigma(task: Task, torque: Torque, hand: RuleOfThumb) -> Space:
    winding = task.rig.drive.winding
    weakest = min((torque_of(rig) for rig in worst_of(task.rig, task.spread)), key=lambda one: one.top)
    made = tables.Tables(task.model, task.options, weakest if weakest.top > 0 else torque)
    speeds = _Speeds.of(torque, hand)
    dimensions = (
        logarithmic("from", 40, tables.FASTEST, max(speeds.start[0], 150), speeds.start[1], 8),
        logarithmic("to", 50, tables.FASTEST, *speeds.slew, 14),
        logarithmic("torque", 5, 2000, 250, 1400, 14),
    )

    def profile(point: Point) -> Profile | None:
        found = made.law(*point)
        if found is None:
            return None
        table, its_law = found
        return Profile(its_law, its_law.values | {"limit": its_law.settings[0].high}, winding, (1, 1), (),
                       {"table": str(table), "short": made.short.value})  # fmt: skip

    def least(point: Point) -> tuple[float, ...]:
        return tuple(made.least(point[0], point[1], point[2], move.steps) for move in task.moves)

    best = (max(round(hand.start), 40), round(hand.top), 500)

    def slower(point: Point, factor: float) -> Point:
        return (point[0], point[1], max(round(point[2] / factor), 5))

    return Space(dimensions, profile, best, slower, ("to", "torque"), _TABLE, lambda point: point[0] < point[1], least)


_TABLE = "end of the table, half steps/s", "torque that the table uses, thousandths of the motor's"


def _label(setting: Setting) -> str:
    """What a setting counts: T: slew speed, 10 steps/s."""
    scale = f"{setting.scale} " if setting.scale > 1 else ""
    return f"{setting.name}: {setting.title}, {scale}{setting.unit}"


_MAKE = {
    "gs-c200": _gsc200,
    "gs-c200s": _gsc200,
    "dcb-274": _dcb274,
    "supersigma": _supersigma,
    "bs0610": _genstepper,
    "bs0710": _genstepper,
}


def _within(value: float, setting: Setting) -> int:
    return min(max(round(value), setting.low), setting.high)


def _default(model: str, name: str) -> str:
    return next(option.default for option in catalogue.model(model).options if option.name == name)
