"""One board: from the first byte to steps, and through shutdown and loss.

A board is told what it received and what the wall clock says, and gives bytes to send. It begins to talk with `start`;
`Ready` or `Refusal` is the first event. See `several.Boards` for what a cell uses.
"""

from collections.abc import Mapping
from enum import Enum

from detent.realtime.boards.drivers import Driver
from detent.realtime.boards.outs import DigitalOut
from detent.realtime.boards.setup import BoardSetup
from detent.realtime.boards.stepper import Stepper
from detent.realtime.boards.stops import Stop
from detent.realtime.pace import WallNs


class State(Enum):
    """Where a board stands."""

    CONNECTING = "connecting"  # looking for its sequence number, reading its dictionary, its clock
    CONFIGURING = "configuring"
    READY = "ready"
    SHUT_DOWN = "shut down"
    LOST = "lost"
    REFUSED = "refused"


class Board:
    """A board, its steppers, outputs, inputs, stops and drivers, by their names in the setup."""

    setup: BoardSetup
    state: State
    steppers: Mapping[str, Stepper]
    outs: Mapping[str, DigitalOut]
    stops: Mapping[str, Stop]
    drivers: Mapping[str, Driver]
    inputs: Mapping[str, bool]
    """The logical level of each input, as last reported."""
    firmware: str
    """Its version as it says; empty until it is known."""
    frequency: int
    """Nominal ticks a second; 0 until it is known."""
    move_count: int
    """Entries of its move queue, shared by steppers and outputs; 0 until it is configured."""

    def emergency_stop(self, wall: WallNs) -> None:
        """Stop everything at once; `ShutDown` follows."""
        raise NotImplementedError

    def recover(self, wall: WallNs) -> None:
        """Make it ready again after ShutDown or Lost (of which the descriptor is there again); `Recovered` follows."""
        raise NotImplementedError
