"""What hosts say between a moment that is kept and a stop is lived through again, however much it is."""

from typing import Any

import pytest
from tests.realtime.boards.driven_bench import Bench

from detent.realtime.boards import past
from detent.realtime.boards.states import Standing
from detent.realtime.watch import RecentLog
from detent.ticks import MS, SECOND

TEXT = """
[units.x]
model = "gs-c200s"
straps = { CHS = "low" }
[hardware.x]
board = "b"
step = "gpio2"
dir = "gpio3"
inputs = { ENABLE = "^gpio12" }
unwired = ["EOT", "HOME"]
[units.y]
model = "gs-c200s"
straps = { CHS = "low" }
[hardware.y]
board = "b"
step = "gpio4"
dir = "gpio5"
unwired = ["EOT", "HOME"]
[units.z]
model = "gs-c200s"
[boards.b]
serial = "fake"
lead = "60 ms"
"""


def flooded(at: int, characters: int) -> Bench:
    """x meets the end of its way at 300; as its motor is `at`, y is sent off, and another host floods its line."""
    bench = Bench(TEXT, switches={"x.ENABLE": ("x", 300, 10**6)})
    bench.run(400 * MS)
    for line in ("S20", "T100", "R10"):
        for unit in "xy":
            bench.type(unit, line)
        bench.run(60 * MS)
    bench.type("x", "+400")
    while bench.position("x") < at:
        bench.run(1 * MS)
    bench.type("y", "+200")
    bench.run(6 * MS)
    for _ in range(characters):
        bench.send("z", b"q")
    bench.rest(20 * SECOND)
    return bench


@pytest.mark.parametrize("at", [270, 290])
def test_a_flood_of_characters_before_a_stop_loses_no_command(at: int) -> None:
    with flooded(at, 9_000) as bench:
        assert [bench.position("x"), bench.position("y")] == [300, 200]
        assert bench.driven.rollback.rewinds == 1
        assert bench.news == []


def test_an_axis_is_not_taken_back_to_what_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """It stands, with the reason, where the motor is; and the other goes on."""

    class Short(RecentLog[Any]):
        def __init__(self) -> None:
            super().__init__(100)

    monkeypatch.setattr(past, "RecentLog", Short)
    with flooded(270, 900) as bench:
        x, y = bench.driven.axes()
        assert (x.standing, x.shaft, bench.position("x")) == (Standing.FAULT, 300, 300)
        assert "nobody knows when that was" in x.why
        assert (y.standing, y.shaft, bench.position("y")) == (Standing.DRIVEN, 200, 200)
