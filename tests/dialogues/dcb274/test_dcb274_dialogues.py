"""Every dialogue file of the DCB-274, scene by scene."""

from pathlib import Path

import pytest
from tests.dialogues.dcb274.player import Player, Scene, files, scenes

ALL = [(path, scene) for path in files() for scene in scenes(path.read_text())]


@pytest.mark.parametrize(("path", "scene"), ALL, ids=[f"{path.stem}: {scene.title}" for path, scene in ALL])
def test_the_controller_answers_as_its_manual_says(path: Path, scene: Scene) -> None:
    Player(scene)


def test_every_file_names_its_pages_on_line_1() -> None:
    for path in files():
        assert path.read_text().startswith("DCB-274 manual, page"), path.name


def test_a_dialogue_fails_when_an_answer_is_wrong_left_over_or_missing() -> None:
    for body in ("> Z\n< Z        1\n", "> Z\n", "> Z\n< Z        0\n< Z\n", "expect position 1\n", "expect P4 = 0\n"):
        with pytest.raises(AssertionError, match="line"):
            Player(next(scenes("title\nscene wrong\n" + body)))
