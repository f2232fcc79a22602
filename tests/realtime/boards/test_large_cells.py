"""Large cells behind up to four boards, meddled with by everything that a control port offers: nothing is lost."""

from collections.abc import Callable
from functools import partial
from random import Random
from typing import Any

import pytest
from tests.generated import seeds
from tests.realtime.boards.random_cells import RandomCell
from tests.realtime.boards.test_random_cells import Session

from detent.cell.faults import Fault, OnLine, StuckPin, SupplyDip, WriteFailure
from detent.lines.faults import BitErrors, CableOut, Delay, LineFault, LostCharacters
from detent.ticks import MS

WAYS = ("units", "host", "both")


def line_fault(random: Random) -> LineFault:
    towards = random.choice(WAYS)
    return random.choice([
        BitErrors(towards, rate=0.01, seed=random.randrange(99)), LostCharacters(towards, rate=0.05),
        Delay(random.randrange(1, 30) * MS, towards), CableOut(towards),
    ])  # fmt: skip


class Large(Session):
    """Three to six units of any kind, on lines of their own or together."""

    def make_cell(self) -> RandomCell:
        return RandomCell(self.random, rich=True, large=True)


class Meddled(Large):
    """Units are started and halted, lines and pins and supplies break and are mended, while hosts and hands go on."""

    def live(self) -> None:
        say = self.cell.say

        def say_and_meddle(bench: Any) -> None:
            say(bench)
            if self.random.random() < 0.35:
                self.meddle()

        self.cell.say = say_and_meddle  # type: ignore[method-assign]
        super().live()
        self.do(self.mend)
        self.bench.run(400 * MS)

    def do(self, what: Callable[[], object]) -> None:
        """At the present of the cell, as whoever serves it does; what is refused changes nothing."""
        asked = self.bench.loop.ask(what)
        self.bench.loop._do_asked()
        asked.exception()
        self.bench.driven.run_to(self.bench.driven.now)

    def mend(self) -> None:
        for fault in list(self.bench.cell.faults.standing):
            self.bench.cell.mend(fault)

    def meddle(self) -> None:
        random, cell = self.random, self.bench.cell
        unit, _ = random.choice(self.cell.units)
        spare = [
            pin.name for pin in cell.controller(unit).pins if (unit, pin.name) not in self.bench.plan.inputs.values()
        ]
        faults: list[Fault] = [
            OnLine(random.randrange(len(cell.lines)), line_fault(random)), SupplyDip(unit), WriteFailure(unit, 2),
            StuckPin(unit, random.choice(spare), random.randrange(2)),
        ]  # fmt: skip
        fault, lasting = random.choice(faults), random.choice([1, 20, 200, 400]) * MS
        self.do(random.choice([
            partial(cell.start, unit), partial(cell.halt, unit), self.mend, partial(cell.breaks, fault, lasting),
            partial(cell.breaks, fault, lasting),
        ]))  # fmt: skip


@pytest.mark.parametrize("rough", [False, True])
@pytest.mark.parametrize("kind", [Large, Meddled])
def test_nothing_is_lost_in_large_cells_and_those_that_are_meddled_with(kind: type[Session], rough: bool) -> None:
    for seed in seeds(12):
        kind(seed, rough=rough, rich=True).run()


@pytest.mark.slow
@pytest.mark.parametrize("rough", [False, True])
@pytest.mark.parametrize("kind", [Large, Meddled])
def test_nothing_is_lost_in_many_more_of_them(kind: type[Session], rough: bool) -> None:
    assert sum(kind(seed, rough=rough, rich=True).run() for seed in range(1000, 1080)) > 100


def test_a_bad_wire_loses_nothing_in_large_cells() -> None:
    for seed in seeds(6):
        Large(seed, rough=False, rich=True, loss=0.01).run()
