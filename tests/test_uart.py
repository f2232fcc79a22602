"""Characters on a serial line: their form, their times, the transmit queue."""

import copy
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.ticks import NEVER, SECOND
from detent.uart import Char, Format, Receiver, Sent, Transmitter, break_as, heard_as

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


FORMATS = st.builds(
    Format,
    st.sampled_from([110, 300, 1200, 2400, 4800, 9600, 19200, 115200]),
    st.sampled_from([7, 8]),
    st.sampled_from(["none", "odd", "even", "mark", "space"]),
    st.sampled_from([1, 2]),
)


def as_wide_as(form: Format, data: bytes) -> bytes:
    return bytes(value & ((1 << form.data_bits) - 1) for value in data)


@given(FORMATS, st.binary(max_size=20))
def test_a_receiver_in_the_senders_format_hears_what_was_sent(form: Format, data: bytes) -> None:
    assert heard_as(data, form, form) == [Char(value) for value in as_wide_as(form, data)]


@given(FORMATS, st.integers(-4, 4), st.binary(max_size=20))
def test_a_clock_that_is_wrong_by_four_percent_is_good_enough_and_no_error_adds_up(
    form: Format, percent: int, data: bytes
) -> None:
    """A receiver starts anew with every start bit: half a bit in at most twelve may be missing."""
    near = form._replace(baud=form.baud * (100 + percent))
    exact = form._replace(baud=form.baud * 100)
    assert heard_as(data, exact, near) == [Char(value) for value in as_wide_as(form, data)]


@pytest.mark.parametrize("stop_bits", [1, 2])
def test_a_receiver_looks_at_the_first_stop_bit_alone(stop_bits: int) -> None:
    sent, read = Format(9600, 8, "none", stop_bits), Format(9600, 8, "none", 3 - stop_bits)
    assert heard_as(b"V1\r\xff\0", sent, read) == [Char(value) for value in b"V1\r\xff\0"]


def test_the_parity_bit_is_an_eighth_data_bit_to_who_expects_one() -> None:
    """GS-C200 datasheet, "Communication port characteristics": 7 data bits, odd parity."""
    assert heard_as(b"F\r", GS_C200, Format(9600)) == [Char(0x46), Char(0x0D)], "three ones each: a parity bit of 0"
    assert heard_as(b"Y1", GS_C200, Format(9600)) == [Char(0xD9), Char(0x31)], "four ones need a fifth"


def test_an_eighth_data_bit_is_a_parity_bit_to_who_expects_one() -> None:
    assert heard_as(b"FY", Format(9600), GS_C200) == [Char(ord("F")), Char(ord("Y"), parity_ok=False)]


def test_the_wrong_parity_is_noticed_in_every_character() -> None:
    even = Format(9600, 7, "even", 2)
    assert heard_as(b"V1\r", even, GS_C200) == [Char(value, parity_ok=False) for value in b"V1\r"]
    spoilt = [Char(value, parity_ok=False) for value in b"V1\r"]
    assert heard_as(spoilt, even, GS_C200) == [Char(value) for value in b"V1\r"], "two wrongs"


def test_a_receiver_twice_as_fast_sees_every_bit_twice_and_falls_over_the_stop_bit() -> None:
    # start 0, U is 1 0 1 0 1 0 1 0, stop 1; at twice the rate 0 01100110 0, high, 0 01100111 1
    assert heard_as(b"U", Format(4800), Format(9600)) == [
        Char(0b01100110, framing_ok=False),
        Char(0b11100110),
    ]


def test_a_receiver_half_as_fast_takes_two_characters_for_one() -> None:
    # \0 at 9600 is 9 bits low and 1 high: at 4800 a start bit, then what lies in the middle of every second bit
    assert heard_as(b"\0", Format(9600), Format(4800)) == [Char(0b11111000)]
    assert heard_as(b"\0\0", Format(9600), Format(4800)) == [Char(0b00001000)]


