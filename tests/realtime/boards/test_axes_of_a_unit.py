"""Random sessions of a unit whose two axes are on one board, or on two: late computers, limits, boards that fail.

What stops an axis on one board reaches that on the other as a message, and not as a trigger: steps that have left
meanwhile are counted, and told. Whatever happens, also in mid-move of both, no axis passes its own limit, and at the
end each is where the cell has it, or is said not to be known.
"""

from random import Random

import pytest
from tests.realtime.boards.driven_bench import Bench

from detent.realtime.boards.states import AxisState, Severity, Standing
from detent.ticks import MS, SECOND, US, Ns

CELL = """
[units.x]
model = "bs0610"
options = {{ hard_stop = "yes" }}
[boards.a]
serial = "fakea"
lead = "{lead} ms"
{second}
[hardware.x]
board = "{shared}"
inputs = {{ RST = "^gpio20", "Y+" = "^gpio21", "X+" = "^gpio22", "X-" = "^gpio23" }}
outputs = {{ RDY = "gpio30" }}
[hardware.x.X]
board = "a"
step = "gpio2"
dir = "gpio3"
enable = "gpio4"
inputs = {{ "LX-" = "^gpio10", "LX+" = "^gpio11" }}
[hardware.x.Y]
board = "{other}"
step = "gpio5"
dir = "gpio6"
enable = "gpio7"
inputs = {{ "LY-" = "^gpio12", "LY+" = "^gpio13" }}
"""
SECOND_BOARD = '[boards.b]\nserial = "fakeb"\nlead = "{lead} ms"\n'
LINES = ("X{n}G", "X-{n}G", "Y{n}G", "Y-{n}G", "X+S", "Y-S", "B+S", "B{n}G", "XZ", "BZ", "X{n}GYZ", "R{t}", "K{k}")
PRESSES = ("x.Y+", "x.X+", "x.X-", "x.RST")
AXES = ("x.X", "x.Y")


