"""One DCB-274 as a device: the contract of `controllers.device`, and who gets each character.

Work is split: `link` makes lines of characters, `desk` has the typed command in hand, `running` the program, `work`
what both can do, `motion` the axis, `ports` the pins, `contacts` what sets something going, `readout` what Z 1 prints.
Here they meet, and whatever the idle state tests is tested (jog, go: page 27).
"""

from collections import deque
from collections.abc import Mapping, Sequence

from detent.axis import Leeway
from detent.controllers.dcb274 import current, pins, program, settings
from detent.controllers.dcb274.commands import MODEL
from detent.controllers.dcb274.contacts import Contacts
from detent.controllers.dcb274.desk import VERSION, Desk, Stage
from detent.controllers.dcb274.link import (
    AT_ONCE,
    CTRL_C,
    CTRL_N,
    CTRL_P,
    ESC,
    LF,
    SPACE,
    Entry,
    Mode,
    NamedEntry,
    SingleEntry,
    is_name,
    next_name,
)
from detent.controllers.dcb274.memory import SIZE, Memory
from detent.controllers.dcb274.motion import SETTLING, Motion, News
from detent.controllers.dcb274.ports import Ports
from detent.controllers.dcb274.program import POWER_UP
from detent.controllers.dcb274.readout import Readout
from detent.controllers.dcb274.running import Running
from detent.controllers.dcb274.settings import Settings
from detent.controllers.dcb274.trip import Trip
from detent.controllers.dcb274.work import Work
from detent.controllers.device import NamedLines, StageSet, Status, Stop, StoreImage
from detent.controllers.powered import OneAxis
from detent.pins import HIGH, LOW, Level, Pin, PulseOutput
from detent.ticks import NEVER, Ns, instants
from detent.uart import Char, Format, SerialPort

SIGN_ON = f"    110 AMS SMC-27X2 {VERSION}\r\n"  # behind the echoed space
CONFLICT = "GO-SS conflict\r\n"


