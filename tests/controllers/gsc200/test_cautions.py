"""A command that is taken and does what its sender may not expect is told: the counter below 0 (entry K)."""

from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.controllers.device import Cautioned
from detent.ticks import MS, SECOND

CELL = '[units.a]\nmodel = "gs-c200"\nstraps = { CHS = "low" }\n'


def told(*script: tuple[str, int]) -> tuple[Cell, list[Cautioned]]:
    """What is cautioned of when these lines are sent, each so many ms behind the one before."""
    cell = build(parse(CELL, "cell"), lambda file: "")
    for line, wait in script:
        cell.run_to(cell.now + wait * MS)
        cell.type("a", line)
    cell.run_to(cell.now + SECOND)
    assert cell.recording is not None
    return cell, [entry for entry in cell.recording.of("a") if isinstance(entry, Cautioned)]


def test_a_goto_behind_a_homing_that_was_cut_off_below_0_tells_how_far_it_goes() -> None:
    """The counter has no sign: below 0 it goes on at 9999999, and G0 goes down from there."""
    cell, found = told(("H-", 0), ("K", 255), ("G0", 50))
    assert [(item.frame, item.what.partition(": G0")[0]) for item in found] == [
        ("G0", "a homing that was cut off has taken the counter below 0, where it reads 9999975")
    ]
    assert "G0 makes 9999975 steps in direction minus; H finds home, I1 clears the counter" in found[0].what
    assert cell.controller("a").status(cell.now).state == "running"


def test_a_program_that_goes_there_tells_too() -> None:
    _, found = told(("P", 0), ("G0", 20), ("E", 20), ("H-", 100), ("K", 255), ("P", 50), ("G5", 20), ("E", 20))
    assert [item.frame for item in found] == ["G5"]


@given(st.integers(0, 400), st.sampled_from(["H+", "H-"]), st.sampled_from(["K", "Z"]), st.integers(0, 60))
@settings(max_examples=examples(25))
def test_it_is_told_of_those_gotos_and_of_no_other(wait: int, home: str, stop: str, begin: int) -> None:
    """Law: a goto is cautioned of if, and only if, it goes away from where the axis came from."""
    start = [(f"+{begin}", 0)] if begin else []
    cell, _ = told(*start, (home, 900), (stop, wait))
    where = cell.controller("a").status(cell.now).position
    cell.type("a", "G0")
    cell.run_to(cell.now + SECOND)
    assert cell.recording is not None
    found = [entry for entry in cell.recording.of("a") if isinstance(entry, Cautioned)]
    assert bool(found) == (where > 5_000_000)


def test_i1_ends_it() -> None:
    _, found = told(("H-", 0), ("K", 255), ("I1", 50), ("+30", 50), ("G0", 500))
    assert found == []
