"""The board: its supply, resets and inputs, its two motors, and what their windings get.

`firmware` obeys the serial commands on it. What moves on its own is told by `_settle`, after every event.
"""

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any

from detent.axis import Axis
from detent.controllers.device import DriveSet, Refused, Status, Stop
from detent.controllers.genstepper import link, pins, reports
from detent.controllers.genstepper.direct import Direct
from detent.controllers.genstepper.inputs import FIRST_RATE, STANDARD_RATES, Keys, Limits, keys
from detent.controllers.genstepper.motor import Motor
from detent.controllers.genstepper.pins import AXES, Order
from detent.controllers.genstepper.prompter import Prompter
from detent.controllers.genstepper.supply import WINDING_CURRENT
from detent.controllers.genstepper.windings import CYCLE, Duties
from detent.controllers.genstepper.windings import drive as winding_drive
from detent.controllers.powered import PoweredDevice
from detent.pins import HIGH, LOW, Level, Pin, PinKind, PulseOutput
from detent.ticks import MS, NEVER, Ns
from detent.uart import Format, SerialPort

DEAF: Ns = 250 * MS  # after a reset ("wait about 1/4 second", page 22)


class Phase(Enum):
    """What the board as a whole is doing."""

    OFF = "off"  # without supply
    HELD = "held"  # RST, or the logic supply, is low
    STARTING = "starting"  # deaf
    READY = "ready"


