import threading
from collections.abc import Iterator
from concurrent.futures import CancelledError
from copy import deepcopy
from typing import Any

import pytest
from tests.realtime.controlled import controlled, no_file, one, slide

from detent.cell.actions import Send, TimedAction
from detent.cell.cell import Cell
from detent.cell.description import parse, single
from detent.cell.recording import Log
from detent.realtime import verbs
from detent.realtime.breaking import MOST
from detent.realtime.control import Control, Ending
from detent.realtime.service import Service
from detent.realtime.verbs import AskedWrongly, Verb
from detent.realtime.watch import MOST_EVENTS, WEIGHT, RecentLog
from detent.ticks import MS


@pytest.fixture
def cell() -> Iterator[Control]:
    with controlled(slide()) as control:
        yield control


def unit(control: Control, name: str) -> dict[str, Any]:
    units: Any = control.call("state", {})["units"]
    found: dict[str, Any] = units[name]
    return found


def test_a_service_that_is_not_observed_has_no_control_and_keeps_nothing() -> None:
    with Service(one(), no_file) as service:
        assert type(service.cell) is Cell
        assert service.cell.recording is None
        assert service.watched is None
        with pytest.raises(ValueError, match="make it with observed=True"):
            Control(service)


def test_the_state_tells_everything(cell: Control) -> None:
    state: Any = cell.call("state", {})
    assert state["paused"] is False
    assert state["pace"] is None
    assert set(state["units"]) == {"slide", "other", "watch"}
    assert state["units"]["slide"]["model"] == "gs-c200"
    assert state["units"]["slide"]["state"] == "ready"
    assert state["units"]["slide"]["axes"] == {"": {"position": 0, "pulses": 0, "rate": 0.0, "state": "ready"}}
    assert state["units"]["slide"]["pins"]["CHS"] == 0
    assert state["units"]["slide"]["pins"]["BR0"] == 0, "a strap that was left open has its default"
    assert state["units"]["slide"]["pins"]["RDY"] == 1
    assert state["lines"]["slide"]["format"] == "9600 7O2"
    assert state["lines"]["slide"]["endpoints"][0].startswith("pty /dev/")
    assert state["switches"] == {"sensor": {"level": 1, "stuck": False}, "hand": {"level": 1, "stuck": False}}
    assert state["faults"] == []
    assert [event["event"] for event in state["events"]] == ["on"] * 3


def test_a_cell_is_stopped_at_the_pulse_that_brings_its_axis_to_a_place(cell: Control) -> None:
    cell.call("pause", {})
    cell.call("type", {"unit": "slide", "text": "+1000"})
    told = cell.call("wait", {"unit": "slide", "position": 417, "resume": True, "pause": True})
    assert told["reached"] is True
    assert told["paused"] is True
    axis = unit(cell, "slide")["axes"][""]
    assert axis["position"] == 417
    assert axis["rate"] > 0
    cell.call("wait", {"unit": "slide", "state": "ready", "resume": True})
    assert unit(cell, "slide")["axes"][""]["position"] == 1000


def test_one_waits_for_a_level_and_for_all_that_is_named_at_once(cell: Control) -> None:
    cell.call("pause", {})
    cell.call("type", {"unit": "slide", "text": "A1"})
    cell.call("wait", {"pin": "other.UI1", "level": "high", "resume": True})
    cell.call("pause", {})
    cell.call("type", {"unit": "slide", "text": "+100"})
    cell.call("wait", {"unit": "slide", "state": "running", "pin": "slide.UI1", "resume": True, "pause": True})
    assert unit(cell, "slide")["axes"][""]["position"] == 50, "the pulse that closes the sensor"


def test_one_waits_for_a_time_of_the_cell(cell: Control) -> None:
    told = cell.call("wait", {"time": "3 s", "pause": True})
    assert told["time_ns"] == 3_000_000_000


def test_what_does_not_come_in_time_is_told_with_the_state(cell: Control) -> None:
    told = cell.call("wait", {"unit": "slide", "position": 5, "timeout": "1 ms"})
    assert told["reached"] is False
    assert "units" in told


