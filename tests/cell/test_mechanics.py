"""A motor in a cell: switches at its rotor, the closed loop, damping, currents by wire; copies and slices of time."""

from pathlib import Path

import numpy as np
import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import Problem, parse
from detent.cell.mechanics import Mechanics
from detent.motors import kernel
from detent.motors.move import Part, simulate
from detent.pins import LOW
from detent.ticks import MS, SECOND, Ns

EXAMPLES = Path(__file__).parents[2] / "examples"

AXIS = """
[units.axis]
model = "gs-c200s"
straps = {{ CHS = "low" }}
[motors.slide]
motor = "qsh4218-41-10-035"
unit = "axis"
supply = 24
lead = 0.05
load = {{ inertia = 5.4e-6, friction = 0.01, viscous = 1e-3 }}
{more}
"""
ENDS = """
[switches.home]
axis = "{axis}"
to = {home}
drives = "axis.HOME"
[switches.end]
axis = "{axis}"
to = {home}
drives = "axis.EOT"
"""


def cell(text: str, program: str = "", *, record: bool = True) -> Cell:
    return build(parse(text, "cell.toml"), lambda _: program, record=record, line_timing=False)


def with_files(text: str, files: dict[str, str]) -> Cell:
    def read(name: str) -> str:
        try:
            return files[name]
        except KeyError:
            raise FileNotFoundError(2, "No such file or directory") from None

    return build(parse(text, "cell.toml"), read, line_timing=False)


def example(name: str, **replaced: str) -> Cell:
    folder = EXAMPLES / name
    text = (folder / "cell.toml").read_text()
    for old, new in replaced.items():
        assert old in text
        text = text.replace(old, new)
    return build(parse(text, f"{name}/cell.toml"), lambda file: (folder / file).read_text())


def motor(of: Cell, name: str = "slide") -> Mechanics:
    part = of.parts[of.wiring.names.index(name)]
    assert isinstance(part, Mechanics)
    return part


def told(of: Cell, *commands: str) -> Cell:
    for command in commands:
        of.type("axis", command)
        rest(of)
    return of


def rest(of: Cell, most: int = 20_000) -> Cell:
    for _ in range(most):
        if of.step() is None:
            return of
    raise AssertionError("the cell does not come to rest")


def settled(of: Cell, name: str = "slide") -> float:
    """Where the rotor stands a while later, in steps."""
    of.run_to(of.now + 500 * MS)
    return motor(of, name).place(of.now)


def levels(of: Cell, pin: str) -> list[tuple[Ns, int]]:
    """When an input of the axis took which level."""
    assert of.recording is not None
    return [(e.at, e.level) for e in of.recording.of("axis") if getattr(e, "pin", "") == pin]  # type: ignore[union-attr]


class TestSwitches:
    def test_the_axis_homes_on_its_rotor(self) -> None:
        """H-: to EOT, and back until HOME opens, both at the same place of the rotor: counter 0 there."""
        made = told(cell(AXIS.format(more=ENDS.format(axis="slide", home=-5.02))), "S30", "H-")
        assert made.controller("axis").status(made.now).position == 0
        # the rotor closed the switch, and opened it again or stands in it, within a step
        assert motor(made).place(made.now) * 0.05 == pytest.approx(-5.02, abs=0.06)
        told(made, "T100", "R40", "+300")
        assert motor(made).place(made.now) * 0.05 == pytest.approx(-5.0 + 15.0, abs=0.1)

    def test_a_switch_in_steps_closes_where_it_would_without_a_motor_but_when_the_rotor_is_there(self) -> None:
        with_motor = told(cell(AXIS.format(more=ENDS.format(axis="axis", home=-100))), "S30", "-150")
        bare = AXIS.format(more=ENDS.format(axis="axis", home=-100))
        ideal = told(cell(bare[: bare.index("[motors")] + bare[bare.index("[switches") :]), "S30", "-150")
        (rotor, _), (pulse, _) = levels(with_motor, "HOME")[-1], levels(ideal, "HOME")[-1]
        assert abs(rotor - pulse) < 3 * MS  # about a step, at 300 steps/s
        assert rotor != pulse

    def test_the_contact_changes_at_the_very_crossing(self) -> None:
        """The rotor one nanosecond before is on this side of the edge, and then on that."""
        made = cell(AXIS.format(more=ENDS.format(axis="slide", home=-2.02)))
        twin = made.copy()
        told(made, "S50", "-100")
        at, level = levels(made, "HOME")[-1]
        assert level == LOW
        twin.type("axis", "S50")
        rest(twin)
        twin.type("axis", "-100")
        twin.run_to(at - 1)
        assert motor(twin).place(at - 1) * 0.05 > -2.02
        assert motor(twin).place(at) * 0.05 == pytest.approx(-2.02, abs=1e-6)
        assert motor(twin).place(at + 1) * 0.05 < -2.02

    def test_a_cell_with_a_motor_at_rest_has_nothing_to_do(self) -> None:
        made = cell(AXIS.format(more=ENDS.format(axis="slide", home=-5)))
        rest(made, 10)
        made.run_to(10_000 * SECOND)
        assert motor(made).place(made.now) == 0


