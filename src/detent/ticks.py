"""Time as integers, and the only rounding in Detent.

Two units, both Python integers of any size:

* ``Ns``: nanoseconds since the cell was made. Every event, pulse and character has one.
* ``Fixed``: units of 2**-60 ns. A segment of a pulse train starts at such an instant, so that the
  thirds and square roots of ramps do not add up to a nanosecond, however many segments follow.

A time becomes a nanosecond once, by :func:`round_fixed`, half up.
"""

import re
from collections.abc import Mapping
from fractions import Fraction
from types import MappingProxyType
from typing import TypeAlias

Ns: TypeAlias = int
Fixed: TypeAlias = int

FIXED_BITS = 60
ONE_NS: Fixed = 1 << FIXED_BITS
HALF_NS: Fixed = ONE_NS >> 1

US: Ns = 1_000
MS: Ns = 1_000_000
SECOND: Ns = 1_000_000_000

_YEAR = 31_557_600  # s

NEVER: Ns = 1 << 100  # a deadline that does not come: later than any time that can be asked for
LONGEST_YEARS = 1_000_000
LONGEST: Ns = LONGEST_YEARS * _YEAR * SECOND  # of durations that can be asked for: many times that is before NEVER


def instants(**memory: Ns | str) -> Mapping[str, Ns | str]:
    """What a class remembers by the clock: the names of these attributes, and for how long each may still matter.

    0: until it is over; a time: so much longer; the name of another: as long as that one; `NEVER`: for ever.
    """
    return MappingProxyType(memory)


def to_fixed(ns: Ns) -> Fixed:
    """The instant `ns` in units of 2**-60 ns, exactly."""
    return ns << FIXED_BITS


def round_fixed(fixed: Fixed) -> Ns:
    """The nanosecond nearest to `fixed`; a tie goes up (towards later)."""
    return (fixed + HALF_NS) >> FIXED_BITS


def round_ratio(numerator: int, denominator: int) -> int:
    """The integer nearest to numerator / denominator (denominator > 0); a tie goes up."""
    return (2 * numerator + denominator) // (2 * denominator)


_UNITS: dict[str, Ns] = {"ns": 1, "us": US, "ms": MS, "s": SECOND, "min": 60 * SECOND, "h": 3600 * SECOND}


_NUMBER = re.compile(r"(\d{1,40}\.?\d{0,40}|\.\d{1,40})(e[+-]?\d{1,2})?", re.ASCII)
_SHOWN = 40  # characters of a wrong duration


def parse_duration(value: str | int | float) -> Ns:
    """Nanoseconds of ``"400 us"``, ``"1.5s"``, ``"2 min"``; a number without a unit is seconds. Exact.

    At most a million years. Raises ValueError with a text that shows how to write it.
    """
    text = str(value if not isinstance(value, int) or abs(value) < LONGEST else LONGEST).strip()
    text = text.replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u")
    number = text.rstrip("abcdefghijklmnopqrstuvwxyz")
    unit = text[len(number) :] or "s"
    found = _NUMBER.fullmatch(number.strip())
    if found is None or unit not in _UNITS:
        shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
        raise ValueError(f"{shown!r} is no duration: write it like 1.5 s, 400 us, 20 ms, 2 min or 1 h")
    amount = Fraction(found[0]) * _UNITS[unit]
    if amount > LONGEST:
        raise ValueError(f"{text[:_SHOWN]} is longer than {LONGEST_YEARS} years: give less, in s, min or h")
    return round_ratio(amount.numerator, amount.denominator)


def show_duration(ns: Ns) -> str:
    """`ns` for people, like ``1.25 ms`` or ``2 min 3 s``; three to four figures."""
    for unit, size in (("ns", 1), ("us", US), ("ms", MS), ("s", SECOND)):
        if ns < 1000 * size or unit == "s":
            break
    if ns < 120 * SECOND:
        return f"{ns / size:.4g} {unit}"
    seconds = round_ratio(ns, SECOND)
    if seconds >= 4 * _YEAR:
        return f"{seconds / _YEAR:.4g} years"
    hours, minutes, seconds = seconds // 3600, seconds // 60 % 60, seconds % 60
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {seconds} s"
