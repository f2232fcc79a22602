"""Driver chips: the settings that a controller commands of its power stage, written to registers and read back.

By UART a chip counts the writes that it took whole (IFCNT); by SPI registers are read back. What is not kept is
written again, and given up after a few times. Afterwards each chip is asked every second whether it still has them: one
whose supply was cut comes back with currents and microsteps of its own, and nobody would hear of it.
"""

from collections import deque
from collections.abc import Callable, Sequence

from detent.controllers.device import Stage
from detent.realtime.boards.core import Core
from detent.realtime.boards.dictionary import Message, Value
from detent.realtime.boards.events import DriverFault, DriverSet
from detent.realtime.boards.registers import (
    CHOPCONF,
    GCONF,
    IFCNT,
    Written,
    bits_of_bytes,
    bytes_of_bits,
    read_answer,
    read_frame,
    settings,
    write_frame,
)
from detent.realtime.boards.setup import DriverSetup
from detent.realtime.pace import WallNs
from detent.ticks import SECOND

TRIES = 3
LOOK_EVERY: WallNs = SECOND
BAUD = 40_000
SPI_RATE = 1_000_000
SPI_MODE = 3

Then = Callable[[bytes, WallNs], None]


class Wire:
    """A UART wire, which several chips may share, or the select line of one chip: one exchange at a time."""

    def __init__(self, core: Core, oid: int, setup: DriverSetup) -> None:
        self.oid, self.setup = oid, setup
        self._core = core
        self._queue: deque[tuple[bytes, int, Then]] = deque()
        self._busy = False

    def config(self) -> list[tuple[str, dict[str, Value | str]]]:
        """The commands that make it; pins by name."""
        setup, oid = self.setup, self.oid
        if setup.uart is not None:
            pin = setup.uart
            return [("config_tmcuart", {
                "oid": oid, "rx_pin": pin.name, "pull_up": int(pin.pull > 0),
                "tx_pin": (setup.transmit or pin).name, "bit_time": self._core.frequency // BAUD,
            })]  # fmt: skip
        assert setup.select is not None
        made: list[tuple[str, dict[str, Value | str]]]
        made = [("config_spi", {"oid": oid, "pin": setup.select.name, "cs_active_high": 0})]
        if setup.bus is not None:
            made.append(("spi_set_bus", {"oid": oid, "spi_bus": setup.bus, "mode": SPI_MODE, "rate": SPI_RATE}))
        else:
            assert setup.clock is not None
            assert setup.mosi is not None
            assert setup.miso is not None
            made.append(("spi_set_sw_bus", {
                "oid": oid, "miso_pin": setup.miso.name, "mosi_pin": setup.mosi.name, "sclk_pin": setup.clock.name,
                "mode": SPI_MODE, "pulse_ticks": self._core.ticks(500),
            }))  # fmt: skip
        return made

    def exchange(self, data: bytes, answer: int, then: Then, wall: WallNs) -> None:
        """Send `data`; `then` is given what came back, of `answer` bytes by UART; nothing where nothing did."""
        self._queue.append((data, answer, then))
        self._next(wall)

    def clear(self) -> None:
        """The board has forgotten what was under way."""
        self._queue.clear()
        self._busy = False

    def _next(self, wall: WallNs) -> None:
        if self._busy or not self._queue:
            return
        self._busy = True
        data, answer, then = self._queue.popleft()

        def came(message: Message, at: WallNs) -> None:
            self._busy = False
            field = "read" if self.setup.uart is not None else "response"
            then(message.data(field), at)
            self._next(at)

        if self.setup.uart is not None:
            self._core.ask("tmcuart_send", "tmcuart_response", came, wall, oid=self.oid, write=bits_of_bytes(data),
                           read=-(-answer * 10 // 8))  # fmt: skip
        else:
            self._core.ask("spi_transfer", "spi_transfer_response", came, wall, oid=self.oid, data=data)


class Driver:
    """A driver chip on a board; found as `board.drivers[name]`. What became of it comes as DriverSet or DriverFault."""

    def __init__(self, core: Core, setup: DriverSetup, wire: Wire) -> None:
        self.name, self.setup = setup.name, setup
        self._core, self._wire = core, wire
        self._wanted: Sequence[Written] | None = None
        self._has: dict[int, int] = {}  # register: value, of those that it has for sure
        self._fresh = False  # `_wanted` has not been written
        self._busy = self._ready = False
        self._failed = False  # what it has is not what it was told
        self._count = 0  # of its writes, by UART, when it was set
        self._look_at: WallNs | None = None  # whether it still has its settings

    def command(self, stage: Stage) -> None:
        """Set the chip as `stage` says, as soon as it can be reached; the last command counts.

        SetupProblem, before anything is sent, where the chip cannot do it.
        """
        wanted = settings(self.setup, stage)
        if wanted != self._wanted or self._failed:
            self._wanted, self._fresh = wanted, True

    def began(self) -> None:
        """The board is ready; the chip may have been without power: it is set again."""
        self._ready, self._busy = True, False
        self._has.clear()
        self._fresh = self._wanted is not None

    def shut_down(self) -> None:
        """The board does not talk to it."""
        self._ready = self._busy = False
        self._look_at = None

    def commit(self, wall: WallNs) -> None:
        """Begin to write what was commanded."""
        if self._fresh and self._ready and not self._busy:
            self._fresh, self._busy, self._look_at = False, True, None
            self._write(TRIES, wall)

    def deadline(self) -> WallNs | None:
        """When `due` wants to be called."""
        return self._look_at

    def due(self, wall: WallNs) -> None:
        """Ask the chip whether it still has its settings, if it is time."""
        if self._look_at is not None and wall >= self._look_at:
            self._look_at = None
            if not self._busy and self._wanted is not None:
                self._busy = True
                self._look(TRIES, wall)

    def _look(self, left: int, wall: WallNs) -> None:
        if self.setup.uart is not None:
            ask, answer = read_frame(self.setup.address, IFCNT), 8
        else:
            ask, answer = bytes((CHOPCONF, 0, 0, 0, 0)), 5
            self._wire.exchange(ask, answer, lambda *_: None, wall)  # the next one brings what this one asks

        def came(data: bytes, at: WallNs) -> None:
            if self._kept(data):
                self._busy, self._look_at = False, at + LOOK_EVERY
            elif self._fresh:
                self._busy = False  # it is set anew anyway
            elif left > 1:
                self._look(left - 1, at)
            else:
                silent = self.setup.uart is not None and read_answer(bytes_of_bits(data), IFCNT) is None
                silent = silent or not any(data) or all(byte == 0xFF for byte in data)
                self._fail(self._no_answer() if silent else "it has lost its settings: was its supply cut?")

        self._wire.exchange(ask, answer, came, wall)

    def _kept(self, data: bytes) -> bool:
        """Whether the answer to a look is that of a chip which has what it was told."""
        if self.setup.uart is not None:
            return read_answer(bytes_of_bits(data), IFCNT) == self._count
        wanted = next(entry.value for entry in self._wanted or () if entry.register == CHOPCONF)
        return int.from_bytes(data[1:5], "big") == wanted

    def _fail(self, reason: str) -> None:
        self._busy, self._failed = False, True
        self._has.clear()
        self._core.events.append(DriverFault(self._core.setup.name, self.name, reason))

    @property
    def waiting(self) -> bool:
        """Whether something waits to be written."""
        return self._fresh and self._ready and not self._busy

    def _write(self, left: int, wall: WallNs) -> None:
        """Only what is new: each register takes a chip on a UART 2 ms, and steps may follow soon."""
        assert self._wanted is not None
        wanted = tuple(entry for entry in self._wanted if self._has.get(entry.register) != entry.value)
        for entry in wanted:
            self._has.pop(entry.register, None)
        if wanted:
            (self._by_uart if self.setup.uart is not None else self._by_spi)(wanted, left, wall)
        else:
            self._busy, self._look_at = False, wall + LOOK_EVERY

    def _by_uart(self, wanted: Sequence[Written], left: int, wall: WallNs) -> None:
        address = self.setup.address
        ask = read_frame(address, IFCNT)

        def before(data: bytes, at: WallNs) -> None:
            count = read_answer(bytes_of_bits(data), IFCNT)
            if count is None:
                self._again(left, at, self._no_answer())
                return
            for entry in wanted:
                self._wire.exchange(write_frame(address, entry.register, entry.value), 0, lambda *_: None, at)

            def behind(data: bytes, at: WallNs) -> None:
                now = read_answer(bytes_of_bits(data), IFCNT)
                if now is None or (now - count) & 0xFF != len(wanted):
                    took = "an unknown number" if now is None else str((now - count) & 0xFF)
                    self._again(left, at, f"it took {took} of {len(wanted)} writes; look at the wire and its resistor")
                else:
                    self._count = now
                    self._done(wanted, at)

            self._wire.exchange(ask, 8, behind, at)

        self._wire.exchange(ask, 8, before, wall)

    def _by_spi(self, wanted: Sequence[Written], left: int, wall: WallNs) -> None:
        for entry in wanted:
            data = bytes((entry.register | 0x80,)) + entry.value.to_bytes(4, "big")
            self._wire.exchange(data, 5, lambda *_: None, wall)
        readable = [entry for entry in self._wanted or () if entry.register in (GCONF, CHOPCONF)]
        wrong: list[str] = []
        silent: list[bool] = []
        for entry in readable:
            ask = bytes((entry.register, 0, 0, 0, 0))
            self._wire.exchange(ask, 5, lambda *_: None, wall)

            def came(data: bytes, at: WallNs, entry: Written = entry) -> None:
                silent.append(not any(data) or all(byte == 0xFF for byte in data))
                value = int.from_bytes(data[1:5], "big")
                if value != entry.value:
                    wrong.append(f"{entry.name} is {value:08X}h and not {entry.value:08X}h")
                if entry is not readable[-1]:
                    return
                if not wrong:
                    self._done(wanted, at)
                else:
                    self._again(left, at, self._no_answer() if all(silent) else "; ".join(wrong))

            self._wire.exchange(ask, 5, came, wall)

    def _no_answer(self) -> str:
        setup = self.setup
        where = f"at {setup.select}" if setup.uart is None else f"at {setup.uart}, address {setup.address}"
        return f"the {setup.kind} {where} does not answer; look at its supply, its wires and its address"

    def _again(self, left: int, wall: WallNs, reason: str) -> None:
        if left > 1 and not self._fresh:
            self._write(left - 1, wall)
            return
        self._busy = False
        if not self._fresh:
            self._fail(reason)

    def _done(self, wanted: Sequence[Written], wall: WallNs) -> None:
        self._busy = self._failed = False
        self._has.update((entry.register, entry.value) for entry in wanted)
        self._look_at = wall + LOOK_EVERY
        what = ", ".join(f"{entry.name} {entry.value:08X}h" for entry in wanted)
        self._core.events.append(DriverSet(self._core.setup.name, self.name, what))
