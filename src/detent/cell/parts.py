"""Units that are not controllers: what else may stand under ``[units.NAME]``."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from detent.cell import damping, detector
from detent.controllers.catalogue import Option
from detent.controllers.device import Device
from detent.lines import sin
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
    adapter: bool = False  # it has a line to its host, and may itself be the host of one


def _switch(text: str) -> bool:
    return {"party": True, "single": False}[text.strip().lower()]


def _mode(text: str) -> bool:
    return {"converter": True, "intelligent": False}[text.strip().lower()]


def _one_of(*rates: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        if int(text) not in rates:
            raise ValueError(text)
        return int(text)

    return read


def _checked(read: Callable[[str], bool]) -> Callable[[str], bool]:
    def checked(text: str) -> bool:
        try:
            return read(text)
        except KeyError:
            raise ValueError(text) from None

    return checked


_HOST_RATES = (1200, 2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200)
_AXIS_RATES = (9600, 19_200, 38_400, 460_800)
_SWITCH = Option("switch", "party", _checked(_switch), "party or single", "party", "the switch when the cell starts")
_OFF = _SWITCH._replace(default="single")  # "all (8) switches in off position" (manual of the DCB-274, page 4)

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
    "sin-8": Part(
        "sin-8",
        "SIN-8 serial adapter: RS-232 to a party line, with its party/single switch",
        sin.PINS,
        (
            Option("baud", "baud", _one_of(*_AXIS_RATES), "9600, 19200, 38400 or 460800", "9600", "rate of both sides"),
            _SWITCH,
        ),
        sin.Sin8,
        adapter=True,
    ),
    "sin-10": Part(
        "sin-10",
        "SIN-10 intelligent serial adapter: buffers, handshake, scan and wait",
        sin.PINS,
        (
            Option("baud", "baud", _one_of(*_HOST_RATES), "1200 to 115200", "9600", "rate of the host's side"),
            Option(
                "line_baud",
                "line_baud",
                _one_of(*_AXIS_RATES),
                "9600, 19200, 38400 or 460800",
                "9600",
                "rate of the party line",
            ),
            _OFF,
            Option(
                "mode",
                "converter",
                _checked(_mode),
                "intelligent or converter",
                "intelligent",
                "do the handshake, or be a SIN-8",
            ),
        ),
        sin.Sin10,
        adapter=True,
    ),
    "phase-reversal": Part(
        "phase-reversal",
        "bang-bang damper between step clock and drive, from MOV and RAMP",
        damping.PINS,
        (
            Option("brake", "brake", parse_duration, "a duration", "2 ms", "from the last pulse to the step back"),
            Option(
                "release", "release", parse_duration, "a duration", "3 ms", "from the last pulse to the step forward"
            ),
        ),
        damping.PhaseReversal,
    ),
}
