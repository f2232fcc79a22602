"""What another host has left, and what was broken off, spoils no call: on a GS-C200, a SUPERSIGMA, a GenStepper board.

A stop stops the axis, looked at on its shaft, or raises. What is broken off, between any two steps of a call and
within each, gives the next call no answer that is not its own, and stores nothing. Nor does a damaged character.
GS-C200 datasheet: figure 4, commands F, K, P, Z; GenStepper manual, pages 22 to 24, 29, 42; Cassinis, table 1.
"""

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

import pytest
from tests.hosts.breaking_off import broken_off
from tests.hosts.test_alike import DRIVERS

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.faults import OnLine
from detent.cell.host import HostPort
from detent.hosts.axis import Speeds
from detent.hosts.errors import DriverError
from detent.hosts.exchange import Steps
from detent.hosts.gsc200 import BlockingGsC200, GsC200
from detent.lines.faults import HOST, UNITS, BitErrors, Delay, LostCharacters
from detent.ticks import MS

REST = 12.0  # seconds: every ramp here is over by then
ADAPTER = 16 * MS  # what a USB adapter keeps back
CHS = 'straps = { CHS = "low" }\n'

MODELS: dict[str, tuple[str, str, Callable[[Any], Any]]] = {
    "gs-c200": ("gs-c200", "", DRIVERS["gs-c200"]),
    "gs-c200s": ("gs-c200s", "", DRIVERS["gs-c200s"]),
    "gs-c200 bare": ("gs-c200", CHS, lambda port: BlockingGsC200(GsC200("gs-c200", checksums=False), port)),
    "gs-c200s bare": ("gs-c200s", CHS, lambda port: BlockingGsC200(GsC200("gs-c200s", checksums=False), port)),
    "supersigma": ("supersigma", "", DRIVERS["supersigma"]),
    "bs0610": ("bs0610", "", DRIVERS["bs0610"]),
}
"""Each as it is in a cell, and the driver of it; bare ones have no checksums."""


class Unit:
    """A unit of a cell, and as many drivers of it, who know nothing of each other, as are asked for."""

    def __init__(self, model: str, late: bool = False) -> None:
        self.model, more, self._driver = MODELS[model]
        self.cell: Cell = build(parse(f'[units.unit]\nmodel = "{self.model}"\n{more}', "cell"), lambda file: "")
        self.cell.run_to(1_000 * MS)
        self.port = HostPort(self.cell)
        if late:
            self.breaks(Delay(ADAPTER))

    def breaks(self, fault: Any) -> int:
        return self.cell.breaks(OnLine(0, fault))

    def driver(self) -> Any:
        return self._driver(self.port)

    def typed(self, *lines: str) -> None:
        """Another host says so, and is gone."""
        for line in lines:
            self.cell.type("unit", line)
            self.port.wait(0.1)

    @property
    def axis(self) -> str:
        return "X" if self.model == "bs0610" else ""

    @property
    def shaft(self) -> int:
        return self.cell.controllers()["unit"].status(self.cell.now, self.axis).position

    def stands(self) -> bool:
        """Whether the shaft stands, and nothing is to move it."""
        self.port.wait(REST)
        before = self.shaft
        self.port.wait(3.0)
        return before == self.shaft

    @property
    def settings(self) -> dict[str, str]:
        """Rates and ramps, as the unit has them."""
        registers = self.cell.controllers()["unit"].registers(self.cell.now)
        return {name: value for name, value in registers.items() if name in ("S", "T", "R", "X K", "X R", "X P")}

    @property
    def memory(self) -> bytes:
        found: Any = self.cell.controllers()["unit"]
        return found.program_memory() + found.kept_memory() if self.model.startswith("gs") else b""


# -- what another host has left ----------------------------------------------------------------------------------

HALF: dict[str, tuple[bytes, ...]] = {
    "gs": (b"", b"+", b"+10", b"G", b"G+", b"g", b"f", b"V", b"P", b"j"),
    "su": (b"", b"\x01", b"\x01\x01", b"\x01\x01\x01", b"\x02", b"\x07\x83\x01\x02"),
    "bs": (b"", b"1", b"-", b"Y+", b"X100", b"B12", b"Y-8", b"I", b"1V", b"2V", b"3V", b"XI"),
}  # fmt: skip
"""What may stand in the line when a host is gone."""

