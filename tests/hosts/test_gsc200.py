"""The driver of the GS-C200 and GS-C200S, without any port: what it says, and what it makes of the answers."""

from pathlib import Path
from typing import Any

import pytest
from tests.hosts.dialogues import Player, Scene, scenes

from detent.hosts import axis, gsc200
from detent.hosts.exchange import NOTHING, Answer, Ask
from detent.hosts.gsc200 import GsC200
from detent.hosts.gsc200.dialogue import LEAVING

FOLDER = Path(__file__).parent / "dialogues" / "gsc200"
SCENES = [
    pytest.param(scene, id=f"{file.name}: {scene.title}")
    for file in sorted(FOLDER.glob("*.txt"))
    for scene in scenes(file)
]


def met(*given: Any, **named: Any) -> GsC200:
    """A driver that knows its module to be in command mode, and that nothing is left of a line."""
    unit = GsC200(*given, **named)
    for steps, said in ((unit.halt(), "Y"), (unit.pins(), "V00")):
        answer = NOTHING
        try:
            step = next(steps)
            while True:
                wants = isinstance(step, Ask) and step.data and step.complete is not None
                text = said.encode()
                frame = text + (bytes([unit.frames.checksum(text)]) if unit.frames.checksums else b"") + b"\r"
                answer = Answer(frame) if wants else Answer(whole=False)
                step = steps.send(answer)
        except StopIteration:
            pass
    return unit


NAMES = {
    "GsC200": met,
    "Unmet": GsC200,
    "Feedback": gsc200.Feedback,
    "UserPins": gsc200.UserPins,
    "Speeds": axis.Speeds,
    "Limits": axis.Limits,
    "LEAVING": LEAVING,
}


@pytest.mark.parametrize("scene", SCENES)
def test_dialogue(scene: Scene) -> None:
    Player(scene, NAMES)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"model": "gs-c300"}, "no model 'gs-c300' is driven so; it is gs-c200 or gs-c200s"),
        ({"address": 8}, "an address is 1 to 7 .*, or None .*, not 8"),
        ({"revision": "two"}, "a revision is written like 2.1 or 2.2, not 'two'"),
    ],
)
def test_a_module_that_there_cannot_be_is_refused_when_it_is_named(given: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        GsC200(**given)  # type: ignore[arg-type]
