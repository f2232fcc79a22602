"""The rig of the reference: what the search must reach there, with variants that it has never met."""

import pytest

from detent.motors.drive import Drive
from detent.motors.fit import fitted
from detent.motors.load import Load
from detent.motors.rotor import Rig
from detent.tuner.judge import judge_of
from detent.tuner.task import Task, moves_of
from detent.tuner.tune import check_of, rival, tune

FRESH = 16_384


def task(moves: str = "200,1000,5000") -> Task:
    fit = fitted("qsh4218-41-10-035")
    assert fit is not None
    return Task("gs-c200", Rig(fit.motor, Drive(24, 1.0), Load(inertia=1.5e-5, friction=0.02)), moves_of(moves))


def test_the_settings_that_are_known_to_be_safe_are_lossless_and_those_by_hand_are_not() -> None:
    judge = judge_of(task("200,1000"))
    safe, hand = rival(judge, (48, 604, 202), 128), rival(judge, judge.space.hand, 128)
    assert safe is not None
    assert hand is not None
    assert safe.lost == 0 < hand.lost
    assert check_of(judge, (48, 604, 202), 64, 1000).lost == 0


@pytest.mark.slow
def test_the_moves_of_the_reference_take_at_most_so_long_and_no_fresh_variant_loses_them() -> None:
    made = task()
    found = tune(made).found
    assert found.time <= 1.21
    check = check_of(judge_of(made), found.point, FRESH, 10**6)
    assert (check.lost, check.corners_lost, check.corners) == (0, 0, 128)
