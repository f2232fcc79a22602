"""Units that are not controllers: what else may stand under ``[units.NAME]``."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from detent.cell import detector
from detent.controllers.catalogue import Option
from detent.controllers.device import Device
from detent.pins import Level, Pin
from detent.ticks import parse_duration


class Part(NamedTuple):
    """A part by its model name; the fields mean what they mean in `catalogue.Model`."""

    name: str
    title: str
    pins: tuple[Pin, ...]
    options: tuple[Option, ...]
    make: Callable[..., Device]
    straps: Mapping[str, Level] = {}


PARTS: dict[str, Part] = {
    "step-detector": Part(
        "step-detector",
        "detector of steps made, to be wired to ENABLE",
        detector.PINS,
        (
            Option("response", "response", parse_duration, "a duration", "200 us", "time the motor takes for a step"),
            Option("slow_from", "slow_from", int, "a step number", "1", "first step that takes slow_response"),
            Option("slow_to", "slow_to", int, "a step number", "0", "last step that takes slow_response"),
            Option("slow_response", "slow_response", parse_duration, "a duration", "0 s", "time of a slow step"),
        ),
        detector.StepDetector,
    ),
}
