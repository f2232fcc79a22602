"""What a motor record needs: a motor to move, and an outlet for its fields."""

from typing import Protocol

from detent.bridges.epics.fields import Alarm, Value
from detent.hosts.axis import Limits, Speeds
from detent.hosts.exchange import AsyncPort


class Motor(Protocol):
    """A driver of `detent.hosts` with its asynchronous shell."""

    port: AsyncPort
    fastest: int

    async def move_to(self, position: int) -> None:
        """Begin a move to `position`."""

    async def run_at(self, rate: float) -> None:
        """Run until told otherwise."""

    async def stop(self) -> None:
        """Ramp down and stand."""

    async def home(self, direction: int) -> None:
        """Begin the search for the reference."""

    async def position(self) -> int:
        """Where the axis is, in steps."""

    async def set_position(self, position: int) -> None:
        """Call the place where the axis stands `position`."""

    async def moving(self) -> bool:
        """Whether the axis moves."""

    async def set_speeds(self, speeds: Speeds) -> Speeds:
        """Make moves so."""

    async def limits(self) -> Limits:
        """Which limit switches are met."""

    async def wait(self) -> None:
        """Wait until the axis stands. Raises MotionFailed."""


class Outlet(Protocol):
    """Where a record shows its fields."""

    async def post(self, field: str, value: Value) -> None:
        """`field` has another value."""

    async def alarm(self, alarm: Alarm) -> None:
        """The record has another alarm."""


class PutFailed(RuntimeError):
    """A put that did not do what it should have done; the text says why."""
