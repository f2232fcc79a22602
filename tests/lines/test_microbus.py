"""The MICROBUS: bytes to everybody, and the strobe /DATA READY at every drive (Cassinis, figures 4 and 9)."""

from detent.lines.line import EVERYBODY
from detent.lines.microbus import Microbus
from detent.ticks import NEVER, US, Ns
from detent.uart import Char, Format, Sent

BYTE = Format(200_000)  # 50 us


def played(bus: Microbus, until: Ns) -> list[tuple[Ns, object]]:
    """What happens at the units: levels of the strobe, and bytes."""
    found: list[tuple[Ns, object]] = []
    while bus.deadline <= until:
        at = bus.deadline
        found += [(at, level) for level in bus.strobes(at)]
        for arrival in bus.advance(at):
            assert arrival.place == EVERYBODY
            found.append((at, bytes([arrival.sent.char.value])))
        assert bus.deadline > at
    return found


def test_the_strobe_is_low_in_the_second_half_of_each_byte_and_the_byte_is_taken_as_it_rises() -> None:
    bus = Microbus(BYTE)
    bus.send(b"\x01\x05", 0)
    assert played(bus, NEVER - 1) == [
        (25 * US, 0), (50 * US, 1), (50 * US, b"\x01"), (75 * US, 0), (100 * US, 1), (100 * US, b"\x05"),
    ]  # fmt: skip


def test_bytes_that_are_sent_meanwhile_wait_their_turn() -> None:
    bus = Microbus(BYTE)
    bus.send(b"\x01", 0)
    begun = played(bus, 30 * US)
    bus.send(b"\x02", 30 * US)
    assert begun + played(bus, NEVER - 1) == [
        (25 * US, 0), (50 * US, 1), (50 * US, b"\x01"), (75 * US, 0), (100 * US, 1), (100 * US, b"\x02"),
    ]  # fmt: skip


def test_without_line_timing_bytes_take_no_time_and_the_strobe_rests() -> None:
    bus = Microbus(BYTE, timed=False)
    bus.send(b"\x01\x05", 7)
    assert bus.deadline == 7
    assert bus.strobes(7) == []
    assert [arrival.sent.char.value for arrival in bus.advance(7)] == [1, 5]
    assert bus.deadline == NEVER


def test_the_ccu_hears_every_answer() -> None:
    bus = Microbus(BYTE)
    bus.from_unit(3, Sent(0, "BUS", Char(0x14), 50 * US))
    bus.advance(50 * US)
    assert [(heard.at, heard.char.value) for heard in bus.take()] == [(50 * US, 0x14)]
