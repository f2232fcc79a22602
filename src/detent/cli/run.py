"""The verb `run`: a cell in virtual time, as fast as it goes."""

import json as json_text
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from cyclopts import Parameter

if TYPE_CHECKING:
    from detent.cell.cell import Cell
    from detent.cli.target import Target
    from detent.controllers.device import Controller
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
    npz: Path | None = None,
    steps: Path | None = None,
    steps_frequency: int = 12_000_000,
    steps_error: Literal["exact", "1us", "5us", "25us"] = "1us",
    strap: Sequence[str] = (),
    set_: Annotated[Sequence[str], Parameter(name="--set")] = (),
    line_timing: Annotated[bool, Parameter(negative="--no-line-timing")] = True,
    json: bool = False,
) -> None:
    """Run a controller or a cell in virtual time and say where everything ended.

    Without --for it ends when nothing is left to do.

    Parameters
    ----------
    target
        A model by name, or a cell file (CELL.toml).
    program
        A program to load and execute: FILE, or UNIT=FILE for a cell.
    send
        A command line for the unit to receive, without checksum and carriage return, which are added. Given
        several times: each is sent when the one before has been answered. UNIT:LINE for a cell.
    for_
        Virtual time to run, like 2.5 (seconds), '400 ms' or '1 h'.
    plot
        Draw positions, speeds and pins over time: a .png, .svg or .pdf file.
    vcd
        Write a value change dump with every pin and pulse (GTKWave, PulseView).
    sr
        Write a sigrok session (PulseView, sigrok-cli).
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
    line_timing
        Let characters take their time on the serial line.
    json
        Print the result as one line of JSON.
    """
    from detent.cell.build import build
    from detent.cell.delivery import Oscillation
    from detent.cell.description import Problem
    from detent.cli.target import asked_wrongly, failed
    from detent.cli.target import target as find
    from detent.motors.motor import MotorError
    from detent.outputs.figures import check
    from detent.ticks import parse_duration

    try:
        found = find(target, straps=strap, options=set_, programs=program)
        until = None if for_ is None else parse_duration(for_)
        if plot is not None:
            check(plot)
        if steps_frequency < 1:
            raise ValueError(f"--steps-frequency {steps_frequency}: a clock has 1 tick a second or more, like 12000000")
        wanted = [path for path in (plot, vcd, sr, npz, steps) if path is not None]
        cell = build(found.description, found.read, record=bool(wanted), line_timing=line_timing)
        lines = [_addressed(cell, text) for text in send]
    except Problem as error:
        asked_wrongly(error)
    except ValueError as error:
        asked_wrongly(error)
    try:
        exchanges = [_exchange(cell, unit, text) for unit, text in lines]
        ended = _run_on(cell, until)
    except (Oscillation, MotorError) as error:
        failed(error)
    try:
        _write(cell, found, plot=plot, vcd=vcd, sr=sr, npz=npz, steps=steps, clock=(steps_frequency, steps_error))
    except MotorError as error:
        failed(error)
    except ValueError as error:
        asked_wrongly(error)
    except OSError as error:
        failed(f"{error.filename}: cannot write it: {error.strerror}")
    if json:
        print(json_text.dumps(result(cell, ended, exchanges)))
    else:
        print_result(cell, ended, exchanges, wanted)


class Exchange(NamedTuple):
    """A command line and what came back."""

    unit: str
    sent: str
    answers: list[str]


def _addressed(cell: "Cell", text: str) -> tuple[str, str]:
    """The unit a line is for, and the line."""
    from detent.cell.description import Problem
    from detent.controllers.catalogue import unknown

    units = cell.talkers() or list(cell.controllers())
    unit, colon, line = (units[0], ":", text) if len(units) == 1 else text.partition(":")
    if not colon:
        raise Problem("", "--send", f"{text!r}: a cell has several units, write UNIT:LINE")
    if unit not in units:
        raise Problem("", "--send", str(unknown("unit", unit, units)))
    if cell.wiring.line_of[cell.unit(unit)] < 0:
        raise Problem("", "--send", f"{unit} is on no line")
    try:
        cell.talker(unit).frame(line)
    except ValueError as error:
        raise Problem("", "--send", str(error)) from None
    return unit, line


