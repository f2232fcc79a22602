"""From the tables of a cell file to what each board is told hangs on it, and back: whose pin is what.

Names on the boards are the cell's own: ``slide`` or ``table.X`` for a stepper, ``slide.MOV`` for a pin.
"""

from collections.abc import Mapping
from typing import NamedTuple

from detent.cell.description import Description, Problem
from detent.cell.hardware import Board, Hardware
from detent.controllers.device import Controller, Stage
from detent.pins import HIGH, PinKind
from detent.realtime.boards.setup import (
    BoardSetup,
    DriverSetup,
    InputSetup,
    OutputSetup,
    Pin,
    SetupProblem,
    StepperSetup,
)
from detent.ticks import MS, US, Ns

MOST_MARGIN: Ns = 4 * MS
LEAST_PULSE: Ns = 2 * US
ANYWHERE = 1 << 62  # beyond every place of an axis
CYCLE = 64  # places in a full step, of a `Stage`

UnitPin = tuple[str, str]


class DrivenAxis(NamedTuple):
    """An axis of a controller that real pins carry; names are those on the board, "" for what is not there."""

    unit: str
    axis: str
    stepper: str
    board: str
    shaft: int = 0  # where the axis stands when the cell starts
    enable: str = ""
    driver: str = ""
    half: str = ""
    stage: Stage | None = None  # what its driver is told where the controller commands nothing


class StandIn(NamedTuple):
    """A switch that a fake board has in place of the machine's: at an input of `board`, on an axis of it."""

    board: str
    pin: Pin
    stepper: str
    low: int
    high: int
    inside: bool  # the level within its places, as the controller reads it


class Plan(NamedTuple):
    """What hangs on the boards of a cell. `setups` come with the address of each; the first is master of time."""

    setups: tuple[tuple[BoardSetup, str], ...]
    axes: tuple[DrivenAxis, ...]
    outputs: Mapping[UnitPin, str]
    inputs: Mapping[str, UnitPin]
    board_of: Mapping[str, str]  # of each input
    lead: Ns  # the longest of all boards
    held: bool  # replies wait until nothing can change them
    file: str
    keys: Mapping[str, str]  # where the file says what hangs there, by name; of a pin the whole key
    stand_ins: tuple[StandIn, ...] = ()

    def problem(self, fault: SetupProblem) -> Problem:
        """The same with the key of the cell file."""
        key = self.keys.get(fault.item, fault.item)
        sub = {"lead": "lead", "error": "error"}.get(fault.key, fault.key)
        if fault.item in {setup.name for setup, _ in self.setups}:
            key = f"boards.{fault.item}.{sub or 'serial'}"
        elif fault.key == "watchdog":
            setup = next(s for s, _ in self.setups if any(out.name == fault.item for out in s.outputs))
            key = f"boards.{setup.name}.watchdog"
        elif fault.key and fault.key != "pin":
            key = f"{key}.{sub}"
        return Problem(self.file, key, str(fault.args[0]) if not hasattr(fault, "text") else fault.text)


