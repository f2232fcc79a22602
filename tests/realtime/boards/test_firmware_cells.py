"""Random cells behind the pins of the stock firmware's process, in real time, with a machine that counts every step.

What each has to keep is what it has to on a fake board (`test_random_cells`). As many as `DETENT_FIRMWARE_CELLS` says.
"""

import os
import select
import time
from collections.abc import Mapping, Sequence
from types import SimpleNamespace

import pytest
from tests.realtime.boards.driven_bench import Bench, no_file
from tests.realtime.boards.firmware_process import MACHINE, TERMINAL, Machine, with_machine
from tests.realtime.boards.random_cells import RandomCell
from tests.realtime.boards.test_random_cells import Session

from detent.cell.build import build
from detent.cell.description import parse
from detent.cell.outside import no_store
from detent.realtime.boards.drive import Opened, RealPins
from detent.realtime.boards.fake.machine import Machine as Pins
from detent.realtime.boards.ports import SerialPort
from detent.realtime.boards.replies import HeldStores
from detent.realtime.boards.states import News
from detent.realtime.loop import Loop
from detent.realtime.pace import Pace
from detent.ticks import SECOND, Ns

pytestmark = with_machine

FIRST = int(os.environ.get("DETENT_FIRMWARE_FIRST", "0"))
CELLS = int(os.environ.get("DETENT_FIRMWARE_CELLS", "8"))


class ProcessPort(SerialPort):
    """The terminal of the process, and what is behind the pins of its board."""

    def __init__(self, machine: Machine) -> None:
        super().__init__(TERMINAL)
        self._machine = machine

    def reopen(self) -> bool:
        """It may have started again."""
        self._machine.begins_anew()
        return super().reopen()


class Side:
    """What a bench has of a fake board, as far as there is such a thing: the process runs by itself."""

    unplugged = False
    board = SimpleNamespace(now=0, gave_up_at="")

    def run_to(self, wall: Ns) -> None:
        """It is there."""


class ProcessPins(Pins):
    """What was seen at the pins of the process: `lines` and `clocks` are those of its setup."""

    def __init__(self, machine: Machine, frequency: int) -> None:
        super().__init__()
        self._machine, self._frequency = machine, frequency
        self.lines: dict[int, str] = {}  # outputs
        self.first: dict[int, bool] = {}  # their levels, before any record
        self.clocks: dict[int, tuple[str, bool, int]] = {}  # step line -> axis, reversed, level of its pulse

    def look(self) -> None:
        """Take what was seen up to now; times are ticks since anything."""
        self.steps.clear()
        self.edges = [(0, name, self.first[line]) for line, name in self.lines.items()]
        levels = dict(self.first)
        for ns, line, level, place in self._machine.records():
            tick = ns * self._frequency // SECOND
            if line in self.lines and levels[line] is not bool(level):
                levels[line] = bool(level)
                self.edges.append((tick, self.lines[line], bool(level)))
            elif line in self.clocks and level == self.clocks[line][2]:
                name, reverse, _ = self.clocks[line]
                self.steps.append((tick, name, -place if reverse else place))
        for line, name in self.lines.items():
            self.outputs[name] = self._machine.output(line)

    def set(self, pin: str, level: bool, tick: int) -> None:
        """An input pin gets a level."""
        self._machine.put(int(pin[4:]), level)


