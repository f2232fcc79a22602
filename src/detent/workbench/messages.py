"""What the workbench and the process of its cell tell each other: plain data, which pickle takes as it is.

`Picture` is what never changes while a cell is served, `State` is a look at it, twenty times a second.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

from detent.cell.actions import TimedAction
from detent.cell.moments import Cut
from detent.cell.recording import Batch
from detent.motors.rotor import Floats
from detent.outputs.units import UnitView
from detent.pins import Level
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.endpoints.tcp import TcpAddress
from detent.ticks import Ns
from detent.workbench.waiting import Waits

# -- the picture: what there is to draw -------------------------------------------------------------------------


class PinPicture(NamedTuple):
    """A row of a unit's pin table."""

    name: str
    number: int | None
    kind: str  # the value of `pins.PinKind`: input, strap, output, open collector, winding, serial, bus, supply
    help: str
    rest: Level
    wired: bool  # a wire of the cell leads to it

    @property
    def reads(self) -> bool:
        """Whether a hand can give it a level (`Bench.set_pin`, or `set_strap` for a strap)."""
        return self.kind in ("input", "strap")


class OptionPicture(NamedTuple):
    """A choice that no pin makes, as it was made."""

    name: str
    value: str
    takes: str
    help: str


class UnitPicture(NamedTuple):
    """A unit of the cell."""

    name: str
    model: str
    title: str
    pins: tuple[PinPicture, ...]
    straps: Mapping[str, Level]  # as the cell began; how they are now is in `UnitState.pins`
    options: tuple[OptionPicture, ...]
    axes: tuple[str, ...]  # names of its axes: ("",) for a single one; () for a part that moves nothing
    line: str | None  # the line on which its host speaks to it
    language: bool  # whether it holds programs
    capacity: int  # bytes of program memory; 0 without
    nonvolatile: bool  # whether it can keep a program without supply: `Bench.save`
    file: str = ""  # its program, as the cell file names it


class SwitchPicture(NamedTuple):
    """A switch of the cell, on a panel (`axis` is None) or on an axis."""

    name: str
    drives: tuple[str, ...]  # UNIT.PIN
    axis: str | None  # the unit (UNIT.AXIS), or the motor, whose axis moves the contact
    low: float | None  # as the cell began: from here, to `high`, it has the level `inside`; None: without end
    high: float | None
    inside: Level
    motor: str | None  # the rotor that moves it: then places are distances of that motor


class MotorPicture(NamedTuple):
    """A motor that is fitted."""

    name: str
    motor: str  # its name in the list of motors
    unit: str | None  # whose axis it sits on; None: a wire brings its steps
    axis: str
    lead: float | None  # distance a step; None: places are steps
    full_steps: int  # of a revolution
    steps: float  # of the axis in a revolution
    contacts: tuple[str, ...]  # switches that its rotor moves


class WirePicture(NamedTuple):
    """A wire: from an output, or a switch, to inputs; each UNIT.PIN, MOTOR.PIN or SWITCH."""

    source: str
    targets: tuple[str, ...]


class EndpointPicture(NamedTuple):
    """Where a host connects to a line."""

    kind: str  # pty, tcp, serial
    address: str

    @property
    def again(self) -> EndpointSpec:
        """The same endpoint once more; a pseudo-terminal without a link has another name each time."""
        bare = self.kind == "pty" and self.address.startswith("/dev/pts/")
        return EndpointSpec(self.kind, "" if bare else self.address)


class LinePicture(NamedTuple):
    """A serial line."""

    name: str
    units: tuple[str, ...]
    format: str  # like 9600 7O2
    host: str | None  # the unit that is its host; None: the host is outside, at the endpoints
    kind: str  # serial, microbus, party line or daisy-chain
    endpoints: tuple[EndpointPicture, ...]


class Picture(NamedTuple):
    """Everything there is to draw of a cell, each by its name, in file order."""

    title: str
    target: str  # as it was asked for: a model or a cell file
    units: Mapping[str, UnitPicture]
    switches: Mapping[str, SwitchPicture]
    motors: Mapping[str, MotorPicture]
    wires: tuple[WirePicture, ...]
    lines: Mapping[str, LinePicture]
    reports: tuple[str, ...] = ()  # images that could not be used, pins that are not driven


# -- the state: a look at it ------------------------------------------------------------------------------------


class AxisState(NamedTuple):
    """An axis now."""

    position: int  # by the controller's counter
    shaft: int  # where the pulses given have commanded it, in steps: what `SwitchPicture` places count
    pulses: int  # given since the cell began
    rate: float  # steps/s, with the sign of the direction


class Step(NamedTuple):
    """The instruction that a program has come to."""

    at: Ns
    address: int
    text: str


class Fault(NamedTuple):
    """A frame or command that was turned down: an error latch, until the unit is switched off."""

    at: Ns
    frame: str
    reason: str


class UnitState(NamedTuple):
    """A unit now."""

    powered: bool
    state: str  # a word, like ready or running; "" for a part that is no controller
    axes: Mapping[str, AxisState]
    pins: Mapping[str, Level | None]  # inputs, straps and outputs; None: no supply, no level
    held_pins: frozenset[str]  # inputs to which a hand holds a wire: `Bench.set_pin` with None lets go
    executing: Step | None  # None: no program runs
    registers: Mapping[str, str]  # loop counters, rates and what else the firmware has, as its manual names them
    error: Fault | None
    memory: int  # changes when the program memory does
    image_changed: bool  # the program memory is not what is kept without supply
    stored: int  # how often it has written its non-volatile memory


