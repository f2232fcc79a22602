"""The driver of a GenStepper board, without any port: what it says, and what it makes of the answers."""

from pathlib import Path

import pytest
from tests.hosts.dialogues import Player, Scene, scenes

from detent.hosts import axis, genstepper
from detent.hosts.genstepper import GenStepper

FOLDER = Path(__file__).parent / "dialogues" / "genstepper"
SCENES = [
    pytest.param(scene, id=f"{file.stem}: {scene.title}")
    for file in sorted(FOLDER.glob("*.txt"))
    for scene in scenes(file)
]
NAMES = {
    "GenStepper": GenStepper,
    "Action": genstepper.Action,
    "Latches": genstepper.Latches,
    "Reports": genstepper.Reports,
    "Speeds": axis.Speeds,
    "Limits": axis.Limits,
}


@pytest.mark.parametrize("scene", SCENES)
def test_dialogue(scene: Scene) -> None:
    Player(scene, NAMES)


def test_a_board_has_two_motors() -> None:
    with pytest.raises(ValueError, match="a board has the motors X and Y, not 'Z'"):
        GenStepper("Z")
