"""Telnet's data and commands: RFC 854 (IAC), RFC 855 (options), RFC 1143 (no loops)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.realtime.endpoints.telnet import (
    BINARY,
    BREAK,
    COM_PORT,
    DO,
    DONT,
    IAC,
    MOST_PARAMETERS,
    SB,
    SE,
    WILL,
    WONT,
    Command,
    Data,
    Decoder,
    Item,
    Negotiation,
    Options,
    Parameters,
    escaped,
    negotiation,
    parameters,
)

ITEMS = st.one_of(
    st.builds(Data, st.binary(min_size=1, max_size=9)),
    st.sampled_from([Command(BREAK), Command(241)]),
    st.builds(Negotiation, st.sampled_from([WILL, WONT, DO, DONT]), st.integers(0, 255)),
    st.builds(Parameters, st.integers(0, 254), st.binary(max_size=9)),
)


def sent(item: Item) -> bytes:
    match item:
        case Data(data):
            return escaped(data)
        case Command(code):
            return bytes((IAC, code))
        case Negotiation(verb, option):
            return negotiation(verb, option)
        case Parameters(option, value):
            return parameters(option, value)


def joined(items: list[Item]) -> list[Item]:
    """With neighbouring data in one piece."""
    whole: list[Item] = []
    for item in items:
        if isinstance(item, Data) and whole and isinstance(whole[-1], Data):
            whole[-1] = Data(whole[-1].data + item.data)
        else:
            whole.append(item)
    return whole


@given(st.lists(ITEMS, max_size=8), st.data())
def test_whatever_is_sent_is_understood_however_it_is_cut(items: list[Item], data: st.DataObject) -> None:
    stream = b"".join(sent(item) for item in items)
    assert joined(Decoder().feed(stream)) == joined(items)
    singly = Decoder()
    assert joined([item for value in stream for item in singly.feed(bytes((value,)))]) == joined(items)
    cut = data.draw(st.integers(0, len(stream)))
    halves = Decoder()
    assert joined(halves.feed(stream[:cut]) + halves.feed(stream[cut:])) == joined(items)


@given(st.binary(max_size=60))
def test_no_bytes_are_too_strange_and_a_decoder_recovers(junk: bytes) -> None:
    decoder = Decoder()
    decoder.feed(junk)
    decoder.feed(bytes((0, IAC, SE)))  # whatever was open is closed
    assert decoder.feed(b"F\r") == [Data(b"F\r")]


def test_data_before_a_command_comes_before_it_and_what_is_behind_it_behind_it() -> None:
    assert Decoder().feed(b"a" + negotiation(WILL, COM_PORT) + b"b" + b"\xff\xff") == [
        Data(b"a"),
        Negotiation(WILL, COM_PORT),
        Data(b"b\xff"),
    ]


def test_a_subnegotiation_without_an_end_is_void_and_the_command_in_it_counts() -> None:
    assert Decoder().feed(bytes((IAC, SB, COM_PORT, 1, 2, IAC, WILL, BINARY)) + b"x") == [
        Negotiation(WILL, BINARY),
        Data(b"x"),
    ]
    assert Decoder().feed(bytes((IAC, SB, 1, IAC)) + bytes((SB, COM_PORT, 7, IAC, SE))) == [Parameters(COM_PORT, b"\7")]


def test_an_empty_subnegotiation_and_a_lonely_end_say_nothing() -> None:
    assert Decoder().feed(bytes((IAC, SB, IAC, SE, IAC, SE))) == []


def test_of_a_subnegotiation_without_end_only_the_beginning_is_kept() -> None:
    (item,) = Decoder().feed(parameters(COM_PORT, b"x" * 100_000))
    assert item == Parameters(COM_PORT, b"x" * (MOST_PARAMETERS - 1))


@pytest.mark.parametrize(("asked", "agreed", "refused"), [(WILL, DO, DONT), (DO, WILL, WONT)])
def test_what_is_accepted_is_agreed_on_once(asked: int, agreed: int, refused: int) -> None:
    options = Options(frozenset((BINARY,)))
    assert options.answer(Negotiation(asked, BINARY)) == negotiation(agreed, BINARY)
    assert options.answer(Negotiation(asked, BINARY)) == b"", "said already: an answer would go round for ever"
    assert options.answer(Negotiation(asked, 1)) == negotiation(refused, 1)
    assert options.theirs | options.ours == {BINARY}


@pytest.mark.parametrize(("yes", "no", "denial"), [(WILL, WONT, DONT), (DO, DONT, WONT)])
def test_an_option_can_be_taken_back(yes: int, no: int, denial: int) -> None:
    options = Options(frozenset((BINARY,)))
    options.answer(Negotiation(yes, BINARY))
    assert options.answer(Negotiation(no, BINARY)) == negotiation(denial, BINARY)
    assert options.answer(Negotiation(no, BINARY)) == b""
    assert not options.theirs | options.ours


def test_the_answer_to_an_offer_is_not_answered() -> None:
    options = Options(frozenset((BINARY,)))
    assert options.offer(WILL, BINARY) == negotiation(WILL, BINARY)
    assert options.offer(WILL, BINARY) == b""
    assert options.answer(Negotiation(DO, BINARY)) == b""
    assert options.ours == {BINARY}
    assert options.offer(WILL, BINARY) == b""
    assert options.offer(DO, BINARY) == negotiation(DO, BINARY)
    assert options.answer(Negotiation(WONT, BINARY)) == b""
    assert options.theirs == set()
