"""What the rotor of a motor did, as rows of numbers: from the trace of its mechanics."""

from typing import Final

import numpy as np

from detent.cell.cell import Cell
from detent.cell.history import take_trace
from detent.cell.mechanics import Mechanics
from detent.motors import kernel
from detent.motors.excitation import at_once
from detent.motors.rotor import Floats
from detent.ticks import MS, Ns

TIME, PLACE, COMMAND, SPEED, CURRENT_A, CURRENT_B, TORQUE = range(7)  # ns, steps, steps, steps/s, A, A, Nm
COLUMNS: Final = 7


def prepare(cell: Cell, part: int) -> None:
    """Have the equations of motor `part` compiled, which may take seconds, before anybody waits for them."""
    motor = cell.parts[part]
    assert isinstance(motor, Mechanics)
    rotor = motor.rotor_at(cell.now)
    rotor.run(
        at_once(cell.now, 0, 1.0, 0, motor.rig.drive.mode), cell.now + MS, trace=np.empty((COLUMNS, kernel.COLUMNS))
    )


def rows(cell: Cell, part: int, now: Ns, *, first: bool = False) -> Floats:
    """The rows of motor `part` since they were last asked for, up to `now`: a row each 50 us while it moves.

    The `first` ones begin with how it stood.
    """
    motor = cell.parts[part]
    assert isinstance(motor, Mechanics)
    motor.catch_up(now)
    taken = [motor.standing] if first else []
    taken += take_trace(cell, part)
    if not taken:
        return np.empty((0, COLUMNS))
    traced = np.concatenate(taken)
    rated, x = motor.rig.motor, traced[:, kernel.X_COLUMN]
    ia, ib = traced[:, kernel.IA_COLUMN], traced[:, kernel.IB_COLUMN]
    found = np.empty((len(traced), COLUMNS))
    found[:, TIME] = traced[:, kernel.T_COLUMN]
    found[:, PLACE] = motor.place_of(x)
    found[:, COMMAND] = motor.place_of(traced[:, kernel.PHI_COLUMN])
    found[:, SPEED] = speed(motor, traced[:, kernel.W_COLUMN])
    found[:, CURRENT_A], found[:, CURRENT_B] = ia, ib
    torque = rated.torque_constant * (ib * np.cos(x) - ia * np.sin(x))
    found[:, TORQUE] = torque - rated.detent_torque * np.sin(4 * x)
    return found


def speed(motor: Mechanics, shaft: Floats | float) -> Floats:
    """Steps/s of the axis for rad/s of the shaft."""
    found: Floats = np.asarray(shaft) * motor.rig.motor.teeth * motor.sign * motor.cycle / (2 * np.pi)
    return found