def test_a_cell_that_stands_goes_on_step_by_step_and_for_a_time(cell: Control) -> None:
    began = cell.call("pause", {})["time_ns"]
    assert isinstance(began, int)
    cell.call("type", {"unit": "slide", "text": "V1"})
    first = cell.call("step", {})["time_ns"]
    second = cell.call("step", {})["time_ns"]
    assert isinstance(first, int)
    assert isinstance(second, int)
    assert began < first < second
    third = cell.call("step", {"time": "5 ms"})
    assert third["time_ns"] == second + 5 * MS
    last = cell.call("run-for", {"time": 0.02})
    assert last["time_ns"] == second + 25 * MS
    assert last["paused"] is True
    assert cell.call("resume", {})["paused"] is False


def test_a_change_of_pace_leaves_a_cell_that_stands_where_it_is(cell: Control) -> None:
    now = cell.call("pause", {})["time_ns"]
    assert cell.call("pace", {"pace": 3}) == {"time_ns": now, "paused": True, "pace": 3.0}
    assert cell.call("pace", {"pace": "free"})["pace"] is None
    with pytest.raises(AskedWrongly, match="is no pace"):
        cell.call("pace", {"pace": 0})


def test_inputs_are_set_and_released(cell: Control) -> None:
    cell.call("set", {"pin": "slide.UI3", "level": "low"})
    pins: Any = cell.call("pins", {"unit": "slide"})["pins"]
    assert pins["slide"]["UI3"] == {"level": 0, "kind": "input", "wired": False, "stuck": False}
    cell.call("release", {"pin": "slide.UI3"})
    pins = cell.call("pins", {})["pins"]
    assert pins["slide"]["UI3"]["level"] == 1
    assert set(pins) == {"slide", "other", "watch"}


def test_switches_and_supplies_are_switched(cell: Control) -> None:
    cell.call("switch", {"switch": "hand", "level": 0})
    assert unit(cell, "slide")["pins"]["UI2"] == 0
    cell.call("power", {"unit": "slide", "on": "off"})
    off = unit(cell, "slide")
    assert (off["powered"], off["state"], off["pins"]["RDY"]) == (False, "off", None)
    cell.call("power", {"unit": "slide", "on": True})
    assert unit(cell, "slide")["state"] == "ready"


def test_what_is_refused_is_told_with_the_reason(cell: Control) -> None:
    """Datasheet, error codes: E3, an argument that is not allowed."""
    cell.call("type", {"unit": "slide", "text": "U9"})
    cell.call("wait", {"time": 1})
    slide = unit(cell, "slide")
    assert slide["refused"]["frame"] == "U9"
    assert slide["said"].startswith("E")
    assert slide["received"] == 3
    cell.call("power", {"unit": "slide", "on": False})
    assert unit(cell, "slide")["refused"] is None


def test_characters_are_sent_as_they_are_written(cell: Control) -> None:
    cell.call("send", {"line": "slide", "data": r"V1\r"})
    cell.call("wait", {"time": 1})
    assert unit(cell, "slide")["said"] == "V0\r"


def test_faults_tell_what_they_have_struck(cell: Control) -> None:
    assert cell.call("fault", {"where": "slide", "kind": "lost", "towards": "host", "nth": 1})["fault"] == 1
    cell.call("type", {"unit": "slide", "text": "V1"})
    cell.call("wait", {"time": 1})
    faults: Any = cell.call("faults", {})["faults"]
    assert faults == [
        {"fault": 1, "kind": "lost", "where": "slide", "towards": "host", "rate": 0.0, "nth": 1, "seed": 0,
         "met": 3, "struck": 1}
    ]  # fmt: skip
    events: Any = cell.call("state", {})["events"]
    assert (events[-1]["event"], events[-1]["before"]["value"]) == ("lost", ord("V"))
    assert cell.call("mend", {"fault": 1})["mended"] == [1]
    assert cell.call("mend", {"fault": 1})["mended"] == [], "it is over"
    assert cell.call("faults", {})["faults"] == []


