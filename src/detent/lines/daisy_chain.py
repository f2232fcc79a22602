"""A daisy chain: the host speaks to the first unit, each unit to the next, the last one to the host (pages 16, 23)."""

from detent.lines.line import Arrival, Line
from detent.ticks import Ns
from detent.uart import Format, Sent


class DaisyChain(Line):
    """A ring of a host and `places` units."""

    __slots__ = ("_between", "_places")

    def __init__(self, form: Format, places: int, *, timed: bool = True) -> None:
        self._places = places
        self._between: list[Arrival] = []  # on the way from one unit to the next
        super().__init__(form, timed=timed)

    def from_unit(self, place: int, sent: Sent) -> None:
        """The unit at `place` begins a character towards the next one."""
        if place == self._places - 1:
            super().from_unit(place, sent)
        else:
            self._between.append(Arrival(place + 1, sent))
            self._plan()

    def advance(self, now: Ns) -> list[Arrival]:
        """Deliver what is due: from the host to the first unit, from unit to unit, and to the host into `heard`."""
        due = [arrival for arrival in self._between if arrival.sent.done <= now]
        self._between = [arrival for arrival in self._between if arrival.sent.done > now]
        return [*(arrival._replace(place=0) for arrival in super().advance(now)), *due]

    def _plan(self) -> None:
        super()._plan()
        for arrival in self._between:
            self.deadline = min(self.deadline, arrival.sent.done)
