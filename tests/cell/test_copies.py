"""A cell is determined by its description and its inputs, and a copy goes on alone exactly as the cell would."""

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.cell.cells import cell
from tests.controllers.gsc200.inputs import commands, stored
from tests.generated import examples

from detent.cell.cell import Cell
from detent.ticks import MS, SECOND

DESCRIPTION = """
[units.one]
model = "gs-c200"
straps = { SEL0 = 0, CHS = 0 }
program = "one.gsc"

[units.two]
model = "gs-c200s"
straps = { SEL0 = 0, SEL1 = 0, CHS = 0 }
eeprom = "two.gsc"

[units.watch]
model = "step-detector"
options = { response = "900 us", slow_from = 5, slow_to = 30, slow_response = "3 ms" }

[lines.bus]
units = ["one", "two"]

[[wires]]
from = "one.UO1"
to = "two.UI1"

[[wires]]
from = "two.UO1"
to = "one.UI2"

[[wires]]
from = "two.CLOCK"
to = "watch.CLOCK"

[[wires]]
from = "watch.DONE"
to = ["two.ENABLE", "one.UI3"]

[[wires]]
from = "two.RDY"
to = "one.ENABLE"

[switches.end]
drives = ["one.EOT", "two.UI2"]
axis = "one"
from = 40

[switches.zero]
drives = "one.HOME"
axis = "one"
to = 0

[switches.hand]
drives = "two.UI3"
level = 0

[[script]]
at = 0.02
set = { hand = 1 }

[[script]]
at = 0.05
send = ["+30"]
to = "two"

[[script]]
at = 0.2
power = { two = false }

[[script]]
at = 0.25
power = { two = true }
"""

FILES = {"one.gsc": "S20\nA1\n+60\nC1\nG0\nL2\n", "two.gsc": "S30\n+20\n-20\n"}
UNITS = st.sampled_from(["one", "two"])
ACTIONS = st.lists(
    st.tuples(
        st.sampled_from([0, 0, 1, 1 * MS]) | st.integers(0, 60 * MS),
        st.one_of(
            st.tuples(st.just("type"), UNITS, commands("gs-c200", 100, 200) | stored("gs-c200s", 100, 200)),
            st.tuples(st.just("set_switch"), st.sampled_from(["hand", "end"]), st.integers(0, 1)),
            st.tuples(st.just("set_pin"), UNITS, st.sampled_from([0, 1])),
            st.tuples(st.just("power"), UNITS, st.booleans()),
            st.tuples(st.just("send"), st.just(0), st.binary(max_size=8)),
        ),
    ),
    max_size=14,
)
SETTINGS = settings(max_examples=examples(40), deadline=None, suppress_health_check=list(HealthCheck))


def made(**options: object) -> Cell:
    return cell(DESCRIPTION, FILES, **options)


def do(target: Cell, actions: list) -> None:
    for gap, (what, where, value) in actions:
        target.run_to(target.now + gap)
        if what == "set_pin":
            target.set_pin(where, "UI1", value)
        else:
            getattr(target, what)(where, value)


def all_of(target: Cell) -> list:
    """Everything that can be seen of a cell."""
    assert target.recording is not None
    heard = list(target.lines[0].heard)
    states = [unit.status(target.now) for unit in target.controllers().values()]
    return [list(target.recording), heard, states, target.now, target.next_event()]


@SETTINGS
@given(ACTIONS, st.booleans())
def test_the_same_inputs_give_the_same_recording(actions: list, line_timing: bool) -> None:
    recordings = []
    for _ in range(2):
        target = made(line_timing=line_timing)
        do(target, actions)
        target.run_to(target.now + 300 * MS)
        recordings.append(all_of(target))
    assert recordings[0] == recordings[1]


@SETTINGS
@given(ACTIONS, ACTIONS, ACTIONS, st.booleans())
def test_a_copy_goes_on_as_the_cell_would_and_neither_minds_the_other(
    before: list, after: list, other: list, line_timing: bool
) -> None:
    whole = made(line_timing=line_timing)
    do(whole, before)
    do(whole, after)
    whole.run_to(whole.now + 300 * MS)
    expected = all_of(whole)
    target = made(line_timing=line_timing)
    do(target, before)
    first, second = target.copy(), target.copy()
    do(second, other)
    second.run_to(second.now + 1 * SECOND)
    do(first, after)
    first.run_to(first.now + 300 * MS)
    assert all_of(first) == expected
    do(target, after)
    target.run_to(target.now + 300 * MS)
    assert all_of(target) == expected
    assert all_of(first) == expected


@SETTINGS
@given(ACTIONS, st.lists(st.integers(0, 400 * MS), max_size=20))
def test_it_does_not_matter_in_how_many_calls_time_passes(actions: list, stops: list[int]) -> None:
    whole, sliced = made(), made()
    do(whole, actions)
    do(sliced, actions)
    until = whole.now + 400 * MS
    whole.run_to(until)
    start = sliced.now
    for stop in sorted(stops):
        sliced.run_to(start + stop)
    while (at := sliced.next_event()) is not None and at <= until:
        sliced.step()
    sliced.run_to(until)
    assert all_of(sliced) == all_of(whole)


@SETTINGS
@given(ACTIONS)
def test_times_of_a_recording_rise(actions: list) -> None:
    target = made(line_timing=True)
    do(target, actions)
    target.run_to(target.now + 300 * MS)
    assert target.recording is not None
    for unit in target.recording.units:
        times = [entry.at for entry in target.recording.of(unit)]
        assert times == sorted(times)


def test_a_copy_of_a_copy_in_the_middle_of_everything() -> None:
    whole = made()
    whole.run_to(2 * SECOND)
    target = made()
    for milliseconds in range(0, 400, 7):
        target.run_to(milliseconds * MS)
        target = target.copy()
    target.run_to(2 * SECOND)
    assert all_of(target) == all_of(whole)
