"""The SUPERSIGMA's drivers without any port: messages and answers (Cassinis, table 1; the codes are ours)."""

from math import asin, sqrt
from pathlib import Path

import pytest
from tests.hosts.dialogues import Player, Scene, scenes

from detent.hosts.axis import Limits, Speeds
from detent.hosts.supersigma import Ccu, Report, Supersigma

FOLDER = Path(__file__).parent / "dialogues" / "supersigma"
SCENES = [(file, scene) for file in sorted(FOLDER.glob("*.txt")) for scene in scenes(file)]
NAMES = {
    "Ccu": Ccu, "Limits": Limits, "Report": Report, "Speeds": Speeds, "Supersigma": Supersigma,
    "asin": asin, "sqrt": sqrt,
}  # fmt: skip


@pytest.mark.parametrize(("file", "scene"), SCENES, ids=[f"{file.stem}: {scene.title}" for file, scene in SCENES])
def test_the_drivers_speak_as_the_bus_wants(file: Path, scene: Scene) -> None:
    Player(scene, NAMES)


def test_the_flags_have_names() -> None:
    report = Report(0, 0x1F)
    names = ("moving", "end_of_rail", "excessive_force", "originated", "refused")
    assert all(getattr(report, name) for name in names)
    for bit, name in enumerate(names):
        assert [other for other in names if getattr(Report(0, 1 << bit), other)] == [name]


def test_a_drive_has_a_number_of_one_byte() -> None:
    with pytest.raises(ValueError, match="a drive has a number of 0 to 255, not 256"):
        Supersigma(256)
