"""A refused action is neither done nor kept: the journal of a cell makes the same recording, whatever was tried."""

from collections.abc import Callable

import pytest
from tests.cell.cells import cell

from detent.assembler import ImageError
from detent.cell.cell import Cell
from detent.cell.faults import OnLine, StuckPin, StuckSwitch
from detent.lines.faults import BitErrors
from detent.ticks import SECOND

TEXT = """
[units.bar]
model = "gs-c200"
straps = { CHS = 0 }
[units.drive]
model = "supersigma"
[units.watch]
model = "step-detector"
[units.desk]
model = "sin-8"
[units.axis]
model = "dcb-274"
straps = { PARTY = 1 }
options = { name = "A" }
[lines.bar]
units = ["bar"]
[lines.drive]
units = ["drive"]
[lines.desk]
units = ["desk"]
[lines.party]
host = "desk"
units = ["axis"]
[switches.end]
drives = "bar.EOT"
axis = "bar"
from = 40
"""

REFUSED: dict[str, Callable[[Cell], object]] = {
    "an output is set": lambda made: made.set_pin("bar", "RDY", 0),
    "a pin that there is not": lambda made: made.set_pin("bar", "XYZ", 0),
    "an output is released": lambda made: made.release("drive", "OUT0"),
    "a strap without a wire is released": lambda made: made.release("bar", "CHS"),
    "a pin of no unit": lambda made: made.set_pin("nobody", "RDY", 0),
    "a switch that there is not": lambda made: made.set_switch("bar", 0),
    "a supply of no unit": lambda made: made.power("nobody", True),
    "a line to a unit without one": lambda made: made.type("watch", "F"),
    "a line to a unit of a party line": lambda made: made.type("axis", "Z"),
    "characters to a line whose host is a unit": lambda made: made.send(
        next(n for n, line in enumerate(made.lines) if line.hosted), b"x"
    ),
    "characters to no line": lambda made: made.send(99, b"x"),
    "nothing taken back from no line": lambda made: made.discard(-1),
    "a program is started in what has none": lambda made: made.start("watch"),
    "what is no controller is halted": lambda made: made.halt("watch"),
    "what is no controller is displaced": lambda made: made.displace("watch", "", 1),
    "an image that is none": lambda made: made.load("bar", b"\xff\xff", 0),
    "a switch is put on no axis": lambda made: made.place_switch("nothing", 1, 2),
    "a fault of no line": lambda made: made.breaks(OnLine(99, BitErrors(rate=1.0))),
    "a fault of a line that makes no sense": lambda made: made.breaks(OnLine(0, BitErrors(rate=7.0))),
    "an output sticks": lambda made: made.breaks(StuckPin("bar", "RDY", 0)),
    "no switch sticks": lambda made: made.breaks(StuckSwitch("nothing", 0)),
    "a fault that never was is mended": lambda made: made.mend(7),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_refused_says_so_and_leaves_no_trace(kind: str) -> None:
    made = cell(TEXT)
    made.run_to(SECOND)
    with pytest.raises((ValueError, KeyError, TypeError, ImageError)) as raised:
        REFUSED[kind](made)
    assert str(raised.value)
    assert list(made.journal) == []
    made.type("bar", "+50")
    made.run_to(3 * SECOND)
    again = cell(TEXT, journal=tuple(made.journal))
    again.run_to(made.now)
    assert made.recording is not None
    assert again.recording is not None
    assert list(made.recording) == list(again.recording)


def test_every_strap_can_be_tied_elsewhere_and_counts_at_the_next_power_on() -> None:
    made = cell(TEXT)
    for unit, controller in made.controllers().items():
        for strap, level in dict(controller.straps).items():
            made.set_pin(unit, strap, 1 - level)
            assert controller.straps[strap] == 1 - level, f"{unit}.{strap}"
            made.set_pin(unit, strap, level)


def test_hands_may_do_any_number_of_things_in_one_instant_and_the_journal_does_them_again() -> None:
    """Only what the cell itself changes without end is an oscillation."""
    made = cell(TEXT)
    made.run_to(SECOND)
    for number in range(1500):
        made.set_pin("bar", "UI1", number % 2)
        made.set_pin("drive", "RAIL", number % 2)
        made.type("bar", "V1")
    made.run_to(2 * SECOND)
    again = cell(TEXT, journal=tuple(made.journal))
    again.run_to(made.now)
    assert made.recording is not None
    assert again.recording is not None
    assert list(made.recording) == list(again.recording)
    assert len(made.journal) == 4500
