"""`step_inputs` against its definition: of an axis at rest, each of twenty short pulses is a step.

They come faster than any input starts a motion that goes so far by itself; an input that answers each of them with a
step is one on which no pulse may be missed.
"""

from typing import cast

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.controllers.conformance import PinTo, Power, Received, Run, Schedule, schedules
from tests.controllers.test_cuts import DRIVEN, Candidate, every_controller, under_way
from tests.generated import examples

from detent.controllers.device import Controller
from detent.pins import HIGH, LOW
from detent.ticks import MS, SECOND, US, Ns
from detent.uart import Char

PULSES = 20
HALF: Ns = 33 * US


def controller(run: Run) -> Controller:
    return cast("Controller", run.device)


def steps_of(run: Run, pin: str) -> int:
    """How many steps of all axes follow so many pulses."""
    twin = run.fork()
    device = controller(twin)
    before = sum(device.status(twin.now, axis).pulses for axis in device.axes)
    for _ in range(PULSES):
        for level in (LOW, HIGH):
            twin.go_to(twin.now + HALF)
            device.set_pin(pin, level, twin.now)
            twin.collect()
    twin.go_to(twin.now + HALF)
    return sum(device.status(twin.now, axis).pulses for axis in device.axes) - before


def resting(run: Run) -> bool:
    device = controller(run)
    return all(under_way(run, axis) is None for axis in device.axes)


@settings(max_examples=examples(40), deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
@every_controller
def test_what_steps_with_every_pulse_says_so(candidate: Candidate, data: st.DataObject) -> None:
    schedule: Schedule = data.draw(schedules(candidate))
    run = Run(candidate, candidate.make())
    for gap, action in schedule:
        run.go_to(run.now + gap)
        run.do(action)
    device = controller(run)
    if resting(run):
        for pin in candidate.pins:
            assert pin in device.step_inputs() or steps_of(run, pin) < PULSES, pin


@pytest.mark.parametrize(
    ("name", "said", "pins"),
    [
        ("dcb-274", b" ", {"STEP"}),
        ("dcb-274-e", b" ", {"STEP", "DIR"}),
        ("bs0610", b"", set()),
        ("bs0610", b"1E", {"X-", "X+", "Y-", "Y+"}),
        ("bs0710 in E mode, hard limits", b"", {"X+", "Y+"}),
        ("gs-c200", b"", set()),
    ],
)
def test_they_are_the_step_inputs_of_the_manuals(name: str, said: bytes, pins: set[str]) -> None:
    candidate = next(candidate for candidate in DRIVEN if candidate.name == name)
    run = Run(candidate, candidate.make())
    run.do(Power(True))
    for pin in candidate.pins:
        run.do(PinTo(pin, HIGH))
    run.go_to(SECOND)
    for value in said:
        run.go_to(run.now + 20 * MS)
        run.do(Received((Char(value),)))
    run.go_to(run.now + SECOND)
    assert resting(run)
    assert pins <= set(controller(run).step_inputs())
    assert {pin for pin in candidate.pins if steps_of(run, pin) == PULSES} == pins


def test_a_board_that_begins_in_e_mode_says_so_without_its_supply() -> None:
    candidate = next(candidate for candidate in DRIVEN if "E mode" in candidate.name)
    device = controller(Run(candidate, candidate.make()))
    assert set(device.step_inputs()) == {"X-", "X+", "Y-", "Y+"}