LEFT: dict[str, dict[str, tuple[str, ...]]] = {
    "gs-c200": {
        "at rest": (),
        "moving": ("+90000",),
        "running": ("G+",),
        "homing": ("H+",),
        "in a program": ("P", "+90000", "+90000", "E"),
        "in a loop": ("P", "+50", "U3", "E"),
        "waiting": ("P", "W1", "+90000", "E"),
        "programming": ("P", "+90000"),
        "in error": ("P", "-5", "E"),
    },
    "gs-c200s": {
        "at rest": (),
        "moving": ("+90000",),
        "running": ("g-",),
        "homing": ("H+",),
        "in a loop": ("Po", "+50", "j0", "E"),
        "waiting": ("Po", "W1", "+90000", "E"),
        "programming": ("Po", "+90000"),
        "in error": ("Po", "j1", "E"),
    },
    "supersigma": {
        "at rest": (),
        "moving": ("move 60000",),
        "slow": ("constant 6000 4",),
        "homing": ("originate",),
        "in error": ("constant 0 4",),
    },
    "bs0610": {
        "at rest": (),
        "moving": ("X90000G",),
        "running": ("X+S",),
        "reversing": ("X3000R2000P+S", "-S"),
        "to another": ("X3000R2000P90000G", "-90000G"),
        "both": ("B+S",),
    },
}


def lefts() -> Iterator[Any]:
    for model, (kind, _, _) in MODELS.items():
        for left in LEFT[kind]:
            yield pytest.param(model, left, id=f"{model}, {left}")


def left_so(model: str, left: str, half: bytes = b"", late: bool = False) -> Unit:
    unit = Unit(model, late)
    unit.typed(*LEFT[unit.model][left])
    if left == "waiting":
        unit.cell.set_pin("unit", "UI1", 0)
        unit.typed("K", "E")
    if half:
        unit.cell.send(0, half)
    return unit


@pytest.mark.parametrize("way", ["stop", "halt"])
@pytest.mark.parametrize(("model", "left"), [*lefts()])
def test_a_stop_stops_whatever_another_host_has_left(model: str, left: str, way: str) -> None:
    for half in HALF[model[:2]]:
        for late in (False, True):
            unit = left_so(model, left, half, late)
            memory = unit.memory
            getattr(unit.driver(), way)()
            assert unit.stands(), half
            assert unit.memory == memory, half


@pytest.mark.parametrize(("model", "left"), [*lefts()])
def test_the_first_call_is_told_the_truth_and_stores_nothing(model: str, left: str) -> None:
    calls: dict[str, Callable[[Any], Any]] = {
        "moving": lambda one: one.moving(),
        "position": lambda one: one.position(),
        "set_speeds": lambda one: one.set_speeds(Speeds(100, 900, 0.1)),
        "move_by": lambda one: one.move_by(700),
        "+1": lambda one: one.move(1) if model[:2] == "gs" else one.move_by(1),
        "set_position": lambda one: one.set_position(0),
    }
    for half in HALF[model[:2]]:
        for name, call in calls.items():
            unit = left_so(model, left, half)
            one, memory, before = unit.driver(), unit.memory, unit.shaft
            what = f"{half!r}, {name}"
            try:
                found = call(one)
            except DriverError:
                assert left not in ("at rest", "in error") or half, what
                continue
            assert unit.memory == memory, what
            match name:
                case "moving":
                    status = unit.cell.controllers()["unit"].status(unit.cell.now, unit.axis)
                    assert found == (status.state not in ("ready", "programming", "idle")), what
                case "position" if model != "supersigma":
                    assert abs(found - unit.shaft) < 300, what
                case "move_by" | "+1" if left in ("at rest", "in error"):
                    one.wait(60)
                    assert unit.shaft == before + (700 if name == "move_by" else 1), what


