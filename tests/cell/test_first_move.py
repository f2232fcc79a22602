"""What a rotor needs is loaded as its cell is built: the first move of a cell that is served keeps no host waiting."""

import os
import subprocess
import sys

import pytest

pytest.importorskip("numba")

CELL = """
[units.axis]
model = "gs-c200"
[motors.slide]
motor = "qsh4218-41-10-035"
unit = "axis"
supply = 24
load = { inertia = 1.5e-5, friction = 0.02 }
[switches.home]
axis = "slide"
to = 4.0
drives = "axis.UI1"
"""
LOADED = f"""
import sys
from detent.cell.build import build
from detent.cell.description import parse
cell = build(parse('''{CELL}''', "cell"), lambda _: "")
cell.run_to(10**9)
before = set(sys.modules)
from detent.motors import engine
calls = engine.advance().signatures
cell.type("axis", "+300")
cell.run_to(4 * 10**9)
new = [name for name in set(sys.modules) - before if "numba" in name or "llvm" in name]
print(len(calls), engine.advance().signatures == calls, new)
"""


def test_the_first_move_loads_and_compiles_nothing() -> None:
    found = subprocess.run([sys.executable, "-c", LOADED], check=True, text=True, capture_output=True, env=os.environ)
    assert found.stdout.strip() == "1 True []"
