"""The laws of moves: what the emulated controller gives for the commands is, pulse for pulse, what the law says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.controllers.catalogue import MODELS, CatalogueError
from detent.moves import laws
from detent.moves.law import Law, Values, clipped, in_force, stepping
from detent.moves.spelling import SettingError, read, spelled


def emulated(law: Law, values: Values, steps: int, options: str = "", axis: str = "") -> np.ndarray:  # type: ignore[type-arg]
    """The pulses (ns from the first one) that the emulated controller gives for the commands of the law."""
    made = build(parse(f'[units.unit]\nmodel = "{law.model}"\n{options}', "cell"), lambda _: "", line_timing=False)
    rest(made)
    if law.model == "dcb-274":
        made.send(0, b" ")  # it signs on
        rest(made)
    commands = law.commands(values, steps)
    for line in (*commands.settings, commands.go):
        made.type("unit", line)
        rest(made)
    assert made.recording is not None
    spans = made.recording.motion("unit", made.now, axis)
    times = np.concatenate([np.asarray(span.train.times(span.first, span.last)) for span in spans])
    return times - times[0]


def rest(made: Cell) -> None:
    while made.step() is not None:
        pass


def same(law: Law, values: Values, steps: int, options: str = "", axis: str = "") -> None:
    given_ = emulated(law, values, steps, options, axis)
    train = law.train(values, steps)
    times = np.asarray(train.times(1, steps))
    assert len(given_) == steps
    assert np.array_equal(given_, times - times[0]), law.commands(values, steps)


@st.composite
def moves(draw: st.DrawFn, law: Law, slowest: int, most: int) -> tuple[Values, int]:
    """Settings from everywhere in their ranges, none so slow that a move takes hours."""
    values = {
        setting.name: draw(st.integers(max(setting.low, min(slowest, setting.high)), setting.high))
        if setting.high > 1000
        else draw(st.integers(setting.low, setting.high))
        for setting in law.settings
    }
    return values, draw(st.integers(1, most))


@settings(max_examples=12)
@given(st.data())
@pytest.mark.parametrize("model", ["gs-c200", "gs-c200s"])
def test_a_gsc200_gives_the_pulses_of_its_law(model: str, data: st.DataObject) -> None:
    law = laws.law(model)
    values = {"S": data.draw(st.integers(1, 1000)), "T": data.draw(st.integers(1, 1000)),
              "R": data.draw(st.integers(1, 999))}  # fmt: skip
    same(law, values, data.draw(st.integers(1, 1500)))


@settings(max_examples=12)
@given(st.data())
def test_a_dcb274_gives_the_pulses_of_its_law(data: st.DataObject) -> None:
    law = laws.law("dcb-274")
    values, steps = data.draw(moves(law, 200, 1500))
    same(law, {**values, "D": data.draw(st.integers(1, 4))}, steps)


@settings(max_examples=10)
@given(st.data(), st.integers(1, 64), st.sampled_from(["X", "Y"]))
def test_a_genstepper_gives_the_pulses_of_its_law(data: st.DataObject, size: int, axis: str) -> None:
    law = laws.law("bs0610", {"step_size": str(size)}, axis)
    values, steps = data.draw(moves(law, 200, 2000))
    same(law, values, steps, f"options = {{ step_size = {size} }}", axis)


@settings(max_examples=10)
@given(st.data(), st.sampled_from(["hyperbola", "exact"]))
def test_a_supersigma_gives_the_pulses_of_its_law(data: st.DataObject, short: str) -> None:
    law = laws.law("supersigma", {"short": short})
    values = {"limit": data.draw(st.integers(7, law.settings[0].high))}
    same(law, values, data.draw(st.integers(1, 9000)), f'options = {{ short = "{short}" }}')


def test_every_model_of_the_catalogue_has_a_law() -> None:
    for name, model in MODELS.items():
        law = laws.law(name)
        assert law.model == model.name
        assert law.values == clipped(law, {})
        assert law.train(law.values, 100).steps == 100
        assert read(name, spelled(law, law.values).split())[1] == law.values


def test_settings_are_read_as_people_write_them() -> None:
    law, values = read("dcb-274", ["i=800", "V=6000", "K=7,5"])
    assert values == {**law.values, "I": 800, "V": 6000, "K up": 7, "K down": 5}
    assert read("dcb-274", ["K=7"])[1]["K down"] == 7
    assert spelled(law, values) == f"I=800 V=6000 K=7,5 D={values['D']}"
    finer, _ = read("bs0610", ["step-size=1", "P=30000"])
    assert finer.windings[0].name == "1/64"


@pytest.mark.parametrize(
    ("model", "text", "words"),
    [("gs-c200", "S20", "write NAME=VALUE, like S="), ("gs-c200", "X=3", "there are: S, T, R"),
     ("gs-c200", "T=5000", r"T takes 1 to 1000 \(slew speed, steps/s / 10\)"), ("gs-c200", "R=1.5", "no whole number"),
     ("gs-c200", "R=nan", "no whole number"), ("dcb-274", "K=1,2,3", "give one number, or 2"),
     ("gs-c200", "=3", "write NAME=VALUE"), ("supersigma", "limits=3", "did you mean limit")],
)  # fmt: skip
def test_what_no_command_takes_is_refused_with_what_it_takes(model: str, text: str, words: str) -> None:
    with pytest.raises(SettingError, match=words):
        read(model, [text])


def test_the_settings_of_a_gsc200_are_those_of_its_table() -> None:
    """S and T count tens of steps a second ("a by 10 multiplier is used"), R steps, 1 to 999."""
    start_stop, slew, ramp = laws.law("gs-c200").settings
    assert (start_stop.name, start_stop.low, start_stop.high, start_stop.scale) == ("S", 1, 1000, 10)
    assert (slew.name, slew.unit) == ("T", "steps/s")
    assert (ramp.name, ramp.low, ramp.high, ramp.scale) == ("R", 1, 999, 1)


def test_genstepper_s_commands_choose_the_motor_first() -> None:
    """Page 36: the commands that follow X are for motor X; page 33: S with a number goes so far."""
    law = laws.law("bs0610", {}, "X")
    assert law.commands(law.values, 300) == (("X", "80K", "800R", "8000P"), "300S")


def test_the_settings_in_force_are_read_from_the_registers() -> None:
    assert in_force(laws.law("gs-c200"), {"S": "20", "T": "300", "R": "80"}) == {"S": 20, "T": 300, "R": 80}
    dcb = in_force(laws.law("dcb-274"), {"I": "500", "V": "2000", "K": "4/7", "D": "3"})
    assert dcb == {"I": 500, "V": 2000, "K up": 4, "K down": 7, "D": 3}
    assert in_force(laws.law("bs0610", {}, "Y"), {"X K": "1", "Y K": "90", "Y R": "700"}, "Y")["K"] == 90


def test_the_stepping_is_what_h_of_a_dcb274_says_and_else_the_usual_one() -> None:
    """Page 40: H 1, the factory value, is a quarter step."""
    assert stepping(laws.law("dcb-274"), {"H": "1/4"}) == "1/4"
    assert stepping(laws.law("dcb-274"), {"H": "Full"}) == "full"
    assert [winding.name for winding in laws.law("dcb-274").windings] == ["1/4", "1/8", "half", "full", "1/2", "wave"]
    assert stepping(laws.law("gs-c200"), {}) == "half"
    assert stepping(laws.law("bs0610", {}, "Y"), {"X O": "1", "Y O": "2"}, "Y") == "O2"
    assert stepping(laws.law("bs0610", {}, "Y"), {"X O": "1", "Y O": "3"}, "Y") == "1/16"
    assert stepping(laws.law("bs0610", {"step_size": "3"}), {}) == ""  # 3/64 divide no full step


def test_what_no_command_takes_is_brought_into_its_range() -> None:
    law = laws.law("gs-c200")
    assert clipped(law, {"S": 0, "T": 5000}) == {"S": 1, "T": 1000, "R": 40}


def test_an_unknown_model_or_option_is_refused_with_the_likeliest_other() -> None:
    with pytest.raises(CatalogueError, match="did you mean gs-c200"):
        laws.law("gs-c20")
    with pytest.raises(CatalogueError, match="ramp"):
        laws.law("bs0610", {"rampp": "1"})


@pytest.mark.parametrize(("model", "axis", "words"), [("bs0610", "Z", "there are: X, Y"), ("gs-c200", "X", "one axis")])
def test_an_axis_that_a_model_does_not_have_is_refused(model: str, axis: str, words: str) -> None:
    with pytest.raises(CatalogueError, match=words):
        laws.law(model, {}, axis)


@settings(max_examples=15)
@given(st.data())
@pytest.mark.parametrize("model", ["gs-c200", "gs-c200s", "dcb-274", "bs0610", "supersigma"])
def test_settings_that_contradict_each_other_are_said_to_and_made_as_said(model: str, data: st.DataObject) -> None:
    """Out of range is one line; else the pulses are the unit's, and evenly spaced just where the words say no ramp."""
    axis = "X" if model == "bs0610" else ""
    law = laws.law(model, {}, axis)
    fast = {"P": 62_500, "K up": 100, "K down": 100, "D": 4, "R": 800 if model == "bs0610" else 50}
    wild = {}
    for setting in law.settings:
        top = fast.get(setting.name, setting.high)
        least = max(setting.low, min(200, top // 8))
        wild[setting.name] = data.draw(st.sampled_from([setting.low - 1, setting.high + 1, least, top])
                                       | st.integers(least, top))  # fmt: skip
    outside = [s.name for s in law.settings if not s.low <= wild[s.name] <= s.high]
    words = spelled(law, wild).split()
    if outside:
        with pytest.raises(SettingError) as refused:
            read(model, words, axis)
        assert refused.value.args[0].count("\n") == 0
        assert any(f": {name} takes " in refused.value.args[0] for name in outside)
        return
    law, values = read(model, words, axis)
    assert values == wild
    steps = data.draw(st.integers(3, 600))
    same(law, values, steps, axis=axis)
    gaps = np.diff(emulated(law, values, steps, axis=axis))
    ends = {"gs-c200": ("S", "T"), "gs-c200s": ("S", "T"), "dcb-274": ("I", "V"), "bs0610": ("K", "R")}
    remark = law.remark(values)
    if model == "supersigma":
        assert bool(remark) == (values["limit"] * 100 < 650)
    else:
        first, top_ = (values[name] for name in ends[model])
        assert not (remark and first <= top_)
        assert remark or first <= top_ or model == "dcb-274"  # whose timer makes one count of rates that are close
    if remark:
        tick = {"dcb-274": 8_036, "bs0610": 16_000, "supersigma": 500}.get(model, 1)
        assert gaps.max() - gaps.min() <= tick
