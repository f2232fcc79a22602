"""The hardware tables of a cell file: what they take, what they refuse, and that a cell is the same with them."""

import pytest
from tests.cell.cells import cell

from detent.cell.description import Problem, parse
from detent.cell.real_pins import behind_pins

GOOD = """
[units.slide]
model = "gs-c200"
[units.table]
model = "bs0610"
[boards.left]
serial = "/dev/serial/by-id/usb-Klipper_rp2040_E66160F423-if00"
lead = "20 ms"
error = "exact"
[hardware.slide]
board = "left"
step = "!gpio2"
dir = "gpio3"
enable = "!gpio4"
pulse = "5 us"
outputs = { MOV = "gpio6", UO1 = "gpio7", RDY = "!gpio8" }
inputs = { EOT = "^gpio10", HOME = "^gpio11", UI1 = "^!gpio12" }
driver = { kind = "tmc2209", uart = "gpio16", address = 0, sense = 0.11, amperes = 1.2 }
[hardware.table]
board = "left"
inputs = { RST = "^gpio30" }
[hardware.table.X]
board = "left"
step = "gpio17"
dir = "gpio18"
inputs = { "LX-" = "^gpio19", "LX+" = "^gpio20" }
driver = { kind = "tmc2209", uart = "gpio16", address = 1 }
[hardware.table.Y]
board = "left"
step = "gpio21"
dir = "gpio22"
unwired = ["LY-", "LY+"]
driver = { kind = "plain", half = "gpio23" }
"""


def test_a_cell_is_the_same_with_its_tables() -> None:
    described = parse(GOOD, "cell.toml")
    assert list(described.hardware) == ["slide", "table.X", "table.Y", "table"]
    made, plain = cell(GOOD), cell(GOOD[: GOOD.index("[boards")])
    for each in (made, plain):
        each.type("slide", "+20")
        each.run_to(3_000_000_000)
    assert made.recording is not None
    assert plain.recording is not None
    assert list(made.recording) == list(plain.recording)


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        (
            'dir = "gpio3"',
            'dir = "gpio2"',
            "hardware.slide.dir: pin gpio2 of left is hardware.slide.step already: take",
        ),
        ('"gpio18"', '"!gpio12"', "hardware.table.X.dir: pin gpio12 of left is hardware.slide.inputs.UI1 already"),
        ('step = "!gpio2"', "", "hardware.slide.dir: it is of an axis that is driven: give step = 'PIN' too"),
        ('dir = "gpio3"', "", "hardware.slide.dir: this key is missing: the firmware needs a pin for it"),
        ('dir = "gpio3"', 'dir = "^gpio3"', "hardware.slide.dir: an output has no pull: leave out ^ and ~"),
        ('EOT = "^gpio10", ', "", "hardware.slide.inputs: slide has no EOT: wire it, inputs = { EOT = 'PIN' }, or say"),
        ('unwired = ["LY-", "LY+"]', "", "hardware.table.Y.inputs: table.Y has no LY-: wire it"),
        ('["LY-", "LY+"]', '["LY-", "LY+", "RST"]', "hardware.table.Y.unwired: no switch of table.Y 'RST'; there are"),
        (
            '["LY-", "LY+"]',
            '["LY-", "LY+"]\ninputs = { "LY+" = "gpio40" }',
            "table.Y.unwired: LY+ is wired in hardware.",
        ),
        ("UI1 =", "UI4 =", "hardware.slide.inputs.UI4: no input of slide 'UI4'; did you mean UI1, UI2 or UI3?"),
        ("MOV =", "CLOCK =", "hardware.slide.outputs.CLOCK: CLOCK carries the steps: name its pin with step"),
        ("MOV =", "EOT =", "hardware.slide.outputs.EOT: no output of slide 'EOT'"),
        ("[hardware.slide]", "[hardware.slid]", "hardware.slid: no controller 'slid'; did you mean slide?"),
        ("[hardware.table.X]", "[hardware.table.Z]", "hardware.table.Z: no axis of table 'Z'"),
        ("[hardware.table.X]", "[hardware.table.x]", "hardware.table.x: no axis of table 'x'; did you mean X?"),
        (
            '"left"\nstep = "!gpio2"',
            '"right"\nstep = "!gpio2"',
            "hardware.slide.board: no board 'right'; there are: left",
        ),
        (
            'pulse = "5 us"',
            'pulse = "1 us"',
            "hardware.slide.pulse: the pulses of a gs-c200 are 1.7 us long: no shorter",
        ),
        ('pulse = "5 us"', 'puls = "5 us"', "hardware.slide.puls: there is no such key; did you mean pulse?"),
        ('lead = "20 ms"', 'lead = "1 ms"', "boards.left.lead: 3 to 500 ms; 30 ms do on every computer"),
        (
            'lead = "20 ms"',
            'lead = "8 ms"\nmargin = "4 ms"',
            "boards.left.margin: 1 ms to a third of the lead, 2.67 ms",
        ),
        ('lead = "20 ms"', 'margin = "0 s"', "boards.left.margin: 1 ms to a third of the lead"),
        ('lead = "20 ms"', 'watchdog = "50 ms"', "boards.left.watchdog: at least 200 ms here"),
        ('error = "exact"', 'error = "1 s"', "boards.left.error: the error of a pulse is 'exact'"),
        (
            'kind = "tmc2209", uart = "gpio16", address = 0',
            'kind = "a4988"',
            "slide.driver.kind: it should be 'plain', 'tmc",
        ),
        ('uart = "gpio16", address = 1', "address = 1", "hardware.table.X.driver.uart: a tmc2209 is told by its UART"),
        ('half = "gpio23"', "sense = 0.1", "hardware.table.Y.driver.half: a plain driver needs it, half = 'PIN'"),
        (
            'RST = "^gpio30"',
            'RST = "^gpio30", "LX-" = "gpio31"',
            "LX- is wired in hardware.table.X already: remove one",
        ),
        (
            "[units.table]",
            '[switches.end]\ndrives = "slide.EOT"\n[units.table]',
            "slide.EOT is on a wire from end in this",
        ),
        (
            "[units.table]",
            '[[script]]\nat = 0\nset = { "slide.UI1" = 0 }\n[units.table]',
            "slide.UI1 is on a wire from ",
        ),
        ("[boards.left]", '[boards.right]\nserial = "x"\n[boards.left]', ""),
    ],
)
def test_what_cannot_be_is_one_line_with_file_key_and_remedy(old: str, new: str, error: str) -> None:
    assert old in GOOD
    text = GOOD.replace(old, new, 1)
    if not error:
        cell(text)
        return
    with pytest.raises(Problem) as raised:
        cell(text)
    assert error in str(raised.value)
    assert str(raised.value).startswith("cell.toml: ")
    assert "\n" not in str(raised.value)


