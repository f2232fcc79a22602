"""A cell with its past is at any time what it was then, and goes on from there exactly as it did."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.cell.cells import cell
from tests.cell.test_copies import ACTIONS, DESCRIPTION, FILES
from tests.generated import examples

from detent.cell.actions import Action, Load, PlaceSwitch, Power, Release, Send, SetPin, SetSwitch, Start, Type
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.history import Broken, History
from detent.cell.moments import Cut
from detent.cell.recording import Batch
from detent.cell.stores import Stores
from detent.pins import PinSet
from detent.ticks import MS, SECOND, Ns

EXAMPLES = Path(__file__).parents[2] / "examples"
SETTINGS = settings(max_examples=examples(25), deadline=None, suppress_health_check=list(HealthCheck))
LOOPING = 'title = "t"\n[units.a]\nmodel = "gs-c200"\nprogram = "a.gsc"\nstraps = { CHS = 0 }\n'
LOOP = {"a.gsc": "S50\nL0\nA1\n+20\nC1\nD1\nL3\n"}  # addresses 0 4 6 8 12 14 16


def example(name: str) -> Cell:
    path = EXAMPLES / name / "cell.toml"
    return build(parse(path.read_text(), str(path)), lambda file: (path.parent / file).read_text())


def action(what: str, where: object, value: object) -> Action:
    match what:
        case "type":
            return Type(str(where), str(value))
        case "set_switch":
            return SetSwitch(str(where), int(value))  # type: ignore[call-overload]
        case "set_pin":
            return SetPin(str(where), "UI1", int(value))  # type: ignore[call-overload]
        case "power":
            return Power(str(where), bool(value))
        case _:
            return Send(int(where), bytes(value))  # type: ignore[call-overload]


class Mirror:
    """Somebody who keeps what happened, as it is told."""

    def __init__(self, history: History) -> None:
        self.history = history
        self.batches: list[Batch] = []
        self.actions = 0

    def update(self) -> list[Batch]:
        cut, first, batches, actions = self.history.news()
        if cut is not None:
            del self.batches[cut.batches :]
            self.actions = cut.actions
        assert first == len(self.batches)
        self.batches += batches
        self.actions += len(actions)
        return self.batches


def look(history: History) -> list[object]:
    """Everything that can be seen of the cell where it stands."""
    cell = history.cell
    states = [unit.status(cell.now) for unit in cell.controllers().values()]
    registers = [unit.registers(cell.now) for unit in cell.controllers().values()]
    fronts = [(f.levels, f.executing, f.refused, f.powered, f.stored) for f in history.panel.fronts]
    travels = [t.at(cell.now) for f in history.panel.fronts for t in f.travels.values()]
    return [cell.now, cell.next_event(), states, registers, repr(fronts), travels, [s.level for s in _switches(cell)]]


def _switches(cell: Cell) -> list:
    return [part for part in cell.parts[cell.wiring.units :] if hasattr(part, "level")]


def with_actions(actions: list, line_timing: bool, **options: int) -> History:
    history = History(cell(DESCRIPTION, FILES, line_timing=line_timing), Stores(), **options)
    for gap, (what, where, value) in actions:
        history.run_to(history.now + gap)
        history.do(action(what, where, value))
    history.run_to(history.now + 200 * MS)
    return history


@SETTINGS
@given(ACTIONS, st.lists(st.integers(0, 800 * MS), min_size=1, max_size=6), st.booleans())
def test_it_is_at_any_time_what_it_was_then(actions: list, times: list[Ns], line_timing: bool) -> None:
    history = with_actions(actions, line_timing)
    mirror = Mirror(history)
    told = list(mirror.update())
    for at in times:
        straight = History(cell(DESCRIPTION, FILES, line_timing=line_timing))
        for gap, (what, where, value) in actions:
            if straight.now + gap > at:
                break
            straight.run_to(straight.now + gap)
            straight.do(action(what, where, value))
        straight.run_to(min(at, history.end))
        history.rewind(at)
        assert look(history) == look(straight)
    assert mirror.update() == told  # looking changes nothing


@SETTINGS
@given(ACTIONS, ACTIONS, st.integers(0, 800 * MS), st.booleans())
def test_going_on_from_the_past_is_as_if_the_rest_had_never_been(
    before: list, after: list, at: Ns, line_timing: bool
) -> None:
    history = with_actions(before, line_timing)
    mirror = Mirror(history)
    mirror.update()
    history.rewind(at)
    history.go()
    straight = History(cell(DESCRIPTION, FILES, line_timing=line_timing))
    for gap, (what, where, value) in before:
        if straight.now + gap > history.now:
            break
        straight.run_to(straight.now + gap)
        straight.do(action(what, where, value))
    straight.run_to(history.now)
    for each in (history, straight):
        for gap, (what, where, value) in after:
            each.run_to(each.now + gap)
            each.do(action(what, where, value))
        each.run_to(each.now + 200 * MS)
    assert look(history) == look(straight)
    other = Mirror(straight)
    assert mirror.update() == other.update()
    assert mirror.actions == other.actions


@pytest.mark.parametrize("name", sorted(path.parent.name for path in EXAMPLES.glob("*/cell.toml")))
def test_every_example_does_the_same_again_entry_by_entry(name: str) -> None:
    history = History(example(name), keep=10_000_000)
    if name == "closed-loop-motor":  # the rotor is computed in between
        history.run_to(30 * MS)
    else:
        history.run_to(5 * SECOND)
    mirror = Mirror(history)
    whole, end = list(mirror.update()), history.end
    for part in (3, 8, 5):
        history.rewind(end * part // 10)
        history.go()
        history.run_to(end)
        assert mirror.update() == whole


def test_what_was_not_told_yet_is_not_told_twice() -> None:
    history = History(example("drilling"))
    mirror = Mirror(history)
    history.run_to(1 * SECOND)
    mirror.update()
    history.run_to(2 * SECOND)  # nobody is told
    history.rewind(1_500 * MS)
    history.go()
    history.rewind(500 * MS)
    history.go()
    history.run_to(3 * SECOND)
    other = History(example("drilling"))
    other.run_to(3 * SECOND)
    assert mirror.update() == Mirror(other).update()


def test_looking_back_keeps_the_present_and_an_action_in_the_past_drops_it() -> None:
    history = History(example("drilling"))
    history.run_to(3 * SECOND)
    history.stop("by hand")
    history.rewind(1 * SECOND)
    assert (history.past, history.now, history.end) == (True, 1 * SECOND, 3 * SECOND)
    history.rewind(9 * SECOND)
    assert (history.past, history.now, history.end) == (False, 3 * SECOND, 3 * SECOND)
    history.rewind(1 * SECOND)
    history.do(SetSwitch("stop", 0))
    assert (history.past, history.now, history.end) == (False, 1 * SECOND, 1 * SECOND)


def test_what_hosts_and_hands_did_happens_again_on_the_way() -> None:
    history = History(cell(LOOPING, LOOP, line_timing=True))
    history.run_to(100 * MS)
    history.do(Type("a", "F"))
    history.run_to(200 * MS)
    history.do(SetPin("a", "UI2", 0))
    history.run_to(400 * MS)
    history.rewind(150 * MS)
    assert history.panel.fronts[0].levels["UI2"] == 1
    history.rewind(250 * MS)
    assert history.panel.fronts[0].levels["UI2"] == 0
    assert history.cell.forced == {(0, "UI2"): 0}
    history.do(Release("a", "UI2"))
    assert history.panel.fronts[0].levels["UI2"] == 1
    assert history.cell.forced == {}


def test_a_host_hears_nothing_twice_and_nothing_too_little() -> None:
    history = History(cell(LOOPING, LOOP, line_timing=True))
    heard = bytearray()

    def listen() -> None:
        for line in history.lines:
            heard.extend(char.value for _, char in line.take())

    history.do(Type("a", "F"))
    history.run_to(50 * MS)  # answered, and not yet heard
    history.rewind(49 * MS)
    history.rewind(0)
    history.rewind(50 * MS)
    listen()
    assert heard == b"B\r"
    history.rewind(40 * MS)
    history.go()
    history.run_to(60 * MS)
    listen()
    assert heard == b"B\r"


def test_bytes_of_a_host_that_come_while_one_looks_back_wait_for_the_cell() -> None:
    history = History(cell(LOOPING, LOOP))
    history.run_to(50 * MS)
    history.stop("by hand")
    history.rewind(10 * MS)
    assert all(line.host_busy_until > SECOND * 1000 for line in history.lines)
    history.send(0, b"F\r")
    assert history.past
    history.go()
    history.run_to(11 * MS)
    assert [char.value for _, char in history.lines[0].take()] == list(b"B\r")


def test_memories_are_not_written_again_by_a_past_that_is_gone_through_again() -> None:
    written: list[tuple[str, bytes]] = []
    stores = Stores(lambda unit, image: written.append((unit, image)) is None)
    history = History(cell(LOOPING, LOOP, store=stores.save), stores)
    program = history.cell.controller("a").program_memory()
    history.run_to(1 * SECOND)
    history.do(Type("a", "M"))
    history.run_to(2 * SECOND)
    assert written == [("a", program)]
    history.rewind(1_500 * MS)
    assert history.panel.fronts[0].stored == 1
    history.rewind(2 * SECOND)
    assert written == [("a", program)]
    history.rewind(500 * MS)
    history.go()  # from before it was written: outside it is as it was then
    assert written == [("a", program), ("a", b"")]
    assert history.cell.controller("a").kept_memory() == b""
    history.do(Type("a", "M"))
    assert written == [("a", program), ("a", b""), ("a", program)]


def test_a_write_that_failed_fails_again() -> None:
    works = [False]
    stores = Stores(lambda unit, image: works[0])
    history = History(cell(LOOPING, LOOP, store=stores.save), stores)
    history.run_to(1 * SECOND)
    history.do(Type("a", "M"))
    works[0] = True
    history.run_to(2 * SECOND)
    before = look(history)
    history.rewind(1_500 * MS)
    assert history.cell.controller("a").kept_memory() == b""
    history.rewind(2 * SECOND)
    assert look(history) == before


class TestStops:
    def history(self) -> History:
        return History(cell(LOOPING, LOOP))

    def test_it_stops_at_the_instant_at_which_the_program_has_come_to_an_address(self) -> None:
        history = self.history()
        history.breakpoints = {(0, 12)}
        history.run_to(10 * SECOND)
        executing = history.panel.fronts[0].executing
        assert executing is not None
        assert (executing.address, executing.at) == (12, history.now)
        assert history.stopped == "a has come to C1 at 12"
        assert history.next_event() is None
        history.run_to(20 * SECOND)
        assert history.now == executing.at
        history.go()
        history.run_to(20 * SECOND)
        again = history.panel.fronts[0].executing
        assert again is not None
        assert again.address == 12
        assert again.at == history.now > executing.at

    def test_it_stops_once_at_the_cursor(self) -> None:
        history = self.history()
        history.once = (0, 14)
        history.run_to(10 * SECOND)
        assert history.stopped == "a has come to D1 at 14"
        history.go()
        history.run_to(10 * SECOND)
        assert history.now == 10 * SECOND

    def test_it_stops_when_a_unit_refuses_something(self) -> None:
        history = self.history()
        history.break_on_errors = True
        history.run_to(10 * MS)
        history.do(Type("a", "Y7"))
        assert history.stopped.startswith("a refused 'Y7': ")
        refused = history.panel.fronts[0].refused
        assert refused is not None
        assert refused.frame == "Y7"
        history.go()
        history.do(Power("a", False))
        assert history.panel.fronts[0].refused is None  # latched until the supply goes

    def test_one_instruction_after_the_other_and_back(self) -> None:
        history = self.history()
        history.stop("by hand")
        seen = []
        for _ in range(9):
            assert history.step_instruction(0) == ""
            executing = history.panel.fronts[0].executing
            assert executing is not None
            seen.append((executing.at, executing.address))
        assert [address for _, address in seen] == [4, 6, 8, 12, 14, 16, 6, 8, 12]
        for at, address in reversed(seen[:-1]):
            assert history.step_back(0)
            executing = history.panel.fronts[0].executing
            assert executing is not None
            assert (history.now, executing.address) == (at, address)
        assert history.past
        assert history.step_instruction(0) == ""  # over the same ground again
        executing = history.panel.fronts[0].executing
        assert executing is not None
        assert (executing.at, executing.address) == seen[1]
        assert history.end == seen[-1][0]

    def test_a_program_that_is_over_gives_no_next_instruction(self) -> None:
        history = self.history()
        history.run_to(10 * SECOND)
        history.stop("by hand")
        assert history.step_instruction(0) == "nothing more happens by itself"
        assert history.now == 10 * SECOND

    def test_one_event_after_the_other_and_back(self) -> None:
        history = self.history()
        history.stop("by hand")
        times = [history.now]
        while history.step():
            times.append(history.now)
        assert not history.step()
        for at in reversed(times[:-1]):
            history.step_back()
            assert history.now == at
        assert not history.step_back()
        for at in times[1:]:
            history.step()
            assert history.now == at
        assert not history.past

    def test_back_from_between_two_events_is_to_the_one_before(self) -> None:
        history = self.history()
        history.step()
        event = history.now
        history.step()
        history.rewind(history.now - 1)
        history.step_back()
        assert history.now == event


def test_far_back_fewer_moments_are_kept_and_the_beginning_is_dropped() -> None:
    history = History(example("menu"), keep=3_000)
    mirror = Mirror(history)
    history.run_to(12 * SECOND)
    assert history.begin > 0
    assert history.first_batch >= len(mirror.update()) - 5_000
    history.rewind(0)
    assert history.now == history.begin
    history.rewind(history.begin + 100 * MS)
    history.go()
    history.run_to(12 * SECOND)
    other = History(example("menu"))
    other.run_to(12 * SECOND)
    assert mirror.update() == Mirror(other).update()


def test_a_loop_without_end_in_one_instant_stops_it_and_one_can_go_back() -> None:
    text = """
        [units.a]
        model = "gs-c200"
        program = "a.gsc"
        [units.b]
        model = "gs-c200"
        [units.d]
        model = "step-detector"
        """
    history = History(cell(text, {"a.gsc": "A1\nC1\nL9\n"}))
    history.run_to(5 * MS)
    history._break(_oscillation())  # as a cell tells it
    assert "go back" in history.stopped
    with pytest.raises(Broken, match="go back"):
        history.go()
    with pytest.raises(Broken, match="go back"):
        history.do(SetPin("a", "UI1", 0))
    history.send(0, b"F\r")  # nobody answers
    history.rewind(3 * MS)
    assert history.broken == ""
    history.go()
    history.run_to(20 * MS)
    assert history.now == 20 * MS


def _oscillation() -> Exception:
    from detent.cell.circuit import Oscillation

    return Oscillation("a.UO1, b.UI1 change each other without end")


def test_a_cell_without_a_recording_has_no_past() -> None:
    with pytest.raises(ValueError, match="record=True"):
        History(cell(LOOPING, LOOP, record=False))


class TestActions:
    def test_a_program_is_put_into_memory_and_started(self) -> None:
        history = History(cell('[units.a]\nmodel = "gs-c200"\n'))
        other = cell(LOOPING, LOOP).controller("a").program_memory()
        history.do(Load("a", other, 0))
        history.do(Start("a"))
        history.run_to(1 * SECOND)
        assert history.cell.controller("a").status(history.now).pulses > 0
        history.rewind(0)
        history.rewind(500 * MS)
        assert history.cell.controller("a").program_memory() == other

    def test_a_strap_counts_from_the_next_power_on_and_the_line_follows_it(self) -> None:
        """Datasheet, "Baud rate": BR0 low, BR1, BR2 low is 9600; BR0 high 4800."""
        history = History(cell(LOOPING, LOOP, line_timing=True))
        history.run_to(1 * MS)
        history.do(SetPin("a", "BR0", 1))
        assert str(history.cell.lines[0].format) == "9600 7O2"
        history.do(Power("a", False))
        history.do(Power("a", True))
        assert str(history.cell.lines[0].format) == "4800 7O2"
        history.do(Type("a", "F"))
        history.run_to(100 * MS)
        assert [char.value for _, char in history.cell.lines[0].take()] == list(b"R\r")

    def test_a_switch_is_put_elsewhere_on_its_axis(self) -> None:
        history = History(
            cell('[units.a]\nmodel = "gs-c200"\nprogram = "a.gsc"\n'
                 '[switches.end]\ndrives = "a.EOT"\naxis = "a"\nfrom = 500\n', {"a.gsc": "S50\n+400\n"})
        )  # fmt: skip
        history.run_to(100 * MS)
        level = history.panel.fronts[0].levels
        assert level["EOT"] == 1
        history.do(PlaceSwitch("end", 10, None))  # the axis is there already
        assert history.panel.fronts[0].levels["EOT"] == 0
        history.do(PlaceSwitch("end", 300, None))
        assert history.panel.fronts[0].levels["EOT"] == 1
        history.run_to(2 * SECOND)
        assert history.panel.fronts[0].levels["EOT"] == 0
        spans = history.cell.controller("a").status(history.now)
        assert spans.position == 400
        with pytest.raises(ValueError, match="whole steps"):
            history.do(PlaceSwitch("end", 10.5, None))
        for nowhere in (float("inf"), float("-inf"), float("nan")):
            with pytest.raises(ValueError, match="whole steps"):
                history.do(PlaceSwitch("end", nowhere, None))
        with pytest.raises(ValueError, match="before it begins"):
            history.do(PlaceSwitch("end", 10, 5))
        with pytest.raises(KeyError):
            history.do(PlaceSwitch("nowhere", 10, 15))

    def test_a_switch_on_a_rotor_is_put_elsewhere_in_distances_of_its_motor(self) -> None:
        history = History(
            cell('[units.a]\nmodel = "gs-c200"\n[motors.slide]\nmotor = "qsh4218-41-10-035"\nunit = "a"\n'
                 'supply = 24\nlead = 0.5\n[switches.end]\ndrives = "a.EOT"\naxis = "slide"\nfrom = 4\nto = 9\n')
        )  # fmt: skip
        assert history.panel.fronts[0].levels["EOT"] == 1
        history.do(PlaceSwitch("end", -1, 2))  # the rotor stands at 0
        assert history.panel.fronts[0].levels["EOT"] == 0
        contact = history.cell.parts[-1].contacts[0]  # type: ignore[attr-defined]
        assert (contact.low, contact.high, contact.range) == (-2, 4, (-1, 2))
        history.do(PlaceSwitch("end", None, -1))
        assert history.panel.fronts[0].levels["EOT"] == 1
        with pytest.raises(ValueError, match="has no width"):
            history.do(PlaceSwitch("end", 3, 3))
        assert history.panel.fronts[0].levels["EOT"] == 1


def test_the_cut_that_is_told_is_the_earliest_of_all() -> None:
    history = History(example("drilling"))
    history.run_to(2 * SECOND)
    history.news()
    history.rewind(1 * SECOND)
    history.go()
    history.run_to(1_500 * MS)
    history.rewind(1_400 * MS)
    history.go()
    cut = history.news().cut
    assert cut is not None
    assert cut.at == 1 * SECOND
    assert isinstance(cut, Cut)


def test_levels_on_the_panel_are_those_of_the_recording() -> None:
    history = History(example("drilling"))
    history.run_to(4 * SECOND)
    batches = Mirror(history).update()
    last = {(unit, e.pin): e.level for unit, entries in batches for e in entries if isinstance(e, PinSet)}
    for (unit, pin), level in last.items():
        assert history.panel.fronts[unit].levels[pin] == level
