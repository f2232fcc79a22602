"""Impossible data are refused with the reason and the remedy; no result is ever not a number."""

from math import inf, isfinite, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples
from tests.motors.moves import SMALL, even, rig

from detent.motors.curve import pull_out
from detent.motors.drive import Currents, Drive
from detent.motors.fit import fit_from_curve, fitted
from detent.motors.load import Load, Profile
from detent.motors.motor import Motor, MotorError
from detent.motors.move import Part, simulate
from detent.motors.named import MOTORS, motor
from detent.motors.rotor import Rig
from detent.motors.variants import changed, judge
from detent.motors.winding import HALF, microstep, winding
from detent.pulses import Train, Uniform


@pytest.mark.parametrize("value", [0.0, -1.0, nan, inf, True, "5"])
@pytest.mark.parametrize("name", ["resistance", "inductance", "current", "holding_torque", "inertia"])
def test_a_motors_numbers_are_positive(name: str, value: object) -> None:
    with pytest.raises(MotorError, match=name.replace("_", " ")):
        SMALL.changed(**{name: value})


def test_wrong_units_are_noticed() -> None:
    with pytest.raises(MotorError, match=r"inductance is in H \(a sheet's 2.8 mH is 0.0028\)"):
        SMALL.changed(inductance=6.6)
    with pytest.raises(MotorError, match="check the units"):
        SMALL.changed(detent_torque=0.3)
    with pytest.raises(MotorError, match="a multiple of 4"):
        SMALL.changed(steps=201)
    with pytest.raises(MotorError, match="check the units"):
        Rig(SMALL.changed(inertia=1e-15), Drive(24, 1.0))
    with pytest.raises(MotorError, match="more than four times"):
        Rig(SMALL.changed(resistance=0.5), Drive(24, 10.0))


def test_a_supply_below_the_windings_need_is_refused_with_what_it_could_drive() -> None:
    with pytest.raises(
        MotorError, match=r"4 V cannot drive 1 A through the 5.3 ohm.*needs 5.3 V.*lower the current to 0.755 A"
    ):
        Rig(SMALL, Drive(4, 1.0, HALF))
    Rig(SMALL, Drive(4, 0.75, HALF))
    with pytest.raises(MotorError, match="nothing is left"):
        Drive(2.0, 1.0, drop=2.0)
    for wrong in (0.0, -24.0, nan):
        with pytest.raises(MotorError, match="supply"):
            Drive(wrong, 1.0)
    with pytest.raises(MotorError, match="current factor"):
        Drive(24, 1.0, currents=Currents(rest=-1))
    with pytest.raises(MotorError, match="no decay 'quick'; there are: fast, slow, mixed, auto, voltage"):
        Drive(24, 1.0, decay="quick")  # type: ignore[arg-type]


def test_a_load_beyond_the_motor_is_refused_at_rest_and_lost_in_motion() -> None:
    with pytest.raises(MotorError, match=r"more than the .* Nm that qsh4218-35-10-027 holds at rest"):
        simulate(even(100, 3), rig(torque=0.5))
    with pytest.raises(MotorError, match="inertia is -1"):
        Load(inertia=-1)
    with pytest.raises(MotorError, match="torque by time"):
        Load(torque_by_time=Profile(0, 0, (1.0, 2.0)))


def test_a_move_without_an_end_and_pulses_out_of_order_are_refused() -> None:
    endless = Train((Uniform.at_rate(0, 500, None),))
    with pytest.raises(MotorError, match="the move has no end: say how many"):
        simulate(endless, rig())
    assert simulate([Part(endless, 1, 1, 50)], rig()).pulses == 50
    with pytest.raises(MotorError, match="rising"):
        simulate(np.array([3, 2, 1]), rig())
    with pytest.raises(MotorError, match="come before"):
        simulate([Part(Train((Uniform.at_rate(0, 500, 5),)))] * 2, rig())
    with pytest.raises(MotorError, match="more than can be computed"):
        simulate(Train((Uniform.at_rate(0, 1, 10**7),)), rig())


def test_unknown_names_come_with_the_likeliest_other() -> None:
    with pytest.raises(MotorError, match="did you mean qsh4218-41-10-035"):
        motor("qsh4218-41")
    with pytest.raises(MotorError, match="no stepping '1/3x'"):
        winding("1/3x")
    with pytest.raises(MotorError, match="1 to 64, not by 128"):
        winding("1/128")
    with pytest.raises(MotorError, match="no published curve"):
        fitted("as1060")
    with pytest.raises(MotorError, match="at least three speeds"):
        fit_from_curve(SMALL, Drive(24, 1.0), [(100, 0.2), (200, 0.2)])
    with pytest.raises(MotorError, match="does not belong to a motor"):
        fit_from_curve(SMALL, Drive(24, 1.0), [(100, 0.2), (200, 0.2), (300, 20)])
    with pytest.raises(MotorError, match="no variant of 'luck'"):
        changed(rig(), luck=2)
    with pytest.raises(MotorError, match="gives no rotor inertia"):
        Rig(MOTORS["23-305-ds8a-series"], Drive(40, 2.0))
    for rate in (0.0, nan, 1e9):
        with pytest.raises(MotorError, match="a speed is"):
            pull_out(SMALL, Drive(24, 1.0), rate)


def test_variants_must_share_what_the_pulses_go_through() -> None:
    other = Rig(SMALL, Drive(24, 1.0, microstep(4)))
    with pytest.raises(MotorError, match="must be the same"):
        judge(even(100, 3), [rig(), other])
    assert judge(even(100, 3), []) == []


@settings(max_examples=examples(40), deadline=None)
@given(
    st.floats(0.05, 50), st.floats(1e-5, 0.05), st.floats(0.1, 10), st.floats(0.01, 20), st.floats(1e-8, 1e-2),
    st.floats(5, 200), st.sampled_from(["fast", "slow", "voltage"]), st.floats(20, 20_000), st.integers(1, 60),
)  # fmt: skip
def test_whatever_the_numbers_the_verdict_is_one(
    ohm: float,
    henry: float,
    amps: float,
    torque: float,
    inertia: float,
    supply: float,
    decay: str,
    rate: float,
    count: int,
) -> None:
    try:
        made = Motor("some", ohm, henry, amps, torque, inertia)
        one = Rig(made, Drive(supply, amps, HALF, decay), Load(friction=torque / 50))  # type: ignore[arg-type]
    except MotorError:
        return
    verdict = simulate(even(rate, count), one, settle=1_000_000).verdict
    assert isfinite(verdict.load_angle)
    assert isfinite(verdict.error)
    assert verdict.lost == (verdict.load_angle > 360 or verdict.slip != 0)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("wrong", [1e308, 1e7, 1e-300, 0.0, -1.0, float("nan"), float("inf")])
@pytest.mark.parametrize("where", [0, 1])
def test_a_point_of_a_curve_that_no_motor_has_is_refused_in_a_line(wrong: float, where: int) -> None:
    point = (wrong, 0.2) if where == 0 else (300.0, wrong or 1e3)
    if point != (300.0, 1e-300):  # so little torque there is
        with pytest.raises(MotorError, match="does not belong to a motor of"):
            fit_from_curve(SMALL, Drive(24, 1.0), [(100, 0.2), (200, 0.2), point])
