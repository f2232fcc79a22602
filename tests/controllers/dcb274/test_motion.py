"""Motion to the nanosecond: execution times, soft stops, trips, inputs, the drive (pages 10, 28, 29, 36 to 53)."""

import pytest
from tests.controllers.dcb274.bench_unit import Bench

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.controllers.dcb274.current import TABLES, threshold
from detent.controllers.dcb274.firmware import Dcb274
from detent.pins import PinSet
from detent.ramps.timer_table import TICK, Speeds, count_of, index
from detent.ticks import MS, SECOND, US
from detent.uart import Char, Sent

DEFAULT = Speeds(count_of(800), count_of(10_000), 5, 5, 1)


def test_an_index_starts_7_5_ms_behind_its_line_and_takes_its_train() -> None:
    bench = Bench()
    bench.do("+1000")
    (started,) = bench.of(MotionStarted)
    assert started.at == 7_500 * US
    assert started.train == index(DEFAULT, 1000).train.at(started.train.start)
    (ended,) = bench.of(MotionEnded)
    assert ended.at == started.train.time_of(1000)


def test_a_program_fetches_a_byte_of_nv_memory_in_a_millisecond_and_of_shadow_ram_at_once() -> None:
    for base, fetched in ((0, 4 * MS), (128, 0)):
        bench = Bench()
        bench.do(f"P {base}", "+ 10", "P")
        start = bench.now
        bench.do(f"G {base}")
        (started,) = bench.of(MotionStarted)
        assert started.at == start + 500 * US + fetched + 7_500 * US


def test_w_is_exact_behind_the_last_step() -> None:
    bench = Bench()
    bench.do("P 0", "+ 10", "W 7", "A 8", "P", "G")
    on = next(pin for pin in bench.of(PinSet) if pin.pin == "P4" and pin.level == 0)
    assert on.at == bench.of(MotionEnded)[0].at + 70 * MS + 2 * MS + 500 * US


def test_a_soft_stop_leaves_the_pulse_on_its_way_and_goes_down_the_table() -> None:
    bench = Bench()
    bench.do("M 5000", wait=SECOND)
    bench.do("@")
    first, second = bench.of(MotionStarted)
    assert second.first == first.train.steps_by(second.at) + 1
    assert second.train.time_of(second.first) == first.train.time_of(second.first)
    assert second.train.steps == second.first + 5 * 21  # 800 and 20 entries below 5185
    assert bench.of(MotionEnded)[0].last == second.train.steps


def test_a_soft_stop_in_the_down_ramp_changes_nothing() -> None:
    bench = Bench()
    bench.do("+1000", wait=150 * MS)
    bench.do("@")
    assert len(bench.of(MotionStarted)) == 1
    assert bench.position == 1000


def test_m_turns_through_rest_and_its_ramp_is_complete_only_then() -> None:
    bench = Bench()
    bench.do("M 3000", wait=SECOND)
    bench.say("M -3000\r")
    bench.run_to(bench.now + 2 * MS)
    bench.say("M 1000\r")
    before = len(bench.out)
    bench.run_to(bench.now + 10 * MS)
    assert not [o for o in bench.out[before:] if isinstance(o, Sent) and o.char.value == 10]
    bench.run_to(bench.now + SECOND)
    assert [o.direction for o in bench.of(MotionStarted)][-1] == 1
    assert {o.direction for o in bench.of(MotionStarted)} == {1, -1}


def test_soft_stop_between_two_m_waits_for_the_first_ramp() -> None:
    bench = Bench()
    bench.say("K 50 50\r")
    bench.run_to(10 * MS)
    bench.say("M 5000\r")
    bench.run_to(30 * MS)
    bench.say("M 2000\r")
    bench.run_to(31 * MS)
    bench.say("@")
    first = bench.of(MotionStarted)[0]
    bench.run_to(5 * SECOND)
    stop = bench.of(MotionStarted)[1]
    assert stop.first == 50 * 21 + 1
    assert stop.at == first.train.time_of(50 * 21)
    assert len(bench.of(MotionStarted)) == 2


