"""Draws the figures of the SUPERSIGMA page and writes their data: `python docs/supersigma.py`.

The data of the times, a line for every 20th length, is kept as `pictures/supersigma-times.csv`; the tests make it
again.
"""

import runpy
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from detent.outputs.figures import style
from detent.ramps.differences import PAPER
from detent.ramps.rate_generator import CLOCK_HZ
from detent.ramps.short_movements import PAPER_HYPERBOLA, Ramp, family, movement, profiles, shortest
from detent.ramps.table_movement import Movement, ramped
from detent.ramps.ways import Way

PICTURES: Final = Path(__file__).parent / "pictures"
ENTRIES: Final = len(PAPER.differences)
OFFSET: Final = 10
LAST: Final = 6000  # half steps: a little more than the shortest long movement
MEMBERS: Final = (3076, 3176, 3576, 4076, 5076, 6020)  # of the family, as the specification lists them
COLOURS: Final = {"hyperbola": "#0072B2", "exact": "#D55E00", "free": "#009E73", "constant": "#888888"}


class Times(NamedTuple):
    """Seconds of a movement over its length in half steps, the ways one by one."""

    steps: npt.NDArray[np.int64]
    ways: dict[str, npt.NDArray[np.float64]]


def times(step: int = 1) -> Times:
    """The times of all lengths up to `LAST`, or of every `step`-th."""
    steps = np.arange(step, LAST + 1, step)
    ways = {way.value: np.array([seconds(int(n), way) for n in steps]) for way in Way}
    return Times(steps, ways | {"constant": steps * (PAPER.first + 1) / CLOCK_HZ})


def seconds(steps: int, way: Way) -> float:
    """The time of one movement, from its start to its last pulse."""
    return movement(PAPER, steps, OFFSET, way, ENTRIES).clocks / CLOCK_HZ


def as_csv(found: Times) -> str:
    """The times in microseconds, exactly: a clock is half of one."""
    names = list(found.ways)
    lines = ["half steps," + ",".join(f"{name} us" for name in names)]
    for row, steps in enumerate(found.steps):
        lines += [",".join([str(steps), *(f"{found.ways[name][row] * 1e6:.1f}" for name in names)])]
    return "\n".join(lines) + "\n"


def draw_times(found: Times, path: Path) -> None:
    """The times over all lengths, and what the exact way gains on the hyperbola."""
    with style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8, 6.4), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
        words = {
            "hyperbola": "whole table, N0 by the hyperbola (the paper's)",
            "exact": "whole table, the best N0",
            "free": "curve cut to the length",
            "constant": "constant low speed",
        }
        for name, values in found.ways.items():
            upper.plot(found.steps, values, color=COLOURS[name], lw=1.2, label=words[name])
        upper.set(ylim=(0, 0.85), ylabel="time of the movement (s)")
        upper.legend(loc="lower right", frameon=False)
        for x, text in ((shortest(PAPER, OFFSET), "very short: below"), (5144, "long: from")):
            for axes in (upper, lower):
                axes.axvline(x, color="#bbbbbb", lw=0.8, zorder=0)
            place = (14 if x < LAST / 2 else 4, 0)
            upper.annotate(f"{text} {x}", (x, 0.74), place, textcoords="offset points", va="top", fontsize=8)
        gain = (found.ways["hyperbola"] - found.ways["exact"]) * 1e3
        lower.plot(found.steps, gain, color=COLOURS["exact"], lw=0.7)
        lower.set(xlabel="length of the movement (half steps)", ylabel="gain of the\nbest N0 (ms)", xlim=(0, LAST))
        figure.suptitle(
            "Short movements three ways: the paper's table, an offset of 10", x=0.02, ha="left", weight="bold"
        )
        figure.savefig(path, dpi=110, metadata={"Software": None})


def draw_family(path: Path) -> None:
    """The paper's figures 10 and 11 from the firmware's own arithmetic."""
    with style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8, 3.6), layout="constrained")
        left, right = figure.subplots(1, 2)
        for first in MEMBERS:
            up = int(profiles(PAPER, [Ramp(first, ENTRIES)]).up[0])
            made = movement_with(first, 2 * up + OFFSET + 40)
            t = np.linspace(0, made.clocks * 500 - 1, 600).astype(np.int64)
            rate = [made.train.state_at(int(each)).rate for each in t]
            left.plot(t / 1e9, rate, lw=1.1, color="#0072B2")
            above = (0, 3) if first < MEMBERS[-1] else (0, -10)
            left.annotate(str(first), (0.3, max(rate)), above, textcoords="offset points", ha="center", fontsize=7)
        left.set(xlabel="time (s)", ylabel="speed (half steps/s)", title="the family of figure 10, by N0")
        members = family(PAPER, ENTRIES)
        right.plot(members.first, members.up, color="#D55E00", lw=2, label="steps of the ramp, na")
        m = np.arange(190, 2567)
        right.plot([PAPER_HYPERBOLA.first(int(each)) for each in m], m, color="#0072B2", lw=1, label="the hyperbola")
        right.set(xlabel="N0", ylabel="steps", title="figure 11")
        right.legend(frameon=False)
        figure.savefig(path, dpi=110, metadata={"Software": None})


def movement_with(first: int, steps: int) -> Movement:
    """A movement of a given member of the family."""
    return ramped(PAPER, first, ENTRIES, steps, OFFSET)


def draw_assembly(path: Path) -> None:
    """The run of the assembly example."""
    example = runpy.run_path(str(Path(__file__).parents[1] / "examples" / "assembly" / "pick_and_place.py"))
    example["in_virtual_time"](path)


def main() -> None:
    """Write everything."""
    (PICTURES / "supersigma-times.csv").write_text(as_csv(times(20)))
    draw_times(times(), PICTURES / "supersigma-times.png")
    draw_family(PICTURES / "supersigma-family.png")
    draw_assembly(PICTURES / "supersigma-assembly.png")


if __name__ == "__main__":
    main()
