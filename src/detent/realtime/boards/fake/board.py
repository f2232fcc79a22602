"""The fake board: blocks in and out, timers in virtual ticks, configuration and its checksum, shutdown and reset."""

from collections.abc import Callable, Mapping
from functools import partial
from heapq import heappop, heappush
from types import MappingProxyType
from typing import Any

from detent.realtime.boards.dictionary import Dictionary, Format, Value
from detent.realtime.boards.fake import parts, words
from detent.realtime.boards.fake.machine import Machine
from detent.realtime.boards.fake.part import Shutdown
from detent.realtime.boards.frames import FrameError, Reader, block, read_integer

MASK = 0xFFFFFFFF
TAKEN: Mapping[str, str] = MappingProxyType({"serial": "gpio0,gpio1"})
LATENCY = 2000  # ticks between a command and its response on the wire


class FakeBoard:
    """A board and the machine behind it. Ticks are whole numbers; 32 bits of them go over the wire.

    `receive` gives it bytes at a tick, `run_to` lets its timers run, `sent` is what it answered, each with its tick.
    """

    def __init__(
        self, machine: Machine | None = None, *, seed: int = 1, frequency: int = 16_000_000, moves: int = 64,
        pins: int | Mapping[str, tuple[int, int]] = 64, window: int | None = 192,
        first_tick: int = (1 << 32) - 50_000_000, sequence: int = 9, leave_out: tuple[str, ...] = (),
        reset: str = "reset", version: str = "fake-1", reserved: Mapping[str, str] = TAKEN, unfit: tuple[str, ...] = (),
    ) -> None:  # fmt: skip
        self.machine = machine if machine is not None else Machine()
        self.frequency, self.moves_allowed, self.window = frequency, moves, window
        self._unfit = unfit  # pins that are there and can do nothing
        self.now = first_tick
        self.sent: list[tuple[int, bytes]] = []
        self.log: list[tuple[int, str, Mapping[str, Value]]] = []  # commands that were carried out
        self.kept_log = True
        self.gave_up_at = ""  # the command that shut it down last
        numbers = words.numbered(seed, leave_out=leave_out, reset=reset)
        self.identity = words.dictionary(*numbers, frequency=frequency, pins=pins, window=window, version=version,
                                         reserved=reserved)  # fmt: skip
        self.dictionary = Dictionary.of_bytes(self.identity)
        self._commands = {form.number: form for form in self.dictionary.commands.values()}
        self._responses = {form.name: form for form in (Format(text, n) for text, n in numbers[1].items())}
        self._reasons = {text: n + 2 for n, text in enumerate(words.REASONS)}
        self._pins = dict(enumerate(self.dictionary.pins))
        self._sequence = sequence
        self._reader = Reader(patient=True)
        self._valid = True
        self.gone = False  # a reset takes the connection away; whoever has it opens it again
        self.resets = 0
        self.chips: dict[object, Any] = {}  # driver chips by their wires: see `chips`
        self.stalled_until = 0
        self.clear()
        self.machine.watchers.append(self._pin_changed)

    def clear(self) -> None:
        """As after power-on: nothing is configured."""
        self.oids: dict[int, Any] = {}
        self.oid_count: int | None = None
        self.crc = 0
        self.finalized = False
        self.reason: int | None = None  # of the shutdown
        self.free = 0
        self.timers: list[tuple[int, int, Callable[[int], None], list[bool]]] = []
        self._order = 0

    # -- time

    def at(self, tick: int, what: Callable[[int], None], *, check: bool = True) -> list[bool]:
        """Call `what` at `tick`; the list that is returned holds one True: False there takes it back.

        Too late is a shutdown, as in the firmware, unless a timer reschedules itself (`check` False).
        """
        if check and tick < self.now:
            raise Shutdown("Timer too close")
        alive = [True]
        heappush(self.timers, (tick, self._order, what, alive))
        self._order += 1
        return alive

    def run_to(self, tick: int) -> None:
        """Let everything happen up to and including `tick`."""
        while self.timers and self.timers[0][0] <= tick:
            at, _, what, alive = heappop(self.timers)
            if not alive[0]:
                continue
            late = max(at, self.stalled_until) if self.stalled_until > self.now else at
            if late > tick:
                heappush(self.timers, (late, self._order, what, alive))
                self._order += 1
                continue
            self.now = max(self.now, late)
            alive[0] = False
            self._guarded(partial(what, self.now))
        self.now = max(self.now, tick)

    def next_timer(self) -> int | None:
        """The tick of the next timer."""
        while self.timers and not self.timers[0][3][0]:
            heappop(self.timers)
        return self.timers[0][0] if self.timers else None

    def stall(self, ticks: int) -> None:
        """It is kept from doing anything for so long from now on."""
        self.stalled_until = self.now + ticks

    def whole(self, low: int) -> int:
        """The tick nearest to now whose low 32 bits these are."""
        return self.now + ((low - self.now + (1 << 31)) & MASK) - (1 << 31)

    # -- the wire

    def receive(self, data: bytes, tick: int) -> None:
        """Bytes of the host arrive at `tick`."""
        self.run_to(max(tick, self.stalled_until) if self.stalled_until > tick else tick)
        before = self._reader.damaged
        for found in self._reader.feed(data):
            if self._reader.damaged != before:
                before = self._reader.damaged
                self._say(b"")
            if found.sequence != self._sequence:
                self._say(b"")
                continue
            self._sequence = (self._sequence + 1) & 0xF
            self._carry_out(found.payload)
            if self.gone:
                return
            self._say(b"")
        if self._reader.damaged != before:
            self._say(b"")

    def respond(self, name: str, **values: Value) -> None:
        """Send a response."""
        self._say(self._responses[name].encode(values))

    def _say(self, payload: bytes) -> None:
        self.sent.append((self.now + LATENCY, block(self._sequence, payload)))

    def form(self, number: int) -> Format:
        """The command with that number. KeyError."""
        return self._commands[number]

    def _carry_out(self, payload: bytes) -> None:
        at = 0
        while at < len(payload) and not self.gone:
            try:
                number, at = read_integer(payload, at)
                form = self._commands[number]
                message, at = form.decode(payload, at)
            except (FrameError, KeyError):
                self._guarded(partial(self._give_up, "Invalid command"))
                return
            method = getattr(self, f"_do_{message.name}", None)
            if self.reason is not None and message.name not in _WHEN_SHUT_DOWN:
                self.respond("is_shutdown", static_string_id=self.reason)
                continue
            if self.kept_log:
                self.log.append((self.now, message.name, message.values))
            if method is not None:
                shut = self._guarded(partial(method, **message.values))
            else:
                part = self.oids.get(int(message.values["oid"]))
                shut = self._guarded(partial(self._of_part, part, message))
            if shut:
                self.gave_up_at = message.name
                return  # the rest of the block is not carried out

    def _of_part(self, part: Any, message: Any) -> None:
        name = message.name
        if name.startswith("config_"):
            self._new(message.values["oid"], parts.make(self, name, message.values))
            return
        method = getattr(part, name, None)
        if method is None:
            self._give_up("Invalid oid type")
        assert method is not None
        method(**{key: value for key, value in message.values.items() if key != "oid"})

    def _give_up(self, reason: str) -> None:
        raise Shutdown(reason)

    # -- shutdown

    def _guarded(self, what: Callable[[], None]) -> bool:
        """Whether it ended in a shutdown."""
        try:
            what()
        except Shutdown as shutdown:
            self.shut_down(str(shutdown))
            return True
        return False

    def shut_down(self, reason: str) -> None:
        """Stop everything; nothing but a few commands is carried out until it is cleared."""
        if self.reason is None:
            self.reason = self._reasons[reason]
        self.timers.clear()
        self.free = self.moves_allowed if self.finalized else 0
        for part in self.oids.values():
            part.shut_down()
        self.respond("shutdown", clock=self.now & MASK, static_string_id=self.reason)

    # -- pins and the move queue

    def pin(self, number: Value) -> str:
        """The name of a pin. Shutdown for one that is not there."""
        assert isinstance(number, int)
        if number not in self._pins or self._pins[number] in self._unfit:
            raise Shutdown("Not an output pin")
        return self._pins[number]

    def take_move(self) -> None:
        """An entry of the move queue, shared by everything that queues. Shutdown when there is none."""
        if self.free <= 0:
            raise Shutdown("Move queue overflow")
        self.free -= 1

    def free_move(self) -> None:
        """Give it back."""
        self.free += 1

    def part(self, oid: int, kind: type) -> Any:
        """The configured thing with that number. Shutdown if it is something else."""
        found = self.oids.get(oid)
        if not isinstance(found, kind):
            raise Shutdown("Invalid oid type")
        return found

    def _pin_changed(self, pin: str, level: bool, tick: int) -> None:
        for part in self.oids.values():
            part.pin_changed(pin, level, tick)

    def _new(self, oid: Any, part: Any) -> None:
        if self.oid_count is None or not 0 <= oid < self.oid_count or oid in self.oids or self.finalized:
            raise Shutdown("Can't assign oid")
        part.oid = oid
        self.oids[oid] = part

    # -- commands of the board itself

    def _do_identify(self, offset: int, count: int) -> None:
        self.respond("identify_response", offset=offset, data=self.identity[offset : offset + count])

    def _do_get_clock(self) -> None:
        self.respond("clock", clock=self.now & MASK)

    def _do_get_uptime(self) -> None:
        self.respond("uptime", high=self.now >> 32, clock=self.now & MASK)

    def _do_get_config(self) -> None:
        self.respond("config", is_config=int(self.finalized), crc=self.crc, is_shutdown=int(self.reason is not None),
                     move_count=self.moves_allowed if self.finalized else 0)  # fmt: skip

    def _do_allocate_oids(self, count: int) -> None:
        if self.oid_count is not None:
            self._give_up("oids already allocated")
        self.oid_count = count

    def _do_finalize_config(self, crc: int) -> None:
        if self.finalized:
            self._give_up("Already finalized")
        self.finalized, self.crc, self.free = True, crc, self.moves_allowed

    def _do_emergency_stop(self) -> None:
        self._give_up("Command request")

    def _do_clear_shutdown(self) -> None:
        if self.reason is None:
            self._give_up("Shutdown cleared when not shutdown")
        self.reason = None

    def _do_debug_nop(self) -> None:
        pass

    def _do_config_reset(self) -> None:
        if self.reason is None:
            self._give_up("config_reset only available when shutdown")
        self.power_cycle()

    def _do_reset(self) -> None:
        self.power_cycle()

    def power_cycle(self) -> None:
        """It starts again: everything is forgotten, outputs let go, and the connection is gone."""
        for part in self.oids.values():
            part.shut_down()
        self.clear()
        self.sent.clear()
        self._sequence = 0
        self._reader = Reader(patient=True)
        self.gone = True
        self.resets += 1


_WHEN_SHUT_DOWN = frozenset((
    "identify", "get_config", "get_clock", "get_uptime", "emergency_stop", "clear_shutdown", "config_reset", "reset",
    "debug_nop",
))  # fmt: skip
