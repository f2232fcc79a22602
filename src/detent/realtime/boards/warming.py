"""What a controller needs for its first move is there before pins are driven: a computer that loads it then is late.

The first ramp of a SUPERSIGMA takes the tenth part of a second, with its tables and modules, and whatever else moves in
the cell would wait for it.
"""

from collections.abc import Mapping

from detent.cell.build import build
from detent.cell.description import Description, single
from detent.ticks import SECOND

FIRST_MOVES: Mapping[str, tuple[str, ...]] = {
    "gs-c200": ("S20", "+900", "-7"),
    "gs-c200s": ("S20", "+900", "-7"),
    "dcb-274": ("M 900", "M -7"),
    "bs0610": ("X900G", "Y-900G"),
    "bs0710": ("X900G", "Y-900G"),
    "supersigma": ("move +3000", "move -7"),
}
"""Commands that move each model: with ramps and the whole way up, and a short way."""


def first_moves(described: Description) -> None:
    """Let a controller like each of the cell make its first moves, in a cell of its own and in no time."""
    for unit in described.units.values():
        lines = FIRST_MOVES.get(unit.model, ())
        if lines:
            cell = build(single(unit.model, options=unit.options), _no_file, record=False)
            cell.run_to(SECOND)
            for line in lines:
                cell.type(unit.model, line)
                cell.run_to(cell.now + 10 * SECOND)


def _no_file(name: str) -> str:
    raise FileNotFoundError(name)
