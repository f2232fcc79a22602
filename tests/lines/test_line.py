"""A line from a host to its units: who hears what, when; what happens when two talk at once."""

from detent.lines.line import EVERYBODY, Arrival, Heard, Line
from detent.ticks import NEVER
from detent.uart import Char, Format, Sent

FORM = Format(9600, 7, "odd", 2)
CHARACTER = 1_145_833


def sent(letter: str, at: int, place: int = 0) -> Sent:
    return Sent(at, "TXD", Char(ord(letter)), at + FORM.duration())


def run(line: Line) -> list[Arrival]:
    arrived = []
    while line.deadline < NEVER:
        arrived += line.advance(line.deadline)
    return arrived


def test_every_unit_hears_the_host_at_the_end_of_the_stop_bits() -> None:
    """GS-C200 datasheet, "Module address programming": units share one line, each hears every string."""
    line = Line(FORM)
    line.send(b"F\r", 1000)
    arrived = run(line)
    assert [arrival.place for arrival in arrived] == [EVERYBODY, EVERYBODY]
    assert [(a.sent.at, a.sent.done, a.sent.char.value) for a in arrived] == [
        (1000, 1000 + 1_145_833, ord("F")),
        (1000 + 1_145_833, 1000 + 2_291_667, 13),
    ]
    assert line.host_busy_until == 1000 + 2_291_667
    assert line.take() == []


def test_the_deadline_is_the_next_start_or_stop_bit() -> None:
    line = Line(FORM)
    assert line.deadline == NEVER
    line.send(b"AB", 0)
    assert line.deadline == CHARACTER
    assert line.advance(500) == []
    assert len(line.advance(CHARACTER)) == 1
    assert line.deadline == 2_291_667


def test_a_byte_too_wide_for_the_line_arrives_with_its_parity_spoilt() -> None:
    """Specification, "Straps and line": "A byte of 80h or more, like a parity error, makes the frame E1"."""
    line = Line(FORM, timed=False)
    line.send(b"\xc1A", 0)
    assert [arrival.sent.char for arrival in line.advance(0)] == [Char(0x41, parity_ok=False), Char(0x41)]


def test_the_host_hears_a_unit_at_the_end_of_the_stop_bits() -> None:
    line = Line(FORM)
    line.from_unit(0, sent("Y", 500))
    assert line.deadline == 500 + CHARACTER
    line.advance(500 + CHARACTER)
    assert line.take() == [Heard(500 + CHARACTER, Char(ord("Y")))]
    assert line.take() == []
    assert line.deadline == NEVER


def test_both_directions_at_once_do_not_disturb_each_other() -> None:
    line = Line(FORM)
    line.send(b"A", 0)
    line.from_unit(0, sent("Y", 100))
    arrived = run(line)
    assert arrived[0].sent.char == Char(ord("A"))
    assert line.take()[0].char == Char(ord("Y"))


def test_two_units_in_step_merge_bit_by_bit_and_a_0_wins() -> None:
    line = Line(FORM)
    line.from_unit(0, sent("Y", 0))  # 59h
    line.from_unit(1, sent("R", 0))  # 52h
    line.from_unit(2, sent("\x7f", 0))
    run(line)
    assert line.take() == [Heard(CHARACTER, Char(0x50))]


def test_two_units_out_of_step_damage_each_other() -> None:
    line = Line(FORM)
    line.from_unit(0, sent("Y", 0))
    line.from_unit(1, sent("R", 100_000))
    run(line)
    assert line.take() == [
        Heard(CHARACTER, Char(ord("Y"), framing_ok=False)),
        Heard(CHARACTER + 100_000, Char(ord("R"), framing_ok=False)),
    ]


def test_one_unit_behind_the_other_is_heard_well() -> None:
    line = Line(FORM)
    line.from_unit(0, sent("Y", 0))
    line.advance(CHARACTER)
    line.from_unit(1, sent("R", CHARACTER))
    run(line)
    assert [heard.char for heard in line.take()] == [Char(ord("Y")), Char(ord("R"))]


def test_without_line_timing_all_comes_in_the_same_instant_and_nothing_collides() -> None:
    line = Line(FORM, timed=False)
    line.send(b"F\r", 9)
    assert line.deadline == 9
    assert [arrival.sent.done for arrival in line.advance(9)] == [9, 9]
    for place, letter in enumerate("YR"):
        line.from_unit(place, Sent(9, "TXD", Char(ord(letter)), 9))
    line.advance(9)
    assert [heard.char.value for heard in line.take()] == [ord("Y"), ord("R")]


def test_a_receiver_that_does_not_wait_for_the_stop_bit_hears_earlier() -> None:
    line = Line(FORM, early=100)
    line.send(b"A", 0)
    assert line.deadline == CHARACTER - 100
    assert len(line.advance(CHARACTER - 100)) == 1


def test_start_bits_are_told_to_those_who_ask() -> None:
    line = Line(FORM, start_bits=True)
    line.send(b"AB", 50)
    assert line.deadline == 50
    assert line.started()
    assert not line.started()
    assert line.deadline == 50 + CHARACTER
    line.advance(line.deadline)
    assert line.started()
    quiet = Line(FORM)
    quiet.send(b"A", 0)
    assert not quiet.started()