class SwitchState(NamedTuple):
    """A switch now."""

    level: Level
    low: float | None  # where it is on its axis
    high: float | None


class MotorState(NamedTuple):
    """A motor now."""

    place: float  # of the rotor on its axis, in steps
    command: float  # where the pulses want it
    speed: float  # steps/s
    lost: int  # steps that it has lost: whole cycles of four full steps


class Mark(NamedTuple):
    """A mark on the time line."""

    at: Ns
    kind: str  # error, caution, power, action, breakpoint, stored
    unit: str  # "" where it is the whole cell's
    text: str


class Lateness(NamedTuple):
    """How late events of the cell were served, in ns of the wall clock, since the pace was set."""

    half: int
    most: int  # of 99 %
    worst: int


class RealState(NamedTuple):
    """How real pins stand that are driven."""

    standing: str  # driven, or fault: an axis stands until somebody says recover
    why: str  # of the fault
    slips: int
    stops: int  # by the firmware, so far


class State(NamedTuple):
    """The cell now."""

    now: Ns
    begin: Ns  # of the history that is kept
    end: Ns  # of what has happened; beyond `now` while one looks into the past
    pace: float | None  # times real time; None: as fast as it goes
    held: bool
    stopped_why: str  # why it is held: a breakpoint, an error, by hand; "" while it goes
    lateness: Lateness
    units: Mapping[str, UnitState]
    switches: Mapping[str, SwitchState]
    motors: Mapping[str, MotorState]
    faults: Mapping[int, str]  # that stand, by number, in words
    branches: tuple[tuple[int, Ns, Ns], ...]  # futures that were left: number, where, and how far they had come
    breakpoints: Mapping[str, frozenset[int]]
    break_on_errors: bool
    marks: tuple[Mark, ...]  # in order of time, the last `MOST_MARKS`
    formats: Mapping[str, str]  # how characters look on each line, like 9600 7O2
    speaking: Mapping[str, Ns]  # when the host of each line has said everything that it was given
    dropped: int  # bytes that hosts did not read
    faster: float  # cell time per wall time, measured over the last second
    real: RealState | None = None  # of boards that are driven
    queue: tuple[Waits, ...] = ()  # what is sent when time goes on
    idle: bool = False  # it goes as fast as it can, and nothing is due: its time stands until something is

    @property
    def past(self) -> bool:
        """Whether the cell stands before the end of what has happened. `go`, or any action, drops what lies behind."""
        return self.now < self.end


MOST_MARKS = 500

# -- what goes over the pipe ------------------------------------------------------------------------------------


class Order(NamedTuple):
    """The first message to an engine: what to open. The fields are those of `Bench.open`."""

    target: str
    straps: tuple[str, ...]
    options: tuple[str, ...]
    endpoints: tuple[EndpointSpec, ...]
    pace: float | None
    line_timing: bool
    state_dir: Path | None
    held: bool
    actions: tuple[TimedAction, ...] = ()  # to be done first, each at its time: those of an engine that is gone
    until: Ns = 0  # as far as it had come
    memory: int = 512  # MB, about, that everything may take: what is older than fits is dropped
    placed: Mapping[str, tuple[EndpointSpec, ...]] = {}  # where its lines were served, by name
    real: bool = False  # drive the pins of the boards in the cell file
    queue: tuple[Waits, ...] = ()  # what waited to be sent
    control: TcpAddress | None = None  # where programs look and meddle; port 0: any that is free
    token: str | None = None  # that they have to know


MOVES: Final = frozenset((
    "power", "set_switch", "set_pin", "send_line", "type", "queue_send", "queue_type", "load", "start", "save",
    "recover",
))  # fmt: skip
"""The verbs of the engine that may move a machine."""


class Ask(NamedTuple):
    """The workbench wants the verb `verb` of the engine done."""

    number: int
    verb: str
    arguments: tuple[object, ...]


class Answer(NamedTuple):
    """It is done: what came of it, or why not, in words."""

    number: int
    value: object
    error: str | None = None


class Opened(NamedTuple):
    """The engine is ready, or has begun anew. What happened so far comes as `Happened`."""

    picture: Picture
    sources: Mapping[str, str]  # the texts of the programs that the cell file names, by unit
    views: Sequence[UnitView]
    control: str | None = None  # the URL of who looks and meddles


class Happened(NamedTuple):
    """Batches of the recording, in order, the first of them number `first`; actions; what rotors did."""

    first: int
    batches: Sequence[Batch]
    actions: Sequence[TimedAction]
    rotors: Mapping[str, Floats]  # rows of `rotors`, by motor
    kept: int  # batches before this one are no longer needed


class Marked(NamedTuple):
    """The marks of `State` have changed: it is told without them."""

    marks: tuple[Mark, ...]


class Failed(NamedTuple):
    """The engine could not be opened, or ends by an error: in words, and for somebody who mends it."""

    text: str
    trace: str
    asked_wrongly: bool


Push: TypeAlias = Opened | Happened | Cut | Marked | State | Failed | Answer
