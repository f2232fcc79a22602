"""The assembler with a language of its own, one that has what no GS-C200 has: a start, two areas, open jumps."""

from typing import NamedTuple

import pytest

from detent.assembler import (
    Assembly,
    AssemblyFailed,
    ImageError,
    Statement,
    StatementError,
    assemble,
    disassemble,
    listing,
)


class Word(NamedTuple):
    """`w N`: two bytes, `g N`: three bytes, leads to N."""

    letter: str
    number: int


class Toy:
    """Programs at 0-9 and 20-39, started anywhere by `p N`; FFh between the parts."""

    model = "toy"
    comment = "#"
    areas = (range(10), range(20, 40))
    blank = 0xFF

    def __init__(self, closed: bool = False) -> None:
        self.closed = closed

    def parse(self, text: str) -> Statement[Word]:
        letter, number = (*text.split(maxsplit=1), "")[:2]
        if letter not in ("w", "g", "p"):
            raise StatementError(f"{letter} is neither w, g nor p")
        if letter == "g" and number.isidentifier():
            return Statement(Word("g", 0), number, text.index(number))
        if not number.isdigit():
            raise StatementError("a number is missing", len(letter))
        if letter == "p":
            return Statement(None, origin=int(number))
        return Statement(Word(letter, int(number)))

    def length(self, instruction: Word) -> int:
        return 2 if instruction.letter == "w" else 3

    def target(self, instruction: Word) -> int | None:
        return instruction.number if instruction.letter == "g" else None

    def with_target(self, instruction: Word, address: int) -> Word:
        return instruction._replace(number=address)

    def encode(self, instruction: Word) -> bytes:
        return bytes([ord(instruction.letter), *[instruction.number] * (self.length(instruction) - 1)])

    def decode(self, image: bytes) -> list[tuple[int, Word]]:
        found, address = [], 0
        while address < len(image):
            if chr(image[address]) not in "wg":
                raise ImageError(f"byte {address} is no letter")
            found.append((address, Word(chr(image[address]), image[address + 1])))
            address += self.length(found[-1][1])
        return found

    def spell(self, instruction: Word, label: str | None = None) -> str:
        return f"{instruction.letter} {label or instruction.number}"


def built(*lines: str, closed: bool = False) -> Assembly[Word]:
    return assemble(Toy(closed), "\n".join(lines))


def complaints(*lines: str, closed: bool = False) -> list[tuple[int, int, str]]:
    with pytest.raises(AssemblyFailed) as caught:
        built(*lines, closed=closed)
    return [tuple(error) for error in caught.value.errors]


def test_instructions_follow_each_other_from_the_first_address() -> None:
    assembly = built("w 1", "g 0", "w 2")
    assert [(placed.address, placed.line, placed.column) for placed in assembly.placed] == [
        (0, 1, 1), (2, 2, 1), (5, 3, 1),
    ]  # fmt: skip
    assert assembly.instructions == (Word("w", 1), Word("g", 0), Word("w", 2))
    assert assembly.image == b"w\x01g\x00\x00w\x02"
    assert (assembly.used, assembly.capacity, assembly.base) == (7, 30, 0)


def test_labels_stand_alone_or_before_an_instruction_and_may_be_used_before_they_are_defined() -> None:
    assembly = built("first:  # the start", "  g last", "a: b: w 1", "last :", "", "g first")
    assert assembly.symbols == {"first": 0, "a": 3, "b": 3, "last": 5}
    assert assembly.commands == ("g 5", "w 1", "g 0")


def test_a_program_may_start_anywhere_and_have_parts() -> None:
    assembly = built("w 1", "here: p 20", "g here", "p 30", "w 2")
    assert [placed.address for placed in assembly.placed] == [0, 20, 30]
    assert assembly.symbols == {"here": 20}
    assert assembly.image[20:23] == b"g\x14\x14"
    assert assembly.image[2:20] == b"\xff" * 18
    assert len(assembly.image) == 32
    assert built("p 20", "w 1").image == b"w\x01"
    assert built("p 20", "w 1").base == 20


def test_lines_may_end_as_on_any_system_and_be_empty() -> None:
    assert assemble(Toy(), "w 1\r\nw 2\rw 3\n\n").commands == ("w 1", "w 2", "w 3")
    assert assemble(Toy(), "").image == b""
    assert assemble(Toy(), "").used == 0