def test_no_device_is_two_things() -> None:
    device = "/dev/serial/by-id/usb-Klipper_rp2040_E66160F423-if00"
    two = GOOD.replace("[hardware.table]", f'[boards.right]\nserial = "{device}@250000"\n[hardware.table]')
    cell(two)  # nothing hangs on it
    with pytest.raises(Problem, match=f"boards.right.serial: {device} is boards.left.serial already: each has"):
        cell(
            two.replace('[hardware.slide]\nboard = "left"', '[hardware.slide]\nboard = "right"').replace(
                "20 ms", "30 ms"
            )
        )
    wire = GOOD.replace(
        "[boards.left]", f'[lines.host]\nunits = ["slide"]\nendpoint = "serial:{device}"\n[boards.left]'
    )
    with pytest.raises(Problem, match=r"lines\.host\.endpoint: .* is boards.left.serial already"):
        cell(wire)
    cell(two.replace(device, "fake:").replace("@250000", ""))  # each its own fake


def test_a_switch_on_another_board_stops_too_late() -> None:
    text = GOOD.replace('[hardware.table]\nboard = "left"\n', '[hardware.table]\nboard = "right"\n')
    text = text.replace("[boards.left]", '[boards.right]\nserial = "x"\nlead = "20 ms"\n[boards.left]')
    moved = text.replace(', "LX+" = "^gpio20"', "").replace('RST = "^gpio30"', 'RST = "^gpio30", "LX+" = "gpio5"')
    cell(text)
    with pytest.raises(Problem, match=r"LX\+ stops table.X, which is on left: a stop on another board comes too late"):
        cell(moved)


