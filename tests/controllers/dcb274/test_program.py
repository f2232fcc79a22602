"""Instructions in memory, byte lengths, and the language (pages 33 to 59)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.controllers.dcb274.bench_unit import Bench

from detent.assembler import AssemblyFailed, ImageError, assemble, disassemble
from detent.controllers.dcb274 import commands, program
from detent.controllers.dcb274.commands import ROWS, TABLE, Instruction, Op, Refusal
from detent.controllers.dcb274.firmware import Dcb274
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


def sources() -> st.SearchStrategy[str]:
    """Programs in one place or several, written as people write them."""
    parts = st.lists(
        st.tuples(st.sampled_from(["", "P 0", "P 100", "P 128", "P 300", "P 1600"]), st.lists(stored(), max_size=5),
                  st.booleans()),
        min_size=1, max_size=4, unique_by=lambda part: part[0],
    )  # fmt: skip

    def written(found: list[tuple[str, list[Instruction], bool]]) -> str:
        lines: list[str] = []
        for start, instructions, ended in found:
            if start or not lines:
                lines += [start] if start else []
                lines += map(commands.spell, instructions)
                lines += ["P"] if ended and (start or instructions) else []
        return "\n".join(lines)

    return parts.map(written)


@given(source=sources())
def test_what_is_printed_is_taken_back_at_the_same_addresses(source: str) -> None:
    """Page 47: P says where a program stands. Listing, commands, image and disassembly: one program."""
    language = program.language()
    try:
        made = assemble(language, source)
    except AssemblyFailed:
        return  # parts that lie on each other, or reach into the parameters
    again = assemble(language, "\n".join(made.typed))
    assert [(p.address, p.code) for p in sorted(again.placed)] == [(p.address, p.code) for p in sorted(made.placed)]
    assert again.whole == made.whole
    back = assemble(language, disassemble(language, made.whole))
    assert (back.whole, back.base) == (made.whole, made.base) or not made.placed
    for each in made.placed:
        assert made.whole[each.address : each.address + len(each.code)] == each.code


def test_the_commands_of_parts_are_those_that_a_terminal_takes() -> None:
    """Page 47: the second P ends program mode, and the next one begins it elsewhere."""
    made = assemble(program.language(), "A 8\nP\nP 128\nt: A 16\nP\nP 300\nT 50 t\n")
    assert made.typed == ("A 8", "P", "P 128", "A 16", "P", "P 300", "T 50 128")
    assert assemble(program.language(), "P 128\nA 8").typed == ("P 128", "A 8")


@pytest.mark.parametrize(
    ("source", "line"),
    [("z: A 8\nT 5 z", 2), ("T 5 far\nP 300\nfar: A 8", 1), ("T 5 256", 1), ("T 5 200", 1)],
)
def test_a_trip_routine_that_stands_where_no_trip_finds_it_is_refused_with_its_line(source: str, line: int) -> None:
    """Page 49: "the specified address between 1 and 255"; "use 0 (zero) as the address parameter" turns it off."""
    with pytest.raises(AssemblyFailed) as failed:
        assemble(program.language(), source)
    (error,) = failed.value.errors
    assert error.line == line
    assert "1 to 192" in error.message or "0 to 192" in error.message


def test_an_instruction_behind_the_closing_p_belongs_to_no_program() -> None:
    """Page 47: the second P returns to command mode, where it would be executed at once."""
    language = program.language()
    with pytest.raises(AssemblyFailed, match=r"program:4:1.*behind the end of a part, on line 3"):
        assemble(language, "P 0\nA 8\nP\nA 16")
    assert assemble(language, "P\nA 8\nP\nP 2\nA 16").commands == ("A 8", "A 16")


@given(stored())
def test_a_unit_lists_and_stores_again_what_it_holds(instruction: Instruction) -> None:
    """Pages 47 and 48: program mode and Q."""
    text = commands.spell(instruction)
    if len(text) > 15:
        return
    bench = Bench(execution_times=False)
    bench.do("P 300", text, "P", wait=5_000_000)
    code = bench.unit.memory.read(300, 6)
    listed = bench.do("Q 300", wait=5_000_000).split("\r\n")
    assert listed[1] == f"300 {text}"
    bench.do("P 300", listed[1].partition(" ")[2], "P", wait=5_000_000)
    assert bench.unit.memory.read(300, 6) == code


def test_what_is_left_of_an_older_program_in_a_memory_is_left_out_and_said():
    memory = bytearray(Dcb274().kept_memory())
    memory[:5] = b"\x1d\x01\x1d\x00\xff"  # ] 1 and ] 0 over the program of page 39
    rest = FACTORY_PROGRAM[5:].hex(" ").upper()
    source = disassemble(program.language(), bytes(memory))
    assert source.splitlines() == ["] 1", "] 0", f"; left of an older program at 5, behind an end mark: {rest}"]
    memory[0] = 0x64
    with pytest.raises(ImageError, match="byte 0 holds 64h"):
        disassemble(program.language(), bytes(memory))


def test_page_47_the_end_mark_of_a_part_may_not_stand_in_one_before_it():
    with pytest.raises(AssemblyFailed, match="end mark of this part would stand at 2, where line 2 has put"):
        assemble(program.language(), "P 2\nA 16\nP\nP 0\nA 8\nP\n")
    assert assemble(program.language(), "P 0\nA 8\nP\nP 2\nA 16\nP\n").typed == ("A 8", "A 16")  # it is written over


def test_a_program_that_is_put_into_the_eeprom_has_an_end_mark_behind_it():
    unit = Dcb274()
    unit.restore(b"\x01\x08\x01\x10")
    assert unit.kept_memory()[:6] == b"\x01\x08\x01\x10\xffd"
