"""Two clocks that part: the board's stands now and then, or goes on while the host's stands (a computer that slept).

No crystal does that; a board that is a process on a busy computer does, and so does a host that is suspended. What
was known of the clock is wrong then, and a line through what was seen before and behind would be wrong for long.
"""

from itertools import pairwise
from random import Random

import pytest
from tests.realtime.boards.driven_bench import Bench, pulses
from tests.realtime.boards.test_stalls import GS

from detent.realtime.boards.clock import Clock
from detent.realtime.boards.states import Standing
from detent.ticks import MS, SECOND, US, Ns

FREQUENCY = 16_000_000


@pytest.mark.parametrize("drift", [-5000, -40, 0, 100, 5000])
@pytest.mark.parametrize("jump", [-30 * SECOND, -20 * MS, 20 * MS, 30 * SECOND])
def test_a_jump_is_known_behind_two_round_trips(jump: Ns, drift: int) -> None:
    random = Random(jump)
    clock, wall, off = Clock(FREQUENCY), 0, 0

    def true(at: Ns) -> int:
        return (at + off) * FREQUENCY * (1_000_000 + drift) // (1_000_000 * SECOND)

    def trip(at: Ns) -> bool:
        there, back = random.randrange(60, 200) * US, random.randrange(60, 300) * US
        return clock.note(true(at + there), at, at + there + back)

    for second in range(40):
        fits = trip(wall)
        assert fits is (second != 20)
        if not fits:
            wall += 1 * MS
            assert trip(wall)
        if second > 29 or 9 < second < 20:
            for ahead in (0, SECOND):
                assert abs(clock.tick_at(wall + ahead) - true(wall + ahead)) < 300 * US * FREQUENCY // SECOND
        elif second == 20:
            assert abs(clock.tick_at(wall) - true(wall)) < 200 * US * FREQUENCY // SECOND
        wall += 985 * MS
        off += jump if second == 19 else 0


def test_one_answer_that_does_not_fit_is_not_believed() -> None:
    """A host that was kept away between its clock and the wire has the wrong time of one round trip."""
    clock = Clock(FREQUENCY)
    for second in range(10):
        clock.note(FREQUENCY * second + 1600, second * SECOND, second * SECOND + 200 * US)
    before = clock.tick_at(20 * SECOND)
    assert not clock.note(FREQUENCY * 10 + 800_000, 10 * SECOND, 10 * SECOND + 200 * US)
    assert clock.tick_at(20 * SECOND) == before
    assert clock.note(FREQUENCY * 10 + 17_600, 10 * SECOND + MS, 10 * SECOND + MS + 200 * US)
    assert abs(clock.tick_at(20 * SECOND) - before) < 100 * US * FREQUENCY // SECOND


def stood(seed: int) -> None:
    """The clock of a board stands now and then while its axis moves; then it runs freely. Nothing is told but slips."""
    random = Random(seed)
    with Bench(GS, jitter=lambda: random.randrange(200 * US)) as bench:
        bench.run(100 * MS)
        port = bench.ports["b"]
        for stands in (True, False):
            end = bench.wall + 5 * SECOND
            bench.type("x", f"T{random.randrange(300, 3000)}")
            while bench.wall < end:
                bench.type("x", random.choice(("+{n}", "-{n}", "Z", "A1", "C1")).format(n=random.randrange(1, 500)))
                bench.run(random.randrange(400 * MS))
                if stands and random.random() < 0.9:
                    port.stand(random.randrange(12 * MS))
            assert port.board.reason is None, port.board.gave_up_at
        bench.rest()
        state = bench.driven.axes()[0]
        assert state.standing is Standing.DRIVEN, state.why
        assert state.shaft == bench.position("x")


@pytest.mark.parametrize("seed", [2, 21, 28, 30])
def test_a_board_whose_clock_stands_now_and_then_never_shuts_down(seed: int) -> None:
    """As the firmware's process does where it is kept from running and its clock with it.

    A count was compared before the last steps had come: the host's estimate said that they had.
    """
    stood(seed)


@pytest.mark.slow
def test_clocks_that_stand_make_no_count_differ_in_many_sessions() -> None:
    for seed in range(50):
        stood(seed)


