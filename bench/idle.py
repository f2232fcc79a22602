"""A year of stored programs that turn in loops and do nothing else, beside ten seconds of them an instant at a time."""

from bench.rows import Row, measure
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.ticks import SECOND

YEAR = 31_557_600 * SECOND
RUN_THROUGH = 10 * SECOND
LOOPS = {
    "DCB-274, an L that polls": ("dcb-274", "L 0 0\n"),
    "DCB-274, a G to itself": ("dcb-274", "G 0 0\n"),
    "DCB-274, a W in a J of 90 rounds": ("dcb-274", "a: W 1\nJ a 90\nG a\n"),
    "GS-C200S, inputs in a loop": ("gs-c200s", "a: jc0,b\nj a\nb: D5\nj a\n"),
    "GS-C200, a guard": ("gs-c200", "U1\nD1\nA2\nC2\n"),
}


def cell(model: str, program: str) -> Cell:
    """One unit that runs it."""
    return build(parse(f'[units.u]\nmodel = "{model}"\nprogram = "p"\n', "bench"), lambda file: program)


def a_year(model: str, program: str) -> None:
    """Asked for its end."""
    cell(model, program).run_to(YEAR)


def an_instant_at_a_time(model: str, program: str) -> None:
    """Asked for each instant."""
    made = cell(model, program)
    while (at := made.next_event()) is not None and at <= RUN_THROUGH:
        made.step()


def rows() -> list[Row]:
    """Milliseconds of both."""
    made = []
    for name, (model, program) in LOOPS.items():
        year = measure(lambda: a_year(model, program)) * 1e3  # noqa: B023 (called at once)
        slow = measure(lambda: an_instant_at_a_time(model, program)) * 1e3  # noqa: B023
        made.append(Row(f"a year: {name}", year, "ms", "10 s, an instant at a time, ms", slow, 1000))
    return made