@pytest.mark.parametrize(
    "fault",
    [
        {"where": "slide", "kind": "bit-errors", "rate": 0.5, "bit": "3", "towards": "units", "seed": 4},
        {"where": "slide", "kind": "lost", "nth": 7},
        {"where": "slide", "kind": "delay", "by": "20 ms"},
        {"where": "slide", "kind": "cable-out", "for": "1 s"},
        {"where": "sensor", "kind": "stuck", "level": "low"},
        {"where": "slide.UI3", "kind": "stuck", "level": 0},
        {"where": "slide", "kind": "eeprom", "times": 3},
        {"where": "slide", "kind": "dip", "for": 0.001},
    ],
)
def test_every_kind_of_fault_is_told_as_it_was_asked_and_is_mended(cell: Control, fault: dict[str, object]) -> None:
    cell.call("pause", {})
    cell.call("fault", fault)
    (told,) = cell.call("faults", {})["faults"]  # type: ignore[misc, union-attr]
    assert isinstance(told, dict)
    assert (told["kind"], told["where"]) == (fault["kind"], fault["where"])
    pins: Any = cell.call("pins", {"unit": "slide"})["pins"]
    stuck = {name for name, pin in pins["slide"].items() if pin["stuck"]}
    assert stuck == ({"UI3"} if fault["where"] == "slide.UI3" else set())
    cell.call("mend", {})
    assert cell.call("faults", {})["faults"] == []


def test_only_so_many_faults_stand_at_once_and_those_that_are_over_leave_nothing_behind(cell: Control) -> None:
    cell.call("pause", {})
    lasting = {"where": "slide", "kind": "lost", "nth": 10**6, "for": "1000 h"}
    for _ in range(MOST):
        cell.call("fault", lasting)
    with pytest.raises(AskedWrongly, match="100 faults stand; mend some first"):
        cell.call("fault", lasting)
    cell.call("mend", {})
    due = cell.call("state", {})
    for _ in range(3):
        cell.call("fault", lasting)
        cell.call("mend", {})
    assert cell.call("faults", {})["faults"] == []
    assert cell.call("state", {}) | {"events": []} == due | {"events": []}


def test_every_kind_of_fault_can_be_asked_for() -> None:
    assert set(verbs.FAULTS) == {"bit-errors", "lost", "delay", "cable-out", "stuck", "eeprom", "dip"}


def test_the_journal_tells_what_was_done(cell: Control) -> None:
    cell.call("pause", {})
    cell.call("switch", {"switch": "hand", "level": 0})
    cell.call("fault", {"where": "hand", "kind": "stuck", "level": 1})
    told: Any = cell.call("journal", {})
    assert told["complete"] is True
    assert [entry["deed"] for entry in told["journal"]] == ["SetSwitch", "Break"]
    assert told["journal"][1]["fault"] == {"kind": "StuckSwitch", "switch": "hand", "level": 1}
    assert len(cell.call("journal", {"last": 1})["journal"]) == 1  # type: ignore[arg-type]


def test_a_long_journal_forgets_its_beginning_and_counts_it() -> None:
    log: RecentLog[int] = RecentLog(10)
    for n in range(100):
        log.append(n)
    assert list(log)[-10:] == list(range(90, 100))
    assert log.forgotten + len(log) == log.appended == 100
    assert len(log) <= 20
    assert log.since(97) == [97, 98, 99]
    assert log.since(100) == []
    assert log.since(0) == list(log), "of what is forgotten nothing"


def test_a_journal_that_parted_from_its_copy_tells_its_own_newest() -> None:
    for kind in (Log[int], RecentLog[int]):
        log = kind()
        for n in range(4):
            log.append(n)
        twin = deepcopy(log)
        log.append(4)
        assert (log.since(3), twin.since(3)) == ([3, 4], [3])
        assert (log.appended, twin.appended) == (5, 4)


def test_a_journal_of_long_actions_takes_no_more_room() -> None:
    log: RecentLog[TimedAction] = RecentLog(1000)
    for n in range(500):
        log.append(TimedAction(n, Send(0, bytes(30_000))))
    assert sum(len(action.what.data) for action in log) <= 2 * 1000 * WEIGHT  # type: ignore[union-attr]
    assert log.forgotten + len(log) == 500
    assert list(log)[-1].at == 499


