"""The contract between a device and the cell it sits in.

A device is told the time. It owns no clock, thread, socket or file; it is told what reaches its pins
and its serial port and when, and it is asked what it did. Two laws hold for every device and are tested
on all of them: its output depends neither on how the characters of one instant are sliced into calls of
`receive`, nor on how the time between two events is sliced into calls of `advance`.

Order within one instant: a pulse due at t is sent before anything else at t; the device's own deadlines
come before pins, pins before characters. `receive` and `set_pin` therefore first advance to `now`.

A device can be copied at any moment (`copy.deepcopy`) and both copies go on identically. What never
changes (tables, trains, options) returns itself when copied.

What a device remembers by the clock it names in `INSTANTS`, what counts from a place in `PLACES` (`detent.cell.later`):
then a cell that does the same again and again can be put on by whole rounds. What depends on the time in another way
(a clock of its own that ticks) names nothing: a cell with it is run through. `leeway`, if it has it, tells how far its
axis could be elsewhere without a difference.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

from detent.axis import Displaced, MotionCut, MotionEnded, MotionStarted
from detent.pins import Level, Pin, PinSet, PulseOutput
from detent.pulses.segment import Int64Array
from detent.ticks import Ns
from detent.uart import Char, Format, Sent, SerialPort


class Executing(NamedTuple):
    """The program reached the instruction at byte `address`, printed as it is listed."""

    at: Ns
    address: int
    instruction: str


class Finished(NamedTuple):
    """The program, or the command that took time, is over."""

    at: Ns


class Refused(NamedTuple):
    """A frame or command was turned down: what it was, and why, in words."""

    at: Ns
    frame: str
    reason: str


class Cautioned(NamedTuple):
    """A frame or command was taken, and does what its sender may not expect: which, and what, in words."""

    at: Ns
    frame: str
    what: str


class StoreImage(NamedTuple):
    """Non-volatile memory is to be written. The owner answers with `stored` in the same instant."""

    at: Ns
    image: bytes


class Powered(NamedTuple):
    """The supply was switched. Without power every output lets go."""

    at: Ns
    on: bool


class Stage(NamedTuple):
    """What a controller commands of the power stage of an axis, in the terms of a motor.

    Position p of the axis is the place `start` + `places` x (p - origin) of the electrical cycle, in 1/64 full steps.
    """

    sequence: int  # of phase currents, as the controller's command numbers them
    places: int
    start: int = 0
    run: float = 1.0  # of full power; amperes a phase where `chops`
    hold: float = 1.0  # the same, `settling` behind a motion; without settling `run` counts until it is told otherwise
    settling: Ns = 0
    chops: bool = False
    slow_over: Ns | None = None  # decay is slow with pulses farther apart, and at rest; None: the drive's own business
    fast_from: int | None = None  # rate from which on `fast_sequence` is in force, at full power
    fast_sequence: int = 0

    def __deepcopy__(self, _: object) -> "Stage":
        return self


class StageSet(NamedTuple):
    """The power stage of `axis` is commanded so until it is set again; `origin` is the shaft at position 0."""

    at: Ns
    axis: str
    origin: int
    stage: Stage


class Drive(Protocol):
    """How windings are driven, as a function of nothing but the position and the rate."""

    @property
    def stage(self) -> Stage:
        """The same in the terms of a motor."""

    @property
    def ends(self) -> Sequence[str]:
        """The winding ends, named as their pins less the name of the connector before them."""

    @property
    def power(self) -> str:
        """How much current they get, in a word or two."""

    def duties(self, position: int, rate: int) -> Sequence[int]:
        """PWM counts of the winding ends, at a position in microsteps and a rate in microsteps/s."""

    def duties_at(self, positions: Int64Array, rates: Int64Array) -> Int64Array:
        """The same for many positions and rates: a row each."""


class DriveSet(NamedTuple):
    """The windings at `connector` are driven by `drive`, until it is set again.

    The position is that of the shaft of `axis` less `origin`, the rate is its train's: no step needs an event.
    """

    at: Ns
    connector: str
    axis: str
    origin: int
    drive: Drive

    @property
    def stage(self) -> Stage:
        """What that is in the terms of a motor, as `StageSet` has it."""
        return self.drive.stage


Output: TypeAlias = (
    Sent | PinSet | MotionStarted | MotionCut | MotionEnded | Displaced | DriveSet | StageSet
    | Executing | Finished | Refused | Cautioned | StoreImage | Powered
)  # fmt: skip


class Stop(NamedTuple):
    """An input that stops an axis at once if it takes this level, which it has not: no further pulse of this motion."""

    pin: str
    level: Level


class CommandHelp(NamedTuple):
    """A row of a controller's command table as people read it."""

    command: str
    argument: str
    bytes: int  # in program memory; 0: not stored
    type: str
    when: str
    what: str
    section: str  # of the manual


class Status(NamedTuple):
    """What a glance at an axis tells: its position by the controller's counter, pulses given, a word of state."""

    position: int
    pulses: int
    state: str


