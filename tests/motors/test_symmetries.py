"""What must not change, or must change in a known way, when a problem is put differently."""

from dataclasses import replace

import numpy as np
import pytest
from tests.motors.moves import LARGE, SMALL, even, ramped, rig

from detent.motors.curve import pull_out
from detent.motors.drive import Drive
from detent.motors.load import Load, Profile
from detent.motors.motor import Motor
from detent.motors.move import Part, Run, simulate
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.motors.variants import SPREAD, Ensemble, draws, judge
from detent.motors.winding import FULL, HALF, Winding, microstep
from detent.pulses import Train, Uniform
from detent.ticks import MS

MOVE = ramped(400, 400, 2600)


def path(run: Run) -> np.ndarray:  # type: ignore[type-arg]
    return run.trace[:, 1] - run.trace[0, 1]


def test_voltage_and_speed_scale_together() -> None:
    """The manual's rule: the speed axis scales with the supply; exactly so if the resistance does, too."""
    doubled = SMALL.changed(resistance=2 * SMALL.resistance)
    for rate in (500, 1500, 3000):
        once = pull_out(SMALL, Drive(24, 1.0, HALF), rate)
        assert pull_out(doubled, Drive(48, 1.0, HALF), 2 * rate).torque == pytest.approx(once.torque, rel=2e-3)