def test_a_glitch_shorter_than_half_a_bit_is_no_start_bit() -> None:
    assert heard_as(b"\xff", Format(9600), Format(1200)) == []


def test_a_character_without_a_stop_bit_is_marked_and_the_next_begins_when_the_line_has_risen() -> None:
    damaged = [Char(0x41, framing_ok=False), Char(0x55)]
    form = Format(9600)
    assert heard_as(damaged[:1], form, form) == damaged[:1]
    assert heard_as(damaged, form, form)[0] == damaged[0]
    assert heard_as(damaged, form, form)[1:] != damaged[1:], "its start bit did not fall"


@given(FORMATS, FORMATS, st.binary(min_size=1, max_size=12), st.integers(0, 12))
def test_what_is_heard_does_not_depend_on_how_a_burst_is_sliced(
    sent: Format, read: Format, data: bytes, cut: int
) -> None:
    receiver = Receiver(sent, read)
    heard = receiver.hear(data[:cut]) + receiver.hear(data[cut:]) + receiver.idle()
    assert heard == heard_as(data, sent, read)
    singly = [char for value in data for char in receiver.hear(bytes((value,)))] + receiver.idle()
    assert singly == heard


@given(FORMATS, FORMATS, st.binary(max_size=8))
def test_a_receiver_is_at_rest_after_an_idle_line(sent: Format, read: Format, data: bytes) -> None:
    receiver = Receiver(sent, read)
    first = receiver.hear(data) + receiver.idle()
    assert receiver.hear(data) + receiver.idle() == first


@given(FORMATS, FORMATS, st.binary(max_size=8))
def test_what_is_heard_is_what_a_drawn_line_shows(sent: Format, read: Format, data: bytes) -> None:
    """The same with fractions of a second and a line drawn bit by bit."""
    edges: list[int] = []
    for value in as_wide_as(sent, data):
        bits = [value >> bit & 1 for bit in range(sent.data_bits)]
        parity = {"odd": [1 - sum(bits) % 2], "even": [sum(bits) % 2], "mark": [1], "space": [0]}.get(sent.parity, [])
        edges += [0, *bits, *parity, *[1] * sent.stop_bits]

    def level(at: Fraction) -> int:
        bit = at * sent.baud // 1
        return edges[bit] if 0 <= bit < len(edges) else 1

    falls = [bit for bit in range(len(edges)) if not edges[bit] and (bit == 0 or edges[bit - 1])]
    looks, heard = Fraction(-1), []
    count = 1 + read.data_bits + (read.parity != "none")
    for fall in falls:
        at = Fraction(fall, sent.baud)
        if at <= looks:
            continue
        looks = at + Fraction(1, 2 * read.baud)
        if level(looks):
            continue
        seen = [level(at + Fraction(2 * bit + 1, 2 * read.baud)) for bit in range(1, count + 1)]
        looks = at + Fraction(2 * count + 1, 2 * read.baud)
        value = sum(one << bit for bit, one in enumerate(seen[: read.data_bits]))
        right = {"odd": 1 - value.bit_count() % 2, "even": value.bit_count() % 2, "mark": 1, "space": 0}
        parity_ok = read.parity == "none" or seen[read.data_bits] == right[read.parity]
        heard.append(Char(value, parity_ok, bool(seen[-1])))
    assert heard_as(data, sent, read) == heard


def test_a_break_is_a_zero_without_a_stop_bit() -> None:
    assert break_as(Format(9600)) == Char(0, framing_ok=False)
    assert break_as(GS_C200) == Char(0, parity_ok=False, framing_ok=False)
    assert break_as(Format(9600, 7, "even")) == Char(0, framing_ok=False)


def test_damaged_characters_are_sent_as_they_are() -> None:
    out: list[Sent] = []
    sender = Transmitter("TXD", GS_C200, out)
    damaged = (Char(65, parity_ok=False), Char(66, framing_ok=False))
    sender.send(damaged, 0)
    sender.advance(NEVER - 1)
    assert tuple(item.char for item in out) == damaged
