"""Driver chips on the fake board's wires: registers that are written and read back, and how they fail."""

from collections.abc import Sequence
from typing import Any

from detent.realtime.boards.fake.part import Home, Part, Shutdown
from detent.realtime.boards.registers import bits_of_bytes, bytes_of_bits, check_byte

IFCNT = 0x02


class Chip:
    """A TMC chip: its registers. `deaf`: it does not answer; `forgets`: it does not keep what is written."""

    def __init__(self, address: int = 0, *, deaf: bool = False, forgets: bool = False) -> None:
        self.address, self.deaf, self.forgets = address, deaf, forgets
        self.registers: dict[int, int] = {}
        self.writes = 0

    def write(self, register: int, value: int) -> None:
        """A register is written."""
        self.writes += 1
        if not self.forgets:
            self.registers[register] = value

    def read(self, register: int) -> int:
        """What a register says."""
        return self.writes & 0xFF if register == IFCNT else self.registers.get(register, 0)


class Chips(dict[object, Sequence[Chip]]):
    """Every wire has its chips, of every address."""

    def get(self, wire: object, default: Any = None) -> Any:
        """The chips on a wire."""
        return self.setdefault(wire, [Chip(address) for address in range(4)])


class _Uart(Part):
    """One wire with chips that have addresses: 40000 bits a second, in real bits."""

    def __init__(self, board: Home, rx_pin: int, pull_up: int, tx_pin: int, bit_time: int) -> None:
        super().__init__(board)
        self.pin, self.bit_time = board.pin(rx_pin), bit_time
        self.busy = False
        self.dropped = 0

    def tmcuart_send(self, write: bytes, read: int) -> None:
        """Bits out, then bits in; dropped without a word while one is under way."""
        if len(write) > 10 or read > 10:
            raise Shutdown("tmcuart data too large")
        if self.busy:
            self.dropped += 1
            return
        self.busy = True
        answer = self._said(bytes_of_bits(write))
        bits = len(write) * 8 + (8 + len(answer) * 10 if read else 0)
        self.board.at(self.board.now + bits * self.bit_time, lambda _: self._over(answer, read))

    def _said(self, frame: bytes | None) -> bytes:
        if frame is None or len(frame) < 4 or check_byte(frame[:-1]) != frame[-1]:
            return b""
        chips: Sequence[Chip] = self.board.chips.get(self.pin, ())
        for chip in chips:
            if chip.address != frame[1] or chip.deaf:
                continue
            if frame[2] & 0x80:
                chip.write(frame[2] & 0x7F, int.from_bytes(frame[3:7], "big"))
                return b""
            reply = bytes((0x05, 0xFF, frame[2])) + chip.read(frame[2]).to_bytes(4, "big")
            return reply + bytes((check_byte(reply),))
        return b""

    def _over(self, answer: bytes, read: int) -> None:
        self.busy = False
        self.board.respond("tmcuart_response", oid=self.oid, read=bits_of_bytes(answer) if answer and read else b"")

    def shut_down(self) -> None:
        """The line is idle."""
        self.busy = False


class _Spi(Part):
    """A select line: datagrams of five bytes, each answered with what the one before asked."""

    def __init__(self, board: Home, pin: int, cs_active_high: int) -> None:
        super().__init__(board)
        self.pin = board.pin(pin)
        self.ready = False
        self.asked = 0

    def spi_set_bus(self, spi_bus: int, mode: int, rate: int) -> None:
        """A bus of the board."""
        self.ready = True

    def spi_set_sw_bus(self, miso_pin: int, mosi_pin: int, sclk_pin: int, mode: int, pulse_ticks: int) -> None:
        """A bus of any pins."""
        self.ready = True

    def spi_send(self, data: bytes) -> None:
        """A datagram."""
        self._exchange(data)

    def spi_transfer(self, data: bytes) -> None:
        """A datagram, and what comes back."""
        self.board.respond("spi_transfer_response", oid=self.oid, response=self._exchange(data))

    def _exchange(self, data: bytes) -> bytes:
        chips: Sequence[Chip] = self.board.chips.get(self.pin, ())
        if not self.ready or not chips or chips[0].deaf or len(data) != 5:
            return bytes(len(data))
        chip = chips[0]
        answer = bytes((0,)) + chip.read(self.asked).to_bytes(4, "big")
        self.asked = data[0] & 0x7F
        if data[0] & 0x80:
            chip.write(data[0] & 0x7F, int.from_bytes(data[1:], "big"))
        return answer


def uart(board: Home, **values: int) -> Part:
    """What config_tmcuart asks for."""
    return _Uart(board, **values)


def spi(board: Home, **values: int) -> Part:
    """What config_spi asks for."""
    return _Spi(board, **values)
