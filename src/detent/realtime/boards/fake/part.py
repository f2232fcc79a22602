"""What every configurable thing of the fake board is, and what it needs of the board."""

from collections.abc import Callable
from typing import Any, Protocol

from detent.realtime.boards.dictionary import Value
from detent.realtime.boards.fake.machine import Machine


class Shutdown(Exception):
    """The firmware gives up, for this reason."""


class Home(Protocol):
    """The board, as its parts see it."""

    machine: Machine
    frequency: int
    now: int
    chips: dict[object, Any]

    def at(self, tick: int, what: Callable[[int], None], *, check: bool = True) -> list[bool]:
        """Call `what` at `tick`; False in the list that is returned takes it back."""

    def whole(self, low: int) -> int:
        """The tick nearest to now whose low 32 bits these are."""

    def respond(self, name: str, **values: Value) -> None:
        """Send a response."""

    def take_move(self) -> None:
        """An entry of the move queue."""

    def free_move(self) -> None:
        """Give it back."""

    def pin(self, number: Value) -> str:
        """The name of a pin."""

    def part(self, oid: int, kind: type) -> Any:
        """The configured thing with that number."""


class Part:
    """A configured thing. It is told of shutdowns and of levels of input pins."""

    oid = -1

    def __init__(self, board: Home) -> None:
        self.board = board

    def shut_down(self) -> None:
        """Go back to the safe state; timers are gone."""

    def pin_changed(self, pin: str, level: bool, tick: int) -> None:
        """An input pin has another level."""