def _exchange(cell: "Cell", unit: str, text: str) -> Exchange:
    """Send a line and let the cell go on until it is answered and the line is quiet, or nothing is left to do."""
    from detent.controllers.catalogue import model
    from detent.ticks import NEVER

    line, controller = cell.lines[cell.wiring.line_of[cell.unit(unit)]], cell.talker(unit)

    def heard() -> list[str]:
        return controller.answers(bytes(h.char.value for h in line.heard))

    one = cell.controllers().get(unit)  # none: an adapter
    while one is not None and one.status(cell.now).state == "starting" and cell.step() is not None:
        pass  # a board that is deaf after its reset
    while line.deadline < NEVER and cell.step() is not None:
        pass
    line.take()
    cell.type(unit, text)
    answered = one is None or model(one.model).answered(text)
    for _ in range(MOST_INSTANTS):
        busy = getattr(controller, "answering", False)  # of those that know: an echo is no answer yet
        if line.deadline >= NEVER and not busy and (not answered or heard()):
            break
        if cell.step() is None:
            break
    answers = heard()
    line.take()
    return Exchange(unit, text, answers)


def _run_on(cell: "Cell", until: "Ns | None") -> str:
    """Run to `until`, or until nothing is left to do: how it ended, in a word: time, idle, endless."""
    if until is not None:
        cell.run_to(max(until, cell.now))
        return "time"
    for _ in range(MOST_INSTANTS):
        if cell.step() is None:
            return "idle"
    return "endless"


def _write(
    cell: "Cell", target: "Target", *, plot: Path | None, vcd: Path | None, sr: Path | None, npz: Path | None,
    steps: Path | None, clock: tuple[int, str],
) -> None:  # fmt: skip
    """Write the files that are wanted. Raises ValueError for a wrong choice, OSError."""
    if plot is None and vcd is None and sr is None and npz is None and steps is None:
        return
    from detent.outputs import signals
    from detent.ticks import parse_duration

    described = target.description
    seen = signals.of_cell(cell, {name: unit.shaft for name, unit in described.units.items()})
    if vcd is not None:
        from detent.outputs import vcd as vcd_file

        vcd_file.write(vcd, seen)
    if sr is not None:
        from detent.outputs import sigrok

        sigrok.write(sr, seen)
    if npz is not None:
        from detent.outputs import arrays

        arrays.write(npz, seen)
    if steps is not None:
        from detent.outputs import step_file

        frequency, error = clock
        try:
            step_file.write(steps, seen, frequency, "exact" if error == "exact" else parse_duration(error))
        except ValueError as problem:
            raise ValueError(f"--steps-frequency {frequency}: {problem}; take a faster clock") from None
    if plot is not None:
        from detent.outputs import figures, rotors

        figures.write(plot, seen, title=described.title or target.name, rotors=rotors.of_cell(cell))


def result(cell: "Cell", ended: str, exchanges: list[Exchange]) -> dict[str, object]:
    """Where everything ended, as --json prints it."""
    units = {name: _where(unit, cell.now) for name, unit in cell.controllers().items()}
    result: dict[str, object] = {"time_ns": cell.now, "ended": ended, "units": units}
    if exchanges:
        result["exchanges"] = [exchange._asdict() for exchange in exchanges]
    return result


def _where(unit: "Controller", now: "Ns") -> dict[str, object]:
    """Where a unit is; one with several axes names the place of each."""
    where: dict[str, object] = unit.status(now)._asdict()
    if len(unit.axes) > 1:
        places = {axis: unit.status(now, axis) for axis in unit.axes}
        where["axes"] = {axis: {"position": at.position, "pulses": at.pulses} for axis, at in places.items()}
    return where


def print_result(cell: "Cell", ended: str, exchanges: list[Exchange], written: list[Path]) -> None:
    """Where everything ended, for people."""
    from rich.console import Console
    from rich.table import Table

    from detent.ticks import show_duration

    console = Console(highlight=False)
    several = len(cell.controllers()) > 1
    for exchange in exchanges:
        console.print(f"> {exchange.unit + ': ' if several else ''}{exchange.sent}", markup=False)
        for answer in exchange.answers:
            console.print(f"< {answer}", markup=False)
    table = Table(box=None, pad_edge=False, header_style="dim")
    for column in ("unit", "model", "position", "pulses", "state"):
        table.add_column(column, justify="right" if column in ("position", "pulses") else "left")
    moving = []
    for name, unit in cell.controllers().items():
        for axis in unit.axes:
            status = unit.status(cell.now, axis)
            shown = f"{name}.{axis}" if axis else name
            table.add_row(shown, unit.model, str(status.position), str(status.pulses), status.state)
            if status.state in ("running", "homing"):
                moving.append(shown)
    console.print(table)
    time = show_duration(cell.now)
    match ended:
        case "idle" if moving:
            print(f"Nothing more will happen by itself after {time}; {', '.join(moving)} still at work.")
        case "idle":
            print(f"Nothing left to do after {time} of virtual time.")
        case "endless":
            print(f"Stopped at {time}: after {MOST_INSTANTS} events the program looks endless.", file=sys.stderr)
            print("Say how long to run it: --for TIME, like --for 60", file=sys.stderr)
        case _:
            print(f"Ran for {time} of virtual time.")
    for path in written:
        print(f"Wrote {path}")
