"""Whether things are, so much later, as they were before: in everything that they are made of, relative to the time.

A class says itself what it remembers by the clock: its `INSTANTS` (`detent.ticks.instants`). Its `PLACES` are
attributes that may move with the axis, its `COUNTS` those on which nothing depends, its `PAST` what is kept for others
of what is over. Whatever is not named must be equal, and a number that might be an instant which nobody has named
(1.07 s in ns, and more) is equal to nothing. So an attribute that is added later may keep things from being found
alike, and never makes them so.
"""

from collections import deque
from collections.abc import Mapping
from enum import Enum
from types import BuiltinFunctionType, FunctionType, MethodType
from typing import Any, Final, NamedTuple

from detent.axis import Axis, Leeway, MotionStarted
from detent.pulses import Train
from detent.ticks import NEVER, Ns, to_fixed

MAYBE_AN_INSTANT: Final = 1 << 30  # ns; no other number that a device keeps is so large

_PLAIN: Final = frozenset((str, bytes, bool, float, bytearray, type(None)))
_ITSELF: Final = frozenset((FunctionType, BuiltinFunctionType, type, Leeway))


class _Made(NamedTuple):
    """What the things of a class are made of."""

    slots: tuple[str, ...]
    instants: Mapping[str, Ns | str]
    places: tuple[str, ...]
    counts: tuple[str, ...]
    past: tuple[str, ...]


_MADE: Final[dict[type, _Made]] = {}


class Later:
    """Holds things that were copied at `now` against what has become of them `by` later.

    `changes` are then, for each attribute that goes on with time, how much that is; `growth` is how far axes have come,
    and `places` how far what counts from a place.
    """

    def __init__(self, by: Ns, now: Ns) -> None:
        self.by, self.before, self.now = by, now - by, now
        self.changes: list[tuple[Any, str, int]] = []
        self.growth: list[int] = []
        self.places: list[int] = []
        self._known: dict[int, int] = {}

    def alike(self, one: Any, other: Any) -> bool:
        """Whether `other` is now what `one`, its copy, was."""
        kind = type(one)
        if kind is not type(other):
            return False
        if kind is int:
            return bool(one == other) and (-MAYBE_AN_INSTANT < one < MAYBE_AN_INSTANT or abs(one) == NEVER)
        if kind in _PLAIN:
            return bool(one == other)
        known = self._known
        if id(one) in known:
            return known[id(one)] == id(other)
        known[id(one)] = id(other)
        alike = self.alike
        if kind is dict:
            return bool(list(one) == list(other)) and all(alike(value, other[key]) for key, value in one.items())
        if kind is list or kind is deque or (kind is tuple or issubclass(kind, tuple)):
            return len(one) == len(other) and all(alike(a, b) for a, b in zip(one, other, strict=True))
        if kind is set or kind is frozenset:
            return bool(one == other) and all(alike(value, value) for value in one)
        if issubclass(kind, Enum) or kind in _ITSELF:
            return one is other or kind is Leeway
        if kind is Train:
            return bool(one == other) and one.start < MAYBE_AN_INSTANT
        if kind is MethodType:
            return one.__func__ is other.__func__ and alike(one.__self__, other.__self__)
        if one is other and hasattr(kind, "__deepcopy__"):
            return True  # it never changes
        return self._attributes(kind, one, other)

    def _attributes(self, kind: type, one: Any, other: Any) -> bool:
        made = _made(kind)
        names = [name for name in made.slots if hasattr(one, name)]
        mine: dict[str, Any] = getattr(one, "__dict__", {})
        yours: dict[str, Any] = getattr(other, "__dict__", {})
        if (not names and not mine) or list(mine) != list(yours):
            return False
        for name in (*names, *mine):
            if name in mine:
                before, now = mine[name], yours[name]
            elif hasattr(other, name):
                before, now = getattr(one, name), getattr(other, name)
            else:
                return False
            if name in made.instants:
                if not self._instant(made.instants[name], one, other, name, before, now):
                    return False
            elif name in made.places:
                moved = now - before
                (self.growth if kind is Axis else self.places).append(moved)
                self._change(other, name, moved)
            elif name in made.counts:
                self._change(other, name, now - before)
            elif name in made.past:
                if before != now:
                    return False
            elif type(now) is MotionStarted:
                if not self._motion(other, name, before, now):
                    return False
            elif not self.alike(before, now):
                return False
        return True

    def _change(self, owner: Any, name: str, by: int) -> None:
        if by:
            self.changes.append((owner, name, by))

    def _motion(self, owner: Any, name: str, before: Any, now: MotionStarted) -> bool:
        """What a follower was told of its axis, which stands in an attribute of that name."""
        if before != later(now, -self.by):
            return False
        self.changes.append((owner, name, self.by))
        return True

    def _instant(self, memory: Ns | str, one: Any, other: Any, name: str, before: Any, now: Any) -> bool:
        if isinstance(memory, str):
            lives_before = getattr(one, memory) > self.before
            lives = getattr(other, memory) > self.now
        elif isinstance(now, int) and isinstance(before, int):
            lives_before, lives = before + memory > self.before, now + memory > self.now
        else:
            lives_before = lives = True
        if _goes_on(before, now, self.by):
            self.changes.append((other, name, self.by))
            return lives_before is lives
        return not lives_before and not lives

    def forward(self, rounds: int) -> None:
        """Put everything on by so many times what it has gone on."""
        for owner, name, by in self.changes:
            setattr(owner, name, _moved(getattr(owner, name), rounds * by))


def later(motion: MotionStarted, by: Ns, growth: int = 0) -> MotionStarted:
    """The same motion so much later, of an axis that stands elsewhere by `growth`."""
    return motion._replace(at=motion.at + by, train=motion.train.shifted(to_fixed(by)), shaft=motion.shaft + growth)


def _goes_on(one: Any, other: Any, by: Ns) -> bool:
    """Whether an instant, or what has one, is so much later."""
    if type(one) is not type(other):
        return False
    if isinstance(one, int):
        return bool(other - one == by or (one == other and abs(one) == NEVER))
    if isinstance(one, Train):
        return bool(one.shifted(to_fixed(by)) == other)
    return one is None and other is None


def _moved(value: Any, by: int) -> Any:
    if isinstance(value, int):
        return value if abs(value) == NEVER else value + by
    if isinstance(value, Train):
        return value.shifted(to_fixed(by))
    return later(value, by) if isinstance(value, MotionStarted) else value


def _made(kind: type) -> _Made:
    found = _MADE.get(kind)
    if found is None:
        slots = [base.__dict__.get("__slots__", ()) for base in kind.__mro__]
        names = tuple(name for some in slots for name in ((some,) if isinstance(some, str) else some))
        instants: dict[str, Ns | str] = {}
        places: list[str] = []
        counts: list[str] = []
        past: list[str] = []
        for base in reversed(kind.__mro__):  # what a class adds comes to what the classes behind it have
            instants |= base.__dict__.get("INSTANTS", {})
            places += base.__dict__.get("PLACES", ())
            counts += base.__dict__.get("COUNTS", ())
            past += base.__dict__.get("PAST", ())
        found = _MADE[kind] = _Made(names, instants, tuple(places), tuple(counts), tuple(past))
    return found
