"""The verb `boards`: which boards are plugged in, and whether a machine is wired to one as its cell file says."""

import json as json_text
import select
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from detent.cli.codes import FAILED
from detent.cli.endings import tell

if TYPE_CHECKING:
    from detent.cell.description import Description
    from detent.realtime.boards.checking import Check, Input, Leg
    from detent.realtime.boards.plan import DrivenAxis
    from detent.realtime.boards.ports import Found

LOOK = 6.0  # seconds that a board has to say what it is


def boards(
    *what: str,
    watch: float | None = None,
    jog: Annotated[bool, Parameter(negative=())] = False,
    yes: Annotated[bool, Parameter(negative=())] = False,
    axis: Sequence[str] = (),
    steps: int | None = None,
    speed: int | None = None,
    json: bool = False,
) -> None:
    """Find boards with Klipper firmware; boards check proves a wiring.

    Without arguments every board in /dev/serial/by-id that calls itself Klipper is asked what it is; others only if
    they are named. It is left as it was.

    `detent boards check CELL.toml` moves nothing by itself: it shows every input live, until Enter. Then it asks, axis
    by axis, whether to jog it by one revolution and back, slowly. Enter or Ctrl-C stops a jog at once, and so
    does any input of its unit that changes, in the board itself.

    Ends with 1 if nothing was found, or if a check found something wrong.

    For example: `detent boards /dev/ttyACM0`

    Or: `detent boards check cell.toml --axis slide`

    Parameters
    ----------
    what
        Devices to ask, like /dev/ttyACM0 or fake:rp2040; or the word check and a cell file.
    watch
        check: show the inputs for so many seconds, and not until Enter.
    jog
        check: ask for jogs, though the answers do not come from a terminal.
    yes
        check: jog every axis without asking. Stand by its switch.
    axis
        check: jog this one alone, like slide or table.X. May be given several times.
    steps
        check: jog by so many pulses instead of a revolution.
    speed
        check: pulses a second; without it a revolution takes four seconds.
    json
        Print one line of JSON; jogs only with --yes.
    """
    from detent.cli.endings import asked_wrongly

    if what and what[0] == "check":
        if len(what) != 2:
            asked_wrongly("say which cell: detent boards check CELL.toml")
        _check(what[1], watch, jog and not json, yes, axis, steps, speed, json)
        return
    if watch is not None or jog or yes or axis or steps is not None or speed is not None:
        asked_wrongly(
            "--watch, --jog, --yes, --axis, --steps and --speed are for a check: detent boards check CELL.toml"
        )
    _find(what, json)


# -- which boards there are


def _find(addresses: Sequence[str], json: bool) -> None:
    from detent.cli.endings import failed
    from detent.realtime.boards.ports import BY_ID, candidates

    asked = list(addresses) or candidates()
    if not asked and not json:
        failed(f"no board calls itself Klipper in {BY_ID}; plug one in, flash it, or name its device: "
               "detent boards /dev/ttyACM0")  # fmt: skip
    found = [board for address in asked if (board := _look(address)) is not None]
    if json:
        print(json_text.dumps([board._asdict() for board in found]))
    else:
        for board in found:
            _print_found(board)
    if not found or len(found) < len(asked):
        raise SystemExit(FAILED)


def _look(address: str) -> "Found | None":
    """What one board says; None, and a line on stderr, if it says nothing."""
    from detent.realtime.boards.port import PortError, PortLost
    from detent.realtime.boards.ports import Look, open_port

    try:
        port = open_port(address)
    except PortError as error:
        tell(error)
        return None
    try:
        look, end = Look(port), time.monotonic() + LOOK
        look.start(time.monotonic_ns())
        while not look.turn(time.monotonic_ns()) and time.monotonic() < end:
            due = look.deadline()
            left = 0.02 if due is None else min(max((due - time.monotonic_ns()) / 1e9, 0.0), 0.02)
            select.select(port.reading(), port.writing(), (), left)
        if look.found is None:
            tell(f"{address} does not answer as a board with Klipper firmware would; is it flashed, at "
                 "this baud rate (DEVICE@BAUD), and used by nobody else?")  # fmt: skip
        return look.found
    except PortLost as error:
        tell(error)
        return None
    finally:
        port.close()


