"""One board: from the first byte to steps, and through shutdown and loss.

A board is told what it received and what the wall clock says, and gives bytes to send. It begins to talk with `start`;
`Ready` or `Refusal` is the first event. See `several.Boards` for what a cell uses.
"""

import json
import zlib
from collections.abc import Mapping
from enum import Enum

from detent.outputs.steps import Scale
from detent.realtime.boards.clock import Clock
from detent.realtime.boards.core import Core
from detent.realtime.boards.dictionary import BARE, Dictionary, Message, Value
from detent.realtime.boards.drivers import Driver, Wire
from detent.realtime.boards.events import InputChanged, Lost, Ready, Recovered, Refusal, ShutDown
from detent.realtime.boards.frames import FrameError
from detent.realtime.boards.inputs import GROUP, Buttons
from detent.realtime.boards.outs import DigitalOut
from detent.realtime.boards.setup import BoardSetup, DriverSetup, InputSetup, SetupProblem
from detent.realtime.boards.stepper import Stepper
from detent.realtime.boards.stops import Stop
from detent.realtime.pace import WallNs
from detent.ticks import MS, SECOND, Ns

PIECE = 40  # bytes of the dictionary in one answer
PROBES = 10  # round trips before anything is scheduled
PROBE_EVERY: WallNs = 985 * MS  # afterwards; not a whole second, which other things may keep too
PATIENCE = 60  # times that its clock is asked again, 40 ms apart: then it is lost
NO_ANSWER: WallNs = 5 * SECOND  # at the start
DYING: WallNs = 700 * MS  # what a host before us has queued is over by then
MOST_WATCHDOG = 1 << 30  # ticks: the firmware's clock has 32 bits

NEEDED: Mapping[str, tuple[str, ...]] = {
    "allocate_oids": ("count",),
    "get_config": (),
    "config": ("is_config", "crc", "is_shutdown", "move_count"),
    "finalize_config": ("crc",),
    "get_clock": (),
    "clock": ("clock",),
    "get_uptime": (),
    "uptime": ("high", "clock"),
    "emergency_stop": (),
    "clear_shutdown": (),
    "shutdown": ("clock", "static_string_id"),
    "is_shutdown": ("static_string_id",),
}
OF_STEPPERS: Mapping[str, tuple[str, ...]] = {
    "config_stepper": ("oid", "step_pin", "dir_pin", "invert_step", "step_pulse_ticks"),
    "queue_step": ("oid", "interval", "count", "add"),
    "set_next_step_dir": ("oid", "dir"),
    "reset_step_clock": ("oid", "clock"),
    "stepper_get_position": ("oid",),
    "stepper_position": ("oid", "pos"),
    "stepper_stop_on_trigger": ("oid", "trsync_oid"),
    "config_trsync": ("oid",),
    "trsync_start": ("oid", "report_clock", "report_ticks", "expire_reason"),
    "trsync_state": ("oid", "can_trigger", "trigger_reason", "clock"),
    "endstop_home": (
        "oid", "clock", "sample_ticks", "sample_count", "rest_ticks", "pin_value", "trsync_oid", "trigger_reason",
    ),
}  # fmt: skip
OF_INPUTS: Mapping[str, tuple[str, ...]] = {
    "config_endstop": ("oid", "pin", "pull_up"),
    "endstop_query_state": ("oid",),
    "endstop_state": ("oid", "homing", "next_clock", "pin_value"),
    "config_buttons": ("oid", "button_count"),
    "buttons_add": ("oid", "pos", "pin", "pull_up"),
    "buttons_query": ("oid", "clock", "rest_ticks", "retransmit_count", "invert"),
    "buttons_ack": ("oid", "count"),
    "buttons_state": ("oid", "ack_count", "state"),
}
OF_OUTS: Mapping[str, tuple[str, ...]] = {
    "config_digital_out": ("oid", "pin", "value", "default_value", "max_duration"),
    "queue_digital_out": ("oid", "clock", "on_ticks"),
}
OF_UARTS: Mapping[str, tuple[str, ...]] = {
    "config_tmcuart": ("oid", "rx_pin", "pull_up", "tx_pin", "bit_time"),
    "tmcuart_send": ("oid", "write", "read"),
    "tmcuart_response": ("oid", "read"),
}
OF_SPI: Mapping[str, tuple[str, ...]] = {
    "config_spi": ("oid", "pin", "cs_active_high"),
    "spi_transfer": ("oid", "data"),
    "spi_transfer_response": ("oid", "response"),
}

