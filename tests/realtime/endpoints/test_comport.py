"""The server's side of RFC 2217, sections 2 to 5, without a socket."""

import pytest

from detent.lines.line import Heard
from detent.realtime.endpoints.comport import ComPort
from detent.realtime.endpoints.endpoint import MOST_WAITING
from detent.realtime.endpoints.telnet import BINARY, BREAK, COM_PORT, DO, DONT, IAC, WILL, WONT, negotiation, parameters
from detent.uart import Char, Format, heard_as

LINE = Format(9600, 7, "odd", 2)
QUERY = b"\0"


def said(command: int, value: bytes) -> bytes:
    return parameters(COM_PORT, bytes((command,)) + value)


def ask(port: ComPort, command: int, value: bytes = b"") -> bytes:
    chars, answer = port.receive(said(command, value))
    assert chars == []
    return answer


def heard(text: bytes, form: Format = LINE, begin: int = 0) -> list[Heard]:
    """A burst as the line tells it."""
    return [Heard(begin + form.duration(place + 1), Char(value)) for place, value in enumerate(text)]


@pytest.fixture
def port() -> ComPort:
    return ComPort(LINE, "drill")


def agreed(port: ComPort) -> ComPort:
    port.receive(negotiation(WILL, COM_PORT) + negotiation(WILL, BINARY) + negotiation(DO, BINARY))
    return port


@pytest.mark.parametrize(
    ("command", "asked", "answered"),
    [
        (1, b"\0\0\0\0", (9600).to_bytes(4)),
        (1, (19200).to_bytes(4), (19200).to_bytes(4)),
        (1, b"\1\2", (9600).to_bytes(4)),
        (2, QUERY, b"\7"),
        (2, b"\x08", b"\x08"),
        (2, b"\x09", b"\7"),
        (3, QUERY, b"\2"),
        (3, b"\1", b"\1"),
        (3, b"\3", b"\3"),
        (3, b"\4", b"\4"),
        (3, b"\5", b"\5"),
        (3, b"\6", b"\2"),
        (4, QUERY, b"\2"),
        (4, b"\1", b"\1"),
        (4, b"\3", b"\3"),
        (4, b"\4", b"\2"),
    ],
)
def test_a_setting_is_answered_with_what_is_so(port: ComPort, command: int, asked: bytes, answered: bytes) -> None:
    """RFC 2217, section 3: the answer has the client's number and 100; 0 asks; the start is the line's own format."""
    assert ask(port, command, asked) == said(command + 100, answered)


def test_a_value_of_255_is_escaped_both_ways(port: ComPort) -> None:
    assert ask(port, 1, b"\0\0\xff\xff") == bytes((IAC, 250, COM_PORT, 101, 0, 0, IAC, IAC, IAC, IAC, IAC, 240))
    assert port.format.baud == 65535


def test_settings_make_the_format(port: ComPort) -> None:
    for command, value in ((1, (1200).to_bytes(4)), (2, b"\x08"), (3, b"\1"), (4, b"\1")):
        ask(port, command, value)
    assert port.format == Format(1200, 8, "none", 1)


@pytest.mark.parametrize(
    ("asked", "answered"),
    [(0, 1), (2, 2), (3, 3), (13, 14), (16, 16), (4, 6), (7, 8), (10, 11), (17, 17), (18, 18)],
)
def test_control_is_answered_with_what_is_so(port: ComPort, asked: int, answered: int) -> None:
    assert ask(port, 5, bytes((asked,))) == said(105, bytes((answered,)))


def test_flow_control_that_was_set_is_what_is_so(port: ComPort) -> None:
    ask(port, 5, b"\3")
    assert ask(port, 5, QUERY) == said(105, b"\3")
    assert ask(port, 5, b"\x0d") == said(105, b"\x0e"), "the other direction is another matter"


