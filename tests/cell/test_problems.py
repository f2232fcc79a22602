"""What cannot be built: each fault is told with the file, the key and what to do."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.cell.cells import cell

from detent.cell.build import build
from detent.cell.description import Problem, parse, single
from detent.ticks import MS

ONE = '[units.bar]\nmodel = "gs-c200"\n'
TWO = ONE + '[units.drill]\nmodel = "gs-c200s"\n'
WIRE = "[[wires]]\n"

A = ONE + '[switches.a]\ndrives = "bar.UI1"\n'
FAULTS = [
    # form
    ("units = ", "", "it is no TOML: "),
    ("", "units", "this key is missing"),
    ("[units]\n", "", "a cell needs at least one unit: [units.NAME] with model = 'gs-c200'"),
    ("[units.bar]\n", "units.bar.model", "this key is missing"),
    ('file = "x"\n' + ONE, "file", "there is no such key; remove it"),
    (ONE + 'modle = "x"\n', "units.bar.modle", "there is no such key; did you mean model? there are: model, program"),
    ("colour = 1\n" + ONE, "colour", "there are: title, units, wires, switches, "),
    (ONE + "program = 5\n", "units.bar.program", "(it is 5)"),
    (ONE + "[switches.a]\n", "switches.a.drives", "this key is missing"),
    (A + 'level = 2\n', "switches.a.level", "a level is 0, 1, low or high (it is 2)"),
    (A + 'level = true\n', "switches.a.level", "a level is 0, 1, low or high"),
    (A + 'from = 2\n', "switches.a", "name it with axis = 'UNIT'"),
    (A + 'axis = "bar"\n', "switches.a", "needs its place: at, or from and to"),
    (A + 'axis = "bar"\nat = 1\nto = 2\n', "switches.a", "either at, or from and to"),
    (A + 'axis = "bar"\nfrom = 3\nto = 2\n', "switches.a", "must not be greater"),
    (ONE + "[[script]]\nat = 1\n", "script[1]", "nothing to do: give set, send or power"),
    (ONE + "[[script]]\nat = -1\npower = {bar = true}\n", "script[1].at", "is no duration: write it like 1.5 s"),
    (ONE + '[[script]]\nat = "3 parsecs"\npower = {bar = true}\n', "script[1].at", "is no duration"),
    (ONE + '[[script]]\nat = true\npower = {bar = true}\n', "script[1].at", "write a time like 1.5 (seconds)"),
    (ONE + '[[script]]\nset = {"bar.UI1" = 1}\n', "script[1].at", "this key is missing"),
    # units
    ('[units.bar]\nmodel = "gs-c300"\n', "units.bar.model", "no model 'gs-c300'; did you mean gs-c200"),
    ('[units.bar]\nmodel = "GS-C200"\n', "units.bar.model", "did you mean gs-c200? there are: "),
    (ONE + "straps = {CSH = 0}\n", "units.bar.straps", "no strap of the gs-c200 'CSH'; did you mean CHS?"),
    (ONE + "straps = {CHS = 3}\n", "units.bar.straps", "strap CHS cannot be 3; it takes low (0), high (1) or open"),
    (ONE + "straps = {TEST = 1}\n", "units.bar.straps", "pin 10 (TEST) of bar must be tied to ground"),
    (ONE + "straps = {TXPD = 1}\n", "units.bar.straps", "TXPD must be tied to TXD on one unit of a line"),
    (ONE + "options = {revison = 2.1}\n", "units.bar.options", "did you mean revision?"),
    (ONE + 'options = {instruction_time = "0"}\n', "units.bar.options", "it takes a duration of at least 1 us"),
    (ONE + 'options = {clock = "both"}\n', "units.bar.options", "it takes direction or separate"),
    ('[units.bar]\nmodel = "gs-c200s"\noptions = {revision = 2.1}\n', "units.bar.options", "no option of the gs-c200s"),
    (ONE + 'program = "gone.gsc"\n', "units.bar.program", "cannot read gone.gsc: No such file or directory"),
    (ONE + 'eeprom = "gone.gsc"\n', "units.bar.eeprom", "cannot read gone.gsc"),
    (ONE + 'program = "bad.gsc"\n', "units.bar.program", "bad.gsc:1:2: A takes an output, 1 to 3, not '9'"),
    (ONE + 'program = "long.gsc"\n', "units.bar.program", "119"),
    ('[units.d]\nmodel = "step-detector"\nprogram = "ok.gsc"\n', "units.d.program", "holds no program: remove it"),
    ('[units.d]\nmodel = "step-detector"\noptions = {response = "x"}\n', "units.d.options", "it takes a duration"),
    ('[units.d]\nmodel = "step-detector"\nstraps = {CHS = 0}\n', "units.d.straps", "no strap of the step-detector"),
    # wires
    (TWO + WIRE + 'from = "bar"\nto = "drill.UI1"\n', "wires[1].from", "'bar' names no pin: write UNIT.PIN"),
    (TWO + WIRE + 'from = "bra.UO1"\nto = "drill.UI1"\n', "wires[1].from", "no unit 'bra'; did you mean bar?"),
    (TWO + WIRE + 'from = "bar.UO1"\nto = "moon.UI1"\n', "wires[1].to", "no unit 'moon'; there are: bar, drill"),
    (TWO + WIRE + 'from = "bar.UO1"\nto = "drill.UI9"\n', "wires[1].to", "that takes a wire 'UI9'; did you mean UI"),
    (TWO + WIRE + 'from = "bar.UI1"\nto = "drill.UI1"\n', "wires[1].from", "is no output: a wire starts at one"),
    (TWO + WIRE + 'from = "bar.TXD"\nto = "drill.RXD"\n', "wires[1].from", "'TXD'"),
    (TWO + WIRE + 'from = "bar.UO1"\nto = "bar.UO1"\n', "wires[1].to", "bar.UO1 is wired to itself: remove the wire"),
    (TWO + WIRE + 'from = "bar.UO1"\nto = "drill.UO1"\n', "wires", "bar.UO1 and drill.UO1 drive the same wire"),
    (
        TWO + WIRE + 'from = "bar.UO1"\nto = "drill.UI1"\n' + WIRE + 'from = "drill.UO2"\nto = "drill.UI1"\n',
        "wires", "drill.UO2 and bar.UO1 drive the same wire: only open collectors may share one",
    ),
    (TWO + WIRE + 'from = "bar.RDY"\nto = "drill.UO1"\n', "wires", "drive the same wire"),
    (
        ONE + '[switches.a]\ndrives = "bar.UI1"\n[switches.b]\ndrives = "bar.UI1"\n',
        "wires", "b and a drive the same wire",
    ),
    # switches
    (ONE + '[switches.bar]\ndrives = "bar.UI1"\n', "switches.bar", "a unit has this name already: choose another"),
    (ONE + '[switches.a]\ndrives = "bar.UX1"\n', "switches.a.drives", "that takes a wire 'UX1'; did you mean U"),
    (A + 'axis = "baz"\nat = 1\n', "switches.a.axis", "no unit 'baz'"),
    (
        '[units.d]\nmodel = "step-detector"\n[switches.a]\ndrives = "d.CLOCK"\naxis = "d"\nat = 1\n',
        "switches.a.axis", "d moves no axis: name a controller",
    ),
    # lines
    (ONE + "[lines.one]\nunits = []\n", "lines.one.units", "a line needs at least one unit"),
    (ONE + '[lines.one]\nunits = ["baz"]\n', "lines.one.units", "no unit 'baz'; did you mean bar?"),
    (TWO + '[lines.one]\nunits = ["bar", "drill"]\n', "lines.one.units", "point to point: give it an address"),
    (ONE + '[lines.one]\nunits = "bar"\n[lines.two]\nunits = "bar"\n', "lines.two.units", "bar is on line one already"),
    (
        '[units.a]\nmodel = "gs-c200"\nstraps = {SEL0 = 0}\n[units.b]\nmodel = "gs-c200"\nstraps = {SEL0 = 0}\n'
        '[lines.one]\nunits = ["a", "b"]\n',
        "lines.one.units", "a and b both have address 4: change SEL0-SEL2 of one of them",
    ),
    (
        '[units.a]\nmodel = "gs-c200"\nstraps = {SEL0=0}\n[units.b]\nmodel = "gs-c200"\nstraps = {SEL1=0, BR0=1}\n'
        '[lines.one]\nunits = ["a", "b"]\n',
        "units.b.straps", "a is strapped for 9600 7O2, b for 4800 7O2: units on one line need the same",
    ),
    (
        '[units.a]\nmodel = "gs-c200"\nstraps = {SEL0 = 0, TXPD = 0}\n'
        '[units.b]\nmodel = "gs-c200"\nstraps = {SEL1 = 0, TXPD = 0}\n[lines.one]\nunits = ["a", "b"]\n',
        "lines.one.units", "units a and b have it tied; set TXPD = low on b only",
    ),
    (ONE + '[units.d]\nmodel = "step-detector"\n[lines.x]\nunits = "d"\n', "lines.x.units", "d has no serial port"),
    # script
    (ONE + "[[script]]\nat = 1\nset = {start = 1}\n", "script[1].set", "no switch 'start'; there are: UNIT.PIN"),
    (ONE + "[[script]]\nat = 1\nset = {bar = 1}\n", "script[1].set", "bar is a unit: write bar.PIN"),
    (ONE + '[[script]]\nat = 1\nset = {"bar.UO1" = 1}\n', "script[1].set", "bar.UO1 is an output: the unit sets it"),
    (ONE + '[[script]]\nat = 1\nset = {"bar.UI1" = 7}\n', "script[1].set.bar.UI1", "a level is 0, 1, low or high"),
    (
        ONE + '[switches.a]\ndrives = "bar.UI1"\n[[script]]\nat = 1\nset = {"bar.UI1" = 1}\n',
        "script[1].set", "a drives bar.UI1: set that instead, or cut the wire",
    ),
    (ONE + "[[script]]\nat = 1\npower = {baz = true}\n", "script[1].power", "no unit 'baz'; did you mean bar?"),
    (ONE + '[[script]]\nat = 1\nsend = "F"\n', "script[1].to", "say which unit the line is for: to = 'UNIT'"),
    (ONE + '[[script]]\nat = 1\nsend = "F"\nto = "baz"\n', "script[1].to", "no unit 'baz'"),
    (
        TWO + '[lines.one]\nunits = "bar"\n[[script]]\nat = 1\nsend = "F"\nto = "drill"\n',
        "script[1].to", "drill is on no line: put it on one in [lines]",
    ),
]  # fmt: skip

FILES = {"bad.gsc": "A9\n", "long.gsc": "+1\n" * 30, "ok.gsc": "A1\n"}


@pytest.mark.parametrize(("text", "key", "message"), FAULTS, ids=[f"{n}-{key}" for n, (_, key, _) in enumerate(FAULTS)])
def test_a_fault_is_told_with_its_file_its_key_and_the_remedy(text: str, key: str, message: str) -> None:
    with pytest.raises(Problem) as caught:
        cell(text, FILES)
    problem = caught.value
    assert problem.file == "cell.toml"
    assert problem.key == key
    assert message in problem.message
    assert str(problem) == ": ".join(part for part in ("cell.toml", key, problem.message) if part)
    assert "\n" not in str(problem)


def test_several_faults_of_form_are_told_in_one_line() -> None:
    with pytest.raises(Problem) as caught:
        cell(ONE + "colour = 1\n[[script]]\nat = 'x'\nset = {a = 1}\n[[wires]]\nto = 'x'\n")
    assert str(caught.value).count("; ") >= 2
    many = ONE + "".join(f"key{n} = 1\n" for n in range(9))
    with pytest.raises(Problem, match=r"and 4 more$"):
        cell(many)


def test_a_damaged_image_is_told() -> None:
    with pytest.raises(Problem, match=r"units\.bar: its stored image is damaged: byte 0 holds 00h"):
        cell(ONE, images={"bar": b"\0"})


def test_a_cell_of_one_unit_has_no_file() -> None:
    made = build(single("gs-c200", straps={"CHS": 0}), lambda name: "")
    assert list(made.controllers()) == ["gs-c200"]
    with pytest.raises(Problem, match=r"^units\.gs-c300\.model: no model"):
        build(single("gs-c300"), lambda name: "")


def test_levels_times_and_names_may_be_written_in_several_ways() -> None:
    described = parse(
        ONE
        + '[switches.a]\ndrives = "bar.UI1"\nlevel = "low"\n[switches.b]\ndrives = ["bar.UI2", "bar.UI3"]\nlevel = 1\n'
        + '[[script]]\nat = "400 us"\nset = {a = "high"}\n[[script]]\nat = 2\nset = {a = 0}\n',
        "x",
    )
    assert described.switches["a"].level == 0
    assert described.switches["a"].drives == ["bar.UI1"]
    assert [entry.at for entry in described.script] == [400_000, 2_000_000_000]


def test_line_faults_do_not_need_lines_for_every_unit() -> None:
    made = cell(TWO + '[lines.one]\nunits = "bar"\n')
    assert len(made.lines) == 1
    with pytest.raises(ValueError, match="is on no line"):
        made.type("drill", "F")
    with pytest.raises(KeyError, match="no unit 'moon'"):
        made.type("moon", "F")


def test_a_part_is_no_controller() -> None:
    made = cell(ONE + '[units.d]\nmodel = "step-detector"\n')
    with pytest.raises(TypeError, match="'d' is not a controller"):
        made.controller("d")
    assert list(made.controllers()) == ["bar"]


MOTOR = '[motors.m]\nmotor = "qsh4218-41-10-035"\nunit = "bar"\nsupply = 24\n'
OWN = '[motors.m]\nunit = "bar"\nsupply = 24\ndata = {{ {} }}\n'
GOOD = "resistance = 2.0, inductance = 3e-3, current = 1, holding_torque = 0.3, inertia = 5e-6"


@pytest.mark.parametrize(
    ("text", "key", "message"),
    [
        (f"[units.bar]\nmodel = 'gs-c200'\nshaft = {'9' * 4000}", "units.bar.shaft", "less than or equal to"),
        (f"[units.bar]\nmodel = 'gs-c200'\nshaft = {'9' * 5000}", "", "a number of thousands of digits"),
        ("[units.bar]\nmodel = 'gs-c200'\nsupply = nan", "units.bar.supply", "a finite number"),
        ("x = " + "[" * 5000 + "]" * 5000, "", "nested too deeply"),
        ("[units.'a.b']\nmodel = 'gs-c200'", "units.a.b", "'.' in a name would part it"),
        ("[units.'']\nmodel = 'gs-c200'", "units.''", "a name is 1 to 64 characters"),
        ('[units."a\\nb"]\nmodel = "gs-c200"', "units.'a\\nb'", "a name is 1 to 64 characters"),
        (ONE + "[switches.s]\naxis = 'bar'\nfrom = -inf\nto = inf\ndrives = 'bar.HOME'", "switches.s.from", "finite"),
        (ONE + "[switches.s]\naxis = 'bar'\nat = 1e400\ndrives = 'bar.HOME'", "switches.s.at", "finite"),
        (ONE + MOTOR + "window = -5", "motors.m.window", "greater than 0"),
        (ONE + MOTOR + "lead = 0", "motors.m", "lead is the distance that a step moves, and not 0"),
        (ONE + MOTOR + "load = { inertia = 1e300 }", "motors.m.load.inertia", "less than or equal to"),
        (ONE + "[[script]]\nat = '1e1000000000 s'\nsend = 'F'", "script[1].at", "is no duration"),
        (ONE + "[[script]]\nat = 1e22\nsend = 'F'", "script[1].at", "longer than 1000000 years"),
        (ONE + "[motors.m]\nunit = 'bar'\nsupply = 24", "motors.m", "name the motor with motor = 'NAME'"),
        (ONE + OWN.format("resistance = 2.0"), "motors.m", "needs inductance, current, holding_torque too"),
        (ONE + OWN.format("resistence = 2.0"), "motors.m", "did you mean resistance?"),
        (ONE + OWN.format(GOOD + ", steps = 50.5"), "motors.m", "50.5 steps a turn"),
        (ONE + OWN.format(GOOD + ", steps = 'many'"), "motors.m", "steps is 'many': give a number"),
        (
            ONE + MOTOR + "step = 'full'\n[[wires]]\nfrom = 'bar.UO3'\nto = 'm.HALF'",
            "motors.m.step",
            "write step = 'half'",
        ),
        (ONE + MOTOR + "step = '1/65'", "motors.m.step", "microstepping divides a step by 1 to 64"),
        (
            ONE.replace("gs-c200", "supersigma") + MOTOR + "step = '1/8'",
            "motors.m.step",
            "a supersigma steps its motor by half",
        ),
        (ONE.replace("gs-c200", "dcb-274") + MOTOR + "step = '1/16'", "motors.m.step", "by full, half, 1/4, 1/8"),
        (
            ONE + MOTOR + "current = { ramp = 1, slew = 0.6, rest = 0.3 }",
            "motors.m.current",
            "wire bar.MOV to m.MOV and bar.RAMP to m.RAMP",
        ),
        (ONE + OWN.format(GOOD) + "fitted = true", "motors.m", "fitted is for a named motor"),
    ],
)
def test_what_comes_from_outside_has_a_bound_where_it_comes_in(text: str, key: str, message: str) -> None:
    with pytest.raises(Problem) as caught:
        cell(text, FILES)
    assert (caught.value.file, caught.value.key) == ("cell.toml", key)
    assert message in caught.value.message
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(
    ("data", "steps"), [(GOOD, 200), (GOOD + ", steps = 48", 48), (GOOD + ", steps = 400, detent_torque = 0.01", 400)]
)
def test_a_motor_of_ones_own_is_as_good_as_a_named_one(data: str, steps: int) -> None:
    made = cell(ONE + OWN.format(data) + "load = { friction = 0.01, viscous = 1e-3 }", FILES)
    made.type("bar", "+40")
    made.run_to(2_000_000_000)
    motor = made.parts[made.wiring.names.index("m")]
    assert motor.rig.motor.steps == steps  # type: ignore[attr-defined]
    assert motor.place(made.now) == pytest.approx(40, abs=0.1)  # type: ignore[attr-defined]


def test_a_named_motor_may_have_other_steps() -> None:
    made = cell(ONE + MOTOR + "data = { steps = 400 }", FILES)
    assert made.parts[made.wiring.names.index("m")].rig.motor.steps == 400  # type: ignore[attr-defined]


# -- any value of any key ------------------------------------------------------------------------------------------

EXAMPLES = Path(__file__).parents[2] / "examples"
VALUE = re.compile(r"""=[ \t]*("[^"\n]*"|'[^'\n]*'|-?[\d.][\w.+-]*|true|false)""")
STRANGE = ("-1", "0", "nan", "inf", "1e15", "-1e15", "1e-300", "99999999999", '""', "true", "[]", "{}", "0.5", '"x"',
           '"1e15 s"', '"0 s"', "-0.0", "1979-05-27", "9" * 5000)  # fmt: skip


