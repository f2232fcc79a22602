"""VALUE as it is typed (manual, pages 22 to 24, 44, 45)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.controllers.genstepper.boards import Board

from detent.controllers.genstepper.link import LARGEST, Value, answer, unframe
from detent.ticks import SECOND


def typed(text: str) -> Value:
    value = Value()
    for character in text:
        if not value.take(character):
            value.number()
    return value


@pytest.mark.parametrize(
    ("text", "number"),
    [("", 0), ("1000", 1000), ("-1000", -1000), ("+1000", 1000), ("123 456", 456), ("-5 7", 7), ("-5+", 0), ("-", 0),
     ("5-", 0), ("5-3", -3), ("--3", -3), ("007", 7), ("12X34", 34), ("99999999999", LARGEST),
     ("-99999999999", -LARGEST)],
)  # fmt: skip
def test_page_24_a_number_is_what_was_typed_last(text, number):
    assert typed(text).number() == number


def test_page_24_a_sign_alone_is_a_direction_until_a_digit_comes():
    assert typed("-").slew() == -1
    assert typed("+").slew() == 1
    assert typed("250-").slew() == -1
    for text in ("", "0", "-3", "- 3", "-X0"):
        assert typed(text).slew() == 0, text


@pytest.mark.parametrize("between", ["X", "Y", "B", " ", "\r", "Z", "R", "L", "?", "Q", "XYB Z"])
def test_pages_22_and_23_the_value_remains_unchanged_between_commands_a_sign_alone_too(between):
    value = typed(f"-{between}")
    assert value.slew() == -1
    assert value.number() == 0, "for every other command it is no digits"
    assert value.slew() == -1


@pytest.mark.parametrize(
    ("said", "ways"),
    [
        ("X-SYS", (-1, -1)),
        ("-XS", (-1, 0)),
        ("-BS", (-1, -1)),
        ("Y+S-XS", (-1, 1)),
        ("X+SZYS", (None, 1)),
        ("-X5S", (5, 0)),
    ],
)
def test_page_22_a_sign_serves_several_commands(said, ways):
    board = Board()
    board.say(said, SECOND)
    for axis, way in zip("XY", ways, strict=True):
        assert way is None or board.position(axis) == way or board.position(axis) * way > 100 > 5 > way, axis


def test_a_sign_that_has_slewed_slews_again_and_does_not_belong_to_the_next_number():
    value = Value()
    value.take("-")
    assert (value.slew(), value.slew()) == (-1, -1)
    value.take("1")
    assert (value.slew(), value.number()) == (0, 1)


@given(st.integers(-LARGEST, LARGEST))
def test_every_position_can_be_typed(number):
    assert typed(str(number)).number() == number
    assert typed(f"{number}R").number() == number, "VALUE stays for the next command"


def test_page_44_a_wrong_character_completes_the_number_and_is_answered():
    board = Board()
    assert board.say("123 456G") == "\r\n*"
    assert board.report(-4) == 456
    for unknown in (" ", ",", "\r", "\n", "Q", "\x00", "\xff", "*"):
        assert board.say(unknown) == "\r\n*", unknown


def test_page_45_a_value_serves_several_commands():
    board = Board()
    board.say("X250RY1000R")
    assert (board.report(-10, "X"), board.report(-10, "Y")) == (250, 1000)
    board.say("100RP")
    assert (board.report(-10, "Y"), board.say("Y-3?")) == (100, "\r\nY,-3,100\r\n*")


@pytest.mark.parametrize("command", ["x100r", "X100R", "x100R"])
def test_page_23_upper_and_lower_case_mean_the_same(command):
    board = Board()
    board.say(command)
    assert board.report(-10) == 100


def test_page_39_the_form_of_answers():
    assert answer((), 0) == "*"
    assert answer((), 1) == "\r\n*"
    assert answer(("X,-1,0", "Y,-1,0"), 0) == "X,-1,0\r\nY,-1,0*"
    assert answer(("X,-1,0",), 3) == "\r\nX,-1,0\r\n*"
    assert unframe(b"\r\nX,-1,0\r\n*") == ["X,-1,0", "*"]
    assert unframe(b"X,-1,0*L,16*\r") == ["X,-1,0", "*", "L,16", "*"]
