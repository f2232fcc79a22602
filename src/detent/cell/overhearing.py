"""Units of one line that are left alone while it carries what is for others.

On a line of several units each hears every character, and all but one of them do nothing with it. A unit says so
itself (`controllers.device.Named`): it is turned away until a line begins with its name. From there on nothing is
told it, but for the characters that act at once; that lines have ended it learns when it is next called. Whatever else
is done to it, it is called back first thing behind that.
"""

from bisect import insort
from collections.abc import Sequence
from typing import TypeAlias

from detent.controllers.device import Device, Named, NamedLines
from detent.uart import Char

Place: TypeAlias = tuple[int, str]
"""A unit on the line, and the port that it hears on."""


class Overhearing:
    """Who of the units of a line is turned away; who is `near` hears its next character."""

    __slots__ = ("_ended", "_lines", "_named", "away", "near")

    def __init__(self, lines: NamedLines, places: Sequence[Place]) -> None:
        self._lines = lines
        self.near = list(places)
        self.away: dict[int, tuple[int, Place]] = {}  # unit -> the name that it waits for, and its place
        self._named: dict[int, list[int]] = {}  # name -> units
        self._ended = False  # a line has ended, and none has begun: those who are away do not know it yet

    def calls(self, chars: Sequence[Char], parts: Sequence[Device]) -> Sequence[Place]:
        """The units that have to hear `chars`, which reach all of them."""
        if self.away:
            value, parity_ok, framing_ok = chars[0]
            if len(chars) > 1 or not parity_ok or not framing_ok or value in self._lines.at_once:
                self.call_all(parts)
            elif value == self._lines.end:
                self._ended = True
            elif self._ended:
                for unit in tuple(self._named.get(value, ())):
                    self.call(unit, parts)
                self._ended = False
        return self.near

    def turn_away(self, skipped: Sequence[Place], parts: Sequence[Device]) -> None:
        """Those of `skipped` go who wait for their names: they were near, and just skipped a character."""
        for place in skipped:
            unit = place[0]
            name = _named(parts[unit]).turned_away
            if name is not None:
                self.away[unit] = name, place
                self._named.setdefault(name, []).append(unit)
        self.near = [place for place in self.near if place[0] not in self.away]

    def call(self, unit: int, parts: Sequence[Device]) -> None:
        """A unit that is away hears again what is said."""
        name, place = self.away.pop(unit)
        self._named[name].remove(unit)
        insort(self.near, place)
        if self._ended:
            _named(parts[unit]).line_ended()

    def call_all(self, parts: Sequence[Device]) -> None:
        """All hear again what is said."""
        for unit in tuple(self.away):
            self.call(unit, parts)
        self._ended = False


def overhearing(parts: Sequence[Device], places: Sequence[Place]) -> Overhearing | None:
    """For the units of a line, where there are several and lines are named alike for all of them."""
    kinds = {getattr(parts[unit], "NAMED_LINES", None) for unit, _ in places}
    lines = kinds.pop() if len(kinds) == 1 else None
    return Overhearing(lines, places) if isinstance(lines, NamedLines) and len(places) > 1 else None


def _named(part: Device) -> Named:
    return part  # type: ignore[return-value]  # whoever is here has `NAMED_LINES`
