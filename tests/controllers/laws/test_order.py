"""Order does not matter where nothing says it does: of the units in a file, and of their supplies.

Whole cells: two to four units of any model, wires between them, and a history of each unit. A wire that nobody drives
reads 1 (GS-C200 datasheet, page 4), and that somebody begins to drive it is no edge.
"""

from collections.abc import Mapping, Sequence
from random import Random
from typing import NamedTuple

import pytest
from tests.controllers.laws.adapter import Model
from tests.controllers.laws.bench import Action, Power, Put, Raw, Say, Wait
from tests.controllers.laws.histories import ORDINARY, THOROUGH, History, gap, hold
from tests.controllers.laws.models import MODELS

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.circuit import Oscillation
from detent.cell.description import parse
from detent.cell.recording import InputSet
from detent.controllers import catalogue
from detent.pins import PinKind
from detent.ticks import MS, SECOND

LEVELS = ("UI1", "UI2", "UI3", "ENABLE", "GO", "SS", "JOG1", "JOG2", "JOG-S", "X+", "X-", "Y+", "Y-", "RST", "VC",
          "LX+", "LX-", "LY+", "LY-", "LIMIT-A", "LIMIT-B", "HOME", "EOT")  # fmt: skip
"""Inputs that act as long as they have a level: what they do depends on since when they have it."""


class Plan(NamedTuple):
    """A cell: the model of each unit, its wires (from, to), whether the DCB-274 share a party line."""

    units: Mapping[str, str]
    wires: tuple[tuple[str, str], ...]
    party: bool

    def text(self, order: Sequence[str], *, powered: bool) -> str:
        """The cell file with its units in this order."""
        shared = [unit for unit in order if self.units[unit] == "dcb-274"] if self.party else []
        lines: list[str] = []
        for unit in order:
            lines += [f"[units.{unit}]", f'model = "{self.units[unit]}"', f"powered = {str(powered).lower()}"]
            lines += [f'options = {{ name = "{unit[-1].upper()}" }}'] if self.units[unit] == "dcb-274" else []
            lines += ["straps = { PARTY = 1 }"] if unit in shared else []
        if len(shared) > 1:
            lines += ["[lines.bus]", f"units = [{', '.join(repr(unit) for unit in shared)}]"]
            lines += [
                line for unit in order if unit not in shared for line in (f"[lines.{unit}]", f'units = ["{unit}"]')
            ]
        for source, sink in self.wires:
            lines += ["[[wires]]", f'from = "{source}"', f'to = "{sink}"']
        return "\n".join(lines)


def pins(model: str, *kinds: PinKind) -> list[str]:
    return [pin.name for pin in catalogue.MODELS[model].pins if pin.kind in kinds]


def plan(draw: Random, *, edges: bool) -> Plan:
    """A cell; `edges`: wires lead to inputs that act on an edge, or on nothing by themselves, only."""
    units = {f"u{letter}": draw.choice(MODELS).name for letter in "abcd"[: draw.randint(2, 4)]}
    sources = [f"{u}.{p}" for u, m in units.items() for p in pins(m, PinKind.OUTPUT, PinKind.OPEN_COLLECTOR)]
    if edges:  # a pulse that a unit gives by itself when it is switched on is one
        sources = [pin for pin in sources if not pin.endswith((".RESET", ".RDY"))]
    sinks = [f"{u}.{p}" for u, m in units.items() for p in pins(m, PinKind.INPUT) if not (edges and p in LEVELS)]
    wires = []
    for sink in draw.sample(sinks, min(draw.randrange(7), len(sinks)) if sources else 0):
        source = draw.choice(sources)
        if source.split(".")[0] != sink.split(".")[0]:
            wires.append((source, sink))
    return Plan(units, tuple(wires), draw.random() < 0.5)


def actions(draw: Random, units: Mapping[str, str]) -> tuple[tuple[str, Action], ...]:
    """What happens to the units of a cell."""
    models = {model.name: model for model in MODELS}
    found: list[tuple[str, Action]] = []
    for _ in range(draw.randrange(8)):
        unit = draw.choice(list(units))
        model: Model = models[units[unit]]
        found += [(unit, action) for action in (*model.actions(draw), Wait(min(gap(draw), 200 * MS)))]
    return tuple(found)


