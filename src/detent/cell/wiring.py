"""How the parts of a cell are joined: wires, lines, axes and who follows them; what a cell asks of its parts."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.controllers.device import DriveSet, Powered, StageSet


class Follower(Protocol):
    """A part that follows the axis of a unit: a switch at a position, a motor with its load."""

    def follow(self, motion: MotionStarted | MotionCut | MotionEnded) -> None:
        """The axis does this."""

    def heed(self, told: DriveSet | StageSet | Powered) -> None:
        """The power stage of the unit is commanded so, or its supply is switched."""


class SerialUnit(Protocol):
    """A unit as its host sees it: a controller, or an adapter in front of others."""

    def frame(self, text: str) -> bytes:
        """The bytes a host sends for a command line."""

    def answers(self, data: bytes) -> list[str]:
        """What a host reads in the bytes that came back."""


class Wiring(NamedTuple):
    """What is joined to what: never changed, but replaced. Parts are meant by their index in `Cell.parts`."""

    names: tuple[str, ...]  # of all parts
    units: int  # the first so many parts are units: recorded, powered, on lines
    drives: tuple[Mapping[str, int], ...]  # part -> pin -> net
    reads: tuple[tuple[tuple[int, str], ...], ...]  # net -> (part, pin)
    followers: tuple[tuple[int, ...], ...]  # part -> parts that follow its axis
    lines: tuple[tuple[tuple[int, str], ...], ...]  # line -> units on it, each with the port it hears on
    line_names: tuple[str, ...]
    line_of: tuple[int, ...]  # unit -> line of its host; -1: none
    speaks: tuple[Mapping[str, tuple[int, int]], ...]  # unit -> port it sends from -> line, place on the line
    remarks: tuple[str, ...] = ()  # what a real cell would not stand, in words

    def __deepcopy__(self, _: object) -> "Wiring":
        return self

    def unit(self, name: str) -> int:
        """The index of a unit. Raises KeyError."""
        try:
            return self.names.index(name, 0, self.units)
        except ValueError:
            raise KeyError(f"no unit {name!r} in this cell") from None

    def with_net(self) -> "Wiring":
        """With one more net, to which nothing is joined: the last."""
        return self._replace(reads=(*self.reads, ()))

    def led(self, part: int, pin: str, net: int) -> "Wiring":
        """With an output that drives a net driving another one."""
        drives = list(self.drives)
        drives[part] = {**drives[part], pin: net}
        return self._replace(drives=tuple(drives))

    def heard_by(self, net: int, pins: Sequence[tuple[int, str]]) -> "Wiring":
        """With these inputs, and no others, reading a net."""
        reads = list(self.reads)
        reads[net] = tuple(pins)
        return self._replace(reads=tuple(reads))
