from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.outputs.expected import level_changes, pulses, settled
from tests.outputs.recorded import BAR, CLOCK, DRILL, FORM, PINS, drilling, interrupted, moved, said

from detent.axis import MotionStarted
from detent.cell.recording import InputSet, Received, Recording
from detent.controllers.device import Powered
from detent.outputs.signals import Signals
from detent.outputs.units import UnitView
from detent.outputs.waves import UNKNOWN, Spoken, serial_wave
from detent.pins import LOW, Pin, PinKind, PinSet, PulseOutput
from detent.ramps.constant_acceleration import move
from detent.ticks import MS, SECOND
from detent.uart import Char, Format


def changes(signals: Signals, unit: str, pin: str) -> list[tuple[int, int]]:
    of_unit = signals.unit(unit)
    wave = of_unit.wave(pin)
    return settled([(-1, of_unit.level_before(pin, 0)), *zip(wave.times.tolist(), wave.levels.tolist(), strict=True)])


def test_every_pin_has_the_levels_worked_out_pulse_by_pulse_and_bit_by_bit():
    recording, until = drilling()
    signals = Signals(recording, [BAR, DRILL], until)
    for view in (BAR, DRILL):
        expected = level_changes(recording, view, until)
        assert list(signals.unit(view.name).pins) == list(expected)
        for pin, wanted in expected.items():
            assert changes(signals, view.name, pin) == wanted, pin


def test_cut_replanned_and_unpowered_motion_gives_the_pulses_that_were_given():
    recording, until = interrupted()
    signals = Signals(recording, [DRILL], until)
    expected = level_changes(recording, DRILL, until)
    for pin, wanted in expected.items():
        assert changes(signals, "drill", pin) == wanted, pin
    found = signals.unit("drill").motion.pulses(0, until + 1)
    assert list(zip(*(column.tolist() for column in found), strict=True)) == pulses(recording, "drill", until)
    assert signals.unit("drill").motion.pulse_count == 670


@given(st.integers(1, 40), st.integers(0, 2_100_000_000))
def test_windows_of_any_size_join_to_the_same_waves(limit, until):
    recording, _ = interrupted()
    signals = Signals(recording, [DRILL], until)
    unit = signals.unit("drill")
    windows = list(signals.windows(limit))
    assert windows[0][0] == 0
    assert windows[-1][1] == until + 1
    assert all(one[1] == other[0] for one, other in pairwise(windows))
    pieces = [unit.wave("CLOCK", begin, end, unit.pulses_for(begin, end)) for begin, end in windows]
    whole = unit.wave("CLOCK")
    assert np.concatenate([piece.times for piece in pieces]).tolist() == whole.times.tolist()
    assert np.concatenate([piece.levels for piece in pieces]).tolist() == whole.levels.tolist()
    assert all(len(unit.motion.pulses(begin, end).times) <= limit for begin, end in windows)


@given(st.integers(0, 2_100_000_000))
def test_a_run_that_is_looked_at_before_its_end_has_what_happened_until_then(until):
    recording, _ = interrupted()
    signals = Signals(recording, [DRILL], until)
    assert changes(signals, "drill", "CLOCK") == level_changes(recording, DRILL, until)["CLOCK"]
    given_so_far = pulses(recording, "drill", until)
    assert signals.unit("drill").motion.position(until) == (given_so_far[-1][2] if given_so_far else 0)


def test_pulses_that_touch_are_one_low_level():
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True)])
    recording.extend(0, moved(30, 1, MS, speeds=(700_000, 700_000, 1))[0])  # 1.43 us apart, 1.7 us wide
    signals = Signals(recording, [BAR], 2 * MS)
    first, last = pulses(recording, "bar", 2 * MS)[0][0], pulses(recording, "bar", 2 * MS)[-1][0]
    assert changes(signals, "bar", "CLOCK") == [(-1, UNKNOWN), (0, 1), (first, 0), (last + 1_700, 1)]
    assert signals.unit("bar").level_before("CLOCK", last) == 0


def test_separate_clocks_carry_the_pulses_of_their_direction():
    pins = (Pin("CW", None, PinKind.OUTPUT, ""), Pin("CCW", None, PinKind.OUTPUT, ""))
    view = UnitView("bar", pins, PulseOutput({1: "CW", -1: "CCW"}, 1_700, LOW))
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True), *moved(3, 1, 0)[0], *moved(5, -1, SECOND, 3)[0]])
    unit = Signals(recording, [view], 2 * SECOND).unit("bar")
    assert int((unit.wave("CW").levels == 0).sum()) == 3
    assert int((unit.wave("CCW").levels == 0).sum()) == 5


