"""A duplicate is what `copy.deepcopy` makes: equal in everything, and with nothing in common that can change."""

import copy
import types
from collections import Counter, OrderedDict, deque
from dataclasses import dataclass, field
from enum import Enum
from random import Random
from typing import Any, NamedTuple

import numpy as np
import pytest
from tests.proofs.cells import Hands, plan
from tests.proofs.tally import Tally

from detent.cell.build import build
from detent.cell.circuit import Oscillation
from detent.cell.copying import duplicate
from detent.cell.description import parse
from detent.cell.idling import same
from detent.ticks import Ns


class Colour(Enum):
    RED = 1


class Pair(NamedTuple):
    one: Any
    other: Any


class Slotted:
    __slots__ = ("left", "right", "unset")

    def __init__(self, left: Any, right: Any) -> None:
        self.left, self.right = left, right


class More(Slotted):
    """Slots below, a dictionary above."""

    def __init__(self) -> None:
        super().__init__([1], {"a": [2]})
        self.own = self.left
        self.method = self.change

    def change(self) -> None:
        self.left.append(7)


class Hidden:
    __slots__ = ("__own",)

    def __init__(self, own: Any) -> None:
        self.__own = own

    def own(self) -> Any:
        return self.__own


@dataclass(frozen=True)
class Frozen:
    parts: list[int] = field(default_factory=lambda: [1])


class Names(list[str]):
    pass


class Whole(tuple[int, ...]):
    """Says itself how it is copied."""

    __slots__ = ()

    def __deepcopy__(self, _: object) -> "Whole":
        return self


def reached(thing: object, found: dict[int, object] | None = None) -> dict[int, object]:
    """Everything that a thing is made of, by its `id`."""
    found = {} if found is None else found
    if id(thing) in found or isinstance(thing, type | types.FunctionType | types.ModuleType | Enum | str | bytes | int):
        return found
    found[id(thing)] = thing
    if isinstance(thing, dict):
        inside = [*thing, *thing.values()]
    elif isinstance(thing, list | tuple | set | frozenset | deque):
        inside = list(thing)
    elif isinstance(thing, types.MethodType):
        inside = [thing.__self__]
    else:
        slots = [name for base in type(thing).__mro__ for name in getattr(base, "__slots__", ())]
        inside = [*getattr(thing, "__dict__", {}).values(), *(getattr(thing, n) for n in slots if hasattr(thing, n))]
    for one in inside:
        reached(one, found)
    return found


def changeable(thing: object) -> set[int]:
    """The `id` of everything that can be changed in a thing."""
    whole = reached(thing).items()
    return {number for number, one in whole if not isinstance(one, tuple | frozenset | types.MethodType)}


def as_deepcopy_does(thing: object) -> None:
    twin, expected = duplicate(thing), copy.deepcopy(thing)
    assert same(twin, expected)
    assert same(twin, thing)
    before = changeable(thing)
    assert changeable(twin) & before == changeable(expected) & before


def shared() -> object:
    one = [1, [2]]
    return [one, one, {"a": one, "b": (one, 3)}, deque([one], maxlen=3)]


def ring() -> object:
    one: list[object] = [1]
    one.append((one, {"back": one}))
    return one


@pytest.mark.parametrize("make", [
    shared, ring, More, lambda: Pair([1], (Pair(2, 3), [Pair(4, [5])])), lambda: Frozen(),
    lambda: {Colour.RED: [Colour.RED]}, lambda: [{1, 2}, {"a", (1, 2)}, frozenset((3,))], lambda: [Counter("aab")],
    lambda: OrderedDict(b=[1], a=[2]), lambda: [bytearray(b"ab"), b"ab", None, 2.5, range(3), len, shared],
    lambda: Names(["a"]), lambda: [Whole((1, 2)), Slotted, int], lambda: ((1, 2), ((), "a")),
])  # fmt: skip
def test_a_thing_is_copied_as_deepcopy_does_it(make: Any) -> None:
    as_deepcopy_does(make())


def test_an_array_is_left_to_deepcopy() -> None:
    array = np.arange(5)
    twin = duplicate({"a": array})["a"]
    assert twin is not array
    assert twin.tolist() == array.tolist()


def test_what_is_shared_stays_shared_and_methods_belong_to_the_copy() -> None:
    more = More()
    twin = duplicate(more)
    twin.method()
    assert twin.left is twin.own
    assert (twin.left, more.left) == ([1, 7], [1])
    assert not hasattr(twin, "unset")
    hidden = Hidden([1])
    assert duplicate(hidden).own() == [1]
    assert duplicate(hidden).own() is not hidden.own()
    whole = Whole((1,))
    assert duplicate([whole])[0] is whole
    unchanged = (1, ("a", 2))
    assert duplicate(unchanged) is unchanged


class Brief(Hands):
    """Does not wait for all that follows."""

    def go_to(self, until: Ns) -> None:
        for _ in range(200):
            at = self.cell.next_event()
            if at is None or at > until:
                return
            self.cell.run_to(at)


def cells(count: int) -> int:
    told = 0
    for number in range(count):
        draw = Random(f"copied {number}")
        planned = plan(draw)
        if "[motors" in planned.text:
            continue  # arrays cannot be compared so
        cell = build(parse(planned.text, "copied"), str, line_timing=planned.timed, record=False)
        hands = Brief(cell, draw, Tally())
        try:
            for _ in range(draw.randint(1, 8)):
                hands.act()
        except Oscillation:
            continue
        as_deepcopy_does(cell)
        twin = cell.copy()
        for one in (cell, twin):
            for _ in range(50):
                one.step()
        assert same(twin, cell)
        told += 1
    return told


def test_a_cell_is_copied_as_deepcopy_does_it() -> None:
    assert cells(20) > 12


@pytest.mark.slow
def test_many_more_cells_are_copied_as_deepcopy_does_it() -> None:
    assert cells(1000) > 700
