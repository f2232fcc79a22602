from collections import Counter
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.lines.daisy_chain import DaisyChain
from detent.lines.faults import (
    BOTH,
    HOST,
    UNITS,
    BitErrors,
    CableOut,
    Delay,
    FaultyLine,
    LineFault,
    LostCharacters,
    Tally,
    drawn,
)
from detent.lines.line import Line
from detent.lines.microbus import Microbus
from detent.lines.party_line import PartyLine
from detent.ticks import MS, NEVER, Ns
from detent.uart import SOUND, Char, Format, Sent

FORM = Format(9600, 7, "odd", 2)
PLAIN = Format(9600)


def faulty(*faults: LineFault, form: Format = FORM, timed: bool = True) -> FaultyLine:
    line = FaultyLine(Line(form, timed=timed))
    for number, fault in enumerate(faults, 1):
        line.begin(number, fault)
    return line


def to_units(line: Line, data: bytes) -> list[Char]:
    """What the units hear of `data`."""
    line.send(data, 0)
    heard = []
    while line.deadline < NEVER:
        heard += [arrival.sent.char for arrival in line.advance(line.deadline)]
    return heard


def to_host(line: Line, data: bytes) -> list[tuple[Ns, Char]]:
    """What the host hears of `data`, one character after the other from the unit at place 0."""
    for n, value in enumerate(data):
        line.from_unit(0, Sent(FORM.duration(n), "TXD", SOUND[value], FORM.duration(n + 1)))
    while line.deadline < NEVER:
        line.advance(line.deadline)
    return [(heard.at, heard.char) for heard in line.take()]


def values(chars: Sequence[Char]) -> bytes:
    return bytes(char.value for char in chars)


def test_what_is_drawn_follows_from_seed_and_number_alone_and_looks_even() -> None:
    assert drawn(1, 2) == drawn(1, 2)
    assert len({drawn(seed, n) for seed in range(50) for n in range(50)}) == 2500
    counts = Counter(drawn(7, n) >> 61 for n in range(8000))
    assert all(900 < counts[octant] < 1100 for octant in range(8))
    assert 0 <= drawn(-3, 1 << 70) < 1 << 64


def test_the_nth_character_alone_is_struck_each_way() -> None:
    line = faulty(BitErrors(nth=3, bit="0"))
    assert values(to_units(line, b"BBBB")) == b"BBCB"
    assert values([char for _, char in to_host(line, b"BBBB")]) == b"BBCB"
    assert line.tally(1) == Tally(8, 2)


def test_a_wrong_data_bit_spoils_the_parity_and_a_second_one_hides_it() -> None:
    (once,) = to_units(faulty(BitErrors(nth=1, bit="2")), b"A")
    assert once == Char(0x45, parity_ok=False)
    (twice,) = to_units(faulty(BitErrors(nth=1, bit="2"), BitErrors(nth=1, bit="5")), b"A")
    assert twice == Char(0x65, parity_ok=True)


def test_without_parity_nobody_sees_a_wrong_bit() -> None:
    assert to_units(faulty(BitErrors(nth=1, bit="7"), form=PLAIN), b"A") == [Char(0xC1)]


@pytest.mark.parametrize(("bit", "seen"), [("parity", Char(65, False, True)), ("framing", Char(65, True, False))])
def test_the_bits_beside_the_data_can_be_wrong_too(bit: str, seen: Char) -> None:
    assert to_units(faulty(BitErrors(nth=1, bit=bit)), b"A") == [seen]


def test_a_bit_that_is_drawn_is_one_of_the_character() -> None:
    heard = to_units(faulty(BitErrors(rate=1.0)), bytes(400))
    changed = Counter(char.value for char in heard)
    assert set(changed) == {0, *(1 << bit for bit in range(7))}, "seven data bits, or the parity bit"
    assert not any(char.parity_ok for char in heard)


def test_a_share_of_the_characters_is_struck_and_another_seed_strikes_others() -> None:
    places = []
    for seed in (0, 0, 1):
        heard = to_units(faulty(BitErrors(rate=0.1, seed=seed)), bytes(2000))
        places.append([n for n, char in enumerate(heard) if not char.parity_ok])
    assert places[0] == places[1] != places[2]
    assert 150 < len(places[0]) < 250


def test_a_lost_character_leaves_a_gap_in_which_nothing_moves_up() -> None:
    line = faulty(LostCharacters(towards=HOST, nth=2))
    assert to_host(line, b"abc") == [(FORM.duration(1), SOUND[97]), (FORM.duration(3), SOUND[99])]
    assert values(to_units(line, b"abc")) == b"abc"


def test_delayed_characters_keep_their_order_and_their_distance() -> None:
    line = faulty(Delay(5 * MS))
    assert [at for at, _ in to_host(line, b"ab")] == [FORM.duration(1) + 5 * MS, FORM.duration(2) + 5 * MS]


