"""Pulse trains as the runs of steps that a board executes: (interval, count, add), within an error that is kept.

Pulse k (1 to count) of a run falls at base + k * interval + add * k * (k - 1) / 2 ticks, where base is the tick of the
last pulse of the run before. The time of each pulse is rounded once, to a ns (`Train.times`); its window is every tick
within the error of that ns. The greedy longest run from the tick actually sent last is near the optimum, as windows
are intervals and a run that fits is still fit when it is cut short.
"""

from collections.abc import Iterator
from typing import Literal, NamedTuple, TypeAlias

from detent.ticks import Ns

Error: TypeAlias = Ns | Literal["exact"]


class Run(NamedTuple):
    """So many steps: the first `interval` ticks behind the step before, each further interval longer by `add`."""

    interval: int
    steps: int
    add: int


def ticks_of(runs: Iterator[Run], base: int) -> Iterator[int]:
    """The tick of every pulse of some runs, the first of which begins at `base`."""
    raise NotImplementedError
