"""A computer that is kept away, at any point of its loop and for any time: a slip that is told, and nothing else.

The stall falls on a look at the clock, wherever that is, or on a write: before it, behind it, or in the middle of a
block. No step is lost, no pulse comes sooner behind another than the cell gave it, and at the next rest the counts are
equal. Steps that come too late never shut a board down. What has a time and no step before it, and comes behind that
time, does: the first step of a motion and what guards it, and a change of an output. Then that is told, and `recover`
goes on from the count.
"""

from itertools import pairwise
from random import Random

import pytest
from tests.generated import seeds
from tests.realtime.boards.driven_bench import Bench, pulses

from detent.realtime.boards.states import Severity, Standing
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
EXPOSED = {"trsync_start", "trsync_set_timeout", "endstop_home", "queue_digital_out"}
"""What shuts a board down where it comes later than it says, for want of a step before it that could run dry."""
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


def session(seed: int, *, writes: bool) -> tuple[int, int]:
    """A host that says what it likes while the computer is away now and then; slips, and boards shut down."""
    random = Random(seed)
    away = Away(random, random.choice([0.002, 0.01]), random.choice([20 * MS, 80 * MS, 300 * MS]), writes=writes)
    small = {"moves": 48} if random.random() < 0.3 else {}
    board = {"window": random.choice([None, 192]), **small}
    spare = random.random() < 0.7
    with Bench(GS, away=away, jitter=lambda: random.randrange(200 * US), board=board, spare_exposed=spare) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]
        fake = bench.ports["b"].board
        bench.run(100 * MS)
        away.on = True
        down = 0
        for _ in range(random.randrange(3, 10)):
            bench.type("x", random.choice(LINES).format(n=random.randrange(1, 800)))
            bench.run(random.choice([3 * MS, 40 * MS, 200 * MS, 700 * MS]) + random.randrange(MS))
            if fake.reason is not None:
                assert writes, "it looked at its clock behind everything that takes time"
                assert not spare
                down += 1
                assert fake.gave_up_at in EXPOSED, "steps were late, and the board gave up"
                away.on = False
                bench.run(100 * MS)
                state = bench.driven.axes()[0]
                assert state.standing is Standing.FAULT
                assert "shut down: Timer too close" in state.why
                bench.driven.recover()
                bench.run(100 * MS)
                assert bench.driven.axes()[0].standing is Standing.DRIVEN
                away.on = True
        away.on = False
        bench.run(50 * MS)
        if fake.reason is not None:
            bench.driven.recover()
            down += 1
        bench.type("x", "K")
        bench.run(SECOND)
        bench.rest()
        state = bench.driven.axes()[0]
        assert sum(news.severity is Severity.FAULT for news in bench.news) == down, bench.news
        assert state.standing is Standing.DRIVEN
        assert bench.boards.boards["b"].state.value == "ready"
        assert state.shaft == bench.position("x")
        assert state.shaft == bench.boards.steppers["x"].counted()
        assert bench.driven.rollback.escaped == 0
        assert sum("slipped" in news.text for news in bench.news) == state.slips
        if not down:
            never_closer(bench)
            assert state.slips <= away.stalls, "a stall is one slip at most"
        return state.slips, down


def held_up(seed: int) -> tuple[int, int]:
    """A wire that stands now and then, while its host goes on, and loses blocks; slips, and boards shut down.

    What has a time and no step before it may be on the wire then.
    """
    random, on = Random(seed), [False]

    def hold() -> Ns:
        return random.randrange(150 * MS) if on[0] and random.random() < 0.005 else 0

    def spoil(data: bytes, to_board: bool) -> list[bytes]:
        return [] if on[0] and to_board and random.random() < 0.01 else [data]

    with Bench(GS, jitter=lambda: random.randrange(200 * US), port={"spoil": spoil}) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]
        fake = bench.ports["b"].board
        bench.ports["b"].hold = hold
        bench.run(100 * MS)
        down = 0
        for _ in range(random.randrange(2, 6)):
            on[0] = True
            bench.type("x", random.choice(LINES).format(n=random.randrange(1, 800)))
            bench.run(random.choice([40 * MS, 200 * MS, 700 * MS]))
            on[0] = False
            bench.run(150 * MS)
            if fake.reason is not None:
                down += 1
                assert fake.gave_up_at in EXPOSED, "steps were late, and the board gave up"
                bench.driven.recover()
                bench.run(100 * MS)
        bench.type("x", "K")
        bench.run(SECOND)
        bench.rest()
        state = bench.driven.axes()[0]
        assert state.standing is Standing.DRIVEN
        assert sum(news.severity is Severity.FAULT for news in bench.news) == down, bench.news
        assert state.shaft == bench.position("x") == bench.boards.steppers["x"].counted()
        if not down:
            never_closer(bench)
        return state.slips, down


def test_the_first_motion_of_an_axis_runs_dry_where_it_was_to_begin_before_it_slipped() -> None:
    """Its time-out was set before the lag grew: placed by the new one it was before all that the cell had done."""
    session(536, writes=False)


