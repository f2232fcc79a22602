"""The process of a search: it reads a task of its input, and prints a line of JSON for everything that there is to say.

``{"progress": [done, total, best, doing]}`` now and then, ``{"found": FACTS, "point": [...]}``, ``{"map": {...}}``, or
``{"problem": TEXT}``. A line ``stop`` on its input ends it with the best so far; its input's end ends it at once.
"""

import contextlib
import json
import os
import pickle
import sys
import threading
import time
from typing import Any, NamedTuple

from detent.extras import MissingExtra
from detent.motors import gpu
from detent.tuner.map import loss_map
from detent.tuner.report import facts, fails_words, models_words, option_lines
from detent.tuner.search import Progress
from detent.tuner.spaces import Point
from detent.tuner.task import Task
from detent.tuner.tune import tune
from detent.workbench.pipe import HEAD

EACH = 0.15  # s between two lines that say how far it is
STOP = b"stop\n"


class Order(NamedTuple):
    """What is searched for; the map of it is drawn, too, or (`point`) the map about settings that are known."""

    task: Task
    map: bool = True
    point: Point | None = None


def say(**what: Any) -> None:
    """A line for the workbench."""
    print(json.dumps(what), flush=True)


class _Watch:
    def __init__(self) -> None:
        self._said = 0.0

    def __call__(self, step: Progress) -> None:
        now = time.monotonic()
        if now >= self._said + EACH:
            self._said = now
            say(progress=[step.done, step.total, step.best, step.doing])


def search(order: Order, stopped: threading.Event) -> None:
    """Carry it out. ValueError where nothing is found, or nothing was known when it was stopped."""
    task, watch, point = order.task, _Watch(), order.point
    gpu.use(where_there_is_one=True)
    if point is None:
        tuned = tune(task, watch=watch, cancelled=stopped.is_set)
        profile, point = tuned.found.profile, tuned.found.point
        words = {
            "settings_words": str(profile), "option_lines": option_lines(profile), "resets": list(profile.before),
            "fails_words": fails_words(tuned), "models_words": models_words(tuned), "part": list(profile.part),
        }  # fmt: skip
        say(found={**facts(tuned), **words, "gpu": gpu.used()}, point=list(point))
        if stopped.is_set():
            return
    if order.map:
        found = loss_map(task, point, watch=watch, cancelled=stopped.is_set)
        say(map={
            "names": found.names, "labels": found.labels, "x": found.x, "y": found.y, "chosen": found.chosen,
            "variants": found.variants, "lost": _rows(found.lost, 4), "times": _rows(found.times, 9),
        })  # fmt: skip


def _rows(values: Any, digits: int) -> list[list[float | None]]:
    """Rows of numbers as JSON has them: what is none is null."""
    return [[None if value != value else round(float(value), digits) for value in row] for row in values]


def _read(size: int) -> bytes:
    """So many bytes of the input; fewer at its end. Unbuffered: another thread waits there when this process ends."""
    data = b""
    while len(data) < size and (more := os.read(0, size - len(data))):
        data += more
    return data


def _hear(stopped: threading.Event) -> None:
    """Wait for the word to stop, and for the end of who gives it."""
    while word := _read(len(STOP)):
        if word == STOP:
            stopped.set()
    os._exit(0)


def main() -> int:
    """Do what the first message on the input orders."""
    head = _read(HEAD.size)
    if len(head) < HEAD.size:
        return 0
    order = pickle.loads(_read(*HEAD.unpack(head)))  # of the process that made us
    stopped = threading.Event()
    threading.Thread(target=_hear, args=(stopped,), daemon=True).start()
    with contextlib.suppress(OSError):
        os.nice(5)  # the cell and its pages go first
    try:
        search(order, stopped)
    except (ValueError, MissingExtra) as error:  # TunerError, MotorError
        say(problem=str(error))
    return 0


if __name__ == "__main__":
    sys.exit(main())
