"""Nothing is loaded and no table is made when a move begins: a computer that does is late for all that moves."""

import subprocess
import sys

import pytest

from detent.controllers import catalogue
from detent.realtime.boards.warming import FIRST_MOVES

MOVES = """
import sys
from detent.cell.build import build
from detent.cell.description import Description, Unit, single
from detent.realtime.boards import drive, warming
model = sys.argv[1]
if sys.argv[2] == "warm":
    warming.first_moves(Description(units={"x": Unit(model=model)}))
cell = build(single(model), warming._no_file, record=False)
cell.run_to(1_000_000_000)
before = set(sys.modules)
for line in warming.FIRST_MOVES[model]:
    cell.type(model, line.replace("9", "8"))
    cell.run_to(cell.now + 5_000_000_000)
    assert any(c.status(cell.now, a).pulses for c in cell.controllers().values() for a in c.axes) or line[0] == "S"
print(*sorted(set(sys.modules) - before))
"""


def loaded(model: str, how: str) -> list[str]:
    found = subprocess.run([sys.executable, "-c", MOVES, model, how], capture_output=True, text=True, check=True)
    return found.stdout.split()


def test_every_controller_has_its_first_moves() -> None:
    assert set(FIRST_MOVES) == set(catalogue.MODELS)


@pytest.mark.parametrize("model", FIRST_MOVES)
def test_a_first_move_behind_pins_loads_nothing(model: str) -> None:
    assert loaded(model, "warm") == []


def test_it_would_otherwise() -> None:
    assert "detent.ramps.short_movements" in loaded("supersigma", "cold")
