"""What every segment of a pulse train is: a law, an instant it is anchored to, and a range of pulses on it.

Instants of a segment are `Fixed` (2**-60 ns) and relative to the start of its train. The law gives the true
time of each pulse, often irrational; a segment answers with its *floor* in `Fixed`. Rounding that half up
gives the nanosecond that rounding the true time half up would, ties included, because anchors and half
nanoseconds are whole numbers of `Fixed`.
"""

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, Self, TypeAlias

from detent.ticks import Fixed, Ns

if TYPE_CHECKING:  # loading NumPy takes longer than most of what is asked pulse by pulse
    import numpy as np
    import numpy.typing as npt

Int64Array: TypeAlias = "npt.NDArray[np.int64]"

# Estimates by float64 are good to 8 rounding errors of 2**-53; the guard is twice that.
GUARD = 2.0**-49


class State(NamedTuple):
    """A train at an instant: pulses given, progress in [0, 1) towards the next, and steps/s by the law.

    Where no segment is in force (before the start, after the end, in a gap) phase and rate are 0.
    """

    steps: int
    phase: float
    rate: float


class Immutable:
    """Copies are the thing itself: a cell that is copied shares its trains."""

    __slots__ = ()

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: Any) -> Self:
        return self


class Segment(Protocol):
    """The contract of the four laws. Pulses are numbered 1..steps within the segment; 0 is its beginning.

    A segment answers pulse by pulse; `filling` and `batch` ask many of it at once.
    """

    @property
    def steps(self) -> int | None:
        """How many pulses; None when it never ends."""

    @property
    def begin(self) -> Fixed:
        """The instant at which it comes into force; no pulse falls there."""

    @property
    def end(self) -> Fixed | None:
        """The instant at which it gives way to the next segment; None when it never ends."""

    def fixed(self, n: int) -> Fixed:
        """The floor of the instant of pulse n. 1 <= n <= steps is the caller's duty."""

    def ns(self, n: int, start: Fixed) -> Ns:
        """The ns of pulse n in a train that starts at `start`: its instant rounded half up."""

    def count_before(self, limit: Fixed) -> int:
        """How many pulses come truly before `limit`: 0..steps, for any instant."""

    def progress(self, instant: Fixed) -> tuple[float, float]:
        """(steps since the beginning, with fraction; steps/s) by the law, for begin <= instant <= end."""

    def part(self, first: int, last: int | None) -> Self:
        """The same law and anchor with only the pulses first + 1 .. last (None: all that follow)."""

    def moved(self, by: Fixed) -> Self:
        """The same segment, `by` later in its train."""


def check_range(first: int, last: int | None, steps: int | None) -> None:
    """Raise ValueError unless the pulses first + 1 .. last lie in a law of `steps` pulses (None: endless)."""
    if first < 0 or (last is not None and last < first):
        raise ValueError(f"a segment keeps the pulses first + 1 .. last with 0 <= first <= last, not {first}, {last}")
    if steps is not None and (last is None or last > steps):
        raise ValueError(f"the segment has {steps} pulses: it has no part that goes to pulse {last}")
