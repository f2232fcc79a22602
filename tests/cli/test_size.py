"""The verb `size` and its pages (BS0610 manual, pages 62 to 68)."""

import json

import pytest

from detent.cli import main
from detent.cli.size import PAGES
from detent.controllers.genstepper.supply import STEP_MODES, Question, size, voltage_for


@pytest.mark.parametrize(("mode", "factors"), [(0, (1.0, 1.4)), (1, (2.0, 2.5)), (2, (2.0, 2.5)), (3, (1.7, 2.3))])
def test_page_64_current_multipliers_by_step_mode(mode, factors):
    sheet = size(Question(12, 30, mode))
    assert sheet.winding_current == pytest.approx(0.4)
    assert sheet.motor_current == pytest.approx([0.4 * factor for factor in factors])
    assert (STEP_MODES[mode].absolute, STEP_MODES[mode].recommended) == factors


def test_page_64_winding_currents_and_page_65_the_voltage_for_a_current():
    assert size(Question(6, 3)).winding_current == 2
    assert size(Question(12, 3)).winding_current == 4
    assert voltage_for(0.5, 12) == 6


def test_page_66_a_single_supply_feeds_the_logic_too_and_two_motors_double_the_current():
    single, dual = size(Question(12, 30, 3, 2)), size(Question(12, 30, 3, 2, "DS", 7))
    assert single.supply_current == pytest.approx((2 * 0.68 + 0.3, 2 * 0.92 + 0.3))
    assert dual.supply_current == pytest.approx((2 * 0.68, 2 * 0.92))


@pytest.mark.parametrize(
    ("question", "warning"),
    [
        (Question(12, 30, 3), "worked example"),
        (Question(12, 10), "product failure"),
        (Question(12, 25), "fan must be used"),
        (Question(24, 100), "above 15 V"),
        (Question(24, 100), "SS is 6.5 to 15 V"),
        (Question(40, 100, supply="DS"), "4.5 to 34"),
        (Question(7, 100), "7.5 to 15 V"),
        (Question(12, 100, logic_voltage=7), "nothing is to be connected"),
        (Question(12, 100, supply="DS"), "DS needs"),
        (Question(12, 100, supply="DS", logic_voltage=16), "DS needs"),
        (Question(12, 100, supply="5VO", logic_voltage=6), "exactly 5 V"),
        (Question(12, 100, tap=0.2), "fan cooled"),
        (Question(12, 100, tap=0.6), "500 mA"),
    ],
)
def test_it_warns_as_the_manual_does(question, warning):
    assert any(warning in told for told in size(question).warnings)


def test_what_is_within_limits_is_not_warned_of():
    assert size(Question(12, 40, 2)).warnings == ()
    assert size(Question(12, 10, 2, double_current=True, supply="DS", logic_voltage=7)).warnings != ()
    assert size(Question(24, 100, 2, supply="DS", logic_voltage=7)).warnings == (
        "above 15 V of motor supply fan based cooling of the board is required (pages 14, 63)",
    )


@pytest.mark.parametrize(
    "wrong",
    [
        Question(0, 1),
        Question(1, 0),
        Question(1, 1, 4),
        Question(1, 1, motors=3),
        Question(1, 1, supply="XX"),
        Question(1, 1, motors=2, double_current=True),
    ],
)
def test_what_is_no_supply_is_an_error(wrong):
    with pytest.raises(ValueError, match=r"."):
        size(wrong)


def run(*words):
    with pytest.raises(SystemExit) as end:
        main(["size", *words])
    return end.value.code or 0


def test_the_verb_lists_pages_questions_and_answers(capsys):
    assert run() == 0
    assert all(name in capsys.readouterr().out for name in ["bs0610"])
    for name, page in PAGES.items():
        assert run(name) == 0
        text = capsys.readouterr().out
        assert all(quantity.name in text for quantity in page.quantities)
    assert run("bs0610", "voltage=12V", "resistance=30", "motors=2") == 0
    assert "1.84 A" in capsys.readouterr().out
    assert run("bs0710", "current=0.5A", "resistance=12ohm", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["page"], facts["voltage_v"], facts["winding_a"]) == ("bs0710", 6, 0.5)


