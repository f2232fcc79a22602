"""Whole cells, each with the page of the manual that it proves on its first line."""

from pathlib import Path

import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.mechanics import Mechanics
from detent.ticks import SECOND

CELLS = Path(__file__).parent / "cells"


def lived(name: str, time: int = 10 * SECOND, text: str = "") -> Cell:
    cell = build(parse((CELLS / f"{name}.toml").read_text() + text, name), lambda file: "")
    cell.run_to(time)
    return cell


def motor(cell: Cell) -> Mechanics:
    found = cell.parts[cell.wiring.names.index("m")]
    assert isinstance(found, Mechanics)
    return found


def test_page_20_a_slew_that_is_asked_for_in_the_stop_at_a_limit_does_not_go_on_through_it():
    status = lived("slew_in_the_stop_at_a_limit").controller("b").status(10 * SECOND)
    assert (status.position, status.state) == (749, "ready"), "(2000^2 - 80^2) / (2 x 8000) behind 500"


@pytest.mark.parametrize("at", ["0.99 s", "1.0 s"])
def test_page_21_a_key_does_not_either(at):
    text = f'[[script]]\nat = "{at}"\nset = {{ "b.X+" = 0 }}\n'
    cell = lived("slew_in_the_stop_at_a_limit", text=text)
    assert cell.controller("b").status(cell.now).position == 749
    cell.set_pin("b", "X+", 1)
    cell.run_to(11 * SECOND)
    assert cell.controller("b").status(cell.now).position == 749


def test_page_12_a_limit_that_is_met_on_the_way_to_a_new_go_is_the_end_of_that():
    cell = lived("limit_while_turning")
    status = cell.controller("b").status(cell.now)
    assert (status.position, status.state) == (826, "ready"), "where it stopped"
    assert cell.controller("b").registers(cell.now)["X G"] == "826", "it has no target any more"


@pytest.mark.parametrize(("name", "counter", "shaft"), [("set_position_with_a_motor", 1000, -3),
                                                          ("homing_at_a_limit", 250, None)])  # fmt: skip
def test_page_38_set_position_moves_no_motor_and_counter_shaft_and_rotor_agree(name, counter, shaft):
    cell = lived(name)
    board, rotor = cell.controller("board"), motor(cell)
    steps = [span for span in cell.recording.motion("board", cell.now, "X") if span.last >= span.first]
    commanded = sum(span.direction * (span.last - span.first + 1) for span in steps)
    assert board.status(cell.now).position == counter
    assert shaft is None or commanded == shaft
    assert rotor.command(cell.now) == pytest.approx(commanded)
    assert rotor.place(cell.now) == pytest.approx(commanded, abs=3), "but for what friction holds back"
    at = (3 if name.startswith("set") else 2) * SECOND
    twin = lived(name, at - 1)
    before = motor(twin).place(twin.now)
    twin.run_to(at + SECOND // 2)
    assert motor(twin).place(twin.now) == pytest.approx(before, abs=0.01), "= itself moves nothing"
