"""One board: from the first byte to steps, and through shutdown and loss.

A board is told what it received and what the wall clock says, and gives bytes to send. It begins to talk with `start`;
`Ready` or `Refusal` is the first event. See `boards.Boards` for what a cell uses.
"""

from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from functools import partial

from detent.outputs.steps import Scale
from detent.realtime.boards.clock import Clock
from detent.realtime.boards.core import Core
from detent.realtime.boards.dictionary import BARE, Dictionary, Message
from detent.realtime.boards.equipment import Equipment
from detent.realtime.boards.events import BY_HAND, Lost, Ready, Recovered, Refusal, ShutDown
from detent.realtime.boards.frames import ROOM, FrameError
from detent.realtime.boards.outputs import DigitalOut
from detent.realtime.boards.probes import Probes
from detent.realtime.boards.setup import BoardSetup
from detent.realtime.boards.vocabulary import owner, unsuited
from detent.realtime.pace import WallNs
from detent.ticks import MS, SECOND, Ns

PIECE = 40  # bytes of the dictionary in one answer
NO_ANSWER: WallNs = 5 * SECOND  # at the start, while nothing comes
RUNS = (1 << 30, 8, 2, 1, 1)  # of steps, at most: a batch that has gone stale is made anew, and shorter
DYING: WallNs = 700 * MS  # what a host before us has queued is over by then
RESTARTING: WallNs = 1 * SECOND  # behind a reset: where the connection is still there, it does not go with the board


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
        setup.check()
        self.setup = setup
        self.state = State.IDLE
        self.reason = ""  # of a shutdown, a loss or a refusal
        self.left_with = 0  # entries of the move queue that it was configured with by somebody
        self.wants_reopening = False  # it was told to start again: its port goes away
        self.core = core = Core(setup)
        self._equipment = has = Equipment(core)
        self.steppers, self.stops, self.outputs, self.drivers = has.steppers, has.stops, has.outputs, has.drivers
        self._probes = Probes(core)
        core.look_at_clock = self._probes.ask
        self._handlers = {
            "shutdown": self._shutdown, "is_shutdown": self._shutdown, "trsync_state": self._trsync,
            "buttons_state": self._button, "starting": self._restarted,
        }  # fmt: skip
        self._only_look = only_look
        self._recovering = False
        self._fresh = False  # it had to be configured
        self._was_down = False  # it was found shut down, with its outputs at `off`
        self._known = False  # it was ready once, so that positions mean something
        self._heard_at: WallNs = 0  # something of it, or it was started
        self._wait_until: WallNs | None = None
        self._restarted_at: WallNs | None = None  # it was told to start again, and is spoken to anew then
        self._identity = bytearray()
        self._setting: Iterator[frozenset[str]] | None = None  # its configuration, as far as it has yet to be sent
        self._pins_set: frozenset[str] = frozenset()  # what the last command of it was about

    # -- what is known of it

    @property
    def name(self) -> str:
        """Its name in the cell."""
        return self.setup.name

    @property
    def inputs(self) -> Mapping[str, bool]:
        """The logical level of each input, as last reported."""
        return self._equipment.inputs.levels

    @property
    def still(self) -> bool:
        """Whether nothing is said to it at present."""
        return self.state in _STILL

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
            "corrections": sum(out.corrections for out in self.outputs.values()),
        }  # fmt: skip

    # -- bytes and time

    def start(self, wall: WallNs) -> None:
        """Begin to talk: at the start, and when its port is open again."""
        core = self.core
        core.link.reset()
        core.forget_questions()
        self.state = State.CONNECTING
        self._identity.clear()
        self._heard_at = wall
        self._wait_until = self._setting = self._restarted_at = None
        self._probes.clear()
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
        for said in core.link.receive(data, wall):
            core.known = said.known
            self._heard_at = wall
            try:
                messages = core.dictionary.parse(said.payload)
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
        self._configure(wall)
        core.link.flush(wall)

    def deadline(self) -> WallNs | None:
        """When `due` wants to be called."""
        if self.state in _STILL:
            return None
        times = [self.core.link.deadline(), self.core.deadline(), self._wait_until, self._probes.at, self._restarted_at]
        if self.state is State.CONNECTING:
            times.append(self._heard_at + NO_ANSWER)
        if self.state is State.READY:
            times += self._equipment.deadlines()
        return min((at for at in times if at is not None), default=None)

    def due(self, wall: WallNs, clock: Callable[[], WallNs] | None = None) -> None:
        """Whatever is due: sent again, asked again, clocks, watchdogs, counts. `clock` as in `commit`."""
        if self.state in _STILL:
            return
        core = self.core
        if self._restarted_at is not None and wall >= self._restarted_at:  # at a UART a reset leaves the port as it is
            self.start(wall)
            return
        core.link.due(wall)
        if self.state is State.CONNECTING and wall >= self._heard_at + NO_ANSWER:
            self._refuse("", "", "it does not answer as a board with Klipper firmware; look at its address and its "
                         "cable, and that the firmware is flashed for this interface", passing=True)  # fmt: skip
            return
        silent = core.due(wall)
        if silent is not None:
            self.lose("it does not answer any more", wall)
            return
        if self._wait_until is not None and wall >= self._wait_until:
            self._wait_until = None
            self._read_all(wall)
        if self._probes.at is not None and wall >= self._probes.at:
            self._probes.ask(wall)
        if self.state is State.READY:
            self._equipment.due(wall)
            if self._equipment.hungry(wall):
                self._give(self._equipment.feed, wall, clock)
        core.link.flush(wall)

    def commit(self, now: Ns, wall: WallNs, clock: Callable[[], WallNs] | None = None, firm: Ns | None = None) -> None:
        """The cell is at `now`: send what is certain. Nothing is taken back up to `firm` (None: as stops here say).

        With a `clock` (the wall's) it is looked at again when everything is ready to be written: what has gone stale
        meanwhile, because the computer was elsewhere, is taken back and made anew. Write at once what `take` gives.
        """
        if self.state is not State.READY:
            return
        self._equipment.talk(wall)
        firm = self.firm if firm is None else firm
        self._give(partial(self._equipment.commit, now, firm), wall, clock)

    def _give(self, work: Callable[[WallNs, int], bool], wall: WallNs, clock: Callable[[], WallNs] | None) -> None:
        """Do `work`, which says things that have a time, until it was quick enough; it tells whether it waits.

        Each time it is asked for less. What is stale even then is left for the next time.
        """
        core, link = self.core, self.core.link
        link.flush(wall)
        waits = False
        for most in RUNS:
            undo = None if clock is None else self._equipment.kept(wall)
            core.earliest = None
            waits = work(wall, most)
            link.flush(wall)
            if clock is None or undo is None:
                break
            after = clock()
            if not core.stale(after):
                break
            undo()
            wall = after
        if waits:
            self.inquire(wall)

    @property
    def starving(self) -> bool:
        """Whether steps have waited for room on the wire, and there is room again."""
        wanted = ROOM + self._equipment.renewing
        return self.state is State.READY and self._equipment.starved and self.core.link.enough(wanted)

    def heard(self) -> WallNs | None:
        """Whatever its stops did up to this wall time was told; None: none of them can do anything."""
        if self.state is not State.READY:
            return None
        return self._equipment.heard()

    @property
    def firm(self) -> Ns:
        """Nothing up to this cell time is taken back by what an input does."""
        return self._equipment.firm

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
        reason = unsuited(self.setup, found)
        if reason is not None:
            self._refuse(*reason)
            return
        self._probes.begin(wall, self._ask_config)

    def _ask_config(self, wall: WallNs) -> None:
        self.core.ask("get_config", "config", self._configured, wall)

    def _configured(self, message: Message, wall: WallNs) -> None:
        """What it says of its configuration: none, ours, or another one."""
        core = self.core
        if self._only_look:
            self.left_with = message.number("move_count")
            self.state = State.SEEN
            return
        self.state = State.CONFIGURING
        is_config, is_shutdown = message.number("is_config"), message.number("is_shutdown")
        if is_config and message.number("crc") & 0xFFFFFFFF == self._equipment.crc():
            if is_shutdown:
                self._was_down = True
                for axis in self.steppers.values():
                    axis.halt()
                core.command("clear_shutdown")
                self._ask_config(wall)
                return
            core.queue.clear(message.number("move_count"))
            for stop in self.stops.values():
                stop.clear()
            # what a host before us has queued is let go
            self._wait_until = wall + (0 if self._fresh or self._was_down else DYING)
            self._fresh_if_waiting(wall)
            return
        if is_config or is_shutdown:
            self._start_again(bool(is_shutdown), wall)
            return
        self._fresh = True
        self._setting = self._equipment.configure()
        self._configure(wall)

    def _configure(self, wall: WallNs) -> None:
        """Configure it, a command at a time: so it is known which of them it does not take."""
        while self._setting is not None and self.core.link.idle:
            pins = next(self._setting, None)
            if pins is None:
                self._setting = None
                self._ask_config(wall)
            else:
                self._pins_set = pins

    def _fresh_if_waiting(self, wall: WallNs) -> None:
        if self._wait_until is not None and self._wait_until <= wall:
            self._wait_until = None
            self._read_all(wall)

    def _start_again(self, is_shutdown: bool, wall: WallNs) -> None:
        """It has another configuration: it has to start again, and its connection goes away, if that is by USB."""
        core = self.core
        if "reset" in core.dictionary.commands:
            core.command("reset")
        elif "config_reset" in core.dictionary.commands:
            core.command("config_reset" if is_shutdown else "emergency_stop")  # see `_shutdown`
        else:
            what = "it has another configuration and cannot be reset by command; switch it off and on"
            self._refuse("", "", what, passing=True)
            return
        self.wants_reopening, self._restarted_at = True, wall + RESTARTING

    def _read_all(self, wall: WallNs) -> None:
        """The level of every input, and the count of every stepper; then it is ready."""
        core, readers = self.core, self._equipment.inputs.readers
        waiting: set[tuple[str, int]] = {("endstop_state", oid) for oid in readers}
        raw: dict[str, bool] = {}

        def came(message: Message, at: WallNs) -> None:
            oid = message.number("oid")
            waiting.discard((message.name, oid))
            if message.name == "endstop_state":
                raw[readers[oid].name] = bool(message.number("pin_value"))
            else:
                for axis in self.steppers.values():
                    axis.position(message)
            if not waiting:
                self._be_ready(raw, at)

        for axis in self.steppers.values():
            waiting |= {("stepper_position", oid) for oid in axis.oids}
        for name, oid in list(waiting):
            command = "endstop_query_state" if name == "endstop_state" else "stepper_get_position"
            core.ask(command, name, came, wall, oid=oid)
        if not waiting:
            self._be_ready({}, wall)

    def _be_ready(self, raw: Mapping[str, bool], wall: WallNs) -> None:
        self._equipment.begin(raw, wall)
        self.state = State.READY
        self.reason = ""
        for out in self.outputs.values():
            self._begin_out(out, wall)
        if self._known:
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
            out.now(wanted)  # with the next commit, which looks whether it is late

    # -- what goes wrong

    def emergency_stop(self, wall: WallNs) -> None:
        """Stop everything at once; `ShutDown` follows. One that is on its way back does not come before `recover`."""
        if self.state in (State.READY, State.CONFIGURING):
            self.core.link.drop_waiting()
            self.core.command("emergency_stop")
            self._fall(State.SHUT_DOWN)
            self.reason = BY_HAND
            self.core.events.append(ShutDown(self.name, self.reason))
            self.core.link.flush(wall)
        elif self.state is State.CONNECTING and self._known:
            self._fall(State.LOST)
            self.reason = BY_HAND

    def recover(self, wall: WallNs) -> None:
        """Make it ready again after ShutDown or Lost (of which the port is open again); `Recovered` follows.

        Nothing where it is ready already, or on its way.
        """
        if self.state is State.SHUT_DOWN:
            self._recovering = True
            self.state = State.CONFIGURING
            self._probes.again(wall, self._ask_config)  # the clocks may have parted meanwhile: a host was suspended
            self.core.link.flush(wall)
        elif self.state in (State.LOST, State.REFUSED, State.IDLE):
            self._recovering = self._known
            self.start(wall)

    def lose(self, reason: str, wall: WallNs) -> None:
        """It does not answer, or its port is gone."""
        if self.state in (State.LOST, State.REFUSED, State.IDLE):
            return
        if self.wants_reopening:
            self.state, self._restarted_at = State.LOST, None  # as it was told
            return
        self._fall(State.LOST)
        self.reason = reason
        self.core.events.append(Lost(self.name, reason))

    def _refuse(self, item: str, key: str, text: str, *, passing: bool = False) -> None:
        self.state = State.REFUSED
        self.reason, self._setting = text, None
        self.core.forget_questions()
        self.core.events.append(Refusal(self.name, item, key, text, passing))

    def _fall(self, state: State) -> None:
        self.state = state
        self.core.forget_questions()
        self._probes.break_off()
        self._recovering = self.wants_reopening = False  # whoever stopped it has to say that it may come back
        self._wait_until = self._setting = self._restarted_at = None
        self._equipment.fall(shut_down=state is State.SHUT_DOWN)
        self.core.queue.clear(self.core.queue.size)

    def _shutdown(self, message: Message, wall: WallNs) -> None:
        reason = self.core.dictionary.reason(message.number("static_string_id"))
        if self.wants_reopening:
            # what follows a shutdown in its block is not carried out: the reset is asked for now
            if message.name == "shutdown" and "reset" not in self.core.dictionary.commands:
                self.core.command("config_reset")
            return
        if self.state is State.CONFIGURING and self._setting is not None:
            pins = " and ".join(sorted(self._pins_set))
            what = f"the firmware does not take {pins or 'this configuration'} ({reason})"
            remedy = "take another pin, that can do this on this board" if pins else "switch the board off and on"
            self._refuse(*owner(self.setup, self._pins_set), f"{what}: {remedy}")
        elif self.state is State.CONFIGURING and message.name == "shutdown":
            # a watchdog that nobody has fed since a host was lost: it is taken from there, as if it had been found so
            self.core.forget_questions()
            self._wait_until = None
            self._ask_config(wall)
        elif self.state is State.READY:
            self._fall(State.SHUT_DOWN)
            self.reason = reason
            self.core.events.append(ShutDown(self.name, reason))

    def _restarted(self, message: Message, wall: WallNs) -> None:
        if self.state is State.READY:
            self.lose("it has started again by itself", wall)

    # -- what the inputs do

    def _trsync(self, message: Message, wall: WallNs) -> None:
        stop = self._equipment.trigger(message.number("oid"))
        if stop is not None and self.state is State.READY:
            stop.reported(message, wall)

    def _button(self, message: Message, wall: WallNs) -> None:
        if self.state is State.READY:
            self._equipment.inputs.reported(message, wall)

    def release_suppressed(self, wall: WallNs) -> None:
        """Tell what was kept back because a stop was armed for it, where no stop is armed any more."""
        self._equipment.inputs.release(wall)
