"""Switches: set by hand, or closed by an axis at the exact pulse."""

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.cell.cells import cell, edges, places
from tests.generated import examples

from detent.axis import Axis
from detent.cell.recording import InputSet
from detent.cell.switches import AxisSwitch, Switch
from detent.pins import PinSet
from detent.pulses import Train, Uniform
from detent.ticks import MS, SECOND, to_fixed

PROBED = """
[units.unit]
model = "gs-c200s"
straps = {{ CHS = 0 }}
options = {{ instruction_time = "1 us" }}
shaft = {shaft}

[switches.probe]
drives = "unit.UI3"
axis = "unit"
{where}
"""


def probed(where: str, shaft: int = 0):
    return cell(PROBED.format(where=where, shaft=shaft))


def seen(made) -> list[tuple[int, int]]:
    """What the probed input was set to."""
    return [(item.at, item.level) for item in made.recording.of("unit")
            if isinstance(item, InputSet) and item.pin == "UI3"]  # fmt: skip


def test_a_switch_set_by_hand_tells_its_level_and_its_changes() -> None:
    switch = Switch(0)
    switch.power(True, 0)
    switch.set_pin("SET", 0, 1)
    switch.set_pin("SET", 1, 2)
    switch.set_pin("SET", 1, 3)
    assert switch.drain() == [PinSet(0, "OUT", 0), PinSet(2, "OUT", 1)]
    assert switch.next_deadline() is None


def test_an_axis_switch_changes_at_the_pulse_that_crosses_its_edge() -> None:
    made = probed("from = 3\nto = 5")
    made.type("unit", "+9")
    made.run_to(1 * SECOND)
    times = {place: at for at, place in places(made, "unit")}
    assert seen(made) == [(times[3], 0), (times[6], 1)]
    made.type("unit", "-9")
    made.run_to(2 * SECOND)
    times = {place: at for at, place in places(made, "unit")[9:]}
    assert seen(made)[2:] == [(times[5], 0), (times[2], 1)]


def test_at_is_one_step_wide_and_inside_may_be_1() -> None:
    made = probed("at = 4\ninside = 1")
    assert seen(made) == [(0, 0)]
    made.type("unit", "+9")
    made.run_to(1 * SECOND)
    times = {place: at for at, place in places(made, "unit")}
    assert seen(made)[1:] == [(times[4], 1), (times[5], 0)]


def test_the_axis_may_stand_inside_when_the_cell_starts() -> None:
    made = probed("to = 0")
    assert seen(made) == [(0, 0)]
    assert probed("to = 0", shaft=5).recording.of("unit")[0] != InputSet(0, "UI3", 0)
    made = probed("from = 100", shaft=105)
    made.type("unit", "-9")
    made.run_to(1 * SECOND)
    assert [level for _, level in seen(made)] == [0, 1]
    assert seen(made)[1][0] == places(made, "unit")[5][0]


def test_a_held_pulse_crosses_no_edge_before_it_is_given() -> None:
    """Pin 24: "stops the generation of the step pulses"."""
    made = probed("at = 4")
    made.type("unit", "S100")
    made.run_to(1 * MS)
    made.type("unit", "+9")  # 1000 steps/s
    made.run_to(4 * MS + 500_000)
    made.set_pin("unit", "ENABLE", 0)
    made.run_to(100 * MS)
    assert made.controller("unit").status(made.now).position == 3
    assert seen(made) == []
    made.set_pin("unit", "ENABLE", 1)
    made.run_to(100 * MS)
    assert seen(made) == [(100 * MS, 0)]


def test_a_pulse_let_go_crosses_its_edge_even_if_K_comes_in_the_same_instant() -> None:
    made = probed("at = 4")
    made.type("unit", "S100")
    made.run_to(1 * MS)
    made.type("unit", "+9")
    made.run_to(4 * MS + 500_000)
    made.set_pin("unit", "ENABLE", 0)
    made.run_to(100 * MS)
    made.set_pin("unit", "ENABLE", 1)
    made.type("unit", "K")
    made.run_to(200 * MS)
    assert made.controller("unit").status(made.now).position == 4
    assert seen(made) == [(100 * MS, 0)]


