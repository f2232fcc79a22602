"""A motor and mechanics of one's own: data, curves, ring-downs, wiring, drives; what they say, and what they refuse."""

from math import pi, sqrt

import numpy as np
import pytest
from tests.motors.moves import LARGE, SMALL, even

from detent.motors import own, ring_down
from detent.motors.chopper import inspect
from detent.motors.curve import pull_out, starts, torque_curve
from detent.motors.damping import UNDAMPED, Damping
from detent.motors.diagnosis import diagnose
from detent.motors.drive import Drive
from detent.motors.drives import PRESETS, drive
from detent.motors.fit import fit_from_curve
from detent.motors.load import Load, profile, read_profile
from detent.motors.mechanics import GRAVITY, Mechanics
from detent.motors.motor import MotorError
from detent.motors.move import simulate
from detent.motors.named import CURVES, motor
from detent.motors.rotor import Rig
from detent.motors.winding import FULL, HALF, microstep
from detent.ramps.constant_acceleration import move
from detent.ticks import MS

MINE = """
resistance = 1.1
inductance = 3.6e-3
current = 2.8
torque = 1.26
inertia = 1e-5
steps = 200.0
source = "a sheet"
"""


class TestData:
    def test_a_motor_is_read_from_its_toml(self) -> None:
        found, curve = own.read(MINE, "folder/mine.toml")
        assert (found.name, found.holding_torque, found.inertia, found.steps) == ("mine", 1.26, 1e-5, 200)
        assert found.source == "a sheet"
        assert curve is None

    @pytest.mark.parametrize(
        ("text", "words"),
        [("", "resistance, inductance, current, torque missing"), ("resistance = ", "no TOML"),
         (MINE + "intertia = 1", "did you mean inertia"), (MINE + "detent_torque = nan", "give a number, not nan"),
         (MINE + "title = 3", "give a word"), (MINE.replace("3.6e-3", "3.6"), "inductance is in H"),
         (MINE + "wiring = 'star'", "no wiring 'star'"), (MINE + "[curve]\nfile = 'x'", "needs supply"),
         (MINE + "[curve]\nsupply = 24\npoints = [3]", "a point is"), (MINE.replace("200.0", "200.5"), "no whole")],
    )  # fmt: skip
    def test_what_no_motor_has_is_refused_with_file_and_key(self, text: str, words: str) -> None:
        with pytest.raises(MotorError, match=words) as caught:
            own.read(text, "mine.toml")
        assert str(caught.value).startswith("mine.toml: ")
        assert "\n" not in str(caught.value).strip()


class TestCurves:
    @pytest.mark.parametrize(
        ("head", "speed", "torque"),
        [("full steps/s, Nm", 1.0, 1.0), ("half_steps_per_s;mNm", 2.0, 1e3), ("speed (rpm),torque (Ncm)", 0.3, 100.0),
         ("turns/s\tNm", 0.005, 1.0), ("steps/s,oz-in", 2.0, 141.6119)],
    )  # fmt: skip
    def test_points_come_in_the_units_of_their_first_line(self, head: str, speed: float, torque: float) -> None:
        mark = ";" if ";" in head else "\t" if "\t" in head else ","
        text = f"# a curve\n{head}\n" + "".join(f"{1000 * speed}{mark}{0.2 * torque}\n" for _ in range(1))
        ((rate, value),) = own.read_curve(text, "c.csv", step="half")
        assert rate == pytest.approx(1000)
        assert value == pytest.approx(0.2, rel=1e-5)

    @pytest.mark.parametrize(
        ("text", "words"),
        [("", "no points"), ("1000,0.2\n", "names no units"), ("rpm,Nm\n100\n", "line 2: '100': give two"),
         ("rpm,Nm\n1,x\n", "line 2: '1,x': give two numbers")],
    )  # fmt: skip
    def test_a_curve_that_is_none_is_refused_with_its_line(self, text: str, words: str) -> None:
        with pytest.raises(MotorError, match=words):
            own.read_curve(text, "c.csv")

    def test_a_fit_says_for_what_speeds_it_holds_and_when_it_leaves_the_rest_open(self) -> None:
        """The low half of a published curve says little of the inductance."""
        curve, drive_ = CURVES["qsh4218-35-10-027"], Drive(24, 1.0, HALF)
        points = [(rate / 2, torque) for rate, torque in curve.points]
        whole, half = (fit_from_curve(SMALL, drive_, some) for some in (points, points[:4]))
        assert (whole.low, whole.high) == (250, 3000)
        assert not whole.ambiguous
        assert half.ambiguous
        assert half.factors[1] > 1.5
        assert "AMBIGUOUS" in half.reach
        assert "holds from 250 to 1000 full steps/s" in half.reach
        # what it left open was really open
        beyond = torque_curve(half.motor, drive_, [3000])[0].torque
        assert abs(beyond - points[-1][1]) / SMALL.holding_torque > 0.05

    def test_a_curve_of_another_motor_is_said_to_be_poor(self) -> None:
        points = [(rate, 0.05) for rate in (250, 500, 1000, 2000)]
        assert "POOR" in fit_from_curve(LARGE, Drive(24, 1.0, HALF), points).reach


