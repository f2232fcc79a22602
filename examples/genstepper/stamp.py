"""What the sample programs of the manual run on: a Basic Stamp with three wires to the board.

`VirtualStamp` is wired to an emulated board, in virtual time. `SerialStamp` has a serial port, of a real board or of
`detent serve bs0610`; it has no wire to RDY.
"""

import time
from pathlib import Path
from typing import Protocol

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.pins import PinSet
from detent.ticks import MS

CELL = Path(__file__).parent / "cell.toml"


class Stamp(Protocol):
    """The statements that the programs use."""

    def serout(self, text: str) -> None:
        """SEROUT: send, and be busy as long as that takes."""

    def serin_wait(self, character: str) -> None:
        """SERIN with WAIT: listen until the character has come. What came before was not heard."""

    def pause(self, milliseconds: int) -> None:
        """PAUSE."""

    def busy(self) -> bool:
        """Whether RDY is low."""


class VirtualStamp:
    """A Stamp beside an emulated board."""

    def __init__(self) -> None:
        self.cell: Cell = build(parse(CELL.read_text(), str(CELL)), lambda file: "")
        self.line = self.cell.lines[0]
        self.sent: list[tuple[int, str]] = []  # when, and what
        self._level, self._seen = 1, 0

    def serout(self, text: str) -> None:
        """Send without gaps."""
        self.sent.append((self.cell.now, text))
        self.cell.send(0, text.encode())
        self.cell.run_to(self.line.host_busy_until)

    def serin_wait(self, character: str) -> None:
        """A Stamp has no buffer: a character that began before it listened is lost."""
        begun = self.cell.now + self.line.format.duration()
        self.line.take()
        while True:
            if any(heard.at >= begun and chr(heard.char.value) == character for heard in self.line.take()):
                return
            if self.cell.step() is None:
                raise RuntimeError(f"{character!r} will never come")

    def pause(self, milliseconds: int) -> None:
        """Let time pass."""
        self.cell.run_to(self.cell.now + milliseconds * MS)

    def busy(self) -> bool:
        """The level at RDY, by what has happened since it was last looked at."""
        recording = self.cell.recording
        assert recording is not None
        for number, (_, entry) in enumerate(recording):
            if number >= self._seen and isinstance(entry, PinSet) and entry.pin == "RDY":
                self._level = entry.level
        self._seen = len(recording)
        return self._level == 0


class SerialStamp:
    """A Stamp's program on a computer with a serial port."""

    def __init__(self, port: str) -> None:
        """A device, or a URL that pyserial knows; HOST:PORT is a TCP port. SystemExit where it cannot be opened."""
        import serial

        host, colon, number = port.rpartition(":")
        tcp = bool(colon) and "//" not in port and number.isdigit()
        try:
            self._port = serial.serial_for_url(f"socket://{host or 'localhost'}:{number}" if tcp else port, 9600)
        except (serial.SerialException, OSError, ValueError) as error:
            raise SystemExit(f"{port}: cannot open it ({error}); give a serial device, or HOST:PORT") from None

    def serout(self, text: str) -> None:
        """Send, and wait until it has gone."""
        self._port.write(text.encode())
        self._port.flush()

    def serin_wait(self, character: str) -> None:
        """Read until the character comes."""
        self._port.reset_input_buffer()
        while self._port.read(1) != character.encode():
            pass

    def pause(self, milliseconds: int) -> None:
        """Wait."""
        time.sleep(milliseconds / 1000)

    def busy(self) -> bool:
        """RDY is not on the serial connector."""
        raise RuntimeError(NO_READY)


NO_READY = "this program watches RDY, which no serial port has: run it without a port, or use gendemoser"


def stamp(arguments: list[str], *, watches_ready: bool = False) -> Stamp:
    """The Stamp that a command line asks for: a port, or nothing.

    SystemExit, before anything moves, for a port that cannot do what the program needs.
    """
    if not arguments:
        return VirtualStamp()
    if watches_ready:
        raise SystemExit(NO_READY)
    return SerialStamp(arguments[0])


def tell(one: Stamp) -> None:
    """What a virtual run did."""
    if not isinstance(one, VirtualStamp):
        return
    for at, text in one.sent:
        print(f"{at / 1e9:9.4f} s  {text}")
    board = one.cell.controller("board")
    for axis in board.axes:
        status = board.status(one.cell.now, axis)
        print(f"{axis}: at {status.position} after {status.pulses} microsteps")
