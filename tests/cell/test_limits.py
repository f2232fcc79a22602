"""Electrical limits, checked where a cell states them (datasheet, "Electrical characteristics", pins 15-18, 20-21)."""

import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import Problem, parse


def built(lines: str) -> Cell:
    description = parse(f'[units.bar]\nmodel = "gs-c200"\n{lines}\n', "cell.toml")
    return build(description, lambda name: "")


@pytest.mark.parametrize("lines", ["supply = 12", "supply = 40.0", 'loads = { "5V" = 0.1, "+VSL" = 0.01, "-VSL" = 0 }'])
def test_what_the_datasheet_allows_is_taken(lines: str) -> None:
    assert built(lines).wiring.names == ("bar",)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("supply = 11.9", "cell.toml: units.bar.supply: 11.9 V: a gs-c200 takes 12 to 40 V"),
        ("supply = 42", "cell.toml: units.bar.supply: 42 V: a gs-c200 takes 12 to 40 V"),
        ("loads = { 5V = 0.101 }", "cell.toml: units.bar.loads: 101 mA from 5V: 5V gives at most 100 mA"),
        ('loads = { "+VSL" = 0.02 }', "cell.toml: units.bar.loads: 20 mA from +VSL: +VSL gives at most 10 mA"),
        ('loads = { "5V" = -0.02 }', "cell.toml: units.bar.loads: -20 mA from 5V: 5V gives at most 100 mA"),
        ('loads = { "VSL" = 0 }', "no supply output 'VSL'; there are"),
    ],
)
def test_more_than_it_allows_is_refused_with_the_limit(lines: str, said: str) -> None:
    with pytest.raises(Problem) as refused:
        built(lines)
    assert said in str(refused.value)
