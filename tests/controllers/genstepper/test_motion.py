"""Motion of a board, exact on the tick, whatever is said to it on the way (manual, pages 22, 27, 31 to 33, 36, 38)."""

import copy
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.controllers.genstepper.boards import Board
from tests.controllers.genstepper.firmware_loop import TICK, LoopMotor
from tests.generated import examples

from detent.axis import MotionEnded, MotionStarted
from detent.ticks import MS, SECOND

small = st.integers(-60, 60)
orders = st.one_of(
    st.tuples(st.just("G"), small),
    st.tuples(st.just("S"), st.one_of(small, st.just("+"), st.just("-"))),
    st.tuples(st.just("Z"), st.just("")),
    st.tuples(st.just("R"), st.sampled_from((30, 200, 800, 2000, 62_500))),
    st.tuples(st.just("P"), st.sampled_from((900, 5000, 20_000, 62_500))),
    st.tuples(st.just("K"), st.sampled_from((20, 80, 500))),
    st.tuples(st.just("="), small),
    st.tuples(st.sampled_from(("LX+", "LX-")), st.sampled_from((0, 0, 1))),
    st.tuples(st.just("key"), st.sampled_from((None, None, 1, -1, 0))),
)


def do(board: Board, loop: LoopMotor, letter: str, value: object) -> None:
    """One thing reaches the board and the loop."""
    if letter == "key":
        for pin, ways in (("X+", (1, 0)), ("X-", (-1, 0))):
            board.pin(pin, 0 if value in ways else 1)
            held = {pin for pin in ("X+", "X-") if board.unit._inputs[pin] == 0}
            loop.press((("X+" in held) - ("X-" in held)) if held else None)
    elif letter in ("LX+", "LX-"):
        board.pin(letter, value)
        loop.limit(1 if letter == "LX+" else -1, value == 0)
    else:
        board.send(f"{value}{letter}")
        obey(loop, letter, value)
    loop.look_at_key()


def obey(loop: LoopMotor, letter: str, value: object) -> None:
    match letter, value:
        case "G", int():
            loop.go(value)
        case "S", int():
            loop.go_relative(value)
        case "S", _ if loop.key is None:
            loop.slew(1 if value == "+" else -1)
        case "Z", _:
            loop.stop()
        case "R", int():
            loop.rate = value
        case "P", int():
            loop.slope = value
        case "K", int():
            loop.set_keep(value)
        case "=", int():
            loop.set_position(value)


stories = st.lists(st.tuples(orders, st.integers(1, 120_000_000)), min_size=1, max_size=8)


@settings(max_examples=examples(60), deadline=None)
@given(stories)
def test_whatever_comes_in_motion_gives_the_steps_of_the_tick_by_tick_loop(story):
    check_against_the_loop(story)


@pytest.mark.slow
@settings(max_examples=2_000, deadline=None)
@given(stories)
def test_whatever_comes_in_motion_gives_the_steps_of_the_tick_by_tick_loop_many_times(story):
    check_against_the_loop(story)


def check_against_the_loop(story):
    board = BOARD.copy()
    loop = LoopMotor(0)
    board.send("X")
    board.run(1 * MS)
    for (letter, value), wait in story:
        loop.run_to(board.cell.now)
        do(board, loop, letter, value)
        board.cell.run_to(board.cell.now + wait)
    board.cell.run_to(board.cell.now + 150 * MS)
    loop.run_to(board.cell.now)
    assert board.pulses() == loop.steps
    assert board.position() == loop.position
    assert board.idle() == (loop.state == "idle")
    if loop.state != "idle":
        assert board.unit._motors["X"]._point(board.cell.now)[1:] == (loop.travel, loop.speed)


class _Prepared(Board):
    def copy(self) -> "_Prepared":
        twin = copy.copy(self)
        twin.cell = self.cell.copy()
        twin.unit, twin.line = twin.cell.controller("board"), twin.cell.lines[0]
        return twin


BOARD = _Prepared()


def test_page_20_the_extreme_move_costs_a_handful_of_segments():
    board = Board()
    board.say("X1P1K62500R")
    board.send("2147483647G")
    board.until_idle(10**6 * SECOND)
    (started,) = board.motions()
    assert len(started.train.segments) <= 4
    assert board.position() == 2_147_483_647
    assert len(board.entries(MotionStarted)) == len(board.entries(MotionEnded)) == 1


def test_page_20_stopping_from_62500_at_a_slope_of_1_takes_62500_seconds_and_1953125000_microsteps():
    board = Board()
    board.say("X1K62500P62500R-2147483647=+S", 2 * SECOND)
    assert board.report(-2) == 62_500
    board.say("1P")
    position = board.position()
    begun = board.cell.now
    board.say("Z")
    ended = board.until_idle(10**6 * SECOND)
    assert abs(ended - begun - 62_499 * SECOND) < TICK
    assert abs(board.position() - position - 1_953_125_000) < 2_000
    assert len(board.motions()) < 8