def test_a_step_detector_does_not_gate_real_pins() -> None:
    detector = """
    [units.detector]
    model = "step-detector"
    [[wires]]
    from = "slide.CLOCK"
    to = "detector.CLOCK"
    [[wires]]
    from = "detector.DONE"
    to = "slide.ENABLE"
    [units.table]
    """
    with pytest.raises(
        Problem, match=r"hardware\.slide: detector lets every single pulse of slide through: on real pins"
    ):
        cell(GOOD.replace("[units.table]", detector, 1))


def test_a_switch_of_the_cell_is_a_switch_too() -> None:
    text = GOOD.replace('EOT = "^gpio10", ', "").replace(
        "[units.table]", '[switches.soft]\naxis = "slide"\nfrom = 500\ndrives = "slide.EOT"\n[units.table]'
    )
    cell(text)


END = '[switches.end]\ndrives = "slide.EOT"\naxis = "slide"\nfrom = 300\nmachine = true\n'


def test_a_switch_of_the_machine_stands_in_for_it_where_no_pin_is_driven() -> None:
    made = cell(GOOD + END)
    made.type("slide", "H+")
    made.run_to(10_000_000_000)
    found = made.controllers()["slide"].status(made.now)
    assert (found.position, found.pulses) == (10_000_000 - 400, 1000)  # there, and away again for home


def test_where_pins_are_driven_the_real_one_counts() -> None:
    mine = END.replace(".end", ".mine").replace("EOT", "UI2").replace("machine = true", "")
    assert list(behind_pins(parse(GOOD + END + mine, "cell.toml")).switches) == ["mine"]


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ('axis = "slide"\nfrom = 300\n', "", r"switches\.end\.machine: such a switch is moved by an axis"),
        ('axis = "slide"', 'axis = "table.X"', r"switches\.end\.drives: slide\.EOT is no input that is wired to the"),
        ('axis = "slide"', 'axis = "other"', r"switches\.end\.axis: no driven axis 'other'; there are: slide, "),
        ("slide.EOT", "slide.UI2", r"switches\.end\.drives: slide\.UI2 is no input that is wired"),
        ("machine = true", "", r"hardware\.slide\.inputs\.EOT: slide\.EOT is on a wire from end in this cell already"),
        ("machine = true", "machine = 1", r"switches\.end\.machine: "),
    ],
)  # fmt: skip
def test_a_switch_of_the_machine_is_at_a_wired_input_of_a_driven_axis(old: str, new: str, error: str) -> None:
    text = GOOD.replace('board = "left"\ninputs = { RST', 'board = "right"\ninputs = { RST').replace(
        "[hardware.slide]",
        '[boards.right]\nserial = "fake:"\nlead = "20 ms"\n[units.other]\nmodel = "gs-c200"\n[hardware.slide]',
    )
    text = text.replace('[hardware.table.X]\nboard = "left"', '[hardware.table.X]\nboard = "right"')
    cell(text + END)
    with pytest.raises(Problem, match=error):
        cell(text + END.replace(old, new))


def test_without_a_board_there_is_no_switch_of_the_machine() -> None:
    with pytest.raises(Problem, match=r"switches\.end\.axis: no axis is driven; without machine = true"):
        cell(GOOD[: GOOD.index("[boards")] + END)


@pytest.mark.parametrize(
    ("unit", "pin"),
    [
        ('model = "dcb-274"', "STEP"),
        ('model = "dcb-274"', "DIR"),
        ('model = "dcb-274"\noptions = { inputs = "encoder" }', "STEP"),
        ('model = "bs0610"\noptions = { e_mode = 1 }', "X+"),
    ],
)
def test_an_input_on_which_every_pulse_counts_is_refused(unit: str, pin: str) -> None:
    """A board would miss pulses without a word, and nobody would know where the motor stands."""
    text = f"""
[units.x]
{unit}
[boards.b]
serial = "fake:"
[hardware.x]
board = "b"
inputs = {{ "{pin}" = "^gpio10" }}
"""
    with pytest.raises(Problem) as raised:
        cell(text)
    wanted = (
        f"cell.toml: hardware.x.inputs.{pin}: every pulse on x.{pin} is a step, and a board looks at its inputs once"
    )
    assert str(raised.value).startswith(wanted)
    assert str(raised.value).endswith("or let a unit of this cell give them")


def test_slew_keys_are_inputs_like_others() -> None:
    cell(GOOD.replace('RST = "^gpio30"', 'RST = "^gpio30", "X+" = "^gpio31"'))
