"""Which lead of a motor is which: from an ohmmeter to windings, and the orders to try (manual, pages 69 to 74).

Leads are numbered from 1. A reading is in ohms; infinity is an open circuit.
"""

from collections.abc import Mapping
from enum import Enum
from itertools import combinations
from typing import NamedTuple

OPEN = 1000.0  # "high resistance": more than this is another winding
JOINED = 10.0  # less than this between common leads: they are connected inside the motor
TOLERANCE = 0.25  # readings that differ by less are alike

Reading = Mapping[tuple[int, int], float]


class WiringError(ValueError):
    """Readings that fit no motor of the manual; the text says what does not fit."""


class Kind(Enum):
    """The motors that the manual tells apart."""

    BIPOLAR = "bipolar, 4 leads"
    UNIPOLAR_5 = "unipolar, 5 leads"
    UNIPOLAR_6_JOINED = "unipolar, 6 leads, the common leads connected inside the motor"
    UNIPOLAR_6 = "unipolar, 6 leads, separate windings"


class Found(NamedTuple):
    """What the readings show.

    `pairs` are the opposite ends of each winding, () where resistances cannot tell; `commons` the centre taps, the
    one of pairs[0] first if that is known; `ends` all leads that are no common.
    """

    kind: Kind
    pairs: tuple[tuple[int, int], ...]
    commons: tuple[int, ...]
    ends: tuple[int, ...]
    remark: str


class Order(NamedTuple):
    """One wiring to try: the lead at WA1, WA2, WB1, WB2."""

    wa1: int
    wa2: int
    wb1: int
    wb2: int


def find(readings: Reading) -> Found:
    """The windings of a motor with 4, 5 or 6 leads. Every pair (low, high) needs its reading. Raises WiringError."""
    leads = sorted({lead for pair in readings for lead in pair})
    if leads not in ([1, 2, 3, 4], [1, 2, 3, 4, 5], [1, 2, 3, 4, 5, 6]):
        raise WiringError(f"number 4, 5 or 6 leads from 1 on, not {', '.join(map(str, leads)) or 'none'}")
    ohms: dict[tuple[int, int], float] = {}
    for pair, reading in readings.items():
        one, other = sorted(pair)
        if one == other or reading < 0 or reading != reading:
            raise WiringError(f"a reading is of two leads and not negative: {pair[0]}-{pair[1]} is {reading:g}")
        if ohms.setdefault((one, other), reading) != reading:
            raise WiringError(f"{one}-{other} has two readings, {ohms[one, other]:g} and {reading:g}: measure it again")
    missing = [f"{one}-{other}" for one, other in combinations(leads, 2) if (one, other) not in ohms]
    if missing:
        raise WiringError(f"no reading of {', '.join(missing)}")
    return {4: _four, 5: _five, 6: _six}[len(leads)](ohms)


def orders(found: Found) -> tuple[Order, ...]:
    """The six orders of the sequence test (page 73), for leads A, B, C, D at WA1, WA2, WB1, WB2."""
    if found.pairs:
        (a, b), (c, d) = found.pairs
    else:
        a, b, c, d = found.ends
    return (
        Order(a, b, c, d),
        Order(a, b, d, c),
        Order(a, d, b, c),
        Order(a, d, c, b),
        Order(a, c, d, b),
        Order(a, c, b, d),
    )


def sensible(found: Found, order: Order) -> bool:
    """Whether an order keeps the windings that are known together."""
    ends = [set(pair) for pair in found.pairs]
    return not ends or {order.wa1, order.wa2} in ends


def reversed_order(order: Order) -> Order:
    """The other direction: both windings swapped (page 74, ABCD as BADC)."""
    return Order(order.wa2, order.wa1, order.wb2, order.wb1)


def _four(ohms: Reading) -> Found:
    low = tuple(pair for pair, reading in ohms.items() if reading <= OPEN)
    if len(low) != 2 or set(low[0]) & set(low[1]):
        shown = ", ".join(f"{one}-{other}" for one, other in low) or "none"
        raise WiringError(f"a bipolar motor has two low readings between four leads, not: {shown}")
    return Found(Kind.BIPOLAR, low, (), (*low[0], *low[1]), "low readings are the ends of one winding")


def _five(ohms: Reading) -> Found:
    for common in range(1, 6):
        own = [reading for pair, reading in ohms.items() if common in pair]
        others = [reading for pair, reading in ohms.items() if common not in pair]
        if _alike(own) and _alike(others) and _about(sum(others) / len(others), 2 * sum(own) / len(own)):
            ends = tuple(lead for lead in range(1, 6) if lead != common)
            return Found(Kind.UNIPOLAR_5, (), (common,), ends,
                         "resistances cannot show which ends belong to winding A and which to B")  # fmt: skip
    raise WiringError("a unipolar motor with 5 leads has one whose readings are alike, and half of all others")


def _six(ohms: Reading) -> Found:
    commons = min(ohms, key=lambda pair: ohms[pair])
    # of a motor of few ohms the halves are near zero as well: the common leads are those that read least
    if ohms[commons] < JOINED and max(ohms.values()) <= OPEN:
        ends = tuple(lead for lead in range(1, 7) if lead not in commons)
        halves = [reading for pair, reading in ohms.items() if pair != commons and set(pair) & set(commons)]
        wholes = [reading for pair, reading in ohms.items() if not set(pair) & set(commons)]
        half, whole = sum(halves) / len(halves), sum(wholes) / len(wholes)
        fits = ohms[commons] <= half / 2 and _about(whole, 2 * half)
        if _alike(halves) and _alike(wholes) and fits:
            return Found(Kind.UNIPOLAR_6_JOINED, (), commons, ends,
                         "it needs the unipolar wiring; resistances cannot tell winding A from B")  # fmt: skip
    connected = {pair: reading for pair, reading in ohms.items() if reading <= OPEN}
    groups = _groups(connected)
    if len(groups) != 2 or any(len(group) != 3 for group in groups) or len(connected) != 6:
        raise WiringError("six leads show two windings of three leads each, or two common leads that are connected")
    pairs, commons_found = [], []
    for group in groups:
        inside = {pair: reading for pair, reading in connected.items() if set(pair) <= group}
        ends_pair = max(inside, key=lambda pair: inside[pair])
        halves = [reading for pair, reading in inside.items() if pair != ends_pair]
        if not (_alike(halves) and _about(inside[ends_pair], sum(halves))):
            shown = ", ".join(f"{one}-{other} {reading:g}" for (one, other), reading in inside.items())
            raise WiringError(f"the ends of a winding read double of each end to its common lead, not {shown}")
        pairs.append(ends_pair)
        commons_found.append(next(iter(group - set(ends_pair))))
    return Found(Kind.UNIPOLAR_6, tuple(pairs), tuple(commons_found), (*pairs[0], *pairs[1]),
                 "the common leads may be left unconnected: bipolar, for double the voltage")  # fmt: skip


def _groups(connected: Reading) -> list[set[int]]:
    groups: list[set[int]] = []
    for pair in connected:
        touching = [group for group in groups if group & set(pair)]
        groups = [group for group in groups if group not in touching] + [set(pair).union(*touching)]
    return sorted(groups, key=min)


def _about(one: float, other: float) -> bool:
    return abs(one - other) <= TOLERANCE * max(one, other)


def _alike(readings: list[float]) -> bool:
    return bool(readings) and max(readings) <= OPEN and _about(min(readings), max(readings))
