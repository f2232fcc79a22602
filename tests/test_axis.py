"""One motor's motion: marks, changes of mind, the gate, the count."""

import copy

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.axis import Axis, Displaced, Moment, MotionCut, MotionEnded, MotionStarted
from detent.pulses import Train, Uniform
from detent.ticks import MS, NEVER, to_fixed


def steady(steps: int | None, start: int = 0) -> Train:
    """A pulse every millisecond from `start` on."""
    return Train((Uniform.at_rate(0, 1000, steps),), to_fixed(start))


def made(*, every_pulse: bool = False, shaft: int = 0, name: str = "") -> tuple[Axis, list]:
    out: list = []
    axis = Axis(out, shaft, name)
    axis.every_pulse = every_pulse
    return axis, out


def test_an_axis_is_woken_at_its_marks_and_its_end_only() -> None:
    axis, out = made(shaft=100)
    train = steady(10)
    axis.start(train, -1, (3, 7), 0)
    assert out == [MotionStarted(0, train, 1, -1, 100)]
    woken = []
    while axis.deadline < NEVER:
        at = axis.deadline
        woken.append((at, *axis.advance(at)))
    assert woken == [(3 * MS, Moment.MARK, 3), (7 * MS, Moment.MARK, 7), (10 * MS, Moment.END, 10)]
    assert out[1:] == [MotionEnded(10 * MS, 10)]
    assert (axis.shaft, axis.pulses, axis.moving) == (90, 10, False)


def test_an_endless_train_without_marks_has_no_deadline() -> None:
    axis, _ = made()
    axis.start(steady(None), 1, (), 0)
    assert axis.deadline == NEVER
    assert axis.given(5 * MS) == 5
    assert axis.shaft_at(5 * MS - 1) == 4
    assert axis.pulses_at(6 * MS) == 6


def test_where_a_wire_carries_the_pulses_each_is_a_moment() -> None:
    axis, _ = made(every_pulse=True)
    axis.start(steady(4), 1, (2,), 0)
    woken = []
    while axis.deadline < NEVER:
        woken.append((axis.deadline, *axis.advance(axis.deadline)))
    assert woken == [
        (1 * MS, Moment.PULSE, 1),
        (2 * MS, Moment.MARK, 2),
        (3 * MS, Moment.PULSE, 3),
        (4 * MS, Moment.END, 4),
    ]


def test_marks_behind_the_end_do_not_count() -> None:
    axis, _ = made()
    axis.start(steady(3), 1, (2, 3, 9), 0)
    assert axis.advance(2 * MS) == (Moment.MARK, 2)
    assert axis.advance(3 * MS) == (Moment.END, 3)


def test_a_change_of_mind_goes_on_from_the_pulses_already_sent() -> None:
    axis, out = made()
    axis.start(steady(100), 1, (), 0)
    shorter = steady(6)
    axis.replan(shorter, (2, 5), 3 * MS + 1)
    assert out[-1] == MotionStarted(3 * MS + 1, shorter, 4, 1, 0)
    assert axis.advance(5 * MS) == (Moment.MARK, 5)
    assert axis.advance(6 * MS) == (Moment.END, 6)
    assert axis.shaft == 6


def test_a_cut_stops_at_once_and_counts_what_was_given() -> None:
    axis, out = made()
    axis.start(steady(100), -1, (), 0)
    axis.cut(3 * MS)
    assert out[-1] == MotionCut(3 * MS, 3)
    assert (axis.shaft, axis.pulses, axis.deadline) == (-3, 3, NEVER)
    axis.start(steady(2, 10 * MS), 1, (), 10 * MS)
    assert out[-1].shaft == -3
    assert axis.pulses_at(11 * MS) == 4
    assert axis.shaft_at(11 * MS) == -2


def test_a_pulse_that_falls_due_behind_a_shut_gate_waits_and_moves_the_rest() -> None:
    axis, out = made()
    axis.start(steady(5), 1, (), 0)
    axis.gate(False, 2 * MS)
    assert axis.deadline == 3 * MS
    assert axis.advance(3 * MS) == (Moment.HELD, 3)
    assert out[-1] == MotionCut(3 * MS, 2)
    assert axis.deadline == NEVER
    assert axis.given(50 * MS) == 2
    axis.gate(True, 50 * MS)
    assert out[-1] == MotionStarted(50 * MS, steady(5, 47 * MS), 3, 1, 0)
    assert axis.given(50 * MS) == 3
    assert axis.deadline == 52 * MS
    assert axis.advance(52 * MS) == (Moment.END, 5)


