"""What the Motion page computes: moves by the laws of the controllers, and what a motor makes of them."""

import numpy as np
import pytest

from detent.controllers.catalogue import MODELS
from detent.motors.drive import Drive
from detent.motors.motor import MotorError
from detent.motors.named import motor
from detent.moves import laws
from detent.ramps import constant_acceleration, timer_table
from detent.workbench import motion


def test_a_move_of_a_gsc200_has_the_times_of_its_ramp() -> None:
    """Datasheet, example 2: S10 T100 R40; 500 steps with ramps of 40 from 100 to 1000 steps/s."""
    law = laws.law("gs-c200")
    drawn = motion.picture(law.train({"S": 10, "T": 100, "R": 40}, 500))
    assert drawn.duration == constant_acceleration.move(100, 1000, 40, 500).train.duration
    assert drawn.peak == pytest.approx(1000)
    assert drawn.reached
    # constant acceleration: 40 steps at a mean of 550 steps/s, then 420 at 1000
    assert drawn.ramps[0] == pytest.approx(40 / 550, abs=1e-6)
    assert drawn.duration * 1e-9 == pytest.approx(2 * 40 / 550 + 0.42, abs=1e-6)
    assert drawn.mean == pytest.approx(500 / (drawn.duration * 1e-9))


def test_acceleration_is_that_of_the_law() -> None:
    """(1000**2 - 100**2) / 80 steps/s2 on the way up, none at the slew speed, as much again on the way down."""
    law = laws.law("gs-c200")
    at, values = motion.picture(law.train({"S": 10, "T": 100, "R": 40}, 500)).accelerations
    up, cruise, down = at < 0.07, (at > 0.08) & (at < 0.48), at > 0.5
    for where, expected in ((up, 12375), (cruise, 0), (down, -12375)):
        assert values[where] == pytest.approx(expected, abs=20)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("steps", [1, 2, 3, 50, 1234])
def test_accelerations_are_finite_and_add_up_to_the_speeds(model: str, steps: int) -> None:
    law = laws.law(model)
    drawn = motion.picture(law.train(law.values, steps))
    at, values = drawn.accelerations
    assert np.isfinite(values).all()
    assert (np.diff(at) > 0).all()
    if steps > 1000:
        gained = np.concatenate(([0], np.cumsum((values[1:] + values[:-1]) / 2 * np.diff(at)))).max()
        assert gained == pytest.approx(drawn.peak - drawn.speeds[0], rel=0.15)


def test_a_move_too_short_for_the_slew_speed_says_so() -> None:
    """Datasheet: "the ramping is reversed before the maximum speed"."""
    law = laws.law("gs-c200")
    drawn = motion.picture(law.train({"S": 10, "T": 100, "R": 40}, 30))
    assert drawn.peak < 1000
    assert not drawn.reached


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("steps", [1, 2, 3, 50, 1234])
def test_a_picture_begins_at_rest_ends_at_the_last_pulse_and_never_goes_back(model: str, steps: int) -> None:
    law = laws.law(model)
    drawn = motion.picture(law.train(law.values, steps))
    assert drawn.times[0] == 0
    assert drawn.times[-1] == pytest.approx(drawn.duration * 1e-9)
    assert (np.diff(drawn.times) > 0).all()
    assert (np.diff(drawn.positions) >= 0).all()
    assert drawn.positions[-1] == steps
    assert (drawn.speeds > 0).all()
    assert len(drawn.times) < 2 * motion.COLUMNS


def test_the_longest_moves_cost_no_more_than_short_ones() -> None:
    for name in MODELS:
        law = laws.law(name)
        assert len(motion.picture(law.train(law.values, law.most)).times) < 2 * motion.COLUMNS


def test_the_speeds_of_a_dcb274_are_those_that_its_timer_makes() -> None:
    """Page 65: speeds are counts of an 8 036 ns timer, which X prints as they really are (page 52)."""
    law = laws.law("dcb-274")
    values = {**law.values, "V": 5000, "I": 400}
    drawn = motion.picture(law.train(values, 5000))
    assert drawn.peak == pytest.approx(1e9 / (timer_table.TICK * timer_table.count_of(5000)))
    assert drawn.peak != pytest.approx(5000, abs=1)


