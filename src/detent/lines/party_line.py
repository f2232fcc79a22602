"""A party line behind an adapter: the host of the line is a unit of the cell (manual of the DCB-274, page 17).

Two pairs of wires: every axis hears what the adapter sends, the adapter hears every axis. The axes' outputs share
their pair, on which a 0 wins, as on any `Line`. A party line without an adapter in the cell is a plain `Line`.
"""

from detent.lines.line import Arrival, Line
from detent.ticks import Ns
from detent.uart import Chars, Format, Sent


class PartyLine(Line):
    """A line with `places` units and, at the place behind them, the unit that is its host."""

    __slots__ = ("_places",)

    hosted: bool = True

    def __init__(self, form: Format, places: int, *, timed: bool = True) -> None:
        super().__init__(form, timed=timed)
        self._places = places

    def send(self, data: Chars, now: Ns) -> None:
        """Nobody outside is the host of this line."""
        raise ValueError("the host of this line is a unit of the cell: send to that unit")

    def from_unit(self, place: int, sent: Sent) -> None:
        """The unit at `place` on the line, or its host, begins a character."""
        if place == self._places:
            self._on_wire.append(sent)
            self._plan()
        elif sent.at == sent.done:
            self._from_units.append(sent)
            self._plan()
        else:
            super().from_unit(place, sent)

    def advance(self, now: Ns) -> list[Arrival]:
        """Deliver what is due: from the host to every unit, from the units to the host."""
        due = [sent for sent in self._from_units if sent.done <= now]
        from_host = super().advance(now)
        self.heard.clear()
        return [
            *(arrival._replace(place=place) for arrival in from_host for place in range(self._places)),
            *(Arrival(self._places, sent) for sent in due),
        ]
