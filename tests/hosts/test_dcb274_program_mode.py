"""A DCB-274 that was left in program mode, where "all commands and data are directed into the NV memory" (page 47)."""

from typing import Any

import pytest
from tests.hosts.dcb274_units import alone, driven, three

from detent.cell.cell import Cell
from detent.cell.host import HostPort
from detent.controllers.dcb274.firmware import Dcb274 as Controller
from detent.hosts.dcb274 import BlockingDcb274, Dcb274
from detent.hosts.errors import DriverError, Refused

MODES = ("single", "party", "daisy", "sin10")
PROGRAM = ["+ 2000", "W 0"]


class Line:
    """A unit, and as many drivers of it, who know nothing of each other, as are asked for."""

    def __init__(self, mode: str) -> None:
        self.mode = mode
        self.cell: Cell
        self.port: HostPort
        match mode:
            case "single":
                self.cell, unit = alone()
                self.port = unit.port
            case "daisy":
                self.cell, self.port = three(party=False, kind='kind = "daisy-chain"\n')
            case "sin10":
                self.cell, self.port = three("sin-10", party=False)
            case _:
                self.cell, self.port = three()
        found = self.cell.controllers()["unit" if mode == "single" else "x"]
        assert isinstance(found, Controller)
        self.unit = found

    def driver(self) -> BlockingDcb274:
        if self.mode == "single":
            return BlockingDcb274(Dcb274(), self.port)
        return driven(self.port, "X", self.mode, "X" if self.mode == "daisy" else "")[0]

    def left_in_program_mode(self, rate: int = 0) -> "Line":
        """Whoever was storing a program is gone; the axis moves on."""
        before = self.driver()
        before.run_at(rate) if rate else before.connect()
        before.command("P 0")
        before.command("+ 100")
        return self

    @property
    def programming(self) -> bool:
        return self.unit._desk.programming

    def state(self) -> str:
        return self.unit.status(self.cell.now).state


@pytest.mark.parametrize("stop", ["stop", "halt"])
@pytest.mark.parametrize("mode", MODES)
def test_a_stop_stops_an_axis_that_stores_what_it_is_told(mode: str, stop: str) -> None:
    """Page 28: @ is a single character "interrupt" of a program, but a line, which is stored, in program mode."""
    line = Line(mode).left_in_program_mode(2000)
    getattr(line.driver(), stop)()
    line.port.wait(1.0)
    assert line.state() == "ready"
    assert not line.programming


CALLS: dict[str, Any] = {
    "position": lambda unit: unit.position(),
    "move": lambda unit: unit.move_to(500),
    "run": lambda unit: unit.run_at(500),
    "status": lambda unit: unit.moving(),
    "program": lambda unit: unit.write_program(PROGRAM),
    "memory": lambda unit: unit.read_memory(0, 4),
}


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("mode", MODES)
def test_nothing_is_stored_or_moved_that_was_not_meant_so(mode: str, call: str) -> None:
    """The P that begins a program ends one that was left open, and its instructions are carried out then."""
    line = Line(mode).left_in_program_mode()
    before, driver = line.unit.memory.nv, line.driver()
    with pytest.raises(Refused, match="is in program mode, where lines are stored"):
        CALLS[call](driver)
    assert line.programming
    assert line.unit.memory.nv == before
    assert line.unit.status(line.cell.now).pulses == 0
    driver.command("P")
    assert not line.programming
    driver.write_program(PROGRAM)
    assert driver.position() == 0
    assert line.unit.memory.nv[:8] == b"\xeb\xd0\x07\x00\x17\x00\x00\xff"


@pytest.mark.parametrize("mode", MODES)
def test_a_program_that_is_broken_off_anywhere_leaves_nothing_that_takes_calls_for_instructions(mode: str) -> None:
    """The driver itself was storing: the calls behind that are told so, or are obeyed."""
    behind, over = 0, False
    while not over:
        line = Line(mode)
        driver = line.driver()
        driver.connect()
        steps, answer = driver.driver.write_program(PROGRAM), None
        try:
            for _ in range(behind):
                answer = driver._do(next(steps) if answer is None else steps.send(answer))
        except StopIteration:
            over = True
        steps.close()
        line.port.wait(0.05)
        before, stores = line.unit.memory.nv, line.programming
        try:
            assert driver.position() == 0
            assert not stores
        except DriverError:
            assert stores, f"behind {behind} steps"
        assert line.unit.memory.nv == before, f"behind {behind} steps"
        driver.stop()
        assert not line.programming, f"behind {behind} steps"
        assert driver.position() == 0
        behind += 1


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("T -8388607 100", "12 characters behind the name of a line"),
        ("R \u2212100", "cannot be typed"),
        ("R\t100", "cannot be typed"),
        ("W 5 ; rest", "more than one instruction"),
    ],
)
def test_what_cannot_be_typed_is_found_before_anything_is_stored(mode: str, wrong: str, words: str) -> None:
    """Pages 22 and 25: 15 characters, behind a name 12."""
    line = Line(mode)
    driver = line.driver()
    driver.connect()
    before = line.unit.memory.nv
    if mode == "single" and wrong.startswith("T"):
        driver.write_program(["+ 100", wrong])
        return
    with pytest.raises(ValueError, match=f"line 2: .*{words}"):
        driver.write_program(["+ 100", wrong])
    assert line.unit.memory.nv == before
    assert driver.position() == 0


@pytest.mark.parametrize("mode", MODES)
def test_an_instruction_that_fits_without_its_blank_is_typed_so(mode: str) -> None:
    """Page 22: "a space is optional between the command and first number"; with it this has 13 characters."""
    line = Line(mode)
    line.driver().write_program(["0 T 1000000 128", "5 W 5;"])
    assert line.unit.memory.nv[:9] == b"\x14\x40\x42\x0f\x80\x17\x05\x00\xff"
