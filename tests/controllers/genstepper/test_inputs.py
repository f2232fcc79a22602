"""Limit switches, slew keys, NXT, RST and the logic supply (manual, pages 19 to 21, 30, 34, 60, 66)."""

import pytest
from tests.controllers.genstepper.boards import Board

from detent.axis import MotionStarted
from detent.ticks import MS, SECOND

LIMITS = (("LY-", "Y", "-", 1), ("LY+", "Y", "+", 2), ("LX-", "X", "-", 4), ("LX+", "X", "+", 8))


def latches(board: Board) -> str:
    return board.say("L").strip("\r\n*")


@pytest.mark.parametrize(("pin", "axis", "sign", "bit"), LIMITS)
def test_page_30_a_limit_stops_what_moves_towards_it_through_the_ramp_and_is_latched(pin, axis, sign, bit):
    board = Board()
    assert latches(board) == "L,16", "a reset has occurred"
    assert latches(board) == "L,0", "forgotten once it is told"
    board.say(f"{axis}{sign}S", 300 * MS)
    board.pin(pin, 0)
    assert board.report(-8, axis) == 8, "until the next tick"
    assert board.report(-8, axis) == 5
    board.run(SECOND)
    assert board.idle(axis)
    assert latches(board) == f"L,{bit}"
    there = board.position(axis)
    board.say(f"{axis}{sign}S")
    assert board.idle(axis), "no step"
    assert board.position(axis) == there
    assert latches(board) == f"L,{bit}", "but latched"
    board.say(f"{axis}{'+' if sign == '-' else '-'}S", 100 * MS)
    assert not board.idle(axis), "the other way is free"
    assert latches(board) == "L,0"


def test_a_soft_stop_takes_the_ramp_of_z_and_a_hard_one_none():
    for hard in ("no", "yes"):
        board = Board(hard_stop=hard)
        board.say("X+S", 300 * MS)
        begun, before = board.cell.now, board.position()
        board.pin("LX+", 0)
        ended = board.until_idle()
        if hard == "yes":
            assert (ended, board.position()) == (begun, before)
        else:
            assert ended - begun > 80 * MS
            assert board.position() > before + 30


def test_a_limit_is_nothing_to_a_motor_at_rest_or_on_its_way_from_it():
    board = Board()
    latches(board)
    board.pin("LX+", 0)
    assert latches(board) == "L,0"
    board.say("X-100G", SECOND)
    assert board.position() == -100
    assert latches(board) == "L,0"
    board.say("0G", SECOND)
    assert (board.position(), latches(board)) == (-100, "L,8")


def test_a_limit_that_opens_again_does_not_undo_the_stop():
    board = Board()
    board.say("X5000G", 300 * MS)
    board.pin("LX+", 0)
    board.pin("LX+", 1)
    board.run(SECOND)
    assert board.idle()
    assert board.position() < 5000


@pytest.mark.parametrize(("pin", "axis", "sign", "bit"), LIMITS)
def test_page_34_t_blocks_a_limit_or_turns_its_sense(pin, axis, sign, bit):
    board = Board()
    board.say(f"{bit}T")
    board.pin(pin, 0)
    board.say(f"{axis}{sign}S", 100 * MS)
    assert not board.idle(axis)
    board.say(f"{axis}Z", SECOND)
    board.say(f"{bit * 16}T{axis}{sign}S", 100 * MS)
    assert not board.idle(axis), "a low means operate"
    board.pin(pin, 1)
    board.run(SECOND)
    assert board.idle(axis), "and a high means limit reached"


def test_page_34_unblocking_a_limit_that_is_active_stops_the_motor():
    board = Board()
    board.say("8TX+S")
    board.pin("LX+", 0)
    board.say("0T", SECOND)
    assert board.idle()


def test_a_stop_for_a_new_go_that_meets_a_limit_is_the_end_of_it():
    board = Board()
    board.say("X2000G", 300 * MS)
    board.say("4000G")
    board.pin("LX+", 0)
    board.run(SECOND)
    assert board.idle()
    assert board.position() < 2000


