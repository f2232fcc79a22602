"""A program in the 119 bytes of the GS-C200's memory, its stored form, and its language for the assembler.

The datasheet gives each instruction's length in bytes but not the bytes themselves. They are ours (E),
with exactly the lengths of its function table:

* First the op-code: the ASCII code of the command's letter (`Op`), for `jc` 80h plus the value of the
  inputs. A velocity move is `g` and a plain goto `G` in both models, a move is `+` whatever its sign.
* Two-byte instructions: one byte with output, input, choice, repetitions, tenths or address.
* Four-byte instructions: a number of 24 bits, little-endian, two's complement where it has a sign. The
  velocity move has its direction, +1 or -1, in 16 such bits and the input (0: none) in the last byte.

An image is the instructions in order, without header, filler or terminator: as many bytes as are used.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, NamedTuple, Self

from detent.assembler import NAME as LABEL_NAME
from detent.assembler import ImageError, Language, Statement, StatementError
from detent.controllers.gsc200 import commands
from detent.controllers.gsc200.commands import CommandError, Instruction, Op

CAPACITY: Final = commands.LAST_ADDRESS + 1
_JUMP_IF: Final = 0x80  # plus the three inputs
_GAP: Final = re.compile(r"(?<![\s,])(?<!^[+-])\s+(?![\s,])")  # a blank that is not beside a comma or the sign


class ProgramFull(Exception):
    """An instruction does not fit behind the program: error 3, "Storage capacity overflow"."""


class ProgramDamaged(ImageError):
    """Bytes that hold no program of this model; the text says at which byte, and why."""


class Step(NamedTuple):
    """An instruction in memory: where it starts, where the next one does, and how Q lists it."""

    address: int
    instruction: Instruction
    next: int
    text: str


@dataclass(frozen=True, slots=True)
class Program:
    """The instructions in memory, from address 0. Immutable: a copy is the program itself."""

    model: str
    steps: tuple[Step, ...]
    _starts: dict[int, Step] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_starts", {step.address: step for step in self.steps})

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return self

    @property
    def size(self) -> int:
        """Bytes in use, 0 to 119."""
        return self.steps[-1].next if self.steps else 0

    def at(self, address: int) -> Step | None:
        """The instruction that starts at `address`; None if none does."""
        return self._starts.get(address)

    def with_instruction(self, instruction: Instruction) -> "Program":
        """The same program with one more instruction at its end.

        Raises ProgramFull if it does not fit in 119 bytes, and ValueError for an instruction that the
        model does not store or whose argument is out of range.
        """
        row = commands.row(self.model, instruction.op)
        if not row.stored:
            raise ValueError(f"the {self.model.upper()} does not store {row.letters}")
        if not row.argument.admits(instruction.value, instruction.other):
            raise ValueError(f"{instruction} is out of range: {row.name} takes {row.argument.words}")
        end = self.size + row.length
        if end > CAPACITY:
            raise ProgramFull(f"{self.size} of {CAPACITY} bytes are used, {row.length} more do not fit")
        step = Step(self.size, instruction, end, commands.spell(self.model, instruction))
        return Program(self.model, (*self.steps, step))

    def image(self) -> bytes:
        """The stored form: `size` bytes."""
        return b"".join(encode(step.instruction) for step in self.steps)


def empty(model: str) -> Program:
    """A program without instructions. ValueError for a model that does not speak this language."""
    commands.rows(model)
    return Program(model, ())


def from_image(model: str, image: bytes) -> Program:
    """The program in `image`; ProgramDamaged for anything that `Program.image` of `model` cannot give."""
    steps = []
    end = 0
    for address, instruction in decode(model, image):
        end = address + commands.length(instruction)
        steps.append(Step(address, instruction, end, commands.spell(model, instruction)))
    return Program(model, tuple(steps))


def encode(instruction: Instruction) -> bytes:
    """The bytes of one instruction that is stored, as the module's docstring has them."""
    op, value, other = instruction
    match op:
        case Op.JUMP_IF:
            return bytes((_JUMP_IF | other, value))
        case Op.VELOCITY:
            return bytes((ord(op.value), *(value & 0xFFFF).to_bytes(2, "little"), other))
    width = commands.length(instruction) - 1
    return bytes((ord(op.value), *(value & ((1 << 8 * width) - 1)).to_bytes(width, "little")))


def decode(model: str, image: bytes) -> list[tuple[int, Instruction]]:
    """The instructions of `image` with their addresses. Raises ProgramDamaged."""
    commands.rows(model)
    if len(image) > CAPACITY:
        raise ProgramDamaged(f"{len(image)} bytes: the memory has {CAPACITY}")
    found = []
    address = 0
    while address < len(image):
        instruction = _decode_one(model, image, address)
        found.append((address, instruction))
        address += commands.length(instruction)
    return found


_STORED: Final = {
    model: {
        opcode: row
        for row in commands.rows(model)
        if row.stored
        for opcode in (range(_JUMP_IF, _JUMP_IF + 8) if row.op is Op.JUMP_IF else (ord(row.op.value),))
    }
    for model in commands.MODELS
}


