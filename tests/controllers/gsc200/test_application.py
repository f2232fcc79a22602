"""The application pages: phase current programming and slew speed selection."""

import pytest

from detent.controllers.gsc200.application import currents, resistors, slew_rate, standard


def test_the_resistors_of_the_datasheets_example() -> None:
    """ "Phase current programming": 0.25, 0.5 and 1.5 A give R3 = 937, R2 = 500, R1 = 4245 ohm."""
    found = resistors(0.25, 0.5, 1.5)
    assert found.r3 == pytest.approx(937, abs=1)
    assert found.r2 == pytest.approx(500, abs=1)
    assert found.r1 == pytest.approx(4245, rel=2e-3)


def test_r3_follows_the_printed_formula() -> None:
    """R3 = I / (1 - 0.933 I), in kilo-ohms although the text does not say so."""
    for amps in (0.3, 0.5, 0.8):
        assert resistors(0.1, amps, 2.0).r3 / 1000 == pytest.approx(amps / (1 - 0.93333 * amps), rel=1e-4)


@pytest.mark.parametrize("drive", ["GS-D200", "GS-D200S"])
@pytest.mark.parametrize("wanted", [(0.25, 0.5, 1.5), (0.1, 0.3, 2.0), (0.6, 0.65, 0.7)])
def test_the_resistors_make_the_currents_that_were_asked_for(wanted: tuple[float, float, float], drive: str) -> None:
    """Figure 11, with 1.2 kilo-ohm to ground in a GS-D200 and 750 ohm in a GS-D200S."""
    assert currents(resistors(*wanted, drive), drive) == pytest.approx(wanted)


def test_the_resistors_of_a_gs_d200_give_a_gs_d200s_less() -> None:
    """ "Assuming the GS-D200S is used": with its 750 ohm the printed R2 and R3 give 0.22 and 0.40 A."""
    rest, slew, _ = currents(resistors(0.25, 0.5, 1.5), "GS-D200S")
    assert (round(rest, 2), round(slew, 2)) == (0.22, 0.4)


def test_the_nearest_resistors_that_one_can_buy() -> None:
    assert [standard(ohms) for ohms in (937, 500, 4249, 9600, 1.04, 99)] == [910, 510, 4300, 10_000, 1.0, 100]


@pytest.mark.parametrize(
    "currents", [(0.5, 0.25, 1.5), (0.0, 0.5, 1.5), (0.25, 1.2, 1.5), (0.25, 0.5, 12.0), (0.25, 0.5, 2.1)]
)
def test_currents_that_no_resistor_gives_are_refused(currents: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="A"):
        resistors(*currents)


def test_the_slew_speed_is_derived_from_units() -> None:
    """1 hp moves 33 000 lb through a foot in a minute; a shaft of 1 hp has 5252 / rpm ft lb."""
    # 6600 lb through 1 inch in 1 s is 1 hp; at 5252.1 turns a minute that is 1 ft lb = 192 oz in
    assert slew_rate(6600, 1, 1, 192) == pytest.approx(5252.1, rel=1e-4)
    with pytest.raises(ValueError, match="above 0"):
        slew_rate(1, 1, 0, 1)
