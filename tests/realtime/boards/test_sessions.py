"""Random sessions on the other controllers, with a computer that is late now and then: nothing is lost or hidden.

Hosts say what they like, hands press what they like, the computer stalls. At the end the motor stands where the cell
has it, every input is in the cell as it is on the board, no host heard what was taken back, and no axis is at fault.
"""

from collections import deque
from random import Random
from typing import NamedTuple

import pytest
from tests.generated import seeds
from tests.realtime.boards.driven_bench import Bench, pulses

from detent.realtime.boards.states import Severity, Standing
from detent.ticks import MS, SECOND, US, Ns

BOARD = '[boards.b]\nserial = "fake"\nlead = "{lead} ms"\n'


class Kind(NamedTuple):
    """A cell file, what hosts say, which inputs hands press, and what brings it to rest."""

    text: str
    lines: tuple[str, ...]
    presses: tuple[str, ...]
    steppers: tuple[str, ...]
    ends: tuple[str, ...] = ()


GS = """
[units.x]
model = "gs-c200s"
straps = { CHS = "low" }
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
enable = "gpio4"
outputs = { MOV = "gpio6", RDY = "!gpio7", UO1 = "gpio8" }
inputs = { EOT = "^gpio10", HOME = "^gpio11", ENABLE = "^gpio12", UI1 = "^gpio13", UI2 = "^gpio14" }
"""
BS = """
[units.x]
model = "bs0610"
options = { hard_stop = "yes" }
[hardware.x]
board = "b"
inputs = { RST = "^gpio20", "Y+" = "^gpio21", "X+" = "^gpio22", "X-" = "^gpio23" }
[hardware.x.X]
board = "b"
step = "gpio2"
dir = "gpio3"
inputs = { "LX-" = "^gpio10", "LX+" = "^gpio11" }
[hardware.x.Y]
board = "b"
step = "gpio4"
dir = "gpio5"
inputs = { "LY-" = "^gpio12", "LY+" = "^gpio13" }
"""
SUPERSIGMA = """
[units.x]
model = "supersigma"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
inputs = { RAIL = "^gpio10", FORCE = "^gpio11" }
"""
KINDS = {
    "gs-c200s": Kind(
        GS,
        ("S{s}", "T{t}", "R{k}", "+{n}", "-{n}", "g+", "g-", "H+", "H-", "A1", "C1", "g+1"),
        ("x.ENABLE", "x.UI1"),
        ("x",),
        ("@", "K"),
    ),
    "bs0610": Kind(
        BS,
        ("X{n}G", "X-{n}G", "Y{n}G", "Y-{n}G", "X+S", "X-S", "XZ", "X{n}GYZ", "R{t}", "K{k}"),
        ("x.Y+", "x.X+", "x.X-", "x.RST"),
        ("x.X", "x.Y"),
        ("RST",),
    ),
    "supersigma": Kind(SUPERSIGMA, ("originate", "move +{n}", "move -{n}", "stop", "emergency"), ("x.FORCE",), ("x",)),
}


