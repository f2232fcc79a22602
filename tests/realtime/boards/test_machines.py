"""Whole machines behind one fake board: the drilling cell, three axes on a party line, two motors with their limits."""

from itertools import pairwise
from pathlib import Path
from random import Random

import pytest
from tests.realtime.boards.driven_bench import Bench, pulses

from detent.cell.build import build
from detent.cell.description import parse
from detent.realtime.boards.states import Standing
from detent.ticks import MS, SECOND

EXAMPLES = Path(__file__).parents[3] / "examples"


def read(name: str) -> str:
    return (EXAMPLES / "drilling" / name).read_text()


DRILLING = """
[boards.b]
serial = "fake"
[hardware.bar]
board = "b"
step = "!gpio2"
dir = "gpio3"
outputs = { MOV = "gpio4" }
inputs = { EOT = "^gpio10", HOME = "^gpio11" }
[hardware.drill]
board = "b"
step = "!gpio5"
dir = "gpio6"
outputs = { UO1 = "gpio7" }
inputs = { EOT = "^gpio12", HOME = "^gpio13" }
"""


def same_pulses(bench: Bench, stepper: str, unit: str, axis: str = "") -> int:
    """The steps on the pins are the pulses of the cell; how many."""
    ledger = next(a for a in bench.driven.ledgers if (a.what.unit, a.what.axis) == (unit, axis))
    wanted = [place for _, place in pulses(ledger.motions.since(0), bench.cell.now)]
    assert [place for _, place in bench.edges(stepper)] == wanted
    assert bench.position(stepper) == ledger.shaft_at(bench.cell.now)
    return len(wanted)


def test_the_drilling_cell_drills_its_bar() -> None:
    """Two units on one board, cross-wired within the cell: the example of the datasheet, as it runs without pins."""
    text = read("cell.toml")
    with Bench(text + DRILLING, read=read) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]
        bench.run(6 * SECOND)
        bench.rest()
        counts = {unit: same_pulses(bench, unit, unit) for unit in ("bar", "drill")}
        assert bench.news == []
        ideal = build(parse(text, "cell.toml"), read, line_timing=False)
        ideal.run_to(bench.cell.now)
        for unit, count in counts.items():
            assert ideal.controller(unit).status(ideal.now) == bench.cell.controller(unit).status(bench.cell.now)
            assert ideal.controller(unit).status(ideal.now).pulses == count > 0


AXES = """
[units.x]
model = "dcb-274"
options = { name = "X" }
[units.y]
model = "dcb-274"
options = { name = "Y" }
[units.z]
model = "dcb-274"
options = { name = "Z" }
[lines.bus]
units = ["x", "y", "z"]
[boards.b]
serial = "fake"
lead = "20 ms"
[hardware.x]
board = "b"
step = "gpio2"
dir = "gpio3"
inputs = { LIMIT-A = "^gpio10", LIMIT-B = "^gpio11", HOME = "^gpio12", JOG1 = "^gpio13" }
[hardware.y]
board = "b"
step = "gpio4"
dir = "gpio5"
inputs = { LIMIT-A = "^gpio14", LIMIT-B = "^gpio15", HOME = "^gpio16" }
[hardware.z]
board = "b"
step = "gpio6"
dir = "gpio7"
inputs = { LIMIT-A = "^gpio17", LIMIT-B = "^gpio18", HOME = "^gpio19" }
"""


