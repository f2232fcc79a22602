"""The table of differences of the SUPERSIGMA drive, and the compiler that makes one from a curve V(t).

A curve is taken at instants one interval apart. Each speed becomes the N of the rate generator that comes nearest,
N = INT(2e6 / V - 1 + 0.5) (Cassinis, equation 2); the table holds by how much each N is less than the one before,
a byte each. The first N stands in the program.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate, islice, pairwise
from typing import Any

from detent.ramps.rate_generator import CLOCK_HZ, CLOCK_NS
from detent.ticks import SECOND

INTERVAL = 2580  # clocks between two loads: 1.29 ms
LARGEST_N = 0xFFFF
LARGEST_DIFFERENCE = 0xFF

EPROM = 1024  # bytes of the 8748
PROGRAM: dict[str, int] = {"command reception": 50, "ramp generation": 198, "additional features": 522}
"""Bytes of the drive's program beside the table (the paper's table 2)."""
ROOM = EPROM - sum(PROGRAM.values())
MOST_INSTANTS = 1 << 16  # of a curve that are looked at, to say where it does not fit

Curve = Callable[[float], float]
"""Speed in half steps a second over time in seconds."""


class CurveError(ValueError):
    """A curve that cannot be a table; the text says where, why and what to do."""


@dataclass(frozen=True, slots=True)
class Differences:
    """A compiled table: the first N, the differences, the clocks between two loads.

    ValueError unless the first N and all that follow fit 16 bits, the differences a byte, and there is one at least.
    """

    first: int
    differences: bytes
    interval: int = INTERVAL

    def __post_init__(self) -> None:
        if not self.differences or self.interval < 1:
            raise ValueError("a table has at least one difference and an interval of at least one clock")
        if not sum(self.differences) < self.first <= LARGEST_N:
            raise ValueError(f"the first N is at most {LARGEST_N} and more than all differences together, "
                             f"{sum(self.differences)}; it is {self.first}")  # fmt: skip

    def __copy__(self) -> "Differences":
        return self

    def __deepcopy__(self, _: Any) -> "Differences":
        return self

    def counts(self, first: int | None = None) -> list[int]:
        """The N from the first (its own, or another) to the last: one more than there are differences."""
        start = self.first if first is None else first
        return list(accumulate(self.differences, lambda n, difference: n - difference, initial=start))

    @property
    def bytes_of_program(self) -> int:
        """What the whole program takes with this table (the paper's table 2)."""
        return sum(PROGRAM.values()) + len(self.differences)

    def entries_up_to(self, speed: int) -> int:
        """How many differences may be taken before a speed above `speed` half steps/s is reached."""
        return max(sum(speed * (n + 1) >= CLOCK_HZ for n in self.counts()) - 1, 0)

    def __str__(self) -> str:
        """As the option `table` of the drive takes it: first N, interval in clocks, differences in hex."""
        return f"{self.first}:{self.interval}:{self.differences.hex()}"


def parse(text: str) -> Differences:
    """The table that `str` of one gives. Raises ValueError."""
    try:
        first, interval, differences = text.strip().split(":")
        return Differences(int(first), bytes.fromhex(differences), int(interval))
    except ValueError as error:
        raise ValueError(f"a table is written FIRST-N:CLOCKS:DIFFERENCES-IN-HEX ({error})") from error


def nearest_count(speed: float | Fraction) -> int:
    """The N for a speed in half steps/s (equation 2)."""
    return math.floor(CLOCK_HZ / speed - 1 + 0.5)


def instants(duration: float, interval: int = INTERVAL) -> Iterator[float]:
    """The seconds of the instants on the grid, 0 and as many as fit `duration`."""
    step = Fraction(interval * CLOCK_NS, SECOND)
    last = math.floor(Fraction(str(duration)) / step)
    return (float(i * step) for i in range(last + 1))


def compiled(curve: Curve, duration: float, interval: int = INTERVAL) -> Differences:
    """The table of `curve` from t = 0 to `duration` seconds. Raises CurveError with the place of the first fault."""
    times = list(islice(instants(duration, interval), MOST_INSTANTS + 1))
    if len(times) > MOST_INSTANTS:
        raise CurveError(f"the curve lasts {duration:g} s, more than {MOST_INSTANTS} intervals of "
                         f"{shown_interval(interval)}: make it shorter or the interval longer")  # fmt: skip
    if len(times) < 2:
        raise CurveError(f"the curve lasts {duration:g} s and the interval is {shown_interval(interval)}: "
                         "there is no difference; make the curve longer or the interval shorter")  # fmt: skip
    counts = [_count(curve(t), t) for t in times]
    for i, (before, after) in enumerate(pairwise(counts)):
        if not 0 <= before - after <= LARGEST_DIFFERENCE:
            raise CurveError(_misfit(curve, times, counts, i))
    if len(counts) - 1 > ROOM:
        raise CurveError(f"{len(counts) - 1} differences, and beside the program the 8748 has room for {ROOM} bytes: "
                         "make the curve shorter or the interval longer")  # fmt: skip
    differences = bytes(a - b for a, b in pairwise(counts))
    return Differences(counts[0], differences, interval)


def shown_interval(interval: int) -> str:
    """An interval in clocks as people read it."""
    return f"{interval * CLOCK_NS / 1e6:g} ms"


def _count(speed: float, t: float) -> int:
    if not (math.isfinite(speed) and speed > 0):
        raise CurveError(f"at t = {t:.5f} s the speed is {speed:g}: every speed of a curve is above 0")
    n = nearest_count(speed)
    if not 1 <= n <= LARGEST_N:
        low, high = CLOCK_HZ / (LARGEST_N + 1), CLOCK_HZ / 2
        raise CurveError(f"at t = {t:.5f} s the speed is {speed:g} half steps/s: the rate generator gives "
                         f"{low:.4g} to {high:.0f}")  # fmt: skip
    return n


def _misfit(curve: Curve, times: Sequence[float], counts: Sequence[int], i: int) -> str:
    difference = counts[i] - counts[i + 1]
    place = (f"difference {i + 1}, between t = {times[i]:.5f} s ({curve(times[i]):.4g} half steps/s, N = {counts[i]}) "
             f"and t = {times[i + 1]:.5f} s ({curve(times[i + 1]):.4g} half steps/s, N = {counts[i + 1]})")  # fmt: skip
    if difference < 0:
        return f"{place} is {difference}: the curve may not fall; a table is for speeding up"
    return f"{place} is {difference} and does not fit a byte: make the curve less steep there or the interval shorter"


PAPER = Differences(3076, bytes.fromhex(
    "a3968a80776e676059544e4a45413d393634302e2c2927252422201e1d1c1b19"
    "1917161614141312111110100f0e0e0d0d0d0c0b0c0b0a0a0a090a0908090808"
    "0708070707060706060605060506050505040504050404040404040304040303"
    "0403030303030302030302030203020203020202020202020202020201020201"
    "0202010201020101020101020101010201010101010101010101010101010101"
    "0001010101000101010001010001000101000100010001000100010001000100"
    "0001000001000001000001000000010000000100000000000100000000000000"
    "0000010000000000"
))  # fmt: skip
"""The paper's table, of 15 000 sin^2(4.544 26 t + 0.2097): kept as bytes, so that no mathematical library has a say."""
