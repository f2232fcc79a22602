"""Which inputs stop an axis in the firmware, now and until the steps of what was before have left the pins.

What the cell does leaves a lead later. So an input that could stop a motion watches until the last step of that motion
is over, though the cell has gone on to the next; what stops that one is added meanwhile.
"""

from collections.abc import Mapping
from typing import NamedTuple

from detent.pins import Level
from detent.realtime.boards.stops import Stop
from detent.ticks import NEVER, Ns


class _Tail(NamedTuple):
    level: Level
    until: Ns  # cell time


class Guard:
    """The stop of one stepper. Inputs are named as on the board."""

    def __init__(self, stop: Stop) -> None:
        self._stop = stop
        self.wanted: dict[str, Level] = {}
        self._tails: dict[str, _Tail] = {}
        self.armed: dict[str, Level] = {}

    @property
    def next(self) -> Ns:
        """When an input is to be let go, by the time of the cell."""
        return min((tail.until for tail in self._tails.values()), default=NEVER)

    def want(self, inputs: Mapping[str, Level], at: Ns, behind: Ns) -> None:
        """From cell time `at` on these inputs cut the motion; what did before watches `behind` longer."""
        for name, level in self.wanted.items():
            if inputs.get(name) != level:
                self._tails[name] = _Tail(level, at + behind)
        self.wanted = dict(inputs)
        self.refresh(at, at)

    def refresh(self, now: Ns, at: Ns) -> None:
        """Arm what is to be armed at cell time `now`; what is new counts from `at` on."""
        self._tails = {name: tail for name, tail in self._tails.items() if tail.until > now and name not in self.wanted}
        wished = {name: tail.level for name, tail in self._tails.items()} | self.wanted
        if wished != self.armed:
            self.armed = wished
            if wished:
                self._stop.arm({name: bool(level) for name, level in wished.items()}, at)
            else:
                self._stop.disarm()

    def later(self, by: Ns) -> None:
        """Pulses come so much later: what watches their last ones watches longer."""
        self._tails = {name: tail._replace(until=tail.until + by) for name, tail in self._tails.items()}

    def fired(self) -> None:
        """The stop has fired: nothing is armed any more."""
        self.wanted, self._tails, self.armed = {}, {}, {}

    def release(self) -> None:
        """Nothing stops the axis any more: it is at fault, or what moved it is over."""
        if self.armed:
            self._stop.disarm()
        self.fired()
