"""Characters on a serial line: their form, their times, the transmit queue."""

import copy
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.ticks import NEVER, SECOND
from detent.uart import Char, Format, Sent, Transmitter

GS_C200 = Format(9600, 7, "odd", 2)


def round_half_up(value: Fraction) -> int:
    return (2 * value.numerator + value.denominator) // (2 * value.denominator)


def test_a_character_takes_a_start_bit_its_data_its_parity_and_its_stop_bits() -> None:
    """GS-C200 datasheet, "Communication port characteristics": 1 start, 7 data, odd parity, 2 stop bits."""
    assert GS_C200.bits == 11
    assert Format(9600).bits == 10
    assert Format(9600, 8, "even", 2).bits == 12
    assert str(GS_C200) == "9600 7O2"
    assert str(Format(115200)) == "115200 8N1"


def test_a_burst_of_characters_is_rounded_as_a_whole() -> None:
    assert GS_C200.duration() == 1_145_833
    assert GS_C200.duration(2) == 2_291_667
    assert GS_C200.duration(3) == 3_437_500
    assert Format(110, 7, "odd", 2).duration() == SECOND // 10


def test_an_idle_transmitter_starts_at_once_and_sends_without_a_pause() -> None:
    out: list[Sent] = []
    sender = Transmitter("TXD", GS_C200, out)
    assert sender.deadline == NEVER
    sender.send(b"Y\x59\r", 1000)
    assert out == [Sent(1000, "TXD", Char(ord("Y")), 1_146_833)]
    assert sender.deadline == 1_146_833
    assert sender.busy_until == 3_438_500
    sender.advance(sender.deadline)
    sender.advance(sender.deadline)
    assert [item.at for item in out] == [1000, 1_146_833, 2_292_667]
    assert [item.done for item in out] == [1_146_833, 2_292_667, 3_438_500]
    assert sender.deadline == NEVER


def test_what_is_sent_later_waits_behind_what_is_being_sent() -> None:
    out: list[Sent] = []
    sender = Transmitter("TXD", GS_C200, out)
    sender.send(b"A", 0)
    sender.send(b"B", 500_000)  # in the middle of the only character
    assert sender.deadline == 1_145_833
    sender.advance(1_145_833)
    assert out[1] == Sent(1_145_833, "TXD", Char(ord("B")), 2_291_667)


def test_a_pause_begins_a_new_burst() -> None:
    out: list[Sent] = []
    sender = Transmitter("TXD", GS_C200, out)
    sender.send(b"A", 0)
    sender.send(b"B", 1_145_833)  # just as the line falls idle
    sender.send(b"C", 10_000_000)
    assert [item.at for item in out] == [0, 1_145_833, 10_000_000]
    assert out[1].done == 1_145_833 + 1_145_833
    sender.send(b"", 20_000_000)
    assert len(out) == 3


def test_what_waits_can_be_discarded_the_character_on_the_line_goes_on() -> None:
    out: list[Sent] = []
    sender = Transmitter("TXD", GS_C200, out)
    sender.send(b"ABC", 0)
    sender.discard()
    assert sender.deadline == NEVER
    assert sender.busy_until == 1_145_833
    sender.send(b"D", 100)
    sender.advance(NEVER - 1)
    assert [chr(item.char.value) for item in out] == ["A", "D"]
    assert out[1].at == 1_145_833


def test_without_line_timing_characters_take_no_time() -> None:
    out: list[Sent] = []
    sender = Transmitter("TXD", GS_C200, out, timed=False)
    sender.send(b"AB", 77)
    assert out == [Sent(77, "TXD", Char(65), 77), Sent(77, "TXD", Char(66), 77)]
    assert sender.deadline == NEVER
    assert sender.busy_until == 77


@given(
    st.sampled_from([110, 150, 300, 600, 1200, 2400, 4800, 9600, 19200]),
    st.lists(st.tuples(st.integers(0, 30_000_000), st.binary(max_size=9)), max_size=9),
)
def test_any_stream_goes_out_whole_in_order_and_at_the_rate_of_the_line(baud: int, pieces: list) -> None:
    form = Format(baud, 7, "odd", 2)
    out: list[Sent] = []
    sender = Transmitter("TXD", form, out)
    now, sent = 0, b""
    for gap, data in pieces:
        until = now + gap
        while sender.deadline <= until:
            sender.advance(sender.deadline)
        now = until
        sender.send(data, now)
        sent += data
    twin = copy.deepcopy((sender, out))
    while sender.deadline < NEVER:
        sender.advance(sender.deadline)
    assert bytes(item.char.value for item in out) == sent
    burst, index = 0, 0
    for before, item in zip([None, *out], out, strict=False):
        if before is None or item.at > before.done:
            burst, index = item.at, 0
        elif item.at == before.done and item.done != burst + round_half_up(Fraction((index + 1) * 11 * SECOND, baud)):
            burst, index = item.at, 0  # the line fell idle in this very instant
        index += 1
        assert item.done == burst + round_half_up(Fraction(index * 11 * SECOND, baud))
        assert before is None or item.at >= before.done
    other, other_out = twin
    while other.deadline < NEVER:
        other.advance(other.deadline)
    assert other_out == out


def test_the_format_changes_between_characters_only() -> None:
    out: list[Sent] = []
    sender = Transmitter("TXD", GS_C200, out)
    sender.send(b"AB", 0)
    with pytest.raises(RuntimeError, match="discard them"):
        sender.change(Format(1200, 7, "odd", 2))
    sender.discard()
    sender.change(Format(1200, 7, "odd", 2))
    sender.send(b"C", 0)
    sender.advance(NEVER - 1)
    assert out[-1].at == 1_145_833
    assert out[-1].done == 1_145_833 + 9_166_667