def test_pulses_that_a_wire_carries_are_taken_from_the_recording_and_not_made_twice():
    motion, end = moved(5, 1, MS)
    train = motion[0].train
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True), motion[0]])
    for n in range(1, 6):
        at = train.time_of(n)
        recording.extend(0, [PinSet(at, "CLOCK", 0), PinSet(at + 1_700, "CLOCK", 1)])
    recording.extend(0, [motion[1]])
    signals = Signals(recording, [BAR], end + MS)
    assert signals.unit("bar").unlogged == frozenset()
    assert int((signals.unit("bar").wave("CLOCK").levels == 0).sum()) == 5


def test_an_endless_motion_is_drawn_to_the_end_of_the_run():
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True), MotionStarted(0, move(1000, 1000, 1, None).train, 1, -1, 7)])
    unit = Signals(recording, [BAR], 10 * MS).unit("bar")
    assert unit.motion.pulse_count == 10
    assert unit.motion.pulses(0, SECOND).positions.tolist() == [6, 5, 4, 3, 2, 1, 0, -1, -2, -3]
    assert unit.motion.start == 7


def test_an_axis_that_does_not_move_stands_where_its_view_says():
    signals = Signals(Recording(["bar"]), [BAR._replace(shaft=40)], SECOND)
    assert signals.unit("bar").motion.start == signals.unit("bar").motion.position(MS) == 40


def test_straps_appear_when_they_are_given_a_level_and_supply_pins_never():
    pins = (*PINS, Pin("CHS", 20, PinKind.STRAP, "checksum"), Pin("REC", 21, PinKind.STRAP, "recall"))
    view = UnitView("bar", pins, CLOCK, FORM, {"CHS": 0})
    recording = Recording(["bar"])
    recording.extend(0, [InputSet(5, "REC", 0)])
    unit = Signals(recording, [view], SECOND).unit("bar")
    assert set(unit.pins) == {"RXD", "TXD", "RDY", "CLOCK", "DIR", "MOV", "UO1", "UI1", "CHS", "REC"}
    assert unit.level_before("CHS", 0) == 0


@pytest.mark.parametrize("form", [Format(9600, 7, "odd", 2), Format(2400, 8, "none", 1), Format(300, 7, "even", 1)])
def test_a_character_is_start_bit_data_from_the_least_significant_bit_parity_and_stop_bits(form):
    value, end = 0b1000001, form.duration()
    wave = serial_wave([Spoken(0, end, Char(value), 0)], form)
    middles = [(2 * k + 1) * end // (2 * form.bits) for k in range(form.bits)]
    data = [value >> k & 1 for k in range(form.data_bits)]
    parity = {"none": [], "odd": [1], "even": [0]}[form.parity]
    assert [wave.level_before(t, 1) for t in middles] == [0, *data, *parity, *[1] * form.stop_bits]


def test_damaged_characters_have_the_wrong_parity_bit_or_no_stop_bits():
    form, end = Format(9600, 7, "odd", 2), 11_000
    wrong_parity = serial_wave([Spoken(0, end, Char(1, parity_ok=False), 0)], form)
    assert wrong_parity.level_before(8_500, 1) == 1  # odd parity of a single 1 would be 0
    no_stop = serial_wave([Spoken(0, end, Char(1, framing_ok=False), 0)], form)
    assert no_stop.level_before(10_500, 1) == 0
    assert no_stop.level_before(end + 1, 1) == 1


def test_characters_without_line_timing_leave_no_trace():
    recording = Recording(["bar"])
    recording.extend(0, [Received(MS, "RXD", Char(65), MS)])
    assert len(Signals(recording, [BAR], SECOND).unit("bar").wave("RXD").times) == 0


def test_a_supply_that_fails_within_a_character_leaves_the_line_unknown():
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True), *said("A", MS), Powered(MS + 300_000, False)])
    unit = Signals(recording, [BAR], SECOND).unit("bar")
    assert unit.wave("TXD").times[-1] == MS + 300_000
    assert unit.level_before("TXD", SECOND) == UNKNOWN


def test_a_unit_without_a_view_is_named():
    with pytest.raises(ValueError, match="no view of drill"):
        Signals(Recording(["bar", "drill"]), [BAR], 0)


def test_a_run_longer_than_int64_is_refused():
    with pytest.raises(ValueError, match="146 years"):
        Signals(Recording([]), [], 1 << 63)


def test_a_unit_that_was_not_recorded_is_named():
    with pytest.raises(KeyError, match="there are bar"):
        Signals(Recording(["bar"]), [BAR], 0).unit("baz")