def test_all_errors_are_told_in_the_order_of_the_lines() -> None:
    assert complaints("g nowhere", "x 1", "w", "a: w 1", "a:", "1a: w 3", "  g aa") == [
        (1, 3, "no label nowhere is defined; write nowhere: before an instruction"),
        (2, 1, "x is neither w, g nor p"),
        (3, 2, "a number is missing"),
        (5, 1, "label a is defined twice, first on line 4; rename one"),
        (6, 1, "'1a' is no name for a label: it takes a letter or _, then letters, figures and _"),
        (7, 5, "no label aa is defined; did you mean a?"),
    ]


def test_a_word_that_is_no_command_may_be_a_label_without_its_colon() -> None:
    assert complaints("start", "w 1") == [
        (1, 1, "start is neither w, g nor p; if it is a label, write start:")
    ]  # fmt: skip


def test_a_part_must_stand_where_programs_may_and_fit() -> None:
    assert complaints("p 15", "w 1", *["p 8", "w 2", "w 3", "w 4"]) == [
        (1, 1, "no program may stand at 15; choose from 0-9, 20-39"),
        (5, 1, "the program is 4 bytes too long: it needs 14 of 10, "
               "and this is the first instruction that does not fit"),
    ]  # fmt: skip
    assert complaints(*["w 1"] * 4, "g 0") == [
        (5, 1, "the program is 1 byte too long: it needs 11 of 10, "
               "and this is the first instruction that does not fit"),
    ]  # fmt: skip


def test_parts_may_not_overlap() -> None:
    assert complaints("w 1", "p 1", "w 2") == [
        (3, 1, "byte 1 already holds the instruction of line 1; choose another start")
    ]


def test_a_jump_into_an_instruction_is_refused_and_one_out_of_the_source_only_if_the_language_is_closed() -> None:
    inside = (2, 1, "address 1 lies inside the instruction of line 1, which takes bytes 0 to 1; "
                    "jump to 0 or use a label")  # fmt: skip
    outside = (3, 1, "no instruction starts at address 33: the program ends at 7")
    behind = (2, 3, "label end stands behind the last instruction, where there is nothing to jump to; "
                    "put an instruction behind it")  # fmt: skip
    assert complaints("w 1", "g 1") == [inside]
    assert built("w 1", "g 33", "end:").commands == ("w 1", "g 33")
    assert built("g end", "end:").commands == ("g 3",)
    assert complaints("w 1", "g 1", "g 33", closed=True) == [inside, outside]
    assert complaints("g 0", "g end", "end:", closed=True) == [behind]


def test_wrong_addresses_are_not_reported_while_a_line_could_not_be_read() -> None:
    assert complaints("?", "w 1", "g 1", closed=True) == [(1, 1, "? is neither w, g nor p")]


def test_the_report_shows_the_line_with_a_caret_under_the_place() -> None:
    with pytest.raises(AssemblyFailed) as caught:
        assemble(Toy(), "w 1\n\tg  foo # x\x07", "toy.prg")
    assert str(caught.value).splitlines() == [
        "toy.prg:2:5: no label foo is defined; write foo: before an instruction",
        "    \tg  foo # x?",
        "    \t   ^",
    ]


def test_the_listing_has_every_line_of_the_source() -> None:
    assert listing(built("# toy", "w 1", "a:", "g a", "")).splitlines() == [
        "address  bytes  image      source",
        "                           # toy",
        "      0      2  77 01      w 1",
        "                           a:",
        "      2      3  67 02 02   g a",
        "5 bytes used of 30",
    ]
    assert listing(built("")).splitlines() == ["address  bytes  image  source", "0 bytes used of 30"]


def test_disassembly_names_what_is_jumped_to() -> None:
    assert disassemble(Toy(), b"w\x01g\x00\x00g\x09\x09") == "at_0:\nw 1\ng at_0\ng 9\n"
    assert disassemble(Toy(closed=True), b"g\x09\x09") == "g 9  # no instruction starts at 9\n"
    with pytest.raises(ImageError, match="byte 2 is no letter"):
        disassemble(Toy(), b"w\x01?")
