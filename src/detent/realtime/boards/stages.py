"""What the power stage behind each driven axis is told when the cell starts: by its controller, or by the cell file.

And whether the driver can do what a controller commands.
"""

from collections.abc import Mapping, Sequence

from detent.cell.cell import Cell
from detent.cell.description import Problem
from detent.controllers.device import DriveSet, Stage, StageSet
from detent.realtime.boards.plan import Plan
from detent.realtime.boards.registers import settings
from detent.realtime.boards.setup import SetupProblem


def stages(plan: Plan, cell: Cell) -> Mapping[str, Stage]:
    """By stepper; without those nobody commands. `cell` records and has just been built.

    Problem for a driver chip that nobody would ever set, and for one that two would.
    """
    found: dict[str, Stage] = {}
    for axis in plan.axes:
        commanded = _commanded(cell, axis.unit, axis.axis)
        model = cell.controller(axis.unit).model
        key = f"hardware.{axis.stepper}.driver.microsteps"
        if axis.driver and commanded is None and axis.stage is None:
            what = f"a {model} commands no power stage: say how many of its steps make a full step"
            raise Problem(plan.file, key, f"{what}, microsteps = 2 for half steps")
        if axis.stage is not None and commanded is not None:
            raise Problem(plan.file, key, f"a {model} commands that itself: leave it out")
        stage = axis.stage if commanded is None else commanded
        if stage is not None:
            found[axis.stepper] = stage
    return found


def check_moves(plan: Plan, moves: Mapping[tuple[str, str], Sequence[Stage]]) -> None:
    """The driver chips can do what controllers command in their first `moves`, by unit and axis. Problem."""
    drivers = {driver.name: driver for setup, _ in plan.setups for driver in setup.drivers}
    for axis in plan.axes:
        for stage in moves.get((axis.unit, axis.axis), ()) if axis.driver else ():
            try:
                settings(drivers[axis.driver], stage)
            except SetupProblem as problem:
                raise plan.problem(problem) from None


def _commanded(cell: Cell, unit: str, axis: str) -> Stage | None:
    assert cell.recording is not None
    stage = None
    for entry in cell.recording.of(unit, StageSet, DriveSet):
        if isinstance(entry, (StageSet, DriveSet)) and entry.axis == axis:
            stage = entry.stage
    return stage
