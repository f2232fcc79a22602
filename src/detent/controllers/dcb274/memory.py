"""The non-volatile memory: 2 048 bytes with the printed map (page 31), and the shadow RAM over 128-191 (page 32).

What is to be written is first proposed (`with_bytes`) and taken over (`commit`) when it is known to be stored,
whole or not at all. The writes of every cell are counted (page 31: the life of a cell is a million).
"""

from collections.abc import Mapping
from typing import Final

from detent.assembler import ImageError
from detent.controllers.dcb274 import program
from detent.controllers.dcb274.commands import Instruction, Op
from detent.controllers.dcb274.program import SHADOW

SIZE: Final = 2048
PAGE: Final = 256
PROTECTED: Final = range(247, 256)  # from C 1
PARAMETERS: Final = range(193, 256)  # no byte of a program may stand there

FACTORY_PROGRAM: Final = b"".join(
    program.encode(Instruction(op, values))
    for op, values in ((Op.PLUS, (1001,)), (Op.WAIT, (100,)), (Op.MINUS, (1000,)), (Op.WAIT, (100,)),
                       (Op.POSITION, (0,)), (Op.GO, (0, 0)))
)  # fmt: skip


class Memory:
    """The NV memory of one unit, with its shadow RAM."""

    __slots__ = ("nv", "ram", "writes")

    def __init__(self, parameters: Mapping[int, int]) -> None:
        """As it leaves the factory: the parameters, the program of page 39."""
        image = bytearray(b"\xff" * SIZE)
        image[: len(FACTORY_PROGRAM)] = FACTORY_PROGRAM
        for address, value in parameters.items():
            image[address] = value
        self.nv = bytes(image)
        self.ram = self.nv[SHADOW.start : SHADOW.stop]
        self.writes: dict[int, int] = {}  # address -> how often it was written

    def restore(self, image: bytes) -> None:
        """Take a kept image, or a program that begins at address 0, behind which an end mark is put.

        Raises `detent.assembler.ImageError`.
        """
        if len(image) > SIZE:
            raise ImageError(f"{len(image)} bytes: the memory has {SIZE}")
        if len(image) == SIZE:
            self.nv = image
        else:
            whole = bytearray(self.nv)
            ended = image + bytes((program.END,))
            for area in program.AREAS:
                part = ended[area.start : area.stop]
                whole[area.start : area.start + len(part)] = part
            self.nv = bytes(whole)
        self.load_shadow()

    def load_shadow(self) -> None:
        """Reset: the shadow RAM is loaded from NV memory."""
        self.ram = self.nv[SHADOW.start : SHADOW.stop]

    def read(self, address: int, length: int = 1) -> bytes:
        """Bytes as a program finds them: 128-191 from shadow RAM."""
        if address + length <= SHADOW.start or address >= SHADOW.stop:
            return self.nv[address : address + length]
        whole = self.nv[: SHADOW.start] + self.ram + self.nv[SHADOW.stop :]
        return whole[address : address + length]

    def instruction(self, address: int) -> Instruction | None:
        """The instruction at `address`; None if none is there (an end mark, a stranger, or no program byte)."""
        if not program.allowed(address):
            return None
        found = program.decode(self.read(address, program.LONGEST))
        return found if found is not None and program.allowed(address, _length(found)) else None

    def nv_bytes(self, address: int, length: int) -> int:
        """How many of these bytes are fetched from NV memory, and not from shadow RAM."""
        return sum(byte not in SHADOW for byte in range(address, address + length))

    def put(self, address: int, data: bytes) -> tuple[bytes, bytes | None]:
        """Shadow RAM and NV image with these bytes of a program; None for the image if no byte goes there."""
        ram, image, changed = bytearray(self.ram), bytearray(self.nv), False
        for byte, value in enumerate(data, address):
            if byte in SHADOW:
                ram[byte - SHADOW.start] = value
            else:
                image[byte] = value
                changed = True
        return bytes(ram), bytes(image) if changed else None

    def with_bytes(self, cells: Mapping[int, int]) -> bytes:
        """The NV image with these cells written."""
        image = bytearray(self.nv)
        for address, value in cells.items():
            image[address] = value
        return bytes(image)

    def commit(self, image: bytes, written: range | tuple[int, ...]) -> None:
        """The image was stored; the cells `written` have one write more."""
        self.nv = image
        for address in written:
            self.writes[address] = self.writes.get(address, 0) + 1


def _length(instruction: Instruction) -> int:
    return len(program.encode(instruction))
