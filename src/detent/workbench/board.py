"""The state of a cell as the table that windows show (see `live`), and the actions that windows may do to it.

Keys: ``now begin end pace held why past faster late dropped marks crashed silent title queue control faults branches``;
of real pins ``real`` (driven, fault, None) ``realwhy slips``; for each unit ``u.UNIT.`` and
``powered state address running error errorat hand reg unsaved stored memory pin.PIN x.AXIS.position|shaft|pulses|rate``
(a single axis has no name: ``x..position``); for each switch ``s.SWITCH.`` and ``level low high``; for each motor
``m.MOTOR.`` and ``place command speed lost``; for each line ``l.LINE.format``. Times are in ns,
places in steps, rates in steps/s.
"""

import asyncio
from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from detent.pins import Level
from detent.ticks import MS, Ns
from detent.workbench.live import Live, Value
from detent.workbench.messages import Mark, State, UnitState
from detent.workbench.stops import BOARDS
from detent.workbench.words import check_typed

if TYPE_CHECKING:
    from detent.workbench.client import Bench

PACES: Sequence[float | None] = (0.001, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 100.0, None)
"""The notches of the pace, times real time; None: as fast as it goes."""

SILENT = 4.0
"""Seconds without a word of the cell's process, after which a person is told."""

IDLE = "nothing is due: at max, time stands until something is"

LevelField = Annotated[Level, Field(ge=0, le=1)]
PlaceField = Annotated[float, Field(allow_inf_nan=False)]
Text = Annotated[str, Field(max_length=4096)]


class Board:
    """Keeps the table of `live` at the state of `bench`, and offers its actions."""

    def __init__(self, bench: "Bench", live: Live) -> None:
        self._bench, self._live = bench, live
        self._marks: tuple[int, Mark | None, Mark | None] = (-1, None, None)
        self.renew()
        bench.on_change(self.renew)
        _offer(bench, live)
        self._hearing = asyncio.get_running_loop().create_task(self._hear())

    async def _hear(self) -> None:
        """Show for how many seconds the process of the cell has said nothing, once that is longer than it should."""
        before = 0.0
        while True:
            await asyncio.sleep(1.0)
            silent = self._bench.silent
            # twice in a row: this process may have been away itself, and not have read yet what was said
            long = min(silent, before + 1.0) > SILENT
            before = silent
            self._live.put({"silent": round(silent) if long else None})

    def renew(self) -> None:
        """Show what the bench knows now."""
        bench = self._bench
        values = table(bench.state)
        values["control"] = bench.control_url
        values["crashed"], values["title"] = bench.crashed, bench.picture.title or bench.picture.target
        marks = bench.state.marks
        known = (len(marks), marks[0] if marks else None, marks[-1] if marks else None)
        if known != self._marks:  # hundreds of them, and seldom a new one
            self._marks = known
            values["marks"] = [[mark.at, mark.kind, mark.unit, mark.text] for mark in marks]
        self._live.put(values)


def table(state: State) -> dict[str, Value]:
    """The state as keys and values, but for the marks."""
    values: dict[str, Value] = {
        "now": state.now,
        "begin": state.begin,
        "end": state.end,
        "pace": state.pace,
        "held": state.held,
        "why": IDLE if state.idle and not state.stopped_why else state.stopped_why,
        "past": state.past,
        "faster": round(state.faster, 3),
        "late": round(state.lateness.most / MS, 2),
        "dropped": state.dropped,
        "breakerrors": state.break_on_errors,
        "branches": [list(branch) for branch in state.branches],
        "queue": [list(one) for one in state.queue],
        "faults": [[number, text] for number, text in state.faults.items()],
        "real": None if state.real is None else state.real.standing,
        "realwhy": None if state.real is None else state.real.why,
        "slips": None if state.real is None else state.real.slips,
    }
    for name, unit in state.units.items():
        _unit(values, f"u.{name}", unit)
    values |= {f"l.{name}.format": form for name, form in state.formats.items()}
    for name, switch in state.switches.items():
        values[f"s.{name}.level"], values[f"s.{name}.low"], values[f"s.{name}.high"] = switch
    for name, motor in state.motors.items():
        values[f"m.{name}.place"], values[f"m.{name}.command"] = round(motor.place, 3), round(motor.command, 3)
        values[f"m.{name}.speed"], values[f"m.{name}.lost"] = round(motor.speed, 1), motor.lost
    return values


