"""Whatever a host does, and however late the computer is: no axis passes its limits, and counts agree at rest."""

from random import Random

import pytest
from tests.generated import seeds
from tests.realtime.boards.driven_bench import Bench

from detent.realtime.boards.states import Severity, Standing
from detent.ticks import MS, US, Ns

CELL = """
[units.x]
model = "dcb-274"
[boards.b]
serial = "fake"
lead = "{lead} ms"
[hardware.x]
board = "b"
step = "gpio2"
dir = "gpio3"
inputs = {{ LIMIT-A = "^gpio10", LIMIT-B = "^gpio11", HOME = "^gpio12", JOG1 = "^gpio13", JOG2 = "^gpio14" }}
"""
LINES = ["+{n}", "-{n}", "M {r}", "M -{r}", "M 0", "F {r} 0", "F {r} 1", "@", "\x1b", "Z 0", "R {n}", "R -{n}", "|"]


def run(seed: int) -> int:
    """One random session; how many stops there were."""
    random = Random(seed)
    edge = random.randrange(30, 300)
    switches = {
        "x.LIMIT-A": ("x", edge, 10**6), "x.LIMIT-B": ("x", -(10**6), -edge), "x.HOME": ("x", -20, -10),
    }  # fmt: skip
    text = CELL.format(lead=random.choice([5, 10, 30, 60]))
    chance, on = random.choice([0.0, 0.001, 0.003]), [False]

    def away(_: bool) -> Ns:
        return random.randrange(90 * MS) if on[0] and random.random() < chance else 0

    with Bench(
        text, switches=switches, jitter=lambda: random.randrange(400 * US), away=away, spare_exposed=True
    ) as bench:
        bench.run(100 * MS)
        bench.type("x", " ")
        bench.run(200 * MS)
        on[0] = True
        for _ in range(random.randrange(3, 15)):
            line = random.choice(LINES).format(n=random.randrange(1, 2 * edge), r=random.randrange(200, 4000))
            if len(line) == 1:
                bench.send("x", line.encode())
            else:
                bench.type("x", line)
            bench.run(random.choice([1 * MS, 8 * MS, 40 * MS, 200 * MS, 900 * MS]) + random.randrange(MS))
            if random.random() < 0.15:
                bench.stall(random.randrange(5 * MS, 120 * MS))
            if random.random() < 0.2:
                bench.press(random.choice(["x.JOG1", "x.JOG2"]), random.randrange(2))
        on[0] = False
        bench.press("x.JOG1", 1)
        bench.press("x.JOG2", 1)
        bench.run(50 * MS)
        bench.send("x", b"\x1b")
        bench.rest()
        bench.check_inputs()
        bench.check_outputs()
        places = [place for _, place in bench.edges("x")]
        assert all(-edge <= place <= edge for place in places), f"{min(places)} to {max(places)} of {edge}"
        assert not [news for news in bench.news if news.severity is Severity.FAULT], bench.news
        state = bench.driven.axes()[0]
        assert state.standing is Standing.DRIVEN
        assert state.shaft == bench.position("x") == (places[-1] if places else 0)
        assert bench.cell.controller("x").status(bench.cell.now).pulses == len(places)
        assert bench.driven.rollback.escaped == 0
        return state.stops


def test_no_axis_passes_its_limits() -> None:
    assert sum(run(seed) for seed in seeds(12)) > 3


@pytest.mark.slow
def test_no_axis_passes_its_limits_in_many_sessions() -> None:
    assert sum(run(seed) for seed in range(100, 400)) > 300


def asked_while_late(seed: int) -> int:
    """A motion meets its limit while the computer is elsewhere, and its host asks on; how many stops there were.

    What was said after the stop, before it was heard of, is not so: no host hears it. Nothing is stored twice.
    """
    random = Random(seed)
    edge, rate = random.randrange(30, 300), random.randrange(200, 2000)
    stored: list[bytes] = []

    def store(_: str, image: bytes) -> bool:
        stored.append(image)
        return True

    text = CELL.format(lead=random.choice([5, 10, 30]))
    switches = {"x.LIMIT-A": ("x", edge, 10**6)}
    with Bench(text, switches=switches, store=store, jitter=lambda: random.randrange(300 * US)) as bench:
        bench.run(100 * MS)
        bench.type("x", " ")
        bench.run(200 * MS)
        bench.type("x", random.choice([f"M {rate}", f"+{3 * edge}"]))
        while bench.position("x") < edge - random.randrange(2, 12) and bench.driven.axes()[0].moving:
            bench.run(1 * MS)
        asked = [random.choice(["Z 0", "^", "S", "Z 0"]) for _ in range(random.randrange(1, 5))]
        for question in asked:
            bench.type("x", question)
            if random.random() < 0.5:
                bench.run(random.randrange(1, 20 * MS))
            bench.stall(random.randrange(100 * MS) if random.random() < 0.9 else 400 * MS)
        bench.run(100 * MS)
        bench.rest()
        bench.type("x", "Z 0")
        bench.run(200 * MS)
        bench.check_inputs()
        bench.check_outputs()
        assert bench.driven.rollback.escaped == 0, bench.news
        assert not [news for news in bench.news if news.severity is Severity.FAULT], bench.news
        state = bench.driven.axes()[0]
        assert state.shaft == bench.position("x") <= edge
        assert len(stored) <= asked.count("S")
        return state.stops


def test_what_is_said_while_the_computer_is_late_waits_for_what_happened_meanwhile() -> None:
    assert sum(asked_while_late(seed) for seed in seeds(24)) > 3


def test_a_home_that_is_left_at_the_pins_when_it_is_looked_for_is_looked_for_anew() -> None:
    """F finds HOME closed in the cell, which the motor has left before F's first pulse leaves: it looks the other way.

    HOME then stops at the instant at which F began, and the cell, taken back there, does what a switch that is open
    asks for (page 39): once, and not again and again.
    """
    switches = {"x.LIMIT-A": ("x", 300, 10**6), "x.HOME": ("x", -5, 20)}
    with Bench(CELL.format(lead=60), switches=switches) as bench:
        bench.run(100 * MS)
        bench.type("x", " ")
        bench.run(200 * MS)
        bench.type("x", "M 600")
        bench.run(30 * MS)
        bench.stall(90 * MS)
        bench.run(2 * MS)
        assert bench.driven.lag > 20 * MS
        bench.type("x", "\x1b")
        bench.run(5 * MS)
        assert bench.position("x") <= 20 < bench.driven.axes()[0].shaft
        bench.type("x", "F 1000 1")
        bench.run(10 * MS)
        bench.rest()
        state = bench.driven.axes()[0]
        assert state.standing is Standing.DRIVEN, state.why
        assert state.stops == 2, "home that is left already; and the limit on the way that it looks then"
        assert state.shaft == bench.position("x") == 300
        bench.check_inputs()
        bench.check_outputs()


@pytest.mark.slow
def test_many_questions_while_the_computer_is_late() -> None:
    assert sum(asked_while_late(seed) for seed in range(100, 400)) > 200
