"""What all controllers do in the same way: their supply, their outputs, the loop over what is due.

A controller says what happens when its supply comes (`_switch_on`) and fails (`_switch_off`), when something is due
(`_next`) and what is done then (`_do_due`).
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import NoReturn

from detent.assembler import ImageError
from detent.axis import Axis
from detent.controllers.device import Output, Powered
from detent.pins import Level, PinDriver
from detent.ticks import NEVER, Ns
from detent.uart import Format, SerialPort, Transmitter


class PoweredDevice(ABC):
    """A device with a supply. `_out` is what it did and has not told, `_driver` sets its output pins."""

    def __init__(self, straps: Mapping[str, Level], *, line_timing: bool) -> None:
        """`straps` are all of them, as they are tied. Without `line_timing` characters take no time."""
        self._straps = dict(straps)
        self._line_timing = line_timing
        self._out: list[Output] = []
        self._driver = PinDriver(self._out)
        self._powered = False

    def power(self, on: bool, now: Ns) -> None:
        """Switch the supply. Without it no output is driven."""
        self.advance(now)
        if on == self._powered:
            return
        self._powered = on
        if not on:
            self._switch_off(now)
        self._out.append(Powered(now, on))
        if on:
            self._switch_on(now)
        else:
            self._driver.release()

    def next_deadline(self) -> Ns | None:
        """When the device wants to be advanced next, if nothing else happens."""
        deadline = self._next()
        return None if deadline >= NEVER else deadline

    def advance(self, now: Ns) -> Ns:
        """Do what is due up to and including `now`, in order of time; what is due next."""
        while (at := self._next()) <= now:
            self._do_due(at)
        return at

    def drain(self) -> list[Output]:
        """What the device did since the last call."""
        if not self._out:
            return []
        out = self._out.copy()
        self._out.clear()
        return out

    def step_inputs(self) -> Sequence[str]:
        """The inputs on which every pulse counts, as they are meant now."""
        return ()

    @property
    def straps(self) -> Mapping[str, Level]:
        """How its straps are tied now; what counts is how they were when they were read."""
        return self._straps

    @property
    @abstractmethod
    def serial_port(self) -> SerialPort:
        """The port towards its host."""

    @property
    @abstractmethod
    def line_format(self) -> Format:
        """How characters look on that port."""

    def _new_transmitter(self) -> Transmitter:
        """The transmitter of its serial port, with nothing to send, in the format of now."""
        return Transmitter(self.serial_port.sends, self.line_format, self._out, timed=self._line_timing)

    @abstractmethod
    def _switch_on(self, now: Ns) -> None:
        """The supply has come: straps are read, outputs are driven."""

    @abstractmethod
    def _switch_off(self, now: Ns) -> None:
        """The supply fails: motion ends at once, everything volatile is lost."""

    @abstractmethod
    def _next(self) -> Ns:
        """The earliest deadline; NEVER if there is none. Nothing is asked more often."""

    @abstractmethod
    def _do_due(self, at: Ns) -> None:
        """Do something of what is due at `at`, the earliest deadline."""


class OneAxis(PoweredDevice):
    """A controller of one axis, which has no name."""

    def __init__(self, straps: Mapping[str, Level], shaft: int, *, line_timing: bool) -> None:
        super().__init__(straps, line_timing=line_timing)
        self._axis = Axis(self._out, shaft)

    @property
    def axes(self) -> Sequence[str]:
        """One axis, without a name."""
        return ("",)

    def displace(self, by: int, now: Ns, axis: str = "") -> None:
        """The shaft is elsewhere. RuntimeError while it moves."""
        self.advance(now)
        self._axis.displace(by, now)

    def _cut(self, now: Ns) -> None:
        """No further pulse."""
        if self._axis.moving:
            self._axis.cut(now)


class WithoutPrograms(PoweredDevice):
    """A controller that holds no program and keeps nothing without supply. `model` is its name in the catalogue."""

    model: str

    def program_memory(self) -> bytes:
        """It holds no program."""
        return b""

    def kept_memory(self) -> bytes:
        """It keeps nothing."""
        return b""

    def restore(self, image: bytes) -> None:
        """There is nothing that could keep an image. Raises ImageError."""
        self._no_memory()

    def load(self, image: bytes, base: int, now: Ns) -> None:
        """There is no memory for programs. Raises ImageError."""
        self._no_memory()

    def start(self, now: Ns) -> None:
        """There is no program to start."""
        self.advance(now)

    def _no_memory(self) -> NoReturn:
        raise ImageError(f"a {self.model} holds no programs and keeps no image: leave that out")