def test_the_cable_loops_rts_to_cts_and_dtr_to_dsr_and_carrier(port: ComPort) -> None:
    assert ask(port, 7) == said(107, b"\xb0")
    assert ask(port, 5, b"\x0c") == said(105, b"\x0c") + said(107, b"\xa1")  # RTS off: CTS off, and it changed
    assert ask(port, 5, b"\x0c") == said(105, b"\x0c"), "nothing changed"
    assert ask(port, 5, b"\x09") == said(105, b"\x09") + said(
        107, b"\x0a"
    )  # DTR off: DSR and carrier off, both changed
    assert ask(port, 7) == said(107, b"\0")
    assert ask(port, 5, b"\x0b") == said(105, b"\x0b") + said(107, b"\x11")


def test_the_modem_mask_is_acknowledged_and_obeyed(port: ComPort) -> None:
    assert ask(port, 11, b"\x10") == said(111, b"\x10") + said(107, b"\x10")
    assert ask(port, 5, b"\x09") == said(105, b"\x09")
    assert ask(port, 11, b"\0") == said(111, b"\0")
    assert ask(port, 5, b"\x0c") == said(105, b"\x0c")


def test_the_signature_is_told_and_the_clients_is_taken_in_silence(port: ComPort) -> None:
    assert ask(port, 0) == said(100, b"Detent, line drill")
    assert ask(port, 0, b"a client") == b""


def test_a_purge_is_acknowledged(port: ComPort) -> None:
    for value in (b"\1", b"\2", b"\3"):
        assert ask(port, 12, value) == said(112, value)


@pytest.mark.parametrize("command", [6, 13, 99, 101, 255])
def test_what_is_no_command_says_nothing_and_does_no_harm(port: ComPort, command: int) -> None:
    assert ask(port, command, b"\1") == b""
    assert port.format == LINE


def test_com_port_control_is_agreed_on_and_binary_is_offered_to_who_waits_for_that(port: ComPort) -> None:
    _, answer = port.receive(negotiation(WILL, COM_PORT))
    binary = negotiation(WILL, BINARY) + negotiation(DO, BINARY)
    assert answer == negotiation(DO, COM_PORT) + binary + said(107, b"\xb0")
    assert port.receive(negotiation(DO, BINARY) + negotiation(WILL, BINARY)) == ([], b""), "these are the answers"


def test_who_asked_for_binary_before_is_not_asked_again(port: ComPort) -> None:
    assert port.receive(negotiation(WILL, BINARY) + negotiation(DO, BINARY))[1] == negotiation(
        DO, BINARY
    ) + negotiation(WILL, BINARY)
    assert port.receive(negotiation(WILL, COM_PORT))[1] == negotiation(DO, COM_PORT) + said(107, b"\xb0")


def test_other_options_are_refused(port: ComPort) -> None:
    assert port.receive(negotiation(DO, 1) + negotiation(WILL, 31))[1] == negotiation(WONT, 1) + negotiation(DONT, 31)


def test_a_client_that_fits_says_and_hears_bytes(port: ComPort) -> None:
    assert agreed(port).receive(b"V1\x17\r") == ([Char(value) for value in b"V1\x17\r"], b"")
    assert port.hear(heard(b"V100I\r")) == b"V100I\r"
    assert not port.waits


def test_a_uart_of_seven_bits_does_not_send_the_eighth(port: ComPort) -> None:
    assert agreed(port).receive(b"\xc1")[0] == [Char(0x41)]


def test_255_is_escaped_as_data() -> None:
    port = agreed(ComPort(Format(9600), "drill"))
    assert port.receive(b"\xff\xff\x01") == ([Char(255), Char(1)], b"")
    assert port.hear(heard(b"\xff\x01", Format(9600))) == b"\xff\xff\x01"


def test_a_terminal_that_sends_cr_nul_means_cr(port: ComPort) -> None:
    """RFC 854: without BINARY a carriage return alone is CR NUL. Whoever speaks RFC 2217 means every byte."""
    assert port.receive(b"F\r\0")[0] == [Char(70), Char(13)]
    assert port.receive(b"F\r")[0] + port.receive(b"\0F")[0] == [Char(70), Char(13), Char(70)]
    assert agreed(port).receive(b"F\r\0")[0] == [Char(70), Char(13), Char(0)]


