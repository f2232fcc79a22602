"""What may reach a SUPERSIGMA drive: messages to it and to others, garbage, levels; and the drives themselves."""

from collections.abc import Callable

from hypothesis import strategies as st

from detent.controllers.supersigma.firmware import Supersigma
from detent.ramps.short_movements import Way
from detent.ticks import MS, US, Ns
from detent.uart import Char
from tests.controllers.conformance import Candidate

INPUTS = ("RAIL", "FORCE", "T0")
NUMBER = 1

CODES = st.sampled_from([1, 2, 3, 4, 5, 6, 7, 0x81, 0x82, 0x83]) | st.integers(0, 255)
STEPS = st.sampled_from([0, 1, 2, 403, 404, 5143, 5144, 65_535]) | st.integers(0, 900) | st.integers(0, 65_535)
SPEEDS = st.sampled_from([0, 1, 6, 60, 255])


def _message(number: int, code: int, steps: int, speed: int) -> bytes:
    low = code & 0x7F
    return bytes([number, code]) + steps.to_bytes(2, "big") * (low in (1, 2, 3)) + bytes([speed]) * (low in (2, 3))


MESSAGES = st.builds(_message, st.sampled_from([NUMBER, NUMBER, NUMBER, 0, 2]), CODES, STEPS, SPEEDS)
GARBAGE = st.binary(min_size=1, max_size=6)


def _spaced(data: bytes, gap: Ns) -> list[tuple[Ns, Char]]:
    return [(gap if index else 0, Char(value)) for index, value in enumerate(data)]


FRAMES = st.builds(_spaced, MESSAGES | MESSAGES | MESSAGES | GARBAGE, st.sampled_from([0, 50 * US, 3 * MS]))


def _wired() -> Supersigma:
    drive = Supersigma(number=NUMBER)
    drive.watch("OUT0")
    return drive


def _candidate(name: str, make: Callable[[], Supersigma], most: int = 40_000) -> Candidate:
    return Candidate(name, make, FRAMES, INPUTS, "BUS", most_per_second=most)


CANDIDATES = (
    _candidate("supersigma", lambda: Supersigma(number=NUMBER)),
    _candidate("supersigma, exact, no line timing", lambda: Supersigma(short=Way.EXACT, line_timing=False)),
    _candidate("supersigma, free, least offset", lambda: Supersigma(short=Way.FREE, offset=4, braking=100)),
    _candidate("supersigma, pulses wired", _wired, most=120_000),
)