def _unit(values: dict[str, Value], key: str, unit: UnitState) -> None:
    values[f"{key}.powered"], values[f"{key}.state"] = unit.powered, unit.state
    values[f"{key}.address"] = None if unit.executing is None else unit.executing.address
    values[f"{key}.running"] = None if unit.executing is None else unit.executing.text
    error = unit.error
    values[f"{key}.error"] = (
        None if error is None else f"{error.frame}: {error.reason}" if error.frame else error.reason
    )
    values[f"{key}.errorat"] = None if error is None else error.at
    values[f"{key}.hand"] = sorted(unit.held_pins)
    values[f"{key}.reg"] = dict(unit.registers)
    values[f"{key}.unsaved"], values[f"{key}.stored"] = unit.image_changed, unit.stored
    values[f"{key}.memory"] = unit.memory
    for pin, level in unit.pins.items():
        values[f"{key}.pin.{pin}"] = level
    for axis, where in unit.axes.items():
        place = f"{key}.x.{axis}"
        values[f"{place}.position"], values[f"{place}.shaft"] = where.position, where.shaft
        values[f"{place}.pulses"], values[f"{place}.rate"] = where.pulses, round(where.rate, 1)


def _offer(bench: "Bench", live: Live) -> None:
    """What a window may do to the cell."""
    turning = asyncio.Lock()  # a notch is counted from where the one before has come to

    async def pace(times: Annotated[float, Field(ge=1e-6, le=1e6)] | None) -> None:
        await bench.pace(times)

    async def notch(by: int) -> None:
        ladder = [float("inf") if one is None else one for one in PACES]
        async with turning:
            now = float("inf") if bench.state.pace is None else bench.state.pace
            rest = [one for one in ladder if (one > now if by > 0 else one < now)]
            if rest:
                chosen = min(rest) if by > 0 else max(rest)
                await bench.pace(chosen if isfinite(chosen) else None)

    async def faster() -> None:
        await notch(1)

    async def slower() -> None:
        await notch(-1)

    async def step_instruction(unit: str) -> None:
        await bench.step_instruction(unit)

    async def step_back(unit: str | None = None) -> None:
        await bench.step_back(unit)

    async def rewind(at: Ns) -> None:
        await bench.rewind(at)

    async def power(unit: str, on: bool) -> None:
        await bench.power(unit, on)

    async def set_switch(name: str, level: LevelField) -> None:
        await bench.set_switch(name, level)

    async def set_pin(unit: str, pin: str, level: LevelField | None) -> None:
        await bench.set_pin(unit, pin, level)

    async def set_strap(unit: str, pin: str, level: LevelField) -> None:
        await bench.set_strap(unit, pin, level)

    async def place_switch(name: str, low: PlaceField | None, high: PlaceField | None) -> None:
        await bench.place_switch(name, low, high)

    async def send(line: str, data: Text) -> None:
        """`data` has one character a byte."""
        foreign = next((character for character in data if ord(character) > 0xFF), None)
        if foreign is not None:
            raise ValueError(f"{foreign!r} is no byte: write what cannot be typed as \\xHH")
        await bench.queue_send(line, data.encode("latin-1"))

    async def type(unit: str, text: Text) -> None:
        await bench.queue_type(unit, check_typed(text))

    async def withdraw(number: int | None = None) -> None:
        """Take back what waits: one, or all of it."""
        await bench.withdraw(number)

    async def start(unit: str) -> None:
        await bench.start(unit)

    async def break_on_errors(on: bool) -> None:
        await bench.break_on_errors(on)

    async def hold() -> None:
        await bench.hold()

    async def go() -> None:
        await bench.go()

    async def step_event() -> None:
        await bench.step_event()

    async def breaks(where: Text, kind: Text, given: dict[str, str | float] | None = None) -> int:
        return await bench.breaks({"where": where, "kind": kind, **(given or {})})

    async def take_branch(number: int) -> None:
        await bench.take_branch(number)

    async def compare_branch(number: int) -> list[str]:
        return await bench.compare_branch(number)

    async def mend(number: int | None = None) -> None:
        await bench.mend(number)

    async def restart() -> None:
        await bench.restart()

    async def stop_motors() -> None:
        live.stops.stop(BOARDS)
        await bench.stop_motors()

    async def recover() -> None:
        await bench.recover()

    async def revive() -> None:
        await bench.revive()

    async def end_silent() -> None:
        """End a process of the cell that says nothing; what was done is done again by the next one."""
        if bench.silent > SILENT and bench.state.real is None:
            await bench.kill()
            await bench.revive()

    moving = (
        power,
        set_pin,
        set_strap,
        set_switch,
        send,
        type,
        start,
        recover,
        revive,
    )  # a machine, where it drives one
    for action in (pace, faster, slower, step_instruction, step_back, rewind, power, set_switch, set_pin, set_strap,
                 place_switch, send, type, withdraw, start, break_on_errors, hold, go, step_event, breaks, mend,
                 take_branch, compare_branch, restart, stop_motors, recover, revive, end_silent):  # fmt: skip
        name, moves = action.__name__, BOARDS if action in moving else ""
        live.offer(name, action, moves=moves, stops=action is stop_motors)
