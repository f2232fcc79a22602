"""The lines that `run` sends to a cell: who is meant, and the way of the cell through them to its end."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from detent.cell.cell import Cell
    from detent.cell.conversation import Conversation, Exchange
    from detent.ticks import Ns

MOST_INSTANTS = 500_000  # eventful instants without --for, after which a cell counts as endless


class Line(NamedTuple):
    """A command line to a unit."""

    unit: str
    text: str


class Pause(NamedTuple):
    """Wait so long; None: until nothing moves and no program runs."""

    length: "Ns | None"


Step = Line | Pause


def addressed(cell: "Cell", text: str) -> Step:
    """What a --send asks for. Raises Problem."""
    from detent.cell.description import Problem
    from detent.controllers.catalogue import unknown
    from detent.ticks import parse_duration

    if text.startswith("@ ") or text == "@idle":
        try:
            return Pause(None if text[1:].strip() == "idle" else parse_duration(text[1:]))
        except ValueError as error:
            raise Problem("", "--send", f"{error}; or '@ idle'") from None
    units = cell.serial_units() or list(cell.controllers())
    named = text.startswith(f"{units[0]}:") if len(units) == 1 else True  # the only one may be left out
    unit, colon, line = text.partition(":") if named else (units[0], ":", text)
    if not colon:
        raise Problem("", "--send", f"{text!r}: a cell has several units, write UNIT:LINE")
    if unit not in units:
        raise Problem("", "--send", str(unknown("unit", unit, units)))
    if cell.wiring.line_of[cell.unit(unit)] < 0:
        raise Problem("", "--send", f"{unit} is on no line")
    try:
        cell.serial_unit(unit).frame(line)
    except ValueError as error:
        raise Problem("", "--send", str(error)) from None
    return Line(unit, line)


class Course:
    """The way of a cell through the lines that it is sent, to its end; never beyond `until`."""

    def __init__(self, cell: "Cell", conversation: "Conversation", until: "Ns | None") -> None:
        self._cell, self._conversation, self._until = cell, conversation, until
        self.sent: list[Exchange] = []
        self.unsent: list[Line] = []  # as the time was over

    def run(self, steps: Sequence[Step]) -> str:
        """How it ended, in a word: time, idle, endless."""
        for place, step in enumerate(steps):
            if isinstance(step, Pause):
                self._wait(step)
            elif not self._exchange(step):
                self.unsent = [left for left in steps[place:] if isinstance(left, Line)]
                break
        return self._run_on()

    def _step(self) -> bool:
        """Let the next eventful instant happen; False if there is none, or only behind the time."""
        at = self._cell.next_event()
        if at is None or (self._until is not None and at > self._until):
            return False
        self._cell.step()
        return True

    def _wait(self, pause: Pause) -> None:
        cell = self._cell
        if pause.length is not None:
            until = cell.now + pause.length
            cell.run_to(until if self._until is None else min(until, max(self._until, cell.now)))
            return
        cell.run_to(cell.now)  # what the script does in this instant comes first
        for _ in range(MOST_INSTANTS):
            if not self._busy() or not self._step():
                return

    def _busy(self) -> bool:
        """Whether anything moves, a program runs, or something is still being said."""
        from detent.cell.conversation import Observer
        from detent.ticks import NEVER

        cell = self._cell
        assert isinstance(cell.recording, Observer)
        if cell.recording.moving or any(line.deadline < NEVER for line in cell.lines):
            return True
        states = [unit.status(cell.now, axis).state for unit in cell.controllers().values() for axis in unit.axes]
        return any(state in ("running", "homing", "moving", "starting") for state in states)

    def _exchange(self, line: Line) -> bool:
        """Send a line and let the cell go on until it is answered and the line is quiet, or nothing is left to do.

        False if the time is over before it can be sent.
        """
        from detent.controllers.catalogue import model
        from detent.ticks import NEVER

        cell, conversation = self._cell, self._conversation
        wire, controller = cell.lines[cell.wiring.line_of[cell.unit(line.unit)]], cell.serial_unit(line.unit)
        one = cell.controllers().get(line.unit)  # none: an adapter
        while one is not None and one.status(cell.now).state == "starting" and self._step():
            pass  # a board that is deaf after its reset
        while wire.deadline < NEVER and self._step():
            pass
        if self._until is not None and cell.now >= self._until:
            return False
        cell.run_to(cell.now)  # what the script does in this instant comes first
        conversation.scripted = False
        cell.type(line.unit, line.text)
        conversation.scripted = True
        exchange = conversation.exchanges[-1]
        self.sent.append(exchange)
        answered = one is None or model(one.model).answered(line.text)
        for _ in range(MOST_INSTANTS):
            conversation.listen()
            busy = getattr(controller, "answering", False)  # of those that know: an echo is no answer yet
            if wire.deadline >= NEVER and not busy and (not answered or conversation.answers(exchange)):
                break
            if not self._step():
                break
        return True

    def _run_on(self) -> str:
        """Run to the time, or until nothing is left to do."""
        cell = self._cell
        if self._until is not None:
            cell.run_to(max(self._until, cell.now))
            return "time"
        for _ in range(MOST_INSTANTS):
            if cell.step() is None:
                return "idle"
        return "endless"
