"""Variants: the same verdicts as one by one, draws that can be made again, and what a count of losses proves."""

import re
from fractions import Fraction
from itertools import pairwise
from math import comb, floor, log10

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples
from tests.motors.moves import LARGE, SMALL, even, ramped, rig

from detent.motors import chance, engine, variants
from detent.motors.drive import Drive
from detent.motors.excitation import Changes
from detent.motors.load import Load, Profile
from detent.motors.motor import MotorError
from detent.motors.move import simulate
from detent.motors.rotor import Rig
from detent.motors.variants import (
    SPREAD,
    UNMET,
    Ensemble,
    LossRate,
    Spread,
    changed,
    corners,
    draws,
    loss_rate,
    percent,
    pieces,
)
from detent.motors.winding import HALF, microstep
from detent.ramps.constant_acceleration import move
from detent.tuner.search import Check

compiled_only = pytest.mark.skipif(not engine.fast(), reason="numba is not installed")
WIDE = SPREAD.changed({"inertia": (0.3, 6.0), "voltage": 0.5})


@compiled_only
@pytest.mark.parametrize("decay", ["fast", "slow", "mixed", "voltage"])
@pytest.mark.parametrize("interpolation", [False, True])
def test_an_ensemble_has_the_verdicts_of_its_rigs_one_by_one(decay: str, interpolation: bool) -> None:
    """With the substep of the finest of them, to the last bit."""
    winding = microstep(8) if interpolation else HALF
    drive = Drive(24, 1.0, winding, decay, interpolation=interpolation, resistance=0.5, least_on=0.05)  # type: ignore[arg-type]
    base = Rig(SMALL, drive, Load(3.5e-6, 0.01), substep=4_000)
    some = Ensemble(base, draws(WIDE, 40))
    times = ramped(400 * winding.steps // 2, 250 * winding.steps, 3500 * winding.steps)
    found = some.judge(times)
    alone = [simulate(times, some.rig_of(k)).verdict for k in range(len(some))]
    assert [found.verdict(k).lost for k in range(len(some))] == [verdict.lost for verdict in alone]
    assert 0 < found.lost.sum() < len(some)
    kept = ~found.lost
    angles = np.array([verdict.load_angle for verdict in alone])
    assert found.load_angles[kept] == pytest.approx(angles[kept], abs=1e-6)


def test_the_first_loss_ends_the_search_and_is_a_real_one() -> None:
    some = Ensemble(rig(), draws(WIDE, 300))
    times = ramped(400, 500, 7000)
    lost = some.judge(times).lost
    index = some.survives(times)
    assert index is not None
    assert lost[index]
    assert some.of(~lost).survives(times) is None
    assert some.of(np.array([index])).survives(times) == 0
    assert len(some.of(slice(0, 5)).and_(some.factors[index])) == 6


@pytest.mark.parametrize("which", ["time", "position"])
def test_a_load_that_changes_on_the_way_has_variants_too(which: str) -> None:
    wall = Profile(0.18, 0.01, (0.0, 0.12)) if which == "time" else Profile(1.5, 0.05, (0.0, 0.12))
    load = Load(3.5e-6, 0.01, **{f"torque_by_{which}": wall})  # type: ignore[arg-type]
    factors = np.ones((2, len(SPREAD)))
    factors[1, -1] = 5.0  # five times the load
    base = Rig(SMALL, Drive(24, 1.0, HALF), load)
    some = Ensemble(base, factors)
    assert some.judge(even(500, 200)).lost.tolist() == [False, True]
    assert some.survives(even(500, 200)) == 1
    assert simulate(even(500, 200), changed(base, load=5.0)).verdict.lost


def test_a_weight_that_a_variant_cannot_hold_is_a_loss_and_no_error() -> None:
    base = rig(torque=0.12)
    factors = np.ones((2, len(SPREAD)))
    factors[1, -1] = 3.0
    assert Ensemble(base, factors).judge(even(100, 20)).lost.tolist() == [False, True]


def test_corners_are_all_combinations_of_ends() -> None:
    found = corners(SPREAD)
    assert found.shape == (128, 8)
    assert len(np.unique(found, axis=0)) == 128
    assert set(np.unique(found[:, 0])) == {0.8, 1.2}
    assert corners(SPREAD.of(rig(friction=0.0))).shape[0] == 64  # no friction to vary
    assert SPREAD.changed({"load": (0.5, 1.5)}).of(rig(torque=0.01)).load == (0.5, 1.5)


def test_draws_are_the_same_however_they_are_divided_and_fill_their_ranges() -> None:
    whole = draws(SPREAD, 1000, seed=3)
    pieces = np.concatenate([draws(SPREAD, 250, seed=3, first=first) for first in range(0, 1000, 250)])
    assert np.array_equal(whole, pieces)
    assert not np.array_equal(whole, draws(SPREAD, 1000, seed=4))
    low, high = np.array(SPREAD).T
    assert (whole >= low).all()
    assert (whole <= high).all()
    middle = (low + high) / 2
    wide = high > low
    assert whole.mean(axis=0)[wide] == pytest.approx(middle[wide], rel=0.03)
    # no dimension follows another
    shown = np.corrcoef(whole[:, wide].T) - np.eye(int(wide.sum()))
    assert np.abs(shown).max() < 0.1


def test_the_first_draws_are_those_of_splitmix() -> None:
    """SplitMix64 as published: seed 1234567 gives 6457827717110365317, 3203168211198807973."""
    with np.errstate(over="ignore"):
        states = np.uint64(1234567) + np.uint64(0x9E3779B97F4A7C15) * np.arange(1, 3, dtype=np.uint64)
    assert chance._mixed(states).tolist() == [6457827717110365317, 3203168211198807973]


def test_none_of_2048_is_less_than_a_hundred_and_fiftieth_of_a_percent_of_ten() -> None:
    """The rule of three: 3 / n; with k looks 0.05 / k each (0.15 %, 0.18 %, 0.20 %)."""
    assert [percent(chance.bound(0, 2048, looks=k)) for k in (1, 2, 3)] == ["0.15 %", "0.18 %", "0.2 %"]
    assert chance.bound(0, 1000) == pytest.approx(3 / 1000, rel=0.01)
    assert chance.bound(7, 7) == 1.0


@settings(max_examples=examples(25))
@given(st.integers(1, 400), st.integers(0, 400))
def test_the_bound_is_the_one_of_clopper_and_pearson(tried: int, lost: int) -> None:
    """With that rate, as few losses or fewer have a chance of just 5 %."""
    lost = min(lost, tried - 1)
    rate = chance.bound(lost, tried)
    binom = pytest.importorskip("scipy.stats").binom
    assert binom.cdf(lost, tried, rate) == pytest.approx(0.05, rel=1e-6)
    assert rate > lost / tried


@compiled_only
def test_a_margin_of_load_angle_is_not_one_of_losses() -> None:
    """A move that the rig itself makes with room to spare, and that many of its variants lose."""
    base = Rig(LARGE, Drive(24, 1.0, HALF, "slow"), Load(LARGE.rotor))
    times = move(1000, 4500, 600, 6000).train
    verdict = simulate(times, base).verdict
    rate = loss_rate(times, base, tried=128)
    assert not verdict.lost
    assert verdict.margin > 0.6
    assert rate.lost > 10
    assert rate.corners_lost > 10
    assert rate == loss_rate(times, base, tried=128)
    assert f"lost by {rate.lost} of 128" in str(rate)


@pytest.mark.parametrize("looks", [1, 2, 3, 6])
@pytest.mark.parametrize(("tried", "lost"), [(2048, 0), (2048, 5), (512, 0), (512, 31), (59, 0), (32, 31), (10, 10)])
def test_what_is_printed_of_a_rate_is_above_the_bound_of_all_its_looks_and_hardly(
    tried: int, lost: int, looks: int
) -> None:
    """Each of k looks may be wrong once in 20 k times: in whole numbers, and from the words that people read."""

    def at_most(rate: Fraction) -> Fraction:
        """The chance of so few losses, exactly."""
        ways = (comb(tried, k) * rate**k * (1 - rate) ** (tried - k) for k in range(lost + 1))
        return sum(ways, Fraction())

    for words in (
        str(LossRate(lost, tried, 0, 128, 1, looks)),
        str(Check(tried, lost, 128, 0, looks, 0)),
    ):
        found = re.search(r"(?:below|less than) ([\d.]+) %", words)
        assert found is not None
        shown = Fraction(found[1]) / 100
        assert (f"{looks} looks counted" in words) is (looks > 1)
        if lost == tried:
            assert shown == 1
            continue
        part = Fraction(1, 20 * looks)
        assert at_most(shown) <= part
        digit = Fraction(1, 100) if shown >= Fraction(1, 10) else Fraction(10) ** (floor(log10(shown)) - 1)
        assert at_most(shown - digit) > part  # the next lesser number with as many digits is none


@compiled_only
def test_what_is_judged_afterwards_has_not_been_met_by_a_search() -> None:
    """A search of the same seed asked the first draws, and what it found survives them: they are no fresh ones."""
    rig = Rig(LARGE, Drive(24, 1.0, HALF, "slow"), Load(LARGE.rotor))
    pulses, spread = move(1000, 4500, 600, 6000).train, SPREAD.of(rig)
    met = Ensemble(rig, draws(spread, 64, first=0)).judge(pulses).lost
    fresh = Ensemble(rig, draws(spread, 64, first=UNMET)).judge(pulses).lost
    assert loss_rate(pulses, rig, tried=64).lost == int(fresh.sum())
    assert met.tolist() != fresh.tolist()


def test_percent_rounds_a_bound_up() -> None:
    assert [percent(value) for value in (0.001463, 0.0101, 0.2501, 1.0)] == ["0.15 %", "1.1 %", "26 %", "100 %"]
    assert isinstance(LossRate(0, 10, 0, 128, 1).bound, float)


@pytest.mark.parametrize(
    ("parts", "words"),
    [({"luck": 0.1}, "no variation of 'luck'"), ({"inertia": 1.0}, "variation of inertia"),
     ({"voltage": (1.2, 0.8)}, "variation of voltage"), ({"friction": float("nan")}, "variation of friction")],
)  # fmt: skip
def test_ranges_that_are_none_are_refused(parts: dict[str, float], words: str) -> None:
    with pytest.raises(MotorError, match=words):
        Spread().changed(parts)
    with pytest.raises(MotorError, match="factors"):
        Ensemble(rig(), np.ones((3, 2)))


@compiled_only
@pytest.mark.parametrize(
    ("chosen", "lost"),
    [((240, 6020, 189), 0), ((430, 6550, 228), 6), ((1040, 4000, 35), 37)],
    ids=["found with corners", "found without corners", "made by hand"],
)
def test_corners_tell_settings_that_are_safe_from_others(chosen: tuple[int, int, int], lost: int) -> None:
    """A belt with 0.2 kg on 8 mm, a motor fitted to its curve, 5000 half steps: what a search found to be fastest."""
    motor = LARGE.changed(inductance_factor=1.71)
    rig_ = Rig(motor, Drive(24, 1.0, HALF), Load(1.5e-5, 0.02))
    steps = 5000 if chosen[0] != 1040 else 1000
    found = Ensemble(rig_, corners(SPREAD)).judge(move(*chosen, steps).train).lost
    assert int(found.sum()) == pytest.approx(lost, abs=2)


@compiled_only
@pytest.mark.parametrize("interpolation", [False, True])
def test_what_is_judged_in_pieces_is_the_same_to_the_last_bit(
    interpolation: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kernel hears no signal: it kept Ctrl-C waiting for minutes. Its work is divided, and a pause is as well."""
    from detent.motors import lockstep

    winding = microstep(8) if interpolation else HALF
    base = Rig(SMALL, Drive(24, 1.0, winding, interpolation=interpolation), Load(3.5e-6, 0.01))
    there = ramped(200 * winding.steps // 2, 250 * winding.steps, 3500 * winding.steps)
    times = np.concatenate([there, there[-1] + 400_000_001 + there])
    some, fewer = Ensemble(base, draws(WIDE, 70)), Ensemble(base, draws(SPREAD, 70))
    hardly = Ensemble(base, np.concatenate([draws(SPREAD, 330), some.factors[some.judge(times).lost][:9]]))

    def told() -> list[object]:
        found = some.judge(times)
        firsts = [many.survives(times) for many in (some, fewer, hardly)]
        return [*(np.ascontiguousarray(part).tobytes() for part in found), *firsts]

    monkeypatch.setattr(variants, "PIECE", 1 << 60)
    monkeypatch.setattr(variants, "BLOCK", 1 << 60)
    whole = told()
    calls: list[object] = []
    advance_all = lockstep.advance_all

    def counted(*words: object) -> object:
        calls.append(words)
        return advance_all(*words)

    monkeypatch.setattr(lockstep, "advance_all", counted)
    for most in (3, 100, 5000):
        monkeypatch.setattr(variants, "PIECE", 96 * most)
        monkeypatch.setattr(variants, "BLOCK", 96 * most)
        calls.clear()
        assert told() == whole
        assert len(calls) > 10


@compiled_only
def test_a_load_that_changes_is_judged_in_pieces_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    load = Load(3.5e-6, 0.01, torque_by_time=Profile(0.18, 0.01, (0.0, 0.12)))
    some = Ensemble(Rig(SMALL, Drive(24, 1.0, HALF), load), draws(WIDE, 20))
    times = np.concatenate([even(300, 200), 700_000_001 + even(50, 20)])
    monkeypatch.setattr(variants, "PIECE", 1 << 60)
    whole = [np.ascontiguousarray(part).tobytes() for part in some.judge(times)]
    for most in (3, 100, 5000):
        monkeypatch.setattr(variants, "PIECE", most)
        assert [np.ascontiguousarray(part).tobytes() for part in some.judge(times)] == whole


@given(
    gaps=st.lists(st.integers(0, 90), max_size=30), behind=st.integers(0, 200), substep=st.integers(1, 9),
    most=st.integers(1, 12),
)  # fmt: skip
@settings(max_examples=examples(200))
def test_pieces_are_short_and_keep_changes_of_one_instant_together(
    gaps: list[int], behind: int, substep: int, most: int
) -> None:
    times = np.cumsum(np.array(gaps, np.int64))
    count = len(times)
    lot = Changes(times, np.arange(count), np.ones(count), np.zeros(count, np.int64), np.zeros(count, np.int64))
    until = (int(times[-1]) if count else 0) + behind
    found = list(pieces([(lot, until)], 0, substep, most))
    assert np.concatenate([part.places for part, _ in found]).tolist() == list(range(count))
    ends = [0, *(end for _, end in found)]
    assert ends[-1] == until
    for (part, end), begin in zip(found, ends, strict=False):
        assert 0 <= end - begin <= most * substep
        assert len(set(part.times.tolist())) <= most
        assert all(begin <= time <= end for time in part.times)
        last = max([0, *(int(time) for time in times if time <= end)])
        assert end in (until, last) or (end - last) % substep == 0
    for (one, _), (other, _) in pairwise(found):
        if len(one) and len(other):
            assert one.times[-1] < other.times[0]
