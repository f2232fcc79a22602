"""The board as a device: resets, characters, pins, and the commands.

One character follows one path: `receive` -> `link.Value` if it belongs to a number, else the method of its command
in `_OBEY` -> `prompter` answers. Motion is `motor`'s; what moves on its own is told by `_settle`, after every event.
"""

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import Any, ClassVar

from detent.assembler import ImageError
from detent.axis import Axis
from detent.controllers.device import DriveSet, Output, Powered, Refused, Status
from detent.controllers.genstepper import commands, link, pins, reports
from detent.controllers.genstepper.commands import Op
from detent.controllers.genstepper.direct import Direct
from detent.controllers.genstepper.inputs import FIRST_RATE, STANDARD_RATES, Limits, key
from detent.controllers.genstepper.motor import DEFAULT_RATE, DEFAULT_SLOPE, LEAST_KEPT, Motor
from detent.controllers.genstepper.pins import AXES, Order
from detent.controllers.genstepper.prompter import Prompter
from detent.controllers.genstepper.windings import CYCLE, Duties
from detent.controllers.genstepper.windings import drive as winding_drive
from detent.pins import HIGH, LOW, Level, Pin, PinDriver, PinKind, PulseOutput
from detent.ramps.tick_accumulator import UPDATES
from detent.ticks import MS, NEVER, Ns
from detent.uart import Char, Format, SerialPort

DEAF: Ns = 250 * MS  # after a reset ("wait about 1/4 second", page 22)


class Phase(Enum):
    """What the board as a whole is doing."""

    OFF = "off"  # without supply
    HELD = "held"  # RST, or the logic supply, is low
    STARTING = "starting"  # deaf
    READY = "ready"