def test_time_may_run_twice_as_fast_for_a_motor_of_half_the_time_constants() -> None:
    """t / 2 with L / 2, Kt / 2 (per rad/s), J / 8: the same angles. The torque constant enters EMF and torque alike."""
    quick = SMALL.changed(
        inductance=SMALL.inductance / 2, holding_torque=SMALL.holding_torque / 2, inertia=SMALL.rotor / 8
    )
    times = even(800, 200)
    once = simulate(times, Rig(SMALL, Drive(24, 1.0, HALF), Load(), 10_000), settle=20 * MS, sample=0)
    twice = simulate(times // 2, Rig(quick, Drive(24, 1.0, HALF), Load(), 5_000), settle=10 * MS, sample=0)
    assert twice.trace[-1, 1] == pytest.approx(once.trace[-1, 1], abs=2e-3)
    assert twice.verdict.load_angle == pytest.approx(once.verdict.load_angle, abs=0.2)


def test_windings_in_parallel_at_twice_the_current_and_half_the_voltage_are_the_same_motor() -> None:
    """Series and parallel: R and L by four, I by two, the same torque (HobbyCNC 23-305-DS8A: 2.12 A against 4.2 A)."""
    series = motor("23-305-ds8a-series").changed(inertia=4.8e-5, current=2.1)
    parallel = motor("23-305-ds8a-parallel").changed(inertia=4.8e-5)
    assert (series.in_parallel().resistance, series.in_parallel().inductance, series.in_parallel().current) == (
        pytest.approx(parallel.resistance), pytest.approx(parallel.inductance), pytest.approx(parallel.current)
    )  # fmt: skip
    times = even(600, 300)
    in_series = simulate(times, Rig(series, Drive(40, 2.1, HALF), Load(friction=0.02)), sample=0)
    in_parallel = simulate(times, Rig(series.in_parallel(), Drive(20, 4.2, HALF), Load(friction=0.02)), sample=0)
    assert path(in_parallel) == pytest.approx(path(in_series), abs=1e-6)
    assert in_parallel.verdict.lost == in_series.verdict.lost


def test_backwards_is_the_mirror_of_forwards() -> None:
    """Place -k of the table is place k with phase B reversed."""
    train = Train((Uniform.at_rate(0, 900, 300),))
    forward = simulate([Part(train, 1)], rig(), sample=0)
    backward = simulate([Part(train, -1)], rig(), sample=0)
    assert path(backward) == pytest.approx(-path(forward), abs=1e-9)
    assert backward.verdict.load_angle == pytest.approx(forward.verdict.load_angle, abs=1e-7)


@pytest.mark.parametrize("winding", [FULL, HALF, microstep(4)], ids=lambda winding: winding.name)
@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_where_the_electrical_angle_is_counted_from_makes_no_difference(winding: Winding, quarters: int) -> None:
    """By full steps, as the supply limits each phase. A load by place is counted from where the rotor stood."""
    a, b = winding.a, winding.b
    for _ in range(quarters):
        a, b = tuple(-value for value in b), a
    other = Winding("turned", winding.steps, a, b, winding.offset + quarters * np.pi / 2)
    load = Load(inertia=7e-6, friction=0.03, torque_by_position=Profile(0.0, 0.02, (0.0, 0.05, 0.1, 0.05, 0.0, 0.1)))
    times = even(60 * winding.steps, 16 * winding.steps)
    once, again = (Rig(SMALL, Drive(24, 1.0, table), load) for table in (winding, other))
    one, two = simulate(times, once, sample=0), simulate(times, again, sample=0)
    assert path(two) == pytest.approx(path(one), abs=1e-6)
    assert two.verdict.lost is one.verdict.lost is False
    assert judge(times, [again])[0].load_angle == pytest.approx(one.verdict.load_angle, abs=1e-3)


def test_four_full_steps_further_everything_is_the_same() -> None:
    there = Train((Uniform.at_rate(0, 200, 8),))
    later = Train((Uniform.at_rate(0, 700, 100),), start=(1 << 60) * 400 * MS)
    alone = Train((Uniform.at_rate(0, 700, 100),))
    moved = simulate([Part(there), Part(later)], rig(friction=0.0, viscous=2e-3), sample=0)
    plain = simulate(alone, rig(friction=0.0, viscous=2e-3), sample=0)
    assert moved.verdict.error == pytest.approx(plain.verdict.error, abs=0.02)
    late = moved.times > 0.4
    assert np.abs(moved.load_angles[late]).max() == pytest.approx(np.abs(plain.load_angles).max(), abs=1)
    assert moved.trace[-1, 1] - plain.trace[-1, 1] == pytest.approx(2 * np.pi, abs=0.03)


def test_a_weight_that_pulls_back_leaves_the_rotor_behind_and_friction_holds_where_it_is() -> None:
    held = simulate(even(100, 1), rig(friction=0.0, viscous=5e-3, torque=0.05), settle=400 * MS)
    assert held.verdict.error > 0.05
    assert simulate(even(100, 1), rig(friction=0.0, viscous=5e-3, torque=-0.05), settle=400 * MS).verdict.error < -0.05
    assert abs(simulate(even(100, 1), rig(friction=0.0, viscous=5e-3), settle=400 * MS).verdict.error) < 1e-3


@pytest.mark.parametrize("which", ["time", "position"])
def test_a_torque_that_comes_up_on_the_way_loses_the_move_there(which: str) -> None:
    """Constant speed: 100 pulses, then more than the motor can give."""
    wall = Profile(0.18, 0.01, (0.0, 0.5)) if which == "time" else Profile(1.5, 0.05, (0.0, 0.5))
    load = replace(rig().load, **{f"torque_by_{which}": wall})
    run = simulate(even(500, 200), Rig(SMALL, Drive(24, 1.0, HALF), load))
    assert run.verdict.lost
    assert 80 < (run.verdict.lost_pulse or 0) < 140
    assert not simulate(even(500, 80), Rig(SMALL, Drive(24, 1.0, HALF), load), settle=1 * MS).verdict.lost


@pytest.mark.parametrize("which", [SMALL, LARGE])
def test_more_inertia_more_friction_less_voltage_never_help_a_hard_start(which: Motor) -> None:
    """Not a law at every speed (resonance), but at a start near the limit."""

    def lost(voltage: float, inertia: float) -> bool:
        one = Rig(which, Drive(24 * voltage, 1.0, HALF), Load(inertia=which.rotor * inertia, friction=0.01))
        return simulate(even(3200, 400), one, settle=0).verdict.lost

    assert [lost(1, inertia) for inertia in (0.0, 8.0)] == [False, True]
    assert [lost(voltage, 0.2) for voltage in (1.0, 0.3)] == [False, True]


@pytest.mark.parametrize("inertia", [1e-5, 1e-3, 3e-2])
@pytest.mark.parametrize("friction", [0.0, 0.02])
def test_no_verdict_hangs_on_how_long_a_rotor_gets_to_settle(inertia: float, friction: float) -> None:
    """Constant speeds, left at once: a heavy rotor has hardly begun to swing when a light one stands."""
    one = Rig(SMALL, Drive(24, 1.0, HALF), Load(inertia=inertia, friction=friction))
    natural = SMALL.natural_frequency(inertia)
    variants = Ensemble(one, draws(SPREAD, 32))
    lost = set()
    for octaves in range(-4, 21):
        times = even(natural * 2 ** (octaves / 4), 24)
        soon, late = simulate(times, one).verdict, simulate(times, one, settle=8 * one.settle).verdict
        assert soon.lost == late.lost, (octaves, str(soon), str(late))
        assert judge(times, [one])[0].lost == soon.lost
        both = [variants.judge(times, settle=settle).lost for settle in (None, 8 * one.settle)]
        assert np.array_equal(*both), octaves
        lost.add(soon.lost)
    assert lost == {False, True}
