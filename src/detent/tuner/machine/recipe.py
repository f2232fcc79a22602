"""Which settings are tried, one after the other: the datasheet's recipe, from the safe side, with a reserve.

"Very conservative ramp gradients, i.e. very long ramps, that will be gradually shortened until the first positioning
error is detected" (GS-C200 datasheet, application information). Here they are shortened in factors of the square root
of 2, from a setting that is known to be safe, until a trial is lost; then in ever smaller factors between the last good
and the first bad. Nothing harder than a setting that has lost is ever tried. What is shipped is the last good one with
a reserve, and it is tried more often.
"""

from collections.abc import Generator, Sequence
from math import ceil, floor, sqrt
from typing import NamedTuple

from detent.tuner.machine.bench import Knob

COARSE = sqrt(2)
LOOKS = 6  # settings that are tried as the one to ship, each gentler than the one before
CLOSE = 1.08  # the bracket is closed when bad and good are no farther apart


class RecipeError(RuntimeError):
    """The recipe cannot go on; the text says why, and what to do."""


class Trial(NamedTuple):
    """One move out and back: the number of the knob, the steps, and whether it is one that confirms what is shipped."""

    knob: int
    steps: int
    confirms: bool = False


class Found(NamedTuple):
    """What the trials have shown. `bad` is None where the hardest setting was made without a loss."""

    good: int
    bad: int | None
    shipped: int
    clean: int  # trials of the shipped setting with each of the moves, none lost
    looks: int  # settings that were tried as the one to ship


Recipe = Generator[Trial, bool, Found]
"""Is sent whether the trial that it yielded was lost."""


def recipe(
    knob: Knob, begin: int, moves: Sequence[int], *, trials: int = 3, confirm: int = 59, reserve: float | None = None
) -> Recipe:
    """Bracket from `begin`, which is taken for safe, and confirm the shipped setting. Raises RecipeError."""
    margin = knob.reserve if reserve is None else reserve
    distances = sorted(moves)
    if not (yield from _made(begin, distances, trials)):
        raise RecipeError(
            f"a step was lost with {knob.name}={begin} already, with which it began: begin gentler, look whether the "
            "carriage is free over all of the travel, or move less far"
        )
    good, bad = begin, None
    while bad is None and (harder := knob.harder(good, COARSE)) != good:
        if (yield from _made(harder, distances, trials)):
            good = harder
        else:
            bad = harder
    while bad is not None:
        between = _between(knob, good, bad)
        if between is None:
            break
        if (yield from _made(between, distances, trials)):
            good = between
        else:
            bad = between
    shipped = _gentler(knob, good, margin)
    for looks in range(1, LOOKS + 1):
        if (yield from _made(shipped, distances, confirm, confirms=True)):
            return Found(good, bad, shipped, confirm, looks)
        if (gentler := _gentler(knob, shipped, COARSE)) == shipped:
            break
        shipped = gentler
    raise RecipeError(
        f"{knob.name}={shipped} lost a step after it had been good before: the machine is not the same from trial to "
        "trial; look for what binds, slips or is loose before it is tuned"
    )


def _made(
    number: int, distances: Sequence[int], trials: int, *, confirms: bool = False
) -> Generator[Trial, bool, bool]:
    """Whether every distance is made so many times, by turns; it ends at the first that is lost."""
    for _ in range(trials):
        for steps in distances:
            if (yield Trial(number, steps, confirms)):
                return False
    return True


def _between(knob: Knob, good: int, bad: int) -> int | None:
    """The middle, in proportions; None when nothing is between, or they are close."""
    if max(good, bad) <= CLOSE * min(good, bad):
        return None
    middle = round(sqrt(good * bad))
    return None if middle in (good, bad) else middle


def _gentler(knob: Knob, number: int, factor: float) -> int:
    """`number` made gentler, rounded to the gentle side, within what the command takes."""
    wanted = number * factor if knob.longer else number / factor
    return min(max(ceil(wanted) if knob.longer else floor(wanted), knob.low), knob.high)
