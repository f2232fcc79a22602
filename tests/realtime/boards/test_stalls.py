"""A computer that is kept away, at any point of its loop and for any time: a slip that is told, and nothing else.

The stall falls on a look at the clock, wherever that is, or just before something is written. No board shuts down, no
step is lost, and at the next rest the counts are equal.
"""

from random import Random

import pytest
from tests.realtime.boards.driven_bench import Bench

from detent.realtime.boards.states import Standing, Weight
from detent.ticks import MS, SECOND, US, Ns

GS = """
[units.x]
model = "gs-c200s"
straps = { CHS = "low" }
[boards.b]
serial = "fake"
lead = "30 ms"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
enable = "gpio4"
outputs = { MOV = "gpio6", RDY = "!gpio7", RAMP = "gpio8" }
inputs = { EOT = "^gpio10", HOME = "^gpio11", ENABLE = "^gpio12" }
"""
LINES = ("S50", "S200", "+{n}", "-{n}", "g+", "g-", "Z", "+{n}", "-{n}", "K")


class Away:
    """Keeps the computer away at the looks at its clock that are drawn: now and then, for `longest` at most."""

    def __init__(self, random: Random, chance: float, longest: Ns, *, writes: bool) -> None:
        self._random, self._chance, self._longest, self._writes = random, chance, longest, writes
        self.on = False
        self.stalls = 0

    def __call__(self, writing: bool) -> Ns:
        if not self.on or (writing and not self._writes) or self._random.random() >= self._chance:
            return 0
        self.stalls += 1
        return self._random.randrange(self._longest)


def session(seed: int, *, writes: bool) -> int:
    """A host that says what it likes while the computer is away now and then; how many slips there were."""
    random = Random(seed)
    away = Away(random, random.choice([0.002, 0.01]), random.choice([20 * MS, 80 * MS, 300 * MS]), writes=writes)
    small = {"moves": 48} if random.random() < 0.3 else {}
    board = {"window": random.choice([None, 192]), **small}
    with Bench(GS, away=away, jitter=lambda: random.randrange(200 * US), board=board) as bench:
        bench.run(100 * MS)
        away.on = True
        for _ in range(random.randrange(3, 10)):
            bench.type("x", random.choice(LINES).format(n=random.randrange(1, 800)))
            bench.run(random.choice([3 * MS, 40 * MS, 200 * MS, 700 * MS]) + random.randrange(MS))
        away.on = False
        bench.type("x", "K")
        bench.run(SECOND)
        bench.rest()
        state = bench.driven.axes()[0]
        assert not [news for news in bench.news if news.weight is Weight.FAULT], bench.news
        assert state.standing is Standing.DRIVEN
        assert bench.boards.boards["b"].state.value == "ready"
        assert state.shaft == bench.position("x")
        assert state.shaft == bench.boards.steppers["x"].counted()
        assert bench.driven.escaped == 0
        assert sum("slipped" in news.text for news in bench.news) == state.slips
        return state.slips


@pytest.mark.parametrize("part", range(3))
def test_a_stall_at_any_look_at_the_clock_is_a_slip(part: int) -> None:
    assert sum(session(seed, writes=False) for seed in range(10 * part, 10 * part + 10)) > 3


@pytest.mark.slow
def test_a_stall_anywhere_is_a_slip_in_many_sessions() -> None:
    assert sum(session(seed, writes=False) for seed in range(100, 700)) > 800
