"""Step pulses for real pins: how fast trains become runs of steps, and what driving a board costs.

Processor time, not time of the wall: what else runs here does not count. The board is the fake one, in virtual time;
its own work is not in the figures.
"""

import gc
from collections.abc import Callable
from fractions import Fraction
from statistics import median
from time import process_time, process_time_ns

import numpy as np

from bench.rows import Row, print_table
from detent.axis import MotionStarted
from detent.cell.build import build
from detent.cell.description import parse
from detent.cell.outside import no_store
from detent.outputs.steps import Error, Runs, Scale
from detent.pulses import Accelerating, Train
from detent.ramps import constant_acceleration, tick_accumulator
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.drive import Opened, RealPins
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.machine import Machine, MachineAxis, MachineSwitch
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.frames import Reader, block
from detent.realtime.boards.link import Link
from detent.realtime.boards.replies import HeldStores
from detent.realtime.boards.setup import BoardSetup, Pin, StepperSetup
from detent.realtime.loop import Loop
from detent.realtime.pace import Pace, WallNs
from detent.ticks import MS, SECOND, US, to_fixed

CLOCK = 12_000_000
MILLION = 1e6


def rows() -> list[Row]:
    return [*compression_rows(), *link_rows(), *drive_rows(), *cell_rows(), *stop_rows()]


def _ramps(rate: int) -> Train:
    steps = rate // 20
    up = Accelerating(0, 0, Fraction(rate * rate, steps), 0, steps)
    return Train((up, Accelerating.down_from(up.end, 0, Fraction(rate * rate, steps), steps)))


def _seconds(fn: Callable[[], object], least: float = 0.3) -> float:
    """The median processor time of a call, of as many as take `least` seconds."""
    fn()
    times: list[float] = []
    while sum(times) < least:
        begin = process_time()
        fn()
        times.append(process_time() - begin)
    return median(times)


