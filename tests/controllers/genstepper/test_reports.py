"""Resets and reports (manual, pages 15, 37, 39 to 44), and the table of commands."""

import pytest
from tests.controllers.genstepper.boards import Board

from detent.controllers.catalogue import MODELS
from detent.controllers.device import Refused
from detent.controllers.genstepper import commands
from detent.controllers.genstepper.firmware import GenStepper
from detent.ticks import MS, SECOND


def test_page_15_power_on_and_page_40_all_reports_of_both_motors():
    board = Board()
    assert board.say("0?") == "\r\nX,0,0,80,8000,0,80,0,0,0,3,800,80\r\nY,0,0,80,8000,0,80,0,0,0,3,800,80\r\n*"
    assert board.say("0V") == "\r\n*", "page 35: CR LF comes as soon as V is recognised"
    assert board.say("-1?") == "X,-1,0\r\nY,-1,0*"
    assert board.say("Y-10?") == "*Y,-10,800*" or board.say("Y-10?") == "Y,-10,800*"
    assert board.report(252) == 3072 // 256
    assert board.report(253) == 4


@pytest.mark.parametrize("number", ["-13", "256", "1000", "-99", "+", "-"])
def test_page_39_any_other_number_counts_as_0(number):
    board = Board()
    assert board.say(f"X{number}?") == "\r\nX,0,0,80,8000,0,80,0,0,0,3,800,80\r\n*"


def test_page_43_the_version_is_the_two_lines_of_the_sign_on():
    board = Board()
    assert board.say("-12?") == board.greeting
    assert "$version: 2.18$" in board.greeting
    assert board.greeting.count("*") == 1
    assert board.say("X0V-12?") == "GenStepper $version: 2.18$\r\nDetent*"


@pytest.mark.parametrize(
    ("typed", "size"), [("!", 4), ("0!", 4), ("1!", 1), ("64!", 64), ("65!", 64), ("-3!", 1), ("16!", 16)]
)
def test_page_37_reset_chooses_the_microstep(typed, size):
    board = Board()
    assert board.say(typed, 300 * MS) == board.greeting
    assert board.report(253) == size
    board.say(typed, 300 * MS)
    board.say("!", 300 * MS)
    assert board.report(253) == 4, "reset clears VALUE"


def test_page_37_reset_stops_at_once_and_gives_the_power_on_list():
    board = Board()
    board.say("X1000AY5H7T10K20P30R1W2O1000=2000G", 100 * MS)
    steps = board.status("Y").pulses
    board.say("4!", 300 * MS)
    assert board.say("0?") == "\r\nX,0,0,80,8000,0,80,0,0,0,3,800,80\r\nY,0,0,80,8000,0,80,0,0,0,3,800,80\r\n*"
    assert board.status("Y").pulses == steps
    assert board.report(252) == 12


@pytest.mark.parametrize(
    ("typed", "report", "value"),
    [("0K", -11, 80), ("0P", -3, 8000), ("0R", -10, 400), ("99999R", -10, 62_500), ("70000P", -3, 62_500),
     ("-R", -10, 400),     ("-7K", -11, 7), ("62500R", -10, 62_500), ("1R", -10, 1)],
)  # fmt: skip
def test_pages_29_31_32_what_rates_of_0_and_beyond_the_limits_become(typed, report, value):
    board = Board()
    board.say(f"X{typed}")
    assert board.report(report) == value


def test_pages_40_and_41_speeds_and_targets_at_rest_and_in_motion():
    board = Board()
    board.say("X90K700R1000P50=")
    assert [board.report(n) for n in (-1, -2, -3, -4, -5, -8)] == [50, 90, 1000, 50, 90, 0]
    board.say("-2000G", 2 * SECOND)
    assert [board.report(n) for n in (-2, -3, -4, -5, -8)] == [700, 1000, -2000, 700, 2]
    board.say("Z")
    assert [board.report(n) for n in (-5, -8)] == [90, 5]


def test_ordered_defaults():
    board = Board(stop_rate=100, ramp=500, run_rate=200, auto_rate=6000, step_size=1, idle_windings=2)
    assert board.say("X0?") == "\r\nX,0,0,100,500,0,100,1,1,0,3,200,100\r\n*"
    assert (board.report(252), board.report(253)) == (23, 1)
    board.say("0!", 300 * MS)
    assert board.report(253) == 1


@pytest.mark.parametrize("wrong", ["4O", "-1O", "3W", "-1W", "2M", "Q"])
def test_values_that_mean_nothing_change_nothing_and_are_noted(wrong):
    board = Board()
    before = board.say("0?")
    assert board.say(wrong) == "\r\n*"
    assert board.say("0?") == before
    (refused,) = board.entries(Refused)
    assert refused.frame == wrong


def test_every_command_of_the_manual_has_a_row_and_a_method():
    characters = {row.character for row in commands.TABLE}
    assert characters == set("ABEGHIKLMOPRSTVWXYZ!=?")
    assert set(GenStepper._OBEY) == {row.op for row in commands.TABLE}
    assert "".join(sorted(row.character for row in commands.TABLE if row.blinds)) == "!=GHIMOPRSWZ", "page 47"


def test_the_two_boards_differ_by_their_plug_only():
    one, other = MODELS["bs0610"], MODELS["bs0710"]
    assert list(one.commands()) == list(other.commands())
    assert {pin.name for pin in one.pins} ^ {pin.name for pin in other.pins} == {"HLF", "FUL"}, (
        "page 67: S1K on early ones"
    )
    boards = [Board(model) for model in ("bs0610", "bs0710")]
    for text in ("B0?", "X1000G", "-12?", "L"):
        assert len({board.say(text) for board in boards}) == 1
