import numpy as np
import pytest
from tests.outputs.expected import level_changes, pulses
from tests.outputs.recorded import BAR, DRILL, drilling, interrupted, moved

from detent.axis import MotionCut, MotionStarted
from detent.cell.recording import Recording
from detent.controllers.device import Executing, Finished, Powered
from detent.outputs import curves, figures
from detent.outputs.curves import Band
from detent.outputs.figures import Pin, Strip
from detent.outputs.signals import Signals
from detent.pins import PinSet
from detent.pulses import Ticked, Train, Uniform
from detent.ramps.constant_acceleration import move
from detent.ticks import MS, SECOND, to_fixed

COLUMNS = 1_000


def drilled() -> Signals:
    recording, until = drilling()
    return Signals(recording, [BAR, DRILL], until)


def at(trace: curves.Trace, t: int) -> float:
    return float(np.interp(t, trace.times, trace.values))


def endless(rate: int, seconds: int) -> Signals:
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True), MotionStarted(0, move(100, rate, 400, None).train, 1, 1, 0)])
    return Signals(recording, [BAR], seconds * SECOND)


def to_and_fro(times: int) -> tuple[Signals, int]:
    recording = Recording(["bar"])
    now = 0
    for n in range(times):
        motion, now = moved(20, 1 if n % 2 == 0 else -1, now, 0 if n % 2 == 0 else 20)
        recording.extend(0, motion)
        now += MS
    return Signals(recording, [BAR], now), now


def test_a_few_steps_are_drawn_as_the_staircase_they_are():
    signals = drilled()
    trace = curves.position_trace(signals.unit("drill"), signals.until, COLUMNS)
    for t, _, place in pulses(signals.recording, "drill", signals.until):
        index = int(np.searchsorted(trace.times, t, side="right")) - 1
        assert trace.values[index] == place
        assert trace.times[index] == t
    assert (trace.times[0], trace.times[-1]) == (0, signals.until)


def test_many_steps_are_drawn_at_the_ends_of_motions_and_at_every_column():
    signals = endless(10_000, 60)
    unit = signals.unit("bar")
    trace = curves.position_trace(unit, signals.until, COLUMNS)
    assert len(trace.times) < 2 * COLUMNS
    assert trace.values.tolist() == [unit.motion.position(t) for t in trace.times.tolist()]


def test_moves_within_a_column_show_how_far_they_went():
    signals, until = to_and_fro(400)
    unit = signals.unit("bar")
    trace = curves.position_trace(unit, until, 10)
    assert (trace.values.min(), trace.values.max()) == (0, 20)
    assert len(trace.times) < 400


def test_speeds_follow_the_law_and_not_the_rounded_times():
    signals = drilled()
    unit = signals.unit("bar")
    trace = curves.speed_trace(unit, signals.until, COLUMNS)
    [span] = unit.motion.spans
    for n in (1, 20, 49, 51, 150, 249, 251, 299):
        t = span.train.time_of(n)
        assert at(trace, t) == pytest.approx(span.train.state_at(t).rate, rel=1e-6)
    assert trace.values.max() == 2_000
    assert at(trace, span.begins - 1) == at(trace, span.ends + 1) == 0


def test_speeds_have_the_sign_of_their_direction_and_drop_to_0_where_a_motion_is_cut():
    recording, until = interrupted()
    unit = Signals(recording, [DRILL], until).unit("drill")
    trace = curves.speed_trace(unit, until, COLUMNS)
    assert trace.values.min() == -2_000
    cut = next(entry for entry in recording.of("drill") if isinstance(entry, MotionCut))
    assert at(trace, cut.at - 1) > 1_000
    assert at(trace, cut.at + 2) == 0


def test_a_motion_that_changes_its_mind_does_not_touch_0_on_the_way():
    recording, until = interrupted()
    unit = Signals(recording, [DRILL], until).unit("drill")
    trace = curves.speed_trace(unit, until, COLUMNS)
    during = trace.values[(trace.times > SECOND) & (trace.times < SECOND + 200 * MS)]
    assert (during <= -100).all()


