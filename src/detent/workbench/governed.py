"""The cell of a workbench as `realtime.control` looks at it and meddles with it, beside the windows.

Decision 30 says what a program may do while somebody looks into the past: look, and send what then waits with the rest.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from typing import TypeVar

from detent.cell.actions import Action, Discard, Send, TimedAction, Type
from detent.cell.cell import Cell
from detent.cell.description import Description
from detent.cell.history import MOST_WAITING
from detent.realtime.boards.driven import Driven
from detent.realtime.control import Control
from detent.realtime.endpoints.tcp import TcpAddress
from detent.realtime.http import HttpControl
from detent.realtime.pace import LatenessSummary, Pace
from detent.realtime.subject import Subject
from detent.realtime.verbs import Answer, AskedWrongly
from detent.realtime.waiting import Watched
from detent.realtime.watch import Watch
from detent.ticks import SECOND, Ns
from detent.workbench.driven import DrivenEngine
from detent.workbench.engine import BY_PROGRAM, Engine

T = TypeVar("T")


class Governed:
    """The cell of `engine`, made to be controlled, where it stands; in its past it can only be looked at."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    @property
    def cell(self) -> Cell:
        """The cell where it stands."""
        return self._engine.history.cell

    @property
    def watch(self) -> Watch | None:
        """How its units stand there."""
        recording = self.cell.recording
        return recording if isinstance(recording, Watch) else None

    @property
    def watched(self) -> Watched:
        """Where one waits for something."""
        return self._engine.watched

    @property
    def pace(self) -> Pace:
        """Its clock."""
        return self._engine.pacing

    @property
    def driven(self) -> Driven | None:
        """It has no real pins."""
        return None

    @property
    def description(self) -> Description:
        """What it was built from."""
        return self._engine.description

    @property
    def stopped(self) -> str:
        """Why it cannot go on."""
        return self._engine.history.broken

    def ask(self, function: Callable[[], T]) -> "Future[T]":
        """Call `function` soon on the thread that serves; from any thread."""
        return self._engine.ask(function)

    def addresses(self) -> list[tuple[int, str, str]]:
        """Its endpoints."""
        return self._engine.addresses()

    def lateness(self) -> LatenessSummary:
        """How late its deadlines were served since its pace was set."""
        return self.pace.lateness.summary()

    def journal(self) -> tuple[int, Sequence[TimedAction]]:
        """How many actions are forgotten, and those behind them, up to where it stands."""
        return self._engine.history.journal()

    def standing(self) -> Answer:
        """Whether it stands in its past, and why it stands; how many commands wait."""
        history = self._engine.history
        return {
            "past": history.past,
            "present_ns": history.end,
            "why": history.stopped,
            "waiting": len(self._engine.waiting.queue),
        }

    def do(self, action: Action) -> None:
        """Do it, now; what a host sends waits with the rest while time stands. Raises what the engine does."""
        engine = self._engine
        match action:
            case Type(unit, text):
                engine.queue_type(unit, text)
            case Send(line, data):
                engine.queue_send(self.cell.wiring.line_names[line], bytes(data))  # type: ignore[arg-type]
            case Discard(line):
                engine.waiting.drop(self.cell.wiring.line_names[line])
                if not engine.history.past:
                    engine.do(action)
            case _:
                self._refuse_in_the_past()
                engine.do(action)

    def stand(self) -> None:
        """Its time stands."""
        if not self.pace.held:
            self._engine.history.stop(BY_PROGRAM)

    def go(self) -> None:
        """Its time goes on."""
        self._refuse_in_the_past()
        if self.pace.held:
            self._engine.go()

    def present(self) -> None:
        """It stands where it had come to, when somebody took it back."""
        if self._engine.history.past:
            self._engine.rewind(self._engine.history.end)

    def step_event(self) -> None:
        """The next eventful instant; then it stands."""
        self._refuse_in_the_past()
        self._engine.step_event()

    def run_on(self, until: Ns) -> bool:
        """Go on towards `until`, as far as the windows can follow; whether nothing has stopped it."""
        self._refuse_in_the_past()
        engine, history = self._engine, self._engine.history
        engine.send_waiting()
        if history.untold > MOST_WAITING:  # the windows come first
            return True
        history.go()
        history.run_to(until)
        goes_on = not history.stopped
        if goes_on:
            history.stop(BY_PROGRAM)
        return goes_on

    def change_pace(self, factor: float | None) -> None:
        """So many times as fast as real time."""
        self._engine.change_pace(factor)

    def _refuse_in_the_past(self) -> None:
        history = self._engine.history
        if history.past:
            where = f"somebody looks back, at {history.now / SECOND:.6f} s of {history.end / SECOND:.6f} s"
            raise AskedWrongly(where, "present takes the cell to its present; to go on from the past is for hands")


class GovernedMachine(Governed):
    """The cell behind its pins: the machine as it is, whatever windows look at."""

    def __init__(self, engine: DrivenEngine) -> None:
        super().__init__(engine)
        self._machine = engine

    @property
    def cell(self) -> Cell:
        """The cell behind the pins."""
        return self._machine.driven.cell

    @property
    def driven(self) -> Driven:
        """Its real pins."""
        return self._machine.driven

    @property
    def stopped(self) -> str:
        """A machine whose cell cannot go on ends the workbench."""
        return ""

    def journal(self) -> tuple[int, Sequence[TimedAction]]:
        """How many actions are forgotten, and those behind them."""
        return self.cell.journal.forgotten, list(self.cell.journal)

    def standing(self) -> Answer:
        """It never stands."""
        return {}

    def do(self, action: Action) -> None:
        """Do it, now."""
        self._machine.do_there(action)

    def present(self) -> None:
        """It is never elsewhere."""


@contextmanager
def controlled(engine: Engine, address: TcpAddress, token: str | None) -> Iterator[str]:
    """Listen at `address` for who looks and meddles, until the end of the block; the URL. Raises EndpointError."""
    subject: Subject = GovernedMachine(engine) if isinstance(engine, DrivenEngine) else Governed(engine)
    http = HttpControl(Control(subject), address, token)
    try:
        yield http.url
    finally:
        http.close()
