"""The verb `run`: a cell in virtual time, as fast as it goes."""

import json as json_text
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from cyclopts import Parameter

if TYPE_CHECKING:
    from detent.cell.cell import Cell
    from detent.cell.conversation import Conversation, Exchange
    from detent.ticks import Ns

MOST_INSTANTS = 500_000  # eventful instants without --for, after which a cell counts as endless


def run(
    target: str,
    *,
    program: Sequence[str] = (),
    send: Annotated[Sequence[str], Parameter(allow_leading_hyphen=True)] = (),
    for_: Annotated[str | None, Parameter(name="--for")] = None,
    plot: Path | None = None,
    vcd: Path | None = None,
    sr: Path | None = None,
    sr_rate: int | None = None,
    npz: Path | None = None,
    steps: Path | None = None,
    steps_frequency: int = 12_000_000,
    steps_error: Literal["exact", "1us", "5us", "25us"] = "1us",
    strap: Sequence[str] = (),
    set_: Annotated[Sequence[str], Parameter(name="--set")] = (),
    pin: Sequence[str] = (),
    line_timing: Annotated[bool, Parameter(negative="--no-line-timing")] = True,
    allow_loss: Annotated[bool, Parameter(negative=())] = False,
    force: Annotated[bool, Parameter(negative=())] = False,
    json: bool = False,
) -> None:
    """Run a controller or a cell in virtual time and say where everything ended.

    Without --for it ends when nothing is left to do. Ends with status 1 if a line was refused or a motor lost steps.

    Parameters
    ----------
    target
        A model by name, or a cell file (CELL.toml).
    program
        A program to load and execute: FILE, or UNIT=FILE for a cell.
    send
        A command line for the unit to receive, without checksum and carriage return, which are added. Given
        several times: each is sent when the one before has been answered. UNIT:LINE for a cell. '@ 500 ms' waits so
        long in between, '@ idle' until nothing moves and no program runs.
    for_
        Virtual time to run, like 2.5 (seconds), '400 ms' or '1 h'.
    plot
        Draw positions, speeds and pins over time: a .png, .svg or .pdf file.
    vcd
        Write a value change dump with every pin and pulse (GTKWave, PulseView).
    sr
        Write a sigrok session (PulseView, sigrok-cli).
    sr_rate
        Samples a second of the sigrok session; 1000000 unless given. Fewer make long runs quick.
    npz
        Write pulse times and pin changes as NumPy arrays.
    steps
        Write the pulses as runs of steps, as a motion board executes them: a CSV file, a run a row.
    steps_frequency
        Ticks a second of that board's clock.
    steps_error
        How far a pulse may be from its time; exact: on the nearest tick.
    strap
        PIN=LEVEL (low, high, open), or UNIT.PIN=LEVEL for a cell.
    set_
        OPTION=VALUE, or UNIT.OPTION=VALUE for a cell.
    pin
        PIN=LEVEL: an input is held at a level, or UNIT.PIN=LEVEL for a cell.
    line_timing
        Let characters take their time on the serial line.
    allow_loss
        A motor that loses steps is told, and no failure.
    force
        Write over files that no run has made.
    json
        Print the result as one line of JSON.
    """
    from detent.cell.build import build
    from detent.cell.conversation import Conversation
    from detent.cell.delivery import Oscillation
    from detent.cell.description import Problem
    from detent.cli import FAILED, exports, outcome
    from detent.cli.endings import asked_wrongly, failed
    from detent.motors.motor import MotorError
    from detent.realtime.cell_source import find_cell
    from detent.ticks import parse_duration, show_duration

    files = exports.ExportFiles(plot, vcd, sr, npz, steps, sr_rate, steps_frequency, steps_error)
    conversation = Conversation()
    try:
        found = find_cell(target, straps=strap, options=set_, programs=program, pins=pin)
        until = None if for_ is None else parse_duration(for_)
        files.check(found.inputs, force=force)
        cell = build(found.description, found.read, record=bool(files.paths), line_timing=line_timing,
                     typed=conversation.typed)  # fmt: skip
        witness = conversation.attend(cell, keeps=bool(files.paths))
        lines = [_addressed(cell, text) for text in send]
        if until is not None and until > cell.latest:
            raise Problem("", "--for", f"with a motor a cell runs for {show_duration(cell.latest)} at most")
    except ValueError as error:
        asked_wrongly(error)
    course = _Course(cell, conversation, until)
    try:
        ended = course.run(lines)
        motors = outcome.motors(cell) if found.description.motors else []
    except (Oscillation, MotorError) as error:
        failed(error)
    told = outcome.Outcome(cell, ended, conversation, course.sent, course.unsent, list(witness.moving), motors)
    try:
        exports.write(cell, found, files)
    except MotorError as error:
        failed(error)
    except ValueError as error:
        asked_wrongly(error)
    except OSError as error:
        failed(f"{error.filename}: cannot write it: {error.strerror or error}")
    if json:
        print(json_text.dumps(outcome.facts(told)))
    else:
        outcome.show(told, files.paths)
    outcome.warn(told)
    if told.refused or told.unsent or (not allow_loss and any(motor.lost for motor in motors)):
        raise SystemExit(FAILED)


class Line(NamedTuple):
    """A command line to a unit."""

    unit: str
    text: str


class Pause(NamedTuple):
    """Wait so long; None: until nothing moves and no program runs."""

    length: "Ns | None"


Step = Line | Pause


def _addressed(cell: "Cell", text: str) -> Step:
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
    unit, colon, line = (units[0], ":", text) if len(units) == 1 else text.partition(":")
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


class _Course:
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
        for _ in range(MOST_INSTANTS):
            if not self._busy() or not self._step():
                return

    def _busy(self) -> bool:
        """Whether anything moves, a program runs, or something is still being said."""
        from detent.cell.conversation import Witness
        from detent.ticks import NEVER

        cell = self._cell
        assert isinstance(cell.recording, Witness)
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