PIN_FIELDS = frozenset((
    "pin", "step_pin", "dir_pin", "rx_pin", "tx_pin", "miso_pin", "mosi_pin", "sclk_pin", "spi_bus",
))  # fmt: skip


class State(Enum):
    """Where a board stands."""

    IDLE = "idle"  # not started
    CONNECTING = "connecting"  # looking for its sequence number, reading its dictionary, its clock
    CONFIGURING = "configuring"
    READY = "ready"
    SHUT_DOWN = "shut down"
    LOST = "lost"
    REFUSED = "refused"
    SEEN = "seen"  # looked at, and left as it was


_STILL = frozenset((State.IDLE, State.LOST, State.REFUSED, State.SEEN))


class Board:
    """A board, its steppers, outputs, inputs, stops and drivers, by their names in the setup."""

    def __init__(self, setup: BoardSetup, *, only_look: bool = False) -> None:
        """Raises SetupProblem for what is wrong on any board.

        `only_look`: it is asked what it is, and left as it was; the state is then SEEN.
        """
        self._only_look = only_look
        self.left_with = 0  # entries of the move queue that it was configured with by somebody
        setup.check()
        self.setup = setup
        self.state = State.IDLE
        self.reason = ""  # of a shutdown, a loss or a refusal
        self.inputs: dict[str, bool] = {}  # the logical level of each, as last reported
        self.core = core = Core(setup)
        self._oids = 0
        self.steppers: dict[str, Stepper] = {}
        self.stops: dict[str, Stop] = {}
        readers: dict[str, int] = {}  # an endstop of each input, to ask for its level
        for stepper in setup.steppers:
            axis = Stepper(core, stepper, [self._oid() for _ in range(1 if stepper.minus is None else 2)])
            self.steppers[stepper.name] = axis
            stoppers: dict[str, tuple[InputSetup, int]] = {}
            for entry in setup.inputs:
                if stepper.stops is None or entry.name in stepper.stops:
                    stoppers[entry.name] = entry, self._oid()
                    readers.setdefault(entry.name, stoppers[entry.name][1])
            self.stops[stepper.name] = Stop(core, axis, self._oid(), stoppers, self._heard)
        self._readers: list[tuple[InputSetup, int, bool]] = []  # (input, endstop, whether it is ours alone)
        for entry in setup.inputs:
            own = entry.name not in readers
            self._readers.append((entry, self._oid() if own else readers[entry.name], own))
        self._buttons = [
            Buttons(core, setup.inputs[i : i + GROUP], self._oid(), self._changed)
            for i in range(0, len(setup.inputs), GROUP)
        ]
        self.outs = {out.name: DigitalOut(core, out, self._oid()) for out in setup.outs}
        self.drivers: dict[str, Driver] = {}
        self._wires: dict[tuple[str, str], Wire] = {}
        for chip in setup.drivers:
            self.drivers[chip.name] = Driver(core, chip, self._wire(chip))
        self._handlers = {
            "shutdown": self._shutdown, "is_shutdown": self._shutdown, "trsync_state": self._trsync,
            "buttons_state": self._button, "starting": self._restarted,
        }  # fmt: skip
        self._triggers = {stop.oid: stop for stop in self.stops.values()}
        self._groups = {group.oid: group for group in self._buttons}
        self._recovering = False
        self._fresh = False  # it had to be configured
        self._was_down = False  # it was found shut down, with its outputs at `off`
        self._known = False  # it was ready once, so that positions mean something
        self._begin_at: WallNs = 0
        self._wait_until: WallNs | None = None
        self._probe_at: WallNs | None = None
        self._probe_sent: tuple[WallNs, int] | None = None
        self._probes = 0
        self._identity = bytearray()
        self._suppressed: dict[str, bool] = {}
        self.wants_reopening = False  # it was told to start again: its port goes away

    def _oid(self) -> int:
        self._oids += 1
        return self._oids - 1

    def _wire(self, chip: DriverSetup) -> Wire:
        key = ("uart", chip.uart.name) if chip.uart is not None else ("spi", chip.select.name if chip.select else "")
        if chip.uart is None and (
            chip.select is None or (chip.bus is None and None in (chip.clock, chip.mosi, chip.miso))
        ):
            raise SetupProblem(chip.name, "uart", "a driver is reached by its uart pin, or by select and a bus (or "
                               "clock, mosi and miso)")  # fmt: skip
        if (chip.uart is None) is not (chip.kind in ("tmc2130", "tmc5160")):
            way = "uart" if chip.kind in ("tmc2208", "tmc2209") else "select and a bus"
            raise SetupProblem(chip.name, "kind", f"a {chip.kind} is reached by {way}")
        if not 0 <= chip.address <= (3 if chip.kind == "tmc2209" else 0):
            raise SetupProblem(chip.name, "address", f"a {chip.kind} has no address {chip.address}")
        if key not in self._wires:
            self._wires[key] = Wire(self.core, self._oid(), chip)
        return self._wires[key]

    # -- what is known of it

    @property
    def name(self) -> str:
        """Its name in the cell."""
        return self.setup.name

    @property
    def firmware(self) -> str:
        """Its version as it says; empty until it is known."""
        return self.core.dictionary.version

    @property
    def frequency(self) -> int:
        """Nominal ticks a second; 0 until it is known."""
        return self.core.dictionary.frequency

    @property
    def move_count(self) -> int:
        """Entries of its move queue, shared by steppers and outputs; 0 until it is configured."""
        return self.core.queue.size

    def statistics(self) -> dict[str, int]:
        """Counts since the start: blocks, what was sent again or came damaged, slips, corrections of outputs."""
        link = self.core.link
        return {
            "blocks": link.blocks, "bytes": link.bytes_sent, "retransmitted": link.retransmitted,
            "refused": link.refused, "damaged": link.damaged,
            "slips": sum(axis.slips for axis in self.steppers.values()),
            "corrections": sum(out.corrections for out in self.outs.values()),
        }  # fmt: skip

    @property
    def everything(self) -> Mapping[str, tuple[str, ...]]:
        """The commands and responses that Detent can make use of."""
        return {**NEEDED, **OF_STEPPERS, **OF_INPUTS, **OF_OUTS, **OF_UARTS, **OF_SPI}

    # -- bytes and time

    def start(self, wall: WallNs) -> None:
        """Begin to talk: at the start, and when its port is open again."""
        core = self.core
        core.link.reset()
        core.forget_questions()
        self.state = State.CONNECTING
        self._identity.clear()
        self._begin_at = wall
        self._wait_until = self._probe_at = self._probe_sent = None
        self.wants_reopening = False
        core.link.sync(wall)

    def take(self) -> bytes:
        """The bytes to send now."""
        return self.core.link.take()

    def receive(self, data: bytes, wall: WallNs) -> None:
        """Bytes came."""
        if self.state in _STILL:
            return
        core = self.core
        was = core.link.synced
        for payload in core.link.receive(data, wall):
            try:
                messages = core.dictionary.parse(payload)
            except FrameError:
                continue  # a word of an earlier life
            for message in messages:
                if not core.answered(message, wall):
                    handler = self._handlers.get(message.name)
                    if handler is not None:
                        handler(message, wall)
        if core.link.synced and not was:
            core.dictionary = BARE
            self._ask_identity(wall)
        core.link.flush(wall)

    def deadline(self) -> WallNs | None:
        """When `due` wants to be called."""
        if self.state in _STILL:
            return None
        times = [self.core.link.deadline(), self.core.deadline(), self._wait_until, self._probe_at]
        if self.state is State.CONNECTING:
            times.append(self._begin_at + NO_ANSWER)
        if self.state is State.READY:
            times += [out.deadline() for out in self.outs.values()]
            times += [axis.proof_due() for axis in self.steppers.values()]
        return min((at for at in times if at is not None), default=None)

    def due(self, wall: WallNs) -> None:
        """Whatever is due: sent again, asked again, clocks, watchdogs, counts."""
        if self.state in _STILL:
            return
        core = self.core
        core.link.due(wall)
        if self.state is State.CONNECTING and wall >= self._begin_at + NO_ANSWER:
            self._refuse("", "", "it does not answer as a board with Klipper firmware; look at its address and its "
                         "cable, and that the firmware is flashed for this interface")  # fmt: skip
            return
        silent = core.due(wall)
        if silent is not None:
            self.lose("it does not answer any more", wall)
            return
        if self._wait_until is not None and wall >= self._wait_until:
            self._wait_until = None
            self._read_all(wall)
        if self._probe_at is not None and wall >= self._probe_at:
            self._probe(wall)
        if self.state is State.READY:
            for out in self.outs.values():
                at = out.deadline()
                if at is not None and wall >= at:
                    out.commit(wall, self.heard())
            for axis in self.steppers.values():
                at = axis.proof_due()
                if at is not None and wall >= at:
                    axis.prove(wall)
        core.link.flush(wall)

    def commit(self, now: Ns, wall: WallNs) -> None:
        """The cell is at `now`: send what is certain."""
        if self.state is not State.READY:
            return
        for stop in self.stops.values():
            stop.commit(wall)
        for axis in self.steppers.values():
            axis.commit(now, wall)
        unheard = False
        heard = self.heard()
        for out in self.outs.values():
            unheard |= out.commit(wall, heard)
        if unheard:
            self.inquire(wall)
        for driver in self.drivers.values():
            driver.commit(wall)
        self.core.link.flush(wall)

    def heard(self) -> WallNs | None:
        """Whatever its stops did up to this wall time was told; None: none of them can do anything."""
        if self.state is not State.READY:
            return None
        return min((at for stop in self.stops.values() if (at := stop.heard()) is not None), default=None)

    def inquire(self, wall: WallNs) -> None:
        """Have something acknowledged, so that `heard` comes on; what is under way already will be."""
        link = self.core.link
        if self.heard() is not None and link.idle:
            self.core.command("get_uptime")  # nobody else asks for it here, so that no answer is mistaken
            link.flush(wall)

    # -- at the start

    def _ask_identity(self, wall: WallNs) -> None:
        self.core.ask("identify", "identify_response", self._identified, wall, offset=len(self._identity), count=PIECE)

    def _identified(self, message: Message, wall: WallNs) -> None:
        data = message.data("data")
        if message.number("offset") == len(self._identity):
            self._identity += data
            if data:
                self._ask_identity(wall)
                return
        else:
            self._ask_identity(wall)
            return
        try:
            found = Dictionary.of_bytes(bytes(self._identity))
        except ValueError as error:
            self._refuse("", "", f"{error}; flash it with stock firmware")
            return
        core = self.core
        core.dictionary = found
        core.link.window = found.receive_window
        core.clock = Clock(found.frequency)
        core.scale = Scale(found.frequency)
        if not self._suits(found):
            return
        core.ask("get_uptime", "uptime", self._uptime, wall)

    def _suits(self, found: Dictionary) -> bool:
        """Whether the firmware and its pins are what the setup wants; else it is refused."""
        setup = self.setup
        wanted = dict(NEEDED)
        for present, words in (
            (setup.steppers, OF_STEPPERS), (setup.steppers or setup.inputs, OF_INPUTS), (setup.outs, OF_OUTS),
            ([d for d in setup.drivers if d.uart is not None], OF_UARTS),
            ([d for d in setup.drivers if d.uart is None], OF_SPI),
        ):  # fmt: skip
            if present:
                wanted |= words
        missing = found.missing(wanted)
        if missing or not found.frequency:
            self._refuse("", "", f"its firmware ({found.version or 'without a version'}) has no {', '.join(missing)}; "
                         "flash it with a current one")  # fmt: skip
            return False
        for item, key, name in self._all_pins():
            try:
                found.number("spi_bus" if key == "bus" else "pin", name)
            except KeyError as error:
                self._refuse(item, key, error.args[0])
                return False
            if key != "bus" and name in found.reserved:
                self._refuse(item, key, f"the board needs {name} itself, for {found.reserved[name]}; use another pin")
                return False
        for out in self.setup.outs:
            if out.watchdog is not None and self.core.ticks(out.watchdog) > MOST_WATCHDOG:
                most = MOST_WATCHDOG // found.frequency
                self._refuse(out.name, "watchdog", f"{out.watchdog / SECOND:g} s is more than its clock can count; "
                             f"take {most} s or less")  # fmt: skip
                return False
        return True

    def _all_pins(self) -> list[tuple[str, str, str]]:
        """(item, key, name) of every pin and bus in the setup."""
        setup = self.setup
        keys = ("step", "dir", "minus", "pin", "uart", "transmit", "select", "clock", "mosi", "miso")
        found = []
        for item in setup.items():
            for key in keys:
                pin = getattr(item, key, None)
                if pin is not None:
                    found.append((item.name, key, pin.name))
        found += [(chip.name, "bus", chip.bus) for chip in setup.drivers if chip.bus is not None]
        return found

    def _uptime(self, message: Message, wall: WallNs) -> None:
        whole = (message.number("high") & 0xFFFFFFFF) << 32 | message.number("clock") & 0xFFFFFFFF
        self.core.clock.note(whole, wall, wall)
        self.core.clock.trips.clear()  # it served to extend the next ones
        self._probes = PROBES
        self._probe(wall)

    def _probe(self, wall: WallNs) -> None:
        """Ask for the clock; a round trip that was not disturbed counts."""
        core = self.core
        self._probe_at = wall + PROBE_EVERY
        if core.asking("clock", -1):
            return  # it has not answered yet
        self._probe_sent = (wall, core.link.retransmitted)
        core.ask("get_clock", "clock", self._clocked, wall, times=PATIENCE)
        core.link.flush(wall)
        if core.link.backlog:  # it has to wait itself
            self._probe_sent = None

    def _clocked(self, message: Message, wall: WallNs) -> None:
        core = self.core
        tick = core.whole(message, "clock", wall)
        if self._probe_sent is not None and self._probe_sent[1] == core.link.retransmitted:
            core.clock.note(tick, self._probe_sent[0], wall)
        if self._probes:
            self._probes -= 1
            if self._probes:
                self._probe(wall)
            else:
                core.ask("get_config", "config", self._configured, wall)

    def _configured(self, message: Message, wall: WallNs) -> None:
        """What it says of its configuration: none, ours, or another one."""
        core = self.core
        if self._only_look:
            self.left_with = message.number("move_count")
            self.state = State.SEEN
            return
        self.state = State.CONFIGURING
        commands = self._config()
        crc = zlib.crc32(json.dumps([core.dictionary.version, commands]).encode())
        is_config, is_shutdown = message.number("is_config"), message.number("is_shutdown")
        if is_config and message.number("crc") & 0xFFFFFFFF == crc:
            if is_shutdown:
                self._was_down = True
                core.command("clear_shutdown")
                core.ask("get_config", "config", self._configured, wall)
                return
            core.queue.clear(message.number("move_count"))
            for stop in self.stops.values():
                stop.clear()
            # what a host before us has queued is let go
            self._wait_until = wall + (0 if self._fresh or self._was_down else DYING)
            self._fresh_if_waiting(wall)
            return
        if is_config or is_shutdown:
            self._start_again(bool(is_shutdown))
            return
        self._fresh = True
        for name, values in commands:
            core.command(name, **self._numbered(name, values))
        core.command("finalize_config", crc=crc)
        core.ask("get_config", "config", self._configured, wall)

    def _fresh_if_waiting(self, wall: WallNs) -> None:
        if self._wait_until is not None and self._wait_until <= wall:
            self._wait_until = None
            self._read_all(wall)

    def _start_again(self, is_shutdown: bool) -> None:
        """It has another configuration: it has to start again, and its connection goes away."""
        core = self.core
        if "reset" in core.dictionary.commands:
            core.command("reset")
        elif "config_reset" in core.dictionary.commands:
            core.command("config_reset" if is_shutdown else "emergency_stop")  # see `_shutdown`
        else:
            self._refuse("", "", "it has another configuration and cannot be reset by command; switch it off and on")
            return
        self.wants_reopening = True

    def _config(self) -> list[tuple[str, dict[str, Value | str]]]:
        commands: list[tuple[str, dict[str, Value | str]]] = [("allocate_oids", {"count": self._oids})]
        for axis in self.steppers.values():
            commands += axis.config()
        for stop in self.stops.values():
            commands += stop.config()
        for entry, oid, own in self._readers:
            if own:
                commands.append(
                    ("config_endstop", {"oid": oid, "pin": entry.pin.name, "pull_up": entry.pin.pull & 0xFF})
                )
        for group in self._buttons:
            commands += group.config()
        commands += [out.config() for out in self.outs.values()]
        for wire in self._wires.values():
            commands += wire.config()
        return commands

    def _numbered(self, name: str, values: Mapping[str, Value | str]) -> dict[str, Value]:
        found: dict[str, Value] = {}
        for key, value in values.items():
            if isinstance(value, str):
                value = self.core.dictionary.number("spi_bus" if key == "spi_bus" else "pin", value)
            found[key] = value
        return found

    def _read_all(self, wall: WallNs) -> None:
        """The level of every input, and the count of every stepper; then it is ready."""
        core = self.core
        waiting: set[tuple[str, int]] = set()
        raw: dict[str, bool] = {}

        def came(message: Message, at: WallNs) -> None:
            oid = message.number("oid")
            waiting.discard((message.name, oid))
            if message.name == "endstop_state":
                for entry, reader, _ in self._readers:
                    if reader == oid:
                        raw[entry.name] = bool(message.number("pin_value"))
            else:
                for axis in self.steppers.values():
                    axis.position(message)
            if not waiting:
                self._be_ready(raw, at)

        for _, oid, _ in self._readers:
            waiting.add(("endstop_state", oid))
        for axis in self.steppers.values():
            waiting |= {("stepper_position", oid) for oid in axis.oids}
        for name, oid in list(waiting):
            command = "endstop_query_state" if name == "endstop_state" else "stepper_get_position"
            core.ask(command, name, came, wall, oid=oid)
        if not waiting:
            self._be_ready({}, wall)

    def _be_ready(self, raw: Mapping[str, bool], wall: WallNs) -> None:
        self.inputs = {entry.name: raw[entry.name] is not entry.pin.active_low for entry, _, _ in self._readers}
        self._suppressed.clear()
        for group, first in zip(self._buttons, range(0, len(self.setup.inputs), GROUP), strict=True):
            group.start([raw[entry.name] for entry in self.setup.inputs[first : first + GROUP]], wall)
        self.state = State.READY
        self.reason = ""
        for axis in self.steppers.values():
            axis.halt()
        for wire in self._wires.values():
            wire.clear()
        for out in self.outs.values():
            self._begin_out(out, wall)
        for driver in self.drivers.values():
            driver.began()
        if self._recovering and self._known:
            lost = self._fresh
            shafts = {name: None if lost else axis.counted() for name, axis in self.steppers.items()}
            self.core.events.append(Recovered(self.name, shafts, dict(self.inputs)))
        else:
            self.core.events.append(Ready(self.name, self._fresh, dict(self.inputs)))
        self._recovering, self._fresh, self._known, self._was_down = False, False, True, False

    def _begin_out(self, out: DigitalOut, wall: WallNs) -> None:
        """Its level is known where the board was configured or shut down; else it is said once."""
        if self._fresh:
            out.began(wall)
            return
        wanted = out.setup.off if self._recovering else out.setup.initial
        out.began(wall, out.setup.off if self._was_down else not wanted)
        if out.level is not wanted:
            out.now(wanted)
            out.commit(wall)

    # -- what goes wrong

    def emergency_stop(self, wall: WallNs) -> None:
        """Stop everything at once; `ShutDown` follows."""
        if self.state in (State.READY, State.CONFIGURING):
            self.core.link.drop_waiting()
            self.core.command("emergency_stop")
            self._fall(State.SHUT_DOWN)
            self.reason = "emergency stop"
            self.core.events.append(ShutDown(self.name, self.reason))
            self.core.link.flush(wall)

    def recover(self, wall: WallNs) -> None:
        """Make it ready again after ShutDown or Lost (of which the port is open again); `Recovered` follows.

        Nothing where it is ready already, or on its way.
        """
        if self.state is State.SHUT_DOWN:
            self._recovering = True
            self.state = State.CONFIGURING
            self.core.ask("get_config", "config", self._configured, wall)
            self.core.link.flush(wall)
        elif self.state in (State.LOST, State.REFUSED, State.IDLE):
            self._recovering = self._known
            self.start(wall)

    def lose(self, reason: str, wall: WallNs) -> None:
        """It does not answer, or its port is gone."""
        if self.state in (State.LOST, State.REFUSED, State.IDLE):
            return
        if self.wants_reopening:
            self.state = State.LOST  # as it was told
            return
        self._fall(State.LOST)
        self.reason = reason
        self.core.events.append(Lost(self.name, reason))

    def _refuse(self, item: str, key: str, text: str) -> None:
        self.state = State.REFUSED
        self.reason = text
        self.core.forget_questions()
        self.core.events.append(Refusal(self.name, item, key, text))

    def _fall(self, state: State) -> None:
        self.state = state
        self.core.forget_questions()
        self._recovering = False
        self._wait_until = None
        for axis in self.steppers.values():
            axis.halt()
        for stop in self.stops.values():
            stop.clear()
        for out in self.outs.values():
            out.shut_down()
        for driver in self.drivers.values():
            driver.shut_down()
        self.core.queue.clear(self.core.queue.size)

    def _shutdown(self, message: Message, wall: WallNs) -> None:
        reason = self.core.dictionary.reason(message.number("static_string_id"))
        if self.wants_reopening:
            # what follows a shutdown in its block is not carried out: the reset is asked for now
            if message.name == "shutdown" and "reset" not in self.core.dictionary.commands:
                self.core.command("config_reset")
            return
        if self.state is State.CONFIGURING and not self._recovering:
            self._refuse("", "", f"the firmware does not take this configuration: {reason}")
        elif self.state is State.CONFIGURING and message.name == "shutdown":
            # a watchdog that nobody has fed since it was lost: it is taken from there, as if it had been found so
            self.core.forget_questions()
            self._wait_until = None
            self.core.ask("get_config", "config", self._configured, wall)
        elif self.state is State.READY:
            self._fall(State.SHUT_DOWN)
            self.reason = reason
            self.core.events.append(ShutDown(self.name, reason))

    def _restarted(self, message: Message, wall: WallNs) -> None:
        if self.state is State.READY:
            self.lose("it has started again by itself", wall)

    # -- what the inputs do

    def _trsync(self, message: Message, wall: WallNs) -> None:
        stop = self._triggers.get(message.number("oid"))
        if stop is not None and self.state is State.READY:
            stop.reported(message, wall)

    def _button(self, message: Message, wall: WallNs) -> None:
        group = self._groups.get(message.number("oid"))
        if group is not None and self.state is State.READY:
            group.reported(message, wall)

    def _changed(self, name: str, level: bool, wall: WallNs) -> None:
        """A report says that an input has another level."""
        if any(stop.armed.get(name) is level for stop in self.stops.values()):
            self._suppressed[name] = level  # the trigger tells it exactly
            return
        self._suppressed.pop(name, None)
        self._tell(name, level, wall)

    def _heard(self, name: str, level: bool, wall: WallNs) -> None:
        """An input was asked behind a trigger: its event tells the level itself."""
        self.inputs[name] = level
        self._suppressed.pop(name, None)

    def _tell(self, name: str, level: bool, wall: WallNs) -> None:
        if self.inputs.get(name) is not level:
            self.inputs[name] = level
            self.core.events.append(InputChanged(self.name, name, level, self.core.clock.ns_at(wall)))

    def release_suppressed(self, wall: WallNs) -> None:
        """What was kept back because a stop was armed for it, where no stop is armed any more."""
        for name, level in list(self._suppressed.items()):
            if not any(stop.armed.get(name) is level or stop.firing for stop in self.stops.values()):
                del self._suppressed[name]
                self._tell(name, level, wall)
