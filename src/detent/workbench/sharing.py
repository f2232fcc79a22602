"""What a cell says again and again is kept once: names of pins, instructions, and the shapes of moves.

What comes over the pipe is new each time, and the finer time is told, the less of it two messages share: at the pace of
real time each would have its own copy of every move.
"""

from collections.abc import Sequence
from sys import intern
from typing import Final

from detent.axis import MotionStarted
from detent.cell.recording import Entry
from detent.pulses import Train
from detent.pulses.laws import AnySegment

MOST_SHAPES: Final = 256  # that are known at a time
COARSE: Final = 2_000  # batches of a message, in which names are shared already


class Sharing:
    """Makes what is equal the same."""

    def __init__(self) -> None:
        self._trains: dict[tuple[AnySegment, ...], Train] = {}  # of these segments, the longest unused first

    def same(self, entries: Sequence[Entry], batches: int) -> tuple[Entry, ...]:
        """These entries, one batch of so many in a message."""
        if batches < COARSE:
            return tuple([self._moved(_named(entry)) for entry in entries])
        return tuple([self._moved(entry) for entry in entries])

    def _moved(self, entry: Entry) -> Entry:
        if type(entry) is not MotionStarted:
            return entry
        train, trains = entry.train, self._trains
        known = trains.pop(train.segments, train)
        trains[known.segments] = known
        if len(trains) > MOST_SHAPES:
            del trains[next(iter(trains))]
        return entry if known is train else entry._replace(train=known.at(train.start))


def _named(entry: Entry) -> Entry:
    return type(entry)._make([intern(one) if type(one) is str else one for one in entry])
