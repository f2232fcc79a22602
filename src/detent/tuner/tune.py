"""The whole answer to a task: the settings found, and everything that says how far to believe them."""

from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from detent.motors.drive import Decay
from detent.motors.motor import MotorError
from detent.motors.variants import QUANTITIES, UNMET, Ensemble
from detent.motors.winding import HALF, HALF_COMPENSATED
from detent.tuner.judge import Job, Judge, Runner, judge_of, one_by_one, weighed
from detent.tuner.quasi_static import Bound, bound
from detent.tuner.search import AHEAD, Cancelled, Check, Found, Progress, Stopped, Watch, never, nobody, search
from detent.tuner.spaces import Point, Profile
from detent.tuner.task import Task

MODEL_VARIANTS = 512  # that each other model is asked
BEYOND = 1.06  # from one factor to the next, looking for what fails first
FARTHEST = 24  # of them
LONGER, LONGEST = 1.25, 16  # ramps by hand are made longer so often until they lose nothing


class Rival(NamedTuple):
    """Settings beside those found."""

    point: Point
    profile: Profile
    times: tuple[float, ...]
    time: float
    tried: int
    lost: int


class Model(NamedTuple):
    """Another model of what nobody has measured, and how many variants lose the moves there."""

    name: str
    tried: int
    lost: int


class Failure(NamedTuple):
    """The factor on one quantity, all others as given, at which the moves are first lost."""

    quantity: str
    factor: float


class Tuned(NamedTuple):
    """What was found for a task. Where it was stopped, what comes behind the search may be missing."""

    task: Task
    found: Found
    bound: Bound
    hand: Rival | None
    safe_hand: Rival | None  # its ramps made longer until no variant loses
    models: tuple[Model, ...]
    fails: tuple[Failure, ...]

    @property
    def bound_time(self) -> float:
        """Seconds below which the worst corner allows no moves."""
        return weighed(self.task, self.bound.worst)

    @property
    def ratio(self) -> float:
        """The time of the settings over that."""
        return self.found.time / self.bound_time if 0 < self.bound_time < float("inf") else float("nan")


def tune(
    task: Task, *, run: Runner = one_by_one, ahead: int = AHEAD, watch: Watch = nobody, cancelled: Cancelled = never
) -> Tuned:
    """Find the fastest settings that lose no step, and what is to be known of them.

    `watch` is told how far it is, `cancelled` asked between judgements whether to stop with the best so far. The
    answer is that of the task alone: `run` (which does the jobs) and `ahead` (how many at once) do not change it.
    TunerError where nothing is without loss, or nothing was known yet when it was stopped.
    """
    found = search(task, run=run, ahead=ahead, watch=watch, cancelled=cancelled)
    limits = bound(task.rig, task.spread, [move.steps for move in task.moves], both_ways=task.both_ways)
    judge = judge_of(task)
    if cancelled():
        return Tuned(task, found, limits, None, None, (), ())
    watch(Progress(found.tested, found.tested, found.time, "comparing"))
    hand = rival(judge, judge.space.hand)
    safe = _safe(judge, found, hand)
    others = () if cancelled() else models(judge, found.point)
    first = () if cancelled() else fails(judge, found.point)
    return Tuned(task, found, limits, hand, safe, others, first)


def each_move(
    task: Task, *, run: Runner = one_by_one, ahead: int = AHEAD, watch: Watch = nobody, cancelled: Cancelled = never
) -> list[Tuned]:
    """Settings for each move alone, to be sent before it; those of the first moves where it was stopped."""
    found: list[Tuned] = []
    for move in task.moves:
        if found and cancelled():
            break
        try:
            part = replace(task, moves=(move,))
            found.append(tune(part, run=run, ahead=ahead, watch=watch, cancelled=cancelled))
        except Stopped:
            if not found:
                raise
    return found


def rival(judge: Judge, point: Point, tried: int = MODEL_VARIANTS) -> Rival | None:
    """How other settings would do, with variants 0 to `tried` and all corners."""
    trains, times = judge.trains(point), judge.times(point)
    if trains is None or times is None:
        return None
    variants = (*judge.task.corners, *judge.task.drawn(0, tried))
    lost = judge.answer(Job(point, variants, to_the_end=True))
    return Rival(point, trains[0], times, weighed(judge.task, times), len(variants), len(lost))


