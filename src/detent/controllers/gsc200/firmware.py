"""The module as a device: power, characters in and out, the immediate commands.

One frame follows one path: `receive` -> `link` completes it -> `_handle` (the datasheet's order of checks) -> the
command's own method, which answers. What takes time is `running`'s.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from detent.axis import Leeway
from detent.controllers.device import Refused, Status, Stop, StoreImage
from detent.controllers.gsc200 import commands, pins, program
from detent.controllers.gsc200.commands import GS_C200S, CommandError, Instruction, Op
from detent.controllers.gsc200.counter import PositionCounter
from detent.controllers.gsc200.link import Frame, Link
from detent.controllers.gsc200.motion import Motion
from detent.controllers.gsc200.program import Program, ProgramFull
from detent.controllers.gsc200.running import Running
from detent.controllers.powered import OneAxis
from detent.pins import HIGH, LOW, Level, Pin, PinKind, PulseOutput
from detent.ticks import MS, NEVER, Ns, instants
from detent.uart import Char, Format, SerialPort

INSTRUCTION_TIME: Ns = 1 * MS  # our assumption: no loop takes no time, no output pulse has no width
FIRST_ORED_REVISION = (2, 2)  # of the GS-C200: from here on the checksum is ORed with 10h


class GsC200(OneAxis):
    """One GS-C200 or GS-C200S module. Straps that are not named are `pins.DEFAULT_STRAPS`."""

    INSTANTS = instants()

    def __init__(
        self,
        model: str,
        straps: Mapping[str, Level] | None = None,
        *,
        revision: tuple[int, int] = FIRST_ORED_REVISION,
        instruction_time: Ns = INSTRUCTION_TIME,
        separate_clocks: bool = False,
        line_timing: bool = True,
        shaft: int = 0,
    ) -> None:
        super().__init__({**pins.DEFAULT_STRAPS, **(straps or {})}, shaft, line_timing=line_timing)
        self.model = model
        self._separate_clocks = separate_clocks
        self._clears_on_home = model != GS_C200S
        self._ored = model == GS_C200S or revision >= FIRST_ORED_REVISION
        self._instruction_time = instruction_time
        self._inputs: dict[str, Level] = {pin.name: pin.rest for pin in self.pins if pin.kind is PinKind.INPUT}
        self._eeprom = program.empty(model)
        self._motion = Motion(self._axis, self._driver, self._inputs, self.pulse_output)
        self._reset()

    def _reset(self) -> None:
        """Everything volatile as it is at power-on."""
        straps = self._straps
        self._form = pins.character_format(straps)
        self._link = Link(pins.address(straps), straps["CHS"] == HIGH, self._ored)
        self._transmitter = self._new_transmitter()
        self._deaf = False  # no reception: REC low and RXD tied high, or TEST not grounded
        self._inbox: deque[Char] = deque()  # characters behind an M that is being stored
        self._storing: Program | None = None
        self._kept: Frame | None = None  # the one frame that came while an answer was being sent
        self._ram = program.empty(self.model)
        self._programming = False
        self._counter = PositionCounter(self._axis, self.model)
        self._motion.reset()
        self._running = Running(
            self._motion, self._counter, self._driver, self._inputs, self._out, self._instruction_time
        )

    # -- the contract ------------------------------------------------------------------------------------

    def _switch_on(self, now: Ns) -> None:
        """Straps are read, and with REC low the stored program recalled."""
        self._reset()
        for pin in self.pins:
            if pin.kind.drives and pin.name != "RESET":
                self._driver.set(pin.name, pin.rest, now)
        self._axis.gate(self._inputs["ENABLE"] == HIGH, now)
        self._motion.pulse_reset(now)
        if self._straps["TEST"] == HIGH:
            self._deaf = True
            self._out.append(Refused(now, "TEST", "pin 10 must be grounded for normal operation: nothing is obeyed"))
        elif self._straps["REC"] == LOW:
            self._recall(now)

    def _switch_off(self, now: Ns) -> None:
        self._cut(now)
        self._reset()

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> None:
        """Characters on RXD whose stop bits end at `now`."""
        self.advance(now)
        if self._powered and not self._deaf:
            self._inbox.extend(chars)
            self._read(now)

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """An input takes a level. Straps may be moved at any time and count at the next power-on."""
        self.advance(now)
        if pin in self._straps:
            self._straps[pin] = level
            return
        self._inputs[pin] = level
        if self._powered:
            if self._running.input_changed(pin, level, now):
                self._homed()
            self.advance(now)  # an opened ENABLE lets a pulse go in this instant

    def stored(self, ok: bool, now: Ns) -> None:
        """The EEPROM was written, or not: then the old image stays whole (error 6)."""
        if self._storing is not None:
            if ok:
                self._eeprom = self._storing
            self._storing = None
            self._answer("Y" if ok else "E6", now)
            self._read(now)

    def _do_due(self, at: Ns) -> None:
        running = self._running
        if running.timer <= at or self._motion.deadline <= at:
            running.advance(at)
        elif self._transmitter.deadline <= at:
            self._transmitter.advance(at)
        elif self._kept is not None:
            frame, self._kept = self._kept, None
            self._handle(frame, at)

    def watch(self, pin: str) -> None:
        """A wire leads from a clock output: give each pulse as an event."""
        if pin in self.pulse_output.clocks:
            self._motion.pulses_are_wired()

    # -- the controller as seen from outside -------------------------------------------------------------

    @property
    def pins(self) -> Sequence[Pin]:
        """The connector, and the two clocks of figure 10 where they were ordered."""
        return pins.PINS_SEPARATE_CLOCKS if self._separate_clocks else pins.PINS

    @property
    def pulse_output(self) -> PulseOutput:
        """CLOCK, and CW and CCW beside it with the circuit of figure 10; low for 1.7 us."""
        return pins.SEPARATE_CLOCK_OUTPUT if self._separate_clocks else pins.CLOCK_OUTPUT

    @property
    def serial_port(self) -> SerialPort:
        """RXD and TXD."""
        return pins.SERIAL_PORT

    @property
    def line_format(self) -> Format:
        """How characters look on its line, by its straps as they were read at power-on."""
        return self._form

    def status(self, now: Ns, axis: str = "") -> Status:
        """The position counter, pulses given since made, and one word: off ready programming running homing."""
        if not self._powered:
            state = "off"
        elif self._running.busy:
            state = "homing" if self._running.homing else "running"
        else:
            state = "programming" if self._programming else "ready"
        return Status(self._counter.read(now), self._axis.pulses_at(now), state)

    def cuts(self, now: Ns, axis: str = "") -> Sequence[Stop]:
        """ENABLE; EOT or HOME in the part of homing that looks for it; the input of a velocity move without a ramp."""
        return self._running.cuts() if self._powered else ()

    def switches(self, axis: str = "") -> Sequence[str]:
        """EOT and HOME."""
        return ("EOT", "HOME")

    def frame(self, text: str) -> bytes:
        """The command line `text` as a host sends it to this module."""
        return self._link.frame(text, to_module=True)

    def answers(self, data: bytes) -> list[str]:
        """The answers in what this module sent."""
        return self._link.unframe(data)

    def registers(self, now: Ns) -> dict[str, str]:
        """S, T and R as they were commanded, the rounds of loops by the address of their L, the error that F tells."""
        motion, running = self._motion, self._running
        found = {"S": str(motion.start_stop), "T": str(motion.slew), "R": str(motion.ramp)}
        found |= {f"L at {address}": f"round {rounds}" for address, rounds in running.rounds()}
        return found | ({"F": f"E{running.error}"} if running.error else {})

    def program_memory(self) -> bytes:
        """The program in RAM."""
        return self._ram.image()

    def kept_memory(self) -> bytes:
        """The program in the EEPROM."""
        return self._eeprom.image()

    def restore(self, image: bytes) -> None:
        """Put `image` into the EEPROM. Raises `detent.assembler.ImageError` and keeps the old one."""
        self._eeprom = program.from_image(self.model, image)

    def load(self, image: bytes, base: int, now: Ns) -> None:
        """Put `image` into RAM, as P and its instructions would; programs start at address 0.

        Raises `detent.assembler.ImageError`.
        """
        self.advance(now)
        self._ram = program.from_image(self.model, image)

    def start(self, now: Ns) -> None:
        """Start the program in RAM, as E would; nothing happens while the module is busy or off."""
        self.advance(now)
        if self._powered and not self._running.busy:
            self._programming = False
            self._running.run(self._ram, now)

    def only_its_program(self, now: Ns) -> bool:
        """Neither a move nor an answer is under way."""
        only = self._transmitter.deadline >= NEVER and self._kept is None and self._transmitter.busy_until <= now
        return only and self._running.only_its_timer

    @property
    def leeway(self) -> Leeway:
        """Of its position counter."""
        return self._counter.leeway

    def postpone(self, by: Ns) -> None:
        """The next instruction is reached so much later."""
        self._running.postpone(by)

    def halt(self, now: Ns) -> None:
        """As K."""
        self.advance(now)
        if self._running.busy:
            self._running.kill(now)

    # -- frames ------------------------------------------------------------------------------------------

    def _read(self, now: Ns) -> None:
        """Take characters until an M has to wait for the EEPROM, which answers in this same instant."""
        while self._inbox and self._storing is None:
            frame = self._link.feed(self._inbox.popleft())
            if frame is None:
                continue
            if self._transmitter.busy_until <= now:
                self._handle(frame, now)
            elif self._kept is None:
                self._kept = frame
            else:
                self._out.append(Refused(now, frame.text, "came while an answer was being sent and another waited"))

    def _handle(self, frame: Frame, now: Ns) -> None:
        """Check a frame in the order E1, unknown E4, E2, busy B, mode E4, E3; then obey and answer."""
        if frame.fault:
            self._refuse(frame, 1, frame.fault, now)
            return
        try:
            instruction = commands.parse(self.model, frame.text)
        except CommandError as error:
            self._refuse(frame, error.code, error.reason, now)
            return
        row = commands.row(self.model, instruction.op)
        if self._running.busy and not row.running:
            reason = "busy: nothing is done; wait until F answers R, and send it again"
            self._out.append(Refused(now, frame.text, reason))
            self._answer("B", now)
        elif self._programming and row.stored:
            try:
                self._ram = self._ram.with_instruction(instruction)
            except ProgramFull as error:
                self._refuse(frame, 3, str(error), now)
            else:
                self._answer("Y", now)
        elif not (row.programming if self._programming else row.idle):
            where = "while programming" if self._programming else "outside a program"
            self._refuse(frame, 4, f"{row.name} is not allowed {where}", now)
        elif row.at_once:
            self._IMMEDIATE[instruction.op](self, instruction, now)
        else:
            self._single(frame, instruction, now)

    def _refuse(self, frame: Frame, code: int, reason: str, now: Ns) -> None:
        self._out.append(Refused(now, frame.text, reason))
        self._answer(f"E{code}", now)

    def _answer(self, text: str, now: Ns) -> None:
        self._transmitter.send(self._link.frame(text), now)

    def _single(self, frame: Frame, instruction: Instruction, now: Ns) -> None:
        """A delayed command outside a program: executed at once, as a program of one instruction."""
        if self._running.refuses(instruction, now):
            self._refuse(frame, 5, "the move would leave the position counter, 0 to 9999999", now)
        else:
            self._answer("Y", now)
            self._running.run(program.empty(self.model).with_instruction(instruction), now)

    # -- immediate commands ------------------------------------------------------------------------------

    def _execute(self, _: Instruction, now: Ns) -> None:
        self._answer("Y", now)
        self._programming = False
        self._running.run(self._ram, now)

    def _feedback(self, _: Instruction, now: Ns) -> None:
        if self._running.busy:
            self._answer("B", now)
        elif self._running.error:
            self._answer(f"E{self._running.error}", now)
            self._running.error = 0
        else:
            self._answer("R", now)

    def _force(self, instruction: Instruction, now: Ns) -> None:
        self._answer("Y", now)
        self._counter.preset(instruction.value, now)

    def _home(self, instruction: Instruction, now: Ns) -> None:
        self._answer("Y", now)
        if self._running.home(instruction.value, now):
            self._homed()

    def _initialize(self, instruction: Instruction, now: Ns) -> None:
        self._answer("Y", now)
        self._running.initialize(instruction.value, now)

    def _kill(self, _: Instruction, now: Ns) -> None:
        self._answer("Y", now)
        if self._running.busy:
            self._running.kill(now)

    def _zero(self, _: Instruction, now: Ns) -> None:
        self._answer("Y", now)
        if self._running.busy:
            self._running.zero(now)

    def _memory(self, _: Instruction, now: Ns) -> None:
        self._storing = self._ram
        self._out.append(StoreImage(now, self._ram.image()))

    def _exchange(self, _: Instruction, now: Ns) -> None:
        self._ram = self._eeprom
        self._answer("Y", now)

    def _program(self, _: Instruction, now: Ns) -> None:
        self._ram = program.empty(self.model)
        self._programming = True
        self._answer("Y", now)

    def _exit(self, _: Instruction, now: Ns) -> None:
        self._programming = False
        self._answer("Y", now)

    def _query(self, _: Instruction, now: Ns) -> None:
        for text in (*(step.text for step in self._ram.steps), "END"):
            self._answer(text, now)

    def _verify(self, instruction: Instruction, now: Ns) -> None:
        if instruction.value == 1:
            self._answer(f"V{self._counter.shown(now)}", now)
        else:
            self._answer(f"V{self._running.user_inputs()}{self._running.user_outputs()}", now)

    # -- homing and power-on -----------------------------------------------------------------------------

    def _recall(self, now: Ns) -> None:
        """Power-on with REC low: X, homing at the first S of the program, then the program."""
        self._ram = self._eeprom
        self._deaf = self._straps["RXD"] == HIGH
        for step in self._ram.steps:
            if step.instruction.op is Op.START_STOP:
                self._motion.start_stop = step.instruction.value
                break
        self._running.after_homing = self._ram
        self._running.home(-1 if self._deaf else 1, now)

    def _homed(self) -> None:
        """A homing that was commanded is complete. One at power-on never clears the program: it runs on."""
        if self._clears_on_home and not self._running.busy:
            self._ram = program.empty(self.model)

    def _next(self) -> Ns:
        """The earliest deadline; written out, as nothing is asked more often."""
        at = self._motion.deadline
        if (timer := self._running.timer) < at:
            at = timer
        if (character := self._transmitter.deadline) < at:
            at = character
        if self._kept is not None and (quiet := self._transmitter.busy_until) < at:
            at = quiet
        return at

    _IMMEDIATE: ClassVar[dict[Op, Callable[["GsC200", Instruction, Ns], None]]] = {
        Op.EXECUTE: _execute,
        Op.FEEDBACK: _feedback,
        Op.FORCE: _force,
        Op.HOME: _home,
        Op.INITIALIZE: _initialize,
        Op.KILL: _kill,
        Op.MEMORY: _memory,
        Op.PROGRAM: _program,
        Op.EXIT: _exit,
        Op.QUERY: _query,
        Op.VERIFY: _verify,
        Op.EXCHANGE: _exchange,
        Op.ZERO: _zero,
    }