class TestTime:
    def test_the_rotor_in_a_cell_is_the_rotor_of_the_simulation(self) -> None:
        made = told(cell(AXIS.format(more="")), "S30", "T200", "R60", "+400")
        assert made.recording is not None
        spans = made.recording.motion("axis", made.now)
        run = simulate([Part(span.train, span.direction, span.first, span.last) for span in spans], motor(made).rig)
        assert motor(made).rotor_at(made.now).s[kernel.WORST] == pytest.approx(
            np.radians(run.verdict.load_angle), rel=1e-12
        )

    @pytest.mark.parametrize("slice_", [777, 50_000, 3 * MS + 1])
    def test_how_time_is_sliced_changes_nothing(self, slice_: Ns) -> None:
        whole = cell(AXIS.format(more=ENDS.format(axis="slide", home=-0.51)))
        sliced = whole.copy()
        for one in (whole, sliced):
            one.type("axis", "S40")
            rest(one)
            one.type("axis", "-30")
        until = whole.now + (2 if slice_ < 1000 else 120) * MS
        whole.run_to(until)
        at = sliced.now
        while at < until:
            at = min(at + slice_, until)
            sliced.run_to(at)
            motor(sliced).place(at)  # asking changes nothing, either
            motor(sliced).advance(at)
        assert levels(sliced, "HOME") == levels(whole, "HOME")
        assert motor(sliced).rotor_at(until).s.tolist() == motor(whole).rotor_at(until).s.tolist()

    def test_a_copy_goes_on_identically(self) -> None:
        made = example("closed-loop-motor")
        made.run_to(50 * MS)
        twin = made.copy()
        rest(made)
        rest(twin)
        assert list(made.recording or ()) == list(twin.recording or ())
        assert motor(made).rotor_at(made.now).s.tolist() == motor(twin).rotor_at(twin.now).s.tolist()

    def test_recording_or_not_is_the_same_motion(self) -> None:
        places = []
        for record in (False, True):
            made = told(cell(AXIS.format(more=ENDS.format(axis="slide", home=-5.02)), record=record), "S30", "H-")
            places.append((made.now, motor(made).place(made.now)))
        assert places[0] == places[1]


class TestClosedLoop:
    def test_open_loop_loses_the_move(self) -> None:
        """The same cell with the wire to ENABLE cut (put on a free input)."""
        made = rest(example("closed-loop-motor", **{'to = "axis.ENABLE"': 'to = "axis.UI3"'}))
        assert made.controller("axis").status(made.now).position == 2000
        assert motor(made).place(made.now) < 100

    def test_the_detector_on_enable_saves_every_step(self) -> None:
        """Datasheet, "Closed loop operation": the step clock is issued only if the previous step has been executed."""
        made = rest(example("closed-loop-motor"))
        assert made.controller("axis").status(made.now).position == 2000
        assert motor(made).place(made.now) == pytest.approx(2000, abs=1)
        assert motor(made).rotor_at(made.now).s[kernel.WORST] < np.radians(180)


class TestDamping:
    @staticmethod
    def ring_down(made: Cell, name: str) -> float:
        """ms from the first step to the last time the rotor is more than a twentieth of a step off, then."""
        rows = motor(made, name).traced(made.now)
        times, places = rows[:, 0] * 1e-6, np.array(motor(made, name).place_of(rows[:, 1]))
        first = float(times[np.argmax(places > 0.05)])
        window = (times > first) & (times < first + 400)
        off = np.abs(places[window] - 1) > 0.05
        return float(times[window][off][-1]) - first

    def test_phase_reversal_shortens_the_ring_down(self) -> None:
        """Figures 20 and 22: the same single steps, with and without the damper of figure 23."""
        made = rest(example("damping"))
        plain, damped = self.ring_down(made, "plain"), self.ring_down(made, "damped")
        assert plain > 100
        assert damped < 5
        for name in ("plain", "damped"):
            assert motor(made, name).place(made.now) == pytest.approx(3, abs=0.02)

    def test_a_wrong_time_leaves_it_a_step_behind_or_swinging(self) -> None:
        """ "it could be that a system compensated in a no load condition will stop one step behind"."""
        made = rest(example("damping", **{'release = "2.0 ms"': 'release = "3.5 ms"'}))
        assert self.ring_down(made, "damped") > 20


