"""No firmware action takes zero time for ever: whatever wires lead back from outputs to inputs, time goes on.

A board looks at its inputs as often as its firmware lets it, so a loop of wires through it swings in time and stops
nothing. Cells of one or two units of any model, with wires from each output to any input, its own too.
"""

from random import Random

import pytest
from tests.controllers.laws.bench import Action, Say, Wait
from tests.controllers.laws.histories import ORDINARY, THOROUGH, History, gap, hold
from tests.controllers.laws.models import MODELS
from tests.controllers.laws.test_order import Plan, pins, play

from detent.axis import MotionStarted
from detent.cell.build import build
from detent.cell.description import parse
from detent.pins import PinKind
from detent.ticks import MS, US

BUSY = 5_000  # changes of levels and motions, behind which a cell has swung enough


def plan(draw: Random, first: str) -> tuple[Plan, tuple[tuple[str, Action], ...]]:
    units = {"ua": first} if draw.random() < 0.6 else {"ua": first, "ub": draw.choice(MODELS).name}
    models = {model.name: model for model in MODELS}
    sources = [f"{u}.{p}" for u, m in units.items() for p in pins(m, PinKind.OUTPUT, PinKind.OPEN_COLLECTOR)]
    sinks = [f"{u}.{p}" for u, m in units.items() for p in pins(m, PinKind.INPUT)]
    some = draw.sample(sources, min(2, len(sources)))  # a few, each to several inputs: keys in pairs
    wires = tuple((draw.choice(some), sink) for sink in draw.sample(sinks, min(draw.randint(1, 6), len(sinks))))
    done: list[tuple[str, Action]] = []
    for _ in range(draw.randint(1, 8)):
        unit = draw.choice(list(units))
        done += [(unit, action) for action in (*models[units[unit]].actions(draw), Wait(min(gap(draw), 12 * MS)))]
    return Plan(units, wires, party=False), tuple(done)


def time_goes_on(plan: Plan, done: tuple[tuple[str, Action], ...]) -> bool:
    cell = build(parse(plan.text(list(plan.units), powered=True), "cell"), str, line_timing=False)
    cell.run_to(300 * MS)
    recording = cell.recording
    assert recording is not None
    for action in done:
        play(cell, [action])
        if sum(len(recording.of(unit)) for unit in plan.units) > BUSY:
            break
    cell.run_to(cell.now + 1 * MS)
    return any(isinstance(item, MotionStarted) for unit in plan.units for item in recording.of(unit))


def check(name: str, count: int) -> None:
    def make(draw: Random) -> tuple[History, tuple[Plan, tuple[tuple[str, Action], ...]]]:
        return History({}, (), ()), plan(draw, name)

    assert hold(lambda _, made: time_goes_on(*made), make, count, f"loops of {name}") > count // 4


@pytest.mark.parametrize("name", [model.name for model in MODELS])
def test_time_goes_on(name: str) -> None:
    check(name, ORDINARY // 10)


@pytest.mark.slow
@pytest.mark.parametrize("name", [model.name for model in MODELS])
def test_time_goes_on_in_many_more_cells(name: str) -> None:
    check(name, THOROUGH // 10)


@pytest.mark.parametrize("model", ["bs0610", "bs0710"])
@pytest.mark.parametrize("axis", "XY")
@pytest.mark.parametrize("said", ["100S", "X100S", "Y100S", "B+S", "X-SYS"])
def test_a_board_that_is_wired_to_its_own_keys_stops_that_axis_and_goes_on(model: str, axis: str, said: str) -> None:
    wires = tuple(("board.RDY", f"board.{axis}{end}") for end in "+-")
    cell = build(parse(Plan({"board": model}, wires, party=False).text(["board"], powered=True), "cell"), str)
    cell.run_to(300 * MS)
    play(cell, [("board", Say(said))])
    for _ in range(200):
        cell.run_to(cell.now + 400 * US)
    assert cell.controller("board").status(cell.now, axis).pulses == 0  # "treated as stop" (page 21)
