"""Prompts on a line with its times: when an answer begins, what cancels it (manual, pages 22, 23, 29, 35, 37)."""

import pytest
from tests.controllers.genstepper.boards import Board, bits

from detent.ticks import MS
from detent.uart import Sent


def sent_after(board: Board, at: int) -> list[Sent]:
    return [sent for sent in board.entries(Sent) if sent.at >= at]


def test_page_37_a_reset_is_deaf_for_250_ms_and_signs_on_within_a_second():
    board = Board(timed=True)
    assert board.greeting == "\r\nGenStepper $version: 2.18$\r\nDetent\r\n*"
    first, last = sent_after(board, 0)[0], sent_after(board, 0)[-1]
    assert first.at == 250 * MS
    assert last.done < 1000 * MS
    begun = board.cell.now
    assert board.say("4!", 1000 * MS) == board.greeting
    assert sent_after(board, begun)[0].at == begun + bits(20 - 0.75) + 250 * MS


def test_characters_during_the_first_250_ms_are_not_heard():
    board = Board(timed=True)
    board.send("!")
    board.run(100 * MS)
    assert board.say("X100R", 1000 * MS).count("*") == 1, "only the sign-on's"
    assert board.report(-10) == 800


def test_page_22_an_answer_begins_three_quarters_of_a_bit_before_its_commands_stop_bit_ends():
    board = Board(timed=True)
    now = board.cell.now
    board.say("X", 10 * MS)
    assert sent_after(board, now)[0].at == now + bits(10) - bits(0.75)
    assert [bits(10) - 1 <= s.done - s.at <= bits(10) + 1 for s in sent_after(board, now)] == [True] * 3


def test_page_22_with_v_bit_1_it_begins_eight_bits_later_and_characters_have_two_more_stop_bits():
    board = Board(timed=True)
    board.say("2V", 20 * MS)
    now = board.cell.now
    assert board.say("X-1?", 50 * MS) == "X,-1,0*"
    answer = sent_after(board, now + bits(40) - bits(1))
    assert answer[0].at == now + bits(40 - 0.75 + 8)
    assert all(bits(12) - 1 <= s.done - s.at <= bits(12) + 1 for s in answer)
    assert answer[1].at == answer[0].done, "back to back"


@pytest.mark.parametrize(
    ("verbose", "heard"),
    [(0, "**"), (1, "\r\r\n*"), (2, "*"), (3, "\r\n*")],
)
def test_page_23_of_gapless_commands_one_character_of_the_first_answer_leaks(verbose, heard):
    board = Board(timed=True)
    board.say(f"{verbose}V", 20 * MS)
    assert board.say("X-3000G", 30 * MS) == heard


def test_page_29_two_zeros_flush_whatever_is_being_sent():
    board = Board(timed=True)
    for verbose in range(4):
        board.say(f"{verbose}V", 20 * MS)
        board.send("B0?")
        board.run(20 * MS)
        board.send("00")
        board.cell.run_to(board.line.host_busy_until)
        assert "Y" not in board.heard()
        board.run(100 * MS)
        assert board.heard() == "", "no further characters are sent after this flushing action"


def test_a_digit_cancels_a_long_report_and_is_not_answered():
    board = Board(timed=True)
    board.send("B0?")
    board.run(bits(30) + bits(100))
    before = board.cell.now
    board.send("5")
    board.run(100 * MS)
    assert all(sent.at < before for sent in board.entries(Sent))


def test_page_29_i_answers_when_the_motors_are_idle():
    board = Board(timed=True)
    board.say("0V100KX", 20 * MS)
    assert board.say("2000G", 30 * MS) == "*", "received as soon as the motion starts"
    assert board.say("I", 30 * MS) == "", "not received until the motion completes"
    ended = board.until_idle()
    board.run(20 * MS)
    assert board.heard() == "*"
    assert sent_after(board, ended)[0].at == ended


def test_page_35_in_the_cr_lf_form_i_tells_at_once_that_it_waits():
    board = Board(timed=True)
    board.say("X2000G", 30 * MS)
    assert board.say("I", 30 * MS) == "\r\n"
    board.until_idle()
    board.run(20 * MS)
    assert board.heard() == "*"


def test_page_29_a_new_character_drops_the_prompt_of_i_and_is_processed():
    board = Board(timed=True)
    board.say("0VX2000G", 30 * MS)
    board.say("I", 20 * MS)
    assert board.say("X-8?", 20 * MS) == "*X,-8,1*", "X leaks one"
    board.until_idle()
    board.run(20 * MS)
    assert board.heard() == ""


def test_i_waits_for_the_selected_motors_only():
    board = Board(timed=True)
    board.say("0VX2000GY", 30 * MS)
    assert board.say("I", 5 * MS) == "*"


@pytest.mark.parametrize(
    ("baud", "jumper", "rate"), [(9600, 1, 9600), (4800, 1, 4800), (2400, 0, 600), (9600, 0, 2400)]
)
def test_page_13_baud_rates_and_dualbaud(baud, jumper, rate):
    board = Board(timed=True, baud=baud, dual_baud="yes", toml=f"straps = {{ S1K = {jumper} }}")
    board.run(1000 * MS)
    assert str(board.unit.line_format) == f"{rate} 8N1"
    assert board.entries(Sent)[-1].done < 1000 * MS, "the sign-on is over within a second"
    board.heard()
    now = board.cell.now
    assert board.say("X", 100 * MS) == "\r\n*"
    assert sent_after(board, now)[0].at == now + bits(10, rate) - bits(0.75, rate)
    assert board.drives()[-1].drive.sixteenths == 0
    board.say("1W", 100 * MS)
    assert board.drives()[-1].drive.sixteenths == 16, "the jumper is no half power jumper then"


def test_without_line_timing_an_answer_waits_one_character_time_for_more():
    board = Board()
    now = board.cell.now
    assert board.say("X-3000G") == "\r\n*"
    assert [sent.at for sent in sent_after(board, now)] == [now + bits(10)] * 3


def test_a_damaged_character_does_nothing():
    from detent.uart import Char

    board = Board()
    board.unit.receive("SI", [Char(ord("X"), framing_ok=False)], board.cell.now)
    assert board.unit.drain() == []
    assert board.say("-1?").count(",-1,") == 2, "both are selected still"
