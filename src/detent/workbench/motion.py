"""What the Motion page computes: the picture of a move (`detent.moves` has its law), and what a motor makes of it.

Nothing here waits or draws.
"""

from dataclasses import replace
from math import pi
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from detent.motors import engine
from detent.motors.curve import PullOut, pull_out
from detent.motors.damping import given, usual
from detent.motors.diagnosis import Loss, diagnose
from detent.motors.drive import Drive
from detent.motors.load import NO_LOAD, Load
from detent.motors.motor import Motor, MotorError
from detent.motors.move import Verdict, simulate
from detent.motors.rotor import Rig
from detent.motors.variants import LossRate, loss_rate
from detent.pulses import Train
from detent.ticks import Ns

Floats = npt.NDArray[np.float64]

COLUMNS: Final = 480  # points of a picture across
MOST_PULSES: Final = 2_000_000  # of a move that is judged while somebody waits
MOST_TIME: Final[Ns] = 120_000_000_000  # likewise
MOST_VARIED: Final[Ns] = 15_000_000_000  # of a move that is judged with variants, likewise
MOST_CHANGING: Final[Ns] = 2_000_000_000  # likewise, where the load changes on the way: variants go one by one
VARIANTS: Final = 256
ACCELERATIONS: Final = 240  # points of their curve
FINE, COARSE, SMOOTH = 400, 60, 8  # parts of a move, in each of which it is taken; segments of a train without stairs
_CURVE: Final = 14  # speeds of a torque curve
_EDGE: Final = 24  # looks close to each end of a segment, where laws meet


# -- the picture of a move --------------------------------------------------------------------------------------


class Picture(NamedTuple):
    """A move as it is drawn: times in s, speeds in units/s, positions in units, one of each a point."""

    times: Floats
    speeds: Floats
    positions: Floats
    steps: int
    duration: Ns
    peak: float  # the highest speed, units/s
    accelerations: tuple[Floats, Floats]  # times in s, and units/s2 there
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
    return Picture(
        seconds, speeds, positions, steps, duration, peak, accelerations(train), ramps, ramps[1] - ramps[0] > 2.5 / peak
    )


def accelerations(train: Train) -> tuple[Floats, Floats]:
    """Times (s) and accelerations (units/s2) of a train that ends: how its mean speed changes, from place to place.

    The speed at which a move starts, and from which it stops, is a step and no acceleration. Counters speed up in
    stairs, which no rotor follows one by one: a part of the move that has several of them is looked at together.
    """
    first, duration = train.time_of(0), train.duration or 0
    window = duration / (FINE if len(train.segments) <= SMOOTH else COARSE)
    at = np.linspace(window, duration - window, ACCELERATIONS)

    def places(times: Floats) -> Floats:
        states = [train.state_at(first + min(max(round(t), 0), duration)) for t in times.tolist()]
        return np.array([state.steps + state.phase for state in states], np.float64)

    if duration < 1000:  # a step or two: nothing to be seen
        return np.zeros(0), np.zeros(0)
    values = (places(at + window) - 2 * places(at) + places(at - window)) / (window * 1e-9) ** 2
    return at * 1e-9, values


# -- what a motor makes of it ----------------------------------------------------------------------------------


class Demand(NamedTuple):
    """What a move asks of the motor: torque (Nm) over speed (units/s), in the order of the move."""

    speeds: Floats
    torques: Floats


def rig(
    motor: Motor, drive: Drive, *, inertia: float, friction: float, damping: float | None = None,
    rest: Load = NO_LOAD, pull: float = 0.0,
) -> Rig:  # fmt: skip
    """Motor, drive and load: kg m2 of the load, Nm. MotorError where they do not go together.

    `rest` is what else hangs on the shaft: its inertia and friction do not count; `pull` (Nm, towards minus) adds to
    its torque.
    """
    if motor.inertia is None:
        # with the load's inertia as the whole; the maker gives no rotor
        if inertia <= 0:
            raise MotorError(f"the maker of {motor.name} gives no rotor inertia: give one for rotor and load together")
        motor, inertia = motor.changed(inertia=inertia), 0.0
    drive.check(motor)
    load = replace(rest, inertia=inertia, friction=friction, torque=rest.torque + pull)
    ratio = None if damping is None or damping == usual(drive.decay).ratio else given(damping)
    return Rig(motor, drive, load, damping=ratio)


class Judgement(NamedTuple):
    """The verdict, where steps are lost, and how often variants lose them (None: too many to be waited for)."""

    verdict: Verdict
    loss: Loss | None
    rate: LossRate | None

    def words(self, rig: Rig) -> str:
        """All of it in a sentence or two."""
        verdict = self.verdict
        said = f"Steps {self.loss}" if self.loss is not None else f"{verdict}; {verdict.where_it_rests}"
        often = "" if self.rate is None else f" The move is {self.rate}."
        return f"{said[0].upper()}{said[1:]}.{often} Assumed: {rig.damping}."


def judgement(train: Train, rig: Rig) -> Judgement:
    """What becomes of the whole train. MotorError for a move too long to be waited for."""
    verdict = judged(train, rig)
    loss = diagnose(train, rig) if verdict.lost else None
    most = MOST_VARIED if rig.load.is_steady else MOST_CHANGING
    quick = (train.duration or 0) <= most and engine.fast()
    return Judgement(verdict, loss, loss_rate(train, rig, tried=VARIANTS) if quick else None)


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
