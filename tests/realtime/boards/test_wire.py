"""Blocks, integers, dictionary, link: what is on the wire, and what a bad wire does to it."""

from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples, seeds

from detent.realtime.boards.dictionary import BARE, Dictionary, Format
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.frames import FrameError, Reader, block, checksum, integer, read_integer
from detent.realtime.boards.link import Link
from detent.ticks import MS, US, Ns


def test_the_checksum_is_crc_16_mcrf4xx() -> None:
    assert checksum(b"123456789") == 0x6F91


def test_a_block() -> None:
    whole = block(5, b"\x01\x02")
    assert whole[:4] == b"\x07\x15\x01\x02"
    assert whole[-1] == 0x7E
    assert whole[4] << 8 | whole[5] == checksum(whole[:4])
    assert block(0, bytes(59))[0] == 64
    with pytest.raises(ValueError, match="59 bytes"):
        block(0, bytes(60))


@pytest.mark.parametrize(
    ("value", "data"),
    [
        (0, "00"), (95, "5f"), (-32, "60"), (96, "80 60"), (-33, "ff 5f"), (12287, "df 7f"), (12288, "80 e0 00"),
        (-4096, "e0 00"), (-4097, "ff df 7f"), (0xFFFFFFFF, "7f"), (0x80000000, "f8 80 80 80 00"),
    ],
)  # fmt: skip
def test_integers_as_the_protocol_writes_them(value: int, data: str) -> None:
    assert integer(value).hex(" ") == data
    assert read_integer(integer(value), 0)[0] & 0xFFFFFFFF == value & 0xFFFFFFFF


@given(st.integers(-(1 << 31), (1 << 32) - 1))
def test_integers_come_back(value: int) -> None:
    data = integer(value)
    assert 1 <= len(data) <= 5
    assert read_integer(data, 0) == ((value + (1 << 31)) % (1 << 32) - (1 << 31), len(data))


@given(st.lists(st.binary(max_size=59), max_size=6), st.randoms(use_true_random=False))
def test_blocks_are_found_however_they_are_sliced(payloads: list[bytes], random: Random) -> None:
    stream = b"".join(block(n, payload) for n, payload in enumerate(payloads))
    reader, found = Reader(), []
    while stream:
        cut = random.randrange(1, len(stream) + 1)
        found += reader.feed(stream[:cut])
        stream = stream[cut:]
    assert [(b.sequence, b.payload) for b in found] == list(enumerate(payloads))
    assert reader.damaged == 0


@given(st.binary(max_size=300), st.binary(min_size=1, max_size=30))
def test_rubbish_hides_at_most_the_blocks_it_touches(rubbish: bytes, payload: bytes) -> None:
    reader = Reader()
    reader.feed(rubbish)
    reader.feed(block(3, payload))  # its end mark ends the rubbish
    assert reader.feed(block(4, payload))[-1] == (4, payload)


def test_a_message_of_a_dictionary() -> None:
    form = Format("queue_step oid=%c interval=%u count=%hu add=%hi", -7)
    data = form.encode({"oid": 3, "interval": 4_000_000_000, "count": 65535, "add": -32768})
    message, end = form.decode(data, len(integer(-7)))
    assert end == len(data)
    assert (message.number("interval") & 0xFFFFFFFF, message.number("add")) == (4_000_000_000, -32768)
    with pytest.raises(KeyError):
        form.encode({"oid": 3})
    with pytest.raises(KeyError, match="has the fields"):
        form.encode({"oid": 3, "interval": 1, "count": 1, "add": 1, "more": 1})
    with pytest.raises(TypeError, match="takes an integer"):
        form.encode({"oid": b"", "interval": 1, "count": 1, "add": 1})


def test_a_dictionary_in_full() -> None:
    fake = FakeBoard(seed=7)
    words = Dictionary.of_bytes(fake.identity)
    assert words.frequency == 16_000_000
    assert words.receive_window == 192
    assert words.pins[:3] == ("gpio0", "gpio1", "gpio2")
    assert words.reserved == {"gpio0": "serial", "gpio1": "serial"}
    assert words.number("pin", "gpio63") == 63
    with pytest.raises(KeyError, match="has no pin gpio64; it has gpio6"):
        words.number("pin", "gpio64")
    assert any(form.number < 0 for form in words.commands.values())
    assert words.missing({"queue_step": ("oid", "interval", "count", "add")}) == []
    assert words.missing({"queue_step": ("oid",), "fly": ()}) == ["queue_step with oid", "fly"]


@pytest.mark.parametrize("data", [b"", b"nothing", FakeBoard().identity[:-9]])
def test_what_is_no_dictionary_is_told(data: bytes) -> None:
    with pytest.raises(ValueError, match="no dictionary"):
        Dictionary.of_bytes(data)


def test_an_unknown_response_is_an_error_of_the_frame() -> None:
    with pytest.raises(FrameError, match="no response 5"):
        BARE.parse(b"\x05")


