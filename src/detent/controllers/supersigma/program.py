"""What is burnt into the 8748: the table of differences and the numbers that go with it.

The drive holds no programs of its user's; a change of curve is another EPROM. Its 1 024 bytes have room for the
program's other sections (the paper's table 2) and 254 differences.
"""

from typing import NamedTuple

from detent.ramps.differences import PAPER, Differences
from detent.ramps.ways import Way

OFFSET = 10  # "a small number (typically 10)"
LEAST_OFFSET = 4  # with fewer the pulses of a long movement would end before the table
BRAKING = 4  # loads of an emergency come so many times as often (our assumption)


class Program(NamedTuple):
    """The constants of one drive's firmware."""

    table: Differences = PAPER
    offset: int = OFFSET
    short: Way = Way.HYPERBOLA
    braking: int = BRAKING

    def __deepcopy__(self, _: object) -> "Program":
        return self