@pytest.mark.parametrize("routine", [False, True])
@pytest.mark.parametrize("stop", ["@", "SS"])
def test_page_28_nor_does_a_stop_between_two_m_of_a_program_cut_the_first_ramp(stop: str, routine: bool) -> None:
    """ "During PENDING PERIODS that are a result of multiple Constant Velocity commands (inter-speed ramping),
    deceleration will be delayed until the previous ramp-to-speed has been completed." G is "a continuous pending
    (Instructions Queued) period" (page 27); a trip that is served meanwhile does not end it."""
    bench = Bench()
    bench.do("K 50 50", "P 100", "A 8", "W 20", "P", "P 0", *(["T 20 100"] if routine else []), "M 5000", "M 2000", "P")
    bench.say("G\r")
    while not bench.of(MotionStarted):
        bench.run_to(bench.now + MS)
    bench.run_to(bench.now + 40 * MS)
    assert bench.unit._ports.port(4) is routine
    if stop == "@":
        bench.say("@")
    else:
        bench.pin("SS", 0)
    first = bench.of(MotionStarted)[0]
    bench.run_to(bench.now + 5 * SECOND)
    stopped = bench.of(MotionStarted)[1]
    assert (stopped.first, stopped.at) == (50 * 21 + 1, first.train.time_of(50 * 21))
    assert len(bench.of(MotionStarted)) == 2
    assert bench.unit.status(bench.now).state == "ready"


def test_a_limit_cuts_at_its_instant_and_esc_as_well() -> None:
    bench = Bench()
    bench.do("M 3000", wait=SECOND)
    bench.pin("LIMIT-A", 0)
    assert bench.of(MotionCut)[0].at == SECOND
    assert bench.do("M 3000") == "M 3000\r\n"
    assert len(bench.of(MotionStarted)) == 1


def test_pre_energize_delays_the_first_step_only_from_hold_current() -> None:
    bench = Bench()
    bench.do("w 25", "+ 10", "+ 10", wait=100 * MS)
    bench.run_to(5 * SECOND)
    bench.do("+ 10")
    delays = [started.train.time_of(0) - started.at for started in bench.of(MotionStarted)]
    assert delays == [250 * MS, 0, 250 * MS]


def test_trips_come_at_the_exact_steps_ten_times() -> None:
    bench = Bench()
    bench.do("P 0", "O 0", "k 200 8", "+ 6000", "W 0", "P", "P 128", "k 400 0", "k 600 16", "i 200 8", "P", "G 0")
    (started,) = bench.of(MotionStarted)
    edges = [(o.at, o.pin, o.level) for o in bench.of(PinSet) if o.pin in ("P4", "P5") and o.at > started.at]
    wanted = []
    for cycle in range(10):
        first, second, third = (started.train.time_of(600 * cycle + n) for n in (200, 400, 600))
        wanted += [(first, "P4", 1), (second, "P5", 0), (third, "P4", 0), (third, "P5", 1)]
    assert edges == wanted
    assert bench.position == 0
    assert bench.unit.status(bench.now).pulses == 6000


def test_the_position_counter_has_24_bits() -> None:
    bench = Bench()
    bench.do("O 8388600", "+ 10")
    assert bench.position == 8_388_610 - (1 << 24)
    assert bench.do("+ 0") == "+ 0\r\n"


def test_a_loop_in_a_tight_form_sees_a_short_pulse_and_the_other_does_not() -> None:
    for address, seen in (("2048", True), ("0", False)):
        bench = Bench()
        bench.do("P 0", f"L {address} 0", "+ 5", "P", "G", wait=100 * MS)
        bench.run_to(bench.now + 3 * MS)
        bench.pin("P1", 0)
        bench.pin("P1", 1)
        bench.run_to(bench.now + SECOND)
        assert (bench.position == 5) is seen


def test_step_pulses_on_a_wire_are_low_for_a_tick_and_the_direction_is_held() -> None:
    bench = Bench(watched="P4")
    bench.do("l 2", "M 3000", wait=50 * MS)
    bench.do("M -3000", wait=SECOND)
    rises = [o.at for o in bench.of(PinSet) if o.pin == "P4" and o.level == 1][1:]
    falls = [o.at for o in bench.of(PinSet) if o.pin == "P4" and o.level == 0]
    assert all(rise - fall == TICK for fall, rise in zip(falls, rises, strict=False))
    turn = next(o.at for o in bench.of(PinSet) if o.pin == "P5" and o.level == 0)
    assert turn - max(rise for rise in rises if rise <= turn) >= 10 * US


