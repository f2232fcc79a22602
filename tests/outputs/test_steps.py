"""Runs of steps: every pulse within its window whatever the law, the clock and the error; as few runs as promised."""

from collections.abc import Iterator
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.outputs.steps import FAR, MOST_ADD, MOST_STEPS, Error, Run, Runs, Scale, ticks
from detent.pulses import Accelerating, Table, Train, Uniform
from detent.ramps import constant_acceleration, tick_accumulator, timer_table
from detent.ticks import MS, SECOND, US

CLOCKS = (12_000_000, 16_000_000, 72_000_000, 180_000_000)
ERRORS: tuple[Error, ...] = ("exact", 1 * US, 5 * US, 25 * US)


@st.composite
def uniform(draw: st.DrawFn) -> Train:
    rate, steps = draw(st.integers(1, 200_000)), draw(st.integers(1, 600))
    denominator = draw(st.integers(1, 97))
    start = draw(st.integers(0, 1 << 70))
    return Train((Uniform(0, SECOND * denominator + 1, rate * denominator, steps),), start)


@st.composite
def accelerating(draw: st.DrawFn) -> Train:
    slow, top = draw(st.integers(1, 5000)), draw(st.integers(5001, 100_000))
    ramp, steps = draw(st.integers(1, 800)), draw(st.integers(1, 900))
    return constant_acceleration.move(slow, top, ramp, steps).train.at(draw(st.integers(0, 1 << 70)))


@st.composite
def table(draw: st.DrawFn) -> Train:
    rows = draw(st.lists(st.tuples(st.integers(1, 40), st.integers(5, 4000)), min_size=1, max_size=20))
    rung = Table.of(0, draw(st.sampled_from([2000, Fraction(10_000, 3), 16_276])), *zip(*rows, strict=True))
    return Train((rung,))


@st.composite
def ticked(draw: st.DrawFn) -> Train:
    run, slope = draw(st.integers(100, 60_000)), draw(st.integers(100, 500_000))
    steps = draw(st.integers(1, 800))
    train: Train = tick_accumulator.toward(steps, 0, 0, run, slope, 100, slope).train
    return train


TRAINS = st.one_of(uniform(), accelerating(), table(), ticked())


def in_window(train: Train, runs: list[Run], frequency: int, error: Error, before: int) -> None:
    """Prove it with fractions of whole numbers, apart from the arithmetic of the module."""
    times = [train.time_of(n) for n in range(1, (train.steps or 0) + 1)]
    at = list(ticks(runs))
    assert len(at) == len(times)
    last = before
    for n, (tick, time) in enumerate(zip(at, times, strict=True)):
        assert tick > last, f"pulse {n + 1} does not rise"
        last = tick
        off = abs(Fraction(tick, frequency) - Fraction(time, SECOND))
        allowed = Fraction(0 if error == "exact" else error, SECOND)
        assert off <= max(allowed, Fraction(1, 2 * frequency)), f"pulse {n + 1} is off by {float(off):g} s"


def fits_firmware(runs: list[Run]) -> None:
    for run in runs:
        assert 1 <= run.steps <= MOST_STEPS
        assert -MOST_ADD <= run.add <= MOST_ADD
        intervals = [run.interval + k * run.add for k in range(run.steps)]
        assert 0 < min(intervals) <= max(intervals) < 1 << 31


@settings(max_examples=examples(60))
@given(TRAINS, st.sampled_from(CLOCKS), st.sampled_from(ERRORS))
def test_every_pulse_is_in_its_window(train: Train, frequency: int, error: Error) -> None:
    scale = Scale(frequency)
    base = scale.tick(train.time_of(0)) - 1
    runs = Runs(train, scale, error, base).take()
    in_window(train, runs, frequency, error, base)
    fits_firmware(runs)


@pytest.mark.slow
@settings(max_examples=3000)
@given(TRAINS, st.sampled_from(CLOCKS), st.sampled_from(ERRORS))
def test_every_pulse_is_in_its_window_at_length(train: Train, frequency: int, error: Error) -> None:
    scale = Scale(frequency)
    base = scale.tick(train.time_of(0)) - 1
    runs = Runs(train, scale, error, base).take()
    in_window(train, runs, frequency, error, base)
    fits_firmware(runs)