class Dcb274(OneAxis):
    """One DCB-274. Straps that are not named are `pins.DEFAULT_STRAPS`."""

    model = MODEL
    INSTANTS = instants()
    NAMED_LINES = NamedLines(LF, AT_ONCE)

    def __init__(
        self,
        straps: Mapping[str, Level] | None = None,
        *,
        name: str = "A",
        execution_times: bool = True,
        overrun: bool = False,
        encoder: bool = False,
        p4_input: bool = False,
        line_timing: bool = True,
        shaft: int = 0,
    ) -> None:
        super().__init__({**pins.DEFAULT_STRAPS, **(straps or {})}, shaft, line_timing=line_timing)
        self._overrun, self._p4_input = overrun and line_timing, p4_input
        self._settings = Settings(name)
        self.memory = Memory(settings.factory(name))
        self._ports = Ports(self._driver, self._settings, p4_input)
        self._contacts = Contacts(self._ports)
        self._motion = Motion(self._axis, self._ports, self._settings, encoder=encoder)
        self._trip = Trip(self._motion, self._ports, self.memory, self._settings)
        self._work = Work(self._motion, self._ports, self.memory, self._settings, self._trip, times=execution_times)
        self._running = Running(self._work, self._out, self._say)
        self._desk = Desk(self._work, self._running, self, self._out)
        self._readout = Readout(self._motion, self._settings)
        self._set_inputs: set[str] = set()  # that something drives: the others follow the PLC jumper
        self._base = 0  # of the program that was loaded
        self._staged: tuple[int, int, tuple[int, int], int] | None = None  # what was last told of the power stage
        self._quiet = False  # nothing is under way: characters for others need no more than a look
        self._inbox: deque[int] = deque()  # characters that wait until a command has executed
        self._entry: Entry = SingleEntry()
        self.mode = Mode.WAITING
        self._transmitter = self._new_transmitter()
        self._forget()

    def _forget(self) -> None:
        """Everything of the link that a reset clears."""
        self._inbox.clear()
        self._candidate = 0  # the name typed before sign-on
        self._after_line_feed = False  # before sign-on: a name behind it makes a daisy chain
        self._conflict = False  # GO and SS were both true
        self._stopped = False  # the soft stop input was active when it was looked at last
        self._contacts.reset()
        self._readout.reset()

    # -- the contract ------------------------------------------------------------------------------------

    def _switch_on(self, now: Ns) -> None:
        """Jumpers count from power-on, PARTY from every reset."""
        self._quiet = False
        self._transmitter = self._new_transmitter()
        for pin in set(pins.INPUTS) - self._set_inputs:
            self._ports.levels[pin] = LOW if self._straps["PLC"] == HIGH else HIGH
        self._reset(now, party=False)

    def _switch_off(self, now: Ns) -> None:
        self._quiet = False
        self._transmitter = self._new_transmitter()
        self._staged = None
        self._cut(now)
        self._motion.reset()
        self._running.reset()
        self._desk.reset()
        self._forget()

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> bool:
        """Characters on RX whose stop bits end at `now`. False if they are for other axes, and nothing is under way."""
        if self._quiet and len(chars) == 1:
            value, parity_ok, framing_ok = chars[0]
            if parity_ok and framing_ok and self._entry.skips(value):  # lines have names where it can be quiet
                return False
        self.advance(now)
        for char in chars:
            if self._powered:
                self._quiet = False
                sound = char.parity_ok and char.framing_ok
                self._receive(char.value if sound else 0xFF, now)
                self._poll(now)
                self.advance(now)
        self._rest(self._next())
        return True

    @property
    def turned_away(self) -> int | None:
        """Its name, within a line for another axis, and while nothing is under way."""
        return self._entry.turned_away if self._quiet else None

    def line_ended(self) -> None:
        """As if LF had come when it came: until now it made no difference whether that line was over."""
        self._entry.skips(LF)

    def _rest(self, following: Ns) -> None:
        """Note whether nothing is under way, so that nothing happens but by an input; `following` is due next."""
        self._quiet = (
            following >= NEVER
            and self.mode is Mode.PARTY
            and self._powered
            and self._desk.stage is Stage.FREE
            and not self._running.active
            and not self._inbox
        )

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """An input takes a level. PARTY counts at the next reset, the jumpers at the next power-on."""
        self.advance(now)
        self._quiet = False
        if pin in self._straps:
            self._straps[pin] = level
            return
        if pin not in self._ports.levels:
            return
        self._set_inputs.add(pin)
        changed = self._ports.levels[pin] != level
        self._ports.levels[pin] = level
        if not self._powered:
            return
        if changed:
            self._heed(self._motion.input_changed(pin, now), now)
        self._poll(now)
        self.advance(now)

    def take_level(self, pin: str, level: Level, now: Ns) -> None:
        """An input takes a level without an edge: it asks for no step."""
        if pin in ("STEP", "DIR"):
            self.advance(now)
            self._set_inputs.add(pin)
            self._ports.levels[pin] = level
            self._motion.step_found(now)
        else:
            self.set_pin(pin, level, now)

    def stored(self, ok: bool, now: Ns) -> None:
        """The NV memory was written, or not."""
        self._quiet = False
        self._desk.stored(ok, now)
        self._poll(now)
        self.advance(now)

    # On a line with names every character reaches every unit: these two cost most of what a line costs.

    def next_deadline(self) -> Ns | None:
        """The earliest of: motion, program, command, next character out, readout."""
        if self._quiet or (deadline := self._next()) >= NEVER:
            return None
        return deadline

    def advance(self, now: Ns) -> Ns:
        """Do what is due, in order of time; in one instant steps come first. What is due next."""
        if self._quiet:
            return NEVER
        while (at := self._next()) <= now:
            self._do_due(at)
        if at >= NEVER:
            self._rest(at)
        return at

    def _do_due(self, at: Ns) -> None:
        if self._motion.deadline <= at:
            self._heed(self._motion.advance(at), at)
        elif self._running.timer <= at:
            self._running.advance(at)
        elif self._desk.timer <= at:
            self._desk.advance(at)
        elif self._transmitter.deadline <= at:
            self._transmitter.advance(at)
            return
        self._poll(at)

    def watch(self, pin: str) -> None:
        """A wire leads from P4 or STEPS: give each of its pulses as an event."""
        if pin == "P4":
            self._ports.wired = True
        elif pin == "STEPS":
            self._ports.steps_wired = True

    # -- the controller as seen from outside -------------------------------------------------------------

    @property
    def pins(self) -> Sequence[Pin]:
        """The connectors; P4 is an input where its jumpers make it one."""
        return pins.PINS_P4_INPUT if self._p4_input else pins.PINS

    @property
    def pulse_output(self) -> PulseOutput:
        """The steps that the drive gets."""
        return pins.STEPS_OUTPUT

    @property
    def serial_port(self) -> SerialPort:
        """RX and TX."""
        return pins.SERIAL_PORT

    @property
    def line_format(self) -> Format:
        """How characters look on its line, by its jumpers."""
        return pins.character_format(self._straps)

    def status(self, now: Ns, axis: str = "") -> Status:
        """The position counter, pulses given, and: off running homing moving programming waiting ready."""
        motion = self._motion
        if not self._powered:
            state = "off"
        elif motion.homing:
            state = "homing"
        elif self._running.active:
            state = "running"
        elif not motion.at_rest:
            state = "moving"
        elif self._desk.programming:
            state = "programming"
        else:
            state = "waiting" if self.mode is Mode.WAITING else "ready"
        return Status(motion.position(now), self._axis.pulses_at(now), state)

    def cuts(self, now: Ns, axis: str = "") -> Sequence[Stop]:
        """The limit ahead unless it is gentle (l 32), and the home switch while it is looked for.

        While w runs no step has been made, and the soft stop input and the end of a jog prevent them all.
        """
        if not self._powered:
            return ()
        found, levels = self._motion.cuts(now), self._ports.levels
        if self._motion.energizing(now):
            for pin in ("SS", "JOG1", "JOG2", "JOG-S"):
                levels[pin] ^= 1
                if self._stops_now():
                    found.append(Stop(pin, levels[pin]))
                levels[pin] ^= 1
        return found

    def _stops_now(self) -> bool:
        """Whether the soft stop and jog inputs, as they are, ask for a stop."""
        if self._ports.stopped and not self._stopped:
            return True
        return self._motion.jogging and self._motion.jog_ends(self._contacts.jog, self._ports.active("JOG-S"))

    def switches(self, axis: str = "") -> Sequence[str]:
        """Both limits and home."""
        return ("LIMIT-A", "LIMIT-B", "HOME")

    def step_inputs(self) -> Sequence[str]:
        """Step and direction, or the phases of an encoder."""
        return ("STEP", "DIR")

    def drive(self, now: Ns) -> current.Drive:
        """Current, decay and step table, as the drive has them at `now`: data for a motor model."""
        return current.drive(self._motion, self._settings, self._axis.shaft_at(now), now)

    @property
    def answering(self) -> bool:
        """Whether an answer is still to come: a command is in hand, or characters wait."""
        return self._desk.stage not in (Stage.FREE, Stage.LISTING, Stage.NAMING) or bool(self._inbox)

    def frame(self, text: str) -> bytes:
        """The line `text` as a host sends it now: signed on first in single mode, with the name on other lines."""
        if self.mode.named:
            return f"{chr(self._settings.name)}{text}\n".encode("ascii", "replace")
        signed_on = "" if self.mode is Mode.SINGLE else " "
        return f"{signed_on}{text}\r".encode("ascii", "replace")

    def answers(self, data: bytes) -> list[str]:
        """The lines in what the unit sent, echoes included."""
        return [line for line in data.decode("latin-1").replace("\r", "\n").split("\n") if line]

    def registers(self, now: Ns) -> dict[str, str]:
        """The registers of X, the trip, and what the jump counter has left."""
        found = self._settings.registers()
        left = self._running.left
        return found if left is None else found | {"J": f"{left} left"}

    def program_memory(self) -> bytes:
        """NV memory with the shadow RAM over it: where programs run."""
        return self.memory.read(0, SIZE)

    def kept_memory(self) -> bytes:
        """NV memory."""
        return self.memory.nv

    def restore(self, image: bytes) -> None:
        """Put `image` into NV memory: a whole one, or a program for address 0. Raises `detent.assembler.ImageError`."""
        self.memory.restore(image)

    def load(self, image: bytes, base: int, now: Ns) -> None:
        """Put a program and an end mark into memory, as program mode would. Raises `detent.assembler.ImageError`."""
        self.advance(now)
        data = image + bytes((program.END,))
        places = [address for address in range(base, base + len(data)) if program.allowed(address)]
        if len(data) - len(places) > len(range(193, 256)) + 1 or (image and not program.allowed(base)):
            raise program.Damaged(f"no program of {len(image)} bytes may stand at {base}")
        for address in places:
            self.memory.ram, nv = self.memory.put(address, data[address - base : address - base + 1])
            if nv is not None:
                self.memory.commit(nv, (address,))
        self._base = base
        self._out.append(StoreImage(now, self.memory.nv))

    def start(self, now: Ns) -> None:
        """Start the program that was loaded, as G would.

        Nothing happens without power, in program mode, while a command is in hand or waits, a program runs, a jog
        moves the axis, or the soft stop input is active.
        """
        self.advance(now)
        self._quiet = False
        at_something = self._desk.stage is not Stage.FREE or self._desk.programming or self._running.active
        if self._powered and not (at_something or self._motion.jogging or self._ports.stopped):
            self._running.go(self._base, False, now)

    def only_its_program(self, now: Ns) -> bool:
        """At rest, with the current that it has at rest, and nothing is typed, printed or read out."""
        over = max(self._motion.rested_at + SETTLING, self._transmitter.busy_until) <= now
        others = min(self._motion.deadline, self._desk.timer, self._transmitter.deadline, self._readout.deadline)
        return over and others >= NEVER and self._motion.at_rest and self._running.timer < NEVER

    @property
    def leeway(self) -> Leeway:
        """Of its position counter."""
        return self._motion.leeway

    def postpone(self, by: Ns) -> None:
        """The program goes on so much later."""
        self._running.timer += by

    def halt(self, now: Ns) -> None:
        """As | (page 25): motion and program are over."""
        self.advance(now)
        self._quiet = False
        if self._powered:
            self._inbox.clear()
            self._interrupt(ord("|"), now)
            self._poll(now)

    # -- reset -------------------------------------------------------------------------------------------

    def _reset(self, now: Ns, *, party: bool) -> None:
        """Power-on, ^C, ^P: registers from NV memory, outputs off, position 0, and the routine at 1600."""
        self._cut(now)
        self.memory.load_shadow()
        self._settings.load(self.memory)
        self._motion.reset()
        self._ports.reset(now)
        self._trip.reset(now)
        self._running.reset()
        self._desk.reset()
        self._forget()
        if self._ports.active("GO") and self._ports.active("SS"):
            self._settings.plc_for_now = self._conflict = True
        self._stopped = self._ports.stopped
        if "STEP" in self._set_inputs:
            self._motion.step_found(now)
        if party or self._straps["PARTY"] == HIGH:
            self._listen(Mode.PARTY)
        else:
            self._listen(Mode.WAITING)
        if self.memory.instruction(POWER_UP) is not None and not self._stopped:
            self._running.go(POWER_UP, False, now)
        self._poll(now)

    def _listen(self, mode: Mode) -> None:
        self.mode = mode
        if mode.named:
            self._entry = NamedEntry(self._settings.name, passes=mode is Mode.DAISY)
        else:
            self._entry = SingleEntry()

    # -- characters --------------------------------------------------------------------------------------

    def _receive(self, value: int, now: Ns) -> None:
        """What acts at once acts at once; everything else waits while a command executes."""
        match value:
            case _ if value == ESC:
                self._abort(now)
            case _ if value in (CTRL_C, CTRL_P):
                self._transmitter.discard()
                if self.mode is Mode.DAISY:
                    self._transmitter.send(bytes((value,)), now)
                self._reset(now, party=value == CTRL_P)
            case _ if self._desk.busy or self._inbox:
                if not (self._overrun and self._inbox):  # the UART holds one character
                    self._inbox.append(value)
            case _:
                self._take(value, now)

    def _take(self, value: int, now: Ns) -> None:
        """Give a character to whatever listens."""
        desk = self._desk
        if desk.stage is Stage.LISTING:
            desk.key(value, now)
        elif desk.stage is Stage.NAMING:
            desk.name(value, now)
        elif desk.closed or self._running.active or self._motion.jogging:
            if self.mode is Mode.WAITING and value != ord("@"):
                self._sign_on(value, now)  # a program at 1600 does not keep anybody from signing on
                return
            entered = self._entry.feed_closed(value)
            self._transmitter.send(entered.reply, now)
            if entered.interrupt:
                self._interrupt(entered.interrupt, now)
        elif value == CTRL_N:
            self._entry.clear()
            desk.ask_name(now)
        elif self.mode is Mode.WAITING:
            self._sign_on(value, now)
        else:
            entered = self._entry.feed(value)
            self._transmitter.send(entered.reply, now)
            if entered.line is not None:
                desk.enter(entered.line, entered.too_long, now)

    def _sign_on(self, value: int, now: Ns) -> None:
        """Before sign-on (pages 21 to 24): a name and SPACE, or LF and a name for a daisy chain."""
        behind_line_feed, self._after_line_feed = self._after_line_feed, value == LF
        if value == SPACE:
            self._settings.name = self._candidate or self._settings.name
            self._listen(Mode.SINGLE)
            self.send(" " + SIGN_ON + (CONFLICT if self._conflict else ""), now)
        elif not is_name(value):
            return
        elif behind_line_feed:
            self._settings.name = value
            self._listen(Mode.DAISY)
            self._transmitter.send(bytes((LF, next_name(value))), now)
        else:
            self._candidate = value
            self._transmitter.send(bytes((value,)), now)

    def _abort(self, now: Ns) -> None:
        """ESC: everything ends, outputs stay."""
        if self.mode is Mode.DAISY:
            self._transmitter.send(bytes((ESC,)), now)
        else:
            self._transmitter.discard()
        self._motion.halt(now)
        self._running.reset()
        self._desk.reset()
        self._entry.clear()
        self._inbox.clear()
        self.spend_contacts()
        if self.mode is not Mode.WAITING:
            self.send("#\n" if self.mode.named else "#\r\n", now)

    def _interrupt(self, value: int, now: Ns) -> None:
        """@ or | on a line that is closed."""
        if value == ord("@"):
            self._soft_stop(now)
        else:
            self._motion.halt(now)
            self._running.reset()
            self.spend_contacts()
            if self._desk.closed or self._desk.setting_off:
                self._desk.cancel(now)

    def _soft_stop(self, now: Ns) -> None:
        """@ or the soft stop input: decelerate; a program ends, a pending command is cancelled (page 28).

        So is a command that executes and would set off a motion at the end of its time.
        """
        self.spend_contacts()
        if self._running.active:
            self._running.soft_stop(now)
        elif self._desk.closed or self._desk.setting_off:
            if self._desk.speeds_pending:
                self._motion.soft_stop_after_ramp(now)
            else:
                self._motion.soft_stop(now)
            self._desk.cancel(now)
        else:
            self._motion.soft_stop(now)

    def spend_contacts(self) -> None:
        """A stop leads to rest."""
        self._contacts.spend()

    def send(self, text: str, now: Ns) -> None:
        """Send characters as they are."""
        self._transmitter.send(text.encode("latin-1"), now)

    def _say(self, text: str, now: Ns) -> Ns:
        """A line that a program prints, in single mode only; when the line is free again."""
        if self.mode is not Mode.SINGLE:
            return now
        self.send(text + "\r\n", now)
        return max(now, self._transmitter.busy_until)

    # -- the idle state ----------------------------------------------------------------------------------

    def _heed(self, news: News, now: Ns) -> None:
        """A step has reached the trip position; or a limit stops the motion, and a jog held meanwhile is spent."""
        if news.limited:
            self._contacts.spend_jogs()
        if news.tripped and (vector := self._trip.reached(now)):
            self._running.trip(vector, now)

    def _poll(self, now: Ns) -> None:
        """Look at everything that waits for a condition; what has come true goes on in this instant."""
        if not self._powered:
            return
        stopped = self._ports.stopped
        if stopped and not self._stopped:
            self._inbox.clear()  # what was typed ahead is pending, too
            self._soft_stop(now)
        self._stopped = stopped
        self._running.poll(now)
        self._desk.poll(now)
        if isinstance(self._entry, NamedEntry):
            self._entry.name = self._settings.name
        while self._inbox and not self._desk.busy:
            self._take(self._inbox.popleft(), now)
            self._running.poll(now)  # an @ that waited for G ends the program that G has begun
            self._desk.poll(now)
        self._test_inputs(now)
        self._readout.look(self._transmitter, now, single=self.mode is Mode.SINGLE)
        registers, origin = self._settings, self._motion.phase_origin
        staged = origin, registers.resolution, registers.current, registers.decay
        if staged != self._staged:
            self._staged = staged
            self._out.append(StageSet(now, "", origin, current.stage(registers)))

    def _test_inputs(self, now: Ns) -> None:
        """Jog and go, in the idle state: no command begun or in hand, no program (page 27)."""
        desk, motion, ports = self._desk, self._motion, self._ports
        self._contacts.look()
        if motion.jogging:  # its release is heeded whatever else is going on
            motion.jog(self._contacts.jog, ports.active("JOG-S"), now)
            return
        idle = desk.stage is Stage.FREE and not desk.programming and not self._running.active and self._entry.empty
        if not idle or ports.stopped:
            return
        if not motion.completing(now) and self._contacts.ask("GO"):
            self._running.go(0, False, now)
        elif motion.at_rest and (jog := self._contacts.jog):
            motion.jog(jog, ports.active("JOG-S"), now)

    def _next(self) -> Ns:
        """The earliest deadline; written out, as nothing is asked more often."""
        at = self._motion.deadline
        if (timer := self._running.timer) < at:
            at = timer
        if (timer := self._desk.timer) < at:
            at = timer
        if (character := self._transmitter.deadline) < at:
            at = character
        if (readout := self._readout.deadline) < at:
            at = readout
        return at