@pytest.mark.parametrize(
    "words",
    [
        ["bs061"],
        ["bs0610", "voltage"],
        ["bs0610", "volts=3"],
        ["bs0610", "voltage=x", "resistance=1"],
        ["bs0610", "voltage=12"],
        ["bs0610", "resistance=12"],
        ["bs0610", "voltage=0", "resistance=1"],
        ["bs0610", "voltage=1", "resistance=1", "supply=AB"],
        ["bs0610", "voltage=12", "current=1", "resistance=12"],
        ["gs-c200", "ramp=1"],
        ["gs-c200-current", "ramp=3"],
        ["gs-c200-current", "ramp=2.6", "drive=GS-D200S"],
        ["gs-c200-slew", "force=-1", "length=1", "time=1", "torque=1"],
        ["gs-c200-slew", "force=0", "length=1", "time=1", "torque=1"],
        ["gs-c200-slew", "force=1", "length=1", "time=1e6", "torque=1"],
        ["gs-c200-slew", "force=1", "length=1", "time=1", "torque=1", "steps=0"],
    ],
)
def test_a_wrong_question_ends_with_2_and_a_remedy(words, capsys):
    assert run(*words) == 2
    assert capsys.readouterr().err


def test_dcb_274_currents_are_percents_of_4_amperes_and_the_supply_is_twice_the_winding_at_least(capsys):
    """Page 5: "Y 25 50" equals 1 A hold and 2 A run; page 52: 100 is 4 A; page 64: twice the winding rating."""
    assert run("dcb-274", "current=2A", "resistance=7", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["hold_percent"], facts["run_percent"], facts["run_a"]) == (25, 50, 2)
    assert facts["supply_v"] == {"least": 28, "most": 40}
    assert run("dcb-274", "current=3.2", "resistance=1", "hold=0") == 0  # the quiet mode of page 53
    assert "Y 0 80" in capsys.readouterr().out


def test_what_is_printed_with_json_is_json_always(capsys):
    for words in ([], ["gs-c200"], ["gs-c200-slew"], ["gs-c200-current", "ramp=1.5", "drive=GS-D200S"]):
        assert run(*words, "--json") == 0
        assert json.loads(capsys.readouterr().out)


def test_a_controller_of_several_pages_lists_them(capsys):
    assert run("gs-c200") == run("gs-c200s") == 0
    assert capsys.readouterr().out.count("gs-c200-slew ") == 2


def test_page_24_half_power_ends_above_the_auto_full_power_rate(capsys):
    assert run("bs0610", "voltage=12", "resistance=40", "mode=2", "half_power=yes") == 0
    assert "0A or a run rate below it (page 24)" in capsys.readouterr().out


def test_resistors_are_those_of_the_drive_and_what_they_make_is_told(capsys):
    assert run("gs-c200-current", "rest=0.25", "slew=0.5", "ramp=1.5", "drive=GS-D200S") == 0
    out = capsys.readouterr().out
    assert "rest 0.2" in out
    assert "E24" in out


@pytest.mark.parametrize(("speed", "decay"), [(90, 25), (180, 50), (360, 100), (720, 200)])
def test_dcb_274_page_36_thresholds_in_eighths(speed, decay, capsys):
    """The column of 1/8 SPS: b 25 is 2400, 50 4800, 100 9600, 200 19 200."""
    assert run("dcb-274", "current=2", "resistance=1", f"speed={speed}", "resolution=1/8", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["decay"], facts["decay_steps_per_s"]) == (decay, 96 * decay)


@pytest.mark.parametrize(
    ("words", "warning"),
    [
        (["current=5", "resistance=1"], "Y 100"),
        (["current=2", "resistance=1", "supply=48"], "never exceed 40 V"),
        (["current=2", "resistance=1", "supply=12"], "advises against"),
        (["current=2", "resistance=15"], "twice the 30 V"),
        (["current=4", "resistance=4"], "100 VA"),
        (["current=1", "resistance=4", "hold=2"], "smaller"),
    ],
)
def test_dcb_274_warns_as_the_manual_does(words, warning, capsys):
    assert run("dcb-274", *words) == 0
    assert warning in capsys.readouterr().out
    assert run("dcb-274", "current=0", "resistance=1") == 2
