"""A cell that is served, as `realtime.control` looks at it and meddles with it.

`realtime.service.Service` is one that knows only its present; a workbench serves one with a past
(`workbench.governed`).
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Protocol, TypeVar

from detent.cell.actions import Action, TimedAction
from detent.cell.cell import Cell
from detent.cell.description import Description
from detent.realtime.boards.driven import Driven
from detent.realtime.pace import LatenessSummary, Pace
from detent.realtime.verbs import Answer
from detent.realtime.waiting import Watched
from detent.realtime.watch import Watch
from detent.ticks import Ns

T = TypeVar("T")


class Subject(Protocol):
    """Everything but `ask` is for the thread that serves. Words about time are not for one that drives real pins."""

    @property
    def cell(self) -> Cell:
        """To look at, each time anew: a word about time may put another in its place."""

    @property
    def watch(self) -> Watch | None:
        """How its units stand; None if nobody takes note of it. Each time anew, too."""

    @property
    def watched(self) -> Watched | None:
        """Where one waits for something; None as `watch`."""

    @property
    def pace(self) -> Pace:
        """Its clock."""

    @property
    def driven(self) -> Driven | None:
        """Its real pins."""

    @property
    def description(self) -> Description:
        """What it was built from."""

    @property
    def stopped(self) -> str:
        """Why it cannot go on; "" as long as it can."""

    def ask(self, function: Callable[[], T]) -> "Future[T]":
        """Call `function` soon on the thread that serves; from any thread."""

    def addresses(self) -> list[tuple[int, str, str]]:
        """Each endpoint: the number of its line, its kind, and what a client connects to."""

    def lateness(self) -> LatenessSummary:
        """How late its deadlines were served."""

    def journal(self) -> tuple[int, Sequence[TimedAction]]:
        """How many actions are forgotten, and those behind them."""

    def standing(self) -> Answer:
        """What else there is to say about its time."""

    def do(self, action: Action) -> None:
        """Do it, now. Raises what `Cell.do` does, and AskedWrongly."""

    def stand(self) -> None:
        """Its time stands."""

    def go(self) -> None:
        """Its time goes on. Raises AskedWrongly."""

    def present(self) -> None:
        """It stands at its present, if somebody has taken it back."""

    def step_event(self) -> None:
        """The next eventful instant; then it stands. Raises AskedWrongly."""

    def run_on(self, until: Ns) -> bool:
        """Go on towards `until`, as fast as it can; whether nothing has stopped it. Raises AskedWrongly."""

    def change_pace(self, factor: float | None) -> None:
        """So many times as fast as real time; None: free. Raises ValueError."""
