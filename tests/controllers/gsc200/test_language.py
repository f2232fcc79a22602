"""S.I.M.P.L.E. source through the assembler: the datasheet's programs, the errors, the way back."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.assembler import Assembly, AssemblyFailed, assemble, disassemble, listing
from detent.controllers.gsc200.arguments import Condition, Direction, Number, Signed
from detent.controllers.gsc200.commands import Instruction, Row, rows
from detent.controllers.gsc200.firmware import GsC200
from detent.controllers.gsc200.program import CAPACITY, empty, from_image, from_instructions, language
from detent.uart import Char, Sent

C200, C200S = "gs-c200", "gs-c200s"

EXAMPLE_1 = "S10 T100 R50 G500000".split()  # noqa: SIM905 - as the sheet lists it
BAR = "S10 T100 R40 W1 +250 L0 A2 D1 C2 W2 +120 L4 A2 C2 W2 +250 A1 D5 C1".split()  # noqa: SIM905 - as the sheet lists it
DRILL = "S15 T200 R25 W1 W2 A2 +150 D1 G0 C2 A1 D1 C1".split()  # noqa: SIM905 - as the sheet lists it
FIVE_HOLES = "S15 T200 R25 W1 L0 W2 A2 +150 D1 G0 C2 A1 D1 C1 L5".split()  # noqa: SIM905 - as the sheet lists it


def built(model: str, *lines: str) -> Assembly[Instruction]:
    return assemble(language(model), "\n".join(lines))


def complaints(model: str, *lines: str) -> list[tuple[int, int, str]]:
    with pytest.raises(AssemblyFailed) as caught:
        built(model, *lines)
    return [tuple(error) for error in caught.value.errors]


@pytest.mark.parametrize(
    ("program", "size"),
    [(EXAMPLE_1, 16), (BAR, 50), (DRILL, 36), (BAR + DRILL, 86), (FIVE_HOLES, 40)],
    ids=["example 1", "bar positioning", "drill control", "both in one memory", "drill for five holes"],
)
def test_the_datasheet_programs_take_the_memory_it_says(program: list[str], size: int) -> None:
    """Program examples: "the bar positioning uses 50 memory locations ... drill control needs only 36"."""
    assembly = built(C200, *program)
    assert assembly.used == len(assembly.image) == size
    assert assembly.commands == tuple(program)
    assert from_image(C200, assembly.image) == from_instructions(C200, assembly.instructions)


def test_the_menu_of_the_conditional_jump_entry_finds_its_segments_by_name() -> None:
    """Entry jcv,y: jc0,40 jc1,52 jc2,74, a segmented program."""
    assembly = built(
        C200S, "menu: jc0,drill", "jc 1 , mill", "  j menu", "drill: +100", " j menu", "mill:", "-100", "j menu"
    )
    assert assembly.symbols == {"menu": 0, "drill": 6, "mill": 12}
    assert assembly.commands == ("jc0,6", "jc1,12", "j0", "+100", "j0", "-100", "j0")


def test_source_may_have_blanks_comments_and_small_letters_that_mean_nothing_else() -> None:
    lines = ("; drill", "", "s 10 ; slow", "\tt200", "lo", "+ 150", "d1", "g0", "c2", "l5")
    assert built(C200, *lines[:7], *lines[8:]).commands == ("S10", "T200", "L0", "+150", "D1", "C2", "L5")
    assert complaints(C200, *lines) == [(8, 1, "g is a command of the GS-C200S, not of the GS-C200; did you mean G0?")]


def test_goto_velocity_force_and_feedback_keep_their_own_case() -> None:
    """Entries Gs, gs, F, fs: the case is the difference."""
    assert built(C200S, "G + 2", "g + 2", "f - 5", "G 7").commands == ("G+2", "g+2", "f-5", "G+7")
    assert "F acts at once" in complaints(C200S, "F")[0][2]


@pytest.mark.parametrize("jump", ["j start", "jstart", "J start", "j  start", "j 0", "j0"])
def test_a_jump_takes_a_label_or_a_number(jump: str) -> None:
    assert built(C200S, "start: W1", jump).commands == ("W1", "j0")


def test_a_label_that_makes_another_command_is_explained() -> None:
    (error,) = complaints(C200S, "cut: W1", "jcut")
    assert error[:2] == (2, 3)
    assert "did you mean j cut?" in error[2]


def test_every_error_of_a_source_is_reported_with_its_place_and_remedy() -> None:
    assert complaints(
        C200S,
        "start: S10",
        " T2000",
        "drill",
        "j strat",
        "E",
        "start: W1",
        "A2 A3",
        "jc9,start",
        "P",
        "2x: C1",
        "+1; far",
        "~1",
    ) == [
        (2, 3, "T takes a rate in tens of steps a second, 1 to 1000, not '2000'"),
        (3, 2, "D takes tenths of a second, 1 to 255, not 'rill'; if it is a label, write drill:"),
        (4, 3, "no label strat is defined; did you mean start?"),
        (
            5,
            1,
            "E acts at once and is not stored in a program; leave it out: running a program loads and executes it",
        ),
        (6, 1, "label start is defined twice, first on line 1; rename one"),
        (7, 4, "one command a line: put A3 on a line of its own"),
        (
            8,
            3,
            "jc takes the value of the inputs, 0 to 7, a comma and an address, 0 to 118 or a label, not '9,start'",
        ),
        (9, 1, "P is a command of the GS-C200, not of the GS-C200S; did you mean Po?"),
        (10, 1, "'2x' is no name for a label: it takes a letter or _, then letters, figures and _"),
        (12, 1, "'~1' is no command of the GS-C200S"),
    ]


@pytest.mark.parametrize("command", ["E", "F", "H+", "K", "M", "Px", "Po", "Q", "V1", "X", "Z"])
def test_immediate_commands_have_no_place_in_a_program(command: str) -> None:
    """Direct execution commands "are immediately actuated"."""
    ((_, _, message),) = complaints(C200S, command)
    assert "not stored in a program; leave it out" in message


def test_initialize_is_stored_by_the_gs_c200s_only() -> None:
    """Entry Ix."""
    assert built(C200S, "I3").used == 2
    ((_, _, message),) = complaints(C200, "I3")
    assert "not stored in a program by the GS-C200, only by the GS-C200S" in message


def test_a_command_of_the_other_model_is_named_as_such() -> None:
    assert complaints(C200, "W1", "x: j x") == [(2, 4, "j is a command of the GS-C200S, not of the GS-C200")]


def test_jumps_must_end_at_an_instruction() -> None:
    """Command description, last page: "it is mandatory to address the proper memory position"."""
    assert complaints(C200S, "S10", "j 1", "j 99") == [
        (2, 1, "address 1 lies inside the instruction of line 1, which takes bytes 0 to 3; "
               "jump to 0 or use a label"),
        (3, 1, "no instruction starts at address 99: the program ends at 7"),
    ]  # fmt: skip


def test_a_label_behind_the_last_instruction_is_the_end_of_the_program() -> None:
    """The same: a jump must lead to an instruction, and there is none that stops. `L1` there does nothing."""
    menu = built(C200S, "jc7,end", "+50", "j end", "+9", "end:", "done: ; nobody jumps here")
    assert menu.commands == ("jc7,12", "+50", "j12", "+9", "L1")
    assert [(placed.line, placed.address) for placed in menu.placed][-1] == (5, 12)
    assert built(C200S, "+50", "end:").commands == ("+50",)
    program = from_image(C200S, menu.image)
    unit = GsC200(C200S, {"CHS": 0}, line_timing=False)
    unit.power(True, 0)
    unit.load(program.image(), 0, 0)
    for begin, level, position in ((10**9, 1, 0), (11 * 10**9, 0, 50)):
        end = begin + 4 * 10**9
        unit.set_pin("UI1", level, begin)
        unit.start(begin)
        unit.advance(end)
        unit.receive("RXD", [Char(value) for value in b"F\r"], end)
        assert unit.status(end).position == position
        assert unit.answers(bytes(item.char.value for item in unit.drain() if isinstance(item, Sent)))[-1] == "R"


def test_a_program_too_long_says_by_how_much_and_from_which_line() -> None:
    """The program storage area: 119 memory locations."""
    assert complaints(C200, *["+1"] * 31) == [
        (30, 1, "the program is 5 bytes too long: it needs 124 of 119, "
                "and this is the first instruction that does not fit"),
    ]  # fmt: skip
    assert built(C200, *["+1"] * 29, "A1").used == 118


def test_the_listing_shows_addresses_bytes_and_the_total() -> None:
    assembly = built(C200S, "; menu", "start: S10 ; slow", "", "j start")
    assert listing(assembly).splitlines() == [
        "address  bytes  image         source",
        "                              ; menu",
        "      0      4  53 0A 00 00   start: S10 ; slow",
        "",
        "      4      2  6A 00         j start",
        "6 bytes used of 119",
    ]


def test_a_jump_to_nowhere_in_an_image_keeps_its_number_and_says_so() -> None:
    held = from_instructions(C200S, [Instruction(rows(C200S)[0].op, 1)]).image() + b"\x6a\x01\x82\x00"
    assert disassemble(language(C200S), held) == ("at_0:\nA1\nj1  ; no instruction starts at 1\njc2,at_0\n")


def test_a_model_without_this_language_is_refused() -> None:
    with pytest.raises(ValueError, match="gs-c200 or gs-c200s"):
        language("supersigma")


def instructions(row: Row) -> st.SearchStrategy[Instruction]:
    """Any instruction of a row of the table."""
    match row.argument:
        case Condition(states=states, high=high):
            arguments = st.tuples(st.integers(0, high), st.integers(0, states))
        case Direction(inputs=inputs):
            arguments = st.tuples(st.sampled_from([1, -1]), st.integers(0, inputs))
        case Number(low=low, high=high) | Signed(low=low, high=high):
            arguments = st.tuples(st.integers(low, high), st.just(0))
        case _:
            raise AssertionError(row)
    allowed = arguments.filter(lambda pair: row.argument.admits(*pair))
    return allowed.map(lambda pair: Instruction(row.op, *pair))


@st.composite
def sound_programs(draw: st.DrawFn, model: str) -> list[Instruction]:
    """Instructions that fit, with every jump to the start of one of them."""
    stored = [row for row in rows(model) if row.stored]
    program = empty(model)
    for _ in range(draw(st.integers(0, 60))):
        instruction = draw(st.sampled_from(stored).flatmap(instructions))
        if program.size + 4 > CAPACITY:
            break
        program = program.with_instruction(instruction)
    starts = [step.address for step in program.steps]
    addressed = {row.op for row in stored if row.argument.address}
    return [
        step.instruction._replace(value=draw(st.sampled_from(starts)))
        if step.instruction.op in addressed
        else step.instruction
        for step in program.steps
    ]


@given(st.sampled_from([C200, C200S]), st.data())
def test_source_image_source_image_is_the_identity(model: str, data: st.DataObject) -> None:
    program = from_instructions(model, data.draw(sound_programs(model)))
    source = disassemble(language(model), program.image())
    assembly = assemble(language(model), source)
    assert assembly.image == program.image()
    assert from_image(model, assembly.image) == program
    assert disassemble(language(model), assembly.image) == source
    plain = assemble(language(model), "\n".join(assembly.commands))  # as on the wire: no labels left
    assert plain.image == program.image()


@given(st.sampled_from([C200, C200S]), st.text(alphabet="AGgjc,Lo0123456789+-;: \n\tEfPxß", max_size=60))
def test_any_source_assembles_or_fails_with_places_inside_it(model: str, source: str) -> None:
    try:
        assembly = assemble(language(model), source)
    except AssemblyFailed as error:
        failed = error
    else:
        assert from_image(model, assembly.image).image() == assembly.image
        return
    assert failed.errors
    for line, column, message in failed.errors:
        assert 1 <= column <= len(failed.lines[line - 1]) + 1  # behind the end: something is missing
        assert message
