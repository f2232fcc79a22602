"""Random programs of starts and stops on every controller, through a fake board in virtual time.

The steps on the pins are the pulses of the cell: as many, in the same directions, each within the error and a tick of
its time and a lead. At rest the machine, the firmware and the counter say the same.
"""

from random import Random

import pytest
from tests.generated import seeds
from tests.realtime.boards.driven_bench import Bench, pulses

from detent.ticks import MS, SECOND, US, Ns

ERROR = 1 * US

BOARD = """
[boards.b]
serial = "fake"
lead = "{lead} ms"
"""

GSC200 = """
[units.x]
model = "gs-c200s"
straps = {{ CHS = "low" }}
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
enable = "!gpio4"
outputs = {{ MOV = "gpio6", RDY = "gpio7", RAMP = "gpio8", UO1 = "gpio9" }}
inputs = {{ UI1 = "^gpio12" }}
unwired = ["EOT", "HOME"]
"""
SEPARATE = GSC200.replace("[hardware.x]", 'options = {{ clock = "separate" }}\n[hardware.x]').replace(
    'step = "!gpio2"', 'step = "!gpio2"\nminus = "!gpio5"'
)
DCB274 = """
[units.x]
model = "dcb-274"
[hardware.x]
board = "b"
step = "gpio2"
dir = "!gpio3"
outputs = {{ P5 = "gpio6" }}
inputs = {{ JOG1 = "^gpio12" }}
unwired = ["LIMIT-A", "LIMIT-B", "HOME"]
"""
GENSTEPPER = """
[units.x]
model = "bs0610"
[hardware.x]
board = "b"
outputs = {{ RDY = "gpio20" }}
[hardware.x.X]
board = "b"
step = "gpio2"
dir = "gpio3"
unwired = ["LX-", "LX+"]
[hardware.x.Y]
board = "b"
step = "gpio4"
dir = "gpio5"
unwired = ["LY-", "LY+"]
"""
SUPERSIGMA = """
[units.x]
model = "supersigma"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
outputs = {{ P23 = "gpio6" }}
inputs = {{ FORCE = "^gpio12" }}
unwired = ["RAIL"]
"""

PROGRAMS = {
    "gs-c200s": (GSC200, ["+{n}", "-{n}", "+{n}", "g+", "g-1", "S{s}", "T{t}", "R30", "Z", "K", "Z", "V1", "F"]),
    "separate clocks": (SEPARATE, ["+{n}", "-{n}", "g-", "S{s}", "T{t}", "Z", "K"]),
    "dcb-274": (DCB274, ["+{n}", "-{n}", "M {t}0", "M -{t}0", "M 0", "@", "\x1b", "Z 0", "K {s} 5", "R {n}", "|"]),
    "bs0610": (GENSTEPPER, ["X{n}G", "Y-{n}G", "B+S", "X-S", "BZ", "XZ", "Y{t}0R", "X{n}G", "B-1?", "XI", "!"]),
    "supersigma": (SUPERSIGMA, ["move {n} forward", "move {n} back", "constant {n} forward {t}", "stop", "emergency"]),
}


def typed(bench: Bench, model: str, text: str, random: Random) -> None:
    if model == "supersigma":
        n, speed = random.randrange(1, 700), random.randrange(1, 60)
        code = random.choice([0x01, 0x81, 0x02, 0x82, 0x03, 0x83, 6, 7])
        data = bytes([1, code])
        if code & 0x7F in (1, 2, 3):
            data += n.to_bytes(2, "big")
        if code & 0x7F in (2, 3):
            data += bytes([speed])
        bench.send("x", data)
        return
    line = text.format(n=random.randrange(1, 400), s=random.randrange(1, 40), t=random.randrange(40, 100))
    if line in ("\x1b", "@", "|") or model == "bs0610":
        bench.send("x", line.encode())
    else:
        bench.type("x", line)


def check(bench: Bench, through: Ns) -> int:
    """The steps on the pins are those of the cell, all of them; how many there are."""
    port = bench.ports["b"]
    count = 0
    for ledger in bench.driven.ledgers:
        wanted = pulses(ledger.motions.since(0), through)
        edges = bench.edges(ledger.name)
        assert [place for _, place in edges] == [place for _, place in wanted], ledger.name
        scale = bench.boards.boards["b"].core.scale
        tick_ns = SECOND / port.board.frequency
        slips = ledger.stepper.slips or ledger.stepper.lag
        for (tick, _), (at, _) in zip(edges, wanted, strict=True):
            off = (tick - scale.tick(at)) * tick_ns
            if not slips:
                assert abs(off) <= ERROR + tick_ns, f"{ledger.name}: {off} ns at {at}"
            assert off >= -(ERROR + tick_ns)
        state = next(s for s in bench.driven.axes() if (s.unit, s.axis) == (ledger.what.unit, ledger.what.axis))
        assert bench.position(ledger.name) == state.shaft
        controller = bench.cell.controller(ledger.what.unit)
        assert controller.status(bench.cell.now, ledger.what.axis).pulses == len(edges)
        count += len(edges)
    return count


def run(model: str, seed: int) -> int:
    """One random program; how many steps it made."""
    random = Random(seed)
    text, lines = PROGRAMS[model]
    lead = random.choice([8, 20, 30])
    cell = text.format() + BOARD.format(lead=lead)
    drift = random.choice([0.0, 47.0, -80.0])
    with Bench(cell, port={"drift": drift}, jitter=lambda: random.randrange(200 * US)) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]  # all of it is compared
        bench.run(300 * MS)
        typed(bench, model, lines[0], random)
        for _ in range(random.randrange(2, 12)):
            bench.run(random.choice([2 * MS, 15 * MS, 90 * MS, 400 * MS]) + random.randrange(MS))
            if random.random() < 0.04:
                bench.power("x", random.random() < 0.5)
            else:
                typed(bench, model, random.choice(lines), random)
        bench.run(200 * MS)
        bench.power("x", True)
        for stop in {"gs-c200s": ["K"], "separate clocks": ["K"], "dcb-274": ["\x1b"], "bs0610": ["!"],
                     "supersigma": []}[model]:  # fmt: skip
            typed(bench, model, stop, random)
        bench.rest()
        assert not [news for news in bench.news if news.severity.value == "fault"], bench.news
        assert all(state.standing.value == "driven" for state in bench.driven.axes())
        return check(bench, bench.cell.now)


@pytest.mark.parametrize("model", PROGRAMS)
def test_edges_are_the_pulses_of_the_cell(model: str) -> None:
    assert sum(run(model, seed) for seed in seeds(8)) > 30


@pytest.mark.slow
@pytest.mark.parametrize("model", PROGRAMS)
def test_edges_are_the_pulses_of_the_cell_in_many_programs(model: str) -> None:
    assert sum(run(model, seed) for seed in range(1_000, 1_200)) > 10_000
