"""All boards of a cell: one is master of time, all are served together.

The first board is the master. Cell time is its time: a nominal second is so many of its own ticks, so that trains need
no scaling. Other boards get their ticks by regression of their clocks on the wall clock and of that on the master.
"""

from collections.abc import Mapping, Sequence

from detent.realtime.boards.board import Board
from detent.realtime.boards.drivers import Driver
from detent.realtime.boards.events import Event
from detent.realtime.boards.outs import DigitalOut
from detent.realtime.boards.ports import Port
from detent.realtime.boards.setup import BoardSetup
from detent.realtime.boards.stepper import Stepper
from detent.realtime.boards.stops import Stop
from detent.realtime.pace import WallNs
from detent.ticks import Ns


class Boards:
    """Boards with their ports. No call ever waits; `wall` is the host's monotonic clock, in ns.

    The owner watches `reading()` and `writing()`, calls `receive`, `flush`, and `due` at `deadline()`, runs its cell to
    the present, tells steppers and outputs what it did, and calls `commit`; then it looks at `events()`.
    """

    boards: Mapping[str, Board]
    steppers: Mapping[str, Stepper]
    """Of all boards, by name; so are these:"""
    outs: Mapping[str, DigitalOut]
    stops: Mapping[str, Stop]
    drivers: Mapping[str, Driver]

    def __init__(self, boards: Sequence[tuple[BoardSetup, Port]]) -> None:
        """The first is the master of time. SetupProblem for what is wrong on any board."""
        raise NotImplementedError

    def start(self, wall: WallNs) -> None:
        """Begin to talk; a `Ready` or `Refusal` comes from each."""
        raise NotImplementedError

    def ns_at(self, wall: WallNs) -> Ns:
        """The master's time at `wall`, in its own nanoseconds; never less than what was answered before."""
        raise NotImplementedError

    def wall_at(self, board_ns: Ns) -> WallNs:
        """The first wall time at which the master's time is at least `board_ns`, as far as is known now."""
        raise NotImplementedError

    def align(self, cell: Ns, board_ns: Ns) -> None:
        """Cell time `cell` is the master's time `board_ns`: with which everything begins. Pins are a lead later."""
        raise NotImplementedError

    def commit(self, now: Ns, wall: WallNs) -> None:
        """The cell has been run to `now` and everything it did was told: give the boards what is certain, at once."""
        raise NotImplementedError

    def events(self) -> list[Event]:
        """What came back since the last call, in order."""
        raise NotImplementedError

    def reading(self) -> Sequence[int]:
        """File descriptors to watch for something to read."""
        raise NotImplementedError

    def writing(self) -> Sequence[int]:
        """File descriptors to watch for room to write."""
        raise NotImplementedError

    def receive(self, descriptor: int, wall: WallNs) -> None:
        """`descriptor` has something to read."""
        raise NotImplementedError

    def flush(self, descriptor: int) -> None:
        """`descriptor` has room to write."""
        raise NotImplementedError

    def deadline(self) -> WallNs | None:
        """When `due` wants to be called, whatever else happens (retransmission, clock, watchdogs, a fake board)."""
        raise NotImplementedError

    def due(self, wall: WallNs) -> None:
        """It is `deadline`; may be called at any time."""
        raise NotImplementedError

    def emergency_stop(self, wall: WallNs) -> None:
        """Stop every board at once."""
        raise NotImplementedError

    def recover(self, wall: WallNs) -> None:
        """Make every board ready again that is shut down or lost; each says `Recovered`."""
        raise NotImplementedError

    def close(self) -> None:
        """Let go of the ports. Outputs stay as they are; those with a watchdog fall to `off` when it runs out."""
        raise NotImplementedError
