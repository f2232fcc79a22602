"""A stop in a cell of several units: it stops those that it is meant for, and nobody else notices.

Units that share a line hear all that is said on it. Each has a history; then one of them is stopped, or all are. A twin
of the cell, in which the stop is not sent, shows what the others would have done.
"""

from collections.abc import Callable, Sequence
from random import Random
from typing import NamedTuple

import pytest
from tests.controllers.laws.adapter import Model
from tests.controllers.laws.bench import Action, Say, Wait
from tests.controllers.laws.histories import ORDINARY, THOROUGH, History, gap, hold
from tests.controllers.laws.models import MODELS

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.ticks import MS, SECOND

UNITS = ("ux", "uy", "uz")
RAMP = 120 * SECOND  # longer than any ramp of these histories


def party(units: Sequence[str]) -> str:
    straps = "straps = { PARTY = 1 }\n"
    text = "".join(f'[units.{u}]\nmodel = "dcb-274"\noptions = {{ name = "{u[1].upper()}" }}\n{straps}' for u in units)
    return text + f"[lines.bus]\nunits = {list(units)}\n"


def multipoint(units: Sequence[str]) -> str:
    straps = ("SEL0 = 0", "SEL1 = 0", "SEL2 = 0")  # three addresses of the table of page 5
    text = "".join(f'[units.{u}]\nmodel = "gs-c200s"\nstraps = {{ {strap}, CHS = 0 }}\n'
                   for u, strap in zip(units, straps, strict=False))  # fmt: skip
    return text + f"[lines.bus]\nunits = {list(units)}\n"


def microbus(units: Sequence[str]) -> str:
    text = "".join(f'[units.{u}]\nmodel = "supersigma"\noptions = {{ number = {n} }}\n' for n, u in enumerate(units, 1))
    return text + f"[lines.bus]\nunits = {list(units)}\n"


class Shared(NamedTuple):
    """A kind of line that units share: its cell, its model, and how one unit, or all of them, are stopped."""

    text: Callable[[Sequence[str]], str]
    model: str
    one: tuple[str, ...]
    before: bytes = b""  # what makes the line ready
    everybody: bytes = b""


LINES = {
    "party line": Shared(party, "dcb-274", ("@", "|"), b"\n", b"\x1b"),  # pages 25, 33, 57
    "multipoint": Shared(multipoint, "gs-c200s", ("K", "Z")),
    "MICROBUS": Shared(microbus, "supersigma", ("stop", "emergency")),
}


class Plan(NamedTuple):
    """How many units, what is said to them, who is stopped and how ("" and bytes: all of them)."""

    units: int
    said: tuple[tuple[str, Action], ...]
    unit: str
    stop: str


def plan(draw: Random, shared: Shared) -> Plan:
    units = UNITS[: draw.randint(2, 3)]
    model: Model = next(model for model in MODELS if model.name == shared.model)
    said: list[tuple[str, Action]] = []
    for _ in range(draw.randint(1, 8)):
        unit = draw.choice(units)
        typed = [action for action in model.actions(draw) if isinstance(action, Say | Wait)]
        said += [(unit, action) for action in (*typed, Wait(min(gap(draw), 400 * MS)))]
    everybody = bool(shared.everybody) and draw.random() < 0.3
    return Plan(len(units), tuple(said), "" if everybody else draw.choice(units), draw.choice(shared.one))


def motions(cell: Cell, unit: str) -> list[object]:
    kinds = (MotionStarted, MotionCut, MotionEnded)
    assert cell.recording is not None
    return [item for item in cell.recording.of(unit) if isinstance(item, kinds)]


def a_stop_is_for_those_it_is_meant_for(shared: Shared, made: Plan) -> bool:
    cells = []
    for stopped in (True, False):
        cell = build(parse(shared.text(UNITS[: made.units]), "cell"), str, line_timing=False)
        cell.run_to(100 * MS)
        cell.send(0, shared.before)
        for unit, action in made.said:
            if isinstance(action, Say):
                cell.type(unit, action.text)
            elif isinstance(action, Wait):
                cell.run_to(cell.now + action.time)
        if stopped and made.unit:
            cell.type(made.unit, made.stop)
        elif stopped:
            cell.send(0, shared.everybody)
        cell.run_to(cell.now + 200 * MS)
        cells.append(cell)
    cell, twin = cells
    others = [unit for unit in UNITS[: made.units] if made.unit and unit != made.unit]
    for unit in others:
        assert motions(cell, unit) == motions(twin, unit), f"{made.stop} for {made.unit} has changed what {unit} does"
    meant = [made.unit] if made.unit else UNITS[: made.units]
    if made.unit and shared.model == "dcb-274":
        meant = []  # what @ and | do to an axis depends on what it is at: `test_stops` has it
    cell.run_to(cell.now + (RAMP if made.stop == "Z" else 2 * SECOND))
    for unit in meant:
        told = motions(cell, unit)
        assert not told or not isinstance(told[-1], MotionStarted), f"{unit} moves on behind {made.stop}"
    return any(motions(twin, unit) for unit in others or UNITS[: made.units])


def check(line: str, count: int) -> None:
    def make(draw: Random) -> tuple[History, Plan]:
        return History({}, (), ()), plan(draw, LINES[line])

    def law(_: History, made: Plan) -> bool:
        return a_stop_is_for_those_it_is_meant_for(LINES[line], made)

    assert hold(law, make, count, f"cells with a {line}") > count // 4


@pytest.mark.parametrize("line", LINES)
def test_a_stop_is_for_those_it_is_meant_for(line: str) -> None:
    check(line, ORDINARY // 10)


@pytest.mark.slow
@pytest.mark.parametrize("line", LINES)
def test_a_stop_is_for_those_it_is_meant_for_in_many_more_cells(line: str) -> None:
    check(line, THOROUGH)
