"""What movements of the SUPERSIGMA drive take, by each way of short movements, and what planning them costs.

Run: python -m bench.supersigma (from the repository). The times of movements are facts of the firmware, in ms on
average over all short lengths; the baseline is the paper's way.
"""

import numpy as np

from bench.rows import Row, measure, print_table
from detent.hosts.interpolation import legs
from detent.ramps.differences import PAPER
from detent.ramps.short_movements import Way, cuts, family, movement
from detent.ramps.table_movement import ramped

ENTRIES = len(PAPER.differences)
BANDS = ((404, 1000), (1000, 2600), (2600, 5144), (404, 5144))


def rows() -> list[Row]:
    return [*time_rows(), *planning_rows()]


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
    line = measure(lambda: list(legs((5000, 3217, -1234), 6))) * 1e3
    one = measure(lambda: list(legs((3000, 2000, 1000), 6))) * 1e3
    made.append(Row("a line of 5000 by 3217 by 1234", line, "ms", "one leg, ms", one, None))
    return made


if __name__ == "__main__":
    print_table(rows())
