"""To tune without numba would take hours: whoever asks for it hears at once what installs it."""

import sys

import pytest

from detent.extras import MissingExtra
from detent.motors.drive import Drive
from detent.motors.load import Load
from detent.motors.named import motor
from detent.motors.rotor import Rig
from detent.moves.spelling import read
from detent.tuner.batch import answer
from detent.tuner.compare import compare
from detent.tuner.search import search
from detent.tuner.task import Task, moves_of

TOLD = "to tune and to compare moves needs numba, which is not installed: "


@pytest.fixture
def task(monkeypatch: pytest.MonkeyPatch) -> Task:
    monkeypatch.setitem(sys.modules, "numba", None)
    return Task("gs-c200", Rig(motor("as1010"), Drive(24, 1.0), Load()), moves_of("200"))


def test_no_search_begins(task: Task) -> None:
    with pytest.raises(MissingExtra, match=TOLD):
        search(task)


def test_nothing_is_compared(task: Task) -> None:
    both = [(text, *read("gs-c200", text.split())) for text in ("S=48 T=604 R=201", "S=102 T=405 R=36")]
    with pytest.raises(MissingExtra, match=TOLD):
        compare(task, both)


def test_a_worker_without_it_says_so_in_its_row(task: Task) -> None:
    assert answer(task).problem.startswith(TOLD)
