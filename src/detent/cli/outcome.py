"""What `run` tells at its end: where everything is, what was said, what was refused, what was lost."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from detent.cli.endings import tell

if TYPE_CHECKING:
    from detent.cell.cell import Cell
    from detent.cell.conversation import Conversation, Exchange
    from detent.cell.mechanics import Mechanics
    from detent.cli.sending import Line
    from detent.controllers.device import Controller, Refused
    from detent.ticks import Ns

MOST_SHOWN = 40  # lines of a script, or refused ones, that people are shown; --json has all
SLICE = 60_000_000_000  # ns; a rotor that has long to go is followed so far at a time


class Rotor(NamedTuple):
    """Where a motor's rotor is, where its pulses want it, in steps of the axis, and how many of these it has lost."""

    name: str
    place: float
    commanded: float
    lost: int


class Outcome(NamedTuple):
    """Everything that there is to tell."""

    cell: "Cell"
    ended: str  # time, idle, endless
    conversation: "Conversation"
    sent: "list[Exchange]"
    unsent: "list[Line]"
    moving: "list[tuple[int, str]]"
    motors: list[Rotor]

    @property
    def refused(self) -> "list[tuple[str, Refused, Exchange | None]]":
        """What was turned down: the unit, what it says, and the line that it was."""
        from detent.controllers.device import Refused

        self.conversation.listen()
        axes, answers = self.cell.controllers(), self.conversation.answers
        adapters = [one for one in self.conversation.exchanges if one.unit not in axes and "#" in answers(one)]
        return self.conversation.refused + [
            (
                one.unit,
                Refused(one.at, one.sent, "no axis of that name is known to it, or none answers; & looks for them"),
                one,
            )
            for one in adapters
        ]

    @property
    def said(self) -> dict[str, list[str]]:
        """What units said unasked."""
        return self.conversation.said()

    @property
    def scripted(self) -> "list[Exchange]":
        """What the cell's script sent."""
        return [exchange for exchange in self.conversation.exchanges if exchange.scripted]


def quiet(cell: "Cell") -> Outcome:
    """Of a cell that nobody has listened to, at its end."""
    from detent.cell.conversation import Conversation

    return Outcome(cell, "idle", Conversation(), [], [], [], [])


def motors(cell: "Cell") -> list[Rotor]:
    """How the rotors stand. Raises MotorError.

    A rotor that has lost steps stands behind, or before, by whole electrical cycles: four full steps each.
    """
    from detent.cell.mechanics import Mechanics
    from detent.cli.unit import progress
    from detent.hosts.exchange import Progress

    found = []
    for name, part in zip(cell.wiring.names, cell.parts, strict=True):
        if not isinstance(part, Mechanics):
            continue
        with progress(f"Following the rotor of {name}") as watch:
            for at in range(SLICE, cell.now, SLICE):
                part.catch_up(at)
                watch(Progress(at, cell.now))
            found.append(_rotor(name, part, cell.now))
    return found


def _rotor(name: str, motor: "Mechanics", now: "Ns") -> Rotor:
    place, commanded = motor.place(now), motor.command(now)
    return Rotor(
        name, round(place, 3), round(commanded, 3), abs(round(round((commanded - place) / motor.cycle) * motor.cycle))
    )


def facts(told: Outcome) -> dict[str, object]:
    """Where everything ended, as --json prints it."""
    cell = told.cell
    told.conversation.listen()
    units = {name: _where(unit, cell.now) for name, unit in cell.controllers().items()}
    result: dict[str, object] = {"time_ns": cell.now, "ended": told.ended, "units": units}
    answers = told.conversation.answers
    if told.sent:
        result["exchanges"] = [{"unit": one.unit, "sent": one.sent, "answers": answers(one)} for one in told.sent]
    if told.unsent:
        result["unsent"] = [line._asdict() for line in told.unsent]
    if told.said:
        result["said"] = told.said
    if told.scripted:
        result["script"] = [
            {"at_ns": one.at, "unit": one.unit, "sent": one.sent, "answers": answers(one)} for one in told.scripted
        ]
    if told.conversation.cautions:
        result["cautions"] = [
            {"at_ns": caution.at, "unit": unit, "line": caution.frame, "what": caution.what}
            for unit, caution in told.conversation.cautions
        ]
    if told.refused:
        result["refused"] = [
            {"at_ns": refused.at, "unit": unit, "line": refused.frame if line is None else line.sent,
             "reason": refused.reason, "answers": [] if line is None else answers(line)}
            for unit, refused, line in told.refused
        ]  # fmt: skip
    if told.cell.wiring.remarks:
        result["remarks"] = list(told.cell.wiring.remarks)
    if told.moving:
        result["moving"] = _moving(told)
    if told.motors:
        result["motors"] = {
            motor.name: {"place": motor.place, "commanded": motor.commanded, "lost": motor.lost}
            for motor in told.motors
        }
    return result


