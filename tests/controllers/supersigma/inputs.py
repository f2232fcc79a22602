"""What may reach a SUPERSIGMA drive: messages to it and to others, garbage, levels; and the drives themselves."""

from collections.abc import Callable

from hypothesis import strategies as st
from tests.controllers.conformance import Candidate

from detent.controllers.supersigma.firmware import Supersigma
from detent.ramps.ways import Way
from detent.ticks import MS, US, Ns
from detent.uart import Char

INPUTS = ("RAIL", "FORCE", "T0")
NUMBER = 1

CODES = st.sampled_from([1, 2, 3, 4, 5, 6, 7, 0x81, 0x82, 0x83]) | st.integers(0, 255)
FEW = st.sampled_from([0, 1, 2]) | st.integers(0, 420)
STEPS = st.sampled_from([0, 1, 2, 403, 404, 5143, 5144, 65_535]) | st.integers(0, 900) | st.integers(0, 65_535)
SPEEDS = st.sampled_from([0, 1, 6, 60, 255])


def _message(number: int, code: int, steps: int, speed: int) -> bytes:
    low = code & 0x7F
    return bytes([number, code]) + steps.to_bytes(2, "big") * (low in (1, 2, 3)) + bytes([speed]) * (low in (2, 3))


GARBAGE = st.binary(min_size=1, max_size=6)


def _spaced(data: bytes, gap: Ns) -> list[tuple[Ns, Char]]:
    return [(gap if index else 0, Char(value)) for index, value in enumerate(data)]


def frames(steps: st.SearchStrategy[int]) -> st.SearchStrategy[list[tuple[Ns, Char]]]:
    """Messages with such steps, and garbage."""
    messages = st.builds(_message, st.sampled_from([NUMBER, NUMBER, NUMBER, 0, 2]), CODES, steps, SPEEDS)
    return st.builds(_spaced, messages | messages | messages | GARBAGE, st.sampled_from([0, 50 * US, 3 * MS]))


def _wired() -> Supersigma:
    drive = Supersigma(number=NUMBER)
    drive.watch("OUT0")
    return drive


def _candidate(name: str, make: Callable[[], Supersigma]) -> Candidate:
    return Candidate(name, make, frames(STEPS), INPUTS, "BUS")


CANDIDATES = (
    _candidate("supersigma", lambda: Supersigma(number=NUMBER)),
    _candidate("supersigma, exact, no line timing", lambda: Supersigma(short=Way.EXACT, line_timing=False)),
    _candidate("supersigma, free, least offset", lambda: Supersigma(short=Way.FREE, offset=4, braking=100)),
    # every pulse is a deadline, and its end another
    Candidate("supersigma, pulses wired", _wired, frames(FEW), INPUTS, "BUS", st.integers(0, 30 * MS), 60_000),
)
