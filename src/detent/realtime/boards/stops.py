"""Stops in the firmware: an input that takes a level stops a stepper at once, without the host.

Each stepper has one stop (a trigger of the firmware) with as many inputs as are armed. Level-sensitive: an input that
is at its level already when the stop comes into force stops at once, so that arming has no race.
"""

from collections.abc import Mapping

from detent.ticks import Ns


class Stop:
    """The stop of one stepper; found as `board.stops[stepper name]`. What it does comes as a `Stopped` event."""

    stepper: str

    @property
    def armed(self) -> Mapping[str, bool]:
        """The inputs that stop the stepper at present, and the (logical) level at which they do; empty: disarmed."""
        raise NotImplementedError

    def arm(self, inputs: Mapping[str, bool], at: Ns) -> None:
        """From cell time `at` on, `inputs` stop the stepper when they take their level; replaces what was armed.

        No pulse leaves before the stop is in force: where `at` + lead is too near, the pulses are made later. KeyError
        for an input that is not on the same board; no inputs: disarm.
        """
        raise NotImplementedError

    def disarm(self) -> None:
        """Nothing stops the stepper any more. A trigger that is on its way already still comes as an event."""
        raise NotImplementedError