def test_a_pulse_let_go_crosses_its_edge_even_if_Z_comes_in_the_same_instant() -> None:
    made = probed("at = 4")
    made.type("unit", "+500")
    made.run_to(places_of("+500")[2] + 1)
    made.set_pin("unit", "ENABLE", 0)
    made.run_to(100 * MS)
    made.set_pin("unit", "ENABLE", 1)
    made.type("unit", "Z")
    made.run_to(1 * SECOND)
    assert made.controller("unit").status(made.now).position == 10
    assert seen(made)[0] == (100 * MS, 0)
    assert [level for _, level in seen(made)] == [0, 1]


def places_of(command: str) -> list[int]:
    made = probed("at = 100000")
    made.type("unit", command)
    made.run_to(2 * SECOND)
    return [at for at, _ in places(made, "unit")]


def test_a_move_that_is_cut_crosses_nothing_behind_the_cut() -> None:
    made = probed("from = 6")
    made.type("unit", "+50")
    made.run_to(places_of("+50")[4])
    made.type("unit", "K")
    made.run_to(5 * SECOND)
    assert seen(made) == []
    made.type("unit", "-3")
    made.run_to(6 * SECOND)
    made.type("unit", "+4")
    made.run_to(7 * SECOND)
    assert seen(made) == [(places(made, "unit")[-1][0], 0)]


def test_power_off_in_a_move_stops_the_switch_too() -> None:
    made = probed("from = 6")
    made.type("unit", "+50")
    made.run_to(places_of("+50")[4])
    made.power("unit", False)
    made.run_to(5 * SECOND)
    assert seen(made) == []
    made.power("unit", True)
    made.type("unit", "+1")
    made.run_to(6 * SECOND)
    assert len(seen(made)) == 1


def test_a_switch_with_another_axis_does_not_follow() -> None:
    out: list = []
    axis = Axis(out, 0, "y")
    axis.start(Train((Uniform.at_rate(0, 1000, 9),), to_fixed(0)), 1, (), 0)
    switch = AxisSwitch(3, 3, 0, axis="x")
    for item in out:
        switch.follow(item)
    assert switch.next_deadline() is None


EVENTS = st.lists(
    st.tuples(
        st.integers(0, 60 * MS) | st.sampled_from([0, 1 * MS]),
        st.sampled_from(["+7", "-5", "+30", "-30", "g+", "g-", "K", "Z", "off", "on", "H+", "H-"])
        | st.sampled_from(["+30", "-30", "low", "high"]),
    ),
    max_size=14,
)


@settings(max_examples=examples(250), deadline=None, suppress_health_check=list(HealthCheck))
@given(
    EVENTS,
    st.none() | st.integers(-12, 12),
    st.none() | st.integers(0, 12),
    st.sampled_from([0, 1]),
    st.integers(-10, 10),
)
def test_an_axis_switch_is_where_the_pulses_say(
    events: list[tuple[int, str]], low: int | None, width: int | None, inside: int, shaft: int
) -> None:
    """Against every single pulse of the recording, whatever happens to the move."""
    high = None if width is None else (low or 0) + width
    if low is None and high is None:
        low = 0
    ends = {"from": low, "to": high}
    where = "\n".join([f"inside = {inside}", *(f"{key} = {end}" for key, end in ends.items() if end is not None)])
    made = probed(where, shaft)
    made.type("unit", "S20")
    for gap, what in events:
        made.run_to(made.now + gap)
        if what in ("low", "high"):
            made.set_pin("unit", "ENABLE", int(what == "high"))
        elif what in ("off", "on"):
            made.power("unit", what == "on")
        else:
            made.type("unit", what)
    made.run_to(made.now + 1 * SECOND)

    def level(place: int) -> int:
        within = (low is None or place >= low) and (high is None or place <= high)
        return inside if within else 1 - inside

    expected = [] if level(shaft) == 1 else [(0, 0)]
    before = level(shaft)
    for at, place in places(made, "unit"):
        if level(place) != before:
            before = level(place)
            expected.append((at, before))
    assert seen(made) == expected
    assert edges(made, "unit", "CLOCK")[0] == (0, 1)
