"""The common face: what a host wants of any axis, whatever controller moves it.

Positions are steps of the controller's own resolution, rates are those steps a second, both with a sign: plus is the
controller's plus. What a controller cannot do raises ValueError and says which call does instead.
"""

from typing import NamedTuple

from detent.hosts.errors import MotionFailed
from detent.hosts.exchange import Driver, Rest, Steps, operation

POLL = 0.02  # seconds between two questions whether a motion is over


class Speeds(NamedTuple):
    """How moves are made: from `start` (the start-stop rate) to `slew`, steps/s, in about `seconds`."""

    start: float
    slew: float
    seconds: float


class Limits(NamedTuple):
    """Which limit switches are met; None where the unit does not tell."""

    low: bool | None = None
    high: bool | None = None


class Axis(Driver):
    """One axis. Moves begin and return; `wait` waits for their end.

    What a move is told while another is under way is the controller's: a GS-C200 and a SUPERSIGMA raise Busy, a
    DCB-274 begins it behind the one under way (the call returns then), a GenStepper board stops and goes to the new
    target. `stop` and `wait` before it, and all of them do the same.
    """

    poll = POLL
    fastest: int = 0  # the largest rate at which a move can be made, steps/s

    @operation
    def move_to(self, position: int) -> Steps[None]:
        """Begin a move to `position` and return."""
        raise NotImplementedError
        yield

    @operation
    def move_by(self, steps: int) -> Steps[None]:
        """Begin a move by `steps` from where the axis is and return."""
        raise NotImplementedError
        yield

    @operation
    def run_at(self, rate: float) -> Steps[None]:
        """Run at `rate` steps/s until told otherwise."""
        raise NotImplementedError
        yield

    @operation
    def stop(self) -> Steps[None]:
        """Ramp down and stand. Nothing happens if the axis stands already."""
        raise NotImplementedError
        yield

    @operation
    def halt(self) -> Steps[None]:
        """Stop at once, without a ramp: a load that is fast may slip."""
        raise NotImplementedError
        yield

    @operation
    def home(self, direction: int = -1) -> Steps[None]:
        """Begin the search for the reference in `direction` (+1 or -1) and return."""
        raise NotImplementedError
        yield

    @operation
    def position(self) -> Steps[int]:
        """Where the axis is, in steps."""
        raise NotImplementedError
        yield

    @operation
    def set_position(self, position: int) -> Steps[None]:
        """Call the place where the axis stands `position`; nothing moves."""
        raise NotImplementedError
        yield

    @operation
    def moving(self) -> Steps[bool]:
        """Whether the axis moves, or the unit is busy with what it was told."""
        raise NotImplementedError
        yield

    @operation
    def set_speeds(self, speeds: Speeds) -> Steps[Speeds]:
        """Make the next moves so; returned is what the unit makes of it, rounded to what it can."""
        raise NotImplementedError
        yield

    @operation
    def limits(self) -> Steps[Limits]:
        """Which limit switches are met, as far as the unit tells."""
        return Limits()
        yield

    @operation
    def wait(self, timeout: float | None = None) -> Steps[None]:
        """Wait until the axis stands, for `timeout` seconds at most (None: as long as it takes).

        Raises MotionFailed.
        """
        waited, began = 0.0, None
        while (yield from self.moving()):
            if timeout is not None and waited >= timeout:
                raise MotionFailed(self.title, f"still moves after {timeout:g} s")
            now = (yield Rest(self.poll)).at
            began = now - self.poll if began is None else began
            waited = max(waited + self.poll, now - began)  # questions take their time, too