def _print_found(board: "Found") -> None:
    print(board.address)
    print(f"  firmware   {board.firmware}")
    print(f"  chip       {board.mcu}, {board.frequency / 1e6:g} MHz")
    queue = f"{board.move_count} entries" if board.move_count else "told when it is configured"
    print(f"  move queue {queue}")
    print(f"  pins       {', '.join(ranges(board.pins))}")
    if board.reserved:
        taken = ", ".join(f"{pin} ({use})" for pin, use in board.reserved.items())
        print(f"  taken      {taken}")
    if board.missing:
        print(f"  too old    it lacks {', '.join(board.missing)}: flash a newer firmware")
    print(f'  in a cell  [boards.main]\n             serial = "{board.address}"')


def ranges(pins: Sequence[str]) -> list[str]:
    """Names like gpio0, gpio1 ... with a row of numbers written as one range."""
    found: list[tuple[str, int, int]] = []
    for pin in pins:
        stem = pin.rstrip("0123456789")
        number = int(pin[len(stem) :] or -1)
        if found and found[-1][0] == stem and number == found[-1][2] + 1 > 0:
            found[-1] = (stem, found[-1][1], number)
        else:
            found.append((stem, number, number))
    return [
        stem if first < 0 else f"{stem}{first}" if first == last else f"{stem}{first} to {stem}{last}"
        for stem, first, last in found
    ]


# -- whether a machine is wired as its cell file says


def _check(
    file: str, watch: float | None, ask: bool, yes: bool, chosen: Sequence[str], steps: int | None,
    speed: int | None, json: bool,
) -> None:  # fmt: skip
    from detent.cell.build import build
    from detent.cell.description import Problem
    from detent.cli.endings import asked_wrongly, failed
    from detent.controllers.catalogue import unknown
    from detent.realtime.boards.checking import LEAD, MOST_RATE, Check, Trouble
    from detent.realtime.boards.drive import Opened, RealPins
    from detent.realtime.cell_source import find_cell

    try:
        found = find_cell(file)
        if steps is not None and not 1 <= steps <= 1_000_000:
            raise Problem("", "--steps", f"{steps}: 1 to 1000000 pulses")
        if speed is not None and not 1 <= speed <= MOST_RATE:
            raise Problem("", "--speed", f"{speed}: 1 to {MOST_RATE} pulses a second, as there is no ramp")
        if watch is not None and not 0 <= watch <= 86_400:
            raise Problem("", "--watch", f"{watch:g}: 0 to 86400 seconds")
        opened = Opened(found.description, found.read, RealPins(lambda news: None), least_lead=LEAD)
    except Problem as problem:
        asked_wrongly(problem)
    legs: dict[str, list[Leg]] = {}
    wrong = ""
    try:
        check = Check(opened, found.description)
        axes = {axis.stepper: axis for axis in check.plan.axes}
        for name in chosen:
            if name not in axes:
                asked_wrongly(Problem("", "--axis", str(unknown("axis", name, tuple(axes)))))
        cell = build(found.description, found.read, record=False)
        helps = {
            (unit, pin.name): pin.help for unit, controller in cell.controllers().items() for pin in controller.pins
        }
        terminal = sys.stdin.isatty() and not json
        try:
            if not json:
                _print_boards(check, found.description)
            _show(check, helps, watch, terminal, json)
            if yes or ask or (terminal and axes):
                for axis in axes.values():
                    if not chosen or axis.stepper in chosen:
                        legs[axis.stepper] = _jog(check, axis, steps, speed, yes, terminal, json)
            check.end()
        except Trouble as trouble:
            wrong = str(trouble)
        inputs = check.inputs(helps)
    finally:
        opened.boards.close()
    if json:
        print(json_text.dumps(_facts(inputs, legs, wrong)))
    if wrong:
        failed(wrong)


def _print_boards(check: "Check", described: "Description") -> None:
    from detent.ticks import show_duration

    for setup, address in check.plan.setups:
        print(f"Board {setup.name}: {address}, ready. Nothing moves.")
        for axis in setup.steppers:
            way = f"direction {axis.dir}" if axis.minus is None else f"minus {axis.minus}"
            print(f"  axis   {axis.name:<16} steps {axis.step}, {way}, pulses of {show_duration(axis.pulse)}")
        for out in setup.outputs:
            print(f"  output {out.name:<16} {out.pin}, at rest {int(out.off)}")
        for chip in setup.drivers:
            where = f"select {chip.select}" if chip.uart is None else f"uart {chip.uart}, address {chip.address}"
            print(f"  driver {chip.name:<16} {chip.kind}, {where}: it answers, and has its currents")


