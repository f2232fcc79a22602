"""What movements of the SUPERSIGMA drive take, by each way of short movements, straight lines, and planning them.

Run: python -m bench.supersigma (from the repository). The times of movements are facts of the firmware, in ms on
average over all short lengths; the baseline is the paper's way.
"""

from functools import partial

import numpy as np

from bench.rows import Row, measure, print_table
from detent.hosts.interpolation import CLOCK_HZ, line
from detent.ramps.differences import PAPER
from detent.ramps.short_movements import cuts, family, movement
from detent.ramps.table_movement import ramped
from detent.ramps.ways import Way

ENTRIES = len(PAPER.differences)
BANDS = ((404, 1000), (1000, 2600), (2600, 5144), (404, 5144))


def rows() -> list[Row]:
    return [*time_rows(), *planning_rows(), *line_rows()]


def time_rows() -> list[Row]:
    """How long short movements take."""
    made = []
    for first, last in BANDS:
        clocks = {
            way: np.array([movement(PAPER, steps, 10, way, ENTRIES).clocks for steps in range(first, last, 3)])
            for way in Way
        }
        hyperbola = float(clocks[Way.HYPERBOLA].mean()) / 2e3
        for way in (Way.EXACT, Way.FREE):
            name = f"{first} to {last - 1} half steps, {way.value}"
            made.append(Row(name, float(clocks[way].mean()) / 2e3, "ms", "hyperbola, ms", hyperbola, None))
    return made


def planning_rows() -> list[Row]:
    """What it costs to plan: a movement of any length beside the shortest long one."""

    def plan(steps: int, way: Way = Way.HYPERBOLA) -> float:
        def some() -> None:
            ramped.cache_clear()
            for n in range(steps, steps + 20):
                movement(PAPER, n, 10, way, ENTRIES)

        return measure(some) / 20 * 1e6

    short = plan(5144)
    made = [Row("planning 65 515 half steps", plan(65_515), "us", "5144 half steps, us", short, 1.2 * short)]
    made += [
        Row(f"planning 2000 half steps, {way.value}", plan(2000, way), "us", "5144, us", short, None) for way in Way
    ]

    def columns() -> None:
        family.cache_clear()
        cuts.cache_clear()
        family(PAPER, ENTRIES)
        cuts(PAPER, ENTRIES)

    made.append(
        Row("the whole family and all cuts, once", measure(columns) * 1e3, "ms", "one movement, ms", short / 1e3, None)
    )
    return made


def line_rows() -> list[Row]:
    """Straight lines at 600 half steps/s: how long they take beside the longest axis alone, and planning them."""
    made = []
    for distances in ((5000, 3217), (5000, 3217, -1234), (12345, 6789, -321)):
        text = " by ".join(str(abs(steps)) for steps in distances)
        runs = line(distances, 6)
        took, alone = max(run.end for run in runs) / CLOCK_HZ, abs(distances[0]) / 600
        made.append(Row(f"a line of {text}, {len(runs)} movements", took, "s", "the ideal, s", alone, 1.001 * alone))
        planned = measure(partial(line, distances, 6)) * 1e3
        one = measure(partial(line, (5000, 2500), 6)) * 1e3
        made.append(Row(f"planning it ({text})", planned, "ms", "5000 by 2500, ms", one, None))
    return made


if __name__ == "__main__":
    print_table(rows())