def _safe(judge: Judge, found: Found, hand: Rival | None) -> Rival | None:
    if hand is None or hand.lost == 0:
        return hand
    point = hand.point
    for _ in range(LONGEST):
        longer = judge.space.slower(point, LONGER)
        if longer == point or judge.trains(longer) is None:
            return None
        point = longer
        if not judge.answer(Job(point, found.examples)):
            again = rival(judge, point)
            if again is not None and not again.lost:
                return again
    return None


def models(judge: Judge, point: Point) -> tuple[Model, ...]:
    """The same settings where the motor is modelled otherwise."""
    trains = judge.trains(point)
    assert trains is not None
    task = judge.task
    rig = task.rig_with(trains[0].winding)
    assert rig.damping is not None
    ratio, drive, damping = rig.damping.ratio, rig.drive, rig.damping
    changes: list[tuple[str, dict[str, Any]]] = [("half the substep", {"substep": max(rig.substep // 2, 1)})]
    if drive.decay in ("fast", "slow"):
        other: Decay = "slow" if drive.decay == "fast" else "fast"
        changes.append((f"{other} decay", {"drive": replace(drive, decay=other)}))
    if ratio:
        changes.append((f"damping {ratio / 4:.3g}", {"damping": damping._replace(ratio=ratio / 4)}))
        changes.append(("no damping", {"damping": damping._replace(ratio=0.0)}))
        less = damping.roll_off / 2
        changes.append((f"damping rolls off at {less:g}", {"damping": damping._replace(roll_off=less)}))
    if drive.winding == HALF:
        changes.append(("half steps compensated", {"drive": replace(drive, winding=HALF_COMPENSATED)}))
    others = []
    for name, change in changes:
        with suppress(MotorError):  # such a model is none of this rig: its supply does not drive that current
            others.append((name, replace(rig, **change)))
    factors = task.factors(task.drawn(UNMET, MODEL_VARIANTS))  # those of the search have been survived
    return tuple(Model(name, MODEL_VARIANTS, int(_lost(judge, point, Ensemble(other, factors)).sum()))
                 for name, other in others)  # fmt: skip


def fails(judge: Judge, point: Point) -> tuple[Failure, ...]:
    """What fails first, each quantity alone, the nearest first; what never does within a factor of four is left out."""
    trains = judge.trains(point)
    assert trains is not None
    task = judge.task
    rows, names = [], []
    for k, (name, (low, high)) in enumerate(zip(QUANTITIES, task.ranges, strict=True)):
        if low == high:
            continue
        for sign in (1, -1):
            for step in range(1, FARTHEST + 1):
                factors = np.ones(len(QUANTITIES))
                factors[k] = BEYOND ** (sign * step)
                rows.append(factors)
                names.append((name, sign, float(factors[k])))
    if not rows:
        return ()
    lost = _lost(judge, point, Ensemble(task.rig_with(trains[0].winding), np.array(rows)))
    first: dict[tuple[str, int], float] = {}
    for (name, sign, factor), is_lost in zip(names, lost, strict=True):
        if is_lost:
            first.setdefault((name, sign), factor)
    found = [Failure(name, factor) for (name, _), factor in first.items()]
    return tuple(sorted(found, key=lambda failure: abs(float(np.log(failure.factor)))))


def _lost(judge: Judge, point: Point, many: Ensemble) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    found = judge.trains(point)
    assert found is not None
    lost = np.zeros(len(many), bool)
    for train in found[1]:
        for pulses in judge.ways(train):
            lost |= many.judge(pulses).lost
    return lost


def check_of(judge: Judge, point: Point, count: int, first: int) -> Check:
    """How a point does with so many draws from `first` on, and with all corners; one look, with the fine substep."""
    task = judge.task
    corners = set(judge.answer(Job(point, task.corners, to_the_end=True, fine=True))) if task.corners else set()
    lost = judge.answer(Job(point, task.drawn(first, count), to_the_end=True, fine=True))
    return Check(count, len(lost), len(task.corners), len(corners), 1, 0)