def compression_rows() -> list[Row]:
    """Steps a second and steps a command; the baseline is their nearest ticks in NumPy, run by run of one step."""
    trains = {
        "ramps 0-100 k": _ramps(100_000),
        "GS-C200 S100 T1000 R1000": constant_acceleration.move(1000, 10_000, 1000, 20_000).train,
        "GenStepper 1-10 k": tick_accumulator.toward(10_000, 0, 62_500_000, 10_000, 20_000, 1000, 20_000).train,
    }
    errors: tuple[Error, ...] = ("exact", 1 * US, 5 * US, 25 * US)
    found = []
    for name, train in trains.items():
        steps = train.steps or 0
        times = train.times()
        plain = steps / _seconds(lambda times=times: np.diff(times * CLOCK // SECOND).tolist()) / MILLION  # type: ignore[misc]
        for error in errors:
            scale = Scale(CLOCK)
            runs = Runs(train, scale, error, -1).take()
            speed = steps / _seconds(lambda t=train, e=error: Runs(t, Scale(CLOCK), e, -1).take()) / MILLION  # type: ignore[misc]
            label = f"{name}, {error if error == 'exact' else f'{error // US} us'}"
            found.append(Row(label, speed, "Msteps/s", "nearest ticks, NumPy", plain, 0.2))
            found.append(Row(f"{label}: steps a command", steps / len(runs), "", "one by one", 1, None))
    return found


def link_rows() -> list[Row]:
    """Messages of 10 bytes through the link and back as acknowledgements."""
    message, count = bytes(10), 20_000

    def through() -> None:
        link, reader, sequence = Link(), Reader(), 0
        link.sync(0)
        link.take()
        link.receive(block(0, b""), 0)
        for n in range(count):
            link.send(message)
            if n % 5 == 4:
                link.flush(n)
                for found in reader.feed(link.take()):
                    sequence = (found.sequence + 1) & 15
                    link.receive(block(sequence, b""), n)

    def frames() -> None:
        for _ in range(count // 5):
            block(0, message * 5)

    kilo = count / 1000
    return [
        Row("messages through the link", kilo / _seconds(through), "k/s", "blocks alone", kilo / _seconds(frames), 20)
    ]


class _Driven:
    """One axis on a fake board in virtual time; the host's own processor time is counted."""

    def __init__(self) -> None:
        self.wall = 0
        steppers = (StepperSetup("slide", Pin("gpio2"), Pin("gpio3")),)
        fake = FakeBoard(moves=512)
        fake.kept_log = False
        self.port = FakePort(fake)
        self.boards = Boards([(BoardSetup("board", steppers=steppers), self.port)])
        self.boards.start(0)
        while not self.boards.ready:
            self.turn()
        self.boards.steppers["slide"].adopt(0)
        self.boards.align(0, self.boards.ns_at(self.wall))
        self.spent, self.commits = 0, list[int]()

    def turn(self) -> None:
        self.wall += MS
        self.port.run_to(self.wall)
        began = process_time_ns()
        self.boards.due(self.wall)
        self.spent = getattr(self, "spent", 0) + process_time_ns() - began

    def move(self, train: Train) -> None:
        now = self.boards.cell_at(self.wall)
        self.boards.steppers["slide"].tell(MotionStarted(now, train.shifted(to_fixed(now)), 1, 1, 0))

    def run(self, time: int) -> None:
        for n in range(time // MS):
            self.turn()
            if n % 2:
                began = process_time_ns()
                self.boards.commit(self.boards.cell_at(self.wall), self.wall)
                self.commits.append(process_time_ns() - began)
                self.spent += self.commits[-1]
            self.boards.events()


def drive_rows() -> list[Row]:
    """The host's share of a core at a rate, and what a commit takes; the baseline is the board at rest."""
    resting = _Driven()
    resting.run(2 * SECOND)
    idle = 100 * resting.spent / (2 * SECOND)
    found = []
    for rate in (1000, 10_000, 30_000):
        driven = _Driven()
        driven.move(constant_acceleration.move(rate, rate, 1, None).train)
        driven.run(2 * SECOND)
        share = 100 * driven.spent / (2 * SECOND)
        found.append(Row(f"processor at {rate} steps/s", share, "%", "at rest", idle, 15 if rate == 10_000 else None))
        if rate == 10_000:
            often, rare = median(driven.commits) / MS, sorted(driven.commits)[-len(driven.commits) // 100] / MS
            rest = median(resting.commits) / MS
            found.append(Row("a commit at 10 kHz, half of them", often, "ms", "at rest", rest, 0.2))
            found.append(Row("a commit at 10 kHz, 99 % of them", rare, "ms", "at rest", rest, None))
    return found


class _Wire(FakePort):
    """A fake board that wakes its host with what it says alone, as a real one does; what it takes itself is counted."""

    spent = 0

    def deadline(self) -> WallNs | None:
        times = [at for at, _ in [*self._to_host][:1]] + [at + 3 * self._delay for at, _ in [*self._to_board][:1]]
        return min(times, default=None)

    def receive(self, wall: WallNs) -> bytes:
        began = process_time_ns()
        data = super().receive(wall)
        self.spent += process_time_ns() - began
        return data

    def send(self, data: bytes, wall: WallNs) -> None:
        began = process_time_ns()
        super().send(data, wall)
        self.spent += process_time_ns() - began


class _Cell:
    """A whole cell behind a board, served by its loop in virtual time."""

    def __init__(self, text: str) -> None:
        self.now, self._until = SECOND, 0
        fake = FakeBoard(Machine({"x": MachineAxis("gpio2", "gpio3")}), moves=512)
        fake.kept_log = False
        self.port = _Wire(fake)
        real = RealPins(lambda news: None, lambda address: self.port, lambda: self.now, self._sleep)
        opened = Opened(parse(text, "cell.toml"), str, real)
        stores = HeldStores(no_store)
        self.cell = build(parse(text, "cell.toml"), str, store=stores.save, inputs=opened.inputs)
        self.driven = opened.drive(self.cell, stores)
        pace = Pace(clock=self.driven.clock)
        self.loop = Loop(self.driven, pace, [], companion=self.driven, wait=self._wait)
        opened.begin(self.driven, pace)

    def _sleep(self, _: object, __: object, seconds: float) -> tuple[list[int], list[int]]:
        self.now += max(round(seconds * SECOND), 10 * US)
        return [], []

    def _wait(
        self, _: object, __: object, ___: object, seconds: float | None
    ) -> tuple[list[int], list[int], list[int]]:
        left = self._until - self.now
        self.now += max(10 * US, left if seconds is None else min(round(seconds * SECOND) + 60 * US, left))
        return [], [], []

    def run(self, span: int) -> float:
        """Serve for so long: the host's share of a core in percent."""
        self._until, self.port.spent, began = self.now + span, 0, process_time_ns()
        while self.now < self._until:
            self.loop.step()
        return 100 * (process_time_ns() - began - self.port.spent) / span

    def type(self, line: str) -> None:
        self.run(200 * MS)
        self.driven.send(0, self.cell.serial_unit("x").frame(line))
        self.run(200 * MS)


def cell_rows() -> list[Row]:
    """The share of a core that a whole driven cell takes at 10 kHz, loop, wire and all; the baseline is it at rest."""
    hardware = (
        '[boards.b]\nserial = "fake:"\n[hardware.x]\nboard = "b"\nstep = "gpio2"\ndir = "gpio3"\nenable = "gpio4"\n'
    )
    cells = {
        "gs-c200": (hardware + 'outputs = { MOV = "gpio5" }\ninputs = { EOT = "^gpio10", HOME = "^gpio11" }\n',
                    ("S10", "T1000", "R100", "+200000")),
        "dcb-274": (hardware + 'inputs = { LIMIT-A = "^gpio10", LIMIT-B = "^gpio11", HOME = "^gpio12" }\n',
                    (" ", "M 10000")),
    }  # fmt: skip
    found = []
    for model, (text, lines) in cells.items():
        made = _Cell(f'[units.x]\nmodel = "{model}"\n{text}')
        idle = made.run(2 * SECOND)
        for line in lines:
            made.type(line)
        made.run(SECOND)
        share = median(made.run(SECOND) for _ in range(5))
        found.append(Row(f"a whole {model} cell at 10 kHz", share, "%", "at rest", idle, 15))
        made.loop.close()
    return found


def stop_rows() -> list[Row]:
    """How long it takes to take a homing cell back to a stop in the firmware; the baseline is a copy of the cell."""
    text = """
[units.x]
model = "gs-c200"
[boards.b]
serial = "fake:"
[hardware.x]
board = "b"
step = "gpio2"
dir = "gpio3"
inputs = { EOT = "^gpio10", HOME = "^gpio11" }
"""
    taken: list[float] = []
    copies: list[float] = []
    gc.freeze()  # as `serve` does: what other benchmarks left is no part of it
    for end in range(20, 40):
        machine = Machine({"x": MachineAxis("gpio2", "gpio3")}, [
            MachineSwitch("x", "gpio10", end, 10_000, False), MachineSwitch("x", "gpio11", -10_000, end - 10, False),
        ])  # fmt: skip
        port, now = FakePort(FakeBoard(machine, moves=400)), [SECOND]

        def sleep(_: object, __: object, seconds: float, now: list[int] = now) -> tuple[list[int], list[int]]:
            now[0] += max(round(seconds * SECOND), 10 * US)
            return [], []

        real = RealPins(lambda news: None, lambda address, port=port: port, lambda now=now: now[0], sleep)  # type: ignore[misc]
        opened = Opened(parse(text, "cell.toml"), str, real)
        stores = HeldStores(no_store)
        cell = build(parse(text, "cell.toml"), str, store=stores.save, line_timing=False, inputs=opened.inputs)
        driven = opened.drive(cell, stores)
        opened.begin(driven, Pace(clock=driven.clock))
        driven.send(0, cell.serial_unit("x").frame("H+"))
        while driven.rollback.rewinds < 2:
            now[0] += 500 * US
            driven.run_to(driven.boards.cell_at(now[0]))
            before, begin = driven.rollback.rewinds, process_time()
            driven.serve()
            if driven.rollback.rewinds > before:
                taken.append(process_time() - begin)
                begin = process_time()
                cell.copy()
                copies.append(process_time() - begin)
    base, name = median(copies) / MS * SECOND, "a copy of the cell"
    worst = max(taken) / MS * SECOND
    gc.unfreeze()
    return [
        Row("a stop takes the cell back, half of them", median(taken) / MS * SECOND, "ms", name, base, 6),
        Row("a stop takes the cell back, the longest", worst, "ms", name, base, 6),
    ]


if __name__ == "__main__":
    print_table(rows())
