"""What is known of a driven axis from the motions that are kept of it."""

from random import Random
from typing import Any

from tests.generated import seeds

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.ramps import constant_acceleration
from detent.realtime.boards.axis_ledger import AxisLedger
from detent.ticks import SECOND, to_fixed


def test_where_it_rested_is_known_though_the_motion_before_is_forgotten() -> None:
    """A train that goes on from another begins at a later pulse: where it was before is not where that would be."""
    nothing: Any = None
    ledger = AxisLedger(nothing, nothing, nothing, 0)
    train = constant_acceleration.move(1000, 1000, 1, 20).train
    ledger.take(MotionStarted(0, train, 1, 1, 0, ""))
    ledger.take(MotionEnded(SECOND, 20, ""))
    ledger.take(MotionStarted(2 * SECOND, train, 1, -1, 20, ""))
    ledger.take(MotionStarted(2 * SECOND + 5, train, 19, -1, 20, ""))
    ledger.motions.forget(2)
    assert ledger.motions.before(4)[0] == MotionEnded(SECOND, 20, "")
    assert ledger.place_at(SECOND + 1) == 20


def test_the_instant_at_which_it_was_at_a_place_is_one_at_which_it_was() -> None:
    """Motions that are held before any pulse and let go, at once or later, exactly at a pulse, or between two."""
    nothing: Any = None
    for seed in seeds(200):
        random = Random(seed)
        ledger = AxisLedger(nothing, nothing, nothing, 0)
        now, place, places = 1, 0, {0}
        for _ in range(random.randrange(1, 5)):
            now += random.choice([0, 1, SECOND // 10])
            steps, direction = random.randrange(2, 40), random.choice([-1, 1])
            whole = constant_acceleration.move(1000, 1000, 1, steps).train
            origin, first, began = place, 1, now
            while first <= steps:
                begun = began - whole.time_of(first)  # so its next pulse comes at once, if none has just come
                train = whole.shifted(
                    to_fixed(begun if began > now and random.random() < 0.5 else begun + SECOND // 1000)
                )
                ledger.take(MotionStarted(began, train, first, direction, origin, ""))
                last = random.randrange(first - 1, steps + 1)
                end = began if last < first else train.time_of(last)
                ledger.take(MotionEnded(end, last, "") if last == steps else MotionCut(end, last, ""))
                places |= {origin + direction * n for n in range(first, last + 1)}
                place, now, first = origin + direction * last, end, last + 1
                began = end + random.choice([0, 1, SECOND // 50])
        for shaft in places:
            for near in (0, now // 3, now // 2, now, now + SECOND):
                assert ledger.place_at(ledger.instant_of(shaft, near)) == shaft, (seed, shaft, near)
