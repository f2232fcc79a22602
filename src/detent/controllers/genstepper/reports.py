"""What `?` tells: reports -1 to -11 of a motor, and the memory locations that are of use (manual, pages 39 to 43)."""

from detent.controllers.genstepper.commands import REPORTS
from detent.controllers.genstepper.motor import Motor
from detent.ticks import Ns

DUAL_POWER = 4  # added to the step mode with double current

VERSION_TEXT = ("GenStepper $version: 2.18$", "Detent")


def values(motor: Motor, energised: bool, double: bool, now: Ns) -> list[int]:
    """The values of reports -1 to -11."""
    return [
        motor.position(now),
        motor.speed(now),
        motor.slope,
        motor.seen_target(now),
        motor.target_speed(now),
        int(energised),
        int(motor.idle_windings != 0),
        motor.step_action(now),
        motor.mode + (DUAL_POWER if double else 0),
        motor.rate,
        motor.keep,
    ]


def line(name: str, number: int, values: list[int]) -> str:
    """A line of a report: number 0 has all values, any other its own."""
    shown = values if number == 0 else [values[-number - 1]]
    return ",".join([name, str(number), *map(str, shown)])


def is_memory(number: int) -> bool:
    """Whether a report number is an address."""
    return 1 <= number <= 255


def is_report(number: int) -> bool:
    """Whether there is a report of that number; any other counts as 0."""
    return -len(REPORTS) <= number < 0
