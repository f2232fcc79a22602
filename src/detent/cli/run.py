"""The verb `run`: a cell in virtual time, as fast as it goes."""

import json as json_text
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from detent.cli.overwrite import Overwrite

if TYPE_CHECKING:
    pass


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
    overwrite: Overwrite = False,
    json: bool = False,
) -> None:
    """Run a controller or a cell in virtual time and say where everything ended.

    Without --for it ends when nothing is left to do. Ends with status 1 if a line was refused or a motor lost steps.

    For example: `detent run gs-c200 --send +1000 --send "@ idle" --send V1 --plot move.png`

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
        Tell of a motor that loses steps, but do not fail because of it.
    overwrite
        Write over files that no run has made.
    json
        Print the result as one line of JSON.
    """
    from detent.cell.build import build
    from detent.cell.circuit import Oscillation
    from detent.cell.conversation import Conversation
    from detent.cell.description import Problem
    from detent.cli import exports, outcome, sending
    from detent.cli.codes import FAILED
    from detent.cli.endings import asked_wrongly, failed
    from detent.motors.motor import MotorError
    from detent.realtime.cell_source import find_cell
    from detent.ticks import parse_duration, show_duration

    files = exports.ExportFiles(plot, vcd, sr, npz, steps, sr_rate, steps_frequency, steps_error)
    conversation = Conversation()
    try:
        found = find_cell(target, straps=strap, options=set_, programs=program, pins=pin)
        until = None if for_ is None else parse_duration(for_)
        files.check(found.inputs, overwrite=overwrite)
        cell = build(found.description, found.read, record=bool(files.paths), line_timing=line_timing,
                     typed=conversation.typed)  # fmt: skip
        observer = conversation.attend(cell, keeps=bool(files.paths))
        lines = [sending.addressed(cell, text) for text in send]
        if until is not None and until > cell.latest:
            raise Problem("", "--for", f"with a motor a cell runs for {show_duration(cell.latest)} at most")
    except ValueError as error:
        asked_wrongly(error)
    course = sending.Course(cell, conversation, until)
    try:
        ended = course.run(lines)
        motors = outcome.motors(cell) if found.description.motors else []
    except (Oscillation, MotorError) as error:
        failed(error)
    told = outcome.Outcome(cell, ended, conversation, course.sent, course.unsent, list(observer.moving), motors)
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
