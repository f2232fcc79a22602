"""Hands tap every input of a unit, limits too, for some milliseconds at any time: nothing is lost, nothing stands.

At the end the motor is where the cell has it, every input is in the cell as on the board, and no axis is at fault.
"""

from random import Random

import pytest
from tests.generated import seeds
from tests.realtime.boards.driven_bench import Bench
from tests.realtime.boards.test_sessions import BOARD, KINDS

from detent.realtime.boards.states import Severity, Standing
from detent.ticks import MS, SECOND, US

INPUTS = {
    "gs-c200s": ("x.ENABLE", "x.UI1", "x.UI2", "x.EOT", "x.HOME"),
    "bs0610": ("x.Y+", "x.X+", "x.X-", "x.RST", "x.LX+", "x.LY-"),
    "supersigma": ("x.FORCE", "x.RAIL"),
}


def session(kind: str, seed: int) -> None:
    random, what = Random(seed), KINDS[kind]
    text = what.text + BOARD.format(lead=random.choice([5, 10, 30, 60]))
    with Bench(text, jitter=lambda: random.randrange(400 * US)) as bench:
        bench.run(400 * MS)
        for _ in range(random.randrange(4, 14)):
            if random.random() < 0.7:
                line = random.choice(what.lines).format(
                    n=random.randrange(1, 800), s=random.choice([5, 20, 50]), t=random.randrange(50, 300),
                    k=random.randrange(1, 60),
                )  # fmt: skip
                bench.send("x", line.encode()) if kind == "bs0610" else bench.type("x", line)
            bench.run(random.choice([random.randrange(60 * MS), 1 * MS, 8 * MS, 200 * MS]))
            if random.random() < 0.15:
                bench.stall(random.randrange(5 * MS, 120 * MS))
            for _ in range(random.randrange(3)):
                pin = random.choice(INPUTS[kind])
                bench.press(pin, 0)
                bench.run(random.randrange(2 * MS, random.choice([6, 40, 120]) * MS))
                bench.press(pin, 1)
                bench.run(random.randrange(5 * MS))
        bench.run(50 * MS)
        if kind == "bs0610":
            bench.press("x.RST", 0)
            bench.run(30 * MS)
            bench.press("x.RST", 1)
            bench.run(600 * MS)
        for end in what.ends if kind != "bs0610" else ():
            bench.type("x", end)
            bench.run(100 * MS)
        bench.rest(20 * SECOND)
        bench.check_inputs()
        bench.check_outputs()
        assert not [news for news in bench.news if news.severity is Severity.FAULT], bench.news
        assert bench.driven.rollback.escaped == 0
        for state, stepper in zip(bench.driven.axes(), what.steppers, strict=True):
            assert state.standing is Standing.DRIVEN
            assert state.moving or state.shaft == bench.position(stepper)


@pytest.mark.parametrize("kind", INPUTS)
def test_whatever_is_tapped_nothing_is_lost(kind: str) -> None:
    for seed in seeds(16):
        session(kind, seed)


@pytest.mark.slow
@pytest.mark.parametrize("kind", INPUTS)
def test_whatever_is_tapped_nothing_is_lost_in_many_sessions(kind: str) -> None:
    for seed in range(100, 400):
        session(kind, seed)
