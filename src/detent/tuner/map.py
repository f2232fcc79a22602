"""The loss rate over two settings: where moves are lost, how long they take, and where the chosen settings lie."""

from collections.abc import Sequence
from math import log
from typing import NamedTuple

import numpy as np

from detent.motors.rotor import Floats
from detent.tuner.grid import logarithmic
from detent.tuner.judge import Job, Runner, judge_of, one_by_one
from detent.tuner.search import Cancelled, Progress, Stopped, Watch, never, nobody
from detent.tuner.spaces import Point
from detent.tuner.task import Task

COLUMNS, ROWS, VARIANTS = 22, 20, 32
TOGETHER = 8  # points given to the runner at once
ABOUT = 2.5  # a map reaches from the chosen point so many times either way, and over the grid of the search


class Map(NamedTuple):
    """A map with `x` (slew) and `y` (ramp) rising. `lost` and `times` have a row for each y, a column for each x.

    A point that is none (a table that cannot be) is NaN in both.
    """

    names: tuple[str, str]
    labels: tuple[str, str]  # what x and y count
    x: tuple[int, ...]
    y: tuple[int, ...]
    lost: Floats  # the part of the variants that lose a step
    times: Floats  # s, all moves
    variants: int
    chosen: tuple[int, int]
    point: Point

    def rows(self) -> list[tuple[int, int, float, float]]:
        """Each point: x, y, loss rate, seconds."""
        return [(x, y, float(self.lost[j, i]), float(self.times[j, i]))
                for j, y in enumerate(self.y) for i, x in enumerate(self.x)]  # fmt: skip

    def csv(self) -> str:
        """The map as a table."""
        head = ",".join(f'"{label}"' for label in self.labels) + f",loss rate of {self.variants},s"
        return "\n".join([head, *(f"{x},{y},{lost:.6g},{time:.9g}" for x, y, lost, time in self.rows())]) + "\n"


def through(values: Sequence[int], chosen: int) -> tuple[int, ...]:
    """Values of an axis with `chosen` in place of the one next to it.

    At a limit of the controller that one may be beyond it: the chosen settings lay where there are none.
    """
    nearest = min(range(len(values)), key=lambda at: abs(log(max(values[at], 1) / max(chosen, 1))))
    return (*values[:nearest], chosen, *values[nearest + 1 :])


def loss_map(
    task: Task, point: Point, *, columns: int = COLUMNS, rows: int = ROWS, variants: int = VARIANTS,
    run: Runner = one_by_one, together: int = TOGETHER, watch: Watch = nobody, cancelled: Cancelled = never,
) -> Map:  # fmt: skip
    """The map about a point. Draws 0 to `variants` of the task judge each of its points.

    `together` points are given to `run` at once. Stopped if it was: half a map says nothing.
    """
    judge = judge_of(task)
    space = judge.space
    x_at, y_at = (space.place(name) for name in space.plane)
    axes = []
    for at, count in ((x_at, columns), (y_at, rows)):
        dimension = space.dimensions[at]
        begin = min(dimension.values[0], point[at] / ABOUT) if at == y_at else min(dimension.values[0], point[at])
        begin = max(begin, point[at] / 8)
        end = max(min(dimension.values[-1], point[at] * 4), point[at] * 1.2)
        values = logarithmic(dimension.name, dimension.low, dimension.high, begin, end, count).values
        axes.append(through(values, point[at]))
    x, y = axes
    places = [(j, i) for j in range(len(y)) for i in range(len(x))]
    lost, times = np.full((len(y), len(x)), np.nan), np.full((len(y), len(x)), np.nan)
    drawn = task.drawn(0, variants)
    jobs: list[tuple[tuple[int, int], Job]] = []
    for j, i in places:
        here = space.on_plane(point, x[i], y[j])
        time = judge.time(here) if space.admits(here) else None
        if time is not None:
            times[j, i] = time
            jobs.append(((j, i), Job(here, drawn, to_the_end=True)))
    for k in range(0, len(jobs), together):
        some = jobs[k : k + together]
        for (place, _), losers in zip(some, run(task, [job for _, job in some]), strict=True):
            lost[place] = len(losers) / variants
        if cancelled():
            raise Stopped("the map was stopped before it was whole")
        watch(Progress(k + len(some), len(jobs), None, "map"))
    return Map(space.plane, space.labels, x, y, lost, times, variants, (point[x_at], point[y_at]), point)
