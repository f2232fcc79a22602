"""Instructions in memory, byte lengths, and the language (pages 33 to 59)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.assembler import AssemblyFailed, ImageError, assemble, disassemble
from detent.controllers.dcb274 import commands, program
from detent.controllers.dcb274.commands import ROWS, TABLE, Instruction, Op, Refusal
from detent.controllers.dcb274.memory import FACTORY_PROGRAM

LENGTHS = {4: "+-ROJL", 5: "Tik", 3: "IVMFKBWGY", 2: "ADHblw]Z|E", 1: "@^", 0: "CPQSX[\\"}


@pytest.mark.parametrize("length", LENGTHS)
def test_byte_lengths_are_those_of_the_reference_but_for_z_t_and_w(length: int) -> None:
    assert sorted(row.letter for row in TABLE if row.length == length) == sorted(LENGTHS[length])


def test_op_codes_are_the_ascii_code_less_40h_as_the_example_on_page_56_proves() -> None:
    assert program.encode(Instruction(Op.SOFT_STOP)) == b"\x00"
    assert program.encode(commands.parse("+ 1001")) == b"\xeb\xe9\x03\x00"
    assert program.encode(commands.parse("R -2")) == b"\x12\xfe\xff\xff"
    assert program.encode(commands.parse("G 5 1")) == b"\x07\x05\x80"
    assert program.encode(commands.parse("M -1000")) == b"\x0d\x7c\x80"


def test_the_factory_program_has_its_g_at_16() -> None:
    assert FACTORY_PROGRAM.index(0x07, 14) == 16
    assert len(FACTORY_PROGRAM) == 19


def stored() -> st.SearchStrategy[Instruction]:
    def made(op: Op, numbers: list[int]) -> Instruction | None:
        try:
            return commands.parse(op.value + " ".join(map(str, numbers)))
        except Refusal:
            return None

    ops = st.sampled_from([row.op for row in TABLE if row.stored])
    numbers = st.lists(st.integers(-9, 300) | st.integers(-8_388_608, 16_777_216), max_size=2)
    return st.builds(made, ops, numbers).filter(lambda found: found is not None)  # type: ignore[return-value]


@given(stored())
def test_encoding_spelling_and_parsing_are_inverse(instruction: Instruction) -> None:
    code = program.encode(instruction)
    assert len(code) == ROWS[instruction.op].length
    assert program.decode(code) == instruction
    assert commands.parse(commands.spell(instruction)) == instruction


@given(st.binary(max_size=12))
def test_any_bytes_are_an_instruction_or_none(data: bytes) -> None:
    instruction = program.decode(data)
    if instruction is not None:
        assert commands.spell(instruction)


@given(st.text(max_size=20))
def test_any_line_is_a_command_or_refused(text: str) -> None:
    try:
        instruction = commands.parse(text)
    except Refusal:
        return
    assert commands.parse(commands.spell(instruction)) == instruction


def test_labels_stand_for_the_addresses_of_g_j_l_and_t() -> None:
    source = "start: + 10\nJ start 3\nT 5 trip\nwait: L wait 4\nG start\nP 128\ntrip: A 8\n"
    found = assemble(program.language(), source)
    assert found.commands == ("+ 10", "J 0 3", "T 5 128", "L 13 4", "G 0 0", "A 8")
    assert found.base == 0
    assert len(found.image) == 130


def test_an_image_comes_back_as_source_that_gives_it_again() -> None:
    language = program.language()
    image = assemble(language, "start: + 10\nJ start 3\nT 5 trip\nP 128\ntrip: A 8\nP 300\nM -900\nG 2048").image
    source = disassemble(language, image)
    assert "P 128\nat_128:\nA 8\n" in source
    assert assemble(language, source).image == image


@pytest.mark.parametrize(
    ("source", "words"),
    [("P 193", "0 to 192"), ("P 190\n+ 5", "too long"), ("X", "not stored"), ("J nowhere 3", "no label"),
     ("K 5", "needs 2"),
     ("G 200", "0 to 192"), ("U 5", "no command")],
)  # fmt: skip
def test_what_is_no_program_is_refused_with_a_reason(source: str, words: str) -> None:
    with pytest.raises(AssemblyFailed, match=words):
        assemble(program.language(), source)


@pytest.mark.parametrize("image", [b"\x15", b"\x08\x09", b"\xeb\x01", b"\x0d\x01\x00"])
def test_what_no_command_gives_is_no_image(image: bytes) -> None:
    with pytest.raises(ImageError):
        disassemble(program.language(), image)
