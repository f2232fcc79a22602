"""A supply that is lost at any instant of any call: an error tells, or the answer is right, and the next call works."""

import re
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples
from tests.hosts.modules import cell
from tests.hosts.test_alike import DRIVERS

from detent.cell.cell import Cell
from detent.cell.host import HostPort
from detent.hosts.axis import Speeds
from detent.hosts.errors import DriverError
from detent.ticks import MS, SECOND, Ns

BEGINS: Ns = 4 * SECOND
"""When the calls begin that the supply is lost in: the unit is signed on, has its speeds, and stands at 300."""

CALLS = ("move_by(900); wait(30)", "move_to(1100); wait(30)", "run_at(400); stop(); wait(30)", "position()", "stop()",
         "set_speeds()", "wait(30)", "set_position(0)", "halt()", "limits()")  # fmt: skip


def lost(model: str, calls: str, off: Ns, dark: Ns) -> tuple[Cell, Any, BaseException | None]:
    """The unit behind `calls`, in which it was without supply from `off` on, for `dark`, and what they raised."""
    made = cell(
        f'[units.unit]\nmodel = "{model}"\n'
        f'[[script]]\nat = "{BEGINS + off} ns"\npower = {{ unit = false }}\n'
        f'[[script]]\nat = "{BEGINS + off + dark} ns"\npower = {{ unit = true }}\n'
    )
    made.run_to(SECOND)
    unit = DRIVERS[model](HostPort(made))
    speeds = Speeds(700 if model == "supersigma" else 100, 900, 0.1)
    unit.set_speeds(speeds)
    unit.move_by(300)
    unit.wait(30)
    assert unit.position() == 300
    made.run_to(BEGINS)
    told: BaseException | None = None
    for call in calls.split("; "):
        try:
            unit.set_speeds(speeds) if call == "set_speeds()" else eval(f"unit.{call}", {"unit": unit})
        except ValueError:
            pass  # no call of this model
        except DriverError as error:
            told = error
            break
    made.run_to(max(made.now, BEGINS + off + dark + 3 * SECOND))
    return made, unit, told


def given_since(made: Cell, since: Ns) -> tuple[int, Ns | None]:
    """The pulses that the unit gave from `since` on, forward less backward, and when the first of them began."""
    assert made.recording is not None
    (axis,) = {name for name in ("", "X") if made.recording.motion("unit", made.now, name)}
    spans = [span for span in made.recording.motion("unit", made.now, axis) if span.begins >= since]
    return sum(span.direction * (span.last - span.first + 1) for span in spans), spans[0].begins if spans else None


NAMES = "supply|switched off|does not answer|does not finish|is off|takes no line|was it stopped otherwise"


@pytest.mark.parametrize("model", DRIVERS)
@given(st.sampled_from(CALLS), st.integers(0, 1500 * MS), st.sampled_from([1, 20, 300, 2500]))
@settings(max_examples=examples(60))
def test_a_supply_that_is_lost_at_any_instant_of_a_call(model: str, calls: str, off: Ns, dark: int) -> None:
    made, unit, told = lost(model, calls, off, dark * MS)
    if told is not None:
        assert re.search(NAMES, str(told))  # as far as it shows: "does not finish" comes before "was switched off"
    elif calls.startswith("move"):
        given, began = given_since(made, BEGINS)
        lost_before = began is None or BEGINS + off < began  # the counter may have begun anew then: nobody can know
        assert given == (900 if calls.startswith("move_by") else 800) or (calls.startswith("move_to") and lost_before)
    if told is None:
        with suppress(DriverError):  # of what was lost behind the calls
            unit.position()
    before = unit.position()
    assert not unit.moving()
    now = made.now
    unit.move_by(50)
    unit.wait(30)
    assert unit.position() == before + 50
    assert given_since(made, now)[0] == 50
