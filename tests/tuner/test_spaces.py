"""The settings of each controller: the pulses that are judged are those it gives for the commands that are printed."""

from functools import cache

import numpy as np
import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.moves.law import winding_of
from detent.moves.laws import law
from detent.tuner.grid import points
from detent.tuner.into import program, put_into
from detent.tuner.judge import Judge
from detent.tuner.spaces import Profile, space
from detent.tuner.task import Task, TunerError, moves_of

LOAD = Load(inertia=1.5e-5, friction=0.02)


def task(model: str, moves: str = "192,960", **other: object) -> Task:
    drive = Drive(24, 1.0, winding_of(law(model), None))
    return Task(model, Rig(motor("qsh4218-41-10-035"), drive, LOAD), moves_of(moves), **other)  # type: ignore[arg-type]


@cache
def usual(model: str) -> Judge:
    """The judge of the usual task of a model."""
    return Judge(task(model))


def rest(made: Cell) -> None:
    while made.step() is not None:
        pass


def emulated(model: str, profile: Profile, distance: int, axis: str = "") -> np.ndarray:  # type: ignore[type-arg]
    """The pulses (ns from the first one) that the emulated controller gives for what is printed."""
    options = {name: value for name, value in profile.options.items() if not profile.before}
    written = ", ".join(f'{name} = "{value}"' for name, value in options.items())
    text = f'[units.unit]\nmodel = "{model}"\n' + (f"options = {{ {written} }}\n" if written else "")
    made = build(parse(text, "cell"), lambda _: "", line_timing=False)
    rest(made)
    if model == "dcb-274":
        made.send(0, b" ")  # it signs on
        rest(made)
    for line in (*profile.settings, profile.go(distance)):
        made.type("unit", line)
        rest(made)
    assert made.recording is not None
    spans = made.recording.motion("unit", made.now, axis)
    times = np.concatenate([np.asarray(span.train.times(span.first, span.last)) for span in spans])
    return times - times[0]


@pytest.mark.parametrize(
    ("model", "axis"),
    [("gs-c200", ""), ("dcb-274", ""), ("supersigma", ""), ("bs0610", "X"), ("bs0610", "Y")],
)
def test_what_is_judged_are_the_pulses_for_what_is_printed(model: str, axis: str) -> None:
    made = task(model, axis=axis)
    judge = Judge(made) if axis else usual(model)
    ends = [dimension.values for dimension in judge.space.dimensions]
    points = [tuple(values[int(part * (len(values) - 1))] for values in ends) for part in (0.2, 0.5, 0.8)]
    mixed = tuple(values[(7 * k) % len(values)] for k, values in enumerate(ends, 1))
    for point in [judge.space.hand, *filter(judge.space.admits, [*points, mixed])]:
        found = judge.trains(point)
        if found is None:
            assert point != judge.space.hand
            continue  # no such table
        profile, trains = found
        for move, train in zip(made.moves, trains, strict=True):
            times = np.asarray(train.times())
            assert np.array_equal(emulated(model, profile, move.steps, axis), times - times[0]), profile.settings


def test_a_coarser_microstep_makes_the_same_way_with_fewer_steps() -> None:
    """A distance is in microsteps of the size that the board has at first; 16! makes them four times as long."""
    judge = usual("bs0610")
    sizes = judge.space.dimensions[0].values
    assert sizes == (1, 2, 4, 8, 16, 32, 64)  # 192 of 4/64 are 12 full steps
    point = (16, *judge.space.hand[1:])
    found = judge.trains(point)
    assert found is not None
    assert found[0].settings[0] == "16!"
    assert found[1][0].steps == 48  # of 192
    assert found[0].winding.name == "1/4"
    assert Judge(task("bs0610", "192", options={"step_size": "8"})).space.dimensions[0].values == (8,)


@pytest.mark.parametrize("model", ["gs-c200", "dcb-274", "supersigma", "bs0610"])
def test_settings_by_hand_are_settings_and_longer_ramps_take_longer(model: str) -> None:
    judge = usual(model)
    hand = judge.space.hand
    longer = judge.space.slower(hand, 1.25)
    fast, slow = judge.time(hand), judge.time(longer)
    assert fast is not None
    assert slow is not None
    assert fast < slow


def test_a_hanging_load_is_judged_both_ways() -> None:
    drive = Drive(24, 1.0, winding_of(law("gs-c200"), None))
    rig = Rig(motor("qsh4218-41-10-035"), drive, Load(inertia=1.5e-5, friction=0.02, torque=0.05))
    hanging = Task("gs-c200", rig, moves_of("200"))
    assert hanging.both_ways
    judge = Judge(hanging)
    found = judge.trains(judge.space.hand)
    assert found is not None
    assert len(judge.ways(found[1][0])) == 2


