"""Any cell behind any boards, and everything at once: hosts, hands, switches, late computers, boards that fail.

At the end each motor is where the cell has it, or is said not to be known; every input is in the cell as on its board,
and every output on its pin as in the cell; no axis has passed its limits, and none is at fault without a reason.
"""

from collections.abc import Sequence
from random import Random
from typing import Any

import pytest
from tests.generated import seeds
from tests.realtime.boards.bench import lossy
from tests.realtime.boards.driven_bench import Bench
from tests.realtime.boards.random_cells import RandomCell
from tests.realtime.boards.test_stalls import EXPOSED

from detent.realtime.boards.states import Severity, Standing
from detent.ticks import MS, SECOND, US, Ns


class Session:
    """One of them. `rough`: boards are unplugged, restarted, stopped by hand and recovered, too (`HAPPENS`)."""

    HAPPENS: Sequence[str] = ("unplugged", "restarted", "stopped", "recovered", "recovered")

    def __init__(self, seed: int, *, rough: bool, loss: float = 0.0, rich: bool = False) -> None:
        """`loss`: so many of the pieces on the wire are lost, doubled or damaged.

        `rich`: as a `RandomCell` takes it, and the wire stands now and then while the computer goes on.
        """
        self.random, self.rough, self.loss, self.rich = Random(seed), rough, loss, rich
        self.cell = self.make_cell()
        self.befallen, self.stalled, self.restarted = False, False, set[str]()
        self.away, self.late = 0.0, False
        self.bench = self.make_bench()
        if rich and self.random.random() < 0.4:
            for port in self.bench.ports.values():
                port.hold = self.stand
        self.kept = self.random.random() < 0.3
        if self.kept:
            self.bench.keep()

    def make_cell(self) -> RandomCell:
        return RandomCell(self.random, rich=self.rich)

    def make_bench(self) -> Bench:
        random = self.random
        self.away = random.choice([0.0, 0.0, 0.001, 0.003])
        jitter = random.choice([50, 400, 400, 1000 if self.cell.lead == 5 else 3000]) * US

        def away(_: bool) -> Ns:
            return random.randrange(90 * MS) if self.late and random.random() < self.away else 0

        boards: dict[str, Any] = {}
        if self.rich:
            boards["frequency"] = random.choice([8, 16, 48, 72, 180, 520]) * 1_000_000
            boards["moves"] = random.choice([40, 64, 400, 1024])
            ticks = 0, (1 << 31) - 1000, (1 << 32) - 50_000_000, random.randrange(1 << 36)
            boards["first_tick"] = random.choice(ticks)
            # little room, a short lead and a slow wire together: what is late makes the next late, without end
            boards["window"] = random.choice([None, 128 if self.cell.lead > 5 else 192, 192])
            boards["pins"] = 128
        spoil = lossy(Random(random.random()), self.loss) if self.loss else None
        line_timing = self.rich and random.random() < 0.5
        return Bench(
            self.cell.text, switches=self.cell.switches, jitter=lambda: random.randrange(jitter), away=away,
            spare_exposed=True, chips=True, board=boards, read=self.cell.files.__getitem__, line_timing=line_timing,
            port={
                "drift": random.choice([0.0, 60.0, -90.0]), "delay": random.choice([30, 100, 800]) * US, "spoil": spoil,
            },
        )  # fmt: skip

    def stand(self) -> Ns:
        """For how long a wire stands."""
        stands = self.late and self.random.random() < 0.004
        self.stalled = self.stalled or stands
        return self.random.randrange(90 * MS) if stands else 0

    def exposed(self) -> bool:
        """Whether a stall longer than the lead has shut a board down: no host can help that."""
        return any(port.board.gave_up_at in EXPOSED for port in self.bench.ports.values())

    def befall(self) -> None:
        """Something happens to a board, or somebody recovers what stands."""
        bench, random = self.bench, self.random
        self.late, self.befallen = False, True
        board = random.choice(list(bench.ports))
        match random.choice(self.HAPPENS):
            case "unplugged":
                bench.ports[board].unplugged = True
                bench.run(random.choice([60, 1200]) * MS)
            case "restarted" if not bench.ports[board].unplugged:
                bench.ports[board].board.power_cycle()
                self.restarted.add(board)
                bench.run(1200 * MS)
            case "stopped":
                bench.driven.stop()
                bench.run((130 if self.rich else 30) * MS)  # the wire may stand
                there = [s for s in self.cell.steppers if not bench.ports[bench.boards.home[s]].unplugged]
                stood = [bench.position(axis) for axis in there]
                bench.run(100 * MS)
                assert [bench.position(axis) for axis in there] == stood
            case "recovered":
                bench.come_back()
        self.late = True

    def switch_off_and_on(self) -> None:
        """Somebody switches a unit."""
        unit, _ = self.random.choice(self.cell.units)
        self.bench.power(unit, False)
        self.bench.run(self.random.randrange(300 * MS) + 1)
        self.bench.power(unit, True)
        self.bench.run(self.random.randrange(600 * MS) + 1)

    def tap(self) -> None:
        """Somebody touches an input, for some milliseconds or for good."""
        bench, random = self.bench, self.random
        pin = random.choice(self.cell.hands)
        level = random.randrange(2) if random.random() < 0.2 else 0
        bench.press(pin, level)
        bench.run(random.randrange(2 * MS, random.choice([6, 40, 120]) * MS))
        if random.random() < 0.85:
            bench.press(pin, 1 - level)
        bench.run(random.randrange(5 * MS) + 1)

    def live(self) -> None:
        """What happens."""
        bench, random = self.bench, self.random
        bench.run(400 * MS)
        for pin in self.cell.hands:
            if random.random() < 0.9:
                bench.press(pin, 1)
        bench.run(60 * MS)
        for unit, model in self.cell.units:
            if model == "dcb-274":
                bench.type(unit, " ")
                bench.run(100 * MS)
        self.late = True
        for _ in range(random.randrange(4, 16)):
            if random.random() < 0.75:
                self.cell.say(bench)
            span = random.choice([60 * MS, 1 * MS, 8 * MS, 200 * MS, 900 * MS])
            bench.run(random.choice([span, random.randrange(span)]) + 1)
            if random.random() < 0.12:
                bench.stall(random.randrange(5 * MS, 120 * MS))
                self.stalled = True
            if random.random() < 0.04:
                self.switch_off_and_on()
            if self.rough and random.random() < 0.15:
                self.befall()
            for _ in range(random.randrange(3) if self.cell.hands else 0):
                self.tap()
        self.late = False

    def check(self) -> int:
        """That nothing is lost or hidden; how many stops there were."""
        bench, cell = self.bench, self.cell
        bench.check_inputs()
        bench.check_outputs()
        bench.check_drivers(late=self.away > 0)
        if self.kept and not self.befallen and not bench.driven.rollback.rewinds:
            bench.check_levels(late=self.away > 0 or self.stalled)
            if not self.away and not self.stalled:
                bench.check_microsteps()
        assert bench.driven.rollback.escaped == 0 or cell.replies == "at once"
        if not self.befallen:
            assert not [news for news in bench.news if news.severity is Severity.FAULT], bench.news
        for state, name in zip(bench.driven.axes(), cell.steppers, strict=True):
            assert state.standing is Standing.DRIVEN, state.why
            assert not state.moving, name
            if state.board not in self.restarted:
                assert state.known
                assert state.shaft == bench.position(name), name
        for name in cell.limits:
            axis, low, high = cell.switches[name]
            if bench.plan.board_of[name] == bench.boards.home[axis]:
                places = [0, *(place for _, place in bench.edges(axis))]
                # a DCB-274 does more than 10 000 steps/s: one more, before the firmware has seen its two samples
                assert not [place for place in places if low + 1 < place < high - 1], name
        return sum(state.stops for state in bench.driven.axes())

    def run(self) -> int:
        """How many stops there were."""
        with self.bench:
            self.live()
            if self.befallen or self.exposed():
                self.befall_no_more()
            self.come_to_rest()
            if not self.befallen and self.exposed():  # on the way there
                self.befall_no_more()
                self.come_to_rest()
            return self.check()

    def befall_no_more(self) -> None:
        """Hands are let go, and somebody recovers what stands."""
        self.befallen = True
        for pin in self.cell.hands:
            self.bench.press(pin, 1)
        self.bench.run(400 * MS)
        self.bench.come_back()
        self.bench.come_back()

    def come_to_rest(self) -> None:
        """With everything that is due behind it."""
        self.cell.bring_to_rest(self.bench)
        self.bench.rest(20 * SECOND)
        self.bench.run(1200 * MS)  # the settling time of a DCB-274, behind which it holds