class TestCurrents:
    WIRES = """
current = { ramp = 1.0, slew = 0.6, rest = 0.3 }
[[wires]]
from = "axis.MOV"
to = "slide.MOV"
[[wires]]
from = "axis.RAMP"
to = "slide.RAMP"
"""

    def test_mov_and_ramp_choose_the_phase_current(self) -> None:
        """Figures 6 and 11: rest, ramp, slew."""
        text = AXIS.format(more="").replace("load =", self.WIRES.partition("[[")[0].strip() + "\nload =")
        made = cell(text + "[[wires]]" + self.WIRES.partition("[[wires]]")[2])
        told(made, "S30", "T60", "R50")
        at_rest = motor(made).rotor_at(made.now)
        assert max(abs(at_rest.s[kernel.IA]), abs(at_rest.s[kernel.IB])) == pytest.approx(0.3, abs=1e-3)
        made.type("axis", "+400")
        seen = {}
        for name, ms in (("ramp", 60), ("slew", 350)):
            made.run_to(made.now + ms * MS)
            seen[name] = float(motor(made).rotor_at(made.now).s[kernel.LEVEL])
        assert seen == {"ramp": pytest.approx(1.0), "slew": pytest.approx(0.6)}

    def test_a_drive_may_hold_by_itself_some_time_after_the_last_step(self) -> None:
        text = AXIS.format(more="").replace("load =", 'current = { run = 1.0, hold = 0.5, after = "200 ms" }\nload =')
        made = told(cell(text), "S30", "+10")
        last = made.now
        assert float(motor(made).rotor_at(last + 100 * MS).s[kernel.LEVEL]) == 1.0
        assert float(motor(made).rotor_at(last + 300 * MS).s[kernel.LEVEL]) == 0.5

    def test_enable_of_the_drive_lets_the_motor_go(self) -> None:
        text = AXIS.format(more='[[wires]]\nfrom = "axis.UO1"\nto = "slide.ENABLE"\n')
        made = told(cell(text), "S30", "+10")
        assert abs(motor(made).rotor_at(made.now).s[kernel.IA]) < 1e-9
        assert abs(motor(made).place(made.now)) < 0.01
        told(made, "A1", "+80")
        assert settled(made) == pytest.approx(82, abs=0.3)  # a whole electrical turn of eight half steps is lost

    def test_half_chooses_half_or_full_steps_and_decay_slow_or_fast(self) -> None:
        """Figure 7: UO3 low is full step, UO2 high is slow decay."""
        more = '[[wires]]\nfrom = "axis.UO3"\nto = "slide.HALF"\n[[wires]]\nfrom = "axis.UO2"\nto = "slide.DECAY"\n'
        made = told(cell(AXIS.format(more=more)), "S20", "+10")
        assert settled(made) == pytest.approx(20, abs=0.3)
        assert int(motor(made).rotor_at(made.now).n[kernel.MODE]) == 0
        told(made, "A3", "A2", "+10")
        assert settled(made) == pytest.approx(30, abs=0.3)
        assert int(motor(made).rotor_at(made.now).n[kernel.MODE]) == 1


def test_an_encoder_counts_the_steps_of_the_rotor() -> None:
    """X and Y, figure 18: four edges to a cycle, one a step."""
    more = '[[wires]]\nfrom = "slide.X"\nto = "axis.UI1"\n[[wires]]\nfrom = "slide.Y"\nto = "axis.UI2"\n'
    made = told(cell(AXIS.format(more=more)), "S30", "+40")
    edges = sorted(levels(made, "UI1") + levels(made, "UI2"))
    moved = [at for at, _ in edges if at > 0]
    assert len(moved) >= 40
    assert (len(moved) - 40) % 2 == 0  # swings over an edge come in pairs


