"""Emulated modules for host drivers: in a cell's virtual time, through lines that can damage characters."""

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort


def cell(text: str) -> Cell:
    """The cell that `text` describes."""
    return build(parse(text, "modules"), lambda file: "")


class FaultyPort(HostPort):
    """A `HostPort` that flips bit 0 of one byte: number `sent` of those to the units, `received` of those from them."""

    def __init__(self, cell: Cell, *, sent: int = -1, received: int = -1) -> None:
        super().__init__(cell)
        self.damage(sent=sent, received=received)

    def damage(self, *, sent: int = -1, received: int = -1) -> None:
        """Count from here."""
        self._to_unit, self._from_unit = sent, received

    def write(self, data: bytes) -> int:
        return super().write(self._damaged(data, "_to_unit"))

    def receive(self, timeout: float) -> bytes:
        kept = bytes(self._heard)
        data = super().receive(timeout)
        return kept + self._damaged(data[len(kept) :], "_from_unit")

    def _damaged(self, data: bytes, name: str) -> bytes:
        place = getattr(self, name)
        setattr(self, name, place - len(data))
        if not 0 <= place < len(data):
            return data
        return data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]

    @property
    def spent(self) -> bool:
        """Whether the byte has gone by."""
        return self._to_unit < 0 and self._from_unit < 0