def test_three_axes_home_run_into_limits_and_jog_at_once() -> None:
    switches = {
        "x.HOME": ("x", -60, -50), "y.LIMIT-A": ("y", 150, 10**6), "z.LIMIT-B": ("z", -(10**6), -77),
    }  # fmt: skip
    with Bench(AXES, switches=switches) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]
        bench.run(100 * MS)
        for unit, line in (("x", "F 400 0"), ("y", "M 900"), ("z", "-500")):
            bench.type(unit, line)
            bench.run(3 * MS)
        bench.run(1500 * MS)
        bench.rest()
        assert bench.position("y") == 150
        assert bench.position("z") == -77
        assert -60 <= bench.position("x") <= -40
        assert bench.driven.rollback.rewinds == 4
        for unit in "xyz":
            assert same_pulses(bench, unit, unit) > 0
        bench.press("x.JOG1", 0)
        bench.run(500 * MS)
        bench.press("x.JOG1", 1)
        bench.run(20 * MS)
        bench.rest()
        assert same_pulses(bench, "x", "x") > 200
        assert bench.news == []


TWO = """
[units.t]
model = "bs0610"
options = { hard_stop = "yes" }
[boards.b]
serial = "fake"
[hardware.t]
board = "b"
inputs = { RST = "^gpio20", "Y+" = "^gpio21" }
outputs = { RDY = "gpio30" }
[hardware.t.X]
board = "b"
step = "gpio2"
dir = "gpio3"
inputs = { "LX-" = "^gpio10", "LX+" = "^gpio11" }
[hardware.t.Y]
board = "b"
step = "gpio4"
dir = "gpio5"
inputs = { "LY-" = "^gpio12", "LY+" = "^gpio13" }
"""


def test_two_motors_with_hard_limits_keys_and_a_reset() -> None:
    with Bench(TWO, switches={"t.LX+": ("t.X", 300, 10**6)}) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]
        bench.run(400 * MS)
        bench.send("t", b"X2000G")
        bench.run(1 * SECOND)
        assert bench.position("t.X") == 300
        bench.press("t.Y+", 0)  # a slew key
        bench.run(300 * MS)
        assert bench.position("t.Y") > 50
        before = bench.wall
        bench.press("t.RST", 0)
        bench.run(200 * MS)
        scale = bench.boards.boards["b"].core.scale
        last = scale.time(bench.edges("t.Y")[-1][0])
        assert last <= bench.boards.cell_at(before) - 30 * MS + MS, "a reset stops at once"
        bench.press("t.RST", 1)
        bench.press("t.Y+", 1)
        bench.run(500 * MS)
        bench.rest()
        assert same_pulses(bench, "t.X", "t", "X") == 300
        assert same_pulses(bench, "t.Y", "t", "Y") > 50
        assert bench.driven.rollback.rewinds == 2
        assert bench.news == []


SUPERSIGMA = """
[units.x]
model = "supersigma"
[boards.b]
serial = "fake"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
outputs = { P23 = "gpio4" }
inputs = { RAIL = "^gpio10", FORCE = "^gpio11" }
"""


def test_emergency_braking_keeps_its_curve() -> None:
    """Excessive force brakes by the steepest allowable curve: it is no stop of the firmware, and no step is lost."""
    with Bench(SUPERSIGMA) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]
        bench.run(100 * MS)
        bench.type("x", "move +20000")
        bench.run(1500 * MS)
        bench.press("x.FORCE", 0)
        bench.run(20 * MS)
        bench.rest()
        assert 0 < same_pulses(bench, "x", "x") < 20000
        assert bench.driven.rollback.rewinds == 0
        assert bench.news == []


def test_both_switches_at_one_place_are_found_in_their_order() -> None:
    """HOME opens a few steps before EOT closes, faster than inputs are reported: home is looked for all the same."""
    text = """
[units.x]
model = "gs-c200"
straps = { CHS = "low" }
[boards.b]
serial = "fake"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
inputs = { EOT = "^gpio10", HOME = "^gpio11" }
"""
    for gap in (1, 2, 5, 20):
        with Bench(text, switches={"x.EOT": ("x", 100, 10**6), "x.HOME": ("x", -5, 100 - gap)}) as bench:
            bench.run(100 * MS)
            bench.type("x", "S50")
            bench.run(20 * MS)
            bench.type("x", "H+")
            bench.run(1 * SECOND)
            bench.rest()
            assert bench.position("x") == 100 - gap, f"{gap} steps apart"
            assert bench.cell.controller("x").status(bench.cell.now).position == 0


