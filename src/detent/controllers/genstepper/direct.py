"""E mode: pulses on the slew inputs make the motors step (manual, pages 25, 26, 46, 47).

Bits 0 and 1 of E choose between a step line for each direction and step with direction, bit 2 gives the currents
to the limit inputs, bits 4 to 7 invert the lines. A line is looked at often enough to see a level that lasts 8 us:
it counts when it has lasted so long, and shorter ones are missed.
"""

from collections.abc import Mapping
from typing import NamedTuple

from detent.controllers.genstepper.pins import AXES, SLEWS
from detent.pins import HIGH, LOW, Level
from detent.ticks import NEVER, US, Ns

STABLE: Ns = 8 * US
BLIND: Ns = 16 * US  # "up to 16 microseconds of missed TTL control edges"
STEP_AND_DIRECTION = 2
CURRENTS = 4


class Step(NamedTuple):
    """A step that the lines ask for."""

    axis: str
    direction: int


class Direct:
    """The step lines. `deadline` says when to call `advance`; without E mode it is `NEVER`."""

    __slots__ = ("_due", "_inputs", "_seen", "_sighted", "bits", "deadline")

    def __init__(self, inputs: Mapping[str, Level]) -> None:
        self._inputs = inputs
        self._due: dict[str, Ns] = {}  # when a line will have been at its new level for long enough
        self._seen: dict[str, bool] = {}  # whether each line was active when last looked at
        self._sighted: Ns = 0  # from then on edges are looked for again
        self.bits = 0
        self.deadline: Ns = NEVER

    @property
    def on(self) -> bool:
        """Whether E mode is on."""
        return self.bits != 0

    @property
    def currents(self) -> bool:
        """Whether the limit inputs control the currents."""
        return bool(self.bits & CURRENTS)

    def choose(self, bits: int) -> None:
        """E: 0 ends the mode; with the low bits 0 other bits mean a line for each direction."""
        bits &= 0xFF
        self.bits = bits | 1 if bits and not bits & 3 else bits
        self._due.clear()
        self._sighted = 0
        self._seen = {pin: self._active(pin) for pin in SLEWS}
        self.deadline = NEVER

    def changed(self, pin: str, now: Ns) -> None:
        """A line has taken another level."""
        if not self.on or pin not in self._seen:
            return
        if self._active(pin) == self._seen[pin]:
            self._due.pop(pin, None)  # too short: nobody looked
        elif pin not in self._due:
            self._due[pin] = max(now + STABLE, self._sighted)
        self._plan()

    def blind(self, now: Ns) -> None:
        """A command keeps the processor busy: lines are looked at again after it, short pulses are missed."""
        if self.on:
            self._sighted = now + BLIND
            self._due = {pin: max(due, self._sighted) for pin, due in self._due.items()}
            self._plan()

    def advance(self, at: Ns) -> list[Step]:
        """Look at the lines that are due; the steps they ask for."""
        fresh = [pin for pin, due in self._due.items() if due <= at]
        for pin in fresh:
            del self._due[pin]
            self._seen[pin] = not self._seen[pin]
        self._plan()
        asking = {pin for pin in fresh if self._seen[pin]}
        steps = []
        for axis in AXES:
            minus, plus = f"{axis}-" in asking, f"{axis}+" in asking
            if self.bits & STEP_AND_DIRECTION:
                if plus:
                    steps.append(Step(axis, -1 if self._active(f"{axis}-") else 1))
            elif minus != plus:  # both at once is illegal, and ignored
                steps.append(Step(axis, 1 if plus else -1))
        return steps

    def power(self, axis: str) -> int:
        """The current that the limit inputs choose, in halves (page 26)."""
        if self._inputs[f"L{axis}-"] == LOW:
            return 0
        return 2 if self._inputs[f"L{axis}+"] == HIGH else 1

    def _active(self, pin: str) -> bool:
        inverted = self.bits >> 4 + SLEWS.index(pin) & 1
        return self._inputs[pin] == (HIGH if inverted else LOW)

    def _plan(self) -> None:
        self.deadline = min(self._due.values(), default=NEVER)