def test_minus_may_turn_the_motor_the_other_way() -> None:
    text = AXIS.format(more="").replace("lead =", "reverse = true\nlead =")
    made = told(cell(text), "S30", "+40")
    assert settled(made) == pytest.approx(40, abs=0.3)
    assert motor(made).rotor_at(made.now).steps == pytest.approx(-40, abs=0.3)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"qsh4218-41-10-035"', '"qsh4218"', "motors.slide: no motor 'qsh4218'; did you mean"),
        ("supply = 24", "supply = 3", "motors.slide: 3 V cannot drive 1 A"),
        ("supply = 24", "supply = 24\nvolts = 3", "motors.slide.volts: there is no such key"),
        ('unit = "axis"', 'unit = "axes"', "motors.slide.unit: no unit 'axes'; did you mean axis?"),
        ('unit = "axis"', 'unit = "axis"\naxis = "Z"', "motors.slide.axis: no axis 'Z'"),
        ("friction = 0.01", "friction = -1", "load: friction is -1.0"),
        ("friction = 0.01", "frictoin = 0.01", "motors.slide.load"),
        ("lead = 0.05", "current = { ramp = 1, run = 1 }", "give ramp, slew and rest"),
        ("lead = 0.05", 'decay = "quick"', "motors.slide.decay"),
        ("[motors.slide]", "[motors.axis]", "motors.axis: a unit or switch has this name"),
    ],
)
def test_a_wrong_motor_is_told_with_key_and_remedy(old: str, new: str, said: str) -> None:
    with pytest.raises(Problem) as caught:
        cell(AXIS.format(more="").replace(old, new))
    assert said in str(caught.value)


class TestWhatHangsOnIt:
    BELT = "mechanics = { belt = 8e-3, mass = 0.2, friction = 0.02 }\nload_by = { turns = [[0, 0.0], [1, 0.1]] }\n"
    CELL = '[units.axis]\nmodel = "gs-c200"\n[motors.slide]\nmotor = "qsh4218-41-10-035"\nunit = "axis"\nsupply = 24\n'

    def test_mechanics_drive_wiring_and_a_load_that_changes(self) -> None:
        rig = motor(cell(self.CELL + 'drive = "a4988"\n' + self.BELT)).rig
        assert rig.load.inertia == pytest.approx(1.28e-5)
        assert rig.load.friction == 0.02
        assert rig.load.torque_by_position.at(3.14159265) == pytest.approx(0.05)
        assert (rig.drive.decay, rig.drive.resistance) == ("mixed", 0.64)
        assert rig.damping is not None
        assert rig.damping.ratio == 0.12
        own = self.CELL.replace("qsh4218-41-10-035", "23-305-ds8a-series").replace("= 24", "= 40")
        wired = motor(cell(own + 'wiring = "parallel"\ndata = { inertia = 4.8e-5 }\ndamping = 0.2\n')).rig
        assert wired.motor.resistance == pytest.approx(0.7)
        assert wired.damping is not None
        assert wired.damping.source == "from the cell file"

    @pytest.mark.parametrize(
        ("more", "words"),
        [('drive = "a4999"', "did you mean a4988"), ('drive = "a4988"\ndecay = "slow"', "a decay of its own"),
         ("mechanics = { mas = 1 }", "did you mean mass"), ("mechanics = { mass = 1 }", "needs what moves it"),
         ("load_by = { m = [[0, 0], [1, 1]] }", "m needs what moves"), ("load_by = { s = [[0, 0.0]] }", "two points"),
         ("load_by = { m = [[0, 0], [1, 1]], turns = [[0, 0], [1, 1]] }", "give one of them"),
         ('wiring = "series"', "do not say how"), ("damping = 7", "ratio is 7")],
    )  # fmt: skip
    def test_what_cannot_be_is_refused_with_its_motor(self, more: str, words: str) -> None:
        with pytest.raises(Problem, match=words) as caught:
            cell(self.CELL + more + "\n")
        assert str(caught.value).startswith("cell.toml: motors.slide")

    OWN = "resistance = 1.1\ninductance = 3.6e-3\ncurrent = 2.8\ntorque = 1.26\ninertia = 3e-5\nwiring = 'series'\n"

    def test_a_motor_may_be_a_file_with_its_curve(self) -> None:
        text = self.CELL.replace("qsh4218-41-10-035", "parts/my.toml").replace("= 24", "= 48")
        curve = "[curve]\nfile = 'my.csv'\nsupply = 48\n"
        files = {
            "parts/my.toml": self.OWN + curve,
            "parts/my.csv": "rpm, Ncm\n75,110\n300,105\n900,85\n1500,55\n",
        }
        rig = motor(with_files(text, files)).rig
        assert rig.motor.holding_torque == 1.26
        assert rig.motor.inductance_factor > 1.1
        assert motor(with_files(text + 'wiring = "parallel"\n', files)).rig.motor.current == pytest.approx(5.6)
        for wrong, words in (({}, "cannot read parts/my.toml"), ({"parts/my.toml": "resistance = 1"}, "missing"),
                             ({"parts/my.toml": self.OWN + curve}, "or its curve")):  # fmt: skip
            with pytest.raises(Problem, match=words) as caught:
                with_files(text, wrong)
            assert str(caught.value).startswith("cell.toml: motors.slide.motor")
