"""Settings beside each other are judged as the search judges them."""

from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.moves.spelling import read
from detent.tuner.compare import compare
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
