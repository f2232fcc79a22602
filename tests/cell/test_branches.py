"""A future that was left is kept: it can be compared with what happened instead, and taken again, entry by entry."""

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from tests.cell.cells import cell
from tests.cell.test_copies import ACTIONS, DESCRIPTION, FILES
from tests.cell.test_history import SETTINGS, Mirror, action, example, look

from detent.cell.actions import Break, SetPin, SetSwitch, Type
from detent.cell.faults import StuckSwitch
from detent.cell.history import MOST_BRANCHES, History
from detent.cell.stores import Stores
from detent.ticks import MS, SECOND


@settings(SETTINGS, phases=[Phase.generate])
@given(ACTIONS, ACTIONS, st.integers(1, 9))
def test_a_future_that_is_taken_again_is_the_same_entry_by_entry(first: list, other: list, part: int) -> None:
    history = History(cell(DESCRIPTION, FILES))
    mirror = Mirror(history)

    def play(actions: list) -> None:
        for gap, (what, where, value) in actions:
            history.run_to(history.now + gap)
            history.do(action(what, where, value))

    play(first)
    history.run_to(history.now + 300 * MS)
    was, seen, end = list(mirror.update()), look(history), history.now
    history.rewind(history.now * part // 10)
    left_at = history.now
    history.go()
    mirror.update()
    play(other)
    history.run_to(history.now + 100 * MS)
    here, here_end = look(history), history.now
    mirror.update()
    if left_at == end:
        return
    (branch,) = history.branches
    assert (branch.at, branch.end) == (left_at, end)
    there, same = history.both(branch.number)
    assert there.now == same.now == min(end, here_end)
    assert look(history) == here  # to compare changes nothing
    history.follow(history.leave_for(branch.number))
    assert history.now == end
    assert look(history) == seen
    assert mirror.update() == was
    (other_branch,) = history.branches  # and what was left for it is kept in its place
    history.follow(history.leave_for(other_branch.number))
    assert look(history) == here


def test_looking_back_and_returning_makes_no_future() -> None:
    history = History(example("drilling"))
    history.run_to(SECOND)
    history.rewind(SECOND // 2)
    history.rewind(history.end)
    history.go()
    assert not history.branches
    with pytest.raises(KeyError, match="no other future 1"):
        history.branch(1)


def test_a_fault_that_was_set_then_is_set_again_and_a_breakpoint_does_not_stop_it() -> None:
    history = History(example("drilling"))
    history.break_on_errors = True
    history.run_to(SECOND // 2)
    history.do(Break(StuckSwitch("start", 0)))
    history.run_to(2 * SECOND)
    history.rewind(SECOND // 4)
    history.do(SetSwitch("stop", 0))
    history.run_to(3 * SECOND)
    assert not history.cell.faults.standing
    history.follow(history.leave_for(1))
    assert history.now == 2 * SECOND
    assert list(history.cell.faults.standing) == [1]
    assert history.break_on_errors


def test_only_the_newest_futures_are_kept() -> None:
    history = History(example("drilling"))
    history.run_to(SECOND)
    for n in range(MOST_BRANCHES + 5):
        history.rewind(history.now - 10 * MS)
        history.do(SetPin("bar", "EOT", n & 1))
        history.run_to(history.now + 11 * MS)
    assert len(history.branches) == MOST_BRANCHES


def test_a_future_left_on_the_way_to_another_is_taken_again_whole() -> None:
    history = History(example("drilling"))
    history.run_to(SECOND)
    history.do(SetSwitch("stop", 0))
    history.run_to(2 * SECOND)
    first = look(history)
    history.rewind(3 * SECOND // 2)  # behind the action
    history.do(SetSwitch("stop", 1))
    history.run_to(3 * SECOND)
    history.rewind(SECOND // 2)  # before it: the way to both futures is left too
    history.do(SetSwitch("start", 0))
    history.run_to(2 * SECOND)
    history.follow(history.leave_for(1))
    assert history.now == 2 * SECOND
    assert look(history) == first


def test_to_compare_writes_no_memory() -> None:
    written: list[str] = []
    stores = Stores(lambda unit, image: not written.append(unit))
    history = History(cell(DESCRIPTION, FILES, store=stores.save), stores)
    history.run_to(50 * MS)
    history.do(Type("one", "E"))
    history.do(Type("one", "Q"))
    history.run_to(800 * MS)
    before = len(written)
    history.rewind(10 * MS)
    history.go()
    history.run_to(900 * MS)
    after = len(written)
    history.both(1)
    assert len(written) == after
    assert before <= after
