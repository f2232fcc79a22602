"""What is done to a unit beside its line, at any instant: its program is loaded or started, or it is halted.

A unit that is at something is not upset by it: no motion begins on top of another, and what was typed and waits is
carried out or answered. A halt brings every axis to rest in that instant.
"""

from contextlib import suppress
from functools import cache
from random import Random
from typing import NamedTuple

import pytest
from tests.controllers.laws import dcb274, gsc200
from tests.controllers.laws.adapter import Model, history, ready
from tests.controllers.laws.bench import Bench, Wait
from tests.controllers.laws.histories import ORDINARY, THOROUGH, History, gap, hold
from tests.controllers.laws.models import every_model

from detent.assembler import AssemblyFailed, ImageError, assemble
from detent.cell.build import build
from detent.cell.description import parse
from detent.controllers import catalogue
from detent.ticks import MS, SECOND

PROGRAMS = {
    **{name: tuple("\n".join(lines) for lines in programs) for name, programs in gsc200.PROGRAMS.items()},
    "dcb-274": tuple("\n".join(line for line in lines if line[0] != "P") for lines in dcb274.PROGRAMS),
}


@cache
def images(model: str) -> tuple[bytes, ...]:
    """Programs of the model; what can be typed and not assembled (a jump into an instruction) is left out."""
    found = []
    for source in PROGRAMS.get(model, ()):
        with suppress(AssemblyFailed):
            found.append(assemble(catalogue.language(model), source).image)
    assert len(found) > 2 or model not in PROGRAMS
    return tuple(found) or (b"",)


class Meddling(NamedTuple):
    """Something is done so long after the action `behind` of the history; `number` says which program is loaded."""

    behind: int
    wait: int
    what: str
    number: int = 0


def meddle(bench: Bench, model: Model, done: Meddling) -> None:
    """Do it, now."""
    match done.what:
        case "start":
            bench.device.start(bench.now)
        case "halt":
            bench.device.halt(bench.now)
        case "load":
            try:
                some = images(model.name)
                bench.device.load(some[done.number % len(some)], 0, bench.now)
            except ImageError:
                assert model.name not in PROGRAMS  # it holds none
    bench.collect()
    if done.what == "halt":
        assert not any(travel.moving for travel in bench.travels.values()), "a halt leaves an axis in motion"


def nothing_is_upset(model: Model, past: History, meddling: tuple[Meddling, ...]) -> bool:
    bench = ready(model, past)
    for number, action in enumerate((Wait(0), *past.actions)):
        bench.do(action)
        for done in meddling:
            if done.behind == number:
                bench.go_to(bench.now + done.wait)
                meddle(bench, model, done)
    bench.go_to(bench.now + SECOND)  # the axes are believed at every event on the way
    for axis, travel in bench.travels.items():
        assert bench.device.status(bench.now, axis).pulses == travel.count(bench.now)
    return bool(meddling)


def check(model: Model, count: int) -> None:
    def make(draw: Random) -> tuple[History, tuple[Meddling, ...]]:
        past = history(model, draw)
        loaded = Meddling(0, 0, "load", draw.randrange(20))
        some = [Meddling(draw.randint(0, len(past.actions)), gap(draw), draw.choice(("start", "start", "halt", "load")),
                         draw.randrange(20)) for _ in range(draw.randint(1, 4))]  # fmt: skip
        return past, (loaded, *some)

    assert hold(lambda past, done: nothing_is_upset(model, past, done), make, count, f"meddling {model.name}")


@every_model("meddling")
def test_nothing_is_upset(model: Model) -> None:
    check(model, ORDINARY // 2)


@pytest.mark.slow
@every_model("meddling")
def test_nothing_is_upset_in_many_more(model: Model) -> None:
    check(model, THOROUGH)


def test_a_program_is_not_started_on_top_of_a_command_that_waits() -> None:
    """An M that waits for the ramp before it (page 28) sets off; the program that was asked for meanwhile does not."""
    cell = build(parse('[units.unit]\nmodel = "dcb-274"\n', "cell"), str)
    cell.load("unit", images("dcb-274")[0], 0)
    for text in ("K 50 5", "M -9000", "M 900"):
        cell.type("unit", text)
        cell.run_to(cell.now + 50 * MS)
    cell.start("unit")
    assert cell.controller("unit").status(cell.now).state == "moving"
    cell.run_to(cell.now + 5 * SECOND)
    status = cell.controller("unit").status(cell.now)
    assert status.state == "moving"  # at 900, and no program runs