# -- what was broken off -----------------------------------------------------------------------------------------

DOES: dict[str, Callable[[Any], Steps[Any]]] = {
    "speeds": lambda axis: axis.set_speeds(Speeds(200, 1200, 0.1)),
    "a move by": lambda axis: axis.move_by(700),
    "a move to": lambda axis: axis.move_to(700),
    "a run": lambda axis: axis.run_at(900),
    "home": lambda axis: axis.home(),
    "a stop": lambda axis: axis.stop(),
    "a halt": lambda axis: axis.halt(),
    "a look at the position": lambda axis: axis.position(),
    "a look at the motion": lambda axis: axis.moving(),
    "a place": lambda axis: axis.set_position(0),
    "a program": lambda axis: axis.write_program(["+77", "A1"]),
    "a listing": lambda axis: axis.read_program(),
    "a backup": lambda axis: axis.saved(),
}
ONLY = {
    "a place": ("gs", "bs"),
    "a program": ("gs",),
    "a listing": ("gs",),
    "a backup": ("gs", "bs"),
    "a run": ("gs", "bs"),
    "home": ("gs", "su"),
}
SOME = ("a move by", "home", "a halt", "a listing")
MOVES: dict[str, Callable[[Any], object]] = {
    "rests": lambda unit: None,
    "moves": lambda unit: unit.move_by(6000),
    "has moved": lambda unit: (unit.move_by(700), unit.wait(60)),
    "homes": lambda unit: unit.home(1) if isinstance(unit, BlockingGsC200) else unit.home() if unit.home else None,
}


def breaks() -> Iterator[Any]:
    for model in MODELS:
        for moves in MOVES:
            if moves == "homes" and model == "bs0610":
                continue
            for does in DOES:
                if model[:2] in ONLY.get(does, (model[:2],)):
                    some = moves != "has moved" and does in SOME and "bare" not in model
                    marks = [] if some else [pytest.mark.slow]
                    yield pytest.param(model, moves, does, id=f"{model}, {moves}, {does}", marks=marks)


def each(model: str, moves: str, does: str) -> Iterator[tuple[Unit, Any, str]]:
    """The unit and its driver, one call broken off, at every place of it."""
    for late in (False, True):
        for said in (False, True):
            behind, over = 0, False
            while not over:
                unit = Unit(model, late)
                one = unit.driver()
                MOVES[moves](one)
                over = broken_off(one, unit.port, DOES[does](one.driver), behind, said=said)
                yield unit, one, f"behind {behind}, said {said}, late {late}"
                behind += 1 + max(behind - 16, 0) // 4


@pytest.mark.parametrize(("model", "moves", "does"), [*breaks()])
def test_a_stop_stops_whatever_was_broken_off(model: str, moves: str, does: str) -> None:
    for way in ("stop", "halt"):
        for unit, one, what in each(model, moves, does):
            getattr(one, way)()
            assert unit.stands(), what


@pytest.mark.parametrize(("model", "moves", "does"), [*breaks()])
def test_what_was_broken_off_spoils_no_call_behind_it(model: str, moves: str, does: str) -> None:
    calls: dict[str, Callable[[Any], Any]] = {
        "moving": lambda one: one.moving(),
        "position": lambda one: one.position(),
        "position later": lambda one: (one.port.wait(REST), one.position())[1],
        "move_by": lambda one: one.move_by(400),
        "again": lambda one: one.move_by(700),
        "move_to": lambda one: one.move_to(300),
        "pins": lambda one: one.activate(2),
        "program": lambda one: one.read_program(),
    }
    for name, call in calls.items():
        if name in ("pins", "program") and not model.startswith("gs"):
            continue
        settings = Unit(model).settings
        for unit, one, what in each(model, moves, does):
            at, memory = unit.cell.controllers()["unit"].status(unit.cell.now, unit.axis), unit.memory
            what += f", {name}"
            try:
                found = call(one)
            except DriverError:
                continue
            status = unit.cell.controllers()["unit"].status(unit.cell.now, unit.axis)
            if does != "a program" and does != "a backup":
                assert unit.memory == memory or does == "home", what
            match name:
                case "moving":
                    assert found == (status.state not in ("ready", "programming", "idle")) or status != at, what
                case "position" if moves != "homes" and does != "home":
                    assert min(at.position, unit.shaft) <= found <= max(at.position, unit.shaft), what
                case "position later" if status.state in ("ready", "idle"):
                    if model != "supersigma" or (moves != "homes" and does != "home"):
                        assert found == unit.shaft or found > 9_000_000, what
                case "move_by" | "again" | "move_to":
                    try:
                        one.wait(120)
                    except DriverError:
                        continue
                    assert unit.stands(), what
                    if model != "supersigma" or (moves != "homes" and does != "home"):
                        assert one.position() == unit.shaft, what
                        if name == "move_to":
                            assert unit.shaft == 300, what
                    if does in ("a stop", "a halt"):
                        assert unit.settings == settings, what


