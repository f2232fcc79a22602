"""A grid of whole numbers, even in their logarithms: made, widened at its ends, made finer about a point."""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

WIDENED = 4  # values more at an end
FINER = 3  # steps of the finer grid in one of the coarse


class Dimension(NamedTuple):
    """One number of a profile: its values on the grid, rising, within what the command takes.

    A dimension of `fixed` values (steps sizes) is neither widened nor made finer.
    """

    name: str
    low: int
    high: int
    values: tuple[int, ...]
    fixed: bool = False

    def wider(self, value: int) -> "tuple[Dimension, tuple[int, ...]]":
        """With more values beyond the end that `value` is, and these; itself if it is none, or there are no more."""
        if self.fixed or not self.values or value not in (self.values[0], self.values[-1]):
            return self, ()
        known = set(self.values)
        more: list[int] = []
        for end, limit in ((self.values[0], self.low), (self.values[-1], self.high)):
            if value == end != limit:
                ratio = _ratio(self.values)
                ways = (end * ratio ** (k if end == self.values[-1] else -k) for k in range(1, WIDENED + 1))
                more += [whole for whole in (min(max(round(one), self.low), self.high) for one in ways)
                         if whole not in known]  # fmt: skip
        added = tuple(sorted(set(more)))
        return self._replace(values=tuple(sorted(known | set(added)))), added

    def near(self, value: int) -> tuple[int, ...]:
        """Values between the neighbours of `value` on the grid, `value` among them."""
        if self.fixed or value not in self.values:
            return (value,)
        at = self.values.index(value)
        found = {value}
        for other in (*self.values[max(at - 1, 0) : at], *self.values[at + 1 : at + 2]):
            found |= {round(value * (other / value) ** (k / FINER)) for k in range(1, FINER)}
        return tuple(sorted(found))


def logarithmic(name: str, low: int, high: int, begin: float, end: float, count: int) -> Dimension:
    """`count` values from `begin` to `end`, as even in their logarithms as whole numbers are, within low to high."""
    first, last = (min(max(value, low, 1), high) for value in (begin, end))
    if last < first:
        first, last = last, first
    steps = max(count - 1, 1)
    values = {round(first * (last / first) ** (k / steps)) for k in range(count)}
    return Dimension(name, low, high, tuple(sorted(values)))


def _ratio(values: Sequence[int]) -> float:
    if len(values) < 2:
        return 1.25
    return max(float((values[-1] / values[0]) ** (1 / (len(values) - 1))), 1.05)


def points(parts: Sequence[Sequence[int]]) -> Iterator[tuple[int, ...]]:
    """Every combination."""
    return product(*parts)
