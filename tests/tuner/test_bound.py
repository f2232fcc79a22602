"""The bound is one: no rotor without lag is faster, whatever the load does and however finely speeds are looked at."""

from dataclasses import replace

import pytest

from detent.motors.drive import Drive
from detent.motors.load import Load, profile
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.tuner import quasi_static
from detent.tuner.quasi_static import fastest, torque_of

MOTOR = motor("qsh4218-41-10-035")
STEADY = Load(inertia=1.5e-5, friction=0.02)
DISTANCES = (20, 200, 2000, 20_000, 200_000)


def rig(load: Load) -> Rig:
    return Rig(MOTOR, Drive(24, 1.0), load)


@pytest.mark.parametrize("by", ["torque_by_time", "torque_by_position"])
def test_a_load_that_changes_is_bound_by_its_best_moments(by: str) -> None:
    """It begins heavy: a move made where it is light may be faster than the start allows."""
    changing = replace(STEADY, **{by: profile([(0.0, 0.15), (0.5, -0.05), (1.0, 0.1)])})  # type: ignore[arg-type]
    assert changing.ends() == (-0.05, 0.15)
    limit = fastest(torque_of(rig(changing)), DISTANCES)
    for torque in (-0.05, 0.0, 0.1, 0.15):
        steady = fastest(torque_of(rig(replace(STEADY, torque=torque))), DISTANCES)
        assert all(least <= time for least, time in zip(limit, steady, strict=True))


def test_a_steady_load_is_bound_as_before() -> None:
    torque = torque_of(rig(replace(STEADY, torque=0.05)))
    assert (torque.less, torque.more) == (0.0, 0.0)


def test_the_top_speed_is_no_point_of_a_grid(monkeypatch: pytest.MonkeyPatch) -> None:
    coarse = fastest(torque_of(rig(STEADY)), DISTANCES)
    monkeypatch.setattr(quasi_static, "RATIO", 1.06)
    fine = fastest(torque_of(rig(STEADY)), DISTANCES)
    assert all(least <= 1.002 * time for least, time in zip(coarse, fine, strict=True))
    assert all(least == pytest.approx(time, rel=0.1) for least, time in zip(coarse, fine, strict=True))
