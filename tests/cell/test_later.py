"""Whether something is so much later as it was: what is named an instant has gone on, and all else is equal."""

from typing import Any

import pytest

from detent.axis import Axis, MotionStarted
from detent.cell.copying import duplicate
from detent.cell.later import Later, later
from detent.pulses import Train, Uniform
from detent.ticks import NEVER, SECOND, Ns, instants, to_fixed

BY: Ns = 7 * SECOND
NOW: Ns = 100 * SECOND
TRAIN = Train((Uniform(0, to_fixed(1_000_000), 1, 50),), to_fixed(NOW))


class Thing:
    """Something that remembers."""

    INSTANTS = instants(due=0, rested=SECOND, stepped=NEVER, begun="due", train=NEVER)
    PLACES = ("place",)
    COUNTS = ("count",)
    PAST = ("heard",)

    def __init__(self, **attributes: object) -> None:
        self.__dict__ = attributes


def alike(before: Any, now: Any) -> bool:
    return Later(BY, NOW + BY).alike(before, now)


@pytest.mark.parametrize(
    ("name", "before", "now", "same"),
    [
        ("due", NOW + 5, NOW + 5 + BY, True),
        ("due", NOW + 5, NOW + 6 + BY, False),
        ("due", NOW + 5 + BY, NOW + 5 + BY, False),  # it comes no nearer
        ("due", NOW, NOW + BY + 1, False),
        ("due", NOW - 3, NOW + BY - 10, True),  # over at both ends
        ("due", NEVER, NEVER, True),
        ("due", NEVER, NOW + 5 + BY, False),
        ("due", NOW + 5, NEVER, False),
        ("rested", NOW - SECOND + 1, NOW - SECOND + 1, False),  # it still matters at first, and no more then
        ("rested", NOW - SECOND, NOW - SECOND, True),
        ("rested", NOW - 5, NOW - 5 + BY, True),
        ("rested", -NEVER, NOW - 5 + BY, False),
        ("rested", -NEVER, NOW, True),
        ("stepped", NOW - 50 * SECOND, NOW - 50 * SECOND, False),
        ("stepped", NOW - 50 * SECOND, NOW - 50 * SECOND + BY, True),
        ("stepped", -NEVER, -NEVER, True),
        ("train", TRAIN, TRAIN.shifted(to_fixed(BY)), True),
        ("train", TRAIN, TRAIN.shifted(to_fixed(BY) + 1), False),  # less than a ns
        ("train", TRAIN, TRAIN, False),
        ("train", None, None, True),
        ("train", None, TRAIN, False),
        ("place", 7, 1000, True),
        ("count", 7, 1000, True),
        ("heard", [NOW], [NOW], True),
        ("heard", [NOW], [NOW, NOW], False),
        ("other", 5, 5, True),
        ("other", 5, 6, False),
        ("other", NOW, NOW, False),  # perhaps an instant
        ("other", NOW, NOW + BY, False),
        ("other", (1, [NOW]), (1, [NOW]), False),
        ("other", TRAIN, TRAIN, False),
        ("other", TRAIN.at(0), TRAIN.at(0), True),
        ("other", NEVER, NEVER, True),
        ("other", {"a": 1}, {"a": 1}, True),
        ("other", {"a": 1, "b": 2}, {"b": 2, "a": 1}, False),  # in another order
        ("other", {3, 4}, {3, 4}, True),
        ("other", True, 1, False),
        ("other", object(), object(), False),  # nothing is known of it
    ],
)
def test_what_is_named_goes_on_and_all_else_is_equal(name: str, before: object, now: object, same: bool) -> None:
    assert alike(Thing(**{name: before}), Thing(**{name: now})) is same


def test_an_instant_may_matter_as_long_as_another() -> None:
    assert alike(Thing(begun=3, due=NOW), Thing(begun=9, due=NOW - 1))
    assert not alike(Thing(begun=NOW - 3, due=NOW + 1), Thing(begun=NOW - 3, due=NOW + 1 + BY))
    assert alike(Thing(begun=NOW - 3, due=NOW + 1), Thing(begun=NOW - 3 + BY, due=NOW + 1 + BY))


def test_an_attribute_that_is_added_keeps_things_from_being_alike() -> None:
    assert not alike(Thing(due=NOW + 5), Thing(due=NOW + 5 + BY, added=0))


def test_things_that_lead_to_each_other() -> None:
    def ring(due: Ns) -> Any:
        one: Any = Thing(due=due)
        other: Any = Thing(due=due)
        one.other, other.other = other, one
        return one

    apart: Any = Thing(due=NOW + 5 + BY)
    apart.other = ring(NOW + 5 + BY)
    assert alike(ring(NOW + 5), ring(NOW + 5 + BY))
    assert not alike(ring(NOW + 5), apart)


def test_what_went_on_is_put_on_by_as_many_rounds() -> None:
    out: list[Any] = []
    axis = Axis(out, shaft=40)
    axis.start(TRAIN, 1, (10,), NOW)
    told = out.pop()
    assert isinstance(told, MotionStarted)
    thing: Any = Thing(due=NOW + 5, rested=NOW - 9 * SECOND, stepped=NEVER, place=0, count=3, axis=axis, told=told)
    then = duplicate(thing)
    then.due, then.place, then.count, then.told = NOW + 5 + BY, 20, 5, later(told, BY)
    then.axis.train, then.axis.deadline, then.axis.shaft = TRAIN.shifted(to_fixed(BY)), axis.deadline + BY, 60
    found = Later(BY, NOW + BY)
    assert found.alike(thing, then)
    assert (found.growth, found.places) == ([20], [20])
    found.forward(1000)
    assert (then.due, then.rested, then.stepped) == (NOW + 5 + 1001 * BY, NOW - 9 * SECOND, NEVER)
    assert (then.place, then.count, then.axis.shaft) == (20_020, 2005, 20_060)
    assert then.axis.deadline == axis.deadline + 1001 * BY
    assert then.axis.train == TRAIN.shifted(1001 * to_fixed(BY))
    assert then.told == told._replace(at=NOW + 1001 * BY, train=then.axis.train)
