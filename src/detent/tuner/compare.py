"""Settings beside each other: the time of each move, how many variants lose it, the torque that it uses."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from detent.motors.rotor import Floats
from detent.motors.variants import UNMET, Ensemble
from detent.moves.law import Law, Values
from detent.pulses import Train
from detent.tuner.judge import ways_of
from detent.tuner.quasi_static import Torque, torque_of
from detent.tuner.search import Check
from detent.tuner.task import Task, check_installed

SMOOTHED = 8  # pulses that a speed is the mean of ...
TICKS = 600  # ... and ticks of the controller at least: a pulse comes up to one of them late
MOST_POINTS = 4000


class Compared(NamedTuple):
    """What becomes of one of the settings. `speeds` and `used` go with `at` (s) of the longest move.

    `used` is torque asked for over pull-out torque at that speed; below 0 it brakes.
    """

    name: str
    times: tuple[float, ...]  # s of each move
    check: Check
    most_used: float
    at: Floats
    speeds: Floats
    used: Floats
    remark: str = ""  # what the controller makes of settings that contradict each other


def compare(task: Task, settings: Sequence[tuple[str, Law, Values]]) -> list[Compared]:
    """Settings with their names, in the order given. The same draws, and all corners, judge each of them.

    There and back, where the load pulls to one side. Each is a look, so that all bounds hold together.
    MissingExtra where it would take hours.
    """
    check_installed()
    torque = torque_of(task.rig)
    rig = task.rig_with(task.rig.drive.winding, fine=True)
    corners = Ensemble(rig, task.factors(task.corners)) if task.corners else None
    drawn = Ensemble(rig, task.factors(task.drawn(UNMET, task.final)))
    found = []
    for name, law, values in settings:
        trains = [law.train(values, move.steps) for move in task.moves]
        lost = np.zeros(len(drawn), bool)
        corners_lost = np.zeros(0 if corners is None else len(corners), bool)
        for pulses in (way for train in trains for way in ways_of(task, train)):
            lost |= drawn.judge(pulses).lost
            if corners is not None:
                corners_lost |= corners.judge(pulses).lost
        check = Check(len(lost), int(lost.sum()), len(corners_lost), int(corners_lost.sum()), len(settings), 0)
        longest = max(trains, key=lambda train: train.steps or 0)
        at, speeds, used = torque_used(longest, torque)
        times = tuple((train.duration or 0) * 1e-9 for train in trains)
        found.append(Compared(name, times, check, float(np.abs(used).max()), at, speeds, used,
                              law.remark(values)))  # fmt: skip
    return found


def torque_used(train: Train, torque: Torque) -> tuple[Floats, Floats, Floats]:
    """Time (s), speed (steps/s) and torque over pull-out torque at each pulse, of a rotor that never lags."""
    times = np.asarray(train.times(), np.float64) * 1e-9
    if len(times) < 3:
        return times, np.zeros_like(times), np.zeros_like(times)
    each = max(SMOOTHED, len(times) // MOST_POINTS)
    marks = np.unique(np.concatenate((np.arange(0, len(times), min(each, max(len(times) // 8, 1))), [len(times) - 1])))
    marks = _apart(marks, times, min(TICKS * _tick(train), (times[-1] - times[0]) / 8))
    gaps = np.diff(times[marks])
    speeds = np.diff(marks) / gaps
    at = (times[marks][1:] + times[marks][:-1]) / 2
    acceleration = np.gradient(speeds, at) if len(at) > 1 else np.zeros_like(at)
    needed = acceleration * torque.inertia * torque.radians + np.interp(speeds, torque.speeds, torque.steady)
    available = np.maximum(np.interp(speeds, torque.speeds, torque.available), 1e-9)
    return at, speeds, needed / available


def _tick(train: Train) -> float:
    """Seconds of which the time from pulse to pulse is always a multiple."""
    return float(np.gcd.reduce(np.diff(np.asarray(train.times(), np.int64)))) * 1e-9


def _apart(marks: npt.NDArray[np.int64], times: Floats, least: float) -> npt.NDArray[np.int64]:
    """Those of the marks that are so many seconds apart; the last one stays."""
    kept = [int(marks[0])]
    for mark in marks[1:-1].tolist():
        if times[mark] - times[kept[-1]] >= least <= times[marks[-1]] - times[mark]:
            kept.append(mark)
    return np.array([*kept, int(marks[-1])], np.int64)