class TestRingDown:
    RIG = Rig(LARGE, Drive(24, 1.0, HALF), Load(LARGE.rotor, 0.003))

    def test_the_damping_that_made_a_step_is_found_again(self) -> None:
        for ratio in (0.05, 0.12, 0.3):
            made = ring_down.step(self.RIG, ratio)
            found = ring_down.from_overshoot(self.RIG, made.overshoot, made.settling)
            assert found.damping.ratio == pytest.approx(ratio, abs=0.01)
            assert found.words == ""
            record = ring_down.from_record(self.RIG, made.times.tolist(), (7 + 1.8 * made.places).tolist())
            assert record.damping.ratio == pytest.approx(ratio, abs=0.015)

    def test_what_does_not_agree_is_said(self) -> None:
        assert "do not belong" in ring_down.from_overshoot(self.RIG, 0.45, 0.2).words
        heavy = Rig(LARGE, Drive(24, 1.0, HALF), Load(4 * LARGE.rotor, 0.003))
        made = ring_down.step(heavy, 0.1)
        words = ring_down.from_record(self.RIG, made.times.tolist(), made.places.tolist()).words
        assert "the inertia is 2." in words

    def test_what_no_damping_does_is_refused(self) -> None:
        with pytest.raises(MotorError, match="is more than the"):
            ring_down.from_overshoot(Rig(LARGE, Drive(5, 1.0, HALF, "voltage"), Load(LARGE.rotor)), 0.9)
        for wrong in (0.0, 1.0, float("nan")):
            with pytest.raises(MotorError, match="overshoot"):
                ring_down.from_overshoot(self.RIG, wrong)
        with pytest.raises(MotorError, match="at least eight"):
            ring_down.from_record(self.RIG, [0, 1], [0, 1])
        with pytest.raises(MotorError, match="line 3"):
            ring_down.read("s,place\n0,1\n0.1,x\n", "r.csv")


class TestMechanics:
    def test_a_mass_on_a_belt_is_an_inertia_of_its_radius_squared(self) -> None:
        """Rig of the tuning example: 0.2 kg on a radius of 8 mm are 1.28e-5 kg m2."""
        found = Mechanics(belt=8e-3, mass=0.2, friction=0.02).load()
        assert found.inertia == pytest.approx(1.28e-5)
        assert (found.friction, found.torque) == (0.02, 0.0)

    def test_a_hanging_mass_on_a_screw_behind_a_gear(self) -> None:
        made = Mechanics(screw=0.005, gear=2, mass=10, slope=90, drag=4, efficiency=0.5, driven_inertia=4e-5)
        along = 0.005 / 2 / (2 * pi)
        load = made.load()
        assert load.torque == pytest.approx(10 * GRAVITY * along)
        assert load.inertia == pytest.approx(10 * along**2 + 1e-5)
        assert load.friction == pytest.approx(4 * along + (load.torque + 4 * along))
        assert made.place(2) == pytest.approx(0.005)
        assert Mechanics(rack=0.01, force=3).load().torque == pytest.approx(0.03)

    @pytest.mark.parametrize(
        ("given", "words"),
        [({"screw": 0.005, "belt": 0.01}, "one of screw, belt and rack"), ({"mass": 1}, "needs what moves it"),
         ({"gear": 0}, "gear"), ({"efficiency": 0}, "efficiency"), ({"screw": -1}, "screw"),
         ({"slope": 100, "screw": 1}, "slope"), ({"inertia": float("nan")}, "inertia")],
    )  # fmt: skip
    def test_impossible_mechanics_are_refused(self, given: dict[str, float], words: str) -> None:
        with pytest.raises(MotorError, match=words):
            Mechanics(**given)

    def test_a_load_that_changes_is_read_from_its_points(self) -> None:
        found = read_profile(Load(), "turns, Nm\n0,0\n1,0.1\n2,0.3\n", "l.csv", {"turns": 2 * pi})
        assert found.torque_by_position.at(3 * pi) == pytest.approx(0.2)
        uneven = profile([(0, 0.0), (1, 1.0), (10, 1.0)])
        assert uneven.at(0.5) == pytest.approx(0.5, abs=0.01)
        for text, words in (("x, Nm\n", "begin with one of"), ("s, Nm\n1,2\n", "at least two"),
                            ("s, Nm\n1,2\n0,1\n", "rise from point"), ("s, Nm\n1,a\n", "line 2")):  # fmt: skip
            with pytest.raises(MotorError, match=f"^l.csv.*{words}"):
                read_profile(Load(), text, "l.csv", {})


