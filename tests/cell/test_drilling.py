"""Example 2 of the GS-C200 datasheet as a whole cell: two modules, cross-wired, drill five holes in a bar.

`examples/drilling` is the cell; the specification page, "Example 2 as a whole cell", says why it is as it is.
"""

from itertools import pairwise
from pathlib import Path

import pytest
from tests.cell.cells import cell, edges, places

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.ticks import MS, SECOND

FOLDER = Path(__file__).parents[2] / "examples" / "drilling"
HOLES = [250, 370, 490, 610, 730]


def drilling(*, until: int = 60 * SECOND, endless: bool = False) -> Cell:
    text = (FOLDER / "cell.toml").read_text()
    if endless:
        text = text[: text.rindex("[[script]]")]
    made = build(parse(text, "cell.toml"), lambda name: (FOLDER / name).read_text())
    made.run_to(until)
    return made


def rises(made: Cell, unit: str, pin: str) -> list[int]:
    return [at for at, level in edges(made, unit, pin) if level == 1]


def falls(made: Cell, unit: str, pin: str) -> list[int]:
    return [at for at, level in edges(made, unit, pin) if level == 0][1:]  # the first is power-on


@pytest.fixture(scope="module")
def one_bar() -> Cell:
    return drilling()


def test_five_holes_are_drilled_120_steps_apart_and_the_bar_is_cut(one_bar: Cell) -> None:
    """Datasheet: "drills 5 equidistant holes on a metal bar"."""
    moves = one_bar.recording.motion("bar", one_bar.now)
    assert [span.shaft + span.direction * span.last for span in moves] == [*HOLES, 980]
    strokes = one_bar.recording.motion("drill", one_bar.now)
    assert [(span.direction, span.last) for span in strokes] == [(1, 150), (-1, 150)] * 5
    assert len(rises(one_bar, "bar", "UO1")) == 1
    assert falls(one_bar, "bar", "UO1")[0] - rises(one_bar, "bar", "UO1")[0] == 502 * MS


def test_the_handshake_has_its_order_at_every_hole(one_bar: Cell) -> None:
    """Bar in place, call on UO2, drill down and up, answer on UO1, next place."""
    calls, answers = rises(one_bar, "bar", "UO2"), rises(one_bar, "drill", "UO1")
    moves = one_bar.recording.motion("bar", one_bar.now)
    strokes = one_bar.recording.motion("drill", one_bar.now)
    assert len(calls) == len(answers) == 5
    for hole, (call, answer) in enumerate(zip(calls, answers, strict=True)):
        down, up = strokes[2 * hole], strokes[2 * hole + 1]
        assert moves[hole].ends < call < down.begins < down.ends < up.begins < up.ends < answer
        assert answer < moves[hole + 1].begins
    assert all(earlier < later for earlier, later in pairwise(calls))


def test_the_motor_of_the_drill_turns_while_it_is_in_the_bar(one_bar: Cell) -> None:
    on, off = rises(one_bar, "drill", "UO2"), falls(one_bar, "drill", "UO2")
    strokes = one_bar.recording.motion("drill", one_bar.now)
    assert len(on) == len(off) == 5
    for hole in range(5):
        assert on[hole] < strokes[2 * hole].begins
        assert strokes[2 * hole + 1].ends < off[hole]


def test_the_bar_never_moves_while_the_drill_is_down(one_bar: Cell) -> None:
    down = 0
    events = [(at, "bar", place) for at, place in places(one_bar, "bar")]
    events += [(at, "drill", place) for at, place in places(one_bar, "drill")]
    for _, unit, place in sorted(events):
        if unit == "drill":
            down = place
        else:
            assert down == 0
    assert down == 0


def test_it_waits_for_the_start_switch_and_ends_by_itself(one_bar: Cell) -> None:
    moves = one_bar.recording.motion("bar", one_bar.now)
    assert moves[0].begins >= 500 * MS
    assert one_bar.next_event() is None
    assert one_bar.controller("bar").status(one_bar.now) == (980, 980, "ready")
    assert one_bar.controller("drill").status(one_bar.now) == (0, 1500, "ready")


def test_bar_after_bar_until_the_stop_switch_opens() -> None:
    """Datasheet: "If the operation has to be repeated till the exhaustion of bars ... U3"."""
    made = drilling(endless=True)
    assert made.next_event() is not None
    moves = made.recording.motion("bar", made.now)
    whole = len(moves) // 6
    assert whole >= 3
    ends = [span.shaft + span.last - 980 * (n // 6) for n, span in enumerate(moves[: 6 * whole])]
    assert ends == [*HOLES, 980] * whole
    made.set_switch("stop", 0)
    made.run_to(made.now + 60 * SECOND)
    assert made.next_event() is None
    assert len(made.recording.motion("bar", made.now)) % 6 == 0
    assert len(made.recording.motion("drill", made.now)) == 10 * (len(made.recording.motion("bar", made.now)) // 6)


def test_as_printed_the_drill_serves_one_hole() -> None:
    """Specification: "As printed the drill program serves one hole"."""
    text = (FOLDER / "cell.toml").read_text()
    printed = {
        "bar.gsc": "S10 T100 R40 W1 +250 L0 A2 D1 C2 W2 +120 L4 A2 C2 W2 +250 A1 D5 C1",
        "drill.gsc": "S15 T200 R25 W1 W2 A2 +150 D1 G0 C2 A1 D1 C1",
    }
    made = cell(text, {name: "\n".join(program.split()) for name, program in printed.items()})
    made.run_to(60 * SECOND)
    assert made.controller("bar").status(made.now) == (370, 370, "running")  # waits for a second hole
    assert made.controller("drill").status(made.now) == (0, 300, "ready")