class Device(Protocol):
    """Anything that sits in a cell."""

    @property
    def pins(self) -> Sequence[Pin]:
        """Its pin table."""

    def power(self, on: bool, now: Ns) -> None:
        """Switch the supply. Everything volatile is lost; straps are read at the next power-on."""

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> bool | None:
        """Characters whose stop bits end at `now` on the serial input pin `port`.

        False: they are for others, nothing has come of them, and what it does next is as it was.
        """

    def set_pin(self, pin: str, level: Level, now: Ns) -> None:
        """An input pin takes a level."""

    def stored(self, ok: bool, now: Ns) -> None:
        """The answer to `StoreImage`, given in the same instant."""

    def next_deadline(self) -> Ns | None:
        """When the device wants to be advanced next, if nothing else happens."""

    def advance(self, now: Ns) -> Ns | None:
        """Do everything that is due up to and including `now`, which is never beyond `next_deadline`.

        Returned is the deadline that is next then, NEVER if there is none; None: `next_deadline` has it.
        """

    def drain(self) -> list[Output]:
        """What the device did since the last call, in order: a list that it does not keep."""

    def watch(self, pin: str) -> None:
        """A wire leads from this pulse output to another device: report its every pulse as `PinSet`."""


@runtime_checkable
class EdgeSensitive(Protocol):
    """What a device has besides if it acts on the edge of an input, and not on its level alone."""

    def take_level(self, pin: str, level: Level, now: Ns) -> None:
        """The wire of an input begins to be driven, or is let go, by a supply: the level is new, and it is no edge."""


class NamedLines(NamedTuple):
    """How lines look of which each is for one unit: its name first, `end` behind it."""

    end: int
    at_once: frozenset[int]  # characters that act wherever they stand


class Named(Protocol):
    """What a device has besides if it hears lines for others, and can be left alone with them."""

    NAMED_LINES: NamedLines

    @property
    def turned_away(self) -> int | None:
        """The name that a line has to begin with before this device does anything; None: it may do something now.

        It is so within a line for somebody else, while nothing is under way, and until something else is done to it, or
        a character is damaged or acts at once: whole lines change nothing here, nor does what is left of this one.
        """

    def line_ended(self) -> None:
        """The line that it was turned away by ended, some time ago; to be told before the next one begins."""


class Controller(Device, Protocol):
    """A device that moves an axis and may hold a program."""

    @property
    def model(self) -> str:
        """Its name in the catalogue."""

    @property
    def pulse_output(self) -> PulseOutput:
        """The pins that carry its step pulses."""

    @property
    def serial_port(self) -> SerialPort:
        """The port towards its host."""

    @property
    def line_format(self) -> Format:
        """How characters look on that port."""

    @property
    def straps(self) -> Mapping[str, Level]:
        """How its straps are tied now; what counts is how they were when they were read."""

    @property
    def axes(self) -> Sequence[str]:
        """The names of its axes; one without a name where it has but one."""

    def status(self, now: Ns, axis: str = "") -> Status:
        """Where an axis is and what the controller does, at `now`; the first axis unless it is named."""

    def cuts(self, now: Ns, axis: str = "") -> Sequence[Stop]:
        """The inputs that, changed at `now`, cut the motion of an axis, or hold its next pulse back.

        What slows down first is none of them; nor is anything at rest, or while the pulse is held already. On a ramp
        it may be otherwise a moment later: what stops without a ramp at low speed needs one at a higher.
        """

    def switches(self, axis: str = "") -> Sequence[str]:
        """The inputs for the switches on the way of an axis: ends of travel, limits, home."""

    def step_inputs(self) -> Sequence[str]:
        """The inputs on which every pulse counts, as they are meant now: each is a step, or a phase of an encoder."""

    def frame(self, text: str) -> bytes:
        """The bytes a host sends for the command line `text`: address, checksum and terminator added.

        Raises ValueError with a remedy where a line cannot be put into bytes.
        """

    def answers(self, data: bytes) -> list[str]:
        """What a host reads in the bytes that came from it: the answers, without what the link adds."""

    def registers(self, now: Ns) -> dict[str, str]:
        """What a debugger shows beside the position, by the letters of the manual: rates, rounds of loops, errors."""

    def program_memory(self) -> bytes:
        """Program memory from its first address on, as `load` takes it; nothing where there is none."""

    def kept_memory(self) -> bytes:
        """Non-volatile memory, as `restore` takes it; nothing where there is none."""

    def restore(self, image: bytes) -> None:
        """Put `image` into non-volatile memory, before the first power-on. Raises `detent.assembler.ImageError`."""

    def load(self, image: bytes, base: int, now: Ns) -> None:
        """Put a program image into program memory from address `base` on, as if a host had sent it.

        Raises `detent.assembler.ImageError`.
        """

    def start(self, now: Ns) -> None:
        """Start the program in memory, as if a host had asked for it."""

    def halt(self, now: Ns) -> None:
        """Stop all axes at once, without ramps, and the program with them, as its most abrupt command does."""

    def displace(self, by: int, now: Ns, axis: str = "") -> None:
        """An axis at rest is found `by` steps from where it was commanded to: all its counters say where it is.

        RuntimeError while it moves.
        """


class Looping(Controller, Protocol):
    """A controller that holds a program, which may turn in a loop for ever."""

    def only_its_program(self, now: Ns) -> bool:
        """Whether nothing is under way in it at `now` but a program that will go on by itself at the next deadline.

        Nothing moves, nothing is being said, and nothing that is over matters any more. What it does from there on
        depends on how it is now, and not on what time it is.
        """

    def postpone(self, by: Ns) -> None:
        """Let its program go on so much later, and whatever this has begun: for a device that does only that."""
