"""What a proof has counted."""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields

from tests.controllers.laws.bench import Action, Raw, Say


@dataclass
class Tally:
    """Numbers of one kind of target; `failures` are the files of the cases, or their texts."""

    cases: int = 0
    frames: int = 0
    events: int = 0
    pulses: int = 0
    images: int = 0
    refused: int = 0  # images, and actions, with an error in words
    copies: int = 0
    replays: int = 0
    stops: int = 0
    failures: list[str] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        """Take over what another has counted."""
        for one in fields(self):
            setattr(self, one.name, getattr(self, one.name) + getattr(other, one.name))


def frames_of(actions: Iterable[Action]) -> int:
    """How many of them are frames."""
    return sum(isinstance(action, Say | Raw) for action in actions)