def test_settings_go_into_a_program_a_backup_and_a_cell() -> None:
    made, judge = task("gs-c200"), usual("gs-c200")
    found = judge.trains((48, 603, 201))
    assert found is not None
    profile = found[0]
    text = "start: S10 ; slow\nT100\n  R40\n+1000\nU1\n"
    changed = put_into(text, profile)
    assert changed.text == "start: S48 ; slow\nT603\n  R201\n+1000\nU1\n"
    assert changed.replaced == ("S10 -> S48", "T100 -> T603", "R40 -> R201")
    backup = '[saved]\nprogram = [\n    "S10",\n    "T100",  # speed\n    "R40",\n    "+1000",\n]\n'
    assert '"S48",\n    "T603",  # speed\n    "R201",\n    "+1000"' in put_into(backup, profile).text
    with pytest.raises(TunerError, match="nothing there sets what R201 sets"):
        put_into("S10\nT100\n+1000\n", profile)
    assert program(made, profile).splitlines() == ["S48", "T603", "R201", "+192", "+960"]
    sigma = task("supersigma")
    table = usual("supersigma").trains(usual("supersigma").space.hand)
    assert table is not None
    cell = 'options = { table = "4000:2580:0102", short = "hyperbola" }'
    assert put_into(cell, table[0]).text == (f'options = {{ table = "{table[0].options["table"]}", short = "exact" }}')
    with pytest.raises(TunerError, match="--from"):
        program(sigma, table[0])


def test_settings_of_one_motor_of_a_board_go_into_its_part_of_a_backup() -> None:
    made = task("bs0610", axis="Y", options={"step_size": "4"})
    judge = Judge(made)
    found = judge.trains(judge.space.hand)
    assert found is not None
    backup = (
        "[saved]\nstep_size = 2\n\n[saved.X]\nstop_rate = 80\nrun_rate = 800\nslope = 8000\n\n"
        "[saved.Y]\nstop_rate = 81\nrun_rate = 801\nslope = 8001\n"
    )
    values = found[0].values
    assert put_into(backup, found[0], "Y").text == backup.replace("step_size = 2", "step_size = 4").replace(
        "stop_rate = 81\nrun_rate = 801\nslope = 8001",
        f"stop_rate = {values['K']}\nrun_rate = {values['R']}\nslope = {values['P']}",
    )


@pytest.mark.parametrize("size", ["1", "4", "64"])
def test_a_board_whose_slope_is_the_limit_has_settings_all_the_same(size: str) -> None:
    """A small load could be accelerated more than P at its most does in fine steps."""
    made = law("bs0610", {"step_size": size})
    rig = Rig(motor("qsh4218-41-10-035"), Drive(5, 1.0, made.windings[0], "voltage"), Load(5.4e-6, friction=0.01))
    found = space(Task("bs0610", rig, moves_of("800"), {"step_size": size}))
    every = points([one.values[::2] for one in found.dimensions])
    profiles = [found.profile(point) for point in every if found.admits(point)]
    assert sum(profile is not None for profile in profiles) >= 5


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
@pytest.mark.parametrize("axis", ["X", "Y"])
def test_a_reset_that_sets_the_step_size_leaves_the_step_mode_that_is_judged(axis: str, mode: int) -> None:
    """Manual, page 37: `!` sets everything as after power-on, and so O to 3."""
    made_of = law("bs0610", {}, axis)
    winding = made_of.windings[0] if mode == 3 else next(one for one in made_of.windings if one.name == f"O{mode}")
    rig = Rig(motor("qsh4218-41-10-035"), Drive(24, 1.0, winding), LOAD)
    judge = Judge(Task("bs0610", rig, moves_of("192"), axis=axis))
    found = judge.trains(judge.space.hand)
    assert found is not None
    profile = found[0]
    assert profile.settings[0].endswith("!")
    unit = build(parse('[units.unit]\nmodel = "bs0610"\n', "cell"), lambda _: "", line_timing=False)
    for line in (axis, f"{mode}O", *profile.settings):
        unit.type("unit", line)
        rest(unit)
    assert unit.controller("unit").registers(unit.now)[f"{axis} O"] == str(mode)
    assert profile.winding.name == (f"O{mode}" if mode != 3 else f"1/{64 // judge.space.hand[0]}")
