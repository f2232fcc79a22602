"""The motor against closed forms, published numbers and another integrator (the validation cases V1 to V9)."""

from math import atan2, cos, degrees, exp, hypot, inf, pi, sin, sqrt

import numpy as np
import numpy.typing as npt
import pytest
from tests.motors.moves import LARGE, SMALL, ramped

from detent.motors import kernel
from detent.motors.curve import pull_out, torque_curve
from detent.motors.damping import CHOPPER, UNDAMPED, VOLTAGE
from detent.motors.drive import Drive
from detent.motors.fit import fit_from_curve, fitted
from detent.motors.load import Load
from detent.motors.motor import Motor
from detent.motors.move import Run, simulate
from detent.motors.named import CURVES
from detent.motors.rotor import SUBSTEP, Rig
from detent.motors.winding import FULL, HALF, HALF_COMPENSATED, WAVE, microstep
from detent.ticks import MS, US


def frequency(run: Run, *, after_ms: float) -> float:
    """Hz of the rotor's swing about its last place."""
    late = run.times > after_ms * 1e-3
    x, t = (run.rotor - run.command[-1])[late], run.times[late]
    up = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    crossings = t[up] - x[up] * (t[up + 1] - t[up]) / (x[up + 1] - x[up])
    return float((len(crossings) - 1) / (crossings[-1] - crossings[0]))


class TestV1SmallSwings:
    @pytest.mark.parametrize(("which", "hertz"), [(SMALL, 312.57), (LARGE, 286.51)])
    def test_natural_frequency_is_sqrt_p_th_over_j(self, which: Motor, hertz: float) -> None:
        assert which.natural_frequency() == pytest.approx(hertz, rel=1e-4)
        # a release from one 64th of a step, so little that the torque is a straight line
        for damping in (UNDAMPED, CHOPPER):
            rig = Rig(which, Drive(24, which.current, microstep(64)), substep=5 * US, damping=damping)
            run = simulate(np.array([MS]), rig, settle=(60 if damping is UNDAMPED else 20) * MS, sample=0)
            damped = sqrt(1 - damping.ratio**2)  # the closed form of a swing with damping
            assert frequency(run, after_ms=2) == pytest.approx(hertz * damped, rel=1e-3)

    @pytest.mark.parametrize(("which", "hertz"), [(SMALL, 264.8), (LARGE, 242.7)])
    def test_a_full_step_swings_slower_by_the_law_of_the_pendulum(self, which: Motor, hertz: float) -> None:
        """V1b: f0 pi / 2 K(sin 45 deg) = 0.847 f0; Jones, Stepping Motors, chapter 2."""
        rig = Rig(which, Drive(24, which.current, FULL), damping=UNDAMPED)  # that of a swing that goes on as it is
        run = simulate(np.array([MS]), rig, settle=60 * MS, sample=0)
        assert frequency(run, after_ms=2) == pytest.approx(hertz, rel=0.02)

    @pytest.mark.parametrize("which", [SMALL, LARGE])
    def test_the_default_damping_overshoots_as_its_ratio_says(self, which: Motor) -> None:
        """A small step: exp(-pi z / sqrt(1 - z**2)), less what the EMF takes."""
        rig = Rig(which, Drive(24, which.current, microstep(64)), substep=5 * US)
        run = simulate(np.array([MS]), rig, settle=20 * MS, sample=0)
        end = run.command[-1]
        overshoot = (run.rotor.max() - end) / (end - run.rotor[0])
        assert overshoot == pytest.approx(exp(-pi * 0.12 / sqrt(1 - 0.12**2)), abs=0.03)


class TestV2LowSpeed:
    @pytest.mark.parametrize(
        ("table", "part"),
        [(microstep(64), 1.0), (FULL, 2 * sqrt(2) / pi), (HALF, 0.832), (WAVE, 2 / pi), (HALF_COMPENSATED, 0.9745)],
        ids=lambda value: getattr(value, "name", None),
    )
    def test_pull_out_at_low_speed_depends_on_the_stepping(self, table: object, part: float) -> None:
        found = pull_out(SMALL, Drive(24, 1.0, table), 5)  # type: ignore[arg-type]
        assert found.torque / SMALL.holding_torque == pytest.approx(part, rel=2e-3)

    @pytest.mark.parametrize(("which", "low", "high"), [(SMALL, 0.220, 0.220), (LARGE, 0.281, 0.299)])
    def test_the_makers_first_points_are_met(self, which: Motor, low: float, high: float) -> None:
        assert low * 0.95 <= pull_out(which, Drive(24, 1.0, HALF), 250).torque <= high * 1.05