def strange_cells() -> Iterator[tuple[Path, str]]:
    """The cells of the examples with one value of one key replaced by another."""
    for path in sorted(EXAMPLES.glob("*/*.toml")):
        text = path.read_text("utf-8")
        for found in VALUE.finditer(text):
            for value in STRANGE:
                yield path, text[: found.start(1)] + value + text[found.end(1) :]


def built_or_refused(path: Path, text: str) -> None:
    try:
        build(parse(text, path.name), lambda name: (path.parent / name).read_text("utf-8"), record=False).run_to(MS)
    except Problem as problem:
        told = str(problem)
    else:
        return
    assert told.startswith(f"{path.name}: ")
    assert "\n" not in told


def test_any_value_of_any_key_is_taken_or_refused_in_a_line() -> None:
    cells = list(strange_cells())
    assert len(cells) > 3000
    for path, text in cells[::7]:
        built_or_refused(path, text)


@pytest.mark.slow
def test_all_of_them_are() -> None:
    for path, text in strange_cells():
        built_or_refused(path, text)


def test_a_motor_of_a_chopper_with_a_supply_that_is_none_is_refused() -> None:
    text = ONE + '[motors.m]\nmotor = "qsh4218-41-10-035"\naxis = "bar"\nsupply = -1\n'
    with pytest.raises(Problem, match=r"motors\.m: drive: supply is -1\.0: give a number greater than 0"):
        build(parse(text, "cell.toml"), str)
    with pytest.raises(Problem, match=r"units\.w\.options: .*brake is at least 8 us"):
        build(parse('[units.w]\nmodel = "phase-reversal"\noptions = { brake = 0 }\n', "cell.toml"), str)


def test_a_number_of_thousands_of_digits_is_told_with_its_line() -> None:
    with pytest.raises(Problem, match=r"a number of thousands of digits \(at line 3\)"):
        parse(ONE + f"shaft = {'9' * 5000}\n", "cell.toml")
