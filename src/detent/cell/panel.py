"""What the panels of a cell's units show: levels of pins, the instruction, the latched error; from the recording.

It is a fold over the recording, so that a copy of it belongs to a copy of the cell. The past of a cell (`cell.history`)
and a cell that is only watched (`realtime.watch`) show the same.
"""

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from typing import Self

from detent.axis import Displaced, MotionCut, MotionEnded, MotionStarted
from detent.cell.cell import Cell
from detent.cell.recording import Batch, Entry, InputSet
from detent.controllers.device import Cautioned, Device, Executing, Finished, Powered, Refused, StoreImage
from detent.pins import Level, PinSet
from detent.ticks import Ns


class Travel:
    """An axis by its motions: where the pulses have commanded it, and how fast they come."""

    __slots__ = ("motion", "shaft")

    def __init__(self, shaft: int) -> None:
        self.shaft = shaft  # at rest, or where the motion under way began
        self.motion: MotionStarted | None = None

    def at(self, now: Ns) -> tuple[int, float]:
        """The shaft in steps and the rate in steps/s, with the sign of the direction."""
        motion = self.motion
        if motion is None:
            return self.shaft, 0.0
        state = motion.train.state_at(now)
        given = max(state.steps, motion.first - 1)
        return motion.shaft + motion.direction * given, motion.direction * float(state.rate)

    def end(self, last: int) -> None:
        """The motion under way has given its pulse `last`, and no more."""
        if self.motion is not None:
            self.shaft = self.motion.shaft + self.motion.direction * last
            self.motion = None


class Front:
    """The panel of one unit. `levels` are those of inputs, straps and outputs; None for an output that is let go.

    An output of which nobody is told (a winding without a wire) is None too. `refused` is cleared by the supply.
    """

    __slots__ = ("_let_go", "executing", "levels", "powered", "refused", "stored", "travels")

    def __init__(self, device: Device, shaft: int) -> None:
        axes: Sequence[str] = getattr(device, "axes", ())
        self.powered = not axes  # a part that moves nothing tells nothing of its supply
        self._let_go: Mapping[str, None] = dict.fromkeys(pin.name for pin in device.pins if pin.kind.drives)
        resting = {pin.name: pin.rest for pin in device.pins if pin.kind.reads}
        straps: Mapping[str, Level] = getattr(device, "straps", {})
        self.levels: dict[str, Level | None] = {**resting, **straps, **self._let_go}
        self.travels = {axis: Travel(shaft) for axis in axes}
        self.executing: Executing | None = None
        self.refused: Refused | None = None
        self.stored = 0

    def copy(self) -> "Front":
        """The same, and on its own from now on."""
        twin = copy(self)
        twin.levels = dict(self.levels)
        twin.travels = {axis: copy(travel) for axis, travel in self.travels.items()}
        return twin

    def take(self, entry: Entry) -> bool:
        """Show one entry. True if somebody may want to stop at it: instruction, refusal, caution, supply or write."""
        match entry:
            case PinSet(_, pin, level) | InputSet(_, pin, level):
                self.levels[pin] = level
            case MotionStarted():
                self.travels[entry.axis].motion = entry
            case MotionCut() | MotionEnded():
                self.travels[entry.axis].end(entry.last)
            case Displaced(_, shaft, axis):
                self.travels[axis].shaft = shaft
            case Executing():
                self.executing = entry
                return True
            case Finished():
                self.executing = None
            case Refused():
                self.refused = entry
                return True
            case Cautioned():
                return True
            case StoreImage():
                self.stored += 1
                return True
            case Powered():
                self.powered = entry.on
                if not entry.on:  # when it is switched on, it tells each of them
                    self.levels |= self._let_go
                self.executing = self.refused = None
                return True
        return False


class Panel:
    """The panels of all units, by their number."""

    __slots__ = ("fronts",)

    def __init__(self, cell: Cell, shafts: Mapping[str, int]) -> None:
        """As they are before anything is recorded; `shafts` are the places where axes stood then, if not at 0."""
        units = zip(cell.wiring.names[: cell.wiring.units], cell.parts, strict=False)
        self.fronts = [Front(part, shafts.get(name, 0)) for name, part in units]

    def copy(self) -> Self:
        """The same, and on its own from now on."""
        twin = copy(self)
        twin.fronts = [front.copy() for front in self.fronts]
        return twin

    def take(self, batches: Iterable[Batch]) -> list[tuple[int, Entry]]:
        """Show what the units did. Returned are the entries at which somebody may want to stop."""
        fronts = self.fronts
        return [(unit, entry) for unit, entries in batches for entry in entries if fronts[unit].take(entry)]
