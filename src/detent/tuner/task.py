"""What a tuner is asked for: a controller, a rig, moves, and how much the machines differ that shall make them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from detent.extras import need
from detent.motors.motor import MotorError
from detent.motors.rotor import FINE, SUBSTEP, Floats, Rig
from detent.motors.variants import SPREAD, Ensemble, Spread, corners, draws
from detent.motors.winding import Winding
from detent.moves.law import Law
from detent.moves.laws import law
from detent.ticks import Ns

SCREENED = 768  # fresh variants that a point meets before it is believed
FINAL = 2048  # fresh ones that prove it in the end
NOMINAL = -1  # the number of the rig as it was given
MOST_FINAL = 1_000_000
MOST_MOVES = 32


class TunerError(ValueError):
    """A task that cannot be done; the text says why, and what to change."""


class Move(NamedTuple):
    """A distance in steps of the controller as it is set up at first, and how often it is made."""

    steps: int
    weight: float = 1.0


def check_installed() -> None:
    """Raise MissingExtra without numba: moves are judged by the thousand, for which plain Python would take hours."""
    need("fast", "to tune and to compare moves needs")


def moves_of(text: str) -> tuple[Move, ...]:
    """Moves as people write them: 200,1000x3,5000 is 200 once, 1000 three times, 5000 once. TunerError."""
    found = []
    for word in text.split(","):
        steps, times, weight = word.strip().lower().partition("x")
        try:
            move = Move(int(steps), float(weight) if times else 1.0)
        except ValueError:
            raise TunerError(f"--moves {text}: write STEPS or STEPSxTIMES with commas between: 200,1000x3") from None
        if not (move.steps >= 1 and 0 < move.weight <= 1e9):
            raise TunerError(f"--moves {text}: {word.strip()!r}: a move has a step or more, and is made some times")
        found.append(move)
    return tuple(found)


@dataclass(frozen=True)
class Task:
    """Everything on which the answer hangs. The same task has the same answer, however the work is divided.

    `moves` count steps of the model as `options` set it up. TunerError for moves that the model does not make.
    """

    model: str
    rig: Rig
    moves: tuple[Move, ...]
    options: Mapping[str, object] = field(default_factory=dict)
    axis: str = ""
    spread: Spread = SPREAD
    seed: int = 1
    at_corners: bool = True
    screened: int = SCREENED
    final: int = FINAL
    refined: bool = True  # look between the points of the grid, too

    def __post_init__(self) -> None:
        if not 1 <= len(self.moves) <= MOST_MOVES:
            raise TunerError(f"{len(self.moves)} moves: give 1 to {MOST_MOVES}")
        for move in self.moves:
            if move.steps > self.law.most:
                raise TunerError(f"--moves {move.steps}: a {self.model} moves at most {self.law.most} steps at once")
        if not (1 <= self.final <= MOST_FINAL and 0 <= self.screened <= MOST_FINAL):
            raise TunerError(f"--variants {self.final}: give 1 to {MOST_FINAL}")

    def __reduce__(self) -> tuple[type["Task"], tuple[object, ...]]:
        return Task, tuple(getattr(self, part.name) for part in fields(self))  # a law does not travel: it is made again

    @cached_property
    def law(self) -> Law:
        """That of the model as the options set it up."""
        return law(self.model, self.options, self.axis)

    @cached_property
    def ranges(self) -> Spread:
        """The spread without what has nothing to vary in this rig."""
        return self.spread.of(self.rig)

    @cached_property
    def corner_factors(self) -> Floats:
        """Those of all corners; none if corners are not asked for."""
        found = corners(self.ranges)
        return found if self.at_corners else found[:0]

    @property
    def corners(self) -> tuple[int, ...]:
        """The numbers of the corners."""
        return tuple(range(len(self.corner_factors)))

    @property
    def both_ways(self) -> bool:
        """Whether the moves are judged in both directions, as a load pulls towards one."""
        return self.rig.load.is_steady and self.rig.load.torque != 0

    def drawn(self, first: int, count: int) -> tuple[int, ...]:
        """The numbers of draws `first`, `first` + 1, ..."""
        begin = len(self.corner_factors) + first
        return tuple(range(begin, begin + count))

    def factors(self, variants: tuple[int, ...]) -> Floats:
        """The factors of the variants with these numbers: -1 is the rig itself, then come corners, then draws."""
        numbers, at = np.array(variants, np.int64), len(self.corner_factors)
        found = np.ones((len(numbers), len(self.ranges)))
        among = (numbers >= 0) & (numbers < at)
        found[among] = self.corner_factors[numbers[among]]
        drawn = np.flatnonzero(numbers >= at)
        if len(drawn):
            wanted = numbers[drawn] - at
            breaks = np.flatnonzero(np.diff(wanted) != 1) + 1  # runs of draws that follow each other come at once
            for run in np.split(np.arange(len(wanted)), breaks):
                first = int(wanted[run[0]])
                found[drawn[run]] = draws(self.ranges, len(run), seed=self.seed, first=first)
        return found

    def substep(self, *, fine: bool) -> Ns:
        """One for every variant of the spread: so no verdict hangs on which of them are judged together."""
        base = replace(self.rig, substep=FINE if fine else SUBSTEP)
        return Ensemble(base, corners(self.ranges)).substep

    @cached_property
    def substeps(self) -> tuple[Ns, Ns]:
        """The one of the search, and the one of the final look."""
        return self.substep(fine=False), self.substep(fine=True)

    def rig_with(self, winding: Winding, *, fine: bool = False) -> Rig:
        """The rig with this stepping and the substep of all its variants."""
        drive = replace(self.rig.drive, winding=winding)
        return replace(self.rig, drive=drive, substep=self.substeps[fine])


def check_rig(rig: Rig | None, motor: str) -> Rig:
    """The rig. MotorError where nobody has said what turns."""
    if rig is None:
        raise MotorError(f"--inertia: the maker of {motor} gives no rotor inertia: give rotor and load together, kg m2")
    return rig
