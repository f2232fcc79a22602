"""The application pages: phase current programming and slew speed selection."""

import pytest

from detent.controllers.gsc200.application import resistors, slew_rate


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


def test_the_printed_r1_is_not_the_gs_d200s() -> None:
    """The text says "assuming the GS-D200S is used"; with its 750 ohm R1 is another."""
    assert resistors(0.25, 0.5, 1.5, "GS-D200S").r1 == pytest.approx(3090, rel=5e-3)


@pytest.mark.parametrize("currents", [(0.5, 0.25, 1.5), (0.0, 0.5, 1.5), (0.25, 1.2, 1.5), (0.25, 0.5, 12.0)])
def test_currents_that_no_resistor_gives_are_refused(currents: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="A"):
        resistors(*currents)


def test_the_slew_speed_is_derived_from_units() -> None:
    """1 hp moves 33 000 lb through a foot in a minute; a shaft of 1 hp has 5252 / rpm ft lb."""
    # 6600 lb through 1 inch in 1 s is 1 hp; at 5252.1 turns a minute that is 1 ft lb = 192 oz in
    assert slew_rate(6600, 1, 1, 192) == pytest.approx(5252.1, rel=1e-4)
    with pytest.raises(ValueError, match="above 0"):
        slew_rate(1, 1, 0, 1)