@pytest.mark.parametrize("slept", [3 * SECOND, 100 * SECOND, 3600 * SECOND])
def test_a_computer_that_slept_recovers_at_the_first_time(slept: Ns) -> None:
    """Its own clock has stood, and the board's has gone on."""
    with Bench(GS) as bench:
        bench.run(100 * MS)
        bench.type("x", "+3000")
        bench.run(700 * MS)
        bench.ports["b"].stand(-slept)
        bench.run(300 * MS)
        assert bench.driven.axes()[0].standing is Standing.FAULT
        bench.driven.recover()
        bench.run(100 * MS)
        assert bench.driven.axes()[0].standing is Standing.DRIVEN
        bench.type("x", "+100")
        bench.run(3 * SECOND)
        bench.rest()
        state = bench.driven.axes()[0]
        assert state.standing is Standing.DRIVEN, state.why
        assert state.shaft == bench.position("x")


@pytest.mark.parametrize("frequency", [16_000_000, 520_000_000])
@pytest.mark.parametrize("wraps", [0.4, 0.6, 0.9, 1.4, 7.7])
def test_a_cell_answers_as_soon_as_its_computer_has_slept(frequency: int, wraps: float) -> None:
    """Whatever part of the 32 bits of the board's clock has gone by meanwhile: its time goes on, and never stands.

    A cell that stood would make what it is told now a minute later, when nobody expects a motion any more.
    """
    outputs = ('enable = "gpio4"', 'outputs = { MOV = "gpio6", RDY = "!gpio7", RAMP = "gpio8" }')
    with Bench(GS.replace(outputs[0], "").replace(outputs[1], ""), board={"frequency": frequency}) as bench:
        bench.run(100 * MS)
        bench.type("x", "+100")
        bench.run(SECOND)
        bench.rest()
        bench.ports["b"].stand(-round(wraps * (1 << 32) * SECOND / frequency))
        bench.run(1200 * MS)
        before = bench.cell.now
        bench.run(300 * MS)
        assert 299 * MS <= bench.cell.now - before <= 302 * MS
        bench.type("x", "+10")
        bench.run(500 * MS)
        assert bench.said("x").endswith("Y\r")
        assert bench.position("x") == bench.driven.axes()[0].shaft == 110
        assert bench.driven.axes()[0].standing is Standing.DRIVEN


TWO = "".join(
    f"""
[units.{unit}]
model = "gs-c200s"
straps = {{ CHS = "low" }}
[boards.{unit}]
serial = "fake {unit}"
[hardware.{unit}]
board = "{unit}"
step = "gpio2"
dir = "gpio3"
unwired = ["EOT", "HOME"]
"""
    for unit in "ab"
)


@pytest.mark.parametrize("seed", [9, 11, 16, 22])
def test_two_boards_whose_clocks_part_keep_to_the_speed_of_their_motors(seed: int) -> None:
    """One clock is known to have parted sooner than the other: a line through both would be steep, or run backwards."""
    random = Random(seed)
    frequency = random.choice([12_000_000, 16_000_000, 520_000_000])
    with Bench(TWO, board={"frequency": frequency}, port={"drift": random.choice([-100, 0, 150])}) as bench:
        bench.keep()
        bench.run(100 * MS + random.randrange(SECOND))
        for _ in range(5):
            for unit in "ab":
                bench.type(unit, f"{random.choice('+-')}{random.randrange(1, 900)}")
            bench.run(random.randrange(900 * MS))
            which = random.choice([["a"], ["b"], ["a", "b"], []])
            span = random.choice([5 * MS, 30 * MS, 400 * MS, 3 * SECOND]) * random.choice([-1, -1, 1])
            for name in which:
                bench.ports[name].stand(min(span, SECOND))
            bench.run(random.randrange(2 * SECOND))
            bench.driven.recover()
            bench.run(random.randrange(600 * MS))
        bench.run(6 * SECOND)
        bench.driven.recover()
        bench.run(3 * SECOND)
        for unit in "ab":
            bench.type(unit, "+20")
        bench.rest()
        for state, ledger in zip(bench.driven.axes(), bench.driven.ledgers, strict=True):
            assert state.standing is Standing.DRIVEN, state.why
            assert state.shaft == bench.position(state.unit)
            told = pulses(ledger.motions.since(0), bench.cell.now)
            least = min(after[0] - before[0] for before, after in pairwise(told))
            edges = bench.edges(state.unit)
            assert min(after[0] - before[0] for before, after in pairwise(edges)) * SECOND > 0.98 * least * frequency