class Session:
    """One of them, on `boards`. `rough`: these are unplugged, restarted, stopped by hand and recovered, too."""

    def __init__(self, seed: int, *, boards: str, rough: bool) -> None:
        self.random = random = Random(seed)
        self.rough, self.boards = rough, boards
        self.befallen = False
        self.restarted: set[str] = set()
        edge = random.randrange(30, 400)
        self.limits = {"x.LX+": ("x.X", edge, 10**6), "x.LY-": ("x.Y", -(10**6), -edge // 2)}
        lead = random.choice([5, 10, 30, 60])
        second = SECOND_BOARD.format(lead=lead) if len(boards) > 1 else ""
        text = CELL.format(lead=lead, shared=random.choice(boards), other=boards[-1], second=second)
        chance, self.on = random.choice([0.0, 0.001, 0.003]), False

        def away(_: bool) -> Ns:
            return random.randrange(90 * MS) if self.on and random.random() < chance else 0

        self.bench = Bench(
            text, switches=self.limits, jitter=lambda: random.randrange(400 * US), away=away, spare_exposed=True,
            port={"drift": random.choice([0.0, 60.0, -90.0])},
        )  # fmt: skip

    def axes(self) -> dict[str, AxisState]:
        return {f"{state.unit}.{state.axis}": state for state in self.bench.driven.axes()}

    def say(self) -> None:
        random = self.random
        line = random.choice(LINES).format(
            n=random.randrange(1, 800), t=random.randrange(50, 300), k=random.randrange(1, 60)
        )
        self.bench.send("x", line.encode())

    def befall(self) -> None:
        self.befallen = True
        self.on = False
        random, bench = self.random, self.bench
        match random.randrange(4):
            case 0:
                board = random.choice(self.boards)
                bench.ports[board].unplugged = True
                bench.run(60 * MS)
            case 1:
                board = random.choice(self.boards)
                if not bench.ports[board].unplugged:
                    bench.ports[board].board.power_cycle()
                    self.restarted.add(board)
                    bench.run(1200 * MS)
            case 2:
                bench.driven.stop()
                bench.run(30 * MS)
                stood = [bench.position(axis) for axis in AXES]
                bench.run(100 * MS)
                assert [bench.position(axis) for axis in AXES] == stood
            case 3:
                self.bench.come_back()
        self.on = True

    def end(self) -> None:
        """Everything plugged in and recovered, a reset, and rest."""
        bench, self.on = self.bench, False
        for name in PRESSES:
            bench.press(name, 1)
        bench.run(50 * MS)
        for _ in range(2 if self.rough else 0):
            self.bench.come_back()
        bench.press("x.RST", 0)
        bench.run(100 * MS)
        bench.press("x.RST", 1)
        bench.run(500 * MS)
        bench.rest(20 * SECOND)

    def check(self) -> int:
        bench = self.bench
        bench.check_inputs()
        bench.check_outputs()
        assert bench.driven.rollback.escaped == 0
        for name, state in self.axes().items():
            assert state.standing is Standing.DRIVEN, state.why
            assert not state.moving
            if state.board not in self.restarted:
                assert state.known
                assert state.shaft == bench.position(name), bench.news
        if not self.befallen:
            assert not [news for news in bench.news if news.severity is Severity.FAULT], bench.news
            assert len({(state.slips, state.slipped) for state in self.axes().values()}) == 1, "a slip is of the unit"
        for name, (axis, low, high) in self.limits.items():
            places = [0, *(place for _, place in bench.edges(axis))]
            assert not [place for place in places if low < place < high], name
        return sum(state.stops for state in self.axes().values())

    def run(self) -> int:
        """How many stops there were."""
        random, bench = self.random, self.bench
        with bench:
            bench.run(400 * MS)
            self.on = True
            for _ in range(random.randrange(5, 16)):
                self.say()
                bench.run(random.choice([1 * MS, 8 * MS, 40 * MS, 200 * MS, 900 * MS]) + random.randrange(MS))
                if random.random() < 0.15:
                    bench.stall(random.randrange(5 * MS, 120 * MS))
                if random.random() < 0.25:
                    bench.press(random.choice(PRESSES), random.randrange(2))
                if self.rough and random.random() < 0.3:
                    self.befall()
            self.end()
            return self.check()


@pytest.mark.parametrize(("boards", "rough"), [("a", True), ("ab", False), ("ab", True)])
def test_each_axis_stays_within_its_limits_and_both_are_where_the_cell_has_them(boards: str, rough: bool) -> None:
    assert sum(Session(seed, boards=boards, rough=rough).run() for seed in range(3)) > 0


@pytest.mark.slow
@pytest.mark.parametrize(("boards", "rough"), [("a", True), ("ab", False), ("ab", True)])
def test_two_axes_of_a_unit_in_many_sessions(boards: str, rough: bool) -> None:
    assert sum(Session(seed, boards=boards, rough=rough).run() for seed in range(100, 300)) > 60


@pytest.mark.parametrize("shared", ["a", "b"])
def test_a_reset_in_mid_move_of_both_stops_one_and_counts_what_the_other_made_meanwhile(shared: str) -> None:
    """One is stopped by its board, and the cell taken back; steps of the other have left by then: they are told."""
    text = CELL.format(lead=30, shared=shared, other="b", second=SECOND_BOARD.format(lead=30))
    with Bench(text) as bench:
        bench.run(400 * MS)
        for line in (b"X+S", b"Y-S"):
            bench.send("x", line)
            bench.run(100 * MS)
        bench.press("x.RST", 0)
        bench.run(300 * MS)
        other = "x.Y" if shared == "a" else "x.X"
        [news] = bench.news
        assert news.severity is Severity.WARNING
        assert news.text.startswith(f"{other}: ")
        assert news.text.endswith("are counted all the same")
        stopped = [bench.position(axis) for axis in AXES]
        assert min(map(abs, stopped)) > 20
        assert [(state.standing, state.shaft) for state in bench.driven.axes()] == [
            (Standing.DRIVEN, place) for place in stopped
        ]
        bench.press("x.RST", 1)
        bench.run(600 * MS)
        bench.send("x", b"X-30G")
        bench.run(SECOND)
        bench.rest()
        assert [bench.position(axis) for axis in AXES] == [stopped[0] - 30, stopped[1]]
