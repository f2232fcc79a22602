"""What a host, a hand and bad luck may do to one unit: mostly what the manual has, some of it damaged, some noise.

The actions are those of `tests.controllers.laws`, made from a number. Severity is on what broke things before: control
characters, frames that are nearly right, inputs that change in one instant, the supply, damaged images.
"""

from collections.abc import Sequence
from random import Random
from typing import Final

from tests.controllers.laws.adapter import Model
from tests.controllers.laws.bench import Action, Power, Put, Raw, Say, Wait
from tests.controllers.laws.histories import gap

from detent.controllers.device import Controller
from detent.pins import HIGH, LOW, PinKind
from detent.ticks import MS

CONTROL: Final = bytes((*range(32), 127, 128, 255))
INPUTS: Final = (PinKind.INPUT,)


def stream(model: Model, device: Controller, draw: Random, frames: int, *, sound: bool) -> list[Action]:
    """So many frames, about, with all that happens between them; a `sound` one has only what the manual has."""
    actions: list[Action] = []
    pins = [pin.name for pin in device.pins if pin.kind in INPUTS]
    told = 0
    while told < frames:
        made = list(model.actions(draw)) if sound or draw.random() < 0.6 else _rough(model, device, draw, pins)
        told += sum(isinstance(action, Say | Raw) for action in made)
        actions += made
        if draw.random() < 0.7:
            actions.append(Wait(gap(draw)))
    return actions


def _rough(model: Model, device: Controller, draw: Random, pins: Sequence[str]) -> list[Action]:
    match draw.randrange(10):
        case 0 | 1 | 2 | 3:
            return [
                _damaged(action, device, draw) if isinstance(action, Say) else action for action in model.actions(draw)
            ]
        case 4:
            return [Raw(bytes(draw.choices(CONTROL, k=draw.randint(1, 6))))]
        case 5:
            said = [action for action in model.actions(draw) if isinstance(action, Say)]
            return [action for action in said for _ in range(draw.choice((2, 3, 40)))]
        case 6:
            return [Raw(draw.randbytes(draw.randint(1, 20)), draw.randrange(-1, 3))]
        case 7:
            return [Put(draw.choice(pins), draw.choice((LOW, HIGH))) for _ in range(draw.randint(1, 12))]
        case 8:  # all of an answer is under way, or nothing is
            return [*model.actions(draw), Power(draw.random() < 0.3), Wait(draw.choice((0, 0, 1, MS))), Power(True)]
    held = draw.sample(pins, min(2, len(pins)))
    return [*(Put(pin, LOW) for pin in held), *model.actions(draw), *(Put(pin, HIGH) for pin in held)]


def _damaged(said: Say, device: Controller, draw: Random) -> Raw:
    """A frame that is nearly right."""
    data = bytearray(device.frame(said.text))
    for _ in range(draw.choice((1, 1, 2, 3))):
        place = draw.randrange(len(data) + 1)
        match draw.randrange(5):
            case 0:
                data[place:place] = draw.choices(CONTROL)
            case 1:
                data[place:place] = bytes((draw.randrange(256),))
            case 2:
                del data[place : place + 1]
            case 3:
                data[place:place] = data[max(place - 3, 0) : place]
            case _:
                if place < len(data):
                    data[place] ^= 1 << draw.randrange(8)
    return Raw(bytes(data), draw.randrange(-1, len(data)) if draw.random() < 0.2 else -1)


def damaged_image(image: bytes, draw: Random) -> bytes:
    """A non-volatile memory of which some is not as it was written."""
    data = bytearray(image)
    for _ in range(draw.choice((0, 1, 1, 2, 30))):
        match draw.randrange(4):
            case 0 if data:
                data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
            case 1 if data:
                del data[draw.randrange(len(data)) :]
            case 2:
                data += draw.randbytes(draw.randint(1, 9))
            case _ if data:
                data[draw.randrange(len(data))] = draw.choice((0, 255, draw.randrange(256)))
    return bytes(data)