def test_a_gate_that_opens_before_the_pulse_changes_nothing() -> None:
    axis, out = made()
    axis.start(steady(5), 1, (), 0)
    axis.gate(False, 2 * MS)
    axis.gate(True, 3 * MS - 1)
    axis.gate(True, 3 * MS - 1)
    assert axis.deadline == 5 * MS
    assert len(out) == 1


def test_a_gate_at_rest_counts_for_the_next_move() -> None:
    axis, out = made()
    axis.gate(False, 0)
    axis.start(steady(5), 1, (), 0)
    assert axis.advance(1 * MS) == (Moment.HELD, 1)
    assert axis.given(5 * MS) == 0
    axis.cut(6 * MS)
    assert out[-1] == MotionCut(1 * MS, 0)  # told when it was held, not twice
    assert (axis.shaft, axis.pulses) == (0, 0)


def test_a_change_of_mind_while_a_pulse_is_held_comes_out_with_the_pulse() -> None:
    axis, out = made()
    axis.start(steady(100), 1, (), 0)
    axis.gate(False, 0)
    axis.advance(1 * MS)
    told = len(out)
    axis.replan(steady(3), (), 2 * MS)
    assert len(out) == told
    axis.gate(True, 9 * MS)
    assert out[-1] == MotionStarted(9 * MS, steady(3, 8 * MS), 1, 1, 0)
    assert axis.deadline == 11 * MS


def test_an_axis_with_a_name_tells_it() -> None:
    axis, out = made(name="x")
    axis.start(steady(2), 1, (), 0)
    axis.cut(1 * MS)
    axis.start(steady(1, 1 * MS), 1, (), 1 * MS)
    axis.advance(2 * MS)
    assert [item.axis for item in out] == ["x"] * 4


def test_misuse_is_told_at_once() -> None:
    axis, _ = made()
    with pytest.raises(RuntimeError, match="at rest"):
        axis.advance(0)
    axis.start(steady(5), 1, (), 0)
    with pytest.raises(RuntimeError, match="is moving"):
        axis.start(steady(5), 1, (), 0)


@given(
    st.integers(1, 40),
    st.lists(st.tuples(st.integers(0, 3_000_000), st.sampled_from(["open", "shut", "cut"])), max_size=12),
    st.booleans(),
)
def test_pulses_are_counted_as_they_are_told(steps: int, events: list[tuple[int, str]], every_pulse: bool) -> None:
    axis, out = made(every_pulse=every_pulse)
    axis.start(steady(steps), 1, (), 0)
    now = 0

    def told(until: int) -> int:
        current, total = None, 0
        for item in out:
            if isinstance(item, MotionStarted):
                current = item
            elif current is not None:
                total, current = total + item.last - current.first + 1, None
        if current is not None:
            total += current.train.steps_by(until) - current.first + 1
        return total

    for gap, what in events:
        until = now + gap
        while axis.deadline <= until:
            axis.advance(axis.deadline)
        now = until
        if what == "cut" and axis.moving:
            axis.cut(now)
        elif what != "cut":
            axis.gate(what == "open", now)
            while axis.deadline <= now:
                axis.advance(axis.deadline)
        twin = copy.deepcopy(axis)
        assert twin.pulses_at(now) == axis.pulses_at(now) == axis.shaft_at(now) == told(now)


@given(st.integers(1, 9), st.integers(-500, 500), st.sampled_from([1, -1]))
def test_a_held_axis_that_is_found_elsewhere_goes_on_from_there(given_: int, by: int, direction: int) -> None:
    """All pulses that are left come, and the counts say where the shaft is, at each of them."""
    axis, out = made(shaft=100)
    axis.start(steady(10), direction, (), 0)
    with pytest.raises(RuntimeError, match="the axis is moving"):
        axis.displace(by, 0)
    axis.gate(False, given_ * MS)
    axis.advance(axis.deadline)
    here = 100 + direction * given_
    assert (axis.shaft_at(50 * MS), out[-1]) == (here, MotionCut((given_ + 1) * MS, given_))
    axis.displace(by, 50 * MS)
    assert (axis.shaft_at(50 * MS), out[-1]) == (here + by, Displaced(50 * MS, here + by))
    axis.gate(True, 60 * MS)
    assert axis.shaft_at(61 * MS) == here + by + 2 * direction or given_ == 9
    axis.advance(axis.deadline)
    assert (axis.shaft, axis.pulses, axis.moving) == (100 + 10 * direction + by, 10, False)