def test_the_tail_of_a_motion_is_watched_until_it_has_left() -> None:
    """The host turns round just before the limit: the steps that are on their way still stop at it."""
    for early in (0, 5, 12, 20, 28, 33):
        with Bench(
            AXES.replace('lead = "20 ms"', 'lead = "50 ms"'), switches={"x.LIMIT-A": ("x", 200, 10**6)}
        ) as bench:
            bench.run(100 * MS)
            bench.type("x", "M 1000")
            while bench.cell.controller("x").status(bench.cell.now).position < 180 + early:
                bench.run(1 * MS)
            bench.send("x", b"\x1b")
            bench.type("x", "-100")
            bench.run(400 * MS)
            bench.rest()
            assert max(place for _, place in bench.edges("x")) <= 200
            assert bench.position("x") == bench.driven.axes()[0].shaft
            assert bench.driven.axes()[0].standing is Standing.DRIVEN


SLAVE = """
[units.x]
model = "dcb-274"
options = { name = "X" }
[units.y]
model = "dcb-274"
options = { name = "Y" }
[[wires]]
from = "x.P4"
to = "y.STEP"
[[wires]]
from = "x.P5"
to = "y.DIR"
[boards.b]
serial = "fake"
[hardware.x]
board = "b"
step = "gpio2"
dir = "gpio3"
inputs = { LIMIT-A = "^gpio10", LIMIT-B = "^gpio11", HOME = "^gpio12" }
[hardware.y]
board = "b"
step = "gpio4"
dir = "gpio5"
unwired = ["LIMIT-A", "LIMIT-B", "HOME"]
"""


def test_an_axis_that_follows_another_through_the_cell_stands_with_its_true_count() -> None:
    """Steps of the slave have left when its master is stopped: they are counted, and it stands until somebody looks."""
    with Bench(SLAVE, switches={"x.LIMIT-A": ("x", 120, 10**6)}) as bench:
        bench.run(100 * MS)
        for unit, line in (("x", " "), ("x", "l 2"), ("x", "M 800")):
            bench.type(unit, line)
            bench.run(100 * MS)
        bench.run(800 * MS)
        bench.rest()
        assert bench.position("x") == 120
        x, y = bench.driven.axes()
        assert x.standing is Standing.DRIVEN
        assert y.shaft == bench.position("y")
        if y.shaft != 120:
            assert y.standing is Standing.FAULT
            assert "took them back" in y.why
            assert bench.cell.controller("y").status(bench.cell.now).position == y.shaft
            bench.driven.recover()
            bench.run(100 * MS)
        bench.type("x", "-20")
        bench.run(500 * MS)
        bench.rest()
        assert bench.position("x") == 100
        assert bench.position("y") == bench.driven.axes()[1].shaft == y.shaft - 20


BOARDS = """
[units.x]
model = "gs-c200s"
straps = { CHS = "low" }
[units.y]
model = "gs-c200s"
straps = { CHS = "low" }
[boards.left]
serial = "one"
[boards.right]
serial = "two"
[hardware.x]
board = "left"
step = "!gpio2"
dir = "gpio3"
inputs = { EOT = "^gpio10", HOME = "^gpio11" }
[hardware.y]
board = "right"
step = "!gpio2"
dir = "gpio3"
inputs = { EOT = "^gpio10", HOME = "^gpio11" }
"""