def switches(kind: str, random: Random) -> dict[str, tuple[str, int, int]]:
    """Where the machine closes what."""
    edge, far = random.randrange(30, 400), 10**6
    if kind == "gs-c200s":
        return {"x.EOT": ("x", edge, far), "x.HOME": ("x", -far, random.randrange(-20, edge))}
    if kind == "bs0610":
        return {"x.LX+": ("x.X", edge, far), "x.LX-": ("x.X", -far, -edge), "x.LY+": ("x.Y", edge // 2, far)}
    return {"x.RAIL": ("x", -far, -edge // 8 - 2)}


def session(kind: str, seed: int) -> int:
    """One of them; how many stops there were."""
    random, what = Random(seed), KINDS[kind]
    closed = switches(kind, random)
    text = what.text + BOARD.format(lead=random.choice([5, 10, 30, 60]))
    chance, on = random.choice([0.0, 0.001, 0.003]), [False]

    def away(_: bool) -> Ns:
        return random.randrange(90 * MS) if on[0] and random.random() < chance else 0

    with Bench(
        text, switches=closed, jitter=lambda: random.randrange(400 * US), away=away, spare_exposed=True
    ) as bench:
        bench.run(400 * MS)
        on[0] = True
        for _ in range(random.randrange(4, 14)):
            line = random.choice(what.lines).format(
                n=random.randrange(1, 800), s=random.choice([5, 10, 20, 50]), t=random.randrange(50, 300),
                k=random.randrange(1, 60),
            )  # fmt: skip
            if kind == "bs0610":
                bench.send("x", line.encode())
            else:
                bench.type("x", line)
            bench.run(random.choice([1 * MS, 8 * MS, 40 * MS, 200 * MS, 900 * MS]) + random.randrange(MS))
            if random.random() < 0.15:
                bench.stall(random.randrange(5 * MS, 120 * MS))
            if random.random() < 0.25:
                bench.press(random.choice(what.presses), random.randrange(2))
        on[0] = False
        for name in what.presses:
            bench.press(name, 1)
        bench.run(50 * MS)
        for end in what.ends:
            if end == "RST":
                bench.press("x.RST", 0)
                bench.run(100 * MS)
                bench.press("x.RST", 1)
                bench.run(500 * MS)
            else:
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
            if kind == "bs0610":
                places = [0, *(place for _, place in bench.edges(stepper))]
                limits = [(low, high) for name, low, high in closed.values() if name == stepper]
                assert not [place for place in places for low, high in limits if low < place < high]
        return sum(state.stops for state in bench.driven.axes())


@pytest.mark.parametrize("kind", KINDS)
def test_whatever_is_said_and_pressed_nothing_is_lost(kind: str) -> None:
    assert sum(session(kind, seed) for seed in seeds(24)) > 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_whatever_is_said_and_pressed_nothing_is_lost_in_many_sessions(kind: str) -> None:
    assert sum(session(kind, seed) for seed in range(100, 200)) > 30


@pytest.mark.parametrize("seed", [132, 165, 189])
def test_sessions_that_lost_something_once(seed: int) -> None:
    """A stop of two axes of which one was sent for later, when the input was over; and what came of it."""
    session("bs0610", seed)


def held_at_once(seed: int) -> None:
    """A motion that ENABLE holds before its first step, while the computer is elsewhere; then another."""
    random = Random(seed)
    lead = random.choice([10, 30, 60])
    with Bench(GS + BOARD.format(lead=lead), jitter=lambda: random.randrange(400 * US)) as bench:
        bench.run(400 * MS)
        bench.type("x", "A1")
        bench.run(30 * MS)
        bench.press("x.ENABLE", 0)
        bench.run(5 * MS)
        bench.type("x", random.choice(["g-", "+5", "-1"]))
        bench.run(random.randrange(lead * MS))
        bench.stall(random.randrange(5 * MS, 150 * MS))
        bench.run(random.randrange(60 * MS))
        bench.press("x.ENABLE", 1)
        bench.run(random.randrange(60 * MS))
        bench.type("x", "-7")
        bench.run(300 * MS)
        for end in KINDS["gs-c200s"].ends:
            bench.type("x", end)
            bench.run(50 * MS)
        bench.rest(5 * SECOND)
        assert not [news for news in bench.news if news.severity is Severity.FAULT], bench.news
        [state] = bench.driven.axes()
        assert state.shaft == bench.position("x") != 0


def test_what_was_held_before_its_first_step_moves_when_it_may() -> None:
    for seed in seeds(16):
        held_at_once(seed)


@pytest.mark.slow
def test_what_was_held_before_its_first_step_moves_when_it_may_in_many_sessions() -> None:
    for seed in range(100, 500):
        held_at_once(seed)


def tapped(seed: int) -> None:
    """A reset, or slew keys, for some milliseconds, at any time around the first steps of motions; then rest."""
    random = Random(seed)
    lead = random.choice([10, 30, 60])
    with Bench(KINDS["bs0610"].text + BOARD.format(lead=lead), jitter=lambda: random.randrange(400 * US)) as bench:
        bench.run(400 * MS)
        if random.random() < 0.4:  # with a lag
            bench.send("x", b"X+S")
            bench.run(100 * MS)
            bench.stall(random.randrange(120 * MS))
            bench.run(100 * MS)
        if random.random() < 0.8:
            bench.send("x", random.choice([b"Y-S", b"B+S", b"X300G"]))
        bench.run(random.choice([random.randrange(lead * MS // 2), random.randrange(200 * MS)]))
        for _ in range(random.choice([0, 0, 1, 2])):
            bench.press("x.X+", 0)
            bench.run(random.randrange(3 * MS, 90 * MS))
            bench.press("x.X+", 1)
            bench.run(random.randrange(3 * MS, 90 * MS))
        bench.press("x.RST", 0)
        bench.run(random.randrange(3 * MS, random.choice([lead // 3 + 3, 60]) * MS))
        bench.press("x.RST", 1)
        bench.run(800 * MS)
        bench.rest(5 * SECOND)
        assert not [news for news in bench.news if news.severity is Severity.FAULT], bench.news
        assert not any(state.moving for state in bench.driven.axes()), "a reset was lost"
        assert [state.shaft for state in bench.driven.axes()] == [bench.position("x.X"), bench.position("x.Y")]
        assert bench.driven.rollback.escaped == 0
        bench.check_inputs()
        bench.check_outputs()


@pytest.mark.parametrize("ahead", [2, 15, 25])
def test_a_reset_that_is_over_before_the_first_step_stops_the_motion(ahead: int) -> None:
    """A stop watches for the pulses of its motion, which leave a lead later: a reset may come and go meanwhile."""
    with Bench(KINDS["bs0610"].text + BOARD.format(lead=60)) as bench:
        bench.run(400 * MS)
        bench.send("x", b"B+S")
        bench.run(ahead * MS)
        bench.press("x.RST", 0)
        bench.run(12 * MS)
        bench.press("x.RST", 1)
        bench.run(500 * MS)
        places = [state.shaft for state in bench.driven.axes()]
        bench.run(500 * MS)
        assert [state.shaft for state in bench.driven.axes()] == places
        assert [bench.position("x.X"), bench.position("x.Y")] == places
        assert bench.said("x").count("GenStepper") == 2, "at power-on, and behind the reset"
        assert bench.news == []


def test_no_tap_is_lost_before_a_stop_comes_into_force() -> None:
    for seed in (121, *seeds(24)):  # 121: of two motors one had no stop yet that the reset of the other could set off
        tapped(seed)


@pytest.mark.slow
def test_no_tap_is_lost_in_many_sessions() -> None:
    for seed in range(100, 600):
        tapped(seed)


@pytest.mark.parametrize("late", [0, 60])
def test_an_input_that_stops_two_axes_stops_both_and_each_count_is_the_boards(late: int) -> None:
    """A reset in mid-move of both motors: two triggers fire, and the cell is taken back for the first of them."""
    text = KINDS["bs0610"].text + BOARD.format(lead=30)
    with Bench(text) as bench:
        bench.run(400 * MS)
        bench.send("x", b"X+S")
        bench.run(100 * MS)
        bench.send("x", b"Y-S")
        bench.run(100 * MS)
        bench.stall(late * MS)  # a slip of each, not of the same length
        bench.run(100 * MS)
        bench.press("x.RST", 0)
        bench.run(300 * MS)
        stopped = [bench.position("x.X"), bench.position("x.Y")]
        assert stopped[0] > 50
        assert stopped[1] < -20
        assert not [news for news in bench.news if news.severity is Severity.FAULT], bench.news
        assert [state.shaft for state in bench.driven.axes()] == stopped
        assert [state.stops for state in bench.driven.axes()] == [1, 1]
        bench.press("x.RST", 1)
        bench.run(600 * MS)
        bench.send("x", b"X-30G")
        bench.run(SECOND)
        bench.rest()
        assert [bench.position("x.X"), bench.position("x.Y")] == [stopped[0] - 30, stopped[1]]


def late_together(seed: int) -> tuple[int, int]:
    """Two motors of a unit, a computer that is late, a stop of both: one time for both. Slips and stops."""
    random = Random(seed)
    text = KINDS["bs0610"].text + BOARD.format(lead=random.choice([10, 30, 60]))
    with Bench(text, jitter=lambda: random.randrange(400 * US)) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]
        bench.run(400 * MS)
        first, second = random.sample(["X", "Y"], 2)
        bench.send("x", f"{first}{random.choice('+-')}S".encode())
        for _ in range(random.randrange(3)):
            bench.run(random.randrange(120 * MS))
            bench.stall(random.randrange(150 * MS))
        bench.send("x", f"{second}{random.choice(['+S', '-S', '60G', '-200G'])}".encode())
        for _ in range(random.randrange(1, 3)):
            bench.run(random.randrange(120 * MS))
            bench.stall(random.randrange(150 * MS))
        bench.run(random.randrange(150 * MS))
        bench.press("x.RST", 0)
        bench.run(500 * MS)
        bench.rest()
        axes = bench.driven.axes()
        assert all("slipped" in news.text for news in bench.news), bench.news
        assert [state.shaft for state in axes] == [bench.position("x.X"), bench.position("x.Y")]
        assert len({(state.slips, state.slipped) for state in axes}) == 1, "a slip is of the unit"
        assert len(bench.news) == axes[0].slips
        same_time(bench)
        return axes[0].slips, sum(state.stops for state in axes)


def same_time(bench: Bench) -> None:
    """What the axes of a unit did at the same time comes at the same time: the lag is of the unit, and only grows."""
    scale = bench.boards.boards["b"].core.scale
    behind: list[tuple[Ns, Ns]] = []
    for ledger in bench.driven.ledgers:
        told = pulses(ledger.motions.since(0), bench.cell.now)
        edges = bench.edges(ledger.name)
        # the input is sampled for each of them, at most 100 us apart: a pulse may be between
        assert 0 <= abs(len(told) - len(edges)) <= 1, ledger.name
        behind += [(at, scale.time(tick) - at) for (tick, _), (at, _) in zip(edges, told, strict=False)]
    behind.sort()
    worst, before = 0, deque(behind)
    for at, lag in behind:
        while before[0][0] < at - bench.plan.lead:  # what waited at the host when others had left is later
            worst = max(worst, before.popleft()[1])
        assert lag >= worst - 3 * US, "an axis was less late than the other had been"


def test_the_axes_of_a_unit_are_late_together() -> None:
    slips, stops = (sum(counts) for counts in zip(*(late_together(seed) for seed in seeds(24)), strict=True))
    assert slips > 2
    assert stops > 4


@pytest.mark.slow
def test_the_axes_of_a_unit_are_late_together_in_many_sessions() -> None:
    for seed in range(100, 400):
        late_together(seed)
