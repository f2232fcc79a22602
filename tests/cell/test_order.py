"""Law: the order of the units in a file, and which of them gets its supply first, change no pulse.

A wire that nobody drives reads 1 (GS-C200 datasheet, page 4: "when unconnected they are at the 1 logic level"), and
that somebody begins to drive it is no edge.
"""

from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.parts import PARTS
from detent.cell.recording import Received
from detent.controllers import catalogue
from detent.pins import LOW, PinKind, PinSet
from detent.ticks import MS, SECOND
from detent.uart import Sent

COMMAND = {  # what each is told at 1 s, and at 2 s
    "gs-c200": ("+40", "G0"),
    "gs-c200s": ("+40", "G0"),
    "supersigma": ("move +450", "move -50"),
    "dcb-274": ("+400", "-100"),
    "bs0610": ("X300G", "Y-200G"),
    "bs0710": ("X300G", "Y-200G"),
}
PROGRAMS = {  # what they do in the very instant of power-on
    "gs-c200": ("", "A1\n+20", "W1\n+10", "G+1\n", "A1\nC1\nU1\n+5"),
    "gs-c200s": ("", "A2\ng-2\n", "jc7,8\nA1\n+7\nA2\n+9", "I3\nW2\n-3"),
    "dcb-274": ("", "+ 50\n", "P 0\nA 8\n+ 100\n", "L 0 0\n"),
}
PART = ("phase-reversal", "step-detector")
MODELS = (*COMMAND, *PART)
EDGES = {  # inputs that act on an edge, or on nothing before a command: which unit is switched on first means nothing
    "gs-c200": ("UI1", "UI2", "EOT", "HOME"),
    "gs-c200s": ("UI1", "UI2", "EOT", "HOME"),
    "supersigma": ("RAIL", "FORCE"),
    "dcb-274": ("STEP", "DIR"),
    "bs0610": ("NXT",),
    "bs0710": ("NXT",),
    "phase-reversal": ("CLOCK", "DIR", "MOV", "RAMP"),
    "step-detector": ("CLOCK",),
}


class Wire(NamedTuple):
    """From an output to an input: each a unit and a pin."""

    source: tuple[str, str]
    sink: tuple[str, str]


class Plan(NamedTuple):
    """A cell: its units by name, its wires, and the programs that some units start with."""

    units: dict[str, str]
    wires: list[Wire]
    programs: dict[str, str]


def pins(model: str, kinds: tuple[PinKind, ...]) -> list[str]:
    table = catalogue.MODELS[model].pins if model in catalogue.MODELS else PARTS[model].pins
    return [pin.name for pin in table if pin.kind in kinds]


@st.composite
def plans(draw: st.DrawFn, edges: bool) -> Plan:
    models = draw(st.lists(st.sampled_from(MODELS), min_size=2, max_size=4))
    units = {f"u{n}": model for n, model in enumerate(models)}
    sources = [(u, p) for u, m in units.items() for p in pins(m, (PinKind.OUTPUT, PinKind.OPEN_COLLECTOR))]
    if edges:  # a pulse that a unit gives when it has been switched on is one
        sources = [(u, p) for u, p in sources if (units[u][:2], p) not in (("gs", "RESET"), ("bs", "RDY"))]
    sinks = [(u, p) for u, m in units.items() for p in (EDGES[m] if edges else pins(m, (PinKind.INPUT,)))]
    taken = draw(st.lists(st.sampled_from(sinks), max_size=6, unique=True)) if sources else []
    wires = [Wire(draw(st.sampled_from(sources)), sink) for sink in taken]
    # a circle through a part whose outputs follow its inputs is a latch: it stays as it was switched on
    wires = [
        wire for wire in wires
        if wire.source[0] < wire.sink[0] or "phase-reversal" not in (units[wire.source[0]], units[wire.sink[0]])
    ]  # fmt: skip
    programs = {unit: draw(st.sampled_from(PROGRAMS[model])) for unit, model in units.items() if model in PROGRAMS}
    return Plan(units, [wire for wire in wires if wire.source[0] != wire.sink[0]], {} if edges else programs)


def made(plan: Plan, order: list[str], begins: dict[str, int]) -> Cell:
    text = []
    for unit in order:
        text += [f"[units.{unit}]", f'model = "{plan.units[unit]}"']
        text += [f'program = "{unit}"'] if plan.programs.get(unit) else []
        text += ["powered = false"] if begins.get(unit) else []
        if plan.units[unit] == "phase-reversal":
            text += [f"[motors.m{unit}]", 'motor = "qsh4218-41-10-035"', "supply = 24"]
    for wire in plan.wires:
        text += ["[[wires]]", f'from = "{".".join(wire.source)}"', f'to = "{".".join(wire.sink)}"']
    for unit, model in plan.units.items():
        if model == "phase-reversal":
            for source, sink in (("STEP", "CLOCK"), ("TURN", "DIR")):
                text += ["[[wires]]", f'from = "{unit}.{source}"', f'to = "m{unit}.{sink}"']
        if begins.get(unit):
            text += ["[[script]]", f'at = "{begins[unit]} ms"', f"power = {{ {unit} = true }}"]
    for unit, model in plan.units.items():
        for second, command in enumerate(COMMAND.get(model, ()), 1):
            text += ["[[script]]", f"at = {second}", f'send = ["{command}"]', f'to = "{unit}"']
    return build(parse("\n".join(text), "cell"), lambda file: plan.programs[file])


