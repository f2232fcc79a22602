"""What happened in a cell: an append-only log, shared by a cell and its copies up to where they part.

Entries are pairs (index of the unit in `units`, output or input). A copy of a cell keeps only the length of
the log; the first of several copies to go on writes into the shared list, the others then fork it.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

from detent.axis import MotionCut, MotionEnded, MotionStarted
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


class Recording:
    """The log of one cell and the names of its units."""

    __slots__ = ("_log", "_size", "units")

    def __init__(self, units: Sequence[str]) -> None:
        self.units = tuple(units)
        self._log: list[tuple[int, Entry]] = []
        self._size = 0

    def __len__(self) -> int:
        return self._size

    def __iter__(self) -> Iterator[tuple[int, Entry]]:
        """All entries, in the order in which they happened."""
        log = self._log
        return (log[i] for i in range(self._size))

    def extend(self, unit: int, entries: Sequence[Entry]) -> None:
        """Append what one unit did."""
        if len(self._log) != self._size:  # a copy has gone on from here already: part from it
            self._log = self._log[: self._size]
        self._log.extend([(unit, entry) for entry in entries])
        self._size = len(self._log)

    def copy(self) -> "Recording":
        """The same log up to here; whichever goes on second makes its own."""
        twin = Recording.__new__(Recording)
        twin.units, twin._log, twin._size = self.units, self._log, self._size
        return twin

    def __deepcopy__(self, _: object) -> "Recording":
        return self.copy()

    def of(self, unit: str) -> list[Entry]:
        """The entries of one unit, in order."""
        index = self.units.index(unit)
        return [entry for i, entry in self if i == index]

    def motion(self, unit: str, until: Ns) -> list[Span]:
        """The pulses of one unit up to `until`, in order and without gaps or overlaps."""
        spans: list[Span] = []
        current: MotionStarted | None = None

        def close(at: Ns, last: int) -> None:
            nonlocal current
            if current is not None:
                spans.append(Span(current.at, at, current.train, current.first, last, current.direction, current.shaft))
            current = None

        for entry in self.of(unit):
            match entry:
                case MotionStarted():
                    close(entry.at, entry.first - 1)
                    current = entry
                case MotionCut() | MotionEnded():
                    close(entry.at, entry.last)
        if current is not None:
            close(until, current.train.steps_by(until))
        return spans
