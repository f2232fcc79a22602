"""Random sessions that write memory, with limits, late computers and boards that fail: what is stored is what happened.

The ideal is the same cell without boards, to which was done what the driven one has in its journal at the end. What it
stored is what is on the disk, in that order and nothing twice; never sooner than no stop can take it back, and never
behind the answer to it.
"""

from random import Random

import pytest
from tests.realtime.boards.driven_bench import Bench, no_file

from detent.cell.build import build
from detent.cell.description import parse
from detent.realtime.boards.states import Severity
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
enable = "gpio4"
inputs = {{ LIMIT-A = "^gpio10", LIMIT-B = "^gpio11", HOME = "^gpio12", JOG1 = "^gpio13", JOG2 = "^gpio14" }}
"""
MOVES = ("+{n}", "-{n}", "M {r}", "M -{r}", "F {r} 0", "F {r} 1", "@", "\x1b", "R {n}", "Z 0")
WRITES = ("S", "\\ {a} {b}", "K {b} 5", "\\ {a} {b}")


class Disk:
    """What was stored."""

    def __init__(self) -> None:
        self.images: list[bytes] = []

    def __call__(self, unit: str, image: bytes) -> bool:
        self.images.append(image)
        return True


class Session:
    """One of them. `rough`: the board is unplugged, restarted, stopped by hand and recovered, too."""

    def __init__(self, seed: int, *, rough: bool) -> None:
        self.random = random = Random(seed)
        self.rough, self.on, self.disk = rough, False, Disk()
        edge = random.randrange(30, 300)
        self.switches = {
            "x.LIMIT-A": ("x", edge, 10**6), "x.LIMIT-B": ("x", -(10**6), -edge), "x.HOME": ("x", -20, -10),
        }  # fmt: skip
        self.text = CELL.format(lead=random.choice([5, 10, 30, 60]))
        chance = random.choice([0.0, 0.001, 0.003])

        def away(_: bool) -> Ns:
            return random.randrange(90 * MS) if self.on and random.random() < chance else 0

        self.bench = Bench(
            self.text, switches=self.switches, store=self.disk, jitter=lambda: random.randrange(400 * US), away=away,
            spare_exposed=True,
        )  # fmt: skip

    def say(self) -> None:
        random = self.random
        line = random.choice(MOVES + WRITES).format(
            n=random.randrange(1, 600), r=random.randrange(200, 3000), a=random.randrange(1024, 1030),
            b=random.randrange(1, 200),
        )  # fmt: skip
        if len(line) == 1 and line != "S":
            self.bench.send("x", line.encode())
        else:
            self.bench.type("x", line)

    def befall(self) -> None:
        bench, random, port = self.bench, self.random, self.bench.ports["b"]
        self.on = False
        match random.randrange(4):
            case 0:
                port.unplugged = True
                bench.run(random.choice([1 * MS, 60 * MS]))
            case 1 if not port.unplugged:
                port.board.power_cycle()
                bench.run(random.choice([1 * MS, 1200 * MS]))
            case 2:
                bench.driven.stop()
            case _:
                bench.come_back()
        self.on = True

    def ideal(self) -> list[bytes]:
        """What the cell stored to which the same was done, without boards."""
        images: list[bytes] = []

        def store(unit: str, image: bytes) -> bool:
            images.append(image)
            return True

        driven, bench = self.bench.cell, self.bench
        levels = dict.fromkeys(bench.plan.inputs.values(), 1)
        made = build(parse(self.text, "cell.toml"), no_file, store=store, line_timing=False,
                     journal=driven.journal.since(0), inputs=levels)  # fmt: skip
        made.run_to(driven.now)
        assert made.controller("x").status(made.now) == driven.controller("x").status(driven.now)
        return images

    def listen(self) -> None:
        """No host hears an answer before what was stored for it is on the disk."""
        bench, hear = self.bench, self.bench.loop._tell

        def heard(wall: Ns) -> None:
            hear(wall)
            for line in bench.heard:
                assert not line or line[-1][1] < bench.stores.first

        bench.loop._tell = heard  # type: ignore[method-assign]

    def run(self) -> int:
        """How many images were stored."""
        random, bench = self.random, self.bench
        with bench:
            self.listen()
            bench.run(100 * MS)
            bench.type("x", " ")
            bench.run(200 * MS)
            self.on = True
            for _ in range(random.randrange(5, 20)):
                self.say()
                bench.run(random.choice([1 * MS, 8 * MS, 40 * MS, 200 * MS]) + random.randrange(MS))
                if random.random() < 0.15:
                    bench.stall(random.randrange(5 * MS, 120 * MS))
                if random.random() < 0.2:
                    bench.press(random.choice(["x.JOG1", "x.JOG2"]), random.randrange(2))
                if self.rough and random.random() < 0.2:
                    self.befall()
            self.on = False
            for _ in range(2 if self.rough else 0):
                bench.come_back()
            for name in ("x.JOG1", "x.JOG2"):
                bench.press(name, 1)
            bench.send("x", b"\x1b")
            bench.rest()
            assert self.disk.images == self.ideal(), bench.news
            assert self.disk.images == [] or self.disk.images[-1] == bench.cell.controller("x").kept_memory()
            assert bench.driven.rollback.escaped == 0
            assert self.rough or not [news for news in bench.news if news.severity is Severity.FAULT], bench.news
            return len(self.disk.images)


@pytest.mark.parametrize("rough", [False, True])
def test_what_is_stored_is_what_an_ideal_cell_stored(rough: bool) -> None:
    assert sum(Session(seed, rough=rough).run() for seed in range(4)) > 4


@pytest.mark.slow
@pytest.mark.parametrize("rough", [False, True])
def test_what_is_stored_is_what_an_ideal_cell_stored_in_many_sessions(rough: bool) -> None:
    assert sum(Session(seed, rough=rough).run() for seed in range(100, 300)) > 300
