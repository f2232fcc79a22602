"""What a controller needs for its first move is there before pins are driven: a computer that loads it then is late.

The first ramp of a SUPERSIGMA takes the tenth part of a second, with its tables and modules, and whatever else moves in
the cell would wait for it.
"""

from collections.abc import Mapping, Sequence

from detent.cell.build import build
from detent.cell.description import Description, single
from detent.controllers.device import DriveSet, Stage, StageSet
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


def first_moves(described: Description) -> Mapping[tuple[str, str], Sequence[Stage]]:
    """Let a controller like each of the cell make its first moves, in a cell of its own and in no time.

    By unit and axis what they command of the power stages.
    """
    found: dict[tuple[str, str], list[Stage]] = {}
    for name, unit in described.units.items():
        lines = FIRST_MOVES.get(unit.model, ())
        if lines:
            cell = build(single(unit.model, options=unit.options), _no_file)
            cell.run_to(SECOND)
            for line in lines:
                cell.type(unit.model, line)
                cell.run_to(cell.now + 10 * SECOND)
            assert cell.recording is not None
            for entry in cell.recording.of(unit.model, StageSet, DriveSet):
                if isinstance(entry, (StageSet, DriveSet)):
                    found.setdefault((name, entry.axis), []).append(entry.stage)
    return found


def _no_file(name: str) -> str:
    raise FileNotFoundError(name)
