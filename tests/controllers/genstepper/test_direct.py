"""E mode: steps by pulses (manual, pages 25, 26, 46, 47)."""

from itertools import pairwise

import pytest
from tests.controllers.genstepper.boards import Board

from detent.ticks import MS, SECOND, US

W = 8 * US


def pulse(board: Board, pin: str, low: int = W, high: int = W, active: int = 0) -> None:
    board.pin(pin, active)
    board.run(low)
    board.pin(pin, 1 - active)
    board.run(high)


@pytest.fixture
def board() -> Board:
    board = Board()
    board.say("1E")
    return board


@pytest.mark.parametrize(("pin", "axis", "step"), [("X+", "X", 1), ("X-", "X", -1), ("Y+", "Y", 1), ("Y-", "Y", -1)])
def test_page_46_each_low_going_edge_is_a_microstep_in_the_direction_of_its_line(board, pin, axis, step):
    for _ in range(5):
        pulse(board, pin)
    assert board.position(axis) == 5 * step
    assert board.status(axis).pulses == 5
    assert board.position("Y" if axis == "X" else "X") == 0
    times = [at for at, _ in board.pulses(axis)]
    assert [b - a for a, b in pairwise(times)] == [16 * US] * 4, "62 500 a second"


def test_page_26_pulses_of_8_us_are_seen_and_shorter_ones_missed(board):
    pulse(board, "X+", low=W - 1)
    assert board.position() == 0
    pulse(board, "X+", low=W)
    assert board.position() == 1
    pulse(board, "X+", low=W, high=W - 1)
    pulse(board, "X+", low=W)
    assert board.position() == 2, "the line was not high for long enough: one of the two is missed"
    pulse(board, "X+", low=SECOND)
    assert board.position() == 3, "there is no upper limit on how wide the pulse may be"


def test_page_47_both_directions_at_the_same_time_are_ignored_but_both_motors_may_step(board):
    board.pin("X+", 0)
    board.pin("X-", 0)
    board.pin("Y+", 0)
    board.run(W)
    assert (board.position("X"), board.position("Y")) == (0, 1)


@pytest.mark.parametrize(("bits", "active", "plus"), [(2, 0, 1), (2 + 32 + 128, 1, 1), (2 + 16 + 64, 0, 0)])
def test_page_25_step_and_direction_and_inverted_lines(bits, active, plus):
    board = Board()
    for pin in ("X+", "Y+"):
        board.pin(pin, 1 - active)
    board.say("B0=")
    board.run(SECOND)
    board.say(f"{bits}E")
    for axis in "XY":
        board.pin(f"{axis}-", plus)
        pulse(board, f"{axis}+", active=active)
        pulse(board, f"{axis}+", active=active)
        board.pin(f"{axis}-", 1 - plus)
        pulse(board, f"{axis}+", active=active)
    moved = [[d for _, d in board.pulses(axis)][-3:] for axis in "XY"]
    assert moved == [[1, 1, -1]] * 2


@pytest.mark.parametrize("bits", [4, 16, 64, 128, 8])
def test_page_25_bits_without_a_mode_mean_mode_1(bits):
    board = Board()
    board.say(f"{bits}E")
    assert board.level("RDY") == 0
    assert board.unit._direct.bits == bits | 1


def test_page_25_entering_and_leaving_stops_at_once_and_windings_are_forced_on():
    board = Board()
    board.say("B10000G", 300 * MS)
    assert not board.idle()
    board.say("1E")
    assert board.idle("X")
    assert board.idle("Y")
    here = board.position()
    assert board.report(-6) == 1
    board.say("G+S", SECOND)
    assert board.position() == here, "G and S have no effect"
    board.say("0E")
    assert board.report(-6) == 0, "back to W"
    assert board.level("RDY") == 1


def test_page_26_modes_marks_and_rates_are_stored_for_later(board):
    board.say("X2O500R600P70K")
    pulse(board, "X+")
    board.say("0M1M0E", 100 * MS)
    values = [board.report(number) for number in (-9, -10, -3, -11)]
    assert values == [2, 500, 600, 70]
    board.say("100G", SECOND)
    board.say("1M", SECOND)
    assert board.position() == 1


def test_page_47_i_never_completes():
    board = Board()
    board.say("0V1E")
    assert board.say("I", 10 * SECOND) == ""
    assert board.say("0E") == "*"


def test_limits_are_ignored_unless_the_hard_stop_is_ordered():
    for hard, steps in (("no", 1), ("yes", 0)):
        board = Board(hard_stop=hard)
        board.say("1E")
        board.pin("LX+", 0)
        pulse(board, "X+")
        pulse(board, "X-")
        assert board.position() == steps - 1
        assert board.say("L") == ("\r\nL,16\r\n*" if steps else "\r\nL,24\r\n*")


def test_page_26_limit_inputs_control_the_currents():
    board = Board(hard_stop="yes")
    board.say("6E")
    power = {}
    for minus in (0, 1):
        for plus in (0, 1):
            board.pin("LX-", minus)
            board.pin("LX+", plus)
            power[minus, plus] = board.drives("X")[-1].drive.sixteenths
    assert power == {(0, 0): 0, (0, 1): 0, (1, 0): 8, (1, 1): 16}
    assert board.drives("Y")[-1].drive.sixteenths == 16
    board.pin("LX+", 0)
    pulse(board, "X+")
    assert board.position() == 1, "they are no limits then"


def test_page_47_some_commands_cost_up_to_16_us_of_edges():
    for command, seen in (("X", 1), ("?", 0 + 1), ("R", 0), ("W", 0), ("=", 0), ("Z", 0), ("K", 1), ("A", 1)):
        board = Board()
        board.say("1EX")
        board.send(command)
        pulse(board, "X+")
        assert len(board.pulses()) == seen, command
    board = Board()
    board.say("1EX")
    board.send("R")
    pulse(board, "X+", low=16 * US)
    assert len(board.pulses()) == 1, "a long one is seen late"


def test_page_12_e_mode_may_be_ordered_for_the_start():
    board = Board(e_mode=2)
    assert board.status().state == "direct"
    pulse(board, "X+")
    assert board.position() == 1
