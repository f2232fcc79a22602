"""What the drive does: it takes messages from the MICROBUS, moves its motor, answers status.

The paper leaves open how long the firmware takes for anything; here it takes no time, and everything happens on the
clock of the rate generator, which starts with each movement.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from detent.controllers.device import Cautioned, Output, Refused, Status, Stop
from detent.controllers.powered import OneAxis, WithoutPrograms
from detent.controllers.supersigma import commands, link, pins
from detent.controllers.supersigma.commands import Command, Op
from detent.controllers.supersigma.link import Link
from detent.controllers.supersigma.motion import Motion
from detent.controllers.supersigma.program import BRAKING, OFFSET, Program
from detent.pins import HIGH, LOW, Level, Pin, PinKind, PulseOutput
from detent.ramps.differences import PAPER, Differences
from detent.ramps.rate_generator import CLOCK_HZ
from detent.ramps.ways import Way
from detent.ticks import Ns, instants, show_duration
from detent.uart import Char, Format, Sent, SerialPort, Transmitter


class Supersigma(OneAxis, WithoutPrograms):
    """One SUPERSIGMA drive with the given number on the bus. It has no straps."""

    model = "supersigma"
    INSTANTS = instants()

    def __init__(
        self,
        straps: Mapping[str, Level] | None = None,
        *,
        number: int = 1,
        table: Differences = PAPER,
        offset: int = OFFSET,
        short: Way = Way.HYPERBOLA,
        braking: int = BRAKING,
        line_timing: bool = True,
        shaft: int = 0,
    ) -> None:
        super().__init__(pins.DEFAULT_STRAPS, shaft, line_timing=line_timing)
        self.number = number
        self._inputs: dict[str, Level] = {pin.name: pin.rest for pin in pins.PINS if pin.kind is PinKind.INPUT}
        self._motion = Motion(self._axis, self._driver, self._inputs, Program(table, offset, short, braking))
        self._reset()

    def _reset(self) -> None:
        """Everything volatile as it is at power-on; "it is impossible for a drive to know the position"."""
        self._link = Link(self.number)
        self._on_bus: list[Output] = []  # the transmitter's outbox: bytes of an answer
        self._transmitter = Transmitter(pins.BUS, pins.BUS_FORMAT, self._on_bus, timed=self._line_timing)
        self._strobes: deque[tuple[Ns, Level]] = deque()  # of /ANSWER READY, to come
        self._flags = 0  # all but MOVING
        self._origin = self._axis.shaft
        self._motion.reset()

    # -- the contract ------------------------------------------------------------------------------------

    def _switch_on(self, now: Ns) -> None:
        self._reset()
        for pin in pins.PINS:
            if pin.kind.drives:
                self._driver.set(pin.name, pin.rest, now)

    def _switch_off(self, now: Ns) -> None:
        self._cut(now)
        self._reset()

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> None:
        """Bytes of the CCU that are taken at `now`."""
        self.advance(now)
        if not self._powered:
            return
        for char in chars:
            if not char.framing_ok:
                self._drop("the CCU let go of the bus", now)
                continue
            message = self._link.feed(char, now)
            if message is not None:
                self._handle(message, now)

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """An input takes a level. The emergency inputs interrupt when they become active; T0 only tells of a byte."""
        self.advance(now)
        before = self._inputs.get(pin)
        if before is None or before == level:
            return
        self._inputs[pin] = level
        if not self._powered:
            return
        if pin == pins.RAIL and self._motion.originating:
            if self._motion.switch_changed(level, now):
                self._origin = self._axis.shaft
                self._flag(link.ORIGINATED, now)
        elif pin in _INTERRUPTS and level == LOW:
            self._flag(_INTERRUPTS[pin], now)
            self._motion.emergency(now)

    def take_level(self, pin: str, level: Level, now: Ns) -> None:
        """An input takes a level without an edge. One that is found active while the motor moves stops it all the same.

        At rest nothing is told: nothing was met.
        """
        self.advance(now)
        if pin in self._inputs and self._motion.at_rest:
            self._inputs[pin] = level
        else:
            self.set_pin(pin, level, now)

    def stored(self, ok: bool, now: Ns) -> None:
        """The EPROM is not written in the circuit."""

    def _do_due(self, at: Ns) -> None:
        if self._motion.deadline <= at:
            self._motion.advance(at)
        elif self._link.deadline <= at:
            self._drop(f"no byte came for {show_duration(link.SILENCE)}", at)
        elif self._strobes and self._strobes[0][0] <= at:
            self._driver.set(pins.ANSWER, self._strobes.popleft()[1], at)
        else:
            self._transmitter.advance(at)
            self._put_on_bus()

    def watch(self, pin: str) -> None:
        """A wire leads from the step output: give each pulse as an event."""
        if pin == pins.STEP:
            self._motion.pulses_are_wired()

    # -- the controller as seen from outside -------------------------------------------------------------

    @property
    def pins(self) -> Sequence[Pin]:
        """The signals of the board."""
        return pins.PINS

    @property
    def pulse_output(self) -> PulseOutput:
        """OUT0 of the 8253; low for 500 ns."""
        return pins.STEP_OUTPUT

    @property
    def serial_port(self) -> SerialPort:
        """The bus carries both directions."""
        return pins.PORT

    @property
    def line_format(self) -> Format:
        """The pace of the bus."""
        return pins.BUS_FORMAT

    def status(self, now: Ns, axis: str = "") -> Status:
        """Half steps from the origin (or from where it was switched on), pulses given since made, and one word.

        The word is off, ready, running, braking or homing. The position is nothing that the drive knows itself.
        """
        course = self._motion.course
        state = "off" if not self._powered else "homing" if self._motion.originating else course.value
        return Status(self._axis.shaft_at(now) - self._origin, self._axis.pulses_at(now), state)

    def cuts(self, now: Ns, axis: str = "") -> Sequence[Stop]:
        """The limit switch in origination; in movements it brakes, as excessive force does."""
        return self._motion.cuts() if self._powered else ()

    def switches(self, axis: str = "") -> Sequence[str]:
        """The limit switch at the end of the rail."""
        return (pins.RAIL,)

    def frame(self, text: str) -> bytes:
        """The message that `text` says, in words or in hex. Raises ValueError with a remedy."""
        return self._link.frame(text)

    def answers(self, data: bytes) -> list[str]:
        """The answers in what this drive sent, in words."""
        return link.answers(data)

    def registers(self, now: Ns) -> dict[str, str]:
        """The step counter and the flags of the status, in words."""
        flags = [flag.word for flag in link.FLAGS if self._flags & flag.bit]
        return {"steps": str(self._motion.steps_done(now)), "flags": ", ".join(flags) or "none"}

    def halt(self, now: Ns) -> None:
        """The pulses stop without braking."""
        self.advance(now)
        self._motion.halt(now)

    # -- messages ----------------------------------------------------------------------------------------

    def _handle(self, message: bytes, now: Ns) -> None:
        command = commands.parse(message)
        if command is None:
            self._refuse(message, f"{message[1]:02X}h is no op-code", now)
            return
        found = commands.row(message[1])
        assert found is not None
        if not found.moves:
            self._ALWAYS[command.op](self, now)
        elif not self._motion.at_rest:
            self._refuse(message, f"{commands.spell(command)} came while the motor was moving", now)
        elif found.steps and command.steps == 0:
            self._refuse(message, f"{commands.spell(command)} has no steps", now)
        elif found.speed and command.speed == 0:
            self._refuse(message, f"{commands.spell(command)} has no speed", now)
        else:
            kept = 0 if command.op is Op.ORIGINATE else self._flags & link.ORIGINATED.bit
            self._flags = kept
            self._driver.set(pins.ATTENTION, LOW, now)
            if caution := self._caution(command):
                self._out.append(Cautioned(now, commands.spell(command), caution))
            self._move(command, now)

    def _caution(self, command: Command) -> str:
        """What is unexpected of a command that is taken: a limit that the ramps of the table cannot keep."""
        limit, lowest = command.speed * commands.SPEED_UNIT, round(CLOCK_HZ / (self._motion.lowest + 1))
        if command.op is not Op.LIMIT or limit >= lowest:
            return ""
        return (
            f"{limit} half steps/s is below {lowest}, where the table begins: it goes at {lowest}, without ramps; "
            f"constant {command.direction * command.steps:+d} {command.speed} would go at {limit}"
        )

    def _move(self, command: Command, now: Ns) -> None:
        op, direction, steps, speed = command
        match op:
            case Op.MOVE:
                self._motion.move(steps, direction, now)
            case Op.CONSTANT:
                self._motion.move_constant(steps, direction, speed * commands.SPEED_UNIT, now)
            case Op.LIMIT:
                self._motion.move_limited(steps, direction, speed * commands.SPEED_UNIT, now)
            case _:
                self._motion.originate(now)

    def _drop(self, why: str, now: Ns) -> None:
        """Half a message is forgotten. It is no refusal: whoever asks next is another, or has begun anew."""
        half = self._link.drop()
        if half:
            self._out.append(Refused(now, half.hex(" "), f"{why}: half a message is dropped"))

    def _refuse(self, message: bytes, reason: str, now: Ns) -> None:
        self._out.append(Refused(now, message.hex(" "), reason))
        self._flag(link.REFUSED, now)

    def _flag(self, flag: link.Flag, now: Ns) -> None:
        self._flags |= flag.bit
        if flag.bit & link.ATTENTION:
            self._driver.set(pins.ATTENTION, HIGH, now)

    def _status(self, now: Ns) -> None:
        flags = self._flags | (0 if self._motion.at_rest else link.MOVING.bit)
        self._transmitter.send(link.answer(self._motion.steps_done(now), flags), now)
        self._put_on_bus()

    def _put_on_bus(self) -> None:
        """Hand on the bytes that have begun; each has its strobe in the second half of its time."""
        for item in self._on_bus:
            assert isinstance(item, Sent)
            self._out.append(item)
            if item.done > item.at:
                self._strobes += ((item.at + (item.done - item.at) // 2, LOW), (item.done, HIGH))
        self._on_bus.clear()

    def _next(self) -> Ns:
        at = self._motion.deadline
        if (byte := self._transmitter.deadline) < at:
            at = byte
        if self._strobes and self._strobes[0][0] < at:
            at = self._strobes[0][0]
        if self._link.deadline < at:
            at = self._link.deadline
        return at

    _ALWAYS: ClassVar[dict[Op, Callable[["Supersigma", Ns], None]]] = {
        Op.STATUS: _status,
        Op.STOP: lambda self, now: self._motion.stop(now),
        Op.EMERGENCY: lambda self, now: self._motion.emergency(now),
    }


_INTERRUPTS = {pins.RAIL: link.END_OF_RAIL, pins.FORCE: link.EXCESSIVE_FORCE}