def _show(check: "Check", helps: dict[tuple[str, str], str], watch: float | None, terminal: bool, json: bool) -> None:
    """Every input live: until Enter, or for `watch` seconds; once where nobody watches."""
    from rich.console import Console
    from rich.live import Live
    from rich.table import Table

    def table() -> Table:
        shown = Table(box=None, pad_edge=False, header_style="dim")
        for column in ("input", "pin", "level", "there", "changes", "what it is"):
            shown.add_column(column, no_wrap=column != "what it is")
        for put in check.inputs(helps):
            there = "high" if bool(put.level) is not put.wire.startswith("!") else "low"
            style = "bold yellow" if put.changes else ""
            shown.add_row(f"{put.unit}.{put.pin}", f"{put.board}:{put.wire}", str(put.level), there, str(put.changes),
                          put.help, style=style)  # fmt: skip
        return shown

    end = None if watch is None else time.monotonic() + watch
    if not terminal:
        while end is not None and time.monotonic() < end:
            check.turn()
        if not json:
            Console(highlight=False).print(table())
        return
    print("Close and open each switch by hand, and see its line change." + (" Enter goes on." if end is None else ""))
    with Live(table(), console=Console(highlight=False), auto_refresh=False) as live:
        while (end is None or time.monotonic() < end) and not (end is None and _typed()):
            if check.turn():
                live.update(table(), refresh=True)


def _typed() -> bool:
    """Whether a line was typed; it is taken."""
    if select.select([sys.stdin], (), (), 0)[0]:
        sys.stdin.readline()
        return True
    return False


def _jog(
    check: "Check", axis: "DrivenAxis", steps: int | None, speed: int | None, yes: bool, terminal: bool, json: bool
) -> "list[Leg]":
    """Ask, and jog one axis there and back. Raises Trouble."""
    from detent.realtime.boards.checking import MOST_RATE, SLOW

    turn = check.revolution(axis)
    count = steps if steps is not None else turn
    rate = speed if speed is not None else max(min(turn // SLOW, MOST_RATE), 1)
    if not json:
        print(f"\n{axis.stepper}: {count} pulses plus at {rate}/s, then back ({turn} are a revolution). "
              "Any input of the unit that changes stops it.")  # fmt: skip
        for name, level in check.guards(axis).items():
            print(f"  {name} is {level}")
    if not yes:
        print(f"THE MOTOR WILL MOVE. Is its way free? Jog {axis.stepper}? [y/N] ", end="", flush=True)
        answer = sys.stdin.readline()
        if not terminal:
            print()
        if answer.strip().lower() not in ("y", "yes"):
            print("Not jogged.")
            return []
        if terminal:
            print("Enter stops it at once.", flush=True)
    legs: list[Leg] = []
    jog = check.jog(axis, count, rate, _typed if terminal else lambda: False)
    for way in ("plus", "minus"):
        if legs and not legs[-1].made:
            break
        try:
            if not json:  # the way is told while the motor turns
                print(f"  {way:<5} ", end="", flush=True)
            legs.append(next(jog))
        except BaseException as error:
            if not json:
                print(flush=True)
            if isinstance(error, (KeyboardInterrupt, SystemExit)):
                tell("stopped by hand; the boards are shut down, and their outputs off")
            raise
        if not json:
            _print_leg(legs[-1])
    next(jog, None)  # its driver is let go
    return legs


def _print_leg(leg: "Leg") -> None:
    ended = f"stopped: {leg.why}" if leg.why else "as many as were asked"
    print(f"{leg.made} of {leg.asked} pulses, {ended}", flush=True)
    for met in leg.met:
        print(f"        {met.input} became {met.level} after {met.steps}")


def _facts(inputs: "list[Input]", legs: "dict[str, list[Leg]]", wrong: str) -> dict[str, object]:
    jogs = {
        name: [{**leg._asdict(), "met": [met._asdict() for met in leg.met]} for leg in each]
        for name, each in legs.items()
    }
    return {"inputs": [put._asdict() for put in inputs], "jogs": jogs, "wrong": wrong or None}
