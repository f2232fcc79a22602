"""A piece of the tuner's work: which of these variants lose a step with the settings of a point.

What a job answers hangs on its task, its point and the numbers of its variants, and on nothing else: neither on what
is judged beside it nor on who does it.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from detent.motors.move import Part, Pulses
from detent.motors.variants import Ensemble
from detent.pulses import Train
from detent.tuner.spaces import Point, Profile, Space, space
from detent.tuner.task import Task, TunerError

KEPT = 256  # profiles with their trains
FIRST = 32  # variants that are asked first: as many as run abreast


class Job(NamedTuple):
    """`variants` are numbers of the task (`Task.factors`). `fine`: with the substep of verdicts that are printed."""

    point: Point
    variants: tuple[int, ...]
    to_the_end: bool = False  # else the first that is lost will do
    fine: bool = False


Lost = tuple[int, ...]
"""The variants that lose a step in one of the moves: all of them, or the first that was met."""
Runner = Callable[[Task, Sequence[Job]], Iterable[Lost]]
"""Does jobs, in whatever order and wherever; gives the answers in the order of the jobs, as they come."""


def one_by_one(task: Task, jobs: Sequence[Job]) -> Iterator[Lost]:
    """The runner of one process."""
    judge = judge_of(task)
    return (judge.answer(job) for job in jobs)


class Judge:
    """Answers the jobs of one task. Keeps the trains of the points that it met last."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self._kept: OrderedDict[Point, tuple[Profile, tuple[Train, ...]] | None] = OrderedDict()

    @cached_property
    def space(self) -> Space:
        """What may be chosen."""
        return space(self.task)

    def trains(self, point: Point) -> tuple[Profile, tuple[Train, ...]] | None:
        """The profile of a point and the train of each move; None where there is no such profile."""
        if point in self._kept:
            self._kept.move_to_end(point)
            return self._kept[point]
        profile = self.space.profile(point)
        found = None
        if profile is not None:
            found = profile, tuple(profile.train(move.steps) for move in self.task.moves)
        self._kept[point] = found
        if len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return found

    def times(self, point: Point) -> tuple[float, ...] | None:
        """Seconds of each move, from the start to the last pulse: what the pulses say, before any motor is asked."""
        found = self.trains(point)
        if found is None:
            return None
        return tuple((train.duration or 0) * 1e-9 for train in found[1])

    def time(self, point: Point) -> float | None:
        """Seconds of all moves together, each as often as it is made."""
        times = self.times(point)
        return None if times is None else weighed(self.task, times)

    def ways(self, train: Train) -> list[Pulses]:
        """See `ways_of`."""
        return ways_of(self.task, train)

    def answer(self, job: Job) -> Lost:
        """The variants of the job that lose a step."""
        found = self.trains(job.point)
        if found is None:
            raise TunerError(f"{job.point}: there is no such profile")
        profile, trains = found
        rig = self.task.rig_with(profile.winding, fine=job.fine)
        many = Ensemble(rig, self.task.factors(job.variants))
        moves = [way for train in sorted(trains, key=lambda train: train.steps or 0) for way in self.ways(train)]
        if job.to_the_end:
            lost = np.zeros(len(many), bool)
            for pulses in moves:
                lost |= many.judge(pulses).lost
            return tuple(job.variants[k] for k in np.flatnonzero(lost))
        for part in (slice(0, FIRST), slice(FIRST, None)):  # all moves of those that lose often, before the others
            some = many.of(part)
            for pulses in moves if len(some) else ():
                if (at := some.survives(pulses)) is not None:
                    return (job.variants[(part.start or 0) + at],)
        return ()


def ways_of(task: Task, train: Train) -> list[Pulses]:
    """The move as it is judged: there, and back where the load pulls to one side."""
    return [train, [Part(train, -1)]] if task.both_ways else [train]


def weighed(task: Task, times: Sequence[float]) -> float:
    """The sum, each as often as its move is made."""
    return sum(time * move.weight for time, move in zip(times, task.moves, strict=True))


_LAST: dict[int, Judge] = {}


def judge_of(task: Task) -> Judge:
    """The judge of a task; the last one is kept."""
    found = _LAST.get(id(task))
    if found is None or found.task is not task:
        found = Judge(task)
        _LAST.clear()
        _LAST[id(task)] = found
    return found