def plan(described: Description, controllers: Mapping[str, Controller], least_lead: Ns = 0) -> Plan:
    """What hangs where, of a cell that `build` has found sound. Raises Problem where nothing does.

    The lead is at least `least_lead`, as far as watchdogs allow.
    """
    if not described.hardware:
        raise Problem(described.file, "hardware", "no pin of this cell is real: add [boards.NAME] and [hardware.UNIT]")
    axes, keys = [], {}
    outputs: dict[UnitPin, str] = {}
    inputs: dict[str, UnitPin] = {}
    board_of: dict[str, str] = {}
    used = [name for name in described.boards if any(t.board == name for t in described.hardware.values())]
    hang: dict[str, _Hang] = {name: _Hang() for name in used}
    for key, table in described.hardware.items():
        unit, _, axis = key.partition(".")
        controller, board, here = controllers[unit], described.boards[table.board], hang[table.board]
        where = f"hardware.{key}"
        for pin, text in table.outputs.items():
            found = next(p for p in controller.pins if p.name == pin)
            rest = found.rest == HIGH or found.kind is PinKind.OPEN_COLLECTOR
            outputs[unit, pin] = name = f"{unit}.{pin}"
            watchdog = described.boards[table.board].watchdog
            here.outputs.append(OutputSetup(name, Pin.parse(text), rest, rest, watchdog, unit))
            keys[name] = f"{where}.outputs.{pin}"
        for pin, text in table.inputs.items():
            name = f"{unit}.{pin}"
            inputs[name], board_of[name], keys[name] = (unit, pin), table.board, f"{where}.inputs.{pin}"
            here.inputs.append(InputSetup(name, Pin.parse(text), table.sample, table.samples))
        if table.step is not None:
            what = DrivenAxis(unit, axis, key, table.board, described.units[unit].shaft)
            mine = [(k, t) for k, t in described.hardware.items() if k.partition(".")[0] == unit]
            stops = tuple(f"{unit}.{pin}" for _, t in mine if t.board == table.board for pin in t.inputs)
            axes.append(_axis(what, table, controller, board, here, keys, stops))
    boards = [described.boards[name] for name in used]
    longest = min(least_lead, *(board.watchdog // 4 for board in boards))
    boards = [board.model_copy(update={"lead": max(board.lead, longest)}) for board in boards]
    setups = tuple((hang[name].setup(name, board), board.serial) for name, board in zip(used, boards, strict=True))
    held = all(board.replies == "held" for board in boards)
    lead = max(board.lead for board in boards)
    return Plan(setups, tuple(axes), outputs, inputs, board_of, lead, held, described.file, keys, _stand_ins(described))


def _stand_ins(described: Description) -> tuple[StandIn, ...]:
    found = []
    for entry in described.switches.values():
        if not entry.machine or entry.axis is None:
            continue
        low, high = entry.range
        places = -ANYWHERE if low is None else int(low), ANYWHERE if high is None else int(high)
        for target in entry.drives:
            unit, _, pin = target.partition(".")
            mine = (table for key, table in described.hardware.items() if key.partition(".")[0] == unit)
            table = next(table for table in mine if pin in table.inputs)
            found.append(StandIn(table.board, Pin.parse(table.inputs[pin]), entry.axis, *places, entry.inside == HIGH))
    return tuple(found)


class _Hang:
    """What hangs on one board."""

    def __init__(self) -> None:
        self.steppers: list[StepperSetup] = []
        self.outputs: list[OutputSetup] = []
        self.inputs: list[InputSetup] = []
        self.drivers: list[DriverSetup] = []

    def setup(self, name: str, board: Board) -> BoardSetup:
        margin = board.margin or max(min(MOST_MARGIN, board.lead // 3), MS)
        return BoardSetup(name, board.lead, board.error, margin, tuple(self.steppers), tuple(self.outputs),
                          tuple(self.inputs), tuple(self.drivers))  # fmt: skip


def _axis(
    axis: DrivenAxis,
    table: Hardware,
    controller: Controller,
    board: Board,
    here: _Hang,
    keys: dict[str, str],
    stops: tuple[str, ...],
) -> DrivenAxis:
    key, where = axis.stepper, f"hardware.{axis.stepper}"
    assert table.step is not None
    assert table.dir is not None
    pulse = table.pulse if table.pulse is not None else max(controller.pulse_output.width, LEAST_PULSE)
    minus = None if table.minus is None else Pin.parse(table.minus)
    here.steppers.append(StepperSetup(key, Pin.parse(table.step), Pin.parse(table.dir), pulse, minus, stops, axis.unit))
    keys[key] = where
    if table.enable is not None:
        axis = axis._replace(enable=f"{key}.enable")
        enable = OutputSetup(axis.enable, Pin.parse(table.enable), watchdog=board.watchdog, unit=axis.unit, supply=True)
        here.outputs.append(enable)
        keys[axis.enable] = f"{where}.enable"
    driver = table.driver
    if driver is not None and driver.kind == "plain":
        assert driver.half is not None
        axis = axis._replace(half=f"{key}.half")
        half = OutputSetup(axis.half, Pin.parse(driver.half), initial=True, off=True, watchdog=board.watchdog)
        here.outputs.append(half)
        keys[axis.half] = f"{where}.driver.half"
    elif driver is not None and driver.kind != "plain":
        axis = axis._replace(driver=f"{key}.driver")
        if driver.microsteps is not None:
            axis = axis._replace(stage=Stage(0, CYCLE // driver.microsteps))
        keys[axis.driver] = f"{where}.driver"
        pins = {k: Pin.parse(text) for k, text in driver.pins().items()}
        here.drivers.append(
            DriverSetup(
                axis.driver, driver.kind, driver.sense, driver.amperes, pins.get("uart"), pins.get("transmit"),
                driver.address, pins.get("select"), driver.bus, pins.get("clock"), pins.get("mosi"), pins.get("miso"),
                driver.quiet, driver.interpolate,
            )
        )  # fmt: skip
    return axis
