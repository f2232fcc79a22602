"""Jumpers, supplies and motors that a board stands or not (manual, pages 7, 12, 14, 62, 67, 78)."""

import pytest
from tests.controllers.genstepper.boards import Board

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import Problem, parse
from detent.controllers import catalogue
from detent.controllers.genstepper.supply import Question, size

MOTOR = '[motors.m]\nmotor = "qsh4218-35-10-027"\nunit = "board"\naxis = "X"\nsupply = {supply}\n{more}'


def made(model: str = "bs0610", unit: str = "", supply: float | None = None, more: str = "") -> Cell:
    motor = "" if supply is None else MOTOR.format(supply=supply, more=more)
    return build(parse(f'[units.board]\nmodel = "{model}"\n{unit}\n{motor}', "test"), lambda file: "")


@pytest.mark.parametrize(
    ("model", "straps", "half"),
    [
        ("bs0610", "", 16),
        ("bs0610", "S1K = 0", 8),
        ("bs0710", "", 16),
        ("bs0710", "HLF = 0", 8),
        ("bs0710", "S1K = 0", 8),
        ("bs0710", "FUL = 0", 16),
        ("bs0710", "FUL = 1, HLF = 0", 8),
    ],
)
def test_page_67_the_half_power_jumper_by_any_of_its_names(model, straps, half):
    board = Board(model, toml=f"straps = {{ {straps} }}", idle_windings=1)
    assert board.drives()[-1].drive.sixteenths == half


@pytest.mark.parametrize(
    "straps", ["FUL = 0, HLF = 0", "FUL = 1", "FUL = 1, HLF = 1", "S1K = 0, HLF = 0", "S1K = 1, FUL = 0"]
)
def test_page_67_exactly_one_of_ful_and_hlf_must_be_installed(straps):
    with pytest.raises(Problem, match="page 67"):
        made("bs0710", f"straps = {{ {straps} }}")


@pytest.mark.parametrize("model", ["bs0610", "bs0710"])
@pytest.mark.parametrize(
    "name", ["S1K", "S1L", "SK1", "S2K", "HLF", "HLP", "FUL", "FULL", "R1", "R2K", "1K", "S-1K", "JSX"]
)
def test_no_jumper_is_a_guess_for_another_as_r1k_doubles_the_current(model, name):
    if name in catalogue.MODELS[model].straps:
        return
    with pytest.raises(Problem) as told:
        made(model, f'straps = {{ "{name}" = 0 }}')
    assert "did you mean" not in str(told.value)
    assert "there are: JS, " in str(told.value)


def test_only_its_case_is_mended():
    with pytest.raises(Problem, match="did you mean S1K"):
        made("bs0610", "straps = { s1k = 0 }")


def test_a_limit_is_no_guess_for_that_of_the_other_side():
    wire = '[[wires]]\nfrom = "board.RDY"\nto = "board.{}"\n'
    for pin in ("LX", "L+", "Y", "XL-"):
        with pytest.raises(Problem) as told:
            made("bs0610", f"\n{wire.format(pin)}")
        assert "did you mean" not in str(told.value), pin


@pytest.mark.parametrize("volts", [0.5, 4.4, 34.1, 48])
def test_page_62_a_motor_supply_outside_4_5_to_34_v_is_told(volts):
    with pytest.raises(Problem, match=r"units\.board\.supply.*4\.5 to 34 V"):
        made(unit=f"supply = {volts}")
    with pytest.raises(Problem, match=r"motors\.m\.supply.*4\.5 to 34 V"):
        made(supply=volts)


@pytest.mark.parametrize("volts", [4.5, 34])
def test_page_62_the_ends_of_the_range_are_in_it(volts):
    assert made(unit=f"supply = {volts}").controllers()["board"].status(0).state == "starting"
    assert made(supply=volts, more="resistance = 40").wiring.names == ("board", "m")


@pytest.mark.parametrize(
    ("unit", "stands"),
    [
        ("", 1),
        ("straps = { S1K = 0 }", 2),
        ("straps = { R1K = 0 }", 2),
        ("straps = { R1K = 0, S1K = 0 }", 4),
        ("options = { high_power = 1 }", 2),
        ("options = { double_current = 'yes' }", 2),
        ("straps = { S1K = 0 }\noptions = { dual_baud = 'yes' }", 1),
    ],
)
def test_page_7_a_motor_beyond_the_boards_current_is_told(unit, stands):
    ohms = 5.3  # of a winding of this motor
    assert made(unit=unit, supply=min(round(0.99 * stands * ohms, 2), 20)).wiring.remarks == ()
    if stands < 4:
        (remark,) = made(unit=unit, supply=round(1.02 * stands * ohms, 2)).wiring.remarks
        assert f"stands {stands} A" in remark


def test_run_tells_it(capsys, tmp_path):
    from detent.cli import main

    file = tmp_path / "cell.toml"
    file.write_text('[units.board]\nmodel = "bs0610"\n' + MOTOR.format(supply=12, more=""))
    with pytest.raises(SystemExit):
        main(["run", str(file), "--for", "1 ms", "--json"])
    told = capsys.readouterr()
    assert "m: 2.26 A in each winding at 12 V, and this bs0610 stands 1 A" in told.err
    assert "lower the supply to 5.30 V" in told.out


def test_page_78_the_drivers_drop_is_in_the_sheet():
    assert size(Question(12, 30)).motor_volts == (10, pytest.approx(10.9))
    assert any("page 78" in warning for warning in size(Question(1.5, 30)).warnings)
