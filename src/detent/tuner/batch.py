"""Many tasks, each its own answer: a row of a batch."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from detent.extras import MissingExtra
from detent.tuner.search import Watch, nobody, search
from detent.tuner.task import Task


class Answer(NamedTuple):
    """What was found for a task; `problem` says why nothing was."""

    settings: str = ""
    seconds: float | None = None  # of all moves, each as often as it is made
    lost: int | None = None  # of `tried` fresh variants
    tried: int | None = None
    below: float | None = None  # what that proves of the rate of losses, at 95 %
    problem: str = ""
    commands: tuple[str, ...] = ()
    options: Mapping[str, str] = {}  # that no command sets
    looks: int | None = None  # that `below` counts


def answers(_: object, tasks: Sequence[Task]) -> list[Answer]:
    """The answer to each; as `detent.realtime.workers.Workers.map` wants it."""
    return [answer(task) for task in tasks]


def answer(task: Task, watch: Watch = nobody) -> Answer:
    """The answer to a task. It hangs on the task alone."""
    try:
        found = search(task, watch=watch)
    except (ValueError, MissingExtra) as error:  # nothing moves this load, a motor without data, a bare worker
        return Answer(problem=str(error))
    check, profile = found.check, found.profile
    return Answer(str(profile), round(found.time, 9), check.lost, check.variants, check.bound, "", profile.settings,
                  dict(profile.options), check.looks)  # fmt: skip
