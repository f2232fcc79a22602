"""What the rotors of a cell did: place, command and currents over time, for figures."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from detent.cell.cell import Cell
from detent.cell.mechanics import Mechanics
from detent.motors import kernel
from detent.ticks import Ns

MOST_ROWS = 200_000  # more are thinned out


class RotorTrace(NamedTuple):
    """Samples of one motor. Between two rows far apart the rotor was at rest."""

    name: str
    times: npt.NDArray[np.float64]  # ns
    places: npt.NDArray[np.float64]  # steps
    commands: npt.NDArray[np.float64]  # steps
    current_a: npt.NDArray[np.float64]  # A
    current_b: npt.NDArray[np.float64]  # A


def of_cell(cell: Cell) -> list[RotorTrace]:
    """The traces of all motors up to now, in file order. A cell that does not record has none."""
    names = cell.wiring.names
    return [
        _trace(names[k], part, cell.now)
        for k, part in enumerate(cell.parts)
        if isinstance(part, Mechanics) and part.trace is not None
    ]


def _trace(name: str, motor: Mechanics, now: Ns) -> RotorTrace:
    rows = motor.traced(now)
    rows = rows[:: max(len(rows) // MOST_ROWS, 1)]
    places = np.array(motor.place_of(rows[:, kernel.X_COLUMN]))
    commands = np.array(motor.place_of(rows[:, kernel.PHI_COLUMN]))
    return RotorTrace(
        name, rows[:, kernel.T_COLUMN], places, commands, rows[:, kernel.IA_COLUMN], rows[:, kernel.IB_COLUMN]
    )