def test_events_take_no_room_without_end(cell: Control) -> None:
    cell.call("pause", {})
    for _ in range(MOST_EVENTS):
        cell.call("power", {"unit": "slide", "on": False})
        cell.call("power", {"unit": "slide", "on": True})
    assert len(cell.call("state", {})["events"]) == MOST_EVENTS  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("verb", "given", "says"),
    [
        ("stat", {}, "no verb 'stat'; did you mean state?"),
        ("state", {"unit": "a"}, "state takes no arguments; leave out unit"),
        ("pins", {"unt": "slide"}, "no argument of pins 'unt'; did you mean unit?"),
        ("pins", {"unit": "slid"}, "no unit 'slid'; did you mean slide?"),
        ("set", {"pin": "slide.UI3"}, "set: level is missing; it takes 0, 1, low or high: the level"),
        ("set", {"pin": "slide.UI3", "level": 2}, "level cannot be 2; it takes 0, 1, low or high"),
        ("set", {"pin": "slide.UI4", "level": 1}, "no input of slide 'UI4'; did you mean UI"),
        ("set", {"pin": "slide.UO1", "level": 1}, "no input of slide 'UO1'"),
        ("set", {"pin": "UI3", "level": 1}, "which unit; name one of: slide, other, watch"),
        ("release", {"pin": "slide.CHS"}, "slide.CHS is a strap; set it to the level that it is tied to"),
        ("switch", {"switch": "hnd", "level": 1}, "no switch 'hnd'; did you mean hand?"),
        ("type", {"text": "V1"}, "which unit"),
        ("type", {"text": "V1", "unit": "watch"}, "unit 'watch' is on no line"),
        ("send", {"data": "\u20ac", "line": "slide"}, "data has characters that are no bytes"),
        ("send", {"data": "x"}, "which line; name one of: slide, other"),
        ("run-for", {"time": "soon"}, "time cannot be 'soon'; it takes seconds, or a time like"),
        ("wait", {}, "wait: for what; name a state"),
        ("wait", {"level": 1}, "wait: a level of what; name the pin too"),
        ("wait", {"unit": "watch", "position": 3}, "watch moves no axis; name one of: slide, other"),
        ("wait", {"unit": "slide", "position": 3, "axis": "X"}, "slide has no axis 'X'; it has only one"),
        ("wait", {"time": 1, "timeout": 1e12}, "timeout cannot be 1000000000000.0; it takes seconds, at most a day"),
        ("wait", {"unit": "slide", "position": True}, "position cannot be True; it takes a whole number"),
        ("fault", {"where": "slide", "kind": "bit-eror"}, "no kind of fault 'bit-eror'; did you mean bit-errors?"),
        ("fault", {"where": "slide", "kind": "dip", "rate": 1}, "a fault dip takes no rate; it takes: for"),
        ("fault", {"where": "slide", "kind": "dip"}, "a supply dip ends by itself; say how long it lasts, or"),
        ("fault", {"where": "slid", "kind": "lost", "nth": 1}, "no line 'slid'; did you mean slide?"),
        ("fault", {"where": "slide", "kind": "lost"}, "say which characters are struck; either a rate"),
        ("fault", {"where": "slide", "kind": "delay"}, "by how much do characters come later; give by"),
        ("fault", {"where": "sensr", "kind": "stuck", "level": 1}, "no switch 'sensr'; did you mean sensor?"),
        ("fault", {"where": "sensor", "kind": "stuck"}, "where is sensor stuck; give level"),
        ("fault", {"where": "slide", "kind": "cable-out", "for": 0}, "a fault lasts for a time above 0"),
        ("mend", {"fault": 9}, "no fault '9'"),
    ],
)
def test_a_wrong_request_says_what_to_do(cell: Control, verb: str, given: dict[str, object], says: str) -> None:
    with pytest.raises(AskedWrongly) as caught:
        cell.call(verb, given)
    assert says in str(caught.value)
    assert cell.call("journal", {})["deeds"] == 0


def test_every_verb_of_the_table_is_done(cell: Control) -> None:
    assert set(cell._does) == set(verbs.VERBS)


@pytest.mark.parametrize("verb", verbs.VERBS.values(), ids=lambda verb: verb.name)
def test_the_table_is_in_order(verb: Verb) -> None:
    names = [parameter.name for parameter in verb.parameters]
    assert len(set(names)) == len(names)
    required = [parameter.required for parameter in verb.parameters]
    assert required == sorted(required, reverse=True), "what may be left out stands behind what may not"


