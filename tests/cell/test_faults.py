"""What breaks in a cell, and that the same breakage gives the same recording."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.cell.cells import cell, edges
from tests.generated import examples

from detent.cell.actions import Break, TimedAction
from detent.cell.cell import Cell
from detent.cell.faults import Fault, OnLine, StuckPin, StuckSwitch, SupplyDip, WriteFailure
from detent.lines.faults import BitErrors, CableOut, Delay, LostCharacters
from detent.lines.line import Line
from detent.ticks import MS, SECOND

ONE = '[units.a]\nmodel = "gs-c200"\nstraps = { CHS = 0 }\n'
SLIDE = f"""
{ONE}
[switches.sensor]
drives = ["a.UI1"]
axis = "a"
from = 50
[switches.hand]
drives = "a.UI2"
"""
TWO = f"""
{ONE}
[units.b]
model = "gs-c200"
straps = {{ CHS = 0 }}
program = "b.gsc"
[[wires]]
from = "a.UO1"
to = "b.UI1"
[switches.far]
drives = ["b.UI2", "a.ENABLE"]
axis = "b"
from = 30
to = 35
[switches.hand]
drives = "a.UI2"
"""
FILES = {"b.gsc": "S20\nA1\n+60\nC1\n-20\nL2\n"}


def answers(made: Cell, *lines: str) -> list[str]:
    """What unit a answers to command lines, each with some time for it."""
    found = []
    for line in lines:
        made.type("a", line)
        made.run_to(made.now + 100 * MS)
        heard = bytes(heard.char.value for heard in made.lines[0].take())
        found += made.controller("a").answers(heard)
    return found


@pytest.mark.parametrize("line_timing", [True, False])
def test_a_damaged_command_is_answered_e1(line_timing: bool) -> None:
    """Datasheet, error codes: E1, a character with a wrong parity."""
    made = cell(ONE, line_timing=line_timing)
    made.breaks(OnLine(0, BitErrors("units", nth=2)))
    assert answers(made, "V1", "V1") == ["E1", "V0"]


@pytest.mark.parametrize("line_timing", [True, False])
def test_a_line_that_is_mended_is_the_line_that_it_was(line_timing: bool) -> None:
    made = cell(ONE, line_timing=line_timing)
    whole = made.lines[0]
    made.breaks(OnLine(0, CableOut()), 50 * MS)
    assert made.lines[0] is not whole
    assert answers(made, "V1", "V1") == ["V0"]
    assert type(made.lines[0]) is Line
    assert made.lines[0] is whole


def test_several_faults_share_a_line_and_are_mended_one_by_one() -> None:
    made = cell(ONE)
    first = made.breaks(OnLine(0, LostCharacters("host", nth=1)))
    second = made.breaks(OnLine(0, Delay(10 * MS)))
    assert answers(made, "V1") == ["0"]
    made.mend(first)
    made.mend(second)
    assert answers(made, "V1") == ["V0"]


def test_nothing_is_left_of_a_fault_that_was_mended_before_its_time() -> None:
    made = cell(ONE)
    made.run_to(SECOND)
    following = made.next_event()
    lasting = made.breaks(OnLine(0, CableOut()), 50 * MS)
    made.breaks(OnLine(0, CableOut()), 60 * MS)
    made.mend(lasting)
    assert made.next_event() == SECOND + 60 * MS
    made.run_to(2 * SECOND)
    assert not made.faults.standing
    for _ in range(10):
        made.mend(made.breaks(OnLine(0, CableOut()), 10**6 * SECOND))
    assert made.next_event() == following


def test_a_stuck_switch_stays_while_the_axis_moves_on_and_is_right_when_mended() -> None:
    made = cell(SLIDE)
    fault = made.breaks(StuckSwitch("sensor", 1))
    assert answers(made, "+100") == ["Y"]
    made.run_to(made.now + 2 * SECOND)
    assert made.controller("a").status(made.now).position == 100
    assert made.circuit.given(0, "UI1") == 1
    made.mend(fault)
    assert made.circuit.given(0, "UI1") == 0
    assert answers(made, "V2") == ["V60"], "UI1 is 0 now"


def test_a_stuck_input_hears_neither_its_wire_nor_a_hand() -> None:
    made = cell(SLIDE)
    fault = made.breaks(StuckPin("a", "UI2", 0))
    made.set_switch("hand", 0)
    made.set_switch("hand", 1)
    made.set_pin("a", "UI2", 1)
    assert answers(made, "V2") == ["V50"]
    made.mend(fault)
    assert answers(made, "V2") == ["V70"]


def test_an_input_without_a_wire_is_as_it_was_given_when_it_is_mended() -> None:
    made = cell(ONE)
    fault = made.breaks(StuckPin("a", "UI3", 0))
    made.mend(fault)
    assert answers(made, "V2") == ["V70"]
    made.set_pin("a", "UI3", 0)
    made.mend(made.breaks(StuckPin("a", "UI3", 1)))
    assert answers(made, "V2") == ["V30"]
    made.release("a", "UI3")
    assert answers(made, "V2") == ["V70"]


def test_two_stuck_inputs_of_one_wire_are_mended_in_any_order() -> None:
    text = f"{TWO}\n"
    for order in ((0, 1), (1, 0)):
        made = cell(text, FILES)
        whole = made.wiring
        faults = [made.breaks(StuckPin("b", "UI2", 0)), made.breaks(StuckPin("a", "ENABLE", 0))]
        for one in order:
            made.mend(faults[one])
        assert made.wiring == whole


def test_a_write_that_fails_leaves_the_old_image() -> None:
    kept = []
    made = cell(ONE, store=lambda unit, image: bool(kept.append(image)) or True)
    made.breaks(WriteFailure("a", 2))
    assert answers(made, "P", "C1", "E", "K", "M", "M", "M")[-3:] == ["E6", "E6", "Y"]
    assert len(kept) == 1


def test_a_dip_switches_the_supply_off_and_on_again() -> None:
    made = cell(ONE)
    assert answers(made, "+1000") == ["Y"]
    made.breaks(SupplyDip("a"), 20 * MS)
    made.run_to(made.now + 1 * SECOND)
    assert made.controller("a").status(made.now).state == "ready"
    assert answers(made, "V1") == ["V0"], "the counter is lost"
    with pytest.raises(ValueError, match="say how long it lasts"):
        made.breaks(SupplyDip("a"))


@pytest.mark.parametrize("on", [False, True])
def test_after_a_dip_the_supply_is_as_its_switch_is_then(on: bool) -> None:
    made = cell(ONE)
    made.breaks(SupplyDip("a"), 20 * MS)
    made.power("a", False)
    if on:
        made.power("a", True)
    assert not made.circuit.supplied(0), "no switch ends a dip"
    made.run_to(made.now + 1 * SECOND)
    assert made.circuit.supplied(0) == on
    assert answers(made, "V1") == (["V0"] if on else [])


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (StuckSwitch("nothing", 0), "no switch 'nothing'"),
        (StuckPin("a", "UO1", 0), "a has no input UO1"),
        (StuckPin("a", "CHS", 0), "CHS is a strap"),
        (StuckPin("c", "UI1", 0), "no unit 'c'"),
        (WriteFailure("a", -1), "writes cannot fail"),
        (OnLine(0, BitErrors()), "either a rate"),
    ],
)
def test_what_cannot_break_changes_nothing_and_is_not_noted(fault: Fault, says: str) -> None:
    made = cell(SLIDE)
    before = (made.wiring, list(made.lines))
    with pytest.raises((ValueError, KeyError), match=says):
        made.breaks(fault)
    assert (made.wiring, list(made.lines)) == before
    assert len(made.journal) == 0
    assert made.breaks(WriteFailure("a")) == 1


def test_what_is_stuck_does_not_stick_twice() -> None:
    made = cell(SLIDE)
    for fault in (StuckSwitch("sensor", 1), StuckPin("a", "UI2", 0)):
        made.breaks(fault)
        with pytest.raises(ValueError, match="stuck already: mend that first"):
            made.breaks(fault)


def test_a_fault_that_never_was_cannot_be_mended() -> None:
    made = cell(ONE)
    number = made.breaks(OnLine(0, CableOut()))
    made.mend(number)
    made.mend(number)
    with pytest.raises(KeyError, match="there was no fault 2"):
        made.mend(2)


def test_a_level_from_outside_comes_behind_everything_of_its_instant() -> None:
    made = cell(TWO, FILES)
    made.run_to(500 * MS)
    made.set_switch("hand", 0)
    assert list(made.journal)[-1].outside
    assert edges(made, "a", "UO1") is not None


FAULTS = st.one_of(
    st.builds(
        OnLine, st.integers(0, 1), st.builds(BitErrors, st.just("both"), st.floats(0.05, 1), seed=st.integers(0, 9))
    ),
    st.builds(OnLine, st.integers(0, 1), st.builds(LostCharacters, st.just("both"), st.floats(0.05, 1))),
    st.builds(OnLine, st.integers(0, 1), st.builds(Delay, st.integers(1, 30 * MS), st.sampled_from(["units", "host"]))),
    st.builds(OnLine, st.integers(0, 1), st.builds(CableOut)),
    st.builds(StuckSwitch, st.sampled_from(["far", "hand"]), st.integers(0, 1)),
    st.builds(StuckPin, st.just("b"), st.sampled_from(["UI1", "UI2", "UI3"]), st.integers(0, 1)),
    st.builds(WriteFailure, st.sampled_from(["a", "b"]), st.integers(0, 2)),
    st.builds(SupplyDip, st.sampled_from(["a", "b"])),
)
ACTIONS = st.lists(
    st.tuples(
        st.sampled_from([0, 0, MS]) | st.integers(0, 60 * MS),
        st.one_of(
            st.tuples(st.just("breaks"), FAULTS, st.none() | st.integers(1, 80 * MS)),
            st.tuples(st.just("mend"), st.integers(1, 6)),
            st.tuples(st.just("type"), st.sampled_from("ab"), st.sampled_from(["V1", "+30", "F", "M", "A1", "C1"])),
            st.tuples(st.just("set_switch"), st.sampled_from(["hand", "far"]), st.integers(0, 1)),
            st.tuples(st.just("set_pin"), st.just("b"), st.just("UI3"), st.integers(0, 1)),
            st.tuples(st.just("release"), st.just("b"), st.just("UI3")),
            st.tuples(st.just("power"), st.sampled_from("ab"), st.booleans()),
        ),
    ),
    max_size=14,
)


def do(target: Cell, actions: list) -> None:
    for gap, (what, *arguments) in actions:
        target.run_to(target.now + gap)
        try:
            getattr(target, what)(*arguments)
        except (ValueError, KeyError):
            continue  # what cannot break does not, each time


def all_of(target: Cell) -> list:
    assert target.recording is not None
    heard = [list(line.heard) for line in target.lines]
    return [list(target.recording), heard, [net.level for net in target.circuit.nets], target.now, target.next_event()]


SETTINGS = settings(max_examples=examples(60), deadline=None, suppress_health_check=list(HealthCheck))


@SETTINGS
@given(ACTIONS, st.booleans())
def test_a_cell_built_with_the_journal_makes_the_same_recording(actions: list, line_timing: bool) -> None:
    made = cell(TWO, FILES, line_timing=line_timing)
    do(made, actions)
    until = made.now + 300 * MS
    made.run_to(until)
    again = cell(TWO, FILES, line_timing=line_timing, journal=list(made.journal))
    again.run_to(until)
    assert all_of(again) == all_of(made)


@SETTINGS
@given(ACTIONS, ACTIONS, st.booleans())
def test_a_copy_of_a_broken_cell_goes_on_as_the_cell_does(before: list, after: list, line_timing: bool) -> None:
    made = cell(TWO, FILES, line_timing=line_timing)
    do(made, before)
    copy = made.copy()
    do(made, after)
    made.run_to(made.now + 300 * MS)
    do(copy, after)
    copy.run_to(copy.now + 300 * MS)
    assert all_of(copy) == all_of(made)


def test_the_journal_has_faults_as_data() -> None:
    made = cell(ONE)
    made.run_to(5 * MS)
    made.breaks(OnLine(0, CableOut()), 7 * MS)
    made.run_to(20 * MS)
    assert list(made.journal) == [TimedAction(5 * MS, Break(OnLine(0, CableOut()), 7 * MS), True)]
