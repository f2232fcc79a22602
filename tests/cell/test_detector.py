"""A step detector on ENABLE closes the loop (GS-C200 datasheet, "Closed loop operation", figures 17 to 19)."""

from itertools import pairwise

import pytest
from tests.cell.cells import cell, edges, pulses

from detent.cell.detector import StepDetector
from detent.controllers.device import Powered
from detent.pins import PinSet
from detent.ticks import MS, SECOND, US

UNIT = '[units.unit]\nmodel = "gs-c200"\n'
LOOP = (
    UNIT
    + """
[units.watch]
model = "step-detector"
options = {{ {options} }}

[[wires]]
from = "unit.CLOCK"
to = "watch.CLOCK"

[[wires]]
from = "watch.DONE"
to = "unit.ENABLE"
"""
)


def moved(text: str, command: str = "+300", until: int = 5 * SECOND):
    made = cell(text)
    made.type("unit", command)
    made.run_to(until)
    return made


def test_each_step_pulse_takes_done_low_until_the_motor_has_stepped() -> None:
    watch = StepDetector(response=200 * US)
    watch.power(True, 0)
    watch.set_pin("CLOCK", 0, 1 * MS)
    watch.set_pin("CLOCK", 1, 1 * MS + 1700)
    assert watch.next_deadline() == 1 * MS + 200 * US
    watch.advance(1 * MS + 200 * US)
    assert watch.drain() == [Powered(0, True), PinSet(0, "DONE", 1), PinSet(1 * MS, "DONE", 0),
                             PinSet(1200 * US, "DONE", 1)]  # fmt: skip
    assert watch.next_deadline() is None


def test_without_supply_it_sees_nothing() -> None:
    watch = StepDetector()
    watch.power(True, 0)
    watch.set_pin("CLOCK", 0, 1)
    watch.power(False, 2)
    assert watch.next_deadline() is None
    watch.set_pin("CLOCK", 1, 3)
    watch.set_pin("CLOCK", 0, 4)
    assert watch.steps == 1
    watch.drain()
    assert watch.next_deadline() is None


def test_a_healthy_move_is_not_slowed() -> None:
    """Specification: "a step detector on ENABLE closes the loop without slowing a healthy move"."""
    free = moved(UNIT)
    closed = moved(LOOP.format(options=""))
    assert pulses(closed, "unit") == pulses(free, "unit")
    assert edges(closed, "unit", "MOV") == edges(free, "unit", "MOV")
    assert edges(closed, "unit", "RAMP") == edges(free, "unit", "RAMP")


def test_slow_steps_stretch_the_move_and_no_pulse_is_lost() -> None:
    """Datasheet: "allowing the step clock pulse to be issued only if the previous step has been executed"."""
    free = pulses(moved(UNIT), "unit")
    made = moved(LOOP.format(options='slow_from = 100, slow_to = 104, slow_response = "20 ms"'))
    closed = pulses(made, "unit")
    assert len(closed) == 300
    assert closed[:100] == free[:100]
    assert [b - a for a, b in pairwise(closed[99:105])] == [20 * MS] * 5
    late = closed[104] - free[104]
    assert late == 5 * 19 * MS
    assert all(abs(b - a - late) <= 1 for a, b in zip(free[104:], closed[104:], strict=True))
    assert made.controller("unit").status(made.now).position == 300


@pytest.mark.parametrize("response", ["999999 ns", "1 ms", "1000001 ns", "1500 us", "30 ms"])
def test_a_motor_slower_than_the_slew_sets_the_pace(response: str) -> None:
    made = moved(LOOP.format(options=f'response = "{response}"'), "+120", 10 * SECOND)
    given = pulses(made, "unit")
    assert len(given) == 120
    text, _, unit = response.partition(" ")
    least = int(text) * {"ns": 1, "us": US, "ms": MS}[unit]
    gaps = [b - a for a, b in pairwise(given)]
    assert min(gaps) >= min(least, 1 * MS) - 1
    if least > 10 * MS:
        assert gaps == [least] * 119
    assert made.controller("unit").status(made.now).position == 120


def test_a_motor_that_never_steps_is_waited_for_until_K() -> None:
    made = moved(LOOP.format(options='slow_from = 50, slow_to = 50, slow_response = "1 h"'))
    assert len(pulses(made, "unit")) == 50
    made.type("unit", "K")
    made.run_to(6 * SECOND)
    assert made.controller("unit").status(made.now) == (50, 50, "ready")


def test_Z_in_the_closed_loop_ramps_down_as_ever() -> None:
    made = cell(LOOP.format(options='response = "1200 us"'))
    made.type("unit", "+500")
    made.run_to(500 * MS)
    given = len(pulses(made, "unit"))
    made.type("unit", "Z")
    made.run_to(5 * SECOND)
    assert len(pulses(made, "unit")) == given + 1 + 50