def test_page_31_the_worked_example_of_the_ramps():
    board = Board()
    board.say("X1K250P500R")
    begun = board.cell.now
    board.send("2000G")
    ended = board.until_idle()
    assert 5.98 * SECOND < ended - begun < 6.02 * SECOND, "2 + 2 + 2 seconds"
    assert board.position() == 2000


def test_two_motors_move_at_once_each_at_its_own_rate():
    board = Board()
    board.say("X250RY1000RB0G")
    board.say("XG")
    board.say("X1000GY-2000G")
    board.until_idle()
    assert (board.position("X"), board.position("Y")) == (1000, -2000)
    assert board.pulses("X")[-1][0] > board.pulses("Y")[-1][0]


def test_page_33_a_relative_move_counts_from_the_target_of_a_running_go():
    board = Board()
    board.say("X1000=2000G", 100 * MS)
    board.say("-500S")
    assert board.report(-8) == 7
    board.until_idle()
    assert board.position() == 1500


def test_page_33_a_relative_move_counts_from_the_present_place_in_a_slew_and_after_z():
    board = Board()
    board.say("X1000=+S", 100 * MS)
    here = board.position()
    board.send("-500S")
    board.run(1100 * 1000)
    assert abs(board.report(-4) - (here - 500)) <= 1
    board = Board()
    board.say("X5000G", 200 * MS)
    board.send("Z-500S")
    here = board.position()
    board.until_idle()
    assert abs(board.position() - (here - 500)) <= 1


def test_page_38_set_position_then_go_back_to_it():
    board = Board()
    board.say("X+S", 200 * MS)
    board.send("2000=G")
    ended = board.until_idle()
    assert board.position() == 2000
    assert ended > 0
    assert {direction for _, direction in board.pulses()} == {1, -1}, "it ran on while it stopped"


def test_page_32_a_rate_counts_at_once_in_a_slew_and_after_a_go():
    board = Board()
    board.say("X+S", 500 * MS)
    board.say("1600R", 500 * MS)
    assert board.report(-2) == 1600
    board.say("Z", SECOND)
    board.say("=10000G", 500 * MS)
    board.say("300R", 500 * MS)
    assert board.report(-2) == 1600
    board.until_idle()
    board.say("0G", 500 * MS)
    assert board.report(-2) == 300


@pytest.mark.parametrize(("slope", "sudden"), [(1000, True), (60_000, False)])
def test_page_31_a_slope_changed_during_a_go_makes_the_stop_too_sudden_or_too_slow(slope, sudden):
    board = Board()
    board.say("X2000R2000G", 700 * MS)
    assert board.report(-8) == 2
    board.say(f"{slope}P")
    board.until_idle()
    assert board.position() == 2000, "it stops at the target all the same"
    (_, _), *_, (before, _), (last, _) = board.pulses()
    rate = SECOND / (last - before)
    assert (rate > 500) == sudden
    assert sudden or rate < 90


def test_page_29_62500k_prevents_all_ramps():
    board = Board()
    board.say("X62500K5000R")
    board.send("100G")
    board.until_idle()
    times = [at for at, _ in board.pulses()]
    assert {later - before for before, later in pairwise(times)} == {12 * TICK, 13 * TICK}


def test_the_numbers_of_the_step_action_in_order():
    board = Board()
    board.say("X2000R2000G")
    seen = []
    while not board.idle():
        action = board.unit._motors["X"].step_action(board.cell.now)
        if action not in seen:
            seen.append(action)
        board.run(1 * MS)
    assert seen == [1, 2, 3]
    board.say("+S", 100 * MS)
    assert board.report(-8) == 4
    board.say("-S")
    assert board.report(-8) == 6
    board.say("Z")
    assert board.report(-8) == 5
    board.run(SECOND)
    assert board.report(-8) == 0


def test_a_slew_ends_at_the_end_of_the_range_of_positions():
    board = Board()
    board.say("X2147483600=+S", SECOND)
    assert board.position() == 2_147_483_647
    assert board.idle()
    board.say("+S")
    assert board.idle()
    board.say("100S", SECOND)
    assert board.position() == 2_147_483_647
    board.say("-S", 100 * MS)
    assert board.position() < 2_147_483_647


def test_mark_remembers_a_place_for_each_motor():
    board = Board()
    board.say("X100=Y200=B0M")
    board.say("B1000G", 3 * SECOND)
    board.say("1M", 3 * SECOND)
    assert (board.position("X"), board.position("Y")) == (100, 200)
    board.say("2M7M-1M")
    assert board.idle("X")


def test_ready_is_low_exactly_while_a_motor_moves():
    board = Board()
    assert board.level("RDY") == 1
    board.send("X10G")
    board.run(1)
    assert board.level("RDY") == 0
    ended = board.until_idle()
    assert board.level("RDY") == 1
    assert board.pulses()[-1][0] == ended