@settings(max_examples=examples(40))
@given(TRAINS, st.sampled_from(CLOCKS), st.sampled_from(ERRORS), st.data())
def test_pieces_are_the_whole(train: Train, frequency: int, error: Error, data: st.DataObject) -> None:
    """Wherever the pulses are split, they fall on the same ticks: what is sent piece by piece is the same motion."""
    scale = Scale(frequency, offset=data.draw(st.integers(-(1 << 50), 1 << 50)))
    base = scale.tick(train.time_of(0)) - 1
    whole = list(ticks(Runs(train, scale, error, base).take()))
    pieces, taken = Runs(train, scale, error, base), []
    steps = train.steps or 0
    for upto in sorted(data.draw(st.lists(st.integers(0, steps), max_size=12))):
        part = pieces.take(upto)
        taken += list(ticks(part))
        assert len(taken) == upto
        assert pieces.next == upto + 1
    taken += list(ticks(pieces.take()))
    assert taken == whole


def test_the_scale_of_another_board() -> None:
    """A clock that is no whole number of ticks a second goes through integers of any size, to the same end."""
    train = constant_acceleration.move(200, 1500, 60, 1000).train
    plain = Runs(train, Scale(12_000_000, offset=7, zero=5), 1000, -100).take()
    odd = Runs(train, Scale(12_000_000 << 5, SECOND << 5, 7, 5), 1000, -100).take()
    assert plain == odd


def test_a_pulse_long_after_the_last_has_a_base_of_its_own() -> None:
    train = Train((Uniform(0, 40 * SECOND, 1, 3),))
    runs = Runs(train, Scale(180_000_000), 1000, 0).take()
    assert [run.steps for run in runs] == [1, 1, 1]
    assert all(run.interval < FAR for run in runs)
    assert list(ticks(runs)) == [40 * 180_000_000 * n for n in (1, 2, 3)]


def test_an_endless_train_is_taken_as_far_as_asked() -> None:
    train = constant_acceleration.move(100, 1000, 50, None).train
    runs = Runs(train, Scale(12_000_000), 1000, 0)
    assert runs.due() == Scale(12_000_000).tick(train.time_of(1))
    assert sum(run.steps for run in runs.take(7000)) == 7000
    with pytest.raises(ValueError, match="open-ended"):
        runs.take()


def test_a_clock_that_is_too_slow_is_told() -> None:
    with pytest.raises(ValueError, match="too few"):
        Runs(Train((Uniform.at_rate(0, 100_000, 10),)), Scale(50_000), "exact", 0).take()


def test_the_last_pulse_before_is_never_met() -> None:
    """The first window reaches to the tick of the pulse before: it is cut behind it."""
    train = Train((Uniform(0, 1 * MS, 1, 4),))
    runs = Runs(train, Scale(12_000_000), 25 * US, 12_000 - 5).take()
    assert next(ticks(runs)) > 12_000 - 5


def _up_and_down(rate: int) -> Train:
    steps = rate // 20  # 0.1 s
    up = Accelerating(0, 0, Fraction(rate * rate, steps), 0, steps)
    return Train((up, Accelerating.down_from(up.end, 0, Fraction(rate * rate, steps), steps)))


def _dcb() -> Train:
    count = timer_table.count_of
    return timer_table.index(timer_table.Speeds(count(400), count(8000), 4, 4, 1), 10_000).train


def profiles() -> Iterator[tuple[str, Train, tuple[float, float, float, float]]]:
    """Trains, and how many steps a run makes at least on average with exact, 1, 5 and 25 us at 12 MHz."""
    move = constant_acceleration.move
    yield "ramps 0-100 k in 0.1 s", _up_and_down(100_000), (2.65, 35, 81, 89)
    yield "ramps 0-10 k in 0.1 s", _up_and_down(10_000), (2.35, 13, 25, 42)
    yield "GS-C200 S20 T150 R60, 1000", move(200, 1500, 60, 1000).train, (15.9, 30, 43, 66.6)
    yield "GS-C200 S100 T1000 R1000, 20 000", move(1000, 10_000, 1000, 20_000).train, (25.5, 179, 377, 714)
    yield "GS-C200, 170 steps/s", move(170, 170, 1, 2000).train, (2.05, 64.5, 285, 1000)
    yield "DCB-274 400-8000 K4, 10 000", _dcb(), (1.99, 38, 120, 370)
    rising = tick_accumulator.toward(10_000, 0, 62_500_000, 10_000, 20_000, 1000, 20_000).train
    yield "GenStepper 1-10 k", rising, (2.2, 2.2, 4, 34)


@pytest.mark.parametrize(("train", "least"), [(t, w) for _, t, w in profiles()], ids=[n for n, _, _ in profiles()])
def test_steps_in_a_run(train: Train, least: tuple[float, ...]) -> None:
    """As few commands as the reference page promises. A count, not a timing."""
    for error, wanted in zip(ERRORS, least, strict=True):
        runs = Runs(train, Scale(12_000_000), error, -1).take()
        assert (train.steps or 0) / len(runs) >= wanted, error
