"""A stop breaks off whatever a driver of a DCB-274 is at, between any two steps and within each: the axis ramps down.

ESC would stop it too, but at once and without a ramp (page 33), and every other axis of a party line with it.
"""

from collections.abc import Callable
from itertools import product
from typing import Any

import pytest
from tests.hosts.breaking_off import broken_off

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.hosts.dcb274 import BlockingDcb274, Dcb274
from detent.hosts.errors import DriverError, NoAnswer
from detent.hosts.exchange import Steps
from detent.ticks import SECOND

ESC = b"\x1b"
REST = 8.0  # seconds: every ramp here is over by then
EACH = (
    32  # steps, between any two of which it is tried; what comes later are looks that are all alike, hundreds of them
)

DOES: dict[str, Callable[[Dcb274], Steps[Any]]] = {
    "a setting": lambda axis: axis.command("V 900"),
    "an index that waits": lambda axis: axis.command("+ 5000", 1000),
    "a wait": lambda axis: axis.command("W 0", 1000),
    "a look at the position": lambda axis: axis.position(),
    "a look at the motion": lambda axis: axis.moving_status(),
    "a move": lambda axis: axis.move_by(5000),
    "a run": lambda axis: axis.run_at(-900),
    "storing a program": lambda axis: axis.write_program(["+ 2000", "W 0"]),
}

SOME = ("a setting", "an index that waits", "storing a program")


def in_program(unit: Any) -> None:
    unit.write_program(["+ 60000", "W 0"])
    unit.go()


MOVES: dict[str, Callable[[Any], object]] = {
    "rests": lambda unit: None,
    "runs": lambda unit: unit.run_at(2000),
    "indexes": lambda unit: unit.move_by(60000),
    "runs a program": in_program,
}


class Told(HostPort):
    """A port that remembers what was sent."""

    def __init__(self, cell: Cell) -> None:
        super().__init__(cell)
        self.sent = b""

    def write(self, data: bytes) -> int:
        self.sent += data
        return super().write(data)


WAYS = {
    "party": ('straps = { PARTY = "high" }\n', ""),
    "daisy": ("", '[lines.ring]\nunits = ["unit"]\nkind = "daisy-chain"\n'),
    "sin10": ("", '[units.adapter]\nmodel = "sin-10"\n[lines.host]\nunits = ["adapter"]\n'
              '[lines.bus]\nunits = ["unit"]\nhost = "adapter"\n'),
}  # fmt: skip
"""Where lines have names: what more the unit has, and its cell."""


def begun(moves: str, way: str = "") -> tuple[Cell, Told, Any]:
    strap, lines = WAYS.get(way, ("", ""))
    name = '[units.unit.options]\nname = "X"\n' if way else ""
    cell = build(parse(f'[units.unit]\nmodel = "dcb-274"\n{strap}{name}{lines}', "cell"), lambda file: "", record=True)
    port = Told(cell)
    unit = BlockingDcb274(Dcb274("X", mode=way) if way else Dcb274(), port)
    unit.connect()
    MOVES[moves](unit)
    return cell, port, unit


def ramps_down(moves: str, does: str, *, said: bool, later: float, way: str = "") -> None:
    behind, over = 0, False
    while not over:
        cell, port, unit = begun(moves, way)
        over = broken_off(unit, port, DOES[does](unit.driver), behind, said=said)
        port.wait(later)
        before = len(port.sent)
        unit.stop()
        what = f"{moves}, {does}, broken off behind {behind} steps (said: {said}), stopped {later} s later"
        assert ESC not in port.sent[before:], what
        port.wait(REST)
        assert cell.controllers()["unit"].status(cell.now, "").state == "ready", what
        behind += 1 + max(behind - EACH, 0) // 4


@pytest.mark.parametrize("does", DOES)
@pytest.mark.parametrize("moves", MOVES)
def test_a_stop_that_breaks_something_off_ramps_down(moves: str, does: str) -> None:
    for said in (False, True):
        ramps_down(moves, does, said=said, later=0.003)


@pytest.mark.parametrize("does", SOME)
@pytest.mark.parametrize("moves", MOVES)
@pytest.mark.parametrize("way", WAYS)
def test_so_does_one_where_lines_have_names(way: str, moves: str, does: str) -> None:
    for said in (False, True):
        ramps_down(moves, does, said=said, later=0.003, way=way)


@pytest.mark.slow
@pytest.mark.parametrize("later", [0.0, 0.001, 0.01, 0.05, 0.4])
@pytest.mark.parametrize(("way", "does"), [*(("", does) for does in DOES), *product(WAYS, SOME)])
@pytest.mark.parametrize("moves", MOVES)
def test_a_stop_at_any_time_after_that_too(way: str, moves: str, does: str, later: float) -> None:
    for said in (False, True):
        ramps_down(moves, does, said=said, later=later, way=way)


READS: dict[str, Callable[[Dcb274], Steps[Any]]] = {
    "a listing": lambda axis: axis.listing(0),
    "reports": lambda axis: axis.follow(0.2),
    "a name": lambda axis: axis.store_name("X"),
    "a look at the memory": lambda axis: axis.read_memory(0, 40),
}


@pytest.mark.parametrize("does", READS)
def test_what_was_broken_off_takes_nothing_of_the_next_call(does: str) -> None:
    """Half a line, a listing that waits for a key (page 48), ^N that waits for a name (page 57)."""
    behind, over = 0, False
    while not over:
        _, port, unit = begun("rests")
        over = broken_off(unit, port, READS[does](unit.driver), behind, said=False)
        try:
            assert unit.position() == 0
        except DriverError:
            assert does == "a name"  # SPACE, which is none, ends that
            assert unit.position() == 0
        assert unit.examine().name in "AX"
        behind += 1


@pytest.mark.parametrize("moves", ["rests", "runs"])
def test_a_stop_that_nobody_hears_is_an_error(moves: str) -> None:
    cell, _, unit = begun(moves)
    cell.power("unit", False)
    began = cell.now
    with pytest.raises(NoAnswer, match="does not take its stop command"):
        unit.stop()
    assert cell.now - began < 2.5 * SECOND, "it took lines when it was last heard: this is no ramp out of a program"
