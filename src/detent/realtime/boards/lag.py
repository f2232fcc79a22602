"""How much later than the lead the axes of a unit come: one time for all of them, so that they stay together.

It grows where a batch is late (a slip), for every axis of the unit alike, and its outputs come later with them, so that
order and distances stay as they are. It is 0 again behind a rest that is long enough, of all axes and of the outputs.
What a single axis needs beyond that, because a cell that was taken back gives its pulses too late, is its own affair
while others move: a hole in their pulses would cost them steps.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol

from detent.realtime.pace import WallNs
from detent.ticks import MS, NEVER, Ns

SETTLED: Ns = 20 * MS  # a rest longer than the lag by this takes it back to 0


class Late(NamedTuple):
    """By how much the next pulse of an axis is too near, and whether a late computer is to blame."""

    by: Ns
    slip: bool


class Axis(Protocol):
    """What a lag needs of an axis."""

    of: "Lag"
    dried: bool  # it waits until it is told anew what was late

    @property
    def told_through(self) -> Ns | None:
        """The cell time of the last pulse that was sent."""

    @property
    def resting(self) -> bool:
        """Whether no pulse is to come."""

    @property
    def under_way(self) -> bool:
        """Whether a motion goes on of which pulses were sent."""

    @property
    def lag(self) -> Ns:
        """That of its unit, and its own."""

    def next_pulse(self) -> Ns | None:
        """The cell time of its next pulse."""

    def late(self, now: Ns, wall: WallNs) -> Late | None:
        """By how much the next pulse that the cell has given up to `now` is too near."""

    def delayed(self, at: Ns, by: Ns, *, slip: bool, own: bool) -> None:
        """From cell time `at` on it comes later by so much more; `own`: it alone."""

    def grew(self, before: Ns) -> None:
        """Its lag was `before` for what it was sent."""

    def caught_up(self, now: Ns) -> None:
        """Its next pulse comes a lead behind the cell again."""


class Output(Protocol):
    """What a lag needs of an output."""

    def delayed(self, at: Ns, by: Ns, wall: WallNs) -> None:
        """What has yet to come, for cell time `at` or behind it, comes later by so much more."""

    def late(self, wall: WallNs, heard: WallNs | None) -> tuple[Ns, Ns] | None:
        """The cell time of its next change, and by how much it is late, if a late computer is to blame.

        None, too, where a stop that was not heard of yet (up to `heard`) may take it back.
        """


class Lag:
    """The lag of a unit, its `axes` on one board or several, and its `outputs`.

    `slips` and `slipped`: how often the computer was late, and by how much.
    """

    def __init__(self) -> None:
        self.axes: list[Axis] = []
        self.outputs: list[Output] = []
        self.now: Ns = 0
        self.slips = 0
        self.slipped: Ns = 0
        self._changed: Ns | None = None  # when an output changed last, by cell time

    @property
    def waits(self) -> bool:
        """Whether an axis ran dry, and has yet to be told what it did not make: the others go on with it."""
        return any(axis.dried for axis in self.axes)

    def has_yet_to_step(self, at: Ns) -> bool:
        """Whether a pulse for cell time `at` or before it has not left: it may be late, and so may what is due then."""
        return any((pulse := axis.next_pulse()) is not None and pulse <= at for axis in self.axes)

    def rested(self, first: Ns, now: Ns) -> None:
        """At cell time `now` an axis begins to move, its first pulse at `first`: all of them may have been at rest."""
        late = any(axis.lag for axis in self.axes)
        if late and self._still(self.axes) and all(self.settled(first, axis) for axis in self.axes):
            for axis in self.axes:
                axis.caught_up(now)
            self.now = 0

    def settled(self, first: Ns, axis: Axis) -> bool:
        """Whether what comes at cell time `first` may be in time again: axis and outputs rested for long enough."""
        last = max((at for at in (axis.told_through, self._changed) if at is not None), default=None)
        return last is None or first - last > axis.lag + SETTLED

    def changed(self, at: Ns) -> Ns:
        """An output of the unit changes at cell time `at`: by how much later than the lead it does."""
        self.rested(at, at)
        self._changed = at if self._changed is None else max(at, self._changed)
        return self._most

    def forget(self) -> None:
        """Nothing is under way that was later, as far as its axes are all at rest."""
        if self._still(self.axes):
            self.now = 0

    def grow(self, found: Sequence[tuple[Late, Axis]], wall: WallNs) -> None:
        """These axes are late."""
        before, lags = self._most, [(axis, axis.lag) for axis in self.axes]
        slip = max((late.by for late, _ in found if late.slip), default=0)
        if slip:
            latest = next(axis for late, axis in found if late.by == slip and late.slip)
            self._slip(slip)
            latest.delayed(self._next(), slip, slip=True, own=False)
        for late, axis in found:
            if late.by > slip:
                alone = not self._still(other for other in self.axes if other is not axis)
                if not alone:
                    self.now += late.by - slip
                axis.delayed(axis.next_pulse() or NEVER, late.by - slip, slip=False, own=alone)
        self._grew(lags)
        for out in self.outputs if self._most > before else ():
            out.delayed(self._next(), self._most - before, wall)

    def settle_outputs(self, wall: WallNs, heard: WallNs | None) -> None:
        """An output is late: what follows comes later, too, where no motion is under way that could not any more."""
        if self.waits:
            return
        late = [found for out in self.outputs if (found := out.late(wall, heard)) is not None]
        if not late:
            return
        at, by = min(at for at, _ in late), max(by for _, by in late)
        if all((axis.told_through or 0) <= at and not axis.under_way for axis in self.axes):
            lags = [(axis, axis.lag) for axis in self.axes]
            self._slip(by)
            self.axes[0].delayed(at, by, slip=True, own=False)
            self._grew(lags)
            for out in self.outputs:
                out.delayed(at, by, wall)

    @property
    def _most(self) -> Ns:
        """Of all axes: outputs come with the latest."""
        return max(axis.lag for axis in self.axes)

    def _next(self) -> Ns:
        return min(axis.next_pulse() or NEVER for axis in self.axes)

    @staticmethod
    def _grew(lags: Iterable[tuple[Axis, Ns]]) -> None:
        for axis, before in lags:
            if axis.lag > before:
                axis.grew(before)

    def _slip(self, by: Ns) -> None:
        self.now += by
        self.slips += 1
        self.slipped += by

    @staticmethod
    def _still(axes: Iterable[Axis]) -> bool:
        return all(axis.resting for axis in axes)


def settle(axes: Iterable[Axis], now: Ns, wall: WallNs) -> None:
    """Let lags grow as what the cell gave up to `now` needs it, before anything of it is sent, or armed for it."""
    found: dict[Lag, list[tuple[Late, Axis]]] = {}
    for axis in axes:
        late = None if axis.of.waits else axis.late(now, wall)
        if late is not None:
            found.setdefault(axis.of, []).append((late, axis))
    for lag, ones in found.items():
        lag.grow(ones, wall)
