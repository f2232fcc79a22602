"""Contacts that a rotor moves, wherever it stands and whatever they switch: a law over generated cells.

A contact is told when the rotor crosses its edge, once a crossing; a rotor that stands on an edge crosses nothing.
"""

import json
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.cell.cells import cell

from detent.cell.cell import Cell
from detent.cell.mechanics import Mechanics
from detent.pins import HIGH, LOW
from detent.ticks import MS, Ns

MODELS: dict[str, tuple[dict[str, str], list[str], tuple[str, ...]]] = {
    "gs-c200": ({"CHS": "low"}, ["HOME", "EOT", "UI1", "UI2"], ("S20", "+7", "-9", "+1", "H-", "G0")),
    "bs0610": ({}, ["LX-", "LX+", "X-", "NXT"], ("X40G", "X-24G", "X0G", "X-50S", "XZ", "X=")),
    "dcb-274": ({}, ["HOME", "LIMIT-A", "LIMIT-B", "GO"], (" ", "+ 9", "- 7", "F 100 1", "R 0")),
}
DRIVES = ("ENABLE", "DECAY", "HALF")
PLACES = st.one_of(st.sampled_from([0.0, 0.5, -0.5, 1.0, 4.0, -4.0]), st.integers(-6, 6).map(float))


@st.composite
def cells(draw: st.DrawFn) -> tuple[str, str]:
    """A cell with a rotor and switches on its axis, some at one place, some where it stands; and what to send it."""
    model = draw(st.sampled_from(sorted(MODELS)))
    straps, inputs, commands = MODELS[model]
    shaft = draw(st.sampled_from([0, 0, 3, -4])) if model == "gs-c200" else 0
    lead = draw(st.sampled_from([1.0, 1.0, 0.05, -0.3]))
    names = sorted(pin for pin in inputs if _has(model, pin))
    names += [f"motor.{pin}" for pin in DRIVES] if model == "gs-c200" and draw(st.booleans()) else []
    table = {
        "units.unit": {"model": model, "straps": straps, "shaft": shaft},
        "motors.motor": {
            "motor": "qsh4218-41-10-035", "unit": "unit", "supply": 24.0, "lead": lead,
            "reverse": draw(st.booleans()),
            "load": {
                "friction": draw(st.sampled_from([0.0, 0.003, 0.05, 0.2])),
                "viscous": draw(st.sampled_from([0.0, 1e-3])),
                "torque": draw(st.sampled_from([0.0, 0.0, 0.1, -0.05])),
            },
        },
    }  # fmt: skip
    if model == "bs0610":
        table["motors.motor"] |= {"axis": "X", "supply": 12.0}
    for number in range(draw(st.integers(1, 3))):
        place = (shaft + draw(PLACES)) * lead
        other = place + abs(draw(PLACES)) + 0.25
        ends = draw(st.sampled_from([{"to": place}, {"from": place}, {"from": place, "to": other}]))
        drives = draw(st.lists(st.sampled_from(names), min_size=1, max_size=2, unique=True))
        names = [name for name in names if name not in drives] or names
        table[f"switches.s{number}"] = {
            "axis": "motor", **ends, "inside": draw(st.sampled_from([0, 1])),
            "drives": [pin if "." in pin else f"unit.{pin}" for pin in drives],
        }  # fmt: skip
        if not names:
            break
    used: set[str] = set()
    for key in [key for key in table if key.startswith("switches")]:  # an input has one contact
        table[key]["drives"] = [pin for pin in table[key]["drives"] if pin not in used]
        used |= set(table[key]["drives"])
        if not table[key]["drives"]:
            del table[key]
    sent = draw(st.lists(st.sampled_from(commands), min_size=1, max_size=4))
    begin = 300 if model == "bs0610" else 1  # a board is deaf after its reset
    script = [{"at": f"{begin + 60 * n} ms", "send": text, "to": "unit"} for n, text in enumerate(sent)]
    return _toml(table, script), model


def _has(model: str, pin: str) -> bool:
    from detent.controllers import catalogue

    return any(found.name == pin for found in catalogue.MODELS[model].pins)


def _toml(table: dict[str, dict[str, Any]], script: list[dict[str, str]]) -> str:
    def value(it: object) -> str:
        if isinstance(it, dict):
            return "{ " + ", ".join(f"{key} = {value(one)}" for key, one in it.items()) + " }"
        return json.dumps(it)

    parts = [f"[{name}]\n" + "".join(f"{k} = {value(v)}\n" for k, v in keys.items()) for name, keys in table.items()]
    parts += ["[[script]]\n" + "".join(f"{k} = {value(v)}\n" for k, v in entry.items()) for entry in script]
    return "".join(parts)


def rotor(of: Cell) -> Mechanics:
    part = of.parts[of.wiring.names.index("motor")]
    assert isinstance(part, Mechanics)
    return part


def told(of: Cell) -> dict[str, int]:
    """The levels of the contacts as the wires have them."""
    index = of.wiring.names.index("motor")
    names = rotor(of).contact_names
    nets = {name: net for name in names if (net := of.circuit.net_driven(index, name)) is not None}
    return {name: of.circuit.nets[net].levels[index, name] for name, net in nets.items()}


def real(of: Cell, now: Ns) -> dict[str, int | None]:
    """The levels that the contacts have by the place of the rotor; None so close to an edge that rounding decides."""
    motor, place = rotor(of), rotor(of).place(now)
    found: dict[str, int | None] = {}
    for contact in motor.contacts:
        close = min(abs(place - contact.low), abs(place - contact.high)) < 1e-6
        within = contact.low <= place <= contact.high
        found[contact.name] = None if close else contact.inside if within else HIGH + LOW - contact.inside
    return found


def obeys(text: str) -> None:
    """The law: the cell lives, and at any time its contacts are where the rotor is."""
    made = cell(text, record=False)
    for part in range(1, 17):
        made.run_to(part * 35 * MS + part)
        levels = told(made)
        for name, level in real(made, made.now).items():
            assert level is None or levels.get(name, level) == level, (name, rotor(made).place(made.now), made.now)


NATURAL_HOME = """
[units.unit]
model = "gs-c200"
straps = { CHS = "low" }
[motors.motor]
motor = "qsh4218-41-10-035"
unit = "unit"
supply = 24
load = { friction = 0.05 }
[switches.end]
axis = "motor"
to = 0
drives = ["unit.HOME"]
[[script]]
at = "1 ms"
send = "+100"
to = "unit"
"""


def test_the_natural_home_switch_is_left_once() -> None:
    """Its edge at 0, where the rotor stands, held by friction: inside; a move away opens it, once."""
    made = cell(NATURAL_HOME)
    made.run_to(300 * MS)
    assert made.controller("unit").status(made.now).position == 100
    assert made.recording is not None
    changes = [e.level for e in made.recording.of("unit") if getattr(e, "pin", "") == "HOME"]  # type: ignore[union-attr]
    assert changes == [LOW, HIGH]


@settings(max_examples=12)
@given(cells())
@example((NATURAL_HOME, "gs-c200"))
@example((NATURAL_HOME.replace("to = 0", "from = 0"), "gs-c200"))
@example((NATURAL_HOME.replace("supply", "reverse = true\nsupply"), "gs-c200"))
def test_contacts_follow_the_rotor(made: tuple[str, str]) -> None:
    obeys(made[0])


@pytest.mark.slow
@settings(max_examples=1500)
@given(cells())
def test_contacts_follow_the_rotor_in_many_cells(made: tuple[str, str]) -> None:
    obeys(made[0])
