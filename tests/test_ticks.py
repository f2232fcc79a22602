from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from detent.ticks import HALF_NS, ONE_NS, round_fixed, round_ratio, to_fixed


def test_a_tie_goes_up_on_both_sides_of_zero():
    assert round_fixed(to_fixed(3) + HALF_NS) == 4
    assert round_fixed(to_fixed(3) + HALF_NS - 1) == 3
    assert round_fixed(to_fixed(-3) - HALF_NS) == -3
    assert round_fixed(to_fixed(-3) - HALF_NS - 1) == -4
    assert round_ratio(7, 2) == 4
    assert round_ratio(-7, 2) == -3


@given(st.fractions())
def test_rounding_the_floor_in_fixed_point_rounds_the_truth(instant: Fraction):
    floor = (instant * ONE_NS).__floor__()
    rounded = round_fixed(floor)
    assert rounded - Fraction(1, 2) <= instant < rounded + Fraction(1, 2)


@given(st.integers(), st.integers(1))
def test_a_ratio_is_rounded_to_the_nearest_integer(numerator: int, denominator: int):
    rounded = round_ratio(numerator, denominator)
    assert rounded - Fraction(1, 2) <= Fraction(numerator, denominator) < rounded + Fraction(1, 2)