def test_external_steps_need_their_low_time_and_at_most_16000_a_second() -> None:
    bench = Bench()
    for low, gap in ((7_000, 100_000), (6_999, 100_000), (7_000, 62_400), (7_000, 62_600)):
        before = bench.position
        bench.run_to(bench.now + gap - low)
        bench.pin("STEP", 0)
        bench.run_to(bench.now + low)
        bench.pin("STEP", 1)
        bench.run_to(bench.now + 10 * US)
        moved = bench.position - before
        assert moved == (1 if low >= 7_000 else 0), (low, gap)
        bench.run_to(bench.now + SECOND)
    bench.pin("DIR", 0)
    bench.pin("STEP", 0)
    bench.run_to(bench.now + MS)
    bench.pin("STEP", 1)
    bench.pin("STEP", 0)
    bench.run_to(bench.now + 50_000)
    bench.pin("STEP", 1)  # 50 us behind the last one: too fast
    bench.run_to(bench.now + MS)
    assert bench.position == 2


@pytest.mark.parametrize(("held", "moved"), [(0, 0), (9_999, 0), (10_000, 1), (11_000, 1)])
def test_a_direction_that_is_not_held_10_us_behind_the_rising_edge_spoils_the_step(held: int, moved: int) -> None:
    """Page 10: "Direction must be held for >10 microseconds after the rising step edge"."""
    bench = Bench()
    bench.run_to(MS)
    bench.pin("STEP", 0)
    bench.run_to(bench.now + 7 * US)
    bench.pin("STEP", 1)
    bench.run_to(bench.now + held)
    bench.pin("DIR", 0)
    bench.run_to(bench.now + MS)
    assert bench.position == moved
    bench.pin("STEP", 0)
    bench.run_to(bench.now + MS)
    bench.pin("STEP", 1)
    bench.run_to(bench.now + MS)
    assert bench.position == moved - 1


def test_an_external_step_is_made_when_its_direction_has_been_held_and_dropped_by_a_limit_or_a_move() -> None:
    for pin, at in (("", 0), ("LIMIT-A", 5 * US), ("JOG2", 5 * US)):
        bench = Bench()
        bench.run_to(MS)
        bench.pin("STEP", 0)
        bench.run_to(bench.now + 7 * US)
        bench.pin("STEP", 1)
        edge = bench.now
        bench.run_to(edge + at)
        if pin:
            bench.pin(pin, 0)
        bench.run_to(edge + 10 * US)
        ended = [item.at for item in bench.of(MotionEnded)]
        assert ended == ([] if pin else [edge + 10 * US]), pin


def test_w_is_no_longer_while_steps_are_fast_since_page_51_has_only_a_bound_for_that() -> None:
    """Page 51: "will increase the delay time by as much as 14 times"; the docs page has it among its limits."""
    bench = Bench()
    bench.do("M 36000", wait=5 * SECOND)
    before = bench.now
    bench.say("W 100\r")
    bench.run_to(before + SECOND + 500 * US - 1)
    assert not [o for o in bench.of(Sent) if o.at > before and o.char.value == 10]
    bench.run_to(before + SECOND + 500 * US)
    assert [o.at for o in bench.of(Sent) if o.at > before and o.char.value == 10] == [bench.now]


def test_a_trip_position_slows_nothing_since_page_65_has_no_numbers() -> None:
    """Page 65: "the top speed is reduced when trip points are introduced"; the docs page has it among its limits."""
    trains = []
    for trip in ("T 5000 100", "T 5000 0"):
        bench = Bench()
        bench.do("V 36000", trip, "+ 20000", wait=20 * SECOND)
        (started,) = bench.of(MotionStarted)
        trains.append(started.train)
    assert trains[0] == trains[1]


def test_an_encoder_gives_four_steps_a_slot_and_limits_hold() -> None:
    bench = Bench(encoder=True)
    for turn in range(8):
        pin, level = (("STEP", 0), ("DIR", 0), ("STEP", 1), ("DIR", 1))[turn % 4]
        bench.run_to(bench.now + MS)
        bench.pin(pin, level)
    assert abs(bench.position) == 8
    direction = 1 if bench.position > 0 else -1
    bench.pin("LIMIT-A" if direction > 0 else "LIMIT-B", 0)
    bench.run_to(bench.now + MS)
    bench.pin("STEP", 0)
    assert abs(bench.position) == 8