@pytest.mark.slow
def test_a_wire_that_stands_is_a_slip_in_many_sessions() -> None:
    counts = [held_up(seed) for seed in range(100, 400)]
    assert sum(slips for slips, _ in counts) > 80


def test_a_wire_that_stands_is_a_slip() -> None:
    assert sum(held_up(6 + seed)[0] for seed in seeds(24)) > 0


def never_closer(bench: Bench) -> None:
    """The pulses of the cell, all of them, and none sooner behind the one before than it gave them."""
    told = pulses(bench.driven.ledgers[0].motions.since(0), bench.cell.now)
    edges = bench.edges("x")
    assert [place for _, place in edges] == [place for _, place in told]
    scale = bench.boards.boards["b"].core.scale
    behind = [scale.time(tick) - at for (tick, _), (at, _) in zip(edges, told, strict=True)]
    for n, (before, late) in enumerate(pairwise(behind), 1):
        if late < before - 3 * US:  # a rest has caught up
            assert edges[n][0] - edges[n - 1][0] > bench.boards.boards["b"].core.ticks(15 * MS)


@pytest.mark.parametrize("part", range(3))
def test_a_stall_at_any_look_at_the_clock_is_a_slip(part: int) -> None:
    assert sum(session(seed, writes=False)[0] for seed in range(8 * part, 8 * part + len(seeds(8)))) > 0


@pytest.mark.parametrize("part", range(3))
def test_a_stall_within_a_write_is_a_slip_too(part: int) -> None:
    assert sum(session(seed, writes=True)[0] for seed in range(30 + 8 * part, 30 + 8 * part + len(seeds(8)))) > 0


@pytest.mark.parametrize("delay", [20 * MS, 90 * MS])
def test_a_slow_wire_is_no_dead_board(delay: int) -> None:
    """A computer that boots gives the wire its turn late: while something comes, it is waited for."""
    with Bench(GS, port={"delay": delay}) as bench:
        assert bench.boards.ready


@pytest.mark.slow
@pytest.mark.parametrize("writes", [False, True])
def test_a_stall_anywhere_is_a_slip_in_many_sessions(writes: bool) -> None:
    counts = [session(seed, writes=writes) for seed in range(100, 700)]
    assert sum(slips for slips, _ in counts) > 800
    assert sum(down for _, down in counts) <= (40 if writes else 0)


OPEN = GS.replace('inputs = { EOT = "^gpio10", HOME = "^gpio11", ENABLE = "^gpio12" }', 'unwired = ["EOT", "HOME"]')
"""Nothing takes back what it does, so that outputs are given to the board as soon as they are known."""
BARE = OPEN.replace('enable = "gpio4"', "").replace('outputs = { MOV = "gpio6", RDY = "!gpio7", RAMP = "gpio8" }', "")
WATCHED = BARE.replace('unwired = ["EOT", "HOME"]', 'inputs = { EOT = "^gpio10", HOME = "^gpio11" }')


@pytest.mark.parametrize("seed", range(8))
def test_a_unit_that_is_late_has_its_outputs_within_their_watchdog(seed: int) -> None:
    """The firmware takes no change for later than the end of the watchdog, and shuts down where it is told one."""
    random = Random(seed)
    with Bench(OPEN.replace('lead = "30 ms"', 'lead = "30 ms"\nwatchdog = "200 ms"')) as bench:
        bench.run(100 * MS)
        bench.type("x", f"+{random.randrange(100, 900)}")
        bench.run(random.randrange(60, 100) * MS)
        bench.stall(148 * MS)
        bench.run(2 * SECOND)
        bench.rest()
        state = bench.driven.axes()[0]
        assert state.standing is Standing.DRIVEN, state.why
        assert state.slips == 1
        assert state.shaft == bench.position("x")
        bench.check_outputs()


@pytest.mark.parametrize(("away", "text"), [(5 * SECOND, WATCHED), (9 * SECOND, BARE)])
def test_a_unit_may_be_later_than_its_clock_counts(away: Ns, text: str) -> None:
    """A process that was stopped goes on as late as it is; the 32 bits of the board's clock go round in 8 s."""
    with Bench(text, board={"frequency": 520_000_000}) as bench:
        bench.keep()
        bench.run(100 * MS)
        bench.type("x", "+3000")
        bench.run(300 * MS)
        bench.stall(away)
        bench.run(2 * SECOND)
        bench.type("x", "Z")
        for rest in (200 * MS, 2500 * MS, 5 * SECOND):
            bench.run(rest)
            bench.type("x", "-400")
        bench.run(5 * SECOND)
        bench.rest(100 * SECOND)
        state = bench.driven.axes()[0]
        assert state.standing is Standing.DRIVEN, state.why
        assert state.shaft == bench.position("x")
        edges = bench.edges("x")
        told = pulses(bench.driven.ledgers[0].motions.since(0), bench.cell.now)
        assert [place for _, place in edges] == [place for _, place in told]
        for (tick, after), (at, following) in zip(pairwise(edges), pairwise(told), strict=True):
            if following[0] - at[0] < away:  # a rest as long as the lag is: in time again behind it
                assert after[0] - tick[0] >= (following[0] - at[0] - 2 * US) * 520 // 1000
