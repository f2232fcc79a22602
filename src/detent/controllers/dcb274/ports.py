"""Inputs as the firmware reads them, and what the outputs P4 and P5 show (pages 34 to 46).

An input is active when it is low. Flag 8 of `l` inverts every input but the limits, flag 1 the limits (page 8: "'l 9'
will invert all of the inputs", "'l 8' all but the limit switch inputs"). An output that is on pulls its pin to 0.
"""

from typing import Final

from detent.controllers.dcb274 import settings
from detent.controllers.dcb274.pins import DIRECTION_HOLD, INPUTS, STEP_LOW
from detent.controllers.dcb274.settings import Settings
from detent.pins import HIGH, LOW, Level, PinDriver
from detent.ticks import NEVER, Ns, instants

P4, P5 = 8, 16  # flags of A
READ_PORTS: Final = 129  # to A: do not set anything, print the ports
PORTS: Final = ((1, "P1"), (2, "P2"), (4, "P3"), (P4, "P4"), (P5, "P5"))  # weights in what A 129 and ] 0 print
SWITCHES: Final = ((128, "LIMIT-B"), (64, "LIMIT-A"), (32, "HOME"))  # the others of ] 0
JOGS: Final = ((128, "JOG-S"), (64, "JOG2"), (32, "JOG1"))  # those of ] 1


class Ports:
    """The pins of J1 and J4. `deadline` is when a step pulse ends, or the direction output changes."""

    INSTANTS = instants(_last_pulse=STEP_LOW + DIRECTION_HOLD, _rises=0, _turns=0)

    def __init__(self, driver: PinDriver, registers: Settings, p4_input: bool) -> None:
        self.levels: dict[str, Level] = dict.fromkeys(INPUTS, HIGH)
        self.latch = 0  # what A has set
        self.wired = False  # a wire leads from P4: every step pulse is an event
        self.steps_wired = False  # the same for STEPS
        self._settings, self._driver = registers, driver
        self._p4_input = p4_input  # by its jumpers
        self._direction = 1
        self._moving = False
        self._rises: Ns = NEVER
        self._turns: Ns = NEVER  # the direction output, held behind the last pulse
        self._last_pulse: Ns = -(1 << 60)

    def reset(self, now: Ns) -> None:
        """All outputs off (high)."""
        self.latch = 0
        self._moving = False
        self._rises = self._turns = NEVER
        self._driver.set("STEPS", HIGH, now)
        self.show(now)

    # -- inputs ------------------------------------------------------------------------------------------

    def active(self, pin: str) -> bool:
        """Whether an input is active: low, or high where its flag inverts it."""
        return self.reads(pin) == LOW

    def reads(self, pin: str) -> Level:
        """The level of an input as the firmware has it, inverted where an option says so; STEP and DIR as well."""
        flag = settings.INVERT_LIMITS if pin.startswith("LIMIT") else settings.PLC
        level = self.levels[pin]
        return (HIGH if level == LOW else LOW) if self._settings.flags & flag else level

    @property
    def stopped(self) -> bool:
        """Whether the soft stop input is active: then nothing sets off."""
        return self.active("SS")

    def limit(self, direction: int) -> bool:
        """Whether motion in `direction` is inhibited: A stops +, B stops -."""
        return self.active("LIMIT-A" if direction > 0 else "LIMIT-B")

    def port(self, number: int) -> bool:
        """Whether port 1 to 5 is active: an input by its level, an output if it is on."""
        if number <= 3:
            return self.active(f"P{number}")
        if number == 5:
            return bool(self.latch & P5)
        if self._settings.flags & settings.P4_INPUT:
            return self._p4_input and self.active("P4")
        return bool(self.latch & P4)

    def ports(self, last: int = 4) -> int:
        """Ports 1 to `last` with the weights 1, 2, 4, 8, 16."""
        return sum(1 << number - 1 for number in range(1, last + 1) if self.port(number))

    def switches(self) -> int:
        """What ``] 0`` prints: Lb La Hm and the five ports."""
        return self.ports(5) + sum(weight for weight, pin in SWITCHES if self.active(pin))

    def jogs(self) -> int:
        """What ``] 1`` prints: the three jog inputs."""
        return sum(weight for weight, pin in JOGS if self.active(pin))

    # -- outputs -----------------------------------------------------------------------------------------

    def write(self, flags: int, now: Ns) -> None:
        """A and k: the outputs that `flags` names are on, the others off."""
        self.latch = flags & (P4 | P5)
        self.show(now)

    def moving(self, is_moving: bool, direction: int, now: Ns) -> None:
        """The axis starts in a direction, or has stopped."""
        self._moving = is_moving
        if is_moving:
            self.turn(direction, now)
        self.show(now)

    def turn(self, direction: int, now: Ns) -> None:
        """The steps that follow are in this direction, whoever asks for them."""
        if direction != self._direction:
            self._direction = direction
            if self._settings.flags & settings.STEP_OUT:
                # the slave needs its direction for 10 us behind the rising edge (page 10)
                held = self._last_pulse + STEP_LOW + DIRECTION_HOLD
                self._turns = held if held > now else NEVER
            self.show(now)

    def pulse(self, now: Ns) -> None:
        """A step is made, and somebody listens."""
        self._last_pulse = now
        self._rises = now + STEP_LOW
        self._driver.set("STEPS", LOW, now)
        if self._settings.flags & settings.STEP_OUT and not self._p4_input:
            self._driver.set("P4", LOW, now)

    @property
    def pulses_are_wired(self) -> bool:
        """Whether every step must be an event of its own."""
        return self.steps_wired or (self.wired and bool(self._settings.flags & settings.STEP_OUT))

    @property
    def deadline(self) -> Ns:
        """When an output changes by itself."""
        return self._rises if self._rises < self._turns else self._turns

    def advance(self, at: Ns) -> None:
        """The step pulse ends, the direction turns."""
        if self._rises <= at:
            self._rises = NEVER
            self._driver.set("STEPS", HIGH, at)
        if self._turns <= at:
            self._turns = NEVER
        self.show(at)

    def show(self, now: Ns) -> None:
        """Bring P4 and P5 up to what options and state make of them."""
        flags = self._settings.flags
        step_out = bool(flags & settings.STEP_OUT)
        if not self._p4_input and self._rises >= NEVER:
            self._driver.set("P4", LOW if self.latch & P4 and not step_out else HIGH, now)
        if step_out:
            if self._turns >= NEVER:
                self._driver.set("P5", HIGH if self._direction > 0 else LOW, now)
        elif flags & settings.MOVING_OUT:
            self._driver.set("P5", LOW if self._moving else HIGH, now)
        else:
            self._driver.set("P5", LOW if self.latch & P5 else HIGH, now)
