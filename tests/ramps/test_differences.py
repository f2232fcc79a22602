"""The table compiler and the numbers that the paper prints of its table (Cassinis, "Long movements", table 2)."""

import itertools

import pytest

from detent.ramps import curves
from detent.ramps.curves import PAPER_DURATION, PAPER_SINE, linear, sine_squared, through
from detent.ramps.differences import PAPER, ROOM, CurveError, Differences, compiled, instants, nearest_count, parse

PAPER_CURVE = sine_squared(*PAPER_SINE)


def test_the_papers_curve_begins_at_650_and_ends_at_15000_steps_a_second() -> None:
    assert PAPER_CURVE(0) == pytest.approx(650, abs=0.5)
    assert PAPER_CURVE(PAPER_DURATION) == pytest.approx(15_000, abs=0.5)


def test_the_printed_peak_of_14000_gives_neither_end_point() -> None:
    printed = sine_squared(14_000, *PAPER_SINE[1:])
    assert printed(0) < 610
    assert max(printed(t) for t in instants(0.3)) < 14_001


def test_the_compiled_table_has_232_differences_of_a_byte_each_from_3076_to_132() -> None:
    table = compiled(PAPER_CURVE, PAPER_DURATION)
    assert len(table.differences) == 232
    assert (table.counts()[0], table.counts()[-1]) == (3076, 132)
    assert max(table.differences) == 163 <= 255
    assert min(table.differences) == 0
    assert sum(table.differences) == 2944
    assert table.interval * 500 == 1_290_000


def test_the_table_that_the_drive_keeps_is_the_compiled_one() -> None:
    assert compiled(PAPER_CURVE, PAPER_DURATION) == PAPER


def test_the_program_with_the_table_takes_1002_bytes_of_1024() -> None:
    assert PAPER.bytes_of_program == 1002
    assert ROOM == 254


def test_a_count_is_the_one_whose_speed_comes_nearest_by_equation_2() -> None:
    assert nearest_count(650) == 3076
    assert nearest_count(15_000) == 132
    assert nearest_count(100) == 19_999


def test_the_grid_has_both_ends() -> None:
    found = list(instants(0.3))
    assert len(found) == 233
    assert found[0] == 0
    assert found[-1] == pytest.approx(0.29928)


def test_a_difference_that_does_not_fit_a_byte_is_refused_with_its_place() -> None:
    with pytest.raises(CurveError, match=r"^difference 1, between t = 0\.00000 s .* is 267 and does not fit a byte"):
        compiled(linear(650, 15_000, 0.3), 0.3)
    with pytest.raises(CurveError, match=r"difference 78, between t = 0\.09933 s .*N = 1999.*: the curve may not fall"):
        compiled(through([(0, 1000), (0.1, 1000), (0.2, 900)]), 0.2)


@pytest.mark.parametrize(
    ("curve", "duration", "message"),
    [
        (linear(0, 1000, 0.1), 0.1, "at t = 0.00000 s the speed is 0"),
        (linear(1000, -1, 0.1), 0.1, "may not fall|speed is"),
        (linear(1000, float("nan"), 0.1), 0.1, "the speed is nan"),
        (linear(10, 1000, 0.1), 0.1, "the rate generator gives 30.52 to 1000000"),
        (linear(650, 1000, 0.001), 0.001, "there is no difference"),
        (sine_squared(15_000, 2, 0.2097), 0.6, r"465 differences, .*room for 254"),
    ],
)
def test_a_curve_that_cannot_be_a_table_is_refused(curve: curves.Curve, duration: float, message: str) -> None:
    with pytest.raises(CurveError, match=message):
        compiled(curve, duration)


def test_points_are_joined_by_straight_lines_and_kept_beyond_their_ends() -> None:
    curve = through([(0.1, 100), (0.2, 300), (0.4, 400)])
    assert [curve(t) for t in (0, 0.1, 0.15, 0.2, 0.3, 0.4, 1)] == pytest.approx([100, 100, 200, 300, 350, 400, 400])
    with pytest.raises(CurveError, match="two points"):
        through([(0, 1)])
    with pytest.raises(CurveError, match="rise in t: 1 s comes behind 2 s"):
        through([(2, 1), (1, 1)])


def test_a_table_is_written_and_read_as_one_line() -> None:
    assert parse(str(PAPER)) == PAPER
    for wrong in ("", "3076", "3076:2580:zz", "10:2580:ff", "3076:0:01", "3076:2580:", "70000:2580:01", "a:b:c:d"):
        with pytest.raises(ValueError, match="FIRST-N:CLOCKS:DIFFERENCES-IN-HEX"):
            parse(wrong)


def test_a_speed_limit_leaves_the_entries_that_do_not_exceed_it() -> None:
    speeds = [2_000_000 / (n + 1) for n in PAPER.counts()]
    assert all(a <= b for a, b in itertools.pairwise(speeds))
    for limit in (100, 600, 649, 650, 700, 2000, 7500, 14_999, 15_000, 25_500):
        entries = PAPER.entries_up_to(limit)
        assert entries == max((i for i, speed in enumerate(speeds) if speed <= limit), default=0)
    assert PAPER.entries_up_to(650) == 0
    assert PAPER.entries_up_to(25_500) == 232


def test_a_table_that_makes_no_sense_is_no_table() -> None:
    with pytest.raises(ValueError, match="at least one difference"):
        Differences(100, b"")
    with pytest.raises(ValueError, match="more than all differences together, 100"):
        Differences(100, b"\x32\x32")
