"""Random sessions in which boards fail: unplugged, restarted, stopped by hand, recovered, with contacts that bounce.

Two units on two boards. Whatever befalls one board is told and leaves the axis of the other alone; an emergency stop is
for both. At the end everything is plugged in and recovered: each axis that says that it knows where it is, is there,
and only one whose board has lost its memory may say that it does not know.
"""

from random import Random

import pytest
from tests.generated import seeds
from tests.realtime.boards.driven_bench import Bench

from detent.realtime.boards.states import AxisState, Severity, Standing
from detent.ticks import MS, US, Ns

UNIT = """
[units.{unit}]
model = "gs-c200s"
straps = {{ CHS = "low" }}
[boards.{board}]
serial = "fake{board}"
lead = "{lead} ms"
replies = "{replies}"
watchdog = "2 s"
[hardware.{unit}]
board = "{board}"
step = "!gpio2"
dir = "gpio3"
enable = "gpio4"
outputs = {{ MOV = "gpio6", RDY = "!gpio7" }}
inputs = {{ EOT = "^gpio10", HOME = "^gpio11", ENABLE = "^gpio12" }}
"""
UNITS = {"x": "a", "y": "b"}
LINES = ("S{s}", "+{n}", "-{n}", "g+", "g-", "H+", "Z", "K")


class Rough:
    """A session, and what befell its boards."""

    def __init__(self, bench: Bench, random: Random) -> None:
        self.bench, self.random = bench, random
        self.restarted: set[str] = set()

    def axis(self, unit: str) -> AxisState:
        return next(state for state in self.bench.driven.axes() if state.unit == unit)

    def say(self) -> None:
        line = self.random.choice(LINES).format(n=self.random.randrange(1, 600), s=self.random.choice([5, 20, 60]))
        self.bench.type(self.random.choice("xy"), line)

    def unplug(self) -> None:
        """One of two: the other goes on."""
        unit = self.random.choice("xy")
        other = "y" if unit == "x" else "x"
        before = self.axis(other).standing
        self.bench.ports[UNITS[unit]].unplugged = True
        for _ in range(20):  # one that has nothing to do is asked for its clock once a second
            self.bench.run(60 * MS)
            if self.axis(unit).standing is Standing.FAULT:
                break
        assert self.axis(unit).standing is Standing.FAULT
        assert self.axis(other).standing is before, "a board that is gone stops nothing on another"

    def restart(self) -> None:
        board = self.random.choice("ab")
        if not self.bench.ports[board].unplugged:
            self.bench.ports[board].board.power_cycle()
            self.restarted.add(board)
            self.bench.run(1200 * MS)  # one that has nothing to do is asked for its clock once a second

    def stop(self) -> None:
        """For both, at once."""
        self.bench.driven.stop()
        self.bench.run(30 * MS)
        assert [state.standing for state in self.bench.driven.axes()] == [Standing.FAULT] * 2
        stood = [self.bench.position(unit) for unit in UNITS]
        self.bench.run(100 * MS)
        assert [self.bench.position(unit) for unit in UNITS] == stood

    def bounce(self) -> None:
        """A contact that makes up its mind within some milliseconds."""
        name, level = self.random.choice("xy") + ".ENABLE", self.random.randrange(2)
        for _ in range(self.random.randrange(1, 9)):
            self.bench.press(name, level)
            self.bench.run(self.random.randrange(20 * US, 1500 * US))
            level = 1 - level
        self.bench.press(name, 1)


def session(seed: int) -> int:
    """One of them; how many faults there were."""
    random = Random(seed)
    lead, replies = random.choice([8, 30]), random.choice(["held", "held", "at once"])
    text = "".join(UNIT.format(unit=unit, board=board, lead=lead, replies=replies) for unit, board in UNITS.items())
    edge = random.randrange(50, 400)
    switches = {f"{unit}.EOT": (unit, edge, 10**6) for unit in UNITS}
    switches |= {f"{unit}.HOME": (unit, -(10**6), edge - random.randrange(5, 40)) for unit in UNITS}
    chance, on = random.choice([0.0, 0.001]), [False]

    def away(_: bool) -> Ns:
        return random.randrange(80 * MS) if on[0] and random.random() < chance else 0

    with Bench(
        text, switches=switches, jitter=lambda: random.randrange(300 * US), away=away, spare_exposed=True
    ) as bench:
        rough = Rough(bench, random)
        bench.run(300 * MS)
        for _ in range(random.randrange(6, 16)):
            on[0] = True
            for _ in range(random.randrange(1, 4)):
                rough.say()
                bench.run(random.choice([2 * MS, 30 * MS, 300 * MS]) + random.randrange(MS))
            on[0] = False
            random.choice([rough.say, rough.unplug, rough.restart, rough.stop, rough.bench.come_back, rough.bounce])()
            bench.run(random.choice([0, 5 * MS, 100 * MS]) + 1)
        rough.bench.come_back()
        rough.bench.come_back()
        for unit in UNITS:
            bench.type(unit, "K")
        bench.run(300 * MS)
        bench.rest()
        bench.check_inputs()
        bench.check_outputs()
        for state in bench.driven.axes():
            assert state.standing is Standing.DRIVEN, state.why
            assert state.known or state.board in rough.restarted, state
            if state.board not in rough.restarted:
                assert state.shaft == bench.position(state.unit), state.unit
        assert replies == "at once" or bench.driven.rollback.escaped == 0
        return sum(news.severity is Severity.FAULT for news in bench.news)


def test_what_befalls_a_board_is_told_and_leaves_the_other_alone() -> None:
    assert sum(session(seed) for seed in seeds(8)) > 1


def neighbour(seed: int) -> None:
    """A board goes away while an axis on another moves, and is late, or meets its switch: that one goes on."""
    random = Random(seed)
    lead, edge = random.choice([8, 30]), random.randrange(50, 200)
    text = "".join(UNIT.format(unit=unit, board=board, lead=lead, replies="held") for unit, board in UNITS.items())
    with Bench(text, switches={"y.EOT": ("y", edge, 10**6)}, jitter=lambda: random.randrange(300 * US)) as bench:
        rough = Rough(bench, random)
        bench.run(300 * MS)
        for unit in UNITS:
            bench.type(unit, "S20")
            bench.run(100 * MS)
        bench.type("x", "g+")
        bench.type("y", random.choice(["g+", f"+{edge + 50}", "H+"]))
        bench.run(random.randrange(100 * MS, 1500 * MS))
        for unplugged in (False, True):
            bench.ports[UNITS["x"]].unplugged = unplugged
            if random.random() < 0.5:
                bench.stall(random.randrange(lead * MS, 3 * lead * MS))
        bench.run(500 * MS)
        assert rough.axis("x").standing is Standing.FAULT
        assert rough.axis("y").standing is Standing.DRIVEN, rough.axis("y").why
        bench.type("y", "K")
        bench.run(300 * MS)
        bench.rest()
        assert rough.axis("y").shaft == bench.position("y")


def test_an_axis_goes_on_while_the_board_of_another_goes_away() -> None:
    for seed in seeds(16):
        neighbour(seed)


@pytest.mark.slow
def test_an_axis_goes_on_while_the_board_of_another_goes_away_in_many_sessions() -> None:
    for seed in range(100, 400):
        neighbour(seed)


@pytest.mark.slow
def test_what_befalls_a_board_is_told_and_leaves_the_other_alone_in_many_sessions() -> None:
    assert sum(session(seed) for seed in range(100, 400)) > 300