def test_whoever_waits_when_it_ends_is_told() -> None:
    with controlled(one()) as control:
        caught: list[BaseException] = []

        def wait() -> None:
            try:
                control.call("wait", {"position": 99})
            except Ending as error:
                caught.append(error)

        waiting = threading.Thread(target=wait)
        waiting.start()
        while not control._waited_for:
            control.ask("state", {}).result()
        control.end()
        waiting.join()
        assert "not served any more" in str(caught[0])
        with pytest.raises(Ending):
            control.call("state", {})


def test_what_is_asked_of_a_service_that_is_closed_is_cancelled() -> None:
    with Service(one(), no_file, observed=True) as service:
        control = Control(service)
    with pytest.raises(CancelledError):
        control.ask("state", {}).result()


def test_who_cancels_waits_no_longer() -> None:
    with controlled(one()) as control:
        asked = control.ask("wait", {"position": 5})
        control.ask("state", {}).result()
        assert len(control._watched._waiters) == 1
        asked.cancel()
        control.ask("state", {}).result()
        assert control._watched._waiters == []


def test_watching_a_cell_that_keeps_pace_changes_nothing() -> None:
    with controlled(one(), free=False) as control:
        control.call("type", {"text": "+10"})
        control.call("wait", {"state": "ready", "position": 10})
        assert control.call("state", {})["pace"] == 1.0


CHAIN = """
[units.first]
model = "dcb-274"
[units.last]
model = "dcb-274"
[lines.chain]
kind = "daisy-chain"
units = ["first", "last"]
"""


def test_straps_are_told_as_the_units_of_a_daisy_chain_read_them() -> None:
    with controlled(parse(CHAIN, "chain.toml")) as chain:
        pins: Any = chain.call("pins", {})["pins"]
    assert [pins[unit]["PARTY"]["level"] for unit in ("first", "last")] == [0, 0], "each link is a line of its own"


def test_an_output_of_which_nobody_is_told_has_no_level() -> None:
    with controlled(single("bs0610")) as board:
        pins: Any = board.call("pins", {})["pins"]["bs0610"]
    assert (pins["XWA1"]["level"], pins["RDY"]["level"]) == (None, 1)


def test_what_waits_on_a_line_has_a_bound_and_can_be_dropped(cell: Control) -> None:
    """9600 baud, 10 bits and a stop bit: 60 000 characters would take a minute and more."""
    cell.call("pause", {})
    with pytest.raises(AskedWrongly, match=r"0\.0 s of characters wait on line slide, and these would be 60000 more"):
        cell.call("send", {"line": "slide", "data": "x" * 60_000})
    cell.call("send", {"line": "slide", "data": "x" * 30_000})
    for verb, given in (
        ("send", {"line": "slide", "data": "x" * 30_000}),
        ("type", {"unit": "slide", "text": "x" * 30_000}),
    ):
        with pytest.raises(AskedWrongly, match=r"at most 60 s of them wait: send fewer, or drop them \(clear\)"):
            cell.call(verb, given)
    cell.call("step", {"time": "3 ms"})
    cell.call("clear", {"line": "slide"})
    cell.call("type", {"unit": "slide", "text": "V1"})
    cell.call("step", {"time": "1 s"})
    journal: Any = cell.call("journal", {})["journal"]
    assert [entry["deed"] for entry in journal] == ["Send", "Discard", "Send"]
    state: Any = cell.call("state", {})
    assert state["lines"]["slide"]["received"] == 3 + 3, "what had begun when the rest was dropped, and V1 CR"


def test_what_is_typed_is_never_another_character_on_the_line(cell: Control) -> None:
    with pytest.raises(AskedWrongly, match=r"'\u20ac' is on no line of these units; write ASCII, or bytes with send"):
        cell.call("type", {"unit": "slide", "text": "V1\u20ac"})
    assert cell.call("journal", {})["journal"] == []


def test_a_wait_in_the_midst_of_a_step_is_met_in_its_instant_and_may_end_it(cell: Control) -> None:
    began = cell.call("pause", {})["time_ns"]
    assert isinstance(began, int)
    cell.call("type", {"unit": "slide", "text": "+100"})
    reached = cell.ask("wait", {"unit": "slide", "state": "running", "pause": True})
    told = cell.call("step", {"time": "10 s"})
    assert told["reached"] is False
    assert reached.result(60)["time_ns"] == told["time_ns"]
