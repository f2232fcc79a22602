"""What the windings get: step modes, power levels, the auto full step rate (manual, pages 24, 28, 30, 31, 36, 70)."""

from itertools import product
from math import cos, pi, sin

import pytest
from tests.controllers.genstepper.boards import Board

from detent.controllers.genstepper.windings import CYCLE, FULL, NOTHING, Drive, table
from detent.pins import PinSet
from detent.ticks import MS, SECOND

PAGE_70 = ["0001", "0101", "0100", "0110", "0010", "1010", "1000", "1001"]  # WB2 WB1 WA2 WA1


def pattern(mode: int, rotor: int) -> str:
    return f"{table(mode, rotor).pattern:04b}"


def test_page_70_the_stepping_sequence():
    assert [pattern(1, 32 * row) for row in range(8)] == PAGE_70
    assert [pattern(0, 64 * step) for step in range(4)] == PAGE_70[::2]
    assert [pattern(2, 64 * step) for step in range(4)] == PAGE_70[1::2]


@pytest.mark.parametrize("eighth", range(8))
def test_page_31_fractions_of_a_step_in_each_mode(eighth):
    rotor = 64 + 8 * eighth
    assert pattern(0, rotor) == PAGE_70[2], "drops the fractional part"
    assert pattern(1, rotor) == PAGE_70[2 if eighth < 4 else 3], "0 to 3/8 maps to 0, 4/8 to 7/8 to 0.5"
    assert pattern(2, rotor) == PAGE_70[3], "the fractional part forced to 0.5"


@pytest.mark.parametrize("rotor", range(CYCLE))
def test_page_31_microsteps_follow_cosine_and_sine_to_half_a_count(rotor):
    duties = table(3, rotor)
    angle = 2 * pi * rotor / CYCLE
    assert abs(duties.wa1 - duties.wa2 - FULL * cos(angle)) <= 0.5
    assert abs(duties.wb1 - duties.wb2 - FULL * sin(angle)) <= 0.5
    assert min(duties.wa1, duties.wa2) == min(duties.wb1, duties.wb2) == 0


def test_every_mode_repeats_after_four_full_steps_in_both_directions():
    for mode, rotor in product(range(4), range(-300, 300, 7)):
        assert table(mode, rotor) == table(mode, rotor + CYCLE)


def test_a_drive_is_a_function_of_position_and_rate():
    drive = Drive(3, 8, 4, auto=12, auto_mode=2)
    assert drive.duties(0, 3327) == (128, 0, 0, 0), "half power"
    assert drive.duties(0, 3328) == (FULL, 0, FULL, 0), "full step, both windings, full power"
    assert drive.duties(16, 3328) == (0, FULL, FULL, 0)
    assert drive._replace(sixteenths=0).duties(5, 0) == NOTHING


@pytest.mark.parametrize(("rate", "auto"), [(3327, False), (3328, True)])
def test_page_24_3072_to_3327_generate_the_same_test_value(rate, auto):
    board = Board()
    board.say(f"X1H62500K{rate}R+S", 10 * MS)
    rotor = board.unit.duties("X", board.cell.now)
    assert (set(rotor) <= {0, FULL}) == auto
    assert (sum(rotor) == 2 * FULL) == auto, "the half power of 1H is lifted too"


@pytest.mark.parametrize("value", [0, 255])
def test_page_24_rates_of_0_to_255_make_all_rates_from_256_on_auto(value):
    board = Board()
    board.say(f"{value}AX62500K255R+S", 10 * MS)
    assert not set(board.unit.duties("X", board.cell.now)) <= {0, FULL}
    board.say("256R", 10 * MS)
    assert set(board.unit.duties("X", board.cell.now)) <= {0, FULL}


def test_page_24_62500_disables_it():
    board = Board()
    board.say("62500AX62500K62500R+S", 10 * MS)
    assert not set(board.unit.duties("X", board.cell.now)) <= {0, FULL}