@pytest.mark.parametrize("axis", ["X", "Y"])
@pytest.mark.parametrize("sign", ["-", "+"])
def test_page_21_a_slew_key_slews_as_long_as_it_is_held(axis, sign):
    board = Board()
    board.pin(f"{axis}{sign}", 0)
    assert board.report(-8, axis) == 4
    board.run(500 * MS)
    assert board.report(-2, axis) == 800
    board.pin(f"{axis}{sign}", 1)
    assert board.report(-8, axis) == 5
    board.run(SECOND)
    assert board.idle(axis)
    assert (board.position(axis) > 0) == (sign == "+")


def test_page_21_both_keys_of_a_pair_stop():
    board = Board()
    board.pin("X+", 0)
    board.run(500 * MS)
    board.pin("X-", 0)
    board.run(SECOND)
    assert board.idle()
    board.pin("X+", 1)
    board.run(10 * MS)
    assert {d for _, d in board.pulses()[-1:]} == {-1} or not board.idle(), "the other one is left"


def test_page_22_a_key_turns_a_go_into_a_slew():
    board = Board()
    board.say("X2000G", 300 * MS)
    board.pin("X+", 0)
    assert board.report(-8) == 4
    board.run(5 * SECOND)
    assert board.position() > 2000
    board = Board()
    board.say("X2000G", 300 * MS)
    board.pin("X-", 0)
    assert board.report(-8) == 6


def test_page_13_noslew_leaves_four_inputs():
    board = Board(slew_inputs="no")
    board.pin("X+", 0)
    assert board.idle()
    assert board.report(6) == 255 - 8


def test_page_21_nxt_steps_through_the_standard_rates_of_both_motors_and_wraps():
    board = Board()
    rates = []
    for _ in range(12):
        board.pin("NXT", 0)
        board.pin("NXT", 1)
        rates.append((board.report(-10, "X"), board.report(-10, "Y")))
    expected = [1600, 4000, 8000, 16, 40, 80, 160, 400, 800, 1600, 4000, 8000]
    assert rates == [(rate, rate) for rate in expected]


def test_a_serial_rate_does_not_move_the_place_of_nxt_and_a_key_held_follows_it():
    board = Board()
    board.pin("X+", 0)
    board.say("B77R")
    board.pin("NXT", 0)
    board.run(SECOND)
    assert board.report(-2) == 1600


@pytest.mark.parametrize("pin", ["RST", "VC"])
def test_pages_60_and_66_reset_low_or_a_low_logic_supply_resets_at_once(pin):
    board = Board()
    board.say("X300R10000G", 300 * MS)
    board.pin(pin, 0)
    assert board.idle()
    assert board.status().state == "held"
    steps = board.status().pulses
    board.run(SECOND)
    assert board.heard() == ""
    board.pin(pin, 1)
    board.run(200 * MS)
    assert board.status().state == "starting"
    board.run(100 * MS)
    assert board.heard() == board.greeting
    assert (board.position(), board.status().pulses, board.report(-10)) == (0, steps, 800)
    assert latches(board) == "L,16"


def test_power_off_loses_everything_and_the_pins_let_go():
    board = Board()
    board.say("X300R10000G", 300 * MS)
    board.cell.power("board", False)
    assert board.status().state == "off"
    assert board.unit._driver.levels == {}
    assert board.say("-1?") == ""
    board.cell.power("board", True)
    board.run(300 * MS)
    assert board.heard() == board.greeting
    assert board.report(-10) == 800
    assert len(board.entries(MotionStarted)) == 1


def test_a_key_held_at_power_on_slews_when_the_board_wakes():
    board = Board()
    board.pin("X+", 0)
    board.say("!", 100 * MS)
    assert board.idle()
    board.run(300 * MS)
    assert not board.idle()
