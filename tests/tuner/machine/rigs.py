"""A cell with a rotor and a witness, and a driver in its virtual time."""

from collections.abc import Callable, Iterable
from typing import Any

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.cell.mechanics import Mechanics
from detent.hosts.exchange import Blocking
from detent.moves.spelling import read
from detent.realtime.connect import connect
from detent.tuner.machine.bench import bench
from detent.tuner.machine.carriage import Room
from detent.tuner.machine.session import Plan, Record, Result, run

GSC200S = """
[units.axis]
model = "gs-c200s"
straps = {{ CHS = "low" }}
[motors.slide]
motor = "qsh4218-41-10-035"
unit = "axis"
supply = 24
load = {{ inertia = 1.5e-5, friction = 0.02, viscous = {viscous} }}
[switches.home]
axis = "slide"
{where}
drives = {drives}
[switches.power]
drives = "slide.ENABLE"
level = 1
{more}
"""
TIED = '["axis.HOME", "axis.EOT", "axis.UI1"]'
ROOM = Room(travel=1200, behind=60, turn=8, rate=200)


class Watched(HostPort):
    """Looks where the rotor is whenever the host does anything."""

    def __init__(self, cell: Cell, rotor: Mechanics | None) -> None:
        super().__init__(cell)
        self.rotor = rotor
        self.seen = [0.0]

    def look(self) -> None:
        if self.rotor is not None:
            self.seen.append(self.rotor.place(self.cell.now))

    def receive(self, timeout: float) -> bytes:
        data = super().receive(timeout)
        self.look()
        return data

    def wait(self, seconds: float) -> None:
        super().wait(seconds)
        self.look()


class Bed:
    """A unit of a cell with its bench and the records of its run; `on` is done at the beginning of that trial."""

    def __init__(self, cell: Cell, model: str = "gs-c200s", witness: str = "UI1", **options: Any) -> None:
        self.cell = cell
        self.port = Watched(cell, self.motor() if "slide" in cell.wiring.names else None)
        self.shell: Blocking = connect(model, self.port, **options)
        self.law = read(model, [])[0]
        self.bench = bench(self.law, self.shell.driver, witness)  # type: ignore[arg-type]
        self.records: list[Record] = []
        self.on: dict[int, Callable[[], object]] = {}
        self.zeros: list[tuple[int, int]] = []  # from when on which count is the reference

    def record(self, record: Record) -> None:
        self.records.append(record)
        if record["kind"] == "reference":
            self.zeros.append((self.cell.now, record["counts"][-1]))
        if record["kind"] == "begins":
            self.on.pop(record["number"], lambda: None)()

    def plan(self, *settings: str, moves: tuple[int, ...] = (200,), room: Room = ROOM, **more: Any) -> Plan:
        law, begin = read(self.law.model, settings)
        return Plan(law, begin, moves, room, **more)

    def run(self, plan: Plan, past: Iterable[Record] = ()) -> Result:
        self.records = []
        if not past:
            self.records.append(plan.recorded(self.bench))
        found: Result = self.shell.perform(run(plan, self.bench, self.record, past))
        return found

    def motor(self, name: str = "slide") -> Mechanics:
        part = self.cell.parts[self.cell.wiring.names.index(name)]
        assert isinstance(part, Mechanics)
        return part

    def kinds(self) -> list[str]:
        return [record["kind"] for record in self.records]

    def pulsed(self, unit: str = "axis") -> tuple[int, int]:
        """The least and the largest place that pulses led to, each against the reference of its time."""
        assert self.cell.recording is not None
        places = []
        for span in self.cell.recording.motion(unit, self.cell.now):
            ends = [span.shaft + span.direction * n for n in (span.first, span.last)]
            began = span.train.time_of(span.first)
            zero = next((zero for at, zero in reversed(self.zeros) if at <= began), None)
            if zero is not None:
                places += [end - zero for end in ends]
        return min(places, default=0), max(places, default=0)

    def stays_within(self, room: Room, unit: str = "axis") -> None:
        """The rotor, and the pulses, were never out of the room."""
        least, most = self.pulsed(unit)
        assert -room.behind <= least
        assert most <= room.travel
        home = 4.0  # where the witness of these cells closes
        assert home - room.behind <= min(self.port.seen)
        assert max(self.port.seen) <= home + room.travel

    def trials(self) -> list[Record]:
        return [record for record in self.records if record["kind"] == "trial"]


def made(text: str) -> Cell:
    return build(parse(text, "cell.toml"), lambda _: "", record=True, line_timing=True)


def gsc200s(viscous: float = 2e-3, where: str = "to = 4.0", drives: str = TIED, more: str = "", **options: Any) -> Bed:
    """A motor with a belt behind a GS-C200S: half steps, 24 V, home switch on HOME, EOT and UI1."""
    text = GSC200S.format(viscous=viscous, where=where, drives=drives, more=more)
    return Bed(made(text), checksums=False, **options)
