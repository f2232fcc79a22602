from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.ticks import HALF_NS, LONGEST, NEVER, ONE_NS, SECOND, parse_duration, round_fixed, round_ratio, to_fixed


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


@pytest.mark.parametrize(
    ("written", "ns"),
    [
        ("400 us", 400_000),
        ("1.5s", 1_500_000_000),
        (2, 2 * SECOND),
        (1e-9, 1),
        (".5 ns", 1),
        ("1e3 h", 3_600_000 * SECOND),
    ],
)
def test_a_duration_is_read_exactly(written: str | float, ns: int) -> None:
    assert parse_duration(written) == ns


def read(written: str | float) -> tuple[int, str]:
    """The duration, or what is said to be wrong with it."""
    try:
        return parse_duration(written), ""
    except ValueError as error:
        return 0, str(error)


@given(st.one_of(st.text(max_size=60), st.floats(), st.integers(), st.from_regex(r"\A\d+e\d+ ?(s|h)\Z")))
def test_no_duration_is_longer_than_can_be_waited_for_and_none_takes_long_to_read(written: str | float) -> None:
    ns, wrong = read(written)
    assert 0 <= ns <= LONGEST < NEVER // 1000
    assert len(wrong) < 200


def test_a_duration_without_a_bound_is_refused_at_once() -> None:
    for written in ("1e1000000000 s", "9" * 100_000, 10**5000, 1e22, float("nan"), float("inf"), "1/3"):
        _, wrong = read(written)
        assert "write it like" in wrong or "longer than" in wrong