def test_a_motion_under_way_at_the_end_does_not_seem_to_stop():
    trace = curves.speed_trace(endless(1_000, 3).unit("bar"), 3 * SECOND, COLUMNS)
    assert trace.values[-1] == 1_000


def test_speeds_of_other_laws_are_sampled_along_the_curve():
    train = Train((Ticked(0, 16_000, 10_000, 1 << 20, 0, 0, 10),))  # 16 us a tick, for 160 ms
    recording = Recording(["bar"])
    recording.extend(0, [MotionStarted(0, train, 1, 1, 0)])
    unit = Signals(recording, [BAR], 160 * MS).unit("bar")
    trace = curves.speed_trace(unit, 160 * MS, COLUMNS)
    for t in (MS, 40 * MS, 159 * MS):
        assert at(trace, t) == pytest.approx(train.state_at(t).rate, rel=0.02)
    assert 100 < len(trace.times) < 2 * COLUMNS


def test_a_train_of_many_segments_is_sampled_as_a_whole():
    pieces = [Uniform.at_rate(to_fixed(n * MS), 5_000, 5) for n in range(300)]
    recording = Recording(["bar"])
    recording.extend(0, [MotionStarted(0, Train(pieces), 1, -1, 0)])
    trace = curves.speed_trace(Signals(recording, [BAR], 300 * MS).unit("bar"), 300 * MS, 50)
    assert len(trace.times) < 100
    assert at(trace, 150 * MS + 7) == -5_000


def test_the_work_does_not_grow_with_the_number_of_pulses_or_motions():
    day = endless(10_000, 86_400)
    assert len(curves.speed_trace(day.unit("bar"), day.until, COLUMNS).times) < 10
    many, until = to_and_fro(3_000)
    assert len(curves.speed_trace(many.unit("bar"), until, 100).times) < 3_000
    lane = curves.lane(day.unit("bar"), "CLOCK", day.until, COLUMNS)
    assert lane.busy == [(0, day.until)]


def test_a_lane_has_the_levels_of_its_pin():
    signals = drilled()
    expected = level_changes(signals.recording, BAR, signals.until)
    for pin in ("MOV", "UO1", "RDY", "UI1"):
        lane = curves.lane(signals.unit("bar"), pin, signals.until, 1_000_000)
        behind_0 = [change for change in expected[pin] if change[0] > 0]
        assert list(zip(lane.times.tolist(), lane.levels.tolist(), strict=True))[1:] == behind_0
        assert lane.busy == []


def test_changes_too_quick_for_a_column_make_one_busy_stretch_and_the_level_behind_it_is_right():
    recording, begin = Recording(["bar"]), SECOND + MS
    recording.extend(0, [Powered(0, True), *(PinSet(begin + n * 1_000, "UO1", (n + 1) % 2) for n in range(1_001))])
    lane = curves.lane(Signals(recording, [BAR], 10 * SECOND).unit("bar"), "UO1", 10 * SECOND, COLUMNS)
    assert lane.busy == [(begin, begin + MS)]
    assert lane.levels.tolist() == [0, 1]
    assert lane.times.tolist() == [0, begin + MS]


def test_an_instruction_lasts_to_the_next_one_and_the_last_to_the_end_of_the_program():
    recording = Recording(["bar"])
    recording.extend(0, [Executing(0, 0, "W1"), Executing(5, 2, "A1"), PinSet(5, "UO1", 1), Finished(9)])
    assert curves.instructions(Signals(recording, [BAR], 20), "bar") == [Band(0, 5, "W1"), Band(5, 9, "A1")]


def test_an_instruction_that_waits_or_moves_lasts_to_the_end_of_the_run():
    recording = Recording(["bar"])
    recording.extend(0, [Executing(3, 0, "W1")])
    assert curves.instructions(Signals(recording, [BAR], 20), "bar") == [Band(3, 20, "W1")]
    motion, _ = moved(500, 1, 0)
    recording = Recording(["bar"])
    recording.extend(0, [Executing(0, 0, "+500"), motion[0], PinSet(4, "RAMP", 0)])
    assert curves.instructions(Signals(recording, [BAR], 20), "bar") == [Band(0, 20, "+500")]


