"""SUPERSIGMA: a table of differences in an EPROM, and the speed that `limit` allows."""

from collections.abc import Mapping

from detent.controllers import catalogue
from detent.controllers.supersigma import commands as supersigma
from detent.controllers.supersigma.program import Program
from detent.motors.winding import HALF
from detent.moves.law import Commands, Law, Setting, Values
from detent.pulses import Train
from detent.ramps.rate_generator import CLOCK_HZ
from detent.ramps.short_movements import movement


def law(found: catalogue.Model, chosen: Mapping[str, object], axis: str) -> Law:
    """The table of differences in its EPROM, and the speed that `limit` allows."""
    program = Program(**{name: value for name, value in chosen.items() if name in Program._fields})  # type: ignore[arg-type]
    return of_program(program, found.name)


def of_program(program: Program, model: str = "supersigma") -> Law:
    """The law of a drive with these constants in its EPROM."""
    most = supersigma.LARGEST_SPEED

    def train(values: Values, steps: int) -> Train:
        entries = program.table.entries_up_to(values["limit"] * supersigma.SPEED_UNIT)
        return movement(program.table, steps, program.offset, program.short, entries).train

    def commands(values: Values, steps: int) -> Commands:
        whole = values["limit"] * supersigma.SPEED_UNIT >= _fastest(program)
        command = supersigma.Command(supersigma.Op.MOVE, 1, steps) if whole else supersigma.Command(
            supersigma.Op.LIMIT, 1, steps, values["limit"])  # fmt: skip
        return Commands((), supersigma.spell(command))

    def remark(values: Values) -> str:
        limit, low = values["limit"] * supersigma.SPEED_UNIT, CLOCK_HZ / (program.table.first + 1)
        if limit >= low:
            return ""
        return f"{limit} half steps/s is below the begin of the table: a {model} makes all steps at {low:.0f} then"

    title = f"table of {len(program.table.differences)} differences; short movements: {program.short.value}"
    limit = Setting("limit", "speed limit", "half steps/s", 1, most, most, supersigma.SPEED_UNIT)
    return Law(model, title, "half steps", supersigma.LARGEST_STEPS, (limit,), train, commands,
               (HALF,), remark)  # fmt: skip


def _fastest(program: Program) -> float:
    """Half steps/s at the end of the table."""
    return 2e6 / (program.table.counts()[-1] + 1)
