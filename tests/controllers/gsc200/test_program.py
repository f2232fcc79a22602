"""A program in memory: 119 bytes, addresses, and the image that goes to the EEPROM."""

import copy
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.controllers.gsc200.commands import Instruction, Op, parse
from detent.controllers.gsc200.program import (
    CAPACITY,
    Program,
    ProgramDamaged,
    ProgramFull,
    empty,
    from_image,
    from_instructions,
)

C200, C200S = "gs-c200", "gs-c200s"


def program(model: str, *texts: str) -> Program:
    return from_instructions(model, (parse(model, text) for text in texts))


def test_a_program_starts_at_memory_address_0_and_grows_by_the_byte_lengths() -> None:
    """Command description, last page: "adding, for each program instruction, the proper bytes length"."""
    held = program(C200, "S10", "W1", "+250", "L0")
    assert [step.address for step in held.steps] == [0, 4, 6, 10]
    assert [step.next for step in held.steps] == [4, 6, 10, 12]
    assert [step.text for step in held.steps] == ["S10", "W1", "+250", "L0"]
    assert held.size == 12


def test_only_the_start_of_an_instruction_can_be_looked_up() -> None:
    held = program(C200, "S10", "W1")
    assert held.at(4) == held.steps[1]
    assert [held.at(address) for address in (1, 3, 5, 6, -1, 118)] == [None] * 6


def test_the_memory_takes_119_bytes_and_then_overflows() -> None:
    """The program storage area: "a total of 119 memory locations"; error 3, storage capacity overflow."""
    assert CAPACITY == 119
    held = program(C200, *["+1"] * 29, "A1")  # 118 bytes
    assert held.size == 118
    for text in ("A1", "+1"):
        with pytest.raises(ProgramFull, match="118 of 119 bytes are used"):
            held.with_instruction(parse(C200, text))


def test_a_program_is_left_alone_by_a_longer_one_and_by_copying() -> None:
    held = program(C200, "S10")
    longer = held.with_instruction(parse(C200, "A1"))
    assert held.size == 4
    assert longer.size == 6
    assert copy.copy(held) is held
    assert copy.deepcopy(held) is held
    assert program(C200, "S10") == held


def test_what_is_not_stored_is_no_part_of_a_program() -> None:
    """Entry Ix: immediate for the GS-C200."""
    with pytest.raises(ValueError, match="GS-C200 does not store I"):
        empty(C200).with_instruction(Instruction(Op.INITIALIZE, 3))
    with pytest.raises(ValueError, match="no command JUMP"):
        empty(C200).with_instruction(Instruction(Op.JUMP, 3))
    with pytest.raises(ValueError, match="1 to 3"):
        empty(C200).with_instruction(Instruction(Op.WAIT, 4))
    with pytest.raises(ValueError, match="choose gs-c200"):
        empty("gs-c300")


def test_the_image_is_our_own_encoding_with_the_lengths_of_the_sheet() -> None:
    held = program(C200S, "S10", "A2", "-2", "G-8388608", "g-3", "jc5,4", "j0", "f+1", "L255")
    assert held.image().hex(" ") == (
        "53 0a 00 00  41 02  2b fe ff ff  47 00 00 80  67 ff ff 03  85 04  6a 00  66 01 00 00  4c ff"
    ).replace("  ", " ")
    assert program(C200, "G9999999").image().hex() == "477f9698"


def test_the_empty_program_has_an_empty_image() -> None:
    assert empty(C200).image() == b""
    assert from_image(C200, b"") == empty(C200)


@pytest.mark.parametrize(
    ("model", "image", "complaint"),
    [
        (C200, "00", "byte 0 holds 00h, which is no op-code"),
        (C200, "4101 ff", "byte 2 holds FFh, which is no op-code"),
        (C200, "4101 6a00", "byte 2 holds 6Ah, j, which the GS-C200S stores and the GS-C200 does not"),
        (C200, "4903", "byte 0 holds 49h, I, which the GS-C200S stores"),
        (C200, "8000", "byte 0 holds 80h, jc, which the GS-C200S stores"),
        (C200, "4104", "byte 0: A takes an output, 1 to 3, not the bytes 04"),
        (C200, "41", "byte 0: the image ends inside A"),
        (C200, "2b0000", "byte 0: the image ends inside ±"),
        (C200, "2b000000", "and not 0, not the bytes 00 00 00"),
        (C200, "47ffffff", "byte 0: G takes a position, 0 to 9999999"),
        (C200, "67020000", "byte 0: G takes a direction"),
        (C200, "67010004", "byte 0: G takes a direction"),
        (C200S, "6a77", "byte 0: j takes an address, 0 to 118, not the bytes 77"),
        (C200S, "8577", "byte 0: jc takes"),
        (C200S, "45", "byte 0 holds 45h, which is no op-code"),
        (C200, "4101" * 60, "120 bytes: the memory has 119"),
    ],
)
def test_a_damaged_image_is_refused_with_the_byte_and_the_reason(model: str, image: str, complaint: str) -> None:
    with pytest.raises(ProgramDamaged) as caught:
        from_image(model, bytes.fromhex(image))
    assert complaint in str(caught.value)


_PIECES = st.tuples(
    st.sampled_from([*b"ACDfGgIjLRSTUW+EP", *range(0x7F, 0x8A)]),
    st.sampled_from([b"\x01", b"\x02", b"\x00", b"\x77", b"\x03\x00\x00", b"\xff\xff\x00", b"\x01\x00\x02"])
    | st.binary(min_size=1, max_size=3),
).map(lambda piece: bytes([piece[0]]) + piece[1])


@given(
    st.sampled_from([C200, C200S]),
    st.binary(max_size=130) | st.lists(_PIECES, max_size=6).map(b"".join),
)
def test_any_bytes_are_a_program_with_just_this_image_or_damaged(model: str, image: bytes) -> None:
    try:
        held = from_image(model, image)
    except ProgramDamaged:
        return
    assert held.image() == image
    assert held.size == len(image)
    assert held == from_instructions(model, (step.instruction for step in held.steps))
    assert all(before.next == after.address for before, after in pairwise(held.steps))