def test_current_is_run_while_moving_and_a_second_behind_then_hold() -> None:
    bench = Bench()
    bench.do("Y 10 80", wait=MS)
    assert bench.unit.drive(bench.now).percent == 10
    bench.do("+ 1000", wait=100 * MS)
    assert bench.unit.drive(bench.now).percent == 80
    bench.run_to(SECOND)
    ended = bench.of(MotionEnded)[0].at
    assert bench.unit.drive(ended + SECOND - 1).percent == 80
    assert bench.unit.drive(ended + SECOND).percent == 10


@pytest.mark.parametrize(
    ("decay", "half", "eighth"),
    [(25, 650, 2400), (50, 1300, 4800), (100, 2400, 9600), (150, 3700, 14000), (200, 5000, 19200)],
)
def test_the_decay_threshold_is_within_8_percent_of_page_36(decay: int, half: int, eighth: int) -> None:
    assert threshold(decay, 2) == pytest.approx(half, rel=0.08)
    assert threshold(decay, 0) == pytest.approx(eighth, rel=0.08)


def test_decay_is_fast_above_the_threshold_and_slow_at_rest() -> None:
    bench = Bench()
    assert bench.unit.drive(0).slow_decay
    bench.do("b 0", "M 40", wait=100 * MS)
    assert not bench.unit.drive(bench.now).slow_decay
    assert ", f," in bench.do("X", wait=MS)
    bench.do("b 255", wait=MS)
    assert bench.unit.drive(bench.now).slow_decay


def test_page_36_decay_is_slow_while_a_motion_waits_for_its_current() -> None:
    """ "When there is no motion (stopped), the decay will always be slow"; w is "a delay after turn on" (page 51)."""
    bench = Bench()
    bench.do("b 0", "w 50", "K 0 0")
    bench.do("+20000", wait=100 * MS)
    assert " s, 1/4" in bench.do("X", wait=10 * MS)
    bench.run_to(bench.now + 500 * MS)
    assert " f, 1/4" in bench.do("X", wait=10 * MS)


def test_step_tables_have_four_full_steps_and_h_returns_to_the_start_phase() -> None:
    assert [len(table) for table in TABLES] == [32, 16, 8, 4, 8, 4]
    bench = Bench()
    bench.do("+ 5")
    assert bench.unit.drive(bench.now).step == 5
    bench.do("H 0")
    assert bench.unit.drive(bench.now).step == 0


def test_jog_runs_at_thirty_full_steps_by_resolution_and_divisor() -> None:
    for resolution, factor in ((0, 8), (1, 4), (3, 1)):
        bench = Bench()
        bench.do("B 10 20", f"H {resolution}", "D 2", wait=10 * MS)
        bench.pin("JOG2", 0)
        bench.run_to(bench.now + SECOND)
        train, now = bench.of(MotionStarted)[0].train, bench.now
        pulse = train.steps_by(now)
        assert train.time_of(pulse) - train.time_of(pulse - 1) == 2 * TICK * count_of(300 * factor)
        assert bench.position < 0


def test_writes_are_counted_cell_by_cell() -> None:
    bench = Bench()
    bench.do("\\ 600 1", "\\ 600 2", "S", "C 0")
    assert bench.unit.memory.writes[600] == 2
    assert bench.unit.memory.writes[229] == 1
    assert bench.unit.memory.writes[128] == 1
    assert 0 not in bench.unit.memory.writes


def test_a_uart_that_is_overrun_loses_characters_in_bit_time_only() -> None:
    for overrun in (True, False):
        unit = Dcb274({"PARTY": 1, "B1": 1}, overrun=overrun)
        unit.power(True, 0)
        now = 0
        for value in b"AZ\nAZ\n":  # the second line comes while the first executes, half a millisecond
            now += unit.line_format.duration()
            unit.receive("RX", [Char(value)], now)
        while (at := unit.next_deadline()) is not None:
            unit.advance(at)
        sent = bytes(item.char.value for item in unit.drain() if isinstance(item, Sent))
        assert sent.endswith(b"A" if overrun else b"AZ        0\nAZ        0\n"), sent


def test_a_jump_counter_is_loaded_when_idle_and_cleared_by_g() -> None:
    bench = Bench()
    bench.do("P 0", "+ 1", "W 0", "J 0 2", "+ 100", "P", "G", "G")
    assert bench.position == 2 * 103


def test_the_trip_routine_is_not_entered_again_and_returns_into_a_wait() -> None:
    bench = Bench()
    bench.do("P 128", "A 8", "W 5", "A 0", "P", "T 10 128", "P 0", "+ 40", "W 30", "A 16", "P")
    bench.do("G")
    edges = [(o.pin, o.level) for o in bench.of(PinSet) if o.pin in ("P4", "P5")][2:]
    assert edges == [("P4", 0), ("P4", 1), ("P5", 0)]
    assert bench.position == 40


