"""What happened in a cell: an append-only log, shared by a cell and its copies up to where they part.

Entries are pairs (index of the unit in `units`, output or input). A copy of a cell keeps only the length of
the log; the first of several copies to go on writes into the shared list, the others then fork it.
"""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Generic, NamedTuple, Self, TypeAlias, TypeVar

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.rounds import Rounds
from detent.cell.turns import Turns
from detent.controllers.device import Output
from detent.pins import Level
from detent.pulses import Train
from detent.ticks import Ns
from detent.uart import Char


class InputSet(NamedTuple):
    """A wire or a switch gives an input pin of the unit a level."""

    at: Ns
    pin: str
    level: Level


class Received(NamedTuple):
    """A character reached the unit: its start bit began at `began`, its last stop bit ended at `at`."""

    at: Ns
    port: str
    char: Char
    began: Ns


Entry: TypeAlias = Output | InputSet | Received

T = TypeVar("T")

Batch: TypeAlias = tuple[int, Sequence[Entry]]
"""A unit, by its number, and what it did in one go."""

Repeated: TypeAlias = Turns[Entry] | Rounds[Entry]
"""What programs in loops did turn after turn, or the whole cell round after round."""


class Span(NamedTuple):
    """Pulses `first` to `last` of `train` (none if last < first), given in `direction` by one unit.

    Pulse n of the train ends at `shaft` + direction * n. `ends` is when the span was over: its last pulse, or
    the moment it was cut, replaced or, for the last one, the end of the recording.
    """

    begins: Ns
    ends: Ns
    train: Train
    first: int
    last: int
    direction: int
    shaft: int


class Log(Generic[T]):
    """An append-only list that is shared by its copies up to where they part. Copying costs the same at any length."""

    __slots__ = ("_items", "_size")

    forgotten: int = 0  # items at its beginning that are no longer kept: none, but in logs that forget

    def __init__(self) -> None:
        self._items: list[T] = []
        self._size = 0  # items that are ours; a copy may have appended more

    def __len__(self) -> int:
        return self._size

    def __iter__(self) -> Iterator[T]:
        return islice(self._items, self._size)

    def append(self, item: T) -> None:
        """Add one item, which must not change any more."""
        if len(self._items) != self._size:  # a copy has gone on from here already: part from it
            self._items = self._items[: self._size]
        self._items.append(item)
        self._size += 1

    @property
    def appended(self) -> int:
        """How many items were added since it began, those that are forgotten among them."""
        return self.forgotten + self._size

    def since(self, count: int) -> list[T]:
        """What was added behind the first `count` items; of what is forgotten nothing."""
        return self._items[max(count - self.forgotten, 0) : self._size]

    def take(self) -> list[T]:
        """Everything that is in it; it begins anew. Copies keep what they have."""
        taken = self._items if len(self._items) == self._size else self._items[: self._size]
        self._items, self._size = [], 0
        return taken

    def __deepcopy__(self, _: object) -> Self:
        twin = type(self).__new__(type(self))
        twin._items, twin._size = self._items, self._size  # noqa: SLF001 (its own class)
        return twin


class Recording:
    """What the units of one cell did, in batches: whatever one unit did in one go costs one append.

    Programs that turn in loops may have been told as one turn (`turn`); looked at, everything is there.
    """

    __slots__ = ("_batches", "units")

    def __init__(self, units: Sequence[str]) -> None:
        self.units = tuple(units)
        self._batches: Log[Batch | Repeated] = Log()

    def __len__(self) -> int:
        """How many entries there are."""
        return sum(len(item[1]) if isinstance(item, tuple) else item.count for item in self._batches)

    def __iter__(self) -> Iterator[tuple[int, Entry]]:
        """All entries, in the order in which they happened."""
        return self.with_kinds()

    def with_kinds(self, *kinds: type[Entry]) -> Iterator[tuple[int, Entry]]:
        """All entries of these kinds (without any: of all kinds), and perhaps others, in order.

        Whoever says what is wanted does not go through a year of a program that does nothing of it.
        """
        for item in self._batches:
            if isinstance(item, tuple):
                unit, entries = item
                for entry in entries:
                    yield unit, entry
            elif not kinds or not item.kinds.isdisjoint(kinds):
                yield from item.with_kinds(kinds) if kinds and isinstance(item, Rounds) else item

    def pieces(self) -> Iterator["Batch | Repeated"]:
        """What it is made of, in order: batches, programs in loops as one turn of each, the cell as one round."""
        return iter(self._batches)

    def extend(self, unit: int, entries: Sequence[Entry]) -> None:
        """Add what one unit did."""
        self._batches.append((unit, entries))

    def turn(self, turns: "Repeated") -> None:
        """Add what units did whose programs turned in loops: instructions and levels of outputs, nothing else.

        Or what the whole cell did, round after round.
        """
        self._batches.append(turns)

    def take(self) -> list[Batch]:
        """The batches since the last call, as many as if nothing had been passed over. For somebody who keeps them."""
        taken: list[Batch] = []
        for item in self._batches.take():
            if isinstance(item, tuple):
                taken.append(item)
            else:
                taken += item.batches()
        return taken

    def of(self, unit: str, *kinds: type[Entry]) -> list[Entry]:
        """The entries of one unit, in order; as in `with_kinds`."""
        index = self.units.index(unit)
        found: list[Entry] = []
        for item in self._batches:
            if isinstance(item, tuple):
                if item[0] == index:
                    found += item[1]
            elif not kinds or not item.kinds.isdisjoint(kinds):
                found += item.of(index, kinds) if isinstance(item, Rounds) else item.of(index)
        return found

    def motion(self, unit: str, until: Ns, axis: str = "") -> list[Span]:
        """The pulses of one axis of a unit up to `until`, in order and without gaps or overlaps."""
        spans: list[Span] = []
        current: MotionStarted | None = None

        def close(at: Ns, last: int) -> None:
            nonlocal current
            if current is not None:
                spans.append(Span(current.at, at, current.train, current.first, last, current.direction, current.shaft))
            current = None

        for entry in self.of(unit, *_MOTION):
            match entry:
                case MotionStarted() if entry.axis == axis:
                    close(entry.at, entry.first - 1)
                    current = entry
                case MotionCut() | MotionEnded() if entry.axis == axis:
                    close(entry.at, entry.last)
        if current is not None:
            close(until, current.train.steps_by(until))
        return spans


_MOTION = (MotionStarted, MotionCut, MotionEnded)