def _where(unit: "Controller", now: "Ns") -> dict[str, object]:
    """Where a unit is; one with several axes names the place of each."""
    where: dict[str, object] = unit.status(now)._asdict()
    if len(unit.axes) > 1:
        places = {axis: unit.status(now, axis) for axis in unit.axes}
        where["axes"] = {axis: {"position": at.position, "pulses": at.pulses} for axis, at in places.items()}
    return where


def _moving(told: Outcome) -> list[str]:
    """The axes that are in motion."""
    names = told.cell.wiring.names
    return [f"{names[unit]}.{axis}" if axis else names[unit] for unit, axis in told.moving]


def show(told: Outcome, written: Sequence[Path]) -> None:
    """Where everything ended, for people."""
    from detent.ticks import show_duration

    cell, conversation = told.cell, told.conversation
    conversation.listen()
    several = len(cell.controllers()) > 1
    for speaker, lines in told.said.items():
        for line in lines:
            print(f"< {speaker + ': ' if several else ''}{line}")
    scripted = 0
    for one in conversation.exchanges:
        scripted += one.scripted
        if one.scripted and scripted > MOST_SHOWN:
            continue
        when = f"{show_duration(one.at) if one.at else '0 s'} " if one.scripted else ""
        print(f"{when}> {one.unit + ': ' if several else ''}{one.sent}")
        for answer in conversation.answers(one):
            print(f"< {answer}")
    if scripted > MOST_SHOWN:
        print(f"... and {scripted - MOST_SHOWN} more lines of the script: --json has them all")
    rows = []
    moving = _moving(told)
    at_work = []
    for name, unit in cell.controllers().items():
        for axis in unit.axes:
            status = unit.status(cell.now, axis)
            shown = f"{name}.{axis}" if axis else name
            rows.append((shown, unit.model, str(status.position), str(status.pulses), status.state))
            if shown in moving or status.state in ("running", "homing"):
                at_work.append(shown)
    _table(("unit", "model", "position", "pulses", "state"), rows, right=("position", "pulses"))
    if told.motors:
        stand = [(one.name, f"{one.place:.2f}", f"{one.commanded:.2f}", str(one.lost)) for one in told.motors]
        titles = ("motor", "rotor at", "commanded", "steps lost")
        _table(titles, stand, right=titles[1:])
    time = show_duration(cell.now)
    match told.ended:
        case "idle" if at_work:
            print(f"Nothing more will happen by itself after {time}; {', '.join(at_work)} still at work.")
            if moving:
                run_on = "runs" if len(moving) == 1 else "run"
                print(f"{', '.join(moving)} {run_on} on for ever: stop it, or name --for TIME, like --for 60")
        case "idle":
            print(f"Nothing left to do after {time} of virtual time.")
        case "endless":
            print(f"Stopped at {time}, in the middle of its work.")
        case _:
            print(f"Ran for {time} of virtual time.")
    for path in written:
        print(f"Wrote {path}")


def _table(titles: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[str]) -> None:
    """Print columns, those of numbers to the `right`; without rich, which takes longer to load than a run takes."""
    widths = [max(len(row[k]) for row in (titles, *rows)) for k in range(len(titles))]
    dim, plain = ("\033[2m", "\033[0m") if sys.stdout.isatty() and "NO_COLOR" not in os.environ else ("", "")
    for row in (titles, *rows):
        cells = [
            text.rjust(width) if title in right else text.ljust(width)
            for title, text, width in zip(titles, row, widths, strict=True)
        ]
        line = "  ".join(cells)
        print(f"{dim}{line}{plain}" if row is titles else line)


def warn(told: Outcome) -> None:
    """What went wrong, a line each on stderr."""
    from detent.ticks import show_duration

    for remark in told.cell.wiring.remarks:
        _warn(remark)
    for unit, caution in told.conversation.cautions[:MOST_SHOWN]:
        _warn(f"{unit} obeys {caution.frame!r} at {show_duration(caution.at)}: {caution.what}")
    for unit, refused, line in told.refused[:MOST_SHOWN]:
        answers = [] if line is None else told.conversation.answers(line)
        answered = f"; it answered {' '.join(answers)}" if answers else "; it answered nothing"
        what = refused.frame if line is None else line.sent
        _warn(f"{unit} refused {what!r} at {show_duration(refused.at)}: {refused.reason}{answered}")
    if len(told.refused) > MOST_SHOWN:
        _warn(f"... and {len(told.refused) - MOST_SHOWN} more were refused: --json has them all")
    for motor in told.motors:
        if motor.lost:
            _warn(
                f"{motor.name} lost {motor.lost} steps: its rotor is at {motor.place:.2f} and not at "
                f"{motor.commanded:.2f}; move slower or with longer ramps, or say --allow-loss"
            )
    if told.unsent:
        lines = ", ".join(repr(line.text) for line in told.unsent[:MOST_SHOWN])
        _warn(f"the time of --for was over before these were sent: {lines}; give it more")
    if told.ended == "endless":
        from detent.cli.sending import MOST_INSTANTS

        _warn(
            f"after {MOST_INSTANTS} events the program looks endless; say how long to run it: --for TIME, like --for 60"
        )


def _warn(text: str) -> None:
    tell(text)