def _decode_one(model: str, image: bytes, address: int) -> Instruction:
    opcode = image[address]
    row = _STORED[model].get(opcode)
    if row is None:
        raise ProgramDamaged(f"byte {address} holds {opcode:02X}h, {_stranger(model, opcode)}")
    argument = image[address + 1 : address + row.length]
    if len(argument) < row.length - 1:
        raise ProgramDamaged(f"byte {address}: the image ends inside {row.name}")
    other = 0
    match row.op:
        case Op.JUMP_IF:
            other = opcode - _JUMP_IF
        case Op.VELOCITY:
            argument, other = argument[:2], argument[2]
    value = int.from_bytes(argument, "little")
    signed = value - (1 << 8 * len(argument))
    # no argument has both readings in range: the ranges are narrower than what the bytes can say
    for reading in (value, signed):
        if row.argument.admits(reading, other):
            return Instruction(row.op, reading, other)
    raise ProgramDamaged(
        f"byte {address}: {row.name} takes {row.argument.words}, "
        f"not the bytes {image[address + 1 : address + row.length].hex(' ').upper()}"
    )


def _stranger(model: str, opcode: int) -> str:
    """What is to be said of a byte that is no op-code of `model`."""
    for other in commands.MODELS:
        row = _STORED[other].get(opcode)
        if row is not None:
            return f"{row.name}, which the {other.upper()} stores and the {model.upper()} does not"
    return "which is no op-code"


@dataclass(frozen=True, slots=True)
class SimpleLanguage:
    """S.I.M.P.L.E. as the assembler sees it (`detent.assembler.Language`), for one of the two models.

    Source is what goes on the wire, and a little wider: blanks around letters, signs and commas, a label
    for an address (`j start`, `jc0,drill`), and a small first letter for a command that has no meaning of
    its own in small (f, g and j have one).
    """

    model: str
    comment: str = ";"
    areas: tuple[range, ...] = (range(CAPACITY),)
    blank: int = 0
    closed: bool = True

    @property
    def ending(self) -> Instruction | None:
        """L1 runs what is before it once in all: nothing happens, and the program ends behind it.

        There is no instruction that stops a program, and a jump must lead to one ("it is mandatory to address the
        proper memory position").
        """
        return Instruction(Op.LOOP, 1) if self.model == commands.GS_C200S else None

    def parse(self, text: str) -> Statement[Instruction]:
        """The instruction in `text`; see `detent.assembler.Language`."""
        text = _capital(text)
        letters = commands.letters(text)
        rest = text[len(letters) :]
        start = len(text) - len(rest.lstrip())
        gap = _GAP.search(rest.strip())
        if letters and gap:
            second = rest.strip()[gap.end() :].split()[0]
            raise StatementError(f"one command a line: put {second} on a line of its own", start + gap.end())
        argument, label = self._without_label(letters, "".join(rest.split()))
        try:
            instruction = commands.parse(self.model, letters + argument if letters else text)
        except CommandError as error:
            if label is None:
                raise StatementError(error.reason, start if error.code == 2 else 0) from error
            takes = f"{commands.takes(self.model, letters)} or a label, not {rest.strip()!r}"
            jump = commands.letters(letters[:-1])  # jcut reads as jc ut, and means j cut
            hint = f"; did you mean {jump} {text[len(jump) :]}?" if jump and rest == label else ""
            raise StatementError(takes + hint, start) from error
        row = commands.row(self.model, instruction.op)
        if not row.stored:
            raise StatementError(self._not_stored(row))
        return Statement(instruction, label, text.rindex(label) if label else 0)

    def _without_label(self, letters: str, argument: str) -> tuple[str, str | None]:
        """The argument with address 0 for the label in its place, and the label; unchanged without one."""
        head, comma, last = argument.rpartition(",")
        takes_address = any(row.argument.address for row in commands.spelled(self.model, letters))
        if takes_address and LABEL_NAME.fullmatch(last):
            return f"{head}{comma}0", last
        return argument, None

    def _not_stored(self, row: commands.Row) -> str:
        """Why an immediate command has no place in a program."""
        owner = next((r.models[0].upper() for r in commands.TABLE if r.op is row.op and r.stored), None)
        only = f" by the {self.model.upper()}, only by the {owner}" if owner else ""
        return (
            f"{row.letters} acts at once and is not stored in a program{only}; leave it out: "
            "running a program loads and executes it"
        )

    def length(self, instruction: Instruction) -> int:
        """As in the function table, "Byte Length"."""
        return commands.length(instruction)

    def target(self, instruction: Instruction) -> int | None:
        """Where j and jc lead."""
        argument = commands.row(self.model, instruction.op).argument
        return instruction.value if argument.address else None

    def with_target(self, instruction: Instruction, address: int) -> Instruction:
        """The same jump, to `address`."""
        return instruction._replace(value=address)

    def encode(self, instruction: Instruction) -> bytes:
        """See the module's docstring."""
        return encode(instruction)

    def decode(self, image: bytes) -> list[tuple[int, Instruction]]:
        """See the module's docstring."""
        return decode(self.model, image)

    def spell(self, instruction: Instruction, label: str | None = None) -> str:
        """As Q lists it; with a label, as source has it."""
        text = commands.spell(self.model, instruction)
        if label is None:
            return text
        head = text.removesuffix(str(instruction.value))
        return f"{head} {label}" if head[-1].isalpha() else head + label


def _capital(text: str) -> str:
    """`text` with a capital first letter, unless the small one begins a command of its own."""
    return text if commands.letters(text) or not text.isascii() else text[:1].upper() + text[1:]


def language(model: str) -> Language[Instruction]:
    """The language of `model` for `detent.assembler`. ValueError for a model that does not speak it."""
    commands.rows(model)
    return SimpleLanguage(model)


def from_instructions(model: str, instructions: Iterable[Instruction]) -> Program:
    """A program of these instructions. Raises what `Program.with_instruction` raises."""
    program = empty(model)
    for instruction in instructions:
        program = program.with_instruction(instruction)
    return program