def test_an_instruction_ends_when_the_supply_does():
    recording = Recording(["bar"])
    recording.extend(0, [Executing(3, 0, "W1"), Powered(8, False), Powered(9, True)])
    assert curves.instructions(Signals(recording, [BAR], 20), "bar") == [Band(3, 8, "W1")]


def test_an_envelope_holds_the_curve():
    signals, until = to_and_fro(300)
    trace = curves.speed_trace(signals.unit("bar"), until, 1_000)
    low, high = curves.envelope(trace, until, 50)
    assert low.values.min() == trace.values.min()
    assert high.values.max() == trace.values.max()
    assert (low.values <= high.values).all()


def test_lanes_chosen_by_themselves_are_programs_and_pins_that_change():
    signals = drilled()
    signals.recording.extend(0, [Executing(0, 0, "W1")])
    chosen = figures.chosen_lanes(signals)
    assert [(lane.unit, lane.pin) for lane in chosen if isinstance(lane, Pin)] == [
        ("bar", "RDY"), ("bar", "MOV"), ("bar", "UO1"), ("drill", "DIR"), ("drill", "MOV"), ("drill", "UI1"),
    ]  # fmt: skip
    assert [lane.label for lane in chosen if isinstance(lane, Strip)] == ["bar program"]


@pytest.mark.parametrize("name", ["run.jpg", "run"])
def test_another_suffix_is_refused_with_the_list(name, tmp_path):
    with pytest.raises(ValueError, match=r"a figure is one of \.png, \.svg, \.pdf"):
        figures.write(tmp_path / name, drilled())


@pytest.fixture
def needs_matplotlib():
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (detent-motion[figures])")


@pytest.mark.usefixtures("needs_matplotlib")
@pytest.mark.parametrize(("suffix", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".PDF", b"%PDF")])
def test_a_figure_is_a_file_of_its_kind_and_the_same_every_time(suffix, start, tmp_path):
    for name in ("one", "other"):
        figures.write(tmp_path / f"{name}{suffix}", drilled(), title="Drilling")
    data = (tmp_path / f"one{suffix}").read_bytes()
    assert data.startswith(start)
    assert data == (tmp_path / f"other{suffix}").read_bytes()


@pytest.mark.usefixtures("needs_matplotlib")
def test_a_figure_shows_every_axis_and_the_lanes_asked_for():
    lanes = [Pin("bar", "UO1", "bar.UO1 → drill.UI1", "drill a hole"), Pin("drill", "CLOCK"),
             Strip("drill", "phase", "what it does", [Band(0, 100 * MS, "waiting")])]  # fmt: skip
    figure = figures.timeline_figure(drilled(), title="Drilling", lanes=lanes)
    words = [text.get_text() for text in figure.texts] + [t.get_text() for a in figure.axes for t in a.texts]
    for shown in ("Drilling", "bar", "drill", "bar.UO1 → drill.UI1", "drill a hole", "drill.CLOCK", "phase", "waiting"):
        assert shown in words
    assert len(figure.axes) == 2 * 2 + 1
    assert figure.axes[-1].get_xlabel() == "time (ms)"
    position = figure.axes[0].lines[0]
    assert (position.get_ydata()[0], position.get_ydata()[-1]) == (0, 300)


@pytest.mark.usefixtures("needs_matplotlib")
@pytest.mark.parametrize("until", [0, 1, MS, 5 * SECOND])
def test_a_run_without_motion_can_be_drawn(until, tmp_path):
    for name, seen in (("bar", Signals(Recording(["bar"]), [BAR], until)), ("none", Signals(Recording([]), [], until))):
        figures.write(tmp_path / f"{name}.png", seen)
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("needs_matplotlib")
def test_a_lane_that_is_none_is_refused_with_those_there_are():
    with pytest.raises(KeyError, match=r"bar has no wire 'MOVE' to draw: it has RXD"):
        figures.timeline_figure(drilled(), lanes=[Pin("bar", "MOVE")])