class ProcessBench(Bench):
    """A cell behind the pins of the process, in real time. As `Bench`, and its clock is the process's."""

    glitch = 10_000  # 200 us: it does one thing after the other

    def __init__(self, text: str, switches: Mapping[str, tuple[str, int, int]]) -> None:
        self.process = machine = Machine(MACHINE)
        self.news: list[News] = []
        self._until = 0
        described = parse(text, "cell.toml")
        real = RealPins(self.news.append, lambda _: ProcessPort(machine), machine.wall)
        opened = Opened(described, no_file, real)
        self.plan, self.boards, self.stores = opened.plan, opened.boards, HeldStores(no_store)
        [(name, board)] = self.boards.boards.items()
        pins = ProcessPins(machine, board.frequency)
        self.machines = {name: pins}
        self.ports = {name: Side()}  # type: ignore[dict-item]
        self._wire(pins, switches)
        self.cell = build(described, no_file, store=self.stores.save, line_timing=False, inputs=opened.inputs)
        self.driven = opened.drive(self.cell, self.stores)
        self.pace = Pace(1, origin=self.cell.now, clock=self.driven.clock)
        self.loop = Loop(self.driven, self.pace, [], companion=self.driven, wait=self._wait)
        self.loop._tell = self._hear  # type: ignore[method-assign]
        opened.begin(self.driven, self.pace)
        self.opened = opened
        self.heard: list[list[tuple[Ns, Ns, int]]] = [[] for _ in self.cell.lines]

    def _wire(self, pins: ProcessPins, switches: Mapping[str, tuple[str, int, int]]) -> None:
        [(setup, _)] = self.plan.setups
        self.axes = {stepper.name: (n, stepper) for n, stepper in enumerate(setup.steppers)}
        for n, stepper in self.axes.values():
            step, turn = int(stepper.step.name[4:]), int(stepper.dir.name[4:])
            self.process.axis(n, step, turn, inverted=stepper.step.active_low)
            pins.clocks[step] = stepper.name, stepper.dir.active_low, int(not stepper.step.active_low)
        pins.lines = {int(out.pin.name[4:]): out.pin.name for out in setup.outputs}
        inputs = {put.name: put.pin for put in setup.inputs}
        for number, (name, (axis, low, high)) in enumerate(switches.items()):
            n, stepper = self.axes[axis]
            if stepper.dir.active_low:
                low, high = -high, -low
            self.process.switch(int(inputs[name].name[4:]), low, high, number=number, axis=n,
                                inside=inputs[name].active_low)  # fmt: skip
        self.process.forget()
        pins.first = {line: self.process.output(line) for line in pins.lines}

    @property
    def wall(self) -> Ns:  # type: ignore[override]
        return self.process.wall()

    def _wait(
        self, reading: Sequence[int], writing: Sequence[int], _: Sequence[int], seconds: float | None
    ) -> tuple[list[int], list[int], list[int]]:
        left = max((self._until - self.wall) / SECOND, 0.0)
        return select.select(reading, writing, (), left if seconds is None else min(seconds, left))

    def run(self, span: Ns) -> None:
        self._until = self.wall + span
        while self.wall < self._until:
            self.loop.step()

    def stall(self, span: Ns) -> None:
        time.sleep(span / SECOND)

    def close(self) -> None:
        self.loop.close()
        self.opened.end(self.driven)

    def position(self, stepper: str) -> int:
        number, setup = self.axes[stepper]
        found = self.process.position_of(number)
        return -found if setup.dir.active_low else found

    def look_at_pins(self) -> None:
        """What was seen at them since the beginning."""
        for pins in self.machines.values():
            assert isinstance(pins, ProcessPins)
            pins.look()


class ProcessSession(Session):
    """One of them: what happens to its board is STOP, and somebody recovers it."""

    HAPPENS = ("stopped", "recovered")

    def make_cell(self) -> RandomCell:
        return RandomCell(self.random, most_boards=1, chips=False)

    def make_bench(self) -> Bench:
        return ProcessBench(self.cell.text, self.cell.switches)

    def exposed(self) -> bool:
        return any("Timer too close" in news.text for news in self.bench.news)

    def check(self) -> int:
        assert isinstance(self.bench, ProcessBench)
        self.bench.look_at_pins()
        return super().check()


@pytest.mark.parametrize("seed", range(FIRST, FIRST + CELLS))
def test_nothing_is_lost_on_the_firmware(seed: int) -> None:
    ProcessSession(seed, rough=seed % 2 == 1).run()
