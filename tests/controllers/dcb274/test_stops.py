"""The laws of stopping, of limits and of the counter, for any history (pages 7, 8, 27, 28, 33, 34, 46 and 47)."""

import copy

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.controllers.dcb274 import histories
from tests.controllers.dcb274.histories import Action, begun, do, motions, shaft
from tests.generated import examples

from detent.controllers.dcb274.desk import Stage
from detent.ticks import MS, SECOND

FEW = settings(max_examples=examples(200), deadline=None)
MANY = settings(max_examples=10_000, deadline=None)


def a_stop_leads_to_rest(data: st.DataObject) -> None:
    """Pages 28 and 33: within the time of the ramp; nothing that was pending moves afterwards."""
    program, actions = data.draw(histories.histories())
    bench = begun(program)
    for action in actions:
        do(bench, action)
    bench.run_to(bench.now + data.draw(st.sampled_from(histories.SOON)))
    how = data.draw(st.sampled_from(histories.stops(bench)))
    longest = histories.longest_stop(bench)
    histories.stop(bench, how)
    bench.run_to(bench.now + longest)
    at, mark = shaft(bench), len(bench.out)
    assert bench.unit._motion.at_rest, f"{how} does not lead to rest"
    assert bench.unit.status(bench.now).state in ("ready", "waiting"), how
    bench.run_to(bench.now + 3 * SECOND)
    assert (shaft(bench), motions(bench, mark)) == (at, []), how


def a_jog_that_is_released_leads_to_rest(data: st.DataObject) -> None:
    """Page 28: jog is a special case of constant velocity; it ramps to rest."""
    program, actions = data.draw(histories.histories(6))
    bench = begun(program)
    for action in actions:
        do(bench, action)
    for pin, level in (("GO", 1), ("JOG1", 1), ("JOG2", 1), ("SS", 1), ("LIMIT-A", 1), ("LIMIT-B", 1)):
        bench.pin(pin, level)
    bench.say("\x1bl 0\r")
    bench.run_to(bench.now + 100 * MS)
    bench.say(data.draw(st.sampled_from(["w 10\r", "B 10 40\r", "B 200 250\r", "B 0 3\r"])))
    bench.run_to(bench.now + SECOND)
    for action in data.draw(st.lists(histories.actions(switches=("JOG1", "JOG2", "JOG-S")), max_size=6)):
        do(bench, Action(action.wait, action.what, action.level if action.level is not None else None))
    if not bench.unit._motion.jogging:
        return
    longest = histories.longest_stop(bench)
    bench.pin("JOG1", 1)
    bench.pin("JOG2", 1)
    bench.run_to(bench.now + longest)
    assert not bench.unit._motion.jogging


def a_closed_limit_is_never_passed(data: st.DataObject) -> None:
    """Pages 7 and 46: not by a step, or with flag 32 by no more than the ramp; whatever is done meanwhile."""
    program, actions = data.draw(histories.histories(8))
    bench = begun(program)
    gentle = data.draw(st.booleans())
    bench.say("l 32\r" if gentle else "l 0\r")
    bench.run_to(bench.now + 10 * MS)
    for action in actions:
        if not action.what.startswith("l ") and action.what != "C 0\r":
            do(bench, action)
    bench.run_to(bench.now + data.draw(st.sampled_from(histories.SOON)))
    pin, direction = data.draw(st.sampled_from([("LIMIT-A", 1), ("LIMIT-B", -1)]))
    bench.pin(pin, 0)
    at, registers = shaft(bench), bench.unit._settings
    rungs = len(histories.ladder(registers.initial, registers.divide).periods)
    over = registers.ramp[1] * rungs + 1 if registers.flags & 32 else 0
    for action in data.draw(st.lists(histories.actions("\x1b", "R 5000", "R -5000"), max_size=8)):
        if action.what in ("LIMIT-A", "LIMIT-B", "C 0\r") or action.what.startswith("l "):
            continue
        if over and action.what[:2] in ("K ", "I ", "D "):
            continue
        do(bench, action)
        assert (shaft(bench) - at) * direction <= over
    bench.run_to(bench.now + 2 * SECOND)
    assert (shaft(bench) - at) * direction <= over


def redefining_the_position_moves_nothing(data: st.DataObject) -> None:
    """Page 47: "may be changed without affecting the distance of travel in process"."""
    program, actions = data.draw(histories.histories(8))
    bench = begun(program)
    for action in actions:
        do(bench, action)
    unit = bench.unit
    if unit._desk.stage is not Stage.FREE or unit._desk.programming or unit._running.active or unit._motion.jogging:
        return
    twin, mark = copy.deepcopy(bench), len(bench.out)
    drive = unit.drive(bench.now)
    bench.say("O -1234\r")
    assert unit.drive(bench.now) == drive
    twin.say("D 1\r" if unit._settings.divide == 1 else "D 2\r")  # takes as long, and changes nothing
    bench.run_to(bench.now + 500_000)
    assert bench.position == -1234
    twin.run_to(bench.now)
    shift = bench.position - twin.position
    for _ in range(5):
        for one in (bench, twin):
            one.run_to(one.now + 300 * MS)
        assert motions(bench, mark) == motions(twin, mark)
        assert bench.position - twin.position == shift
        assert shaft(bench) == shaft(twin)


LAWS = (
    a_stop_leads_to_rest,
    a_jog_that_is_released_leads_to_rest,
    a_closed_limit_is_never_passed,
    redefining_the_position_moves_nothing,
)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
@given(data=st.data())
@FEW
def test_the_law_holds(law: object, data: st.DataObject) -> None:
    law(data)  # type: ignore[operator]


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
@given(data=st.data())
@MANY
def test_the_law_holds_for_many_histories(law: object, data: st.DataObject) -> None:
    law(data)  # type: ignore[operator]
