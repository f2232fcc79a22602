"""A step detector: tells on a wire whether the motor has made the last step (datasheet, "Closed loop operation").

It stands for the disk or the velocity coils with the logic of figure 19. Each step pulse takes its output low
until the motor has stepped, `response` later; wired to ENABLE it holds the next pulse for so long. A motor that
hesitates is one whose step number `slow_from` to `slow_to` takes `slow_response`.
"""

from collections.abc import Sequence

from detent.controllers.device import Output, Powered
from detent.pins import HIGH, LOW, Level, Pin, PinDriver, PinKind
from detent.ticks import NEVER, US, Ns
from detent.uart import Char

PINS = (
    Pin("CLOCK", None, PinKind.INPUT, "step pulses: a falling edge asks the motor for a step"),
    Pin("DONE", None, PinKind.OUTPUT, "1 while the motor has made every step it was asked for"),
)


class StepDetector:
    """Watches one motor that makes its steps one after the other."""

    pins: Sequence[Pin] = PINS

    def __init__(self, response: Ns = 200 * US, slow_from: int = 1, slow_to: int = 0, slow_response: Ns = 0) -> None:
        self.response, self.slow_response = response, slow_response
        self.slow_from, self.slow_to = slow_from, slow_to
        self.steps = 0  # asked for
        self._clock: Level = HIGH
        self._done_at: Ns = NEVER
        self._out: list[Output] = []
        self._driver = PinDriver(self._out)

    def power(self, on: bool, now: Ns) -> None:
        """Switch the supply."""
        self._out.append(Powered(now, on))
        self._done_at = NEVER
        if on:
            self._driver.set("DONE", HIGH, now)
        else:
            self._driver.release()

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> None:
        """It has no serial port."""

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """The step clock changes."""
        self.advance(now)
        falls = self._clock == HIGH and level == LOW
        self._clock = level
        if falls and self._driver.levels:
            self.steps += 1
            slow = self.slow_from <= self.steps <= self.slow_to
            self._done_at = now + (self.slow_response if slow else self.response)
            self._driver.set("DONE", LOW, now)

    def take_level(self, pin: str, level: Level, now: Ns) -> None:
        """The controller is switched on or off: it asks for no step."""
        self.advance(now)
        self._clock = level

    def stored(self, ok: bool, now: Ns) -> None:
        """It stores nothing."""

    def next_deadline(self) -> Ns | None:
        """When the motor will have stepped."""
        return None if self._done_at >= NEVER else self._done_at

    def advance(self, now: Ns) -> None:
        """The motor has stepped."""
        if self._done_at <= now:
            at, self._done_at = self._done_at, NEVER
            self._driver.set("DONE", HIGH, at)

    def drain(self) -> list[Output]:
        """What its output did."""
        out = self._out.copy()
        self._out.clear()
        return out

    def watch(self, pin: str) -> None:
        """It gives no step pulses of its own."""
