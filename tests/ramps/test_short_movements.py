"""Short movements three ways (Cassinis, "Short movements", figures 10 and 11, "Experimental results")."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.ramps.curves import linear
from detent.ramps.differences import PAPER, Differences, compiled
from detent.ramps.short_movements import PAPER_HYPERBOLA, Ramp, choose, cuts, family, hyperbola, movement, shortest
from detent.ramps.table_movement import constant, ramped
from detent.ramps.ways import Way

ENTRIES = 232
OTHER = compiled(linear(1000, 8000, 0.2), 0.2)


def slowly(*values: int) -> list[Any]:
    """Parameters of the slow tests."""
    return [pytest.param(value, marks=pytest.mark.slow) for value in values]


def seconds(steps: int, way: Way, table: Differences = PAPER) -> float:
    return movement(table, steps, 10, way, len(table.differences)).clocks / 2e6


def test_the_columns_agree_with_movements_made_one_by_one() -> None:
    for made, ramps in ((family(PAPER, ENTRIES), 2600), (cuts(PAPER, ENTRIES), 232), (family(PAPER, 60), 1500)):
        for at in range(1, ramps, 97):
            first, entries, up = int(made.first[at]), int(made.entries[at]), int(made.up[at])
            for steps in (2 * up + 10, 2 * up + 11, 2 * up + 300):
                one = ramped(PAPER, first, entries, steps, 10)
                assert one.up == up
                assert int(made.clocks(steps, 10)[at]) == one.clocks


def test_the_hyperbola_of_figure_11_never_cuts_a_ramp() -> None:
    ups = dict(
        zip(*(column.tolist() for column in (family(PAPER, ENTRIES).first, family(PAPER, ENTRIES).up)), strict=True)
    )
    for m in range(197, 2567):
        assert ups[PAPER_HYPERBOLA.first(m)] <= m
    assert PAPER_HYPERBOLA.first(197) == 5703
    assert PAPER_HYPERBOLA.first(2566) == 3078


def test_below_404_half_steps_constant_speed_wins() -> None:
    assert shortest(PAPER, 10) == 404
    for way in (Way.HYPERBOLA, Way.EXACT):
        assert movement(PAPER, 403, 10, way, ENTRIES) == constant(3076, 403)
        assert choose(PAPER, 404, 10, way, ENTRIES).entries == ENTRIES


@pytest.mark.parametrize("steps", [404, *slowly(405, 700, 1000, 2222, 4000), 5143])
def test_the_exact_way_is_the_best_of_the_whole_family(steps: int) -> None:
    found = [constant(3076, steps).clocks]
    for first in range(3076, 6100):
        up = int(family(PAPER, ENTRIES).up[first - 3076]) if first - 3076 < len(family(PAPER, ENTRIES).up) else 10**9
        if 2 * up + 10 <= steps <= 2 * up + 600:  # those with room to spare for more are slower by far
            found.append(ramped(PAPER, first, ENTRIES, steps, 10).clocks)
    assert movement(PAPER, steps, 10, Way.EXACT, ENTRIES).clocks == min(found)


@pytest.mark.parametrize("stride", [49, *slowly(7)])
def test_the_exact_way_gains_14_ms_on_average_and_24_at_most_of_about_610(stride: int) -> None:
    hyperbolic, exact = (
        np.array([movement(PAPER, steps, 10, way, ENTRIES).clocks for steps in range(404, 5144, stride)]) / 2e3
        for way in (Way.HYPERBOLA, Way.EXACT)
    )
    gain = hyperbolic - exact
    assert gain.min() >= 0
    assert gain.mean() == pytest.approx(14, abs=0.5)
    assert gain.max() <= 24
    assert exact.mean() == pytest.approx(611, abs=1)
    # "a table-bound family cannot give more": every member takes the two ramps of 0.3 s
    assert exact.min() >= 2 * 232 * 1.29


def test_a_curve_cut_to_the_length_is_several_times_faster_below_1000_half_steps() -> None:
    for steps, times in ((100, 2), (404, 3.4), (1000, 2.2), (2000, 1.6)):
        best = min(seconds(steps, Way.EXACT), constant(3076, steps).clocks / 2e6)
        assert best / seconds(steps, Way.FREE) == pytest.approx(times, rel=0.15)


@pytest.mark.parametrize("steps", [2, 11, 50, 403, 999, 5143])
def test_the_free_way_is_the_best_of_all_cuts(steps: int) -> None:
    found = [constant(3076, steps).clocks]
    fitting = [entries for entries in range(1, ENTRIES + 1) if 2 * int(cuts(PAPER, ENTRIES).up[entries]) + 10 <= steps]
    found += [ramped(PAPER, 3076, entries, steps, 10).clocks for entries in fitting]
    assert movement(PAPER, steps, 10, Way.FREE, ENTRIES).clocks == min(found)


def test_a_movement_with_room_for_the_table_gets_it_whatever_the_way() -> None:
    for way in Way:
        assert choose(PAPER, 5144, 10, way, ENTRIES) == Ramp(3076, ENTRIES)


def test_another_table_gets_a_hyperbola_of_its_own_that_never_cuts_a_ramp() -> None:
    entries = len(OTHER.differences)
    members = family(OTHER, entries)
    ups = dict(zip(members.first.tolist(), members.up.tolist(), strict=True))
    found = hyperbola(OTHER)
    assert all(
        ups[found.first(m)] <= m for m in range(int(members.up[-1]) + 11, int(members.up[0])) if found.first(m) in ups
    )
    for steps in range(1, 2 * int(members.up[0]) + 40, 13):
        made = movement(OTHER, steps, 10, Way.HYPERBOLA, entries)
        assert made.train.steps == steps
        assert made.clocks >= movement(OTHER, steps, 10, Way.EXACT, entries).clocks


TABLES = st.builds(
    lambda differences, spare, interval: Differences(sum(differences) + spare, bytes(differences), interval),
    st.lists(st.integers(0, 255), min_size=1, max_size=12), st.integers(1, 4000), st.sampled_from([1, 7, 300, 2580]),
)  # fmt: skip


@settings(deadline=None, max_examples=examples(60))
@given(
    TABLES, st.lists(st.integers(1, 1200), min_size=1, max_size=4), st.sampled_from(Way), st.integers(4, 12), st.data()
)
def test_whatever_the_table_a_movement_has_exactly_its_pulses(
    table: Differences, lengths: list[int], way: Way, offset: int, data: st.DataObject
) -> None:
    for steps in lengths:
        made = movement(table, steps, offset, way, data.draw(st.integers(0, len(table.differences))))
        assert made.train.steps == steps
        assert not made.loads or made.loads[-1].clock <= made.clocks
