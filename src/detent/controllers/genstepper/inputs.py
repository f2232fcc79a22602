"""Limit switches, slew keys and the rate key: the TTL inputs outside E mode (manual, pages 19 to 21, 34)."""

from collections.abc import Mapping
from enum import Enum

from detent.controllers.device import Stop
from detent.controllers.genstepper.pins import LIMITS
from detent.pins import HIGH, LOW, Level

RESET_LATCH = 16
STANDARD_RATES = (16, 40, 80, 160, 400, 800, 1600, 4000, 8000)  # page 21; NXT steps through them
FIRST_RATE = 5  # its place after a reset, which is 800


class Limits:
    """The limit inputs, what T makes of them, and what L reports."""

    __slots__ = ("_inputs", "_mask", "_off", "hard", "latches")

    def __init__(self, inputs: Mapping[str, Level], hard: bool) -> None:
        self._inputs = inputs  # the levels of all inputs
        self.hard = hard  # they stop at once (order option)
        self.reset()

    def reset(self) -> None:
        """All four enabled, active when low; the reset itself is latched."""
        self._mask = 0
        self._off = False
        self.latches = RESET_LATCH

    def choose(self, mask: int) -> None:
        """T: bits 0-3 block, bits 4-7 make a limit active when high."""
        self._mask = mask & 0xFF

    def switch(self, off: bool) -> None:
        """In E mode the inputs may have another meaning, or none."""
        self._off = off

    def meets(self, axis: str, direction: int) -> bool:
        """Whether a step action of `axis` in `direction` runs into its limit, which is latched then."""
        if not self.closed(axis, direction):
            return False
        self.latches |= 1 << LIMITS.index(_pin(axis, direction))
        return True

    def closed(self, axis: str, direction: int) -> bool:
        """Whether the limit of `axis` in `direction` is active; nothing is latched."""
        stop = self.ahead(axis, direction)
        return stop is not None and self._inputs[stop.pin] == stop.level

    def ahead(self, axis: str, direction: int) -> Stop | None:
        """The limit of `axis` in `direction`, at the level that makes it active; None where it counts for nothing."""
        pin = _pin(axis, direction)
        place = LIMITS.index(pin)
        if self._off or self._mask >> place & 1:
            return None
        return Stop(pin, HIGH if self._mask >> place + 4 & 1 else LOW)

    def report(self) -> int:
        """L: what was latched; it is forgotten then."""
        latched, self.latches = self.latches, 0
        return latched


def _pin(axis: str, direction: int) -> str:
    return f"L{axis}{'+' if direction > 0 else '-'}"


class Keys(Enum):
    """What the slew keys of an axis ask for, as long as they are held (pages 21, 60); the values are directions."""

    NONE = None
    BOTH = 0  # "are treated as stop to avoid confusion"
    PLUS = 1
    MINUS = -1

    @property
    def held(self) -> bool:
        """Whether there is one at ground level."""
        return self is not Keys.NONE


def keys(inputs: Mapping[str, Level], axis: str) -> Keys:
    """The slew keys of an axis."""
    plus, minus = inputs[f"{axis}+"] == LOW, inputs[f"{axis}-"] == LOW
    return Keys(plus - minus) if plus or minus else Keys.NONE