def test_a_trip_without_a_program_does_nothing() -> None:
    bench = Bench()
    bench.do("P 128", "A 8", "P", "T 10 128", "+ 40")
    assert not [o for o in bench.of(PinSet) if o.pin == "P4" and o.level == 0]


def test_steps_of_an_encoder_trip_nothing_steps_of_the_step_input_do() -> None:
    """Page 49: "The trip is not currently usable in the encoder mode"."""
    for encoder in (False, True):
        bench = Bench(encoder=encoder)
        bench.do("P 128", "A 8", "P", "T 2 128", "P 0", "W 1000", "P")
        bench.say("G\r")
        bench.run_to(bench.now + 100 * MS)
        for turn in range(4):
            pin, level = (("STEP", 0), ("DIR" if encoder else "STEP", 1 - encoder))[turn % 2]
            bench.pin(pin, level if turn < 2 or not encoder else 1)
            bench.run_to(bench.now + MS)
        assert bench.position >= 2
        assert [o.level for o in bench.of(PinSet) if o.pin == "P4"][1:] == ([] if encoder else [0]), encoder


def test_on_a_party_line_what_an_input_or_a_start_sets_going_has_its_deadlines() -> None:
    """The Go input (page 24) and the step input (page 10), with nothing else under way."""
    for begin in ("GO", "start", "STEP"):
        bench = Bench(straps={"PARTY": 1})
        bench.say("\n")
        for line in ("P 0", "+ 40", "P"):
            bench.say(f"A{line}\n")
            bench.run_to(bench.now + SECOND)
        if begin == "start":
            bench.unit.start(bench.now)
        else:
            bench.pin(begin, 0)
            bench.run_to(bench.now + MS)
            bench.pin(begin, 1)
        assert bench.unit.next_deadline() is not None
        bench.run_to(bench.now + 2 * SECOND)
        assert bench.position == (1 if begin == "STEP" else 40), begin


def test_page_46_a_limit_that_closes_on_a_ramp_to_rest_ends_it_by_the_k_of_now_if_that_is_shorter():
    passed = {}
    for slope in ("K 5 90", "K 5 2", "K 5 200"):
        bench = Bench()
        bench.do("l 32", "K 5 90", "M 5000")
        bench.do("M 0", wait=150_000_000)
        bench.do(slope, wait=20_000_000)
        at = bench.position
        bench.pin("LIMIT-A", 0)
        bench.pin("LIMIT-A", 1)
        bench.pin("LIMIT-A", 0)  # it bounces: the ramp is still one
        bench.run_to(bench.now + 5_000_000_000)
        passed[slope] = bench.position - at
    assert passed["K 5 2"] < 60 < 1000 < passed["K 5 90"]
    assert passed["K 5 200"] <= passed["K 5 90"] + 90  # what is under way is not made longer


@pytest.mark.parametrize(("flags", "then"), [("l 32", "M 5000"), ("l 32", "M 901"), ("l 0", "M 5000")])
@pytest.mark.parametrize("later", [0, 1, 200_000, 499_999])
def test_page_46_a_limit_that_closes_while_m_is_executed_is_not_driven_through(flags, then, later):
    bench = Bench()
    bench.do(flags)
    bench.do("M 900", wait=12_000_000)
    bench.say(then + "\r")
    bench.run_to(bench.now + later)
    at = bench.position
    bench.pin("LIMIT-A", 0)
    bench.run_to(bench.now + 2_000_000_000)
    assert bench.position - at <= 10
    bench.pin("LIMIT-A", 1)
    bench.run_to(bench.now + 2_000_000_000)
    assert bench.unit.status(bench.now).state == "ready"
    assert bench.position - at <= 10


@pytest.mark.parametrize("behind", ["@", "@\r"])
def test_page_28_a_stop_that_is_typed_while_g_is_executed_ends_the_program_that_it_begins(behind):
    bench = Bench()
    bench.do("P 0", "+ 4000", "G 0", "P", wait=50_000_000)
    bench.say("G\r" + behind)
    bench.run_to(bench.now + 10_000_000)
    assert bench.unit.status(bench.now).state == "ready"
    assert bench.unit.next_deadline() is None
    assert bench.position == 0