def test_a_character_does_not_overtake_those_that_were_delayed_before_it() -> None:
    line = faulty(Delay(5 * MS))
    line.from_unit(0, Sent(0, "TXD", SOUND[97], FORM.duration(1)))
    line.advance(FORM.duration(1))
    line.mend(1)
    assert not line.sound, "one is still late"
    line.from_unit(0, Sent(FORM.duration(1), "TXD", SOUND[98], FORM.duration(2)))
    while line.deadline < NEVER:
        line.advance(line.deadline)
    assert values([heard.char for heard in line.take()]) == b"ab"
    assert line.sound


def test_delay_towards_the_units_moves_begin_and_end() -> None:
    line = faulty(Delay(5 * MS, UNITS))
    line.send(b"a", 0)
    arrived = []
    while line.deadline < NEVER:
        arrived += line.advance(line.deadline)
    ((_, sent),) = arrived
    assert (sent.at, sent.done) == (5 * MS, 5 * MS + FORM.duration(1))


def test_nothing_passes_a_cable_that_is_out() -> None:
    line = faulty(CableOut())
    assert to_units(line, b"abc") == []
    assert to_host(line, b"abc") == []
    line.mend(1)
    assert values(to_units(line, b"abc")) == b"abc"


@pytest.mark.parametrize("timed", [True, False])
def test_faults_meet_characters_that_take_no_time_too(timed: bool) -> None:
    line = faulty(BitErrors(nth=2, bit="0"), LostCharacters(nth=3), timed=timed)
    assert line.immediate(b"BBB") == []
    assert values(to_units(line, b"BBBB")) == b"BCB"


def test_on_a_party_line_a_character_is_damaged_alike_for_all_units_and_the_host_is_the_host() -> None:
    line = FaultyLine(PartyLine(FORM, 2), host_place=2)
    line.begin(1, BitErrors(nth=1, bit="0", towards=UNITS))
    line.begin(2, BitErrors(nth=1, bit="1", towards=HOST))
    line.from_unit(2, Sent(0, "TX", SOUND[0x40], FORM.duration(1)))
    line.from_unit(0, Sent(0, "TXD", SOUND[0x40], FORM.duration(1)))
    arrived = [(place, sent.char.value) for place, sent in line.advance(FORM.duration(1))]
    assert arrived == [(0, 0x41), (1, 0x41), (2, 0x42)]


def test_on_a_daisy_chain_the_cable_of_the_host_is_meant() -> None:
    line = FaultyLine(DaisyChain(FORM, 2))
    line.begin(1, CableOut(UNITS))
    line.send(b"a", 0)
    line.from_unit(0, Sent(0, "TXD", SOUND[98], FORM.duration(1)))
    assert [(place, sent.char.value) for place, sent in line.advance(FORM.duration(1))] == [(1, 98)]


def test_a_cable_that_is_out_brings_no_strobe() -> None:
    line = FaultyLine(Microbus(PLAIN))
    line.begin(1, CableOut())
    line.send(b"a", 0)
    assert line.strobes(NEVER - 1) == []


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (BitErrors(), "either a rate above 0, or the nth one"),
        (BitErrors(rate=0.1, nth=1), "either a rate above 0, or the nth one"),
        (LostCharacters(rate=1.5), "rate 1.5 is no share of the characters; it takes a number from 0 to 1"),
        (LostCharacters(rate=float("nan")), "no share of the characters"),
        (BitErrors(nth=1, towards="left"), "'left' is no way on a line; a fault is towards units, host or both"),
        (
            BitErrors(nth=1, bit="7"),
            "characters of 9600 7O2 have no bit '7'; there are: 0, 1, 2, 3, 4, 5, 6, parity, fr",
        ),
        (Delay(0), "a time above 0"),
    ],
)
def test_a_fault_that_makes_no_sense_is_refused(fault: LineFault, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        faulty(fault)


def test_a_line_without_parity_has_no_parity_bit() -> None:
    with pytest.raises(ValueError, match="have no bit 'parity'"):
        faulty(BitErrors(nth=1, bit="parity"), form=PLAIN)


@given(st.binary(max_size=40), st.lists(st.integers(0, 40), max_size=5), st.sampled_from([UNITS, BOTH]))
def test_how_characters_are_sliced_changes_nothing(data: bytes, cuts: list[int], towards: str) -> None:
    faults = [BitErrors(towards, rate=0.3), LostCharacters(towards, rate=0.2, seed=5), Delay(3 * MS, towards)]
    whole = to_units(faulty(*faults), data)
    line = faulty(*faults)
    ends = sorted({*(min(cut, len(data)) for cut in cuts), len(data)})
    for begin, end in zip([0, *ends], ends, strict=False):
        line.send(data[begin:end], 0)
    heard = []
    while line.deadline < NEVER:
        heard += [arrival.sent.char for arrival in line.advance(line.deadline)]
    assert heard == whole
