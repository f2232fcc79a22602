"""What is known of a driven axis from the motions that are kept of it."""

from typing import Any

from detent.axis import MotionEnded, MotionStarted
from detent.ramps import constant_acceleration
from detent.realtime.boards.axis_ledger import AxisLedger
from detent.ticks import SECOND


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
