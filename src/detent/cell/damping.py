"""Phase reversal: the bang-bang damper of the GS-C200 datasheet ("Electronic damping", figures 22 and 23).

It sits between the controller's step clock and the drive and passes the pulses on. The last pulse of a motion is
known by MOV and RAMP, both low; `brake` later the motor is stepped back once, which slows the rotor that is swinging
through, and `release` after the last pulse forward again, at the moment at which the rotor stands where it should.
"""

from collections.abc import Sequence

from detent.controllers.device import Output, Powered
from detent.pins import HIGH, LOW, Level, Pin, PinDriver, PinKind
from detent.ticks import MS, US, Ns, instants
from detent.uart import Char

PULSE: Ns = 2 * US
SETUP: Ns = 1 * US  # from the direction to the pulse

PINS = (
    Pin("CLOCK", None, PinKind.INPUT, "step pulses of the controller, falling edge"),
    Pin("DIR", None, PinKind.INPUT, "direction of the controller"),
    Pin("MOV", None, PinKind.INPUT, "1 while the controller moves"),
    Pin("RAMP", None, PinKind.INPUT, "1 while it ramps"),
    Pin("STEP", None, PinKind.OUTPUT, "step pulses for the drive, falling edge"),
    Pin("TURN", None, PinKind.OUTPUT, "direction for the drive"),
)


class PhaseReversal:
    """Steps the motor back and forward once, a set time after the last pulse of each motion."""

    INSTANTS = instants()  # none while it rests
    pins: Sequence[Pin] = PINS

    def __init__(self, brake: Ns = 2 * MS, release: Ns = 3 * MS) -> None:
        if not 4 * PULSE <= brake <= release - 4 * PULSE:
            raise ValueError("the motor is braked, and later released: brake is at least 8 us, release 8 us more")
        self.brake, self.release = brake, release
        self._inputs: dict[str, Level] = {pin.name: HIGH for pin in PINS if pin.kind is PinKind.INPUT}
        self._plan: list[tuple[Ns, str, Level]] = []  # what is still to be done, in order of time
        self._on = False
        self._out: list[Output] = []
        self._driver = PinDriver(self._out)

    def power(self, on: bool, now: Ns) -> None:
        """Switch the supply."""
        self._out.append(Powered(now, on))
        self._plan, self._on = [], on
        if on:
            self._driver.set("STEP", HIGH, now)
            self._driver.set("TURN", self._inputs["DIR"], now)
        else:
            self._driver.release()

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> None:
        """It has no serial port."""

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """The controller moves."""
        self.advance(now)
        before = self._moving
        changed = self._inputs[pin] != level
        self._inputs[pin] = level
        if not (self._on and changed):
            return
        if pin == "DIR" and not self._plan:
            self._driver.set("TURN", level, now)
        elif pin == "CLOCK":
            if self._plan and level == LOW:
                self._finish(now)
            self._driver.set("STEP", level, now)
        elif before and not self._moving:
            back, forth = 1 - self._inputs["DIR"], self._inputs["DIR"]
            self._plan = [
                (now + delay + late, name, value)
                for delay, way in ((self.brake, back), (self.release, forth))
                for late, name, value in ((-SETUP, "TURN", way), (0, "STEP", LOW), (PULSE, "STEP", HIGH))
            ]

    def take_level(self, pin: str, level: Level, now: Ns) -> None:
        """The controller is switched on or off: no motion begins or ends, and no step is made."""
        self.advance(now)
        self._inputs[pin] = level
        if pin == "DIR" and self._on and not self._plan:
            self._driver.set("TURN", level, now)

    def stored(self, ok: bool, now: Ns) -> None:
        """It stores nothing."""

    def next_deadline(self) -> Ns | None:
        """When it steps back or forward."""
        return self._plan[0][0] if self._plan else None

    def advance(self, now: Ns) -> None:
        """Do what is due."""
        while self._plan and self._plan[0][0] <= now:
            at, pin, level = self._plan.pop(0)
            self._driver.set(pin, level, at)

    def drain(self) -> list[Output]:
        """What its outputs did."""
        out = self._out.copy()
        self._out.clear()
        return out

    def watch(self, pin: str) -> None:
        """It gives no step pulses of its own accord."""

    @property
    def _moving(self) -> bool:
        return HIGH in (self._inputs["MOV"], self._inputs["RAMP"])

    def _finish(self, now: Ns) -> None:
        """The next motion begins already: whatever is left of the damping happens now."""
        for _, pin, level in self._plan:
            self._driver.set(pin, level, now)
        self._plan = []
        self._driver.set("TURN", self._inputs["DIR"], now)