class TestV3VoltageFed:
    @pytest.mark.parametrize("rate", [100, 250, 500, 1000, 2500, 5000])
    def test_pull_out_and_load_angle_follow_the_closed_form(self, rate: float) -> None:
        """T = Kt (V / Z - R Kt w / Z**2) at 90 deg + atan(p w L / R), Z**2 = R**2 + (p w L)**2."""
        ohm, kt = SMALL.resistance, SMALL.torque_constant
        volts = SMALL.current * ohm * sqrt(2)
        w = rate * pi / 2 / SMALL.teeth
        reactance = SMALL.teeth * w * SMALL.inductance
        z = hypot(ohm, reactance)
        found = pull_out(SMALL, Drive(24, SMALL.current, microstep(64), "voltage"), rate)
        assert found.torque == pytest.approx(kt * (volts / z - ohm * kt * w / z**2), rel=1e-3)
        assert found.angle == pytest.approx(90 + degrees(atan2(reactance, ohm)), abs=0.1)


class TestV4PublishedCurves:
    @staticmethod
    def rms(which: Motor, **changes: float) -> float:
        curve = CURVES[which.name]
        changed = which.changed(**changes)
        computed = torque_curve(
            changed, Drive(curve.supply, curve.current, HALF), [rate / 2 for rate, _ in curve.points]
        )
        rest = [point.torque - torque for point, (_, torque) in zip(computed, curve.points, strict=True)]
        return float(np.sqrt(np.mean(np.square(rest)))) / which.holding_torque

    @pytest.mark.parametrize(("which", "raw"), [(SMALL, 0.106), (LARGE, 0.140)])
    def test_the_sheet_alone_is_optimistic_at_speed(self, which: Motor, raw: float) -> None:
        assert self.rms(which) == pytest.approx(raw, abs=0.005)

    @pytest.mark.parametrize(("which", "common"), [(SMALL, 0.065), (LARGE, 0.027)])
    def test_one_factor_on_the_inductance_mends_most_of_it(self, which: Motor, common: float) -> None:
        assert self.rms(which, inductance_factor=1.82) == pytest.approx(common, abs=0.005)

    @pytest.mark.parametrize("which", [SMALL, LARGE])
    def test_two_fitted_numbers_come_within_three_percent(self, which: Motor) -> None:
        found = fitted(which.name)
        assert found.rms < 0.03
        assert 1 <= found.motor.inductance_factor <= 2.5
        assert found.motor.viscous >= 0
        assert found.sheet_rms == pytest.approx(self.rms(which), rel=1e-6)

    def test_a_fit_finds_the_motor_that_made_the_curve(self) -> None:
        true = SMALL.changed(inductance_factor=1.6, viscous=3e-4)
        drive = Drive(24, 1.0, HALF)
        points = [(point.rate, point.torque) for point in torque_curve(true, drive, range(250, 4000, 500))]
        found = fit_from_curve(SMALL, drive, points)
        assert found.motor.inductance_factor == pytest.approx(1.6, abs=0.02)
        assert found.motor.viscous == pytest.approx(3e-4, rel=0.05)
        assert found.rms < 1e-3


class TestV7MaximumMicrostepVelocity:
    @pytest.mark.parametrize(("which", "published"), [(SMALL, 3.147), (LARGE, 2.575)])
    def test_the_speed_at_which_the_voltage_is_used_up_is_the_manuals(self, which: Motor, published: float) -> None:
        """QSH4218 manual, table 5.4: sqrt((R I)**2 + (p w L I + Kt w)**2) = Vs with I = 1.414 A."""
        peak = sqrt(2) * 1.0
        room = sqrt(24**2 - (which.resistance * peak) ** 2)
        factor = 1.8
        w = room / (which.teeth * which.inductance * factor * peak + which.torque_constant)
        assert w / (2 * pi) == pytest.approx(published, rel=0.3)


