"""Levels of inputs that a cell was given, and which of them it never had, once a stop takes it back."""

from types import SimpleNamespace
from typing import Any

from detent.cell.actions import SetPin
from detent.realtime.boards.cell_inputs import CellInputs
from detent.realtime.boards.events import Stopped


def stopped(level: bool, at: int) -> Stopped:
    return Stopped("b", "x", "x.KEY", level, 0, at, at, level)


def test_what_a_stop_has_given_is_taken_back_by_an_earlier_one() -> None:
    """A key was pressed, as a stop told; that it was let go before stops what is older: it is not pressed then."""
    cell: Any = SimpleNamespace(now=0, controller=lambda unit: SimpleNamespace(switches=lambda axis: ()))
    plan: Any = SimpleNamespace(inputs={"x.KEY": ("x", "KEY")})
    ledger: Any = SimpleNamespace(what=SimpleNamespace(axis=""))
    inputs = CellInputs(cell, plan)
    inputs.begin({"x.KEY": 1})
    given, never = inputs.taken_back(ledger, stopped(False, 100), 100)
    assert (given, never) == ([SetPin("x", "KEY", 0)], set())
    given, never = inputs.taken_back(ledger, stopped(True, 90), 90)
    assert given == [SetPin("x", "KEY", 1)]
    assert never == {(100, SetPin("x", "KEY", 0))}
    assert not inputs.differs("x.KEY", 1)
