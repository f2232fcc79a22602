"""The table of op-codes: lengths, bytes, words (Cassinis, table 1; the codes are ours)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.controllers.supersigma import commands, link
from detent.controllers.supersigma.commands import TABLE, Command, Op
from detent.controllers.supersigma.link import Link
from detent.uart import Char

COMMANDS = st.builds(
    lambda row, direction, steps, speed: Command(
        row.op, direction if row.steps else 1, steps if row.steps else 0, speed if row.speed else 0
    ),
    st.sampled_from(TABLE), st.sampled_from([1, -1]), st.integers(1, 65_535), st.integers(0, 255),
)  # fmt: skip


def test_commands_are_two_to_five_bytes_long() -> None:
    assert {row.op: row.length for row in TABLE} == {
        Op.MOVE: 4, Op.CONSTANT: 5, Op.LIMIT: 5, Op.ORIGINATE: 2, Op.STATUS: 2, Op.STOP: 2, Op.EMERGENCY: 2,
    }  # fmt: skip


def test_an_unknown_op_code_is_a_message_of_two_bytes() -> None:
    known = {row.op.value for row in TABLE}
    for code in range(256):
        if code & 0x7F not in known:
            assert commands.length(code) == 2
            assert commands.parse(bytes([1, code])) is None


def test_bytes_3_and_4_are_the_steps_with_the_more_significant_first_and_byte_5_the_speed() -> None:
    assert commands.parse(bytes([9, 0x82, 0x14, 0x18, 60])) == Command(Op.CONSTANT, -1, 5144, 60)
    assert commands.message(9, Command(Op.CONSTANT, -1, 5144, 60)) == bytes([9, 0x82, 0x14, 0x18, 60])


def test_bit_7_means_nothing_to_commands_without_steps() -> None:
    assert commands.parse(bytes([1, 0x85])) == Command(Op.STATUS)


@given(COMMANDS, st.integers(0, 255))
def test_a_command_is_the_same_in_bytes_and_in_words(command: Command, number: int) -> None:
    data = commands.message(number, command)
    assert data[0] == number
    assert commands.parse(data) == command
    assert commands.read(commands.spell(command)) == command
    assert Link(number).frame(commands.spell(command)) == Link(number).frame(data[1:].hex(" ")) == data


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "'' is no command; write move ±steps, constant ±steps speed"),
        ("go 12", "'go 12' is no command"),
        ("move", "move takes steps with their sign, 1 to 65535, not nothing"),
        ("move 1 2", "move takes steps"),
        ("move far", "not far"),
        ("move 65536", "1 to 65535, not 65536"),
        ("constant 10", "and a speed in units of 100 half steps/s, 1 to 255, not 10"),
        ("limit 10 256", "not 10 256"),
        ("status 1", "status takes nothing, not 1"),
    ],
)
def test_what_cannot_be_a_command_is_refused_with_what_can(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message.replace("±", ".")):
        Link(1).frame(text or "")


@given(st.lists(st.tuples(st.integers(0, 3), COMMANDS), max_size=8))
def test_a_drive_finds_its_messages_among_those_to_others(sent: list[tuple[int, Command]]) -> None:
    receiver = Link(2)
    stream = b"".join(commands.message(number, command) for number, command in sent)
    found = [message for value in stream if (message := receiver.feed(Char(value), 0)) is not None]
    assert [commands.parse(message) for message in found] == [command for number, command in sent if number == 2]


def test_answers_are_told_in_words_and_a_broken_one_in_bytes() -> None:
    assert link.answers(bytes([0x14, 0x18, 0x09, 0, 1, 0x16, 7])) == [
        "5144 steps, moving, originated",
        "1 steps, end of rail, excessive force, refused",
        "07",
    ]


def test_only_status_is_answered() -> None:
    assert [row.word for row in TABLE if link.answered(row.word + " 1" * (row.steps + row.speed))] == ["status"]
    assert link.answered("05")
    assert not link.answered("01")
    assert not link.answered("nonsense")
