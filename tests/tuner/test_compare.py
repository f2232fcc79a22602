"""Settings beside each other are judged as the search judges them."""

import numpy as np
import pytest

from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.moves.law import winding_of
from detent.moves.laws import law
from detent.moves.spelling import read
from detent.tuner.compare import compare, torque_used
from detent.tuner.quasi_static import torque_of
from detent.tuner.task import Task, moves_of


def test_a_hanging_load_is_compared_on_its_way_down_too() -> None:
    """The ramp down is as steep as it can be: with the load against the pulses it helps to brake, and else not."""
    rig = Rig(motor("qsh4218-41-10-035"), Drive(24, 1.0), Load(inertia=1.5e-5, friction=0.02, torque=0.1))
    task = Task("dcb-274", rig, moves_of("400"), at_corners=False, final=32)
    steep, gentle = (
        found.check.lost
        for found in compare(task, [(k, *read("dcb-274", ["I=600", "V=5000", k])) for k in ("K=2,1", "K=20,20")])
    )
    assert gentle == 0
    assert steep > 16


@pytest.mark.parametrize("slope", [10_000, 30_000, 62_500])
@pytest.mark.parametrize("run", [8_000, 20_000, 60_000])
def test_the_torque_used_is_that_of_the_ramp_and_not_of_the_ticks(run: int, slope: int) -> None:
    """A board gives each pulse at one of its ticks of 16 us; its speed rises evenly all the same."""
    made = law("bs0610")
    rig = Rig(motor("qsh4218-41-10-035"), Drive(24, 1.0, winding_of(made, None)), Load(inertia=1.5e-5))
    torque = torque_of(rig)
    train = made.train({"K": 1000, "R": run, "P": slope}, 2 * run**2 // slope)
    _, speeds, used = torque_used(train, torque)
    needed = slope * torque.inertia * torque.radians / np.interp(speeds, torque.speeds, torque.available)
    # it was up to 34 times as much; 0.4 % of the pull-out torque nobody sees
    assert np.all(np.abs(used) <= np.maximum(1.2 * needed, needed + 0.004))
    assert np.abs(used).max() > 0.8 * needed.max()