@pytest.mark.parametrize("rough", [False, True])
def test_nothing_is_lost_in_any_cell(rough: bool) -> None:
    assert sum(Session(seed, rough=rough).run() for seed in seeds(24)) > 1


@pytest.mark.parametrize(("seed", "rough"), [(2, False), (165, True), (175, True), (3149, False)])
def test_cells_that_lost_something_once(seed: int, rough: bool) -> None:
    """A motion that went on behind a slip, with half of its current; a jog that began before its driver was enabled."""
    Session(seed, rough=rough).run()


@pytest.mark.slow
@pytest.mark.parametrize("rough", [False, True])
@pytest.mark.parametrize("first", range(1000, 2000, 250))
def test_nothing_is_lost_in_many_cells(first: int, rough: bool) -> None:
    assert sum(Session(seed, rough=rough).run() for seed in range(first, first + 250)) > 100


def test_a_bad_wire_loses_nothing_in_any_cell() -> None:
    assert sum(Session(seed, rough=False, loss=0.01).run() for seed in seeds(12)) > 1


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1000, 1400, 100))
def test_a_bad_wire_loses_nothing_in_many_cells(first: int) -> None:
    assert sum(Session(seed, rough=False, loss=0.01).run() for seed in range(first, first + 100)) > 40


@pytest.mark.parametrize("rough", [False, True])
def test_nothing_is_lost_with_programs_chips_by_spi_and_clocks_of_their_own(rough: bool) -> None:
    assert sum(Session(seed, rough=rough, rich=True).run() for seed in seeds(36)) > 1


@pytest.mark.slow
@pytest.mark.parametrize("rough", [False, True])
def test_nothing_is_lost_with_programs_chips_by_spi_and_clocks_of_their_own_in_many_cells(rough: bool) -> None:
    assert sum(Session(seed, rough=rough, rich=True).run() for seed in range(1000, 1100)) > 100
