"""What the scope shows is what happened: no pulse, no glitch and no step of it is lost, whatever the zoom."""

import math

import numpy as np
import pytest
from tests.workbench.told import Told, alone, example

from detent.outputs import signals
from detent.outputs.waves import UNKNOWN
from detent.ticks import MS, SECOND, US, Ns
from detent.workbench.scope import Scope, Trigger, width_for


@pytest.fixture(scope="module")
def drilling() -> Told:
    told = example("drilling")
    told.run(4 * SECOND, 37 * MS)
    return told


def level(value: float) -> float:
    return math.nan if value == UNKNOWN else float(value)


@pytest.mark.parametrize(
    ("begin", "end"), [(0, 4 * SECOND), (900 * MS, 1100 * MS), (921 * MS, 923 * MS), (922 * MS, 922 * MS + 40 * US)]
)
def test_columns_of_a_pin_hold_its_least_and_most_level(drilling: Told, begin: Ns, end: Ns) -> None:
    whole = signals.of_cell(_recorded(drilling))
    for unit, pin in (("bar", "UO2"), ("bar", "CLOCK"), ("drill", "RDY"), ("drill", "CLOCK"), ("bar", "RAMP")):
        data = drilling.scope.columns([f"{unit}.{pin}"], begin, end, 300, 0)
        one = whole.unit(unit)
        wave = one.wave(pin)
        for k in range(0, data.columns, 7):
            first, last = data.begin + k * data.width, data.begin + (k + 1) * data.width
            changes = wave.between(first, last)
            at_first = len(changes.times) and changes.times[0] == first
            levels = [level(v) for v in changes.levels.tolist()]
            if not at_first:
                levels.append(level(one.level_before(pin, first)))
            known = [v for v in levels if not math.isnan(v)]
            assert data.low[0, k] == min(known, default=math.nan) or not known
            assert data.high[0, k] == max(known, default=math.nan) or not known
            assert bool(np.isnan(data.low[0, k])) == (not known)


@pytest.mark.parametrize(("begin", "end"), [(0, 4 * SECOND), (1 * SECOND, 1400 * MS), (1120 * MS, 1130 * MS)])
def test_columns_of_a_position_hold_every_place_it_was_at(drilling: Told, begin: Ns, end: Ns) -> None:
    whole = signals.of_cell(_recorded(drilling))
    for unit in ("bar", "drill"):
        data = drilling.scope.columns([f"{unit}.position", f"{unit}.pulses"], begin, end, 200, 0)
        one = whole.unit(unit)
        for k in range(data.columns):
            first, last = data.begin + k * data.width, data.begin + (k + 1) * data.width
            places = [one.motion.position(first - 1), *one.motion.pulses(first, last).positions.tolist()]
            low, high = min(places), max(places)
            assert low >= data.low[0, k] >= low - 1e-9
            assert high <= data.high[0, k] <= high + 1e-9
            if k % 20 == 0:
                assert data.high[1, k] == len(one.motion.pulses(0, last).times)


def test_columns_of_a_speed_reach_its_peaks(drilling: Told) -> None:
    """drill.gsc: T200, 2000 steps/s both ways."""
    data = drilling.scope.columns(["drill.speed"], 0, 4 * SECOND, 97, 0)
    assert np.nanmax(data.high) == pytest.approx(2000, abs=1)
    assert np.nanmin(data.low) == pytest.approx(-2000, abs=1)
    for at in (700 * MS, 1200 * MS, 1500 * MS, 3 * SECOND):
        column = (at - data.begin) // data.width
        assert data.low[0, column] - 1 <= drilling.scope.curve("drill.speed").value(at) <= data.high[0, column] + 1


def test_columns_that_are_kept_are_those_that_would_be_made(drilling: Told) -> None:
    told = example("drilling")
    keys = [trace.key for trace in told.scope.traces]
    for until in range(100, 2000, 130):  # as one looks on while it runs
        told.run(until * MS)
        followed = told.scope.columns(keys, max(until * MS - SECOND, 0), until * MS, 500, 0)
    fresh = Scope(told.picture, told.mirror).columns(keys, max(until * MS - SECOND, 0), until * MS, 500, 0)
    assert followed.width == fresh.width
    np.testing.assert_array_equal(followed.low, fresh.low)
    np.testing.assert_array_equal(followed.high, fresh.high)


def test_nothing_is_shown_of_what_has_not_happened_and_of_what_is_forgotten(drilling: Told) -> None:
    data = drilling.scope.columns(["bar.position"], 3 * SECOND, 6 * SECOND, 300, 3_500 * MS)
    times = data.begin + np.arange(data.columns) * data.width
    assert np.isnan(data.low[0, times > 4 * SECOND]).all()
    assert np.isnan(data.low[0, times + data.width <= 3_500 * MS]).all()
    assert not np.isnan(data.low[0, (times > 3_500 * MS) & (times < 4 * SECOND)]).any()


def test_after_the_past_was_changed_the_new_past_is_shown(drilling: Told) -> None:
    from detent.cell.actions import Power

    told = example("drilling")
    told.run(2 * SECOND)
    keys = [trace.key for trace in told.scope.traces]
    told.scope.columns(keys, 0, 2 * SECOND, 400, 0)
    told.history.rewind(1 * SECOND)
    told.history.do(Power("bar", False))
    told.run(2 * SECOND)
    other = example("drilling")
    other.run(1 * SECOND)
    other.history.do(Power("bar", False))
    other.run(2 * SECOND)
    one, two = (each.scope.columns(keys, 0, 2 * SECOND, 400, 0) for each in (told, other))
    np.testing.assert_array_equal(one.low, two.low)
    np.testing.assert_array_equal(one.high, two.high)
    assert np.isnan(one.low[keys.index("bar.UO1"), -10])