def pulses(cell: Cell, plan: Plan) -> dict[str, list[object]]:
    """Every pulse of every axis, and every edge of the step outputs of parts."""
    assert cell.recording is not None
    found: dict[str, list[object]] = {}
    for unit, model in plan.units.items():
        if model in COMMAND:
            for axis in cell.controller(unit).axes:
                spans = cell.recording.motion(unit, cell.now, axis)
                found[f"{unit}.{axis}"] = [
                    (span.first, span.last, span.direction, span.train.times(span.first, min(span.last, 50)).tolist())
                    for span in spans
                    if span.last >= span.first
                ]
        elif model == "phase-reversal":
            entries = cell.recording.of(unit)
            found[unit] = [entry.at for entry in entries if isinstance(entry, PinSet) and entry[1:] == ("STEP", LOW)]
    return found


def seen(plan: Plan, order: list[str], begins: dict[str, int]) -> dict[str, list[object]]:
    cell = made(plan, order, begins)
    cell.run_to(4 * SECOND)
    return pulses(cell, plan)


def check_order(plan: Plan, order: list[str]) -> None:
    assert seen(plan, order, {}) == seen(plan, list(plan.units), {})


def check_supply(plan: Plan, order: list[str], begins: dict[str, int]) -> None:
    assert seen(plan, order, begins) == seen(plan, list(plan.units), {})


DAMPED = Plan(
    {"u0": "gs-c200", "u1": "phase-reversal"},
    [Wire(("u0", pin), ("u1", pin)) for pin in ("CLOCK", "DIR", "MOV", "RAMP")],
    {},
)


@st.composite
def orders(draw: st.DrawFn) -> tuple[Plan, list[str]]:
    plan = draw(plans(edges=False))
    return plan, draw(st.permutations(list(plan.units)))


@st.composite
def sequences(draw: st.DrawFn) -> tuple[Plan, list[str], dict[str, int]]:
    plan = draw(plans(edges=True))
    order = draw(st.permutations(list(plan.units)))
    return plan, order, {unit: draw(st.sampled_from([0, 0, 10, 250, 400])) for unit in plan.units}


@given(orders())
@settings(max_examples=examples(25))
def test_the_order_in_the_file_changes_no_pulse(case: tuple[Plan, list[str]]) -> None:
    check_order(*case)


@given(sequences())
@settings(max_examples=examples(25))
def test_which_unit_is_switched_on_first_changes_no_pulse(case: tuple[Plan, list[str], dict[str, int]]) -> None:
    check_supply(*case)


@pytest.mark.parametrize("begins", [{"u0": 0}, {"u0": 300}, {"u1": 300}, {"u0": 300, "u1": 200}])
@pytest.mark.parametrize("order", [["u0", "u1"], ["u1", "u0"]])
def test_a_damper_makes_no_step_when_its_controller_is_switched_on(order: list[str], begins: dict[str, int]) -> None:
    """Section "Electronic damping": it steps behind the last pulse of a motion; before the first there is none."""
    check_supply(DAMPED, order, begins)
    cell = made(DAMPED, order, begins)
    cell.run_to(SECOND - 1)
    assert pulses(cell, DAMPED) == {"u0.": [], "u1": []}


ALONE = """
[units.%s]
model = "gs-c200"
straps = { REC = "low" }
powered = false
eeprom = "%s"
[switches.%s]
drives = ["%s.EOT", "%s.HOME"]
level = 0
"""


@pytest.mark.parametrize("first", ["a", "b"])
@pytest.mark.parametrize("wait", ["W1\n+10", "G+1"])
def test_units_that_the_script_switches_on_in_one_go_find_each_others_outputs(first: str, wait: str) -> None:
    """b must not take the wire for open: a, which drives it to 0, is switched on in the same instant."""
    programs = {"a": "D1\nA1", "b": wait}
    text = "".join(ALONE % (unit, unit, f"{unit}2", unit, unit) for unit in ("a", "b"))
    text += '[[wires]]\nfrom = "a.UO1"\nto = "b.UI1"\n[[script]]\nat = "50 ms"\n'
    text += "power = { a = true, b = true }\n" if first == "a" else "power = { b = true, a = true }\n"
    cell = build(parse(text, "cell"), lambda file: programs[file])
    cell.run_to(SECOND // 8)
    assert cell.controller("b").status(cell.now).pulses == 0
    cell.run_to(SECOND)
    assert cell.controller("b").status(cell.now).pulses == (10 if wait.startswith("W") else 0)


@pytest.mark.slow
@given(orders())
@settings(max_examples=10_000)
def test_the_order_in_the_file_changes_no_pulse_at_length(case: tuple[Plan, list[str]]) -> None:
    check_order(*case)


@pytest.mark.slow
@given(sequences())
@settings(max_examples=10_000)
def test_which_unit_is_switched_on_first_changes_no_pulse_at_length(
    case: tuple[Plan, list[str], dict[str, int]],
) -> None:
    check_supply(*case)


def test_a_unit_that_is_strapped_otherwise_changes_what_no_other_unit_of_its_line_hears() -> None:
    text = "".join(f'[units.{u}]\nmodel = "gs-c200s"\nstraps = {{ {s} = 0, CHS = 0 }}\n' for u, s in
                   (("a", "SEL0"), ("b", "SEL1"), ("c", "SEL2")))  # fmt: skip
    cell = build(parse(text + '[lines.bus]\nunits = ["a", "b", "c"]\n', "cell"), str)
    cell.run_to(100 * MS)
    cell.power("b", False)
    cell.set_pin("b", "BR0", 1 - cell.controller("b").straps["BR0"])
    cell.power("b", True)
    cell.run_to(200 * MS)
    cell.type("c", "V1")
    cell.run_to(2 * SECOND)
    assert cell.recording is not None
    heard = {u: [e.char for e in cell.recording.of(u) if isinstance(e, Received)] for u in "abc"}
    assert heard["a"] == heard["c"] != heard["b"]
    assert any(isinstance(entry, Sent) for entry in cell.recording.of("c"))
