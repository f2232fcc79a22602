"""The paper's result, as far as its data go: a 34-frame motor at 27 000 half steps a second without a loss.

The paper names its motor (Rapid-Syn 34D-9209A) without resistance, inductance, torque or supply, and no curve to
27 000. Assumed: a 34-frame motor of 5 Nm from a maker's sheet (Beckhoff AS1060), its inductance 1.8 times the sheet's
as in the published curves, its windings in parallel, 160 V; no load but its own rotor; the paper's curve from 650,
stretched to end at 27 000 after the same 0.3 s.
"""

from dataclasses import replace
from math import asin, pi, sqrt

import numpy as np
import pytest

from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.move import simulate
from detent.motors.named import motor
from detent.motors.rotor import FINE, Rig
from detent.motors.variants import changed, judge, loss_rate
from detent.motors.winding import HALF
from detent.pulses import Train
from detent.ramps.constant_acceleration import move
from detent.ramps.curves import sine_squared
from detent.ramps.differences import compiled
from detent.ramps.table_movement import ramped
from detent.ticks import MS

LOW, RAMP = 650.0, 0.3


def supersigma(top: float, steps: int) -> Train:
    """The drive's pulses: a table of the curve V = top sin^2(...) from 650 to `top` in 0.3 s, and back."""
    phase = asin(sqrt(LOW / top))
    table = compiled(sine_squared(top, (pi / 2 - phase) / RAMP, phase), RAMP)
    return ramped(table, table.first, len(table.differences), steps, 10).train


def rig(supply: float, *, parallel: bool, viscous: float = 5e-4) -> Rig:
    sheet = motor("as1060").changed(inductance_factor=1.8)
    wired = sheet.in_parallel() if parallel else sheet
    return Rig(wired, Drive(supply, wired.current, HALF), Load(viscous=viscous), FINE)


def test_27000_half_steps_a_second_are_reached_without_loss() -> None:
    run = simulate(supersigma(27_000, 20_000), rig(160, parallel=True), sample=MS)
    assert not run.verdict.lost
    assert run.verdict.margin > 0.4
    assert np.median(run.speed[run.times < 0.75][-200:]) * 2 == pytest.approx(27_000, rel=0.01)


def test_15000_the_required_speed_needs_half_the_voltage() -> None:
    """ "well above the 15 000 half steps per second which is the maximum required speed"."""
    assert not simulate(supersigma(15_000, 20_000), rig(80, parallel=True)).verdict.lost
    assert simulate(supersigma(27_000, 20_000), rig(80, parallel=True)).verdict.lost


def test_it_does_not_hang_on_one_number() -> None:
    """Inertia, friction and torque 20 percent either way, the supply 10."""
    base, train = rig(160, parallel=True), supersigma(27_000, 20_000)
    many = loss_rate(train, base, tried=96)
    assert (many.lost, many.corners_lost, many.corners) == (0, 0, 128)
    one_by_one = [("inertia", 0.8), ("inertia", 1.2), ("friction", 0.5), ("friction", 2.0), ("torque_constant", 0.9),
                  ("torque_constant", 1.1), ("voltage", 0.9), ("voltage", 1.1)]  # fmt: skip
    verdicts = judge(train, [changed(base, **{name: factor}) for name, factor in one_by_one])
    assert [verdict.lost for verdict in verdicts] == [False] * len(one_by_one)


def test_the_worst_moment_lies_where_the_ramp_turns_into_constant_speed() -> None:
    """Figure 5, shaded: "this is a critical region where losses of synchronisation may occur"."""
    loaded = replace(rig(160, parallel=True), load=Load(inertia=1e-3, viscous=5e-3))
    steps = round((650 + 15_000) / 2 * RAMP)
    runs = [
        simulate(train, loaded, sample=MS // 20)
        for train in (supersigma(15_000, 10_000), move(650, 15_000, steps, 10_000).train)
    ]
    assert not any(run.verdict.lost for run in runs)
    worst = []
    for run in runs:
        later = run.times > 0.1  # the start from rest is a shock of its own
        at = int(np.argmax(np.abs(run.load_angles[later])))
        assert 0.2 < run.times[later][at] < 0.36  # the ramp ends at 0.3 s
        worst.append(float(np.abs(run.load_angles[later]).max()))
    assert worst[1] > worst[0]