def test_what_is_forgotten_leaves_levels_and_places_as_they_were() -> None:
    told, whole = example("menu", keep=3_000), example("menu")
    told.run(12 * SECOND, 200 * MS)
    whole.run(12 * SECOND)
    assert told.history.begin > 5 * SECOND
    keys = [trace.key for trace in told.scope.traces]
    begin = told.history.begin + SECOND
    one, two = (each.scope.columns(keys, begin, 12 * SECOND, 400, begin) for each in (told, whole))
    np.testing.assert_array_equal(one.low, two.low)
    np.testing.assert_array_equal(one.high, two.high)
    pulses = [key for key in keys if key.endswith(".pulses")]
    assert all(told.scope.curve(k).value(12 * SECOND) == whole.scope.curve(k).value(12 * SECOND) for k in pulses)
    assert len(told.mirror.recording()) < len(whole.mirror.recording()) / 2
    assert told.mirror.signals().unit(told.picture.units[next(iter(told.picture.units))].name).motion.position(
        12 * SECOND
    ) == whole.mirror.signals().unit(next(iter(whole.picture.units))).motion.position(12 * SECOND)


def test_an_axis_that_was_found_elsewhere_is_shown_there_at_once() -> None:
    """As behind real pins when a board that was stopped has counted fewer steps than the cell had given."""
    told = alone("gs-c200s", CHS=0)
    told.cell.type("gs-c200s", "+50")
    told.run(2 * SECOND, 20 * MS)
    told.cell.displace("gs-c200s", "", -7)
    told.run(3 * SECOND, 20 * MS)
    data = told.scope.columns(["gs-c200s.position", "gs-c200s.pulses"], 0, 3 * SECOND, 300, 0)
    last = int((2900 * MS) // data.width)
    assert (data.low[0, last], data.high[0, last], data.high[1, last]) == (43, 43, 50)
    before = int((1900 * MS) // data.width)
    assert data.low[0, before] == 50
    [front] = told.history.panel.fronts
    assert front.travels[""].at(told.cell.now) == (43, 0.0)
    told.cell.type("gs-c200s", "+10")
    told.run(4 * SECOND, 20 * MS)
    data = told.scope.columns(["gs-c200s.position"], 0, 4 * SECOND, 300, 0)
    assert data.high[0, int((3900 * MS) // data.width)] == 53


def test_triggers_are_found_at_their_very_nanosecond(drilling: Told) -> None:
    whole = signals.of_cell(_recorded(drilling))
    wave = whole.unit("bar").wave("UO2").between(1, 4 * SECOND)
    search = drilling.scope.search
    assert search(Trigger("rise", "bar.UO2"), 1, 4 * SECOND, 100) == wave.times[wave.levels == 1].tolist()
    assert search(Trigger("fall", "bar.UO2"), 1, 4 * SECOND, 100) == wave.times[wave.levels == 0].tolist()
    clock = whole.unit("bar").wave("CLOCK").between(SECOND, 1200 * MS)
    assert search(Trigger("edge", "bar.CLOCK"), SECOND, 1200 * MS - 1, 9999) == clock.times.tolist()
    pulses = whole.unit("bar").motion.pulses(0, 4 * SECOND)
    (at,) = search(Trigger("up", "bar.position", 250.5), 0, 4 * SECOND, 100)
    assert at == pulses.times[pulses.positions == 251][0]
    for at in search(Trigger("up", "drill.speed", 500.0), 0, 4 * SECOND, 100):
        curve = drilling.scope.curve("drill.speed")
        assert curve.value(at - 1) <= 500.0 < curve.value(at)
    assert search(Trigger("error"), 0, 4 * SECOND, 100) == []
    with pytest.raises(ValueError, match="it takes rise, fall or edge"):
        search(Trigger("up", "bar.UO2", 0.5), 0, 4 * SECOND, 100)
    with pytest.raises(KeyError, match="no trace"):
        search(Trigger("up", "bar.speeed"), 0, 4 * SECOND, 100)


def test_a_rotor_is_shown_with_its_currents_and_its_torque() -> None:
    told = example("closed-loop-motor")
    told.run(30 * MS, 5 * MS)
    names = ("place", "command", "rotor_speed", "current_a", "current_b", "torque", "lag")
    data = told.scope.columns([f"slide.{name}" for name in names], 0, 30 * MS, 100, 0)
    assert data.low.shape == (7, data.columns)
    shown = dict(zip(names, data.high, strict=True))
    assert np.nanmax(shown["place"]) == pytest.approx(told.scope.curve("slide.place").value(30 * MS), abs=1)
    assert np.nanmax(shown["current_a"]) > 0.5
    assert np.nanmax(np.abs(shown["torque"])) > 0.01
    for key in ("place", "current_a"):
        assert not np.isnan(data.low[names.index(key), 5:-5]).any()


def test_columns_stand_on_a_grid_of_round_widths() -> None:
    for span, points in ((4 * SECOND, 2000), (123_456_789, 700), (5_000, 2_000), (77, 1_000), (3600 * SECOND, 2_000)):
        width = width_for(span, points)
        assert -(-span // width) + 1 <= points or width == 1
        assert width <= 2 * max(span // points, 1) + 1


def _recorded(told: Told):
    """The same cell with its recording, which the history has taken out of it."""
    cell = told.cell.copy()
    cell.recording = told.mirror.recording()
    return cell
