"""Instructions in memory, and the SMC-27X2's language for the assembler.

The manual gives the lengths of instructions but, apart from the op-code of ``@``, not their bytes. The op-code is
the ASCII code less 40h, modulo 256, as its example on page 56 shows; FFh ends a program. The rest is ours (E):
numbers little-endian, positions as 24-bit two's complement, speeds as timer counts with sign or direction in bit
15, trace in bit 15 of G's address, the name of an axis behind ``|``.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from detent.assembler import NAME as LABEL_NAME
from detent.assembler import ImageError, Language, Statement, StatementError
from detent.controllers.dcb274 import commands
from detent.controllers.dcb274.arguments import Address
from detent.controllers.dcb274.commands import MODEL, ROWS, TABLE, Instruction, Op, Refusal

END: Final = 0xFF
AREAS: Final = (range(193), range(256, 2048))  # where bytes of a program may stand (page 59)
SHADOW: Final = range(128, 192)  # programs there run from RAM (page 32)
BRANCHES: Final = range(256, 512, 16)  # where G 2048 leads to, by the ports (page 39)
POWER_UP: Final = 1600  # what stands there is executed at power-up
_BEGUN: Final = (range(SHADOW.start), range(SHADOW.start, 193), range(256, POWER_UP), range(POWER_UP, 2048))
MOST_MARKS: Final = 4  # FFh in a row inside what is left of a program: an end mark and the three bytes of a number
LONGEST: Final = max(row.length for row in TABLE)
_BIT_15: Final = 0x80  # of the high byte

OPCODES: Final = {(ord(row.letter) - 0x40) & 0xFF: row for row in TABLE if row.stored}


class Damaged(ImageError):
    """Bytes that hold no program; the text says at which byte, and why."""


def allowed(address: int, length: int = 1) -> bool:
    """Whether `length` bytes of a program may stand at `address`."""
    return any(address in area and address + length <= area.stop for area in AREAS)


def encode(instruction: Instruction) -> bytes:
    """The bytes of an instruction that program mode stores."""
    row = ROWS[instruction.op]
    values = instruction.values
    opcode = (ord(row.letter) - 0x40) & 0xFF
    match instruction.op:
        case Op.GO | Op.FIND_HOME:
            word = row.arguments[0].pack(values[0])
            return bytes((opcode, word[0], word[1] | (_BIT_15 if values[1] else 0)))
        case _:
            return bytes((opcode,)) + b"".join(a.pack(v) for a, v in zip(row.arguments, values, strict=True))


def decode(data: bytes) -> Instruction | None:
    """The instruction with which `data` begins; None if none does (FFh, a stranger, a number out of range)."""
    row = OPCODES.get(data[0]) if data else None
    if row is None or len(data) < row.length:
        return None
    rest = data[1 : row.length]
    if row.op in (Op.GO, Op.FIND_HOME):
        value = row.arguments[0].unpack(bytes((rest[0], rest[1] & ~_BIT_15)))
        return None if value is None else Instruction(row.op, (value, rest[1] >> 7))
    values: list[int] = []
    for argument in row.arguments:
        value = argument.unpack(rest[: argument.width])
        if value is None:
            return None
        values.append(value)
        rest = rest[argument.width :]
    return Instruction(row.op, tuple(values))


@dataclass(frozen=True, slots=True)
class SmcLanguage:
    """The SMC-27X2 as the assembler sees it (`detent.assembler.Language`).

    Source is what goes on the wire, one command a line, with labels for the addresses of G, J, L and T (``J start 3``,
    ``T 1000 trip``). ``P 128`` says where the next instruction stands, as it does in program mode; ``P`` alone ends a
    program by the end mark FFh, as it does there, and an instruction behind it needs another ``P n`` first: on the
    wire it would be executed at once. A source that begins with an instruction stands at 0.
    """

    model: str = MODEL
    comment: str = ";"
    areas: tuple[range, ...] = AREAS
    blank: int = END
    closed: bool = False
    closing: str = "P"

    def parse(self, text: str) -> Statement[Instruction]:
        """The statement in `text`; see `detent.assembler.Language`."""
        row = commands.LETTERS.get(text[0])
        if row is not None and row.op is Op.PROGRAM:
            return self._origin(text)
        text, label, offset = self._without_label(text)
        try:
            instruction = commands.parse(text)
        except Refusal as error:
            raise StatementError(str(error)) from error
        found = ROWS[instruction.op]
        if not found.stored:
            raise StatementError(f"{found.letter} is not stored in a program; leave it out")
        return Statement(instruction, label, offset)

    def origin(self, address: int) -> str:
        """The line that says where the next instruction stands."""
        return f"P {address}"

    def _origin(self, text: str) -> Statement[Instruction]:
        try:
            values = commands.parse(text).values
        except Refusal as error:
            raise StatementError(str(error)) from error
        if text.strip() == "P":
            return Statement(None, ends=True)  # bytes between parts are FFh, and so is the one behind a program
        return Statement(None, origin=values[0])

    def _without_label(self, text: str) -> tuple[str, str | None, int]:
        """The text with 0 for the label in its place, the label and where it stands; unchanged without one."""
        row = commands.LETTERS.get(text[0])
        if row is None:
            return text, None, 0
        for place, match in enumerate(re.finditer(r"[^ ,]+", text[1:])):
            takes = place < len(row.arguments) and isinstance(row.arguments[place], Address)
            if takes and LABEL_NAME.fullmatch(match[0]):
                return f"{text[: 1 + match.start()]}0{text[1 + match.end() :]}", match[0], 1 + match.start()
        return text, None, 0

    def length(self, instruction: Instruction) -> int:
        """As settled from the command reference."""
        return ROWS[instruction.op].length

    def target(self, instruction: Instruction) -> int | None:
        """Where G, J, L and T lead, unless it is 2048, or the 0 that turns a trip off."""
        place = self._place(instruction)
        if place is None:
            return None
        value = instruction.values[place]
        off = value == commands.BRANCH or (instruction.op is Op.TRIP and value == 0)
        return None if off else value

    def with_target(self, instruction: Instruction, address: int) -> Instruction:
        """The same instruction, leading to `address`."""
        place = self._place(instruction)
        assert place is not None
        argument = ROWS[instruction.op].arguments[place]
        if instruction.op is Op.TRIP and (address == 0 or argument.read(address) is None):
            why = "0 turns it off" if address == 0 else "its vector is a byte"
            raise StatementError(
                f"T calls a routine at 1 to 192, as {why} (page 49); put the routine there, like P 128"
            )
        if argument.read(address) is None:
            raise StatementError(f"{instruction.op.value} leads to {argument.words}")
        values = list(instruction.values)
        values[place] = address
        return instruction._replace(values=tuple(values))

    def _place(self, instruction: Instruction) -> int | None:
        arguments = ROWS[instruction.op].arguments
        return next((i for i, argument in enumerate(arguments) if isinstance(argument, Address)), None)

    def encode(self, instruction: Instruction) -> bytes:
        """See the module's docstring."""
        return encode(instruction)

    def decode(self, image: bytes) -> list[tuple[int, Instruction]]:
        """The instructions of an image that starts at address 0; FFh and what nobody wrote is left out.

        Of a whole NV memory (2 048 bytes) only the program areas are read, and there what is left of an older program
        behind the end mark of a shorter one is none (`left_over`).
        """
        if len(image) == AREAS[-1].stop:
            return sorted(place for part in self._programs(image).values() for place in part)
        found, address = [], 0
        while address < len(image):
            if image[address] == END:
                address += 1
                continue
            instruction = _first(image, address)
            found.append((address, instruction))
            address += ROWS[instruction.op].length
        return found

    def left_over(self, image: bytes) -> list[range]:
        """The bytes of a whole NV memory that stand behind an end mark and belong to no program.

        A program that is stored over a longer one leaves the rest of that one in memory (page 47).
        """
        if len(image) != AREAS[-1].stop:
            return []
        held = {
            byte
            for part in self._programs(image).values()
            for at, instruction in part
            for byte in range(at, at + ROWS[instruction.op].length)
        }
        left: list[range] = []
        for at in (at for area in AREAS for at in area if image[at] != END and at not in held):
            joined = bool(left) and at == left[-1].stop
            left[-1:] = [range(left[-1].start, at + 1)] if joined else [*left[-1:], range(at, at + 1)]
        return left

    def _programs(self, image: bytes) -> dict[int, list[tuple[int, Instruction]]]:
        """The instructions of each program of a whole NV memory, by where it begins."""
        parts: dict[int, list[tuple[int, Instruction]]] = {}
        for area in _BEGUN:
            at = area.start
            while at < area.stop:
                under_way = next((part for part in parts.values() if at in _bytes(part)), None)
                if under_way is None and image[at] == END:
                    at += 1
                    continue
                part = under_way or parts.setdefault(at, _part(image, at))
                at = _behind(image, _bytes(part).stop, area)
        asked = set(parts)
        while places := self._led_to(parts) - asked:
            at = min(places)
            asked.add(at)
            if image[at] != END and not any(at in _bytes(part) for part in parts.values()):
                try:
                    parts[at] = _part(image, at)
                except Damaged:
                    continue
        return parts

    def _led_to(self, parts: Mapping[int, list[tuple[int, Instruction]]]) -> set[int]:
        """Where programs lead, by the ports too."""
        instructions = [instruction for part in parts.values() for _, instruction in part]
        branches = any(one.op is Op.GO and one.values[0] == commands.BRANCH for one in instructions)
        places = {place for one in instructions if (place := self.target(one)) is not None}
        return {place for place in places | (set(BRANCHES) if branches else set()) if allowed(place)}

    def spell(self, instruction: Instruction, label: str | None = None) -> str:
        """As Q lists it; with a label, as source has it."""
        text = commands.spell(instruction)
        place = self._place(instruction)
        if label is None or place is None:
            return text
        words = text.split(" ")
        words[1 + place] = label
        return " ".join(words)


