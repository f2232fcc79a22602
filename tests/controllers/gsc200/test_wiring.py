"""Pins as the datasheet wires them: page 4 (pins 13 and 28), figure 10 (a clock for each direction)."""

from pathlib import Path

import numpy as np
import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import Problem, parse
from detent.controllers.device import Refused
from detent.outputs import arrays, signals
from detent.ticks import SECOND


def built(text: str) -> Cell:
    return build(parse(text, "cell.toml"), lambda file: "")


def multipoint(*txpd: str | None) -> str:
    """Modules 6, 5, 4 ... on one line, TXPD tied as said; None: nothing is said."""
    text = ""
    names = [chr(ord("a") + place) for place in range(len(txpd))]
    for address, (name, tied) in enumerate(zip(names, txpd, strict=True), 1):
        levels = [f"SEL{pin} = {address >> (2 - pin) & 1}" for pin in range(3)]
        levels += [f'TXPD = "{tied}"'] if tied is not None else []
        text += f'[units.{name}]\nmodel = "gs-c200"\nstraps = {{ {", ".join(levels)} }}\n'
    return f"{text}[lines.bus]\nunits = {names}\n"


@pytest.mark.parametrize(
    ("txpd", "tied"),
    [
        (("open", "low"), "b"), (("low", "open"), "a"), (("open", None), "b"), (("low", None), "a"),
        ((None, None), "b"), (("high", "low"), "b"), (("open", None, None), "c"), ((None, "low", None), "b"),
        ((None, "open", "open"), "a"),
    ],
)  # fmt: skip
def test_txpd_is_open_on_all_modules_but_the_chain_terminator(txpd: tuple[str | None, ...], tied: str) -> None:
    """Page 4, pin 13: "this pin must be left open on all modules except the chain terminator unit"."""
    cell = built(multipoint(*txpd))
    assert [name for name, unit in cell.controllers().items() if unit.straps["TXPD"] == 0] == [tied]


@pytest.mark.parametrize("txpd", [("open", "open"), ("low", "low"), ("low", "low", None)])
def test_a_line_with_no_pull_down_or_with_two_is_refused(txpd: tuple[str | None, ...]) -> None:
    with pytest.raises(Problem, match="TXPD must be tied to TXD on one unit of a line"):
        built(multipoint(*txpd))


def test_point_to_point_txpd_must_be_tied() -> None:
    """Page 4, pin 13: "must always be connected to the TxD output ... when the Point-to-Point protocol is used"."""
    with pytest.raises(Problem, match="it is open on every unit"):
        built('[units.a]\nmodel = "gs-c200"\nstraps = { TXPD = "open" }\n')


CLOCKS = """
[units.a]
model = "gs-c200"
options = { clock = "separate" }
"""
COUNTED = """
[units.b]
model = "step-detector"
[[wires]]
from = "a.%s"
to = "b.CLOCK"
"""
BACK_AND_FORTH = '[[script]]\nat = "10 ms"\nsend = ["+300"]\nto = "a"\n[[script]]\nat = 2\nsend = ["-100"]\nto = "a"\n'


@pytest.mark.parametrize(("pin", "pulses"), [("CLOCK", 400), ("CW", 300), ("CCW", 100)])
def test_the_circuit_of_figure_10_has_its_two_clocks_beside_pin_28(pin: str, pulses: int) -> None:
    """Figure 10: both clocks are made of CLOCK and DIR, which stay what they are (page 4, pins 26 and 28)."""
    cell = built(CLOCKS + COUNTED % pin + BACK_AND_FORTH)
    cell.run_to(4 * SECOND)
    assert cell.parts[1].steps == pulses  # type: ignore[attr-defined]


@pytest.mark.parametrize("wired", [False, True])
def test_a_drawing_has_the_pulses_on_all_three_clocks_with_and_without_a_wire(wired: bool, tmp_path: Path) -> None:
    cell = built(CLOCKS + (COUNTED % "CLOCK" if wired else "") + BACK_AND_FORTH)
    cell.run_to(4 * SECOND)
    drawn = signals.of_cell(cell)
    unit = drawn.units[0]
    falls = {pin: int((unit.wave(pin).levels == 0).sum()) for pin in ("CLOCK", "CW", "CCW")}
    assert falls == {"CLOCK": 400, "CW": 300, "CCW": 100}
    arrays.write(tmp_path / "a.npz", drawn)
    with np.load(tmp_path / "a.npz") as kept:
        assert '"common": "CLOCK"' in str(kept["meta"])


def test_a_velocity_move_ends_at_the_first_pulse_of_a_clock_that_is_wired_to_its_input() -> None:
    """Entry gsx: "until the specified (x) input is brought to zero"."""
    text = (
        CLOCKS
        + '[units.b]\nmodel = "gs-c200s"\n[[wires]]\nfrom = "a.CLOCK"\nto = "b.UI1"\n'
        + '[[script]]\nat = "10 ms"\nsend = ["g+1"]\nto = "b"\n[[script]]\nat = "500 ms"\nsend = ["+300"]\nto = "a"\n'
    )
    cell = built(text)
    cell.run_to(10 * SECOND)
    assert [unit.status(cell.now).state for unit in cell.controllers().values()] == ["ready", "ready"]
    assert cell.controller("b").status(cell.now).position == 508


def test_a_module_that_is_strapped_to_another_rate_takes_its_line_for_noise_from_the_next_power_on() -> None:
    """Page 4, pins 4 to 6, "Baud Rate Programming": straps are read at power-on, and both ends need one rate."""
    cell = built(multipoint(None, None) + "[[script]]\nat = 1\npower = { b = false }\n")
    cell.run_to(SECOND // 2)
    cell.set_pin("b", "BR0", 1)  # 4800 baud
    cell.type("b", "+100")
    cell.run_to(2 * SECOND)
    assert cell.controller("b").status(cell.now).pulses == 100
    cell.power("b", True)
    for unit in ("b", "a"):
        cell.type(unit, "+100")
    cell.run_to(4 * SECOND)
    assert cell.controller("b").status(cell.now).pulses == 100
    assert cell.controller("a").status(cell.now).pulses == 100
    cell.power("b", False)
    cell.set_pin("b", "BR0", 0)
    cell.power("b", True)
    cell.type("b", "+100")
    cell.run_to(6 * SECOND)
    assert cell.controller("b").status(cell.now).pulses == 200


def test_a_module_whose_pin_10_is_not_grounded_obeys_nothing() -> None:
    """Page 4, pin 10: "for testing purpose only and it must be grounded for normal operation"."""
    cell = built('[units.a]\nmodel = "gs-c200"\n')
    cell.set_pin("a", "TEST", 1)
    cell.type("a", "+10")
    cell.run_to(SECOND)
    assert cell.controller("a").status(cell.now).pulses == 10  # it counts from the next power-on
    for on in (False, True):
        cell.power("a", on)
    cell.type("a", "+10")
    cell.run_to(2 * SECOND)
    assert cell.controller("a").status(cell.now).pulses == 10
    assert cell.recording is not None
    assert [entry.frame for entry in cell.recording.of("a") if isinstance(entry, Refused)] == ["TEST"]