class TestV8AnotherIntegrator:
    def test_a_thousand_pulses_end_within_a_tenth_of_a_degree_of_lsoda(self) -> None:
        """Voltage drive, whose equations are smooth between pulses: nothing of ours but the tables is used."""
        solve_ivp = pytest.importorskip("scipy.integrate").solve_ivp
        drive = Drive(24, 1.0, HALF, "voltage")
        load = Load(inertia=SMALL.rotor, viscous=2e-4, torque=0.01)
        times = ramped(1000, 200, 1200)
        rig = Rig(SMALL, drive, load)
        run = simulate(times, rig, settle=0, sample=0)
        kt, p, ohm, henry = SMALL.torque_constant, SMALL.teeth, SMALL.resistance, SMALL.inductance
        j = SMALL.rotor + load.inertia
        d0 = 2 * VOLTAGE.ratio * sqrt(p * SMALL.holding_torque * SMALL.rotor)

        def rates(_: float, y: npt.NDArray[np.float64], va: float, vb: float, wanted: float, d: float) -> list[float]:
            x, w, ia, ib = y
            torque = kt * (ib * cos(x) - ia * sin(x)) - load.torque - load.viscous * w + d * (wanted - w)
            return [
                p * w,
                torque / j,
                (va - ohm * ia + kt * w * sin(x)) / henry,
                (vb - ohm * ib - kt * w * cos(x)) / henry,
            ]

        s, _n = rig.at_rest(0, 1.0)
        y = np.array([s[kernel.X], 0.0, s[kernel.IA], s[kernel.IB]])
        begin = 0.0
        for k, end in enumerate(times * 1e-9):
            # pulses known so far: the last two say how fast they are; the speed of the rest falls as they are late
            gap = begin - times[k - 2] * 1e-9 if k > 1 else inf
            for first, last in ((begin, min(begin + gap, end)), (min(begin + gap, end), end)):
                if last <= first:
                    continue
                wanted = pi / 4 / p / max(gap, (first + last) / 2 - begin)
                d = d0 / (1 + (wanted * 200 / (2 * pi) / VOLTAGE.roll_off) ** 2)
                args = (HALF.a[k % 8] * ohm, HALF.b[k % 8] * ohm, wanted, d)
                y = solve_ivp(rates, (first, last), y, "LSODA", args=args, rtol=1e-8, atol=1e-10).y[:, -1]
            begin = end
        assert degrees(abs(run.trace[-1, kernel.X_COLUMN] - y[0])) < 0.1
        assert run.verdict.lost is False


class TestV9Identities:
    @pytest.mark.parametrize("which", [SMALL, LARGE])
    def test_torque_constant_is_the_manuals_rule_for_the_emf(self, which: Motor) -> None:
        """QSH4218 manual, 5.4: U_BEMF (rms) = Th / (2 I) per rad/s; the amplitude is sqrt(2) of it."""
        assert which.torque_constant == pytest.approx(sqrt(2) * which.holding_torque / (2 * which.current), rel=1e-15)

    @pytest.mark.parametrize("decay", ["fast", "slow", "voltage"])
    def test_no_energy_appears_or_vanishes(self, decay: str) -> None:
        """Pel = Pcu + Pmech + dWm / dt, to a millionth."""
        drive = Drive(24, 1.0, HALF, decay)  # type: ignore[arg-type]
        load = Load(inertia=SMALL.rotor, friction=0.01, torque=0.02)
        # at the substep that everything uses, and at one so fine that only rounding is left
        for substep, part in ((SUBSTEP, 1e-5), (2 * US, 1e-6)):
            found = simulate(ramped(600, 200, 1500), Rig(SMALL, drive, load, substep)).energies
            rest = found.electric - found.copper - found.mechanic - found.magnetic
            assert abs(rest) < part * found.electric
        assert found.copper > 0
        assert found.mechanic > 0
