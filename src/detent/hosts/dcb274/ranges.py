"""What a DCB-274 can be told: numbers in their ranges, checked before anything is sent (pages of the manual)."""

from math import sqrt
from typing import Final

from detent.hosts.dcb274.names import is_name

FARTHEST: Final = 8_388_607  # steps from the origin (page 47)
MOST_STEPS: Final = 16_777_215  # of one index (page 55)
SLOWEST, FASTEST = 40, 36_000  # steps/s that the unit is told (page 65)
CEILING: Final = 41_480  # steps/s that it makes of 36 000, the "42,000 SPS ceiling" in ticks of its timer (page 65)
LARGEST_ADDRESS: Final = 2047
TABLE_RATE: Final = 1095.4  # steps/s, times the square root of an entry's number: our reading of the fixed table


def ramp_seconds(initial: float, slew: float, divide: int) -> float:
    """How long a ramp takes for each unit of K: so many steps at I, and at each entry of the fixed table up to V.

    The table "approximates straight-line acceleration" (page 48); which one it is, the manual does not say.
    """
    entries = range(int((initial / TABLE_RATE) ** 2) + 1, int((slew / TABLE_RATE) ** 2) + 1)
    return divide * (1 / initial + sum(1 / (TABLE_RATE * sqrt(entry)) for entry in entries))


def between(value: int, low: int, high: int, what: str) -> int:
    """`value`, if it is from `low` to `high`. Raises ValueError."""
    if not low <= value <= high:
        raise ValueError(f"{what} is {low} to {high}, not {value}")
    return value


def place(position: int) -> int:
    """A position that the unit can be told. Raises ValueError."""
    return between(position, -FARTHEST, FARTHEST, "a position")


def speed(rate: float, *, signed: bool = False) -> int:
    """A rate that the unit can be told, in whole steps/s. Raises ValueError."""
    whole = round(rate)
    if signed and whole == 0:
        return 0
    if not SLOWEST <= (abs(whole) if signed else whole) <= FASTEST:
        either = "with a sign, or 0, " if signed else ""
        raise ValueError(f"a rate is {SLOWEST} to {FASTEST} steps/s, {either}not {rate:g}; divide() makes slower ones")
    return whole


def commanded_rate(rate: float) -> float:
    """The rate that the unit is told so that it makes `rate`: up to its ceiling that is 36 000 steps/s at most."""
    return max(-FASTEST, min(rate, FASTEST)) if abs(rate) <= CEILING else rate


def sign(direction: int) -> int:
    """+1 or -1. Raises ValueError."""
    if direction not in (-1, 1):
        raise ValueError(f"a direction is +1 or -1, not {direction}")
    return direction


def program_address(address: int) -> int:
    """An address at which a program may stand (page 59). Raises ValueError."""
    if not (0 <= address <= 192 or 256 <= address <= LARGEST_ADDRESS):
        raise ValueError(f"programs stand at 0 to 192 or 256 to {LARGEST_ADDRESS}, not at {address} (page 59)")
    return address


def name_of_axis(name: str) -> str:
    """A name that an axis can be given (page 23). Raises ValueError."""
    if not is_name(name):
        raise ValueError(f"a name is one character, not SPACE and none of [ \\ ] ^ _ ` @, not {name!r} (page 23)")
    return name