def test_two_boards_keep_one_time_and_one_may_fail() -> None:
    switches = {"x.EOT": ("x", 90, 10**6), "x.HOME": ("x", -9, 9), "y.EOT": ("y", 140, 10**6), "y.HOME": ("y", -9, 9)}
    with Bench(BOARDS, switches=switches) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]
        bench.run(100 * MS)
        for unit in "xy":
            bench.type(unit, "S20")
            bench.run(10 * MS)
            bench.type(unit, "H+")
        bench.run(2 * SECOND)
        bench.rest()
        assert bench.position("x") == bench.position("y") == 9
        assert (same_pulses(bench, "x", "x"), same_pulses(bench, "y", "y")) == (90 + 81, 140 + 131)
        assert bench.driven.rollback.rewinds == 4
        bench.type("x", "+400")
        bench.type("y", "+400")
        bench.run(200 * MS)
        bench.ports["right"].unplugged = True
        bench.run(2 * SECOND)
        bench.rest()
        x, y = bench.driven.axes()
        assert (x.standing, y.standing) == (Standing.DRIVEN, Standing.FAULT)
        assert bench.position("x") == 409 == x.shaft
        bench.ports["right"].unplugged = False
        bench.driven.recover()
        bench.run(5 * SECOND)
        assert bench.driven.axes()[1].standing is Standing.DRIVEN
        bench.type("y", "-5")
        bench.rest()
        assert bench.position("y") == bench.driven.axes()[1].shaft


def test_the_master_of_time_may_come_back() -> None:
    """Cell time goes on while the board that keeps it is away, and behind it."""
    with Bench(BOARDS) as bench:
        bench.run(100 * MS)
        bench.ports["left"].unplugged = True
        bench.run(1 * SECOND)
        before = bench.cell.now
        assert 900 * MS < before < 1300 * MS
        bench.ports["left"].board.clear()
        bench.ports["left"].unplugged = False
        bench.driven.recover()
        bench.run(3 * SECOND)
        assert bench.driven.axes()[0].standing is Standing.DRIVEN
        assert abs(bench.cell.now - before - 3 * SECOND) < 50 * MS
        for unit in "xy":
            bench.type(unit, "+30")
        bench.run(1 * SECOND)
        bench.rest()
        assert (bench.position("x"), bench.position("y")) == (30, 30)
        assert not [news for news in bench.news if "slipped" in news.text]


@pytest.mark.parametrize("seed", [0, 9, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(10, 40))])
def test_an_axis_goes_on_evenly_while_the_master_of_time_comes_back(seed: int) -> None:
    """What is known of the new clock differs from the old: no pulse of another board comes out of its turn."""
    random = Random(seed)
    with Bench(BOARDS, jitter=lambda: random.randrange(3 * MS), port={"drift": random.choice([-90.0, 60.0])}) as bench:
        bench.run(100 * MS)
        bench.type("y", "S5")
        bench.run(50 * MS)
        bench.type("y", "g+")
        bench.run(1 * SECOND)
        left = bench.ports["left"]
        left.unplugged = True
        bench.run(1 * SECOND + random.randrange(2 * SECOND))
        left.board.clear()
        left.unplugged = False
        bench.driven.recover()
        bench.run(3 * SECOND)
        assert [state.standing for state in bench.driven.axes()] == [Standing.DRIVEN] * 2
        ticks = [tick for tick, place in bench.edges("y") if place > 150]
        spans = [after - before for before, after in pairwise(ticks)]
        assert max(spans) < min(spans) * 1.01 + 2 * 25 * 16  # its error of a tick or 25 us
        assert not [news for news in bench.news if "slipped" in news.text]


def test_pulses_on_pins_that_become_steps_are_warned_of() -> None:
    """E mode, chosen by a host: pulses that a board does not see would be steps that nobody misses."""
    with Bench(TWO) as bench:
        bench.run(400 * MS)
        assert bench.news == []
        for text in (b"1E", b"0E", b"2E"):
            bench.send("t", text)
            bench.run(200 * MS)
        warning = (
            "t: on Y+ every pulse is a step now, and a board looks at its inputs once a millisecond: steps may be lost"
        )
        assert [news.text for news in bench.news] == [warning] * 2
