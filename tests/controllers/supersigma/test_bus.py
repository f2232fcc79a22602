"""Law: whatever came over the bus before, behind a silence the next messages do exactly what they say.

Cassinis, table 1: a message is two to five bytes, and nothing marks where it begins. How a drive that has lost its
place finds it again is Detent's own; the paper's protocol "is given [1,3]".
"""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.axis import MotionStarted
from detent.controllers.device import Output, Refused
from detent.controllers.supersigma import commands, link
from detent.controllers.supersigma.commands import Command, Op
from detent.controllers.supersigma.firmware import Supersigma
from detent.lines.microbus import LET_GO
from detent.ticks import MS, SECOND, US, Ns
from detent.uart import SOUND, Char, Sent

BYTE: Ns = 50 * US
REST: Ns = 700 * SECOND  # more than 65 535 steps take at the lowest speed
GARBAGE = st.lists(st.sampled_from([0, 1, 2, 3, 5, 0x81, 0x83, 0xFF]) | st.integers(0, 255), max_size=12).map(bytes)
COMMANDS = st.lists(
    st.builds(Command, st.sampled_from([Op.MOVE, Op.CONSTANT, Op.LIMIT]), st.sampled_from([1, -1]),
              st.integers(0, 300), st.integers(0, 20))
    | st.sampled_from([Command(Op.STATUS), Command(Op.STOP), Command(Op.EMERGENCY), Command(Op.ORIGINATE)]),
    min_size=1, max_size=4,
)  # fmt: skip


class Bench:
    """A drive, and the bytes that reach it."""

    def __init__(self, number: int = 1) -> None:
        self.drive = Supersigma(number=number)
        self.now: Ns = 0
        self.out: list[Output] = []
        self.drive.power(True, 0)

    def wait(self, span: Ns) -> None:
        self.now += span
        while (at := self.drive.next_deadline()) is not None and at <= self.now:
            self.drive.advance(at)
        self.drive.advance(self.now)
        self.out += self.drive.drain()

    def hear(self, *chars: Char) -> None:
        for char in chars:
            self.wait(BYTE)
            self.drive.receive("BUS", [char], self.now)
        self.out += self.drive.drain()

    def settle(self) -> None:
        """Let everything that is under way come to its end, with the limit switch met if it is looked for."""
        for level in (0, 1):
            self.wait(SECOND)
            self.drive.set_pin("RAIL", level, self.now)
        self.wait(REST)
        assert self.drive.status(self.now).state == "ready"

    def say(self, command: Command) -> None:
        self.hear(*(SOUND[value] for value in commands.message(self.drive.number, command)))

    def done(self, messages: list[Command]) -> list[tuple[object, ...]]:
        """What comes of messages, a second apart, in times from here on."""
        begin, shaft = self.now, self.drive.status(self.now).position
        self.out.clear()
        for command in messages:
            self.say(command)
            self.wait(SECOND)
        answers = [(item.at - begin, item.char.value) for item in self.out if isinstance(item, Sent)]
        moves = [(m.at - begin, m.first, m.direction) for m in self.out if isinstance(m, MotionStarted)]
        refused = [(item.at - begin, item.reason) for item in self.out if isinstance(item, Refused)]
        return [*answers, *moves, *refused, (self.drive.status(self.now).position - shaft,)]


def originated() -> Bench:
    """A drive that is at its origin."""
    bench = Bench()
    bench.say(Command(Op.ORIGINATE))
    bench.settle()
    return bench


def known(bench: Bench) -> Bench:
    """The same with flags and steps as they are behind an accepted move."""
    bench.say(Command(Op.ORIGINATE))
    bench.settle()
    bench.say(Command(Op.CONSTANT, 1, 3, 10))
    bench.wait(SECOND)
    return bench


def check_silence(garbage: bytes, messages: list[Command]) -> None:
    """Whatever came before; what it has set in motion has ended."""
    used = Bench()
    used.hear(*(SOUND[value] for value in garbage))
    used.wait(link.SILENCE)
    used.settle()
    assert known(used).done(messages) == known(Bench()).done(messages)


def check_half(command: Command, cut: int, messages: list[Command], *, lets_go: bool) -> None:
    """Half a message, and at once those of the next program."""
    used, fresh = originated(), originated()
    half = commands.message(1, command)
    used.hear(*(SOUND[value] for value in half[: min(cut, len(half) - 1)]))
    if lets_go:
        used.hear(LET_GO)
    else:
        used.wait(link.SILENCE)
    assert used.done(messages) == fresh.done(messages)


@given(GARBAGE, COMMANDS)
@settings(max_examples=examples(60))
def test_behind_a_silence_every_message_does_what_it_says(garbage: bytes, messages: list[Command]) -> None:
    check_silence(garbage, messages)


@given(COMMANDS, st.integers(1, 4), COMMANDS, st.booleans())
@settings(max_examples=examples(60))
def test_half_a_message_changes_nothing_of_what_follows_a_silence_or_another_program(
    half: list[Command], cut: int, messages: list[Command], lets_go: bool
) -> None:
    check_half(half[0], cut, messages, lets_go=lets_go)


@pytest.mark.slow
@given(GARBAGE, COMMANDS)
@settings(max_examples=10_000)
def test_behind_a_silence_every_message_does_what_it_says_at_length(garbage: bytes, messages: list[Command]) -> None:
    check_silence(garbage, messages)


def test_half_a_message_is_dropped_after_a_silence_and_the_drive_that_it_named_says_so() -> None:
    named, other = Bench(1), Bench(2)
    for bench in (named, other):
        bench.hear(SOUND[1], SOUND[1], SOUND[0x13])
        bench.wait(99 * MS)
        assert not [item for item in bench.out if isinstance(item, Refused)]
        bench.wait(1 * MS)
    told = [item for item in named.out if isinstance(item, Refused)]
    assert [(item.at, item.frame) for item in told] == [(3 * BYTE + link.SILENCE, "01 01 13")]
    assert told[0].reason == "no byte came for 100 ms: half a message is dropped"
    assert not [item for item in other.out if isinstance(item, Refused)]
    assert named.drive.registers(named.now)["flags"] == "none"


def test_a_pause_shorter_than_the_silence_breaks_no_message() -> None:
    bench = Bench()
    for value in (1, 1, 0, 9):
        bench.wait(link.SILENCE - BYTE - 1)
        bench.hear(SOUND[value])
    bench.wait(SECOND)
    assert bench.drive.status(bench.now).position == 9


def test_half_a_message_is_dropped_when_the_ccu_lets_go() -> None:
    bench = Bench()
    bench.hear(SOUND[1], SOUND[3], SOUND[0x13], LET_GO, SOUND[1], SOUND[5])
    bench.wait(SECOND)
    assert [item.char.value for item in bench.out if isinstance(item, Sent)] == [0, 0, 0]
    assert bench.drive.status(bench.now).pulses == 0
