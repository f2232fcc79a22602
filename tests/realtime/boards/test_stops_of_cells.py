"""Stops in the firmware take the cell back: homing, limits and holds, against the same cell with ideal switches.

The machine behind the fake board moves its switches with its steps. The same cell, with switches that its own axis
moves, is the ideal: what it says, where it ends, how many steps it makes. Of the driven one the same may come, later.
"""

from random import Random
from typing import NamedTuple

import pytest
from tests.generated import seeds
from tests.realtime.boards.driven_bench import Bench, no_file, pulses

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.ticks import MS, SECOND, US, Ns

BOARD = """
[boards.b]
serial = "fake"
lead = "{lead} ms"
[hardware.x]
board = "b"
step = "gpio2"
dir = "gpio3"
"""


class Case(NamedTuple):
    """A cell with switches: where each is low, and what its host says, with the pause before each."""

    name: str
    unit: str
    inputs: str
    switches: dict[str, tuple[int, int]]
    sends: list[tuple[Ns, str]]
    lasts: Ns


FAR = 10**6


def ideal(case: Case) -> Cell:
    """The cell with switches that its axis moves, run to its end."""
    text = case.unit
    for n, (pin, (low, high)) in enumerate(case.switches.items()):
        text += f'\n[switches.s{n}]\naxis = "x"\nfrom = {low}\nto = {high}\ndrives = "x.{pin}"\n'
    made = build(parse(text, "cell.toml"), no_file, line_timing=False)
    for pause, line in case.sends:
        made.run_to(made.now + pause)
        made.send(0, made.serial_unit("x").frame(line)) if len(line) > 1 else made.send(0, line.encode())
    made.run_to(made.now + case.lasts)
    return made


def drive(case: Case, lead: int, seed: int, **options: object) -> Bench:
    """The cell behind a fake board, as far."""
    random = Random(seed)
    text = case.unit + BOARD.format(lead=lead) + case.inputs
    switches = {f"x.{pin}": ("x", low, high) for pin, (low, high) in case.switches.items()}
    bench = Bench(text, switches=switches, jitter=lambda: random.randrange(300 * US), **options)  # type: ignore[arg-type]
    bench.driven._forget = lambda: None  # type: ignore[method-assign]
    for pause, line in case.sends:
        bench.run(pause)
        bench.type("x", line) if len(line) > 1 else bench.send("x", line.encode())
    bench.run(case.lasts)
    bench.rest()
    return bench


def compare(case: Case, lead: int, seed: int) -> int:
    """Drive it and compare; how many stops there were."""
    wanted, bench = ideal(case), drive(case, lead, seed)
    with bench:
        assert bench.news == [], bench.news
        told = [place for _, place in bench.edges("x")]
        assert wanted.recording is not None
        spans = wanted.recording.motion("x", wanted.now)
        places = [s.shaft + s.direction * n for s in spans for n in range(s.first, s.last + 1)]
        assert told == places, f"{case.name}: {told[-3:]} and not {places[-3:]}"
        assert [place for _, place in pulses(bench.driven.ledgers[0].motions.since(0), bench.cell.now)] == places
        status = wanted.controller("x").status(wanted.now)
        assert bench.cell.controller("x").status(bench.cell.now) == status
        heard = "".join(chr(h.char.value & 127) for h in wanted.lines[0].take())
        assert bench.said("x") == heard
        assert bench.driven.rollback.escaped == 0
        bench.check_inputs()
        bench.check_outputs()
        return bench.driven.rollback.rewinds


def homing(random: Random) -> Case:
    """H of a GS-C200 (datasheet, "Home"): to the end of travel, and back to the home position."""
    way = random.choice([1, -1])
    speed = random.choice([1, 2, 5, 20, 100, 300, 500])
    most = max(min(speed * 20, 600), 3)  # steps, so that it takes two seconds at most
    end = random.randrange(1, most)
    home = random.randrange(-most // 2, end - 1) if end > 1 else -1
    wide = random.randrange(0, 8)
    switches = {"EOT": (end, FAR), "HOME": (home - wide, home)}
    if way < 0:
        switches = {"EOT": (-FAR, -end), "HOME": (-home, -home + wide)}
    unit = '[units.x]\nmodel = "gs-c200"\nstraps = { CHS = "low" }\n'
    inputs = 'inputs = { EOT = "^gpio10", HOME = "^gpio11", ENABLE = "^gpio12" }\n'
    h = "H+" if way > 0 else "H-"
    last = random.choice([1, 3, 30])
    sends = [(100 * MS, f"S{speed}"), (50 * MS, h)]
    lasts = (2 * end - home + 40) * SECOND // (speed * 10) + 200 * MS
    return Case(f"homing {way} {speed} {switches}", unit, inputs, switches,
                [*sends, (lasts, f"+{last}")], last * SECOND // (speed * 10) + 300 * MS)  # fmt: skip


def limits(random: Random) -> Case:
    """A DCB-274 runs into a limit (page 35), back off it, and finds home (page 39)."""
    place = random.randrange(3, 500)
    rate = random.choice([200, 600, 1500, 3000])
    switches = {"LIMIT-A": (place, FAR), "LIMIT-B": (-FAR, -place), "HOME": (-place // 3 - 40, -place // 3)}
    unit = '[units.x]\nmodel = "dcb-274"\n'
    inputs = 'inputs = { LIMIT-A = "^gpio10", LIMIT-B = "^gpio11", HOME = "^gpio12" }\n'
    there = 2 * place * SECOND // min(rate, 400) + 700 * MS
    kind = random.choice(["+{n}", "M {r}", "-{n}", "M -{r}", "F {r} 0", "F {r} 1"])
    line = kind.format(n=place + 50, r=rate)
    return Case(f"limits {line} {place}", unit, inputs, switches,
                [(100 * MS, " "), (200 * MS, line), (there, "\x1b"), (100 * MS, "Z 0")], 300 * MS)  # fmt: skip


def origination(random: Random) -> Case:
    """SUPERSIGMA: backward to the limit switch, then off it."""
    place = random.randrange(1, 60)
    switches = {"RAIL": (-FAR, -place)}
    unit = '[units.x]\nmodel = "supersigma"\n'
    return Case(f"origination {place}", unit, 'inputs = { RAIL = "^gpio10", FORCE = "^gpio11" }\n', switches,
                [(100 * MS, "originate")], (place + 20) * 30 * MS)  # fmt: skip


KINDS = {"homing": homing, "limits": limits, "origination": origination}


@pytest.mark.parametrize("kind", KINDS)
def test_a_stop_is_where_an_ideal_switch_would_stop_it(kind: str) -> None:
    stops = 0
    for seed in seeds(12):
        random = Random(seed)
        stops += compare(KINDS[kind](random), random.choice([4, 8, 20, 30, 50]), seed)
    assert stops >= 2


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_many_stops_are_where_ideal_switches_would_stop_them(kind: str) -> None:
    stops = 0
    for seed in range(100, 300):
        random = Random(seed)
        stops += compare(KINDS[kind](random), random.choice([4, 8, 20, 30, 50]), seed)
    assert stops >= 150