@pytest.mark.parametrize("theirs", [Format(9600), Format(4800, 7, "odd", 2), Format(19200), Format(9600, 7, "even")])
def test_a_client_of_another_format_says_and_hears_what_the_bits_are_to_the_other_side(theirs: Format) -> None:
    port = agreed(ComPort(LINE, "drill"))
    ask(port, 1, theirs.baud.to_bytes(4))
    ask(port, 2, bytes((theirs.data_bits,)))
    ask(port, 3, bytes((("none", "odd", "even").index(theirs.parity) + 1,)))
    ask(port, 4, bytes((theirs.stop_bits,)))
    assert port.receive(b"V1\x17\r")[0] == heard_as(b"V1\x17\r", theirs, LINE)
    assert port.waits
    garbage = bytes(char.value for char in heard_as(b"V100I\r", LINE, theirs))
    told = b""
    for one in heard(b"V100I\r"):
        told += port.hear([one])
    assert told + port.idle() == garbage
    singly = bytes(char.value for value in b"V1" for char in heard_as(bytes((value,)), LINE, theirs))
    apart = [heard(b"V")[0], heard(b"1", begin=10**9)[0]]
    assert port.hear(apart) + port.idle() == singly


def test_stop_bits_alone_make_no_difference_to_a_receiver(port: ComPort) -> None:
    ask(agreed(port), 4, b"\1")
    assert port.receive(b"F\r")[0] == [Char(70), Char(13)]
    assert port.hear(heard(b"R\r")) == b"R\r"


def test_a_break_is_a_character_without_a_stop_bit_and_holds_the_line(port: ComPort) -> None:
    zero = Char(0, parity_ok=False, framing_ok=False)
    agreed(port)
    assert port.receive(said(5, b"\5")) == ([zero], said(105, b"\5"))
    assert port.receive(said(5, b"\5") + b"lost") == ([], said(105, b"\5"))
    assert port.receive(said(5, b"\6") + b"F") == ([Char(70)], said(105, b"\6"))
    assert port.receive(bytes((IAC, BREAK))) == ([zero], b""), "telnet's own"


def test_damage_on_the_line_is_notified_to_who_wants_to_know(port: ComPort) -> None:
    """RFC 2217, NOTIFY-LINESTATE: 4 a parity error, 8 a framing error, 16 a break."""
    damaged = [
        Heard(0, Char(65, parity_ok=False)),
        Heard(0, Char(66, framing_ok=False)),
        Heard(0, Char(0, True, False)),
    ]
    assert port.hear(damaged) == b"AB\0"
    assert ask(port, 10, b"\x1c") == said(110, b"\x1c")
    assert port.hear(damaged) == said(106, b"\4") + b"A" + said(106, b"\x08") + b"B" + said(106, b"\x18") + b"\0"


def test_a_client_that_suspends_gets_everything_when_it_resumes(port: ComPort) -> None:
    assert ask(port, 8) == b""
    assert port.hear(heard(b"R\r")) == b""
    assert ask(port, 7) == said(107, b"\xb0"), "answers are no data"
    assert ask(port, 9) == b"R\r"
    assert port.hear(heard(b"B\r")) == b"B\r"


def test_a_client_that_suspends_for_ever_loses_the_oldest_bytes_and_a_purge_forgets_the_rest(port: ComPort) -> None:
    ask(port, 8)
    port.hear(heard(b"x" * 10 + b"y" * MOST_WAITING))
    assert port.dropped == 10
    ask(port, 12, b"\2")
    assert ask(port, 9) == b"y" * MOST_WAITING
    ask(port, 8)
    port.hear(heard(b"z"))
    ask(port, 12, b"\1")
    assert ask(port, 9) == b""
