"""A bench in virtual time: boards, what is behind them, and an axis of a cell, without any waiting."""

from collections.abc import Callable, Sequence
from random import Random
from typing import Any, TypeVar

from detent.axis import Axis, MotionCut, MotionEnded, MotionStarted
from detent.pulses import Train
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.events import Event, Ready, Stopped
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.machine import Machine, MachineAxis, MachineSwitch
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.setup import BoardSetup, InputSetup, OutputSetup, Pin, StepperSetup
from detent.ticks import MS, SECOND, Ns, to_fixed

E = TypeVar("E")

SLIDE = StepperSetup("slide", Pin("gpio2"), Pin("gpio3"))
EOT = InputSetup("EOT", Pin.parse("^gpio10"))
HOME = InputSetup("HOME", Pin.parse("!gpio11"))
MOV = OutputSetup("MOV", Pin("gpio6"))
ENABLE = OutputSetup("ENABLE", Pin.parse("!gpio4"), watchdog=2 * SECOND)


def setup(name: str = "left", **changes: Any) -> BoardSetup:
    """A board with an axis, two inputs and two outputs."""
    parts: dict[str, Any] = {"steppers": (SLIDE,), "outputs": (MOV, ENABLE), "inputs": (EOT, HOME)}
    return BoardSetup(name, **{**parts, **changes})


def slide(*switches: MachineSwitch, pin: str = "gpio2", direction: str = "gpio3") -> Machine:
    """A machine with the axis of `setup`."""
    return Machine(axes={"slide": MachineAxis(pin, direction)}, switches=list(switches))


class Bench:
    """Boards and their wall clock, which goes where it is told. Cell time begins when all are ready."""

    def __init__(self, boards: Sequence[tuple[BoardSetup, FakePort]], *, start: bool = True) -> None:
        self.wall: Ns = 1_000 * SECOND
        self.boards = Boards(boards)
        self.ports = [port for _, port in boards]
        self.events: list[Event] = []
        self.axes: dict[str, Axis] = {}
        self.told: dict[str, list[MotionStarted | MotionCut | MotionEnded]] = {}
        self.did: dict[str, list[MotionStarted | MotionCut | MotionEnded]] = {}
        self.now: Ns = 0
        self.stride: Ns = 2 * MS
        self.aligned = False
        if start:
            self.boards.start(self.wall)
            self.until(lambda: self.boards.ready)
            self.align()

    def align(self) -> None:
        """The cell begins."""
        for name, stepper in self.boards.steppers.items():
            self.axes[name] = Axis(self.told.setdefault(name, []))
            stepper.adopt(0)
        self.boards.align(self.now, self.boards.ns_at(self.wall))
        self.aligned = True

    @property
    def board(self) -> FakeBoard:
        """The fake behind the first board."""
        return self.ports[0].board

    @property
    def machine(self) -> Machine:
        """What is behind it."""
        return self.board.machine

    def turn(self, wall: Ns) -> None:
        """Everything at `wall`: what came, the cell, what leaves."""
        self.wall = max(self.wall, wall)
        self.boards.due(self.wall)
        self.hear()
        if self.aligned:
            self.now = max(self.now, self.boards.cell_at(self.wall))
            self.live()
            self.boards.commit(self.now, self.wall)
        self.hear()

    def hear(self) -> None:
        """What came; what was late is told once more, as the owner of a stepper has to."""
        events = self.boards.events()
        self.events += events
        for event in events:
            if isinstance(event, Stopped) and event.dry:
                stepper = self.boards.steppers[event.stepper]
                stepper.rewind(event.shaft, slipped=True)
                did = self.did.get(event.stepper, [])
                begun = [n for n, e in enumerate(did) if isinstance(e, MotionStarted) and e.at <= max(event.dry)]
                for entry in did[begun[-1] :]:
                    stepper.tell(entry)

    def live(self) -> None:
        """The axes run to now, and what they did is told."""
        for name, axis in self.axes.items():
            while axis.deadline <= self.now:
                axis.advance(axis.deadline)
            told = self.told[name]
            for entry in told:
                self.boards.steppers[name].tell(entry)
            self.did.setdefault(name, []).extend(told)
            told.clear()

    def step(self) -> None:
        """To whatever is next, at most a stride on."""
        times = [at for at in (self.boards.deadline(), self.boards.commit_at()) if at is not None]
        self.turn(max(min([*times, self.wall + self.stride]), self.wall + 1000))

    def run(self, time: Ns) -> None:
        """For so long."""
        end = self.wall + time
        while self.wall < end:
            self.step()

    def until(self, done: Callable[[], bool], most: Ns = 20 * SECOND) -> None:
        """Until something is so."""
        end = self.wall + most
        while not done():
            assert self.wall < end, f"it never came to it: {self.events}"
            self.step()

    def move(self, train: Train, direction: int, name: str = "slide") -> None:
        """A motion begins now; the train is relative to it."""
        steps = train.steps
        marks = () if steps is None else (steps,)
        self.axes[name].start(train.shifted(to_fixed(self.now)), direction, marks, self.now)

    def rest(self, name: str = "slide", most: Ns = 60 * SECOND) -> None:
        """Until the motion is over, at the pins too."""
        self.until(lambda: not self.axes[name].moving, most)
        self.run(self.boards.lead + self.boards.steppers[name].lag + 100 * MS)
        self.until(lambda: not self.boards.steppers[name].proving, most)

    def of(self, kind: type[E]) -> list[E]:
        """The events of one kind."""
        return [event for event in self.events if isinstance(event, kind)]


def bench(
    *switches: MachineSwitch, board: dict[str, Any] | None = None, port: dict[str, Any] | None = None,
    start: bool = True, **changes: Any,
) -> Bench:  # fmt: skip
    """One board with an axis, and a machine behind it."""
    fake = FakeBoard(slide(*switches), **(board or {}))
    made = Bench([(setup(**changes), FakePort(fake, **(port or {})))], start=start)
    if start:
        assert [type(event) for event in made.events] == [Ready]
    return made


def lossy(random: Random, chance: float) -> Callable[[bytes, bool], list[bytes]]:
    """What a bad wire does to so many of the pieces: they are lost, doubled, or damaged."""

    def spoil(data: bytes, to_board: bool) -> list[bytes]:
        what = random.random()
        if what > chance:
            return [data]
        if what < chance / 3:
            return []
        if what < chance * 2 / 3:
            return [data, data]
        place = random.randrange(len(data))
        return [data[:place] + bytes([data[place] ^ 1 << random.randrange(8)]) + data[place + 1 :]]

    return spoil
