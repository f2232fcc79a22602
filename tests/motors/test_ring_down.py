"""The damping from a record, as scopes and encoders give them: noise, another zero, a beginning before the step."""

import numpy as np
import numpy.typing as npt
import pytest

from detent.motors.drive import Drive
from detent.motors.named import motor
from detent.motors.ring_down import Step, from_record, step
from detent.motors.rotor import Rig

RIG = Rig(motor("qsh4218-41-10-035"), Drive(24, 1.0))
RATIO = 0.09
Floats = npt.NDArray[np.float64]


def record() -> tuple[Floats, Floats]:
    """What the model itself does with that damping."""
    made = step(RIG, RATIO, 0.06)
    return made.times, made.places


def test_a_record_of_the_model_gives_its_damping() -> None:
    found = from_record(RIG, *map(list, record()))
    assert found.damping.ratio == pytest.approx(RATIO, rel=0.05)
    assert not found.words


@pytest.mark.parametrize("early", [0.005, 0.02, 0.1])
def test_a_record_may_begin_before_the_step(early: float) -> None:
    times, places = record()
    lead = np.arange(0, early, 1e-4)
    t, x = np.concatenate((lead, times + early)), np.concatenate((np.zeros(len(lead)), places))
    found = from_record(RIG, list(t), list(37.0 - 1.8 * x))
    assert found.damping.ratio == pytest.approx(RATIO, rel=0.1)
    assert not found.words


@pytest.mark.parametrize("much", [0.01, 0.03])
def test_noise_is_no_swing(much: float) -> None:
    times, places = record()
    noise = much * np.random.default_rng(1).standard_normal(len(times))
    assert Step(times, places + noise).frequency == pytest.approx(Step(times, places).frequency, rel=0.12)
    found = from_record(RIG, list(times), list(places + noise))
    assert found.damping.ratio == pytest.approx(RATIO, rel=0.3)
    assert not found.words
