"""A cell behind ideal boards, served by the loop itself in virtual time; and the same cell with ideal switches."""

from collections.abc import Callable
from typing import Any

from tests.realtime.boards.ideal import EPOCH, IdealBoards

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.delivery import Store, no_store
from detent.cell.description import parse
from detent.realtime.boards.driven import Driven
from detent.realtime.boards.plan import plan
from detent.realtime.boards.replies import HeldStores
from detent.realtime.boards.states import News
from detent.realtime.loop import Loop
from detent.realtime.pace import Pace
from detent.ticks import US, Ns


def no_file(name: str) -> str:
    raise FileNotFoundError(name)


class Bench:
    """`text` is a cell file. `hosts` hear what its lines say, with the board's time at which they heard it."""

    def __init__(
        self,
        text: str,
        *,
        store: Store = no_store,
        line_timing: bool = False,
        machine: dict[str, Callable[[dict[str, Any]], bool]] | None = None,
        latency: Ns = 500 * US,
        jitter: Callable[[], Ns] = lambda: 0,
    ) -> None:
        self.wall = EPOCH + 5_000_000_000
        self.jitter = jitter
        described = parse(text, "cell.toml")
        trial = build(described, no_file, record=False)
        self.plan = plan(described, trial.controllers())
        self.boards = IdealBoards(self.plan, lambda: self.wall, latency=latency)
        self.boards.machine = machine or {}
        self.boards.look(0)
        inputs = {name: int(self.boards.levels[name]) for name in self.plan.inputs}
        self.stores = HeldStores(store)
        given = {self.plan.inputs[name]: level for name, level in inputs.items()}
        self.cell: Cell = build(described, no_file, store=self.stores.save, line_timing=line_timing, inputs=given)
        self.boards._mail.clear()  # noqa: SLF001  # what was read at the start
        self.news: list[News] = []
        self.driven = Driven(self.cell, self.boards, self.plan, self.stores, wall=lambda: self.wall,  # type: ignore[arg-type]
                             tell=self.news.append)  # fmt: skip
        self.pace = Pace(1, origin=self.cell.now, clock=self.driven.clock)
        self.loop = Loop(self.driven, self.pace, [], companion=self.driven, wait=self._wait)
        self.loop._tell = self._hear  # type: ignore[method-assign]  # noqa: SLF001
        self.driven.begin(self.pace, inputs)
        self.heard: list[list[tuple[Ns, Ns, int]]] = [[] for _ in self.cell.lines]  # board time, cell time, value
        self._until = self.wall

    def close(self) -> None:
        self.loop.close()

    def _wait(self, readers: object, writers: object, _: object, seconds: float | None) -> tuple[list[int], ...]:
        left = self._until - self.wall
        sleep = left if seconds is None else min(round(seconds * 1e9) + 1, left)
        self.wall += max(sleep, 10 * US) + self.jitter()
        return [], [], []

    def run(self, span: Ns) -> None:
        """Let so much wall time pass."""
        self._until = self.wall + span
        while self.wall < self._until:
            self.loop.step()

    def _hear(self, _: int) -> None:
        for number, line in enumerate(self.driven.lines):
            for heard in line.take():
                self.heard[number].append((self.boards.board_now(), heard.at, heard.char.value))

    def type(self, unit: str, text: str) -> None:
        """The host of a unit sends a line, now: when the cell is at its present."""
        self.send(unit, self.cell.talker(unit).frame(text))

    def send(self, unit: str, data: bytes) -> None:
        self.loop._catch_up()  # noqa: SLF001
        self.driven.send(self.cell.wiring.line_of[self.cell.unit(unit)], data)

    def said(self, unit: str) -> str:
        line = self.cell.wiring.line_of[self.cell.unit(unit)]
        return "".join(chr(value & 127) for _, _, value in self.heard[line])

    def stall(self, span: Ns) -> None:
        """The computer is elsewhere."""
        self.wall += span

    def edges(self, stepper: str) -> list[tuple[Ns, int]]:
        """The steps on the pins so far: cell time at which the cell has them, and the position behind each."""
        self.boards.live()
        return [(cell, position) for _, _, position, cell in self.boards.steppers[stepper].edges]
