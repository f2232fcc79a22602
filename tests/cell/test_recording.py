"""The log of a cell: shared by copies up to where they part; the motion that is read from it."""

import copy

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.recording import Recording, Span
from detent.pins import PinSet
from detent.pulses import Train, Uniform
from detent.ticks import MS, to_fixed


def steady(steps: int | None, start: int = 0) -> Train:
    return Train((Uniform.at_rate(0, 1000, steps),), to_fixed(start))


def pin(at: int, level: int = 1) -> PinSet:
    return PinSet(at, "UO1", level)


def test_entries_are_kept_in_order_with_the_unit_they_belong_to() -> None:
    log = Recording(["a", "b"])
    log.extend(0, [pin(0), pin(1)])
    log.extend(1, [pin(1)])
    log.extend(0, [pin(2)])
    assert list(log) == [(0, pin(0)), (0, pin(1)), (1, pin(1)), (0, pin(2))]
    assert len(log) == 4
    assert log.of("a") == [pin(0), pin(1), pin(2)]
    assert log.of("b") == [pin(1)]


def test_copies_share_the_past_and_part_where_they_go_on() -> None:
    log = Recording(["a"])
    log.extend(0, [pin(0)])
    twin = copy.deepcopy(log)
    third = copy.deepcopy(log)
    twin.extend(0, [pin(1)])
    log.extend(0, [pin(2)])
    assert log.of("a") == [pin(0), pin(2)]
    assert twin.of("a") == [pin(0), pin(1)]
    assert third.of("a") == [pin(0)]
    third.extend(0, [pin(3)])
    late = copy.deepcopy(third)
    third.extend(0, [pin(4)])
    assert late.of("a") == [pin(0), pin(3)]
    late.extend(0, [pin(5)])
    assert third.of("a") == [pin(0), pin(3), pin(4)]
    assert log.of("a") == [pin(0), pin(2)]


def test_a_whole_move_is_one_span() -> None:
    log = Recording(["a"])
    train = steady(5)
    log.extend(0, [MotionStarted(0, train, 1, 1, 100), MotionEnded(5 * MS, 5)])
    assert log.motion("a", 9 * MS) == [Span(0, 5 * MS, train, 1, 5, 1, 100)]


def test_a_move_that_changes_its_mind_is_held_and_cut_in_spans_without_gap() -> None:
    log = Recording(["a"])
    first, second, third = steady(90), steady(50), steady(50, 20 * MS)
    log.extend(0, [
        MotionStarted(0, first, 1, -1, 0),
        MotionStarted(3 * MS, second, 4, -1, 0),
        MotionCut(6 * MS, 5),
        MotionStarted(26 * MS, third, 6, -1, 0),
        MotionCut(30 * MS, 10),
    ])  # fmt: skip
    assert log.motion("a", 99 * MS) == [
        Span(0, 3 * MS, first, 1, 3, -1, 0),
        Span(3 * MS, 6 * MS, second, 4, 5, -1, 0),
        Span(26 * MS, 30 * MS, third, 6, 10, -1, 0),
    ]


def test_a_move_under_way_ends_with_the_recording() -> None:
    log = Recording(["a", "b"])
    train = steady(None)
    log.extend(0, [MotionStarted(0, train, 1, 1, 0)])
    assert log.motion("a", 7 * MS) == [Span(0, 7 * MS, train, 1, 7, 1, 0)]
    assert log.motion("b", 7 * MS) == []


def test_the_axes_of_one_unit_are_told_apart() -> None:
    log = Recording(["a"])
    log.extend(0, [
        MotionStarted(0, steady(5), 1, 1, 0, "x"),
        MotionStarted(1 * MS, steady(2, 1 * MS), 1, 1, 0, "y"),
        MotionEnded(3 * MS, 2, "y"),
        MotionEnded(5 * MS, 5, "x"),
    ])  # fmt: skip
    assert [(s.last, s.ends) for s in log.motion("a", 9 * MS, "x")] == [(5, 5 * MS)]
    assert [(s.last, s.ends) for s in log.motion("a", 9 * MS, "y")] == [(2, 3 * MS)]
    assert log.motion("a", 9 * MS) == []
