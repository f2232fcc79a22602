"""The verb `wiring` (BS0610 manual, pages 69 to 74)."""

import contextlib
import json
from itertools import combinations, permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.cli import main
from detent.controllers.genstepper import motors
from detent.controllers.genstepper.wiring import Kind, Order, WiringError, find, orders, reversed_order, sensible

INFINITE = float("inf")


def measured(leads, windings, half=10.0, wire=0.0):
    """Readings between all leads of a motor: windings are (end, common or None, end)."""
    readings = {}
    for one, other in combinations(range(1, leads + 1), 2):
        reading = INFINITE
        for end, common, far in windings:
            if {one, other} == {end, far}:
                reading = 2 * half if common else half
            elif common and {one, other} in ({end, common}, {far, common}):
                reading = half
        readings[one, other] = reading
    if len(windings) == 2 and windings[0][1] and windings[1][1] and wire is not None:
        commons = (windings[0][1], windings[1][1])
        for (one, other), reading in readings.items():
            if reading == INFINITE:
                halves = sum(lead not in commons for lead in (one, other))
                readings[one, other] = halves * half + wire
    return readings


@pytest.mark.parametrize("half", [0.9, 3.0, 9.0, 40.0])
@pytest.mark.parametrize("wire", [0.0, 0.2])
def test_six_leads_with_joined_commons_of_a_motor_of_few_ohms(half, wire):
    found = find(measured(6, [(1, 2, 3), (4, 5, 6)], half, wire))
    assert (found.kind, found.commons) == (Kind.UNIPOLAR_6_JOINED, (2, 5))


@pytest.mark.parametrize(
    ("shown", "ohms"),
    [("OL", INFINITE), ("ol", INFINITE), ("open", INFINITE), ("0L", INFINITE), ("10k", 10_000), ("5ohm", 5),
     ("5 ohms", 5),
     ("1.2kohm", 1200), ("2M", 2e6), ("5\N{OHM SIGN}", 5), ("5", 5), ("1e3", 1000)],
)  # fmt: skip
def test_a_reading_is_written_as_the_meter_shows_it(shown, ohms):
    from detent.cli.wiring import _ohms

    assert _ohms(shown) == ohms


@pytest.mark.parametrize("leads", list(permutations(range(1, 5)))[::5])
def test_page_71_four_leads_low_readings_are_windings(leads):
    a, b, c, d = leads
    found = find(measured(4, [(a, None, b), (c, None, d)]))
    assert found.kind is Kind.BIPOLAR
    assert {frozenset(pair) for pair in found.pairs} == {frozenset((a, b)), frozenset((c, d))}


@pytest.mark.parametrize("common", range(1, 6))
def test_page_71_five_leads_the_common_reads_half_of_all_others(common):
    ends = [lead for lead in range(1, 6) if lead != common]
    found = find(measured(5, [(ends[0], common, ends[1]), (ends[2], common, ends[3])]))
    assert (found.kind, found.commons, found.pairs) == (Kind.UNIPOLAR_5, (common,), ())
    assert set(found.ends) == set(ends)


@pytest.mark.parametrize("leads", list(permutations(range(1, 7)))[::97])
def test_page_72_six_leads_with_joined_or_separate_commons(leads):
    a, b, c, d, e, f = leads
    joined = find(measured(6, [(a, b, c), (d, e, f)], half=40, wire=0.2))
    assert (joined.kind, set(joined.commons), set(joined.ends)) == (Kind.UNIPOLAR_6_JOINED, {b, e}, {a, c, d, f})
    apart = find(measured(6, [(a, b, c), (d, e, f)], half=40, wire=None))
    assert apart.kind is Kind.UNIPOLAR_6
    assert {(frozenset(pair), common) for pair, common in zip(apart.pairs, apart.commons, strict=True)} == {
        (frozenset((a, c)), b),
        (frozenset((d, f)), e),
    }


def test_page_73_the_six_orders_and_page_74_the_other_direction():
    found = find(measured(4, [(1, None, 2), (3, None, 4)]))
    letters = ["".join("ABCD"[lead - 1] for lead in order) for order in orders(found)]
    assert letters == ["ABCD", "ABDC", "ADBC", "ADCB", "ACDB", "ACBD"]
    assert [sensible(found, order) for order in orders(found)] == [True, True, False, False, False, False]
    assert reversed_order(Order(1, 2, 3, 4)) == (2, 1, 4, 3)


readings = st.dictionaries(
    st.tuples(st.integers(-1, 7), st.integers(-1, 7)),
    st.one_of(st.floats(), st.sampled_from([10.0, 20.0, INFINITE])),
    max_size=16,
)


@given(readings)
def test_any_readings_are_a_motor_or_an_error_with_words(found):
    with contextlib.suppress(WiringError):
        assert find(found).ends


def run(*words):
    with pytest.raises(SystemExit) as end:
        main(["wiring", *words])
    return end.value.code or 0


def test_the_verb_prints_windings_and_orders(capsys):
    words = ["1-2=open", "1-3=10", "1-4=open", "2-3=open", "2-4=10", "3-4=open"]
    assert run(*words) == 0
    text = capsys.readouterr().out
    assert "one winding: 1 and 3" in text
    assert "  1  1   3   2   4" in text
    assert run(*words, "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["windings"] == [[1, 3], [2, 4]]
    assert facts["orders"][0] == {"WA1": "1", "WA2": "3", "WB1": "2", "WB2": "4", "fits": True}


def test_without_readings_it_lists_the_six_orders(capsys):
    assert run() == 0
    assert "  3  A   D   B   C" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words",
    [
        ["1-2"],
        ["1-2=ten"],
        ["a-b=1"],
        ["1-2=10"],
        ["1-2=10", "1-3=10", "2-3=10"],
        ["1-1=3"],
        ["--motor", "999"],
        ["1-2=-5"],
        ["1-2=nan"],
    ],
)
def test_a_wrong_question_ends_with_2_and_a_remedy(words, capsys):
    assert run(*words) == 2
    assert capsys.readouterr().err


def test_the_motors_of_the_examples(capsys):
    assert run("--motor", "105873") == 0
    assert "1  common B  Black" in capsys.readouterr().out
    assert run("--motor", "168831", "--json") == 0
    assert json.loads(capsys.readouterr().out)["amperes"] == 1.25
    assert len({example.number for example in motors.EXAMPLES}) == len(motors.EXAMPLES) == 11