# -- what is damaged or lost on the line -------------------------------------------------------------------------


UNSEEN = {"su": (UNITS, (7,)), "bs": (UNITS, range(7))}
"""Bits that nothing can tell: the direction of a movement, which status does not have, and a command of a GenStepper
board that becomes another one, as P of X, or = of a question: it has the same answer, or none."""


def strikes(model: str, count: int, *, some: bool) -> Iterator[tuple[str, Any]]:
    """One character of the first so many, towards the unit or from it, with one bit wrong, or lost; `some` of them."""
    # 7 has no factor in common with the 8 or 9 strikes at one character: all of them come
    yield from islice(_strikes(model, count), 0, None, 7 if some else 1)


def _strikes(model: str, count: int) -> Iterator[tuple[str, Any]]:
    unseen, places = UNSEEN.get(model[:2], ("", ()))
    for towards in (UNITS, HOST):
        for nth in range(1, count + 1):
            yield f"{nth} {towards} lost", LostCharacters(towards, nth=nth)
            for bit in range(7 if model[:2] == "gs" else 8):
                if towards != unseen or bit not in places:
                    yield f"{nth} {towards} bit {bit}", BitErrors(towards, nth=nth, bit=str(bit))


HOW_MANY = [pytest.param(True, id="some"), pytest.param(False, id="all", marks=pytest.mark.slow)]


@pytest.mark.parametrize("some", HOW_MANY)
@pytest.mark.parametrize("way", ["stop", "halt"])
@pytest.mark.parametrize("before", ["moving", "stopping", "at rest"])
@pytest.mark.parametrize("model", ["gs-c200", "gs-c200s bare", "supersigma", "bs0610"])
def test_a_stop_stops_whichever_character_is_damaged(model: str, before: str, way: str, some: bool) -> None:
    for what, fault in strikes(model, 16, some=some):
        unit = Unit(model)
        one = unit.driver()
        one.set_speeds(Speeds(200, 3000, 1.0))
        if before != "at rest":
            one.move_by(60000)
            unit.port.wait(2.0)
        if before == "stopping":
            one.stop()
        unit.breaks(fault)
        try:
            getattr(one, way)()
        except DriverError:
            continue
        assert unit.stands(), what


@pytest.mark.parametrize("some", HOW_MANY)
@pytest.mark.parametrize("model", ["gs-c200", "gs-c200s bare", "supersigma", "bs0610"])
def test_what_is_said_to_have_happened_has_happened_whichever_character_is_damaged(model: str, some: bool) -> None:
    calls: dict[str, Callable[[Any], Any]] = {
        "move_by": lambda one: one.move_by(700),
        "move_to": lambda one: one.move_to(1400),
    }
    for name, call in calls.items():
        for what, fault in strikes(model, 20, some=some):
            unit = Unit(model)
            one = unit.driver()
            one.move_by(700)
            one.wait(60)
            assert unit.shaft == 700
            unit.breaks(fault)
            try:
                call(one)
                one.wait(60)
            except DriverError:
                continue
            assert unit.stands(), f"{name}, {what}"
            assert unit.shaft == 1400, f"{name}, {what}"
            assert one.position() == 1400, f"{name}, {what}"