def play(cell: Cell, done: Sequence[tuple[str, Action]]) -> None:
    for unit, action in done:
        match action:
            case Say(text):
                cell.type(unit, text)
            case Raw(data):
                cell.send(cell.wiring.line_of[cell.unit(unit)], data)
            case Put(pin, level):
                cell.set_pin(unit, pin, level)
            case Power(on):
                cell.power(unit, on)
            case Wait(time):
                cell.run_to(cell.now + time)


Seen = Mapping[str, object] | str


def order_in_the_file(plan: Plan, order: Sequence[str], done: Sequence[tuple[str, Action]]) -> Seen:
    """Everything that each unit does, in a cell with its units in this order."""
    try:
        cell = build(parse(plan.text(order, powered=True), "cell"), str, line_timing=False)
        cell.run_to(300 * MS)
        play(cell, done)
        cell.run_to(cell.now + 300 * MS)
    except Oscillation:
        return "an oscillation"
    assert cell.recording is not None
    return {unit: [item for item in cell.recording.of(unit) if not isinstance(item, InputSet)] for unit in plan.units}


def order_of_supply(plan: Plan, order: Sequence[str], done: Sequence[tuple[str, Action]]) -> Seen:
    """The motions of each unit, in a cell with its units switched on in this order."""
    try:
        cell = build(parse(plan.text(list(plan.units), powered=False), "cell"), str, line_timing=False)
        for n, unit in enumerate(order):
            cell.run_to(n * 10 * MS)
            cell.power(unit, True)
        cell.run_to(SECOND)
        for unit, model in plan.units.items():  # a board counts its ticks from its reset
            if model.startswith("bs"):
                cell.type(unit, "4!")
        cell.run_to(2 * SECOND)
        play(cell, done)
        cell.run_to(cell.now + 300 * MS)
    except Oscillation:
        return "an oscillation"
    assert cell.recording is not None
    kinds = (MotionStarted, MotionCut, MotionEnded)
    return {unit: [item for item in cell.recording.of(unit) if isinstance(item, kinds)] for unit in plan.units}


def check(count: int, *, supply: bool) -> None:
    seen = order_of_supply if supply else order_in_the_file

    def make(draw: Random) -> tuple[History, tuple[Plan, list[str], tuple[tuple[str, Action], ...]]]:
        made = plan(draw, edges=supply)
        order = draw.sample(list(made.units), len(made.units))
        return History({}, (), ()), (made, order, actions(draw, made.units))

    def law(_: History, then: tuple[Plan, list[str], tuple[tuple[str, Action], ...]]) -> bool:
        made, order, done = then
        here, there = seen(made, list(made.units), done), seen(made, order, done)
        assert here == there, differing(here, there) if not isinstance(here, str) else f"{here}, and {there}"
        moved = isinstance(here, str) or any(isinstance(item, MotionStarted) for told in here.values() for item in told)  # type: ignore[attr-defined]
        return bool(made.wires) and moved

    assert hold(law, make, count, "order of supply" if supply else "order in the file") > count // 3


def differing(here: Seen, there: Seen) -> str:
    """The first thing that is not the same."""
    assert not isinstance(here, str)
    if isinstance(there, str):
        return there
    for unit, one in here.items():
        for a, b in zip(one, there[unit], strict=False):  # type: ignore[call-overload]
            if a != b:
                return f"{unit}: {a}\nand {b}"
    return "one has more"


def test_the_order_in_the_file_changes_nothing() -> None:
    check(ORDINARY // 4, supply=False)


def test_the_order_of_supply_changes_no_pulse() -> None:
    check(ORDINARY // 4, supply=True)


@pytest.mark.slow
def test_the_order_in_the_file_changes_nothing_in_many_more_cells() -> None:
    check(THOROUGH, supply=False)


@pytest.mark.slow
def test_the_order_of_supply_changes_no_pulse_in_many_more_cells() -> None:
    check(THOROUGH, supply=True)