class Board(PoweredDevice):
    """A board without its commands: all of its state, and what moves it from outside but characters.

    Straps that are not named are open, JS installed; `order` are fields of `pins.Order`.
    """

    def __init__(
        self, model: str, straps: Mapping[str, Level] | None = None, *, line_timing: bool = True, shaft: int = 0,
        **order: Any,
    ) -> None:  # fmt: skip
        super().__init__({**pins.DEFAULT_STRAPS[model], **(straps or {})}, line_timing=line_timing)
        self.model = model
        self._order = Order(**order)
        self._inputs: dict[str, Level] = {pin.name: pin.rest for pin in self.pins if pin.kind is PinKind.INPUT}
        self._limits = Limits(self._inputs, self._order.hard_stop)
        self._motors = {axis: Motor(Axis(self._out, shaft, axis), self._limits) for axis in AXES}
        self._direct = Direct(self._inputs)
        self._wired: tuple[str, ...] = ()  # connectors with a wire to another device
        self._phase = Phase.OFF
        self._clear(0, self._order.step_size)

    def _clear(self, now: Ns, step_size: int) -> None:
        """Everything as it is after a reset."""
        order = self._order
        self._value = link.Value()
        self._prompter = Prompter(pins.SERIAL_PORT.sends, self.line_format, self._out, timed=self._line_timing)
        self._selected: tuple[str, ...] = AXES
        self._waiting: tuple[str, ...] = ()  # motors that an I waits for
        self._verbose = link.CRLF_FIRST
        self._limits.reset()
        self._direct.choose(0)
        for motor in self._motors.values():
            motor.reset(now, keep=order.stop_rate, slope=order.ramp, rate=order.run_rate,
                        idle_windings=order.idle_windings)  # fmt: skip
        half_installed = pins.half_installed(self._straps) and not order.dual_baud
        self._half = bool(order.low_power if half_installed else order.high_power)
        self._double = order.double_current or self._straps["R1K"] == LOW
        self._auto = high_byte(order.auto_rate)
        self._step_size = step_size
        self._rate_place = FIRST_RATE
        self._keys = dict.fromkeys(AXES, Keys.NONE)  # as they were when last looked at
        self._unheeded: tuple[str, ...] = ()  # motors that were halted under a held key
        self._rests_until: dict[str, Ns] = dict.fromkeys(AXES, now)  # the tick after it came to rest; NEVER in motion
        self._again: Ns = NEVER  # when held keys are to be looked at again
        self._lost = ""  # what came while the board was deaf
        self._drives: dict[str, DriveSet] = {}  # what was last told of each connector
        self._wakes: Ns = NEVER

    # -- the contract ------------------------------------------------------------------------------------

    def _switch_on(self, now: Ns) -> None:
        for pin in self.pins:
            if pin.kind is PinKind.OUTPUT:
                self._driver.set(pin.name, pin.rest, now)
        self._reset(self._order.step_size, now)
        self._settle(now)

    def _switch_off(self, now: Ns) -> None:
        self._phase = Phase.OFF
        self._clear(now, self._order.step_size)

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """An input takes a level; SI low is the start bit of a character. Jumpers count at the next reset."""
        self.advance(now)
        if pin == pins.SERIAL_PORT.receives:
            if level == LOW:
                self._cancel()
            return
        if pin in self._straps:
            self._straps[pin] = level
            return
        before, self._inputs[pin] = self._inputs[pin], level
        if self._phase is Phase.OFF or before == level:
            return
        if pin in ("RST", "VC"):
            self._reset(self._order.step_size, now)
        elif self._phase is Phase.READY:
            self._input_changed(pin, level, now)
        self._settle(now)
        self.advance(now)

    def take_level(self, pin: str, level: Level, now: Ns) -> None:
        """An input takes a level without an edge: NXT and a step request are none then."""
        if pin == "NXT" or (self._direct.on and pin in pins.SLEWS):
            self.advance(now)
            self._inputs[pin] = level
        else:
            self.set_pin(pin, level, now)

    def stored(self, ok: bool, now: Ns) -> None:
        """It stores nothing."""

    def _do_due(self, at: Ns) -> None:
        for motor in self._motors.values():
            if motor.deadline <= at:
                motor.advance(at)
        if self._direct.deadline <= at:
            self._steps(at)
        if self._wakes <= at:
            self._wake(at)
        self._settle(at)
        if self._prompter.deadline <= at:
            self._prompter.advance(at)

    def watch(self, pin: str) -> None:
        """A wire leads from a winding: give its level at every step."""
        connector = pin[:1]
        if pin[1:] in pins.WINDINGS and connector not in self._wired:
            self._wired = (*self._wired, connector)
            self._motors[connector].wired()
            if self._double:
                self._motors[AXES[0]].wired()

    # -- the controller as seen from outside -------------------------------------------------------------

    @property
    def pins(self) -> Sequence[Pin]:
        """The connectors and jumpers."""
        return pins.PINS[self.model]

    @property
    def pulse_output(self) -> PulseOutput:
        """None: the motors hang on the board itself."""
        return pins.NO_STEP_CLOCK

    @property
    def serial_port(self) -> SerialPort:
        """SI and SO, whichever way they lead to the host."""
        return pins.SERIAL_PORT

    @property
    def most_current(self) -> float:
        """Amperes that a winding may draw at the whole supply, by page 7: its pulses halve that at half power."""
        return WINDING_CURRENT * (2 if self._double else 1) * (2 if self._half else 1)

    @property
    def axes(self) -> Sequence[str]:
        """X and Y."""
        return AXES

    @property
    def line_format(self) -> Format:
        """8N1 at the ordered rate."""
        return pins.character_format(self._order, self._straps)

    def status(self, now: Ns, axis: str = "") -> Status:
        """The location of an axis, its steps, and one word: off held starting direct running ready."""
        motor = self._motors[axis or AXES[0]]
        state = self._phase.value
        if self._phase is Phase.READY:
            state = "direct" if self._direct.on else "ready" if motor.idle else "running"
        return Status(motor.position(now), motor.pulses(now), state)

    def cuts(self, now: Ns, axis: str = "") -> Sequence[Stop]:
        """The resets; a hard limit ahead; and whatever asks for a stop while the motor needs no ramp for it."""
        axis = axis or AXES[0]
        motor, inputs = self._motors[axis], self._inputs
        if self._phase is Phase.OFF or not motor.stepping:
            return ()
        found = [Stop(pin, LOW) for pin in ("RST", "VC") if inputs[pin] == HIGH]
        if self._phase is not Phase.READY:
            return found
        limit = self._limits.ahead(axis, motor.direction)
        if limit is not None and inputs[limit.pin] != limit.level and motor.cut_by_limit(now):
            found.append(limit)
        if not self._direct.on and self._order.slew_inputs and motor.stops_at_once(now):
            for pin in (f"{axis}-", f"{axis}+"):
                asked = keys({**inputs, pin: inputs[pin] ^ 1}, axis)
                if asked is not self._keys[axis] and asked.value != motor.direction:
                    found.append(Stop(pin, inputs[pin] ^ 1))
        return found

    def switches(self, axis: str = "") -> Sequence[str]:
        """Both limits of the axis."""
        axis = axis or AXES[0]
        return (f"L{axis}-", f"L{axis}+")

    def step_inputs(self) -> Sequence[str]:
        """The slew inputs in E mode; without supply, those of a board that begins with it."""
        return pins.SLEWS if self._direct.on or (self._order.e_mode and self._phase is not Phase.READY) else ()

    def halt(self, now: Ns) -> None:
        """Both motors stop at once. A slew key that is held then counts again when it has been let go."""
        self.advance(now)
        self._unheeded = AXES
        for motor in self._motors.values():
            motor.halt(now)
        self._settle(now)

    def displace(self, by: int, now: Ns, axis: str = "") -> None:
        """The shaft of a motor is elsewhere."""
        self.advance(now)
        self._motors[axis or AXES[0]].displace(by, now)
        self._settle(now)

    def duties(self, connector: str, now: Ns) -> Duties:
        """The PWM counts at the connector of an axis."""
        told = self._drive_of(connector, now)
        motor = self._motors[told.axis]
        rate = 0 if motor.idle else motor.speed(now)
        return told.drive.duties(motor.field(now), rate)  # type: ignore[return-value]

    def _next(self) -> Ns:
        motors = self._motors
        return min(motors["X"].deadline, motors["Y"].deadline, self._direct.deadline, self._wakes,
                   self._again, self._prompter.deadline)  # fmt: skip

    # -- resets ------------------------------------------------------------------------------------------

    def _reset(self, step_size: int, now: Ns) -> None:
        """Everything stops at once and is as after power-on; while RST or the logic supply is low it stays so."""
        self._clear(now, step_size)
        if LOW in (self._inputs["RST"], self._inputs["VC"]):
            self._phase = Phase.HELD
        else:
            self._phase = Phase.STARTING
            self._wakes = now + DEAF

    def _wake(self, now: Ns) -> None:
        self._wakes = NEVER
        self._phase = Phase.READY
        self._prompter.answer(link.answer(reports.VERSION_TEXT, self._verbose), now)
        if self._lost:
            self._out.append(
                Refused(now, self._lost, "lost: deaf for 250 ms after a reset; wait for its prompt (page 22)")
            )
            self._lost = ""
        if self._order.e_mode:
            self._choose_direct(self._order.e_mode, now)

    # -- inputs ------------------------------------------------------------------------------------------

    def _input_changed(self, pin: str, level: Level, now: Ns) -> None:
        if pin in pins.LIMITS:
            self._look_at_limits(now)
        elif self._direct.on:
            self._direct.changed(pin, now)
        elif pin == "NXT" and level == LOW:
            self._next_rate(now)

    def _look_at_limits(self, now: Ns) -> None:
        for motor in self._motors.values():
            motor.look_at_limit(now)

    def _look_at_keys(self, now: Ns) -> None:
        """A key slews its motor as long as it is held and stops it when it is let go; both of a pair stop it (page 21).

        What stops a motor under a held key (Z, =, a limit) brings it to rest; on the next tick it slews again, as soon
        as there is a way.
        """
        self._again = NEVER
        if self._phase is not Phase.READY:
            return
        for axis, motor in self._motors.items():
            asked, before = self._held(axis), self._keys[axis]
            self._keys[axis] = asked
            self._note_rest(motor, now)
            if asked is not before:
                self._unheeded = tuple(name for name in self._unheeded if name != axis)
                if not asked.value:
                    motor.stop(now)
                elif not motor.idle or self._rests_until[axis] <= now:
                    self._rests_until[axis] = NEVER
                    motor.slew(asked.value, now)
                self._note_rest(motor, now)
            if not asked.value or not motor.idle or axis in self._unheeded or self._limits.closed(axis, asked.value):
                continue
            if self._rests_until[axis] <= now:
                self._rests_until[axis] = NEVER
                motor.slew(asked.value, now)
                self._note_rest(motor, now)
            else:
                self._again = min(self._again, self._rests_until[axis])

    def _note_rest(self, motor: Motor, now: Ns) -> None:
        """A motor that has come to rest stands for a tick at least: so often are its keys looked at."""
        if not motor.idle:
            self._rests_until[motor.name] = NEVER
        elif self._rests_until[motor.name] >= NEVER:
            self._rests_until[motor.name] = motor.next_tick(now)

    def _held(self, axis: str) -> Keys:
        """The slew keys of an axis that are held; none where they are no slew keys (E mode, NOSLEW)."""
        return Keys.NONE if self._direct.on or not self._order.slew_inputs else keys(self._inputs, axis)

    def _next_rate(self, now: Ns) -> None:
        self._rate_place = (self._rate_place + 1) % len(STANDARD_RATES)
        for motor in self._motors.values():
            motor.set_rate(STANDARD_RATES[self._rate_place], now)

    def _choose_direct(self, bits: int, now: Ns) -> None:
        """E: both motors stop at once, whatever they did."""
        for motor in self._motors.values():
            motor.halt(now)
        self._direct.choose(bits)
        self._limits.switch(self._direct.on and (self._direct.currents or not self._order.hard_stop))
        self._keys = dict.fromkeys(AXES, Keys.NONE)

    def _steps(self, now: Ns) -> None:
        for step in self._direct.advance(now):
            if not self._limits.meets(step.axis, step.direction):
                self._motors[step.axis].step(step.direction, now)

    # -- after every event -------------------------------------------------------------------------------

    def _settle(self, now: Ns) -> None:
        """Slew keys, RDY, an I that waited, and the windings, as they follow from what has happened."""
        if self._phase is Phase.OFF:
            return
        self._look_at_keys(now)
        idle = all(motor.idle for motor in self._motors.values())
        self._driver.set("RDY", HIGH if idle and not self._direct.on else LOW, now)
        if self._waiting and self._may_answer():
            self._waiting = ()
            self._prompter.answer(link.PROMPT, now)
        for connector in AXES:
            told = self._drive_of(connector, now)
            before = self._drives.get(connector)
            if before is None or before[1:] != told[1:]:
                self._drives[connector] = told
                self._out.append(told)
        for connector in self._wired:
            pattern = self.duties(connector, now).pattern
            for bit, name in enumerate(reversed(pins.WINDINGS)):
                self._driver.set(pins.winding(connector, name), pattern >> bit & 1, now)

    def _may_answer(self) -> bool:
        return not self._direct.on and all(self._motors[axis].idle for axis in self._waiting)

    def _drive_of(self, connector: str, now: Ns) -> DriveSet:
        """What a connector gets: with double current both get what X does."""
        axis = AXES[0] if self._double else connector
        motor = self._motors[axis]
        forced = self._direct.on
        found = winding_drive(
            mode=motor.mode, idle=motor.idle_windings, moving=not motor.idle, forced=forced, half=self._half,
            size=self._step_size, auto=self._auto, auto_mode=self._order.auto_mode,
        )  # fmt: skip
        if self._phase is not Phase.READY:
            found = found._replace(sixteenths=0)
        elif self._direct.currents:
            halves = self._direct.power(axis)
            found = found._replace(sixteenths=(16 if halves == 2 else 8 if halves else 0))
        return DriveSet(now, connector, axis, motor.field_origin, found)

    # -- what `?` reads of it ----------------------------------------------------------------------------

    def _memory(self, address: int, now: Ns) -> int:
        match address:
            case 5:
                return sum(self._inputs[pin] << bit for bit, pin in enumerate(pins.LIMITS))
            case 6:
                levels = [*(self._inputs[pin] for pin in (*pins.SLEWS, "NXT")), self._driver.levels["RDY"], HIGH, HIGH]
                return sum(level << bit for bit, level in enumerate(levels))
            case 7:
                return self.duties("X", now).pattern | self.duties("Y", now).pattern << 4
            case 61 | 125:
                motor = self._motors["Y" if address == 61 else "X"]
                return motor.field(now) * self._step_size % CYCLE
            case 252:
                return self._auto
            case 253:
                return self._step_size
        return 0

    # -- output that waits -------------------------------------------------------------------------------

    def _cancel(self) -> None:
        """A new character begins, or has come: output that has not begun is dropped, and so is the prompt of an I."""
        self._prompter.discard()
        self._waiting = ()


def high_byte(rate: int) -> int:
    """What A keeps of its value."""
    return min(abs(rate) // 256, 255)
