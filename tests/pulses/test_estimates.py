"""What is estimated in float64 lies within its guard of the truth, whichever way it is estimated."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.pulses import Accelerating, Train, Uniform, ramp_arrays, ramp_estimates, short
from detent.pulses.settling import FARTHEST, MOST_PLACES, scale_for
from detent.ramps.constant_acceleration import move
from detent.ticks import HALF_NS, ONE_NS, to_fixed

LAWS = {
    "rooted": Accelerating(to_fixed(10**14) + 777, 0, 40_000, 0, 20_000),
    "rooted, down": Accelerating(to_fixed(10**14) + 777, 3, 40_000, 0, 20_000, up=False),
    "divided": Accelerating(HALF_NS, 0, 40, 0, 70_000),
    "divided, slow": Accelerating(to_fixed(10**17), 1, Fraction(1, 10**4), 0, 70_000, up=False),
    "rows": Accelerating(5, 0, 1000, 10**6, 10**6 + 200_000),
    "rows, down": Accelerating(to_fixed(10**14) + 777, 100, Fraction(541, 7), 10**6, 10**6 + 200_000, up=False),
    "rows, hardly a ramp": Accelerating(0, 9999, Fraction(1, 10**9), 10**9, 10**9 + 200_000),
    "rows, fast": Accelerating(0, 10**6, 10**9, 10**6, 10**6 + 200_000),
}


@pytest.mark.parametrize("name", LAWS)
def test_every_way_to_estimate_a_ramp_stays_within_half_its_guard(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    law, seen, done = LAWS[name], set(), 0
    ways = dict(ramp_estimates.WAYS)
    settle = ramp_arrays.settle
    for way, function in ways.items():
        monkeypatch.setitem(
            ramp_estimates.WAYS, way, lambda chunk, work, w=way, f=function: (seen.add(w), f(chunk, work))[1]
        )

    def check(out, estimate, scale, base, exact, guard=4):
        nonlocal done
        plain = estimate.copy()
        settle(out, estimate, scale, base, exact, guard)
        for i in {*range(0, len(plain), 499), len(plain) - 1}:
            truth = Fraction(law.fixed(done + i + 1) + HALF_NS, ONE_NS) - base
            off = (Fraction(plain[i]) - Fraction(scale.magic)) - truth - Fraction(scale.unit) * guard
            assert abs(off) <= Fraction(scale.unit) * guard / 2, (i, float(off / Fraction(scale.unit)))
        done += len(plain)

    monkeypatch.setattr(ramp_arrays, "settle", check)
    ramp_arrays.fill_ramp(np.empty(law.steps, np.int64), 1, law, 0)
    assert done == law.steps
    assert name.split(",")[0] in seen


@given(st.floats(0, FARTHEST))
def test_a_scale_has_room_for_its_reach_and_no_unit_is_finer_than_its_errors(reach: float) -> None:
    scale = scale_for(reach)
    assert 0 < scale.places <= MOST_PLACES
    assert scale.unit >= reach * 2.0**-51
    for estimate in (-reach, 0.0, 0.5, reach):
        bits = int(np.float64(estimate + scale.magic).view(np.int64))
        assert abs((bits >> scale.places) - scale.offset - estimate) <= 1


starts = st.one_of(st.just(0), st.integers(0, 10**18).map(to_fixed), st.integers(0, 10**30))


@given(st.integers(1, 1000), st.integers(1, 1000), st.integers(1, 999), st.integers(1, 6000), starts)
@settings(max_examples=examples(60))
def test_a_move_asked_as_a_whole_gives_what_each_pulse_gives(start_stop, slew, ramp, steps, start) -> None:
    train = move.__wrapped__(10 * start_stop, 10 * slew, ramp, steps).train.at(start)
    out = np.zeros(steps, np.int64)
    if short.fill(out, train.segments, [0, *np.cumsum([s.steps for s in train.segments])[:-1].tolist()], start):
        assert out.tolist() == [train.time_of(n) for n in range(1, steps + 1)]
    assert train.times().tolist() == [train.time_of(n) for n in range(1, steps + 1)]
    assert train.times().tolist() == [train.time_of(n) for n in range(1, steps + 1)]  # kept


def test_ties_of_a_short_train_are_settled_by_the_exact_law() -> None:
    # from standstill with gain = 16e18 a quarter of 2 sqrt(x) ns, periods of 5/2 ns: ties all along
    up = Accelerating(0, 0, 16 * 10**18, 0, 100)
    train = Train((up, Uniform(up.end, 5, 2, 30), Accelerating(to_fixed(100), 0, 16 * 10**18, 0, 100, up=False)))
    for start in (0, 1, -1, HALF_NS, HALF_NS - 1, HALF_NS + 1, to_fixed(10**12)):
        times = train.at(start).times()
        assert times.tolist() == [train.at(start).time_of(n) for n in range(1, 231)]
        assert short.fill(times, train.segments, [0, 100, 130], start)


def test_what_is_too_long_to_be_asked_as_a_whole_says_so() -> None:
    out = np.zeros(10, np.int64)
    assert not short.fill(out, (Uniform.at_rate(0, 1, 10),) * 9, list(range(9)), 0)
    assert not short.fill(out, (Uniform(0, 10**12, 1, 10),), [0], 0)
    assert not short.fill(out, (Uniform.at_rate(0, 1, 10**6),), [0], 0)
    assert not short.fill(out, (Accelerating(0, 1, 1, 10**6, 10**6 + 10),), [0], 0)
    assert not out.any()


laws = st.one_of(
    st.builds(lambda n, d: Uniform(0, n, d, 100), st.integers(10**3, 10**9), st.integers(1, 100)),
    st.builds(
        lambda slow, gain, low, up: Accelerating(to_fixed(10**13), slow, gain, low, low + 100, up),
        st.fractions(0, 10**5, max_denominator=20),
        st.fractions(1, 10**7, max_denominator=20),
        st.integers(0, 100),
        st.booleans(),
    ),
)


@given(laws, starts, st.integers(1, 99), st.floats(0, 1))
def test_the_quick_state_is_that_of_the_law(law, start: int, n: int, between: float) -> None:
    """Steps are exact; phase and speed are the law's to some rounding errors."""
    train = Train((law,), start)
    t = train.time_of(n) + int(between * (train.time_of(n + 1) - train.time_of(n)))
    state = train.state_at(t)
    done, rate = law.progress(to_fixed(t) - start)
    assert state.steps == train.steps_by(t)
    assert state.steps + state.phase == pytest.approx(done, rel=1e-9, abs=2 * rate * 1e-9)
    assert state.rate == pytest.approx(rate, rel=1e-9)
