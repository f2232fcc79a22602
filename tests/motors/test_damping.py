"""Damping about the speed of the pulses: what it mends, and what it must leave as it is."""

import numpy as np
import pytest
from tests.motors.moves import LARGE, SMALL, even

from detent.motors import engine
from detent.motors.curve import torque_curve
from detent.motors.damping import CHOPPER, UNDAMPED, VOLTAGE, Damping, given
from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.motor import MotorError
from detent.motors.move import simulate
from detent.motors.named import MOTORS
from detent.motors.rotor import Rig
from detent.motors.variants import SPREAD, Ensemble, draws, judge
from detent.motors.winding import FULL, HALF
from detent.ramps.constant_acceleration import move
from detent.ticks import MS

pytestmark = pytest.mark.skipif(not engine.fast(), reason="numba is not installed")


def rigs(damping: Damping, decay: str) -> list[Rig]:
    """Nine motors with 1, 2 and 5 times the inertia of the rotor, without friction and with 2 % of the torque."""
    return [
        Rig(
            motor,
            Drive(24, motor.current, FULL, decay),  # type: ignore[arg-type]
            Load(motor.rotor * (heavy - 1), part * motor.holding_torque),
            damping=damping,
        )
        for motor in MOTORS.values()
        if motor.inertia is not None
        for heavy in (1, 2, 5)
        for part in (0, 0.02)
    ]


def lost(pulses, damping: Damping) -> int:  # type: ignore[no-untyped-def]
    return sum(verdict.lost for decay in ("fast", "slow") for verdict in judge(pulses, rigs(damping, decay)))


RAMPS = {(100, 400): 5, (200, 800): 0, (100, 1000): 0}


@pytest.mark.parametrize("ramp", RAMPS)
def test_nearly_all_motors_make_an_ordinary_slow_move(ramp: tuple[int, int]) -> None:
    """Of 108 combinations; without damping 80, 32 and 54 lose steps."""
    pulses = move(*ramp, 50, 1000).train
    assert lost(pulses, CHOPPER) == pytest.approx(RAMPS[ramp], abs=2)
    assert lost(pulses, UNDAMPED) > 20


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "count"), [(100, 12), (150, 0), (200, 0), (300, 0)])
def test_nearly_all_motors_run_at_a_constant_low_speed(rate: int, count: int) -> None:
    assert lost(even(rate, 1000), CHOPPER) == pytest.approx(count, abs=2)


def test_a_move_from_low_speed_is_not_lost_in_the_resonance() -> None:
    """1000 full steps, 100 to 400 steps/s in ramps of 50, with the rotor's inertia again as load."""
    pulses = move(100, 400, 50, 1000).train

    def rig(damping: Damping | None) -> Rig:
        return Rig(LARGE, Drive(24, 1.0, FULL), Load(LARGE.rotor), damping=damping)

    assert simulate(pulses, rig(UNDAMPED)).verdict.lost
    assert not simulate(pulses, rig(None)).verdict.lost


def test_torque_at_a_speed_is_the_same_with_and_without() -> None:
    """It is no drag: a rotor that turns evenly with its pulses feels none of it."""
    rates = (100, 500, 1500, 4000)
    free, damped = (LARGE.changed(damping=ratio) for ratio in (0.0, 0.5))
    assert torque_curve(free, Drive(24, 1.0), rates) == torque_curve(damped, Drive(24, 1.0), rates)
    # nor in motion: behind a gentle ramp the load angle is the same
    angles = []
    for damping in (Damping(0.06), Damping(0.24)):
        rig = Rig(SMALL, Drive(24, 1.0, HALF), Load(SMALL.rotor, friction=0.02, viscous=1e-3), damping=damping)
        run = simulate(move(100, 1500, 600, 3000).train, rig, sample=MS // 10)
        steady = (run.times > 1.2) & (run.times < 1.4)
        angles.append(float(run.load_angles[steady].mean()))
    assert angles[0] == pytest.approx(angles[1], abs=0.1)


def test_the_resonance_of_the_middle_speeds_is_still_there() -> None:
    """The large motor, slow decay, twice its inertia: lost somewhere in 4000 to 8000 half steps/s, and not above."""
    rig = Rig(LARGE, Drive(24, 1.0, HALF, "slow"), Load(LARGE.rotor), damping=given(0.10))
    some = Ensemble(rig, draws(SPREAD.of(rig), 32))
    counts = [int(some.judge(move(1000, top, 600, 6000).train).lost.sum()) for top in (2000, 4500, 5000, 10_000)]
    assert counts[0] == 0
    assert max(counts[1:3]) >= 3
    assert counts[3] == 0


def test_what_is_assumed_depends_on_the_drive_and_is_said() -> None:
    assert Rig(SMALL, Drive(24, 1.0)).damping == CHOPPER
    assert Rig(SMALL, Drive(24, 1.0, HALF, "voltage")).damping == VOLTAGE
    assert "not measured" in str(CHOPPER)
    own = Rig(SMALL.changed(damping=0.2), Drive(24, 1.0)).damping
    assert own is not None
    assert (own.ratio, own.source) == (0.2, "from the motor's data")
    for wrong in (-0.1, 3.0, float("nan")):
        with pytest.raises(MotorError, match="damping"):
            given(wrong)


@pytest.mark.parametrize("pieces", [1, 3, 10])
def test_it_knows_only_pulses_that_have_come(pieces: int) -> None:
    """Whoever tells the pulses one by one gets the same rotor: see the kernel's own test; here with a pause."""
    times = np.concatenate((even(700, 30), even(700, 30) + 200 * MS))
    rig = Rig(SMALL, Drive(24, 1.0, HALF), Load(SMALL.rotor), damping=given(0.3))
    whole = simulate(times, rig, sample=0).trace
    part = simulate(times[: len(times) * pieces // 10], rig, settle=0, sample=0).trace
    assert np.array_equal(whole[: len(part) - 1], part[:-1])
    assert abs(simulate(times, rig).verdict.error) < 0.01  # nothing drives it on behind the last pulse
