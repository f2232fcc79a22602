"""What programs do that turn in loops, held as one turn: a year of it costs what a second does."""

from collections.abc import Iterator, Sequence
from heapq import merge
from itertools import groupby
from operator import itemgetter
from typing import Generic, NamedTuple, Protocol, Self, TypeVar

from detent.ticks import Ns


class Timed(Protocol):
    """Something that happened at a time: a named tuple."""

    @property
    def at(self) -> Ns:
        """When."""

    def _replace(self, *, at: Ns) -> Self:
        """The same at another time."""


T = TypeVar("T", bound=Timed)


class Turn(NamedTuple, Generic[T]):
    """What a unit does in each turn of a loop: `entries`, in order, from `begins` on and before `begins` + `period`."""

    unit: int
    begins: Ns
    period: Ns
    entries: tuple[T, ...]


class Turns(Generic[T]):
    """The turns of some units, all up to but not including `ends`, in order of time. Never changed.

    What several of them do in one instant is in the order of `turns`.
    """

    __slots__ = ("ends", "kinds", "turns")

    def __init__(self, turns: Sequence[Turn[T]], ends: Ns) -> None:
        self.turns, self.ends = tuple(turns), ends
        self.kinds = {type(entry) for turn in turns for entry in turn.entries}  # what it is made of

    @property
    def count(self) -> int:
        """How many entries there are."""
        found = 0
        for turn in self.turns:
            rounds, rest = divmod(self.ends - turn.begins, turn.period)
            begun = sum(entry.at < turn.begins + rest for entry in turn.entries)
            found += rounds * len(turn.entries) + begun
        return found

    @property
    def units(self) -> list[int]:
        """The units."""
        return [turn.unit for turn in self.turns]

    def __iter__(self) -> Iterator[tuple[int, T]]:
        """All entries with their units, made as they are asked for."""
        if len(self.turns) == 1:
            return ((unit, entry) for _, unit, entry in self._of(self.turns[0]))
        return ((unit, entry) for _, unit, entry in merge(*map(self._of, self.turns), key=itemgetter(0)))

    def batches(self) -> Iterator[tuple[int, Sequence[T]]]:
        """All entries in batches: what a unit did in one instant."""
        for (unit, _), some in groupby(self, key=lambda entry: (entry[0], entry[1].at)):
            yield unit, tuple(entry for _, entry in some)

    def of(self, unit: int) -> Iterator[T]:
        """The entries of one unit."""
        return (entry for turn in self.turns if turn.unit == unit for _, _, entry in self._of(turn))

    def last(self) -> Iterator[tuple[int, T]]:
        """The entries of the last turn of each unit: they leave things as all of them do."""
        for turn in self.turns:
            rounds = max((self.ends - turn.begins) // turn.period - 1, 0)
            for _, unit, entry in self._of(turn, rounds * turn.period):
                yield unit, entry

    def _of(self, turn: Turn[T], later: Ns = 0) -> Iterator[tuple[Ns, int, T]]:
        """The entries of a turn, so much `later` than they say, over and over; each with its time and unit."""
        if not turn.entries:
            return
        unit, period, ends = turn.unit, turn.period, self.ends
        while True:
            for entry in turn.entries:
                at = entry.at + later
                if at >= ends:
                    return
                yield at, unit, entry._replace(at=at)
            later += period
