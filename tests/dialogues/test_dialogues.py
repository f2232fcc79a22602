"""Every dialogue file of every controller, scene by scene."""

from pathlib import Path

import pytest
from tests.dialogues.reader import Scene, files, play, scenes

CONTROLLERS = ("gsc200",)
ALL = [(path, scene) for controller in CONTROLLERS for path in files(controller) for scene in scenes(path.read_text())]


@pytest.mark.parametrize(("path", "scene"), ALL, ids=[f"{path.stem}: {scene.title}" for path, scene in ALL])
def test_the_controller_answers_as_its_manual_says(path: Path, scene: Scene) -> None:
    play(scene)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_every_file_names_its_place_in_the_manual_on_line_1(controller: str) -> None:
    for path in files(controller):
        first = path.read_text().splitlines()[0]
        assert first.startswith("GS-C200 datasheet, "), path.name
        assert ": " in first, path.name


def test_a_dialogue_fails_when_an_answer_is_wrong_left_over_or_missing() -> None:
    good = "manual, page 1: a test\nmodel gs-c200\n> F\n< R\n"
    for bad in ("> F\n", "> F\n< B\n", "> F\n< R\n< R\n", "< R\n", "> F\n<< R\n", "expect UO1 = 1\n", "jump\n"):
        for scene in scenes(good):
            play(scene)
        with pytest.raises(AssertionError, match=r"line \d"):
            play(next(iter(scenes(good + bad))))