def test_the_divisor_of_a_dcb274_divides_all_speeds() -> None:
    """Page 37: "Divide speeds"."""
    law = laws.law("dcb-274")
    once = motion.picture(law.train(law.values, 2000))
    twice = motion.picture(law.train({**law.values, "D": 2}, 2000))
    assert twice.duration == 2 * once.duration
    assert twice.peak == pytest.approx(once.peak / 2)


def test_genstepper_begins_with_its_options_and_ramps_by_p() -> None:
    """BS0610 manual, pages 29, 31 and 32: K, P and R in microsteps/s; on a ramp P is added every second."""
    law = laws.law("bs0610", {"ramp": "4000", "run_rate": "1000"})
    assert law.values == {"K": 80, "R": 1000, "P": 4000}
    drawn = motion.picture(law.train(law.values, 3000))
    assert drawn.ramps[0] == pytest.approx((1000 - 80) / 4000, abs=1e-3)


def test_a_supersigma_is_limited_by_its_command_or_else_by_its_table() -> None:
    """Cassinis, "Other features": move with ramps, at no more than the speed."""
    law = laws.law("supersigma")
    assert law.commands({"limit": 255}, 400) == ((), "move +400")
    assert law.commands({"limit": 60}, 400) == ((), "limit +400 60")
    drawn = motion.picture(law.train({"limit": 60}, 4000))
    assert drawn.peak <= 6000
    assert motion.picture(law.train({"limit": 255}, 20000)).peak == pytest.approx(15037.6, abs=0.1)


def rig(friction: float = 0.0) -> motion.Rig:
    found = motor("qsh4218-41-10-035")
    half = laws.law("gs-c200").windings[0]
    return motion.rig(found, Drive(24, found.current, half), inertia=found.rotor, friction=friction)


def test_a_gentle_move_is_followed_and_a_steep_one_is_lost() -> None:
    law = laws.law("gs-c200")
    assert not motion.judged(law.train({"S": 10, "T": 150, "R": 60}, 300), rig()).lost
    assert motion.judged(law.train({"S": 10, "T": 900, "R": 3}, 300), rig(0.1)).lost


def test_what_a_move_asks_is_inertia_times_acceleration_and_friction() -> None:
    """Constant acceleration from 100 to 1000 steps/s in 40 steps: (1000**2 - 100**2) / 80 steps/s2."""
    law, motor_rig = laws.law("gs-c200"), rig(0.02)
    asked = motion.demand(motion.picture(law.train({"S": 10, "T": 100, "R": 40}, 500)), motor_rig)
    radians = 2 * np.pi / 400  # half steps of a motor with 200 steps
    inertia = motor_rig.motor.rotor + motor_rig.load.inertia
    expected = inertia * (1000**2 - 100**2) / 80 * radians + 0.02
    assert asked.torques.mean() == pytest.approx(expected, rel=0.02)
    assert asked.speeds[0] == pytest.approx(100)
    assert asked.speeds[-1] == pytest.approx(1000, rel=1e-3)


def test_the_torque_curve_reaches_beyond_the_move_and_falls() -> None:
    points = motion.torque_curve(rig(), 2000.0)
    assert points[0].rate < 200
    assert points[-1].rate > 2000 or points[-1].torque <= 0
    assert points[-1].torque < points[0].torque


def test_a_move_that_would_take_minutes_to_judge_is_refused_with_a_remedy() -> None:
    law = laws.law("gs-c200")
    with pytest.raises(MotorError, match="make it shorter"):
        motion.judged(law.train({"S": 1, "T": 2, "R": 1}, 100_000), rig())


def test_a_motor_without_rotor_inertia_needs_one_for_the_whole() -> None:
    found = motor("qsh4218-41-10-035").changed(inertia=None)
    half = laws.law("gs-c200").windings[0]
    with pytest.raises(MotorError, match="rotor and load together"):
        motion.rig(found, Drive(24, 1.0, half), inertia=0.0, friction=0.0)
