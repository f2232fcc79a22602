"""The DCB-274's driver without any port: dialogues as its manual has them."""

from pathlib import Path

import pytest
from tests.hosts.dialogues import Player, Scene, scenes

from detent.hosts.axis import Limits, Speeds
from detent.hosts.dcb274 import Dcb274
from detent.hosts.dcb274.answers import Inputs, JogInputs, Listed, Listing, Ports, Settings
from detent.hosts.dcb274.ranges import ramp_seconds
from detent.hosts.exchange import Answer, Ask

FOLDER = Path(__file__).parent / "dialogues" / "dcb274"
SCENES = [(file, scene) for file in sorted(FOLDER.glob("*.txt")) for scene in scenes(file)]


def ready(unit: Dcb274, *answers: bytes) -> Dcb274:
    """The driver behind its sign-on, in which it was given these answers."""
    steps, left = unit.connect(), list(answers)
    step = next(steps)
    try:
        while True:
            wanted = isinstance(step, Ask) and step.complete is not None
            answer = left.pop(0) if wanted else b""
            step = steps.send(Answer(answer, whole=bool(answer)))
    except StopIteration:
        return unit


def signed_on() -> Dcb274:
    banner = b"     110 AMS SMC-27X2 V1.10\r\n"
    settings = b" K= 5/5, I= 802, V= 10370, D= 1, b=30, s, 1/4, n=A\r\n"
    return ready(Dcb274(), banner, b"X", settings, b"Z", b"        0\r\n")


def axis(name: str) -> Dcb274:
    return ready(Dcb274(name, mode="party"), b"", name.encode(), b"\n", name.encode(), b"X", b"  26\n")


def known(name: str) -> Dcb274:
    return ready(Dcb274(name, mode="sin10"), f"{name}X  26\r\n".encode())


NAMES = {
    "Dcb274": Dcb274, "Inputs": Inputs, "JogInputs": JogInputs, "Limits": Limits, "Listed": Listed,
    "Listing": Listing, "Ports": Ports, "Settings": Settings, "Speeds": Speeds,
    "ramp_seconds": ramp_seconds, "signed_on": signed_on, "axis": axis, "known": known,
}  # fmt: skip


@pytest.mark.parametrize(("file", "scene"), SCENES, ids=[f"{file.stem}: {scene.title}" for file, scene in SCENES])
def test_the_driver_speaks_as_the_manual_says(file: Path, scene: Scene) -> None:
    Player(scene, NAMES)


@pytest.mark.parametrize(
    ("name", "mode", "message"),
    [
        ("X", "rs485", "mode 'rs485': choose from single, party, daisy, sin10"),
        ("", "party", "in mode party an axis has a name of one character, not ''"),
        ("^", "daisy", r"in mode daisy an axis has a name of one character, not '\^'"),
        ("XY", "sin10", "not 'XY'"),
    ],
)
def test_what_is_no_mode_and_no_name_is_refused_at_once(name: str, mode: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Dcb274(name, mode=mode)


def test_a_move_that_waits_for_its_turn_is_given_up_when_the_axis_is_stopped() -> None:
    """Page 28: @ in a pending period cancels the command that waits. Here it waits on the host's side."""
    unit = signed_on()
    waiting = unit.index_to(5)
    sent = [next(waiting)]
    sent += [waiting.send(answer) for answer in (Answer(), Answer(b"^"), Answer(b"   1\r\n"))]
    assert type(sent[-1]).__name__ == "Rest"  # the port is free
    stopping = unit.stop()
    next(stopping)
    for answer in (Answer(), Answer(b"@")):
        stopping.send(answer)
    with pytest.raises(StopIteration):
        stopping.send(Answer(b"\r\n"))
    with pytest.raises(RuntimeError, match="gave up 'R5': the axis was stopped before its turn came"):
        waiting.send(Answer())