class GenStepper:
    """One BS0610 or BS0710. Straps that are not named are open, JS installed; `order` are fields of `pins.Order`."""

    def __init__(
        self, model: str, straps: Mapping[str, Level] | None = None, *, line_timing: bool = True, shaft: int = 0,
        **order: Any,
    ) -> None:  # fmt: skip
        self.model = model
        self._order = Order(**order)
        self._straps = {**pins.DEFAULT_STRAPS[model], **(straps or {})}
        self._line_timing = line_timing
        self._inputs: dict[str, Level] = {pin.name: pin.rest for pin in self.pins if pin.kind is PinKind.INPUT}
        self._out: list[Output] = []
        self._driver = PinDriver(self._out)
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
        half_installed = self._straps[pins.HALF_JUMPER[self.model]] == LOW and not order.dual_baud
        self._half = bool(order.low_power if half_installed else order.high_power)
        self._double = order.double_current or self._straps["R1K"] == LOW
        self._auto = _high_byte(order.auto_rate)
        self._step_size = step_size
        self._rate_place = FIRST_RATE
        self._keys = dict.fromkeys(AXES, 0)  # what the slew keys asked for when last looked at
        self._drives: dict[str, DriveSet] = {}  # what was last told of each connector
        self._wakes: Ns = NEVER

    # -- the contract ------------------------------------------------------------------------------------

    def power(self, on: bool, now: Ns) -> None:
        """Switch the supply."""
        self.advance(now)
        if on == (self._phase is not Phase.OFF):
            return
        if on:
            self._out.append(Powered(now, on))
            for pin in self.pins:
                if pin.kind is PinKind.OUTPUT:
                    self._driver.set(pin.name, pin.rest, now)
            self._reset(self._order.step_size, now)
            self._settle(now)
        else:
            self._phase = Phase.OFF
            self._clear(now, self._order.step_size)
            self._out.append(Powered(now, on))
            self._driver.release()

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> None:
        """Characters on SI that are recognised at `now`, a quarter into their stop bits."""
        self.advance(now)
        for char in chars:
            if self._phase is Phase.READY:
                self._cancel()
                if char.framing_ok and char.parity_ok:
                    self._take(chr(char.value), now)
                    self._settle(now)

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

    def stored(self, ok: bool, now: Ns) -> None:
        """It stores nothing."""

    def next_deadline(self) -> Ns | None:
        """The earliest of: the end of a reset, motion, step lines, next character out."""
        deadline = self._next()
        return None if deadline >= NEVER else deadline

    def advance(self, now: Ns) -> None:
        """Do what is due, in order of time: steps first, then the rest."""
        while (at := self._next()) <= now:
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

    def drain(self) -> list[Output]:
        """What the board did since the last call."""
        out = self._out.copy()
        self._out.clear()
        return out

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
    def axes(self) -> Sequence[str]:
        """X and Y."""
        return AXES

    @property
    def line_format(self) -> Format:
        """8N1 at the ordered rate."""
        return pins.character_format(self._order, self._straps[pins.HALF_JUMPER[self.model]])

    def status(self, now: Ns, axis: str = "") -> Status:
        """The location of an axis, its steps, and one word: off held starting direct running ready."""
        motor = self._motors[axis or AXES[0]]
        state = self._phase.value
        if self._phase is Phase.READY:
            state = "direct" if self._direct.on else "ready" if motor.idle else "running"
        return Status(motor.position(now), motor.pulses(now), state)

    def duties(self, connector: str, now: Ns) -> Duties:
        """The PWM counts at the connector of an axis."""
        told = self._drive_of(connector, now)
        motor = self._motors[told.axis]
        rate = 0 if motor.idle else motor.speed(now)
        return told.drive.duties(motor.position(now), rate)  # type: ignore[return-value]

    def frame(self, text: str) -> bytes:
        """Commands as they are typed: there is nothing to add."""
        return text.encode("ascii", "replace")

    def answers(self, data: bytes) -> list[str]:
        """The lines, and the prompts, in what the board sent."""
        return link.undress(data)

    def restore(self, image: bytes) -> None:
        """It has no non-volatile memory."""
        raise ImageError(f"a {self.model} keeps nothing: it has no image")

    def load(self, image: bytes, base: int, now: Ns) -> None:
        """It holds no program."""
        raise ImageError(f"a {self.model} holds no programs")

    def start(self, now: Ns) -> None:
        """It holds no program."""

    def _next(self) -> Ns:
        motors = self._motors
        return min(motors["X"].deadline, motors["Y"].deadline, self._direct.deadline, self._wakes,
                   self._prompter.deadline)  # fmt: skip

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
        if self._order.e_mode:
            self._choose_direct(self._order.e_mode, now)
        self._look_at_keys(now)

    # -- inputs ------------------------------------------------------------------------------------------

    def _input_changed(self, pin: str, level: Level, now: Ns) -> None:
        if pin == "NXT":
            if level == LOW:
                self._next_rate(now)
        elif pin in pins.LIMITS:
            self._look_at_limits(now)
        elif self._direct.on:
            self._direct.changed(pin, now)
        else:
            self._look_at_keys(now)

    def _look_at_limits(self, now: Ns) -> None:
        for motor in self._motors.values():
            motor.look_at_limit(now)

    def _look_at_keys(self, now: Ns) -> None:
        """A key that was pressed slews, one that was let go stops, both of a pair stop (page 21)."""
        if self._direct.on or not self._order.slew_inputs:
            return
        for axis, motor in self._motors.items():
            asked = key(self._inputs, axis)
            if asked == self._keys[axis]:
                continue
            self._keys[axis] = asked
            if asked:
                motor.slew(asked, now)
            else:
                motor.stop(now)

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
        self._keys = dict.fromkeys(AXES, 0)
        self._look_at_keys(now)

    def _steps(self, now: Ns) -> None:
        for step in self._direct.advance(now):
            if not self._limits.meets(step.axis, step.direction):
                self._motors[step.axis].step(step.direction, now)

    # -- after every event -------------------------------------------------------------------------------

    def _settle(self, now: Ns) -> None:
        """RDY, an I that waited, and the windings, as they follow from what has happened."""
        if self._phase is Phase.OFF:
            return
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
        return DriveSet(now, connector, axis, motor.origin, found)

    # -- characters --------------------------------------------------------------------------------------

    def _cancel(self) -> None:
        """A new character begins, or has come: output that has not begun is dropped, and so is the prompt of an I."""
        self._prompter.discard()
        self._waiting = ()

    def _take(self, character: str, now: Ns) -> None:
        if self._value.take(character):
            return
        row = commands.row(character)
        lines: Sequence[str] | None = ()
        if row is None:
            self._value.number()
            if character not in commands.LITTLE_SAID:
                self._out.append(Refused(now, character, "no command of GenStepper: ignored, and answered"))
        else:
            if row.blinds:
                self._direct.blind(now)
            lines = self._OBEY[row.op](self, now)
        if lines is not None:
            self._prompter.answer(link.answer(lines, self._verbose), now)

    def _each(self) -> list[Motor]:
        return [self._motors[axis] for axis in self._selected]

    def _refuse(self, op: Op, number: int, takes: str, now: Ns) -> None:
        self._out.append(Refused(now, f"{number}{op.value}", f"{op.value} takes {takes}: nothing changes"))

    # -- commands: each returns the lines of its answer, None if it answers later --------------------------

    def _auto_rate(self, now: Ns) -> Sequence[str]:
        self._auto = _high_byte(self._value.number())
        return ()

    def _select(self, axes: tuple[str, ...]) -> Sequence[str]:
        self._value.number()
        self._selected = axes
        return ()

    def _select_both(self, now: Ns) -> Sequence[str]:
        return self._select(AXES)

    def _select_x(self, now: Ns) -> Sequence[str]:
        return self._select(("X",))

    def _select_y(self, now: Ns) -> Sequence[str]:
        return self._select(("Y",))

    def _direct_mode(self, now: Ns) -> Sequence[str]:
        self._choose_direct(self._value.number() & 0xFF, now)
        return ()

    def _go(self, now: Ns) -> Sequence[str]:
        target = self._value.number()
        if not self._direct.on:
            for motor in self._each():
                motor.go(target, now)
        return ()

    def _half_power(self, now: Ns) -> Sequence[str]:
        self._half = self._value.number() != 0
        return ()

    def _wait_idle(self, now: Ns) -> Sequence[str] | None:
        self._value.number()
        self._waiting = self._selected
        if self._may_answer():
            self._waiting = ()
            return ()
        if self._verbose & link.CRLF_FIRST:
            self._prompter.answer(link.CRLF, now)
        return None

    def _keep(self, now: Ns) -> Sequence[str]:
        rate = _limited(self._value.number(), LEAST_KEPT)
        for motor in self._each():
            motor.set_keep(rate, now)
        return ()

    def _slope(self, now: Ns) -> Sequence[str]:
        slope = _limited(self._value.number(), DEFAULT_SLOPE)
        for motor in self._each():
            motor.set_slope(slope, now)
        return ()

    def _rate(self, now: Ns) -> Sequence[str]:
        rate = _limited(self._value.number(), DEFAULT_RATE)
        for motor in self._each():
            motor.set_rate(rate, now)
        return ()

    def _latches(self, now: Ns) -> Sequence[str]:
        self._value.number()
        return (f"L,{self._limits.report()}",)

    def _mark(self, now: Ns) -> Sequence[str]:
        number = self._value.number()
        for motor in self._each():
            if number == 0:
                motor.mark = motor.position(now)
            elif number == 1 and not self._direct.on:
                motor.go(motor.mark, now)
        if number not in (0, 1):
            self._refuse(Op.MARK, number, "0 or 1", now)
        return ()

    def _mode(self, now: Ns) -> Sequence[str]:
        mode = self._value.number()
        if not 0 <= mode <= 3:
            self._refuse(Op.MODE, mode, "0 to 3", now)
            return ()
        for motor in self._each():
            motor.mode = mode
        return ()

    def _slew(self, now: Ns) -> Sequence[str]:
        direction = self._value.slew()
        if self._direct.on:
            return ()
        steps = 0 if direction else self._value.number()
        for motor in self._each():
            if direction:
                motor.slew(direction, now)
            else:
                motor.go_relative(steps, now)
        return ()

    def _limit_mask(self, now: Ns) -> Sequence[str]:
        self._limits.choose(self._value.number())
        self._look_at_limits(now)
        return ()

    def _choose_verbose(self, now: Ns) -> Sequence[str]:
        self._verbose = self._value.number() & (link.CRLF_FIRST | link.DELAYED)
        self._prompter.verbose(self._verbose)
        return ()

    def _idle_windings(self, now: Ns) -> Sequence[str]:
        choice = self._value.number()
        if not 0 <= choice <= 2:
            self._refuse(Op.WINDINGS, choice, "0 to 2", now)
            return ()
        for motor in self._each():
            motor.idle_windings = choice
        return ()

    def _stop(self, now: Ns) -> Sequence[str]:
        self._value.number()
        for motor in self._each():
            motor.stop(now)
        return ()

    def _software_reset(self, now: Ns) -> Sequence[str] | None:
        number = self._value.number()
        self._reset(min(max(number, 1), 64) if number else self._order.step_size, now)
        return None

    def _set_position(self, now: Ns) -> Sequence[str]:
        position = self._value.number()
        for motor in self._each():
            motor.set_position(position, now)
        return ()

    def _report(self, now: Ns) -> Sequence[str]:
        number = self._value.number()
        if number == commands.VERSION:
            return reports.VERSION_TEXT
        if reports.is_memory(number):
            return [f"{axis},{number},{self._memory(number, now)}" for axis in self._selected]
        number = number if reports.is_report(number) else 0
        found = []
        for motor in self._each():
            told = self._drive_of(motor.name, now)
            energised = bool(told.drive.sixteenths)  # type: ignore[attr-defined]
            found.append(reports.line(motor.name, number, reports.values(motor, energised, self._double, now)))
        return found

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
                return motor.position(now) * self._step_size % CYCLE
            case 252:
                return self._auto
            case 253:
                return self._step_size
        return 0

    _OBEY: ClassVar[dict[Op, Callable[["GenStepper", Ns], Sequence[str] | None]]] = {
        Op.AUTO: _auto_rate, Op.BOTH: _select_both, Op.DIRECT: _direct_mode, Op.GO: _go, Op.HALF: _half_power,
        Op.IDLE: _wait_idle, Op.KEEP: _keep, Op.LATCHES: _latches, Op.MARK: _mark, Op.MODE: _mode, Op.SLOPE: _slope,
        Op.RATE: _rate, Op.SLEW: _slew, Op.LIMITS: _limit_mask, Op.VERBOSE: _choose_verbose,
        Op.WINDINGS: _idle_windings, Op.X: _select_x, Op.Y: _select_y, Op.STOP: _stop, Op.RESET: _software_reset,
        Op.SET: _set_position, Op.REPORT: _report,
    }  # fmt: skip


def _limited(number: int, default: int) -> int:
    """A rate or slope as K, P and R take it: `default` for 0, no more than the ticks allow; a sign does not count."""
    return min(abs(number), UPDATES) or default


def _high_byte(rate: int) -> int:
    """What A keeps of its value."""
    return min(abs(rate) // 256, 255)
