"""What a whole cell does in each round of its production, held as one round: a year of it costs what a minute does."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain, islice
from typing import Any, Generic, NamedTuple, TypeVar

from detent.axis import MotionStarted
from detent.cell.later import later
from detent.cell.turns import Timed
from detent.ticks import Ns

T = TypeVar("T", bound=Timed)

_new = tuple.__new__  # a named tuple's own takes as long as all the rest


class _Told(NamedTuple):
    """An entry of the round: all that stays as it is, or the motion, which goes on as a whole."""

    unit: int
    kind: type
    at: Ns
    rest: tuple[Any, ...]
    motion: MotionStarted | None
    growth: int


class Rounds(Generic[T]):
    """`batches`, of a unit and what it did in one go, `rounds` times more: each time `period` later than before.

    `growth` is how far the axis of a unit has come in a round, if it is not where it was. Entries begin with their
    time; but for motions they have no other. Never changed.
    """

    __slots__ = ("_sizes", "_told", "kinds", "period", "rounds")

    def __init__(
        self, batches: Sequence[tuple[int, Sequence[T]]], period: Ns, rounds: int, growth: Mapping[int, int] = {}
    ) -> None:
        self.period, self.rounds = period, rounds
        entries = [(unit, entry) for unit, batch in batches for entry in batch]
        self._sizes = [len(batch) for _, batch in batches]
        self.kinds = {type(entry) for _, entry in entries}  # what it is made of
        self._told: list[_Told] = []
        for unit, entry in entries:
            values: tuple[Any, ...] = tuple(entry)  # type: ignore[arg-type]  # a named tuple
            motion = entry if isinstance(entry, MotionStarted) else None
            self._told.append(_Told(unit, type(entry), values[0], values[1:], motion, growth.get(unit, 0)))

    @property
    def count(self) -> int:
        """How many entries there are."""
        return self.rounds * len(self._told)

    @property
    def units(self) -> list[int]:
        """The units that do something."""
        return sorted({told.unit for told in self._told})

    def __iter__(self) -> Iterator[tuple[int, T]]:
        """All entries with their units, made as they are asked for."""
        return self._made(self._told, 1)

    def batches(self) -> Iterator[tuple[int, Sequence[T]]]:
        """All entries in batches: what a unit did in one go."""
        for number in range(1, self.rounds + 1):
            made = iter(self._round(self._told, number))
            for size in self._sizes:
                some = list(islice(made, size))
                yield some[0][0], tuple(entry for _, entry in some)

    def with_kinds(self, kinds: Collection[type]) -> Iterator[tuple[int, T]]:
        """Those of these kinds, with their units."""
        return self._made([told for told in self._told if told.kind in kinds], 1)

    def of(self, unit: int, kinds: Collection[type] = ()) -> Iterator[T]:
        """The entries of one unit; of these kinds, if any are named."""
        mine = [told for told in self._told if told.unit == unit and (not kinds or told.kind in kinds)]
        return (entry for _, entry in self._made(mine, 1))

    def last(self) -> Iterator[tuple[int, T]]:
        """The entries of the last round: they leave things as all of them do."""
        return self._made(self._told, self.rounds)

    def _made(self, what: Sequence[_Told], first: int) -> Iterator[tuple[int, Any]]:
        return chain.from_iterable(self._round(what, number) for number in range(first, self.rounds + 1))

    def _round(self, what: Sequence[_Told], number: int) -> list[tuple[int, Any]]:
        by, new = number * self.period, _new
        return [
            (unit, new(kind, (at + by,) + rest) if motion is None else later(motion, by, number * growth))  # noqa: RUF005
            for unit, kind, at, rest, motion, growth in what
        ]
