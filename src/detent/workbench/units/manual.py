"""Moving an axis manually, as operations of its driver, and so in the controller's own commands."""

from typing import Final, NamedTuple

from detent.hosts.axis import Axis
from detent.hosts.exchange import Steps
from detent.hosts.genstepper import GenStepper
from detent.hosts.gsc200 import GsC200
from detent.hosts.supersigma import Supersigma

FARTHEST: Final = 100_000_000  # steps by hand: a slip of the keyboard is longer


class ManualMoves(NamedTuple):
    """Why an axis cannot be moved so by hand, in words; "" where it can. `unit`: what its steps are."""

    hold: str
    home: str
    unit: str
    before_hold: str  # what running at a rate changes in the unit
    before_home: str  # what a person should know before


def manual_moves(driver: Axis) -> ManualMoves:
    """How the axis of `driver` can be moved by hand."""
    hold = home = before_hold = before_home = ""
    unit = "steps"
    match driver:
        case GsC200():
            before_hold = "It sets T, which later moves keep."
            before_home = "" if driver.signed else "A GS-C200 clears the program in its RAM, too."
        case GenStepper():
            home = "A GenStepper board does not search: jog to a switch, then set zero."
            unit, before_hold = "microsteps", "It sets R; moves made here set it back."
        case Supersigma():
            hold = "A drive moves by a number of steps only: jog by steps."
            unit, before_home = (
                "half steps",
                "It always goes backward, to the end of the rail.",
            )
    return ManualMoves(hold, home, unit, before_hold, before_home)


def check_moves(driver: Axis) -> None:
    """Raises ValueError where a command would be stored instead of obeyed: somebody types a program."""
    if not getattr(driver, "programming", False):
        return
    ends = "P ends that"
    if isinstance(driver, GsC200):
        ends = "Px ends that" if driver.signed else "E ends that, and starts the program"
    raise ValueError(f"the unit is in program mode: a command would be stored, and nothing move; {ends}")


def jog(driver: Axis, steps: int) -> Steps[None]:
    """Move by `steps`. Raises ValueError, DriverError."""
    _some(steps)
    yield from driver.move_by(steps)


def go_to(driver: Axis, position: int) -> Steps[None]:
    """Move to `position`. Raises ValueError, DriverError."""
    _some(position)
    yield from driver.move_to(position)


def set_zero(driver: Axis) -> Steps[None]:
    """The place where the axis stands is 0. Raises DriverError, also where it moves."""
    yield from driver.set_position(0)


def home(driver: Axis, direction: int) -> Steps[None]:
    """Begin the search for the reference. Raises ValueError, DriverError."""
    yield from driver.home(-1 if isinstance(driver, Supersigma) else direction)


def run(driver: Axis, rate: float) -> Steps[None]:
    """Run until told otherwise, at `rate` steps/s with its sign. Raises ValueError, DriverError."""
    if not rate:
        raise ValueError("give a rate to run at, in steps/s")
    yield from driver.run_at(rate)


def _some(steps: int) -> None:
    if abs(steps) > FARTHEST:
        raise ValueError(f"{steps} steps are more than a hand gives: at most {FARTHEST}")
