"""The memory that a day on the workbench takes: 24 h of the drilling cell as fast as it goes, with the default bound.

What counts is what stays resident in both processes together: the engine with the cell and its past, and the pages, for
which this process stands.
"""

import asyncio
import sys
from pathlib import Path
from time import perf_counter

from bench.rows import Row
from detent.ticks import SECOND, Ns
from detent.workbench.client import Bench
from detent.workbench.messages import Order

CELL = Path(__file__).parents[1] / "examples" / "drilling" / "bar-after-bar.toml"
HOUR: Ns = 3600 * SECOND
HOURS = 24
SHIFT = 8  # hours; then the cell is switched off and on, as the counter of the bar overflows in the tenth (E5)
BOUND = Order("", (), (), (), None, True, None, False).memory  # MB, the default


def rows() -> list[Row]:
    first, most, last, kept = asyncio.run(_lived(HOURS))
    return [
        Row(f"resident after {HOURS} h of the drilling cell", last, "MB", "after 1 h", first, BOUND),
        Row("the most of it at any hour", most, "MB", "after 1 h", first, BOUND),
        Row("of those the past that is kept", kept, "h", "lived", HOURS, None),
    ]


async def _lived(hours: int) -> tuple[float, float, float, float]:
    """MB after the first hour, at most, and at the end; how many hours of the past are kept then."""
    found: list[float] = []
    begin = perf_counter()
    bench = await Bench.open(str(CELL), pace=None)
    try:
        for hour in range(1, hours + 1):
            if hour > 1 and hour % SHIFT == 1:
                await _switched_on_again(bench)
            await bench.until(lambda state, until=hour * HOUR: state.now >= until)  # type: ignore[misc]
            assert bench.engine_pid is not None
            found.append(_resident(bench.engine_pid) + _resident("self"))
            took = perf_counter() - begin
            left = took / hour * (hours - hour)
            print(f"  {hour} h: {found[-1]:.0f} MB; {left:.0f} s left", file=sys.stderr, flush=True)
        return found[0], max(found), found[-1], (bench.state.end - bench.state.begin) / HOUR
    finally:
        await bench.close()


async def _switched_on_again(bench: Bench) -> None:
    """Every unit off and on, its program loaded and started: the drill first, which the bar calls for 0.1 s only."""
    units = list(bench.picture.units)
    for on in (False, True):
        for unit in units:
            await bench.power(unit, on)
    for unit in units:
        checked = bench.program(unit).check(bench.sources[unit])
        await bench.load(unit, checked.image, checked.base)
    for unit in reversed(units):
        await bench.start(unit)


def _resident(process: int | str) -> float:
    """MB of a process that are in memory."""
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1000
    raise AssertionError(f"process {process} tells no VmRSS")