@pytest.mark.parametrize(
    ("half", "idle", "moving", "still"),
    [(0, 0, 16, 0), (0, 1, 16, 16), (0, 2, 16, 8), (1, 0, 8, 0), (1, 1, 8, 8), (1, 2, 8, 4)],
)
def test_pages_28_and_36_power_in_motion_and_idle(half, idle, moving, still):
    board = Board()
    board.say(f"{half}HX{idle}W100G")
    assert board.drives()[-1].drive.sixteenths == moving
    board.until_idle()
    assert board.drives()[-1].drive.sixteenths == still, "2W with 1H idles at a quarter"
    assert (board.report(-6), board.report(-7)) == (int(still > 0), int(idle > 0))


def test_page_36_w_acts_immediately_when_the_motor_is_stopped():
    board = Board()
    assert board.report(-6) == 0
    board.say("1W")
    assert board.report(-6) == 1
    assert board.unit.duties("X", board.cell.now) == (FULL, 0, 0, 0)
    board.say("0W")
    assert board.report(-6) == 0


@pytest.mark.parametrize(("options", "straps", "power"), [
    ({}, "", 16), ({}, "straps = { S1K = 0 }", 8), ({"low_power": 0}, "straps = { S1K = 0 }", 16),
    ({"high_power": 1}, "", 8), ({"dual_baud": "yes", "baud": 9600}, "straps = { S1K = 0 }", 16),
])  # fmt: skip
def test_pages_12_and_67_the_half_power_jumper_and_the_ordered_levels(options, straps, power):
    board = Board(toml=straps, idle_windings=1, **options)
    board.run(SECOND)
    assert board.drives()[-1].drive.sixteenths == power


def test_no_event_per_step_unless_a_wire_carries_it():
    board = Board()
    board.say("X1000G", 3 * SECOND)
    assert len(board.drives()) <= 6
    assert not [pin for pin in board.entries(PinSet) if pin.pin.startswith("X") and pin.at > 0]


def test_a_wire_from_a_winding_carries_its_level_at_every_step():
    toml = '[[wires]]\nfrom = "board.XWA1"\nto = "board.NXT"\n'
    board = Board(toml=f"{toml}[units.other]\nmodel = 'bs0710'\n")
    board.say("X0O5000K160R")
    board.send("320G")
    board.run(3 * SECOND)
    edges = [entry for entry in board.entries(PinSet) if entry.pin == "XWA1" and entry.at > 0]
    assert [edge.level for edge in edges[:4]] == [1, 0, 1, 0]
    times = [at for at, _ in board.pulses()]
    assert edges[1].at == times[15], "single winding: WA1 gives way to WB1 on the 16th microstep"
    assert edges[2].at == times[63]


def test_page_75_double_current_the_y_connector_carries_what_x_gets():
    for board in (Board(toml="straps = { R1K = 0 }"), Board(double_current="yes")):
        board.say("X1WX200GY2OY500G", 3 * SECOND)
        assert board.unit.duties("Y", board.cell.now) == board.unit.duties("X", board.cell.now) == table(3, 800)
        assert (board.position("X"), board.position("Y")) == (200, 500), "Y is accepted and reported"
        assert (board.report(-9, "X"), board.report(-9, "Y")) == (7, 6), "page 43"
        assert {told.axis for told in board.drives("Y")} == {"X"}


def test_page_39_memory_locations_show_the_windings_and_rotors():
    board = Board()
    board.say("8!", 300 * MS)
    board.say("B1WX0OX33GY-1GB", 2 * SECOND)
    assert board.report(253) == 8
    assert board.report(125, "X") == board.report(125, "Y") == 264 % 256
    assert board.report(61) == 248
    assert board.report(7) == 0b0001 | (0b1001 << 4)
    assert board.report(252) == 12
    assert (board.report(5), board.report(6)) == (15, 255)
    board.pin("LY+", 0)
    board.pin("X-", 0)
    board.pin("NXT", 0)
    assert (board.report(5), board.report(6)) == (13, 255 - 4 - 16 - 32)
    assert [board.report(address) for address in (1, 4, 8, 60, 62, 124, 254, 255)] == [0] * 8
