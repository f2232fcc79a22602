"""Drives on a MICROBUS in a cell: who hears what, the strobes as pins, and cells that cannot be."""

import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import Problem, parse
from detent.cell.recording import InputSet, Received
from detent.pins import PinSet
from detent.ticks import US
from detent.uart import Sent

TWO = """
[units.left]
model = "supersigma"
options = {{ number = {left} }}
[units.right]
model = "{model}"
{options}
[lines.microbus]
units = ["left", "right"]
"""


def cell(
    left: int = 1, model: str = "supersigma", options: str = "options = { number = 2 }", timed: bool = True
) -> Cell:
    text = TWO.format(left=left, model=model, options=options)
    return build(parse(text, "two.toml"), lambda file: "", line_timing=timed)


def test_every_drive_sees_every_byte_and_its_strobe_and_one_obeys() -> None:
    two = cell()
    two.type("right", "move +100")
    while two.step() is not None:
        pass
    assert two.recording is not None
    for unit in ("left", "right"):
        entries = two.recording.of(unit)
        assert [e.char.value for e in entries if isinstance(e, Received)] == [2, 1, 0, 100]
        strobe = [(e.at, e.level) for e in entries if isinstance(e, InputSet)]
        assert strobe == [(at * 25 * US, at % 2 ^ 1) for at in range(1, 9)]
    assert [unit.status(two.now).position for unit in two.controllers().values()] == [0, 100]


def test_an_answer_has_its_strobe_too() -> None:
    two = cell()
    two.type("left", "status")
    while two.step() is not None:
        pass
    assert two.recording is not None
    entries = two.recording.of("left")
    assert [(e.at, e.done, e.char.value) for e in entries if isinstance(e, Sent)] == [
        (100 * US, 150 * US, 0), (150 * US, 200 * US, 0), (200 * US, 250 * US, 0),
    ]  # fmt: skip
    strobe = [(e.at, e.level) for e in entries if isinstance(e, PinSet) and e.pin == "ANSWER" and e.at]
    assert strobe == [(125 * US, 0), (150 * US, 1), (175 * US, 0), (200 * US, 1), (225 * US, 0), (250 * US, 1)]
    assert bytes(heard.char.value for heard in two.lines[0].take()) == bytes(3)


def test_without_line_timing_many_bytes_in_one_instant_are_no_oscillation() -> None:
    two = cell(timed=False)
    two.send(0, b"\x01\x05" * 600)
    assert len(two.lines[0].take()) == 1800


@pytest.mark.parametrize(
    ("left", "model", "options", "message"),
    [
        (2, "supersigma", "options = { number = 2 }", "units.right.options: left and right both have the number 2"),
        (1, "supersigma", "", "left and right both have the number 1: change one of them"),
        (1, "gs-c200", "", "a supersigma and a gs-c200 do not share a line: give right one of its own"),
        (1, "supersigma", 'options = { number = 256 }', "option number cannot be 256; it takes a number, 0 to 255"),
        (1, "supersigma", 'options = { number = 2, offset = 3 }', "option offset cannot be 3; it takes half steps"),
        (1, "supersigma", 'options = { number = 2, table = "x" }', "option table cannot be 'x'"),
        (1, "supersigma", 'options = { number = 2 }\nprogram = "x"', "a supersigma holds no programs"),
    ],
)  # fmt: skip
def test_a_cell_that_cannot_be_is_refused_with_its_key_and_a_remedy(
    left: int, model: str, options: str, message: str
) -> None:
    with pytest.raises(Problem, match=message):
        cell(left, model, options)


def test_a_script_may_send_commands_in_words_and_a_wrong_one_is_refused_before_anything_happens() -> None:
    text = '[units.m]\nmodel = "supersigma"\n[[script]]\nat = 0.5\nsend = ["move +10"]\nto = "m"\n'
    one = build(parse(text, "m.toml"), lambda file: "")
    while one.step() is not None:
        pass
    assert one.controller("m").status(one.now).position == 10
    with pytest.raises(Problem, match=r"script\[1\].send: 'mvoe 10' is no command"):
        build(parse(text.replace("move +10", "mvoe 10"), "m.toml"), lambda file: "")
