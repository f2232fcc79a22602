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
    at: Ns  # cell time of the last pulse that it watches, at the latest


class Guard:
    """The stop of one stepper. Inputs are named as on the board."""

    def __init__(self, stop: Stop) -> None:
        self._stop = stop
        self.wanted: dict[str, Level] = {}
        self._tails: dict[str, _Tail] = {}
        self.armed: dict[str, Level] = {}
        self._over: Ns = -1  # until when something was armed, before

    @property
    def next(self) -> Ns:
        """The cell time up to which pulses must have left the pins before an input is let go."""
        return min((tail.at for tail in self._tails.values()), default=NEVER)

    def watched(self, at: Ns) -> bool:
        """Whether some input watched the axis at cell time `at`, or later."""
        return bool(self.armed) or self._over >= at

    def want(self, inputs: Mapping[str, Level], at: Ns, now: Ns) -> None:
        """From cell time `at` on these inputs cut the motion; what did before watches the pulses given up to `now`."""
        for name, level in self.wanted.items():
            if inputs.get(name) != level:
                self._tails[name] = _Tail(level, now)
        self.wanted = dict(inputs)
        self._arm(at)

    def refresh(self, left: Ns, at: Ns) -> None:
        """Every pulse up to cell time `left` has left the pins: let go what watched those alone."""
        self._tails = {name: tail for name, tail in self._tails.items() if tail.at >= left}
        self._arm(at)

    def _arm(self, at: Ns) -> None:
        tails = {name: tail.level for name, tail in self._tails.items() if name not in self.wanted}
        wished = tails | self.wanted
        if wished != self.armed:
            self.armed = wished
            if wished:
                self._stop.arm({name: bool(level) for name, level in wished.items()}, at)
            else:
                self._over = at
                self._stop.disarm()

    def fired(self) -> None:
        """The stop has fired: nothing is armed any more, and what was asked for since then was of before."""
        self._stop.anew()
        self.wanted, self._tails, self.armed = {}, {}, {}

    def release(self) -> None:
        """Nothing stops the axis any more: it is at fault, or what moved it is over."""
        if self.armed:
            self._stop.disarm()
        self.wanted, self._tails, self.armed = {}, {}, {}