class TestWiring:
    def test_series_parallel_and_unipolar_are_one_motor_in_three_wirings(self) -> None:
        """HobbyCNC 23-305-DS8A: series 2.12 A 2.8 ohm 12.8 mH, parallel 4.2 A 0.7 ohm 3.2 mH, 3.0 Nm both."""
        series = motor("23-305-ds8a-series")
        parallel = series.wired("parallel")
        assert (parallel.resistance, parallel.inductance) == pytest.approx((0.7, 3.2e-3))
        assert parallel.current == pytest.approx(4.24)
        assert parallel.holding_torque == 3.0
        half = parallel.wired("unipolar")
        assert half.resistance * half.current**2 == pytest.approx(series.resistance * series.current**2)  # its heat
        assert half.torque_constant == pytest.approx(series.torque_constant / 2)  # half of the turns
        assert half.wired("series").inductance == pytest.approx(series.inductance)
        with pytest.raises(MotorError, match="do not say how"):
            LARGE.wired("parallel")


class TestDrives:
    def test_mixed_decay_lies_between_slow_and_fast(self) -> None:
        def torque(**more: object) -> float:
            return pull_out(LARGE, Drive(24, 1.0, microstep(8), **more), 2500).torque  # type: ignore[arg-type]

        slow, fast = torque(decay="slow"), torque(decay="fast")
        mixed = [torque(decay="mixed", fast_part=part) for part in (0.0, 0.3, 1.0)]
        assert mixed[0] == pytest.approx(slow, rel=1e-9)
        assert mixed[2] == pytest.approx(fast, rel=1e-9)
        assert min(slow, fast) - 0.02 <= mixed[1] <= max(slow, fast) + 0.02

    def test_interpolation_takes_the_steps_out_of_the_motion(self) -> None:
        """At low speed each pulse is a push, unless the drive passes from place to place by itself."""
        ripple = {}
        for interpolation in (False, True):
            rig = Rig(LARGE, Drive(24, 1.0, microstep(8), interpolation=interpolation), Load(LARGE.rotor, 0.002))
            run = simulate(even(800, 400), rig, sample=MS // 10)
            late = (run.times > 0.3) & (run.times < 0.45)
            ripple[interpolation] = float(run.speed[late].std())
            assert not run.verdict.lost
        assert ripple[True] < 0.4 * ripple[False]

    def test_drives_have_names(self) -> None:
        assert {"tmc2209", "tmc5160", "a4988", "drv8825"} <= set(PRESETS)
        for name in PRESETS:
            made = drive(name, 24, 1.0, microstep(16))
            assert not simulate(even(8000, 400), Rig(LARGE, made, Load(LARGE.rotor, 0.01))).verdict.lost
        with pytest.raises(MotorError, match="did you mean tmc2209"):
            drive("tmc2208", 24, 1.0, HALF)

    def test_blanking_leaves_small_currents_too_large(self) -> None:
        """A bridge that must be on for a while in each period cannot make less than that."""
        made = Drive(24, 1.0, microstep(16), "mixed", fast_part=0.0, least_on=0.1)
        assert made.fall == pytest.approx(0.1)
        assert Drive(24, 1.0, decay="mixed", fast_part=1.0).fall == -1.0

    def test_a_makers_accuracy_is_carried_and_bounded(self) -> None:
        """Microsteps are off by up to that between full steps, full steps are not; the rotor stands where they say."""
        off = LARGE.changed(accuracy=0.05)
        errors = {}
        for count in (
            4,
            8,
        ):  # an eighth of a step further: between two full steps, where the error is greatest, and on one
            rig = Rig(off, Drive(24, 1.0, microstep(16)), Load(LARGE.rotor))
            errors[count] = simulate(even(400, count + 8), rig, settle=200 * MS).verdict.error
        assert abs(errors[4]) == pytest.approx(0.05, abs=0.005)
        assert abs(errors[8]) < 0.005
        with pytest.raises(MotorError, match="accuracy"):
            LARGE.changed(accuracy=0.5)


class TestLosses:
    @pytest.mark.parametrize(
        ("load", "pulses", "words"),
        [(Load(LARGE.rotor, 0.25), (100, 4000, 400, 2000), "too little torque"),
         (Load(1e-4), (500, 9000, 50, 600), "too steep"),
         (Load(LARGE.rotor, 0.02), (6000, 6000, 1, 500), "does not start")],
    )  # fmt: skip
    def test_where_and_why(self, load: Load, pulses: tuple[int, int, int, int], words: str) -> None:
        train = move(*pulses).train
        rig = Rig(LARGE, Drive(24, 1.0, HALF), load)
        loss = diagnose(train, rig)
        verdict = simulate(train, rig).verdict
        assert loss is not None
        assert words in loss.reason
        assert loss.pulse <= (verdict.lost_pulse or 0)
        assert 180 <= abs(loss.load_angle) < 360
        assert str(loss.pulse) in str(loss)

    def test_resonance_is_told_from_a_lack_of_torque(self) -> None:
        train = move(100, 400, 50, 1000).train
        loss = diagnose(train, Rig(LARGE, Drive(24, 1.0, FULL), Load(LARGE.rotor), damping=UNDAMPED))
        assert loss is not None
        assert "resonance" in loss.reason
        assert loss.available > 10 * abs(loss.needed)
        assert diagnose(train, Rig(LARGE, Drive(24, 1.0, FULL), Load(LARGE.rotor))) is None

    def test_the_moment_of_a_loss_does_not_hang_on_the_substep(self) -> None:
        """The count of lost steps does: it is not said."""
        train = move(100, 4000, 400, 2000).train
        losses = [
            diagnose(train, Rig(LARGE, Drive(24, 1.0, HALF), Load(LARGE.rotor, 0.25), substep=h))
            for h in (5_000, 10_000, 20_000)
        ]
        pulses = [loss.pulse for loss in losses if loss is not None]
        assert max(pulses) - min(pulses) <= 8
        verdict = simulate(train, Rig(LARGE, Drive(24, 1.0, HALF), Load(LARGE.rotor, 0.25))).verdict
        assert str(abs(verdict.steps_lost)) not in str(verdict).replace("4 steps", "")

    def test_at_rest_is_said_only_when_it_is(self) -> None:
        rig = Rig(LARGE, Drive(24, 1.0, FULL), Load(LARGE.rotor), damping=Damping(0.005))
        swinging = simulate(even(50, 3), rig, settle=5 * MS).verdict
        assert not swinging.resting
        assert "still swings by" in swinging.where_it_rests
        calm = simulate(even(50, 3), Rig(LARGE, Drive(24, 1.0, FULL), Load(LARGE.rotor))).verdict
        assert calm.resting
        assert calm.where_it_rests.startswith("rests")


class TestBounds:
    def test_slow_and_impossible_speeds_cost_nothing(self) -> None:
        """What takes for ever, or all memory, is refused; the torque of very low speeds is that of low ones."""
        rig = Rig(LARGE, Drive(24, 1.0, HALF), Load(LARGE.rotor))
        for rate in (0, -1, float("nan"), float("inf")):
            with pytest.raises(MotorError, match="a speed is"):
                starts(rig, [rate])
            with pytest.raises(MotorError, match="a speed is"):
                pull_out(LARGE, rig.drive, rate)
            with pytest.raises(MotorError, match="a speed is"):
                inspect(LARGE, rig.drive, rate)
        with pytest.raises(MotorError, match="too long to be looked at"):
            starts(rig, [0.02])
        with pytest.raises(MotorError, match="a row each microsecond"):
            inspect(LARGE, rig.drive, 0.02)
        assert pull_out(LARGE, rig.drive, 0.1).torque == pytest.approx(pull_out(LARGE, rig.drive, 10).torque, rel=1e-3)
        for wrong in (1e9, float("nan"), float("inf")):
            with pytest.raises(MotorError, match="supply"):
                Drive(wrong, 1.0)

    def test_the_torque_constant_is_what_it_says(self) -> None:
        assert sqrt(2) * LARGE.torque_constant * LARGE.current == pytest.approx(LARGE.holding_torque)
        assert np.isfinite(simulate(even(500, 10), Rig(LARGE, Drive(24, 1.0))).verdict.swing)