class Echo:
    """A board that keeps what it was told, in order."""

    def __init__(self, sequence: int) -> None:
        self.reader, self.sequence = Reader(patient=True), sequence
        self.taken: list[bytes] = []
        self.out = bytearray()

    def receive(self, data: bytes) -> None:
        before = self.reader.damaged
        for found in self.reader.feed(data):
            if found.sequence == self.sequence:
                self.sequence = (self.sequence + 1) & 15
                self.taken.append(found.payload)
                if found.payload and found.payload[-1] % 3 == 0:
                    self.out += block(self.sequence, b"answer")
            self.out += block(self.sequence, b"")
        if self.reader.damaged != before:
            self.out += block(self.sequence, b"")

    def say(self) -> bytes:
        data, self.out = bytes(self.out), bytearray()
        return data


def converse(seed: int, loss: float) -> None:
    """Every message arrives once and in order, whatever a wire loses, doubles, damages and delays."""
    random = Random(seed)
    link, far = Link(), Echo(random.randrange(16))
    link.window = random.choice([None, 192])
    messages = [n.to_bytes(2, "big") + bytes(random.randrange(1, 30)) for n in range(random.randrange(1, 120))]
    wall: Ns = 0
    to_far: list[tuple[Ns, bytes]] = []
    to_near: list[tuple[Ns, bytes]] = []

    def spoilt(data: bytes) -> list[bytes]:
        chance = random.random()
        if not data or chance > loss:
            return [data] if data else []
        if chance < loss / 3:
            return []
        if chance < 2 * loss / 3:
            return [data, data]
        place = random.randrange(len(data))
        return [data[:place] + bytes([data[place] ^ 1 << random.randrange(8)]) + data[place + 1 :]]

    link.sync(wall)
    waiting = list(messages)
    for _ in range(60_000):
        if link.synced and waiting and random.random() < 0.5:
            link.send(waiting.pop(0))
            link.flush(wall)
        to_far += [(wall + 200 * US, part) for part in spoilt(link.take())]
        while to_far and to_far[0][0] <= wall:
            far.receive(to_far.pop(0)[1])
        to_near += [(wall + 200 * US, part) for part in spoilt(far.say())]
        while to_near and to_near[0][0] <= wall:
            link.receive(to_near.pop(0)[1], wall)
        at = link.deadline()
        if at is not None and at <= wall:
            link.due(wall)
        assert link.window is None or sum(len(sent.data) for sent in link._under_way) <= max(link.window, 64)
        if link.synced and not waiting and link.idle:
            break
        wall += 100 * US
    else:
        raise AssertionError("it never ended")
    assert b"".join(payload for payload in far.taken) == b"".join(messages)


@pytest.mark.parametrize("loss", [0.0, 0.02, 0.2])
@pytest.mark.parametrize("seed", seeds(8))
def test_a_bad_wire_loses_nothing(seed: int, loss: float) -> None:
    converse(seed, loss)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_a_bad_wire_loses_nothing_at_length(part: int) -> None:
    for seed in range(100 * part, 100 * part + 100):
        converse(seed, 0.25)


@pytest.mark.parametrize("payloads", [[b"1"], [b"12", bytes(59)], [bytes(40), b"3", b"4"]])
def test_what_was_damaged_on_its_way_is_taken_when_it_is_sent_again(payloads: list[bytes]) -> None:
    """Whichever bit it was: a board that waits for a longer block than there is gets its fill."""
    for place in range(sum(len(payload) + 5 for payload in payloads)):
        for bit in range(8):
            link, far = Link(), Echo(4)
            link.sync(0)
            far.receive(link.take())
            link.receive(far.say(), 0)
            for payload in payloads:
                link.send(payload)
                link.flush(0)
            data = bytearray(link.take())
            data[place] ^= 1 << bit
            far.receive(bytes(data))
            link.receive(far.say(), 0)
            at = link.deadline()
            if not link.idle and not link.retransmitted:
                assert at is not None
                link.due(at)
            far.receive(link.take())
            link.receive(far.say(), at or 0)
            assert link.idle, (place, bit)
            assert b"".join(far.taken) == b"".join(payloads)


def test_a_clean_wire_repeats_nothing() -> None:
    link, far = Link(), Echo(4)
    link.sync(0)
    wall: Ns = 0
    far.receive(link.take())
    link.receive(far.say(), wall)
    for n in range(300):
        link.send(bytes([n % 256]))
        link.flush(wall)
        far.receive(link.take())
        link.receive(far.say(), wall)
        wall += MS
    assert (link.retransmitted, link.refused) == (0, 0)
    assert far.taken[-300:] == [bytes([n % 256]) for n in range(300)]


def test_a_message_longer_than_a_block_is_an_error() -> None:
    link, far = Link(), Echo(0)
    link.sync(0)
    far.receive(link.take())
    link.receive(far.say(), 0)
    link.send(bytes(60))
    with pytest.raises(ValueError, match="longer than a block"):
        link.flush(0)


@settings(max_examples=examples(30))
@given(st.lists(st.binary(max_size=80), max_size=20))
def test_whatever_comes_from_a_board_breaks_nothing(pieces: list[bytes]) -> None:
    link = Link()
    link.sync(0)
    for n, piece in enumerate(pieces):
        link.receive(piece, n * MS)
        link.due(n * 50 * MS)
