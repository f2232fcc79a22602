"""The command table of the GS-C200 and GS-C200S against the datasheet's own tables and entries."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.controllers.gsc200 import commands
from detent.controllers.gsc200.commands import CommandError, Instruction, Op, length, parse, row, rows, spell

C200, C200S = "gs-c200", "gs-c200s"
MODELS = (C200, C200S)

# "S.I.M.P.L.E. Interpreter Command and Functions", column Byte Length, and who has the command
FUNCTION_TABLE = {
    Op.ACTIVATE: (2, MODELS), Op.CLEAR: (2, MODELS), Op.DELAY: (2, MODELS), Op.EXECUTE: (0, MODELS),
    Op.FEEDBACK: (0, MODELS), Op.FORCE: (4, (C200S,)), Op.GOTO: (4, MODELS), Op.VELOCITY: (4, MODELS),
    Op.HOME: (0, MODELS), Op.INITIALIZE: (2, MODELS), Op.JUMP: (2, (C200S,)), Op.JUMP_IF: (2, (C200S,)),
    Op.KILL: (0, MODELS), Op.LOOP: (2, MODELS), Op.MEMORY: (0, MODELS), Op.PROGRAM: (0, MODELS),
    Op.EXIT: (0, (C200S,)), Op.QUERY: (0, MODELS), Op.RAMP: (4, MODELS), Op.START_STOP: (4, MODELS),
    Op.TOP: (4, MODELS), Op.UNTIL: (2, MODELS), Op.VERIFY: (0, MODELS), Op.EXCHANGE: (0, MODELS),
    Op.WAIT: (2, MODELS), Op.ZERO: (0, MODELS), Op.MOVE: (4, MODELS),
}  # fmt: skip


def refusal(model: str, text: str) -> CommandError:
    with pytest.raises(CommandError) as caught:
        parse(model, text)
    return caught.value


@pytest.mark.parametrize(("model", "count"), [(C200, 25), (C200S, 29)])
def test_the_instruction_sets_comprise_25_and_29_different_commands(model: str, count: int) -> None:
    """Description, "The instruction sets comprise respectively 25 (GS-C200) and 29 (GS-C200S)"."""
    forms = [form for entry in rows(model) for form in entry.forms]
    assert len(forms) == len(set(forms)) == count


@pytest.mark.parametrize("op", Op)
def test_byte_lengths_and_models_are_those_of_the_function_table(op: Op) -> None:
    """Function table."""
    bytes_taken, models = FUNCTION_TABLE[op]
    assert length(Instruction(op)) == bytes_taken
    assert tuple(model for model in MODELS if op in [entry.op for entry in rows(model)]) == models


def test_the_gs_c200_does_not_store_initialize_and_the_gs_c200s_does() -> None:
    """Entry Ix: "immediate execution type for the GS-C200 ... delayed/immediate ... for the GS-C200S"."""
    assert not row(C200, Op.INITIALIZE).stores(C200)
    assert row(C200S, Op.INITIALIZE).stores(C200S)
    assert row(C200, Op.INITIALIZE).use.type == "immediate"
    assert row(C200S, Op.INITIALIZE).use.type == "delayed/immediate"


@pytest.mark.parametrize("model", MODELS)
def test_while_running_only_f_z_and_k_are_accepted(model: str) -> None:
    """Command description, last page: "During the program execution, the GS-C accepts only F, Z and K"."""
    assert {entry.op for entry in rows(model) if entry.running} == {Op.FEEDBACK, Op.ZERO, Op.KILL}


def test_programming_mode_takes_what_it_stores_and_the_ways_out_and_f_m_q_v() -> None:
    """Entries E, Px; Example 1 (M before E)."""
    acting = {model: {entry.op for entry in rows(model) if entry.programming and not entry.stored} for model in MODELS}
    assert acting[C200] == {Op.EXECUTE, Op.FEEDBACK, Op.MEMORY, Op.QUERY, Op.VERIFY}
    assert acting[C200S] == {*acting[C200], Op.EXIT}
    for model in MODELS:
        assert all(entry.programming for entry in rows(model) if entry.stored)


def test_loops_jumps_and_until_have_no_meaning_outside_a_program() -> None:
    """Entries Lo, Ux, ju, jcv,y: delayed, and about the program they stand in."""
    alone = {entry.op for entry in rows(C200S) if entry.stored and not entry.idle}
    assert alone == {Op.LOOP, Op.UNTIL, Op.JUMP, Op.JUMP_IF}


@pytest.mark.parametrize(
    ("text", "instruction"),
    [
        ("A2", Instruction(Op.ACTIVATE, 2)),
        ("C3", Instruction(Op.CLEAR, 3)),
        ("D15", Instruction(Op.DELAY, 15)),
        ("H+", Instruction(Op.HOME, 1)),
        ("H", Instruction(Op.HOME, 1)),  # "The argument can be omitted and in such a case ... H+"
        ("H-", Instruction(Op.HOME, -1)),
        ("I3", Instruction(Op.INITIALIZE, 3)),
        ("L0", Instruction(Op.LOOP, 0)),
        ("Lo", Instruction(Op.LOOP, 0)),
        ("L10", Instruction(Op.LOOP, 10)),
        ("R50", Instruction(Op.RAMP, 50)),
        ("S30", Instruction(Op.START_STOP, 30)),
        ("T300", Instruction(Op.TOP, 300)),
        ("U2", Instruction(Op.UNTIL, 2)),
        ("V1", Instruction(Op.VERIFY, 1)),
        ("V2", Instruction(Op.VERIFY, 2)),
        ("W2", Instruction(Op.WAIT, 2)),
        ("+500000", Instruction(Op.MOVE, 500_000)),
        ("-800", Instruction(Op.MOVE, -800)),
        ("-0800", Instruction(Op.MOVE, -800)),
        ("D015", Instruction(Op.DELAY, 15)),
        *((op.value, Instruction(op)) for op in map(Op, "EFKMQXZ")),
    ],
)
@pytest.mark.parametrize("model", MODELS)
def test_both_models_read_the_examples_of_the_command_description(
    model: str, text: str, instruction: Instruction
) -> None:
    """Command description, the examples of the entries."""
    assert parse(model, text) == instruction


@pytest.mark.parametrize(
    ("model", "text", "instruction"),
    [
        (C200, "G500000", Instruction(Op.GOTO, 500_000)),
        (C200, "G9999999", Instruction(Op.GOTO, 9_999_999)),
        (C200, "G0", Instruction(Op.GOTO)),
        (C200, "G+", Instruction(Op.VELOCITY, 1)),
        (C200, "G-", Instruction(Op.VELOCITY, -1)),
        (C200, "G+2", Instruction(Op.VELOCITY, 1, 2)),
        (C200, "P", Instruction(Op.PROGRAM)),
        (C200S, "G-8388608", Instruction(Op.GOTO, -8_388_608)),
        (C200S, "G+8388607", Instruction(Op.GOTO, 8_388_607)),
        (C200S, "G0", Instruction(Op.GOTO)),
        (C200S, "g+", Instruction(Op.VELOCITY, 1)),
        (C200S, "g-3", Instruction(Op.VELOCITY, -1, 3)),
        (C200S, "f-8388608", Instruction(Op.FORCE, -8_388_608)),
        (C200S, "f+0", Instruction(Op.FORCE)),
        (C200S, "jc0,40", Instruction(Op.JUMP_IF, 40, 0)),
        (C200S, "jc1,52", Instruction(Op.JUMP_IF, 52, 1)),
        (C200S, "Jc7,118", Instruction(Op.JUMP_IF, 118, 7)),
        (C200S, "j0", Instruction(Op.JUMP)),
        (C200S, "J118", Instruction(Op.JUMP, 118)),
        (C200S, "Po", Instruction(Op.PROGRAM)),
        (C200S, "P0", Instruction(Op.PROGRAM)),
        (C200S, "Px", Instruction(Op.EXIT)),
    ],
)
def test_each_model_has_its_own_goto_jumps_and_programming_commands(
    model: str, text: str, instruction: Instruction
) -> None:
    """Entries marked * and **."""
    assert parse(model, text) == instruction


@pytest.mark.parametrize(
    ("model", "text"),
    [
        *((model, text) for model in MODELS for text in ("", "a2", " A2", "3000", "B1", "N", "O5", "Y", "?")),
        *((model, text) for model in MODELS for text in ("e", "h+", "p", "\x00", "\xb2", "\u0661")),
        *((C200, text) for text in ("g+", "g+2", "f+5", "j5", "J5", "jc0,40", "Po", "P0", "Px")),
        *((C200S, text) for text in ("P", "P5")),
    ],
)
def test_unknown_commands_and_those_of_the_other_model_are_error_4(model: str, text: str) -> None:
    """Error code table, 4: "Not allowed or not executable command"."""
    assert refusal(model, text).code == 4


@pytest.mark.parametrize(
    ("model", "text"),
    [
        *((model, text) for model in MODELS for text in ("A", "A0", "A4", "C4", "I0", "I4", "U4", "W0", "V0", "V3")),
        *((model, text) for model in MODELS for text in ("D0", "D256", "L256", "R0", "R1000", "S0", "S1001", "T1001")),
        *((model, text) for model in MODELS for text in ("+", "-", "+0", "+1000000", "--1", "+1 ", "+1\n", "A²")),
        *((model, text) for model in MODELS for text in ("E1", "F0", "K5", "M ", "Q1", "X1", "Z-", "H5", "H+1", "H*")),
        *((model, text) for model in MODELS for text in ("LO", "Lo1", "S1.5", "S+5", "Ao", "D0x10", "D1_0", "G", "Gx")),
        *((C200, text) for text in ("G10000000", "G+12", "G-4", "G+0", "P5", "G5-")),
        *((C200S, text) for text in ("G+8388608", "G-8388609", "G+", "g", "g+4", "g+0", "gt1", "f5", "f", "f+")),
        *((C200S, text) for text in ("j", "j119", "jc", "jc8,0", "jc0,119", "jc0", "jc,5", "j+5", "Po1", "P00", "Px1")),
        (C200, "A" + "1" * 5000),
    ],
)
def test_arguments_missing_not_wanted_or_out_of_limits_are_error_2(model: str, text: str) -> None:
    """Error code table, 2: "Command argument out of limit or not requested"."""
    assert refusal(model, text).code == 2


@pytest.mark.parametrize(
    ("model", "text", "meant"),
    [
        (C200, "a2", "A2"),
        (C200, "3000", "+3000"),  # entry Rvvv prints 3000 for +3000
        (C200, "g+2", "G+2"),
        (C200, "G+12", "G12"),
        (C200, "Po", "P"),
        (C200S, "P", "Po"),
        (C200S, "G+", "g+"),
        (C200S, "JC0,5", "jc0,5"),
    ],
)
def test_a_refusal_names_the_command_that_may_have_been_meant(model: str, text: str, meant: str) -> None:
    assert refusal(model, text).reason.endswith(f"; did you mean {meant}?")


def test_a_refusal_says_what_the_argument_should_be() -> None:
    assert refusal(C200, "A5").reason == "A takes an output, 1 to 3, not '5'"
    assert refusal(C200, "A").reason == "A takes an output, 1 to 3, and there is none"
    assert refusal(C200, "j5").reason == "j is a command of the GS-C200S, not of the GS-C200"


@pytest.mark.parametrize(
    ("model", "text", "listed"),
    [
        (C200, "G0500", "G500"),
        (C200S, "G500", "G+500"),
        (C200S, "G-0", "G+0"),
        (C200S, "J0040", "j40"),
        (C200S, "Jc0,040", "jc0,40"),
        (C200S, "P0", "Po"),
        (C200, "Lo", "L0"),
        (C200, "-007", "-7"),
        (C200, "H", "H+"),
    ],
)
def test_commands_are_listed_without_leading_zeros_jumps_small_gotos_with_their_sign(
    model: str, text: str, listed: str
) -> None:
    """Entry Q: the program is sent back instruction by instruction."""
    assert spell(model, parse(model, text)) == listed


def test_misuse_of_the_table_is_told_at_once() -> None:
    with pytest.raises(ValueError, match="choose gs-c200 or gs-c200s"):
        rows("dcb-274")
    with pytest.raises(ValueError, match="GS-C200 has no command JUMP"):
        row(C200, Op.JUMP)


NEAR_COMMANDS = st.from_regex(r"[A-Za-z+\-][a-z]?[+\-]?[0-9]{0,8}(,[0-9]{1,3})?", fullmatch=True)


@given(st.sampled_from(MODELS), st.text() | NEAR_COMMANDS)
def test_any_text_is_an_instruction_or_a_command_error(model: str, text: str) -> None:
    try:
        instruction = parse(model, text)
    except CommandError as error:
        refused = error
    else:
        check_listed(model, instruction)
        return
    assert refused.code in (2, 4)
    assert refused.reason


def check_listed(model: str, instruction: Instruction) -> None:
    listed = spell(model, instruction)
    assert parse(model, listed) == instruction
    assert len(listed) <= 9  # address digit, nine characters, checksum: within the 12 of a frame
    entry = row(model, instruction.op)
    assert entry.argument.admits(instruction.value, instruction.other)
    assert entry.length in (0, length(instruction))


def test_every_row_has_help_and_names_its_section() -> None:
    for entry in commands.TABLE:
        assert entry.help.endswith(".")
        assert entry.section.startswith("command description, ")
        assert set(entry.models) <= set(MODELS)