def _first(image: bytes, address: int) -> Instruction:
    """The instruction at an address of an image. Raises Damaged."""
    instruction = decode(image[address : address + LONGEST])
    if instruction is None or not _typed(instruction, image, address):
        raise Damaged(f"byte {address} holds {image[address]:02X}h, with which no instruction begins")
    return instruction


def _part(image: bytes, address: int) -> list[tuple[int, Instruction]]:
    """A program from where it begins to its end mark, or to where no program may stand. Raises Damaged."""
    part: list[tuple[int, Instruction]] = []
    while allowed(address) and image[address] != END:
        part.append((address, _first(image, address)))
        address += ROWS[part[-1][1].op].length
    return part


def _bytes(part: list[tuple[int, Instruction]]) -> range:
    """The bytes that a program takes, without its end mark."""
    last, instruction = part[-1]
    return range(part[0][0], last + ROWS[instruction.op].length)


def _behind(image: bytes, end: int, area: range) -> int:
    """Where in `area` another program may begin behind the end mark at `end`, past what is left over there."""
    at, most = end, 1  # end marks that belong together: the one at `end`, or those in what is left over
    while at < area.stop:
        begun = at
        while at < area.stop and image[at] == END:
            at += 1
        if at - begun > most:
            return at
        while at < area.stop and image[at] != END:
            at += 1
        most = MOST_MARKS
    return at


def _typed(instruction: Instruction, image: bytes, address: int) -> bool:
    """Whether a command line gives just the bytes at `address` of `image`: raw writes may have made others."""
    return image.startswith(encode(commands.parse(commands.spell(instruction))), address)


def language() -> Language[Instruction]:
    """The language for `detent.assembler`."""
    return SmcLanguage()
