"""One axis: what a controller's axis does goes in, runs of steps for the firmware come out.

Only pulses that are certain are sent: those with a time at or before the present of the cell. What the cell changes
its mind about later has then not left, or is given at the same times by the new train (`Axis.replan`).
"""

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.ticks import Ns


class Stepper:
    """An axis on a board; made by `Board` from its `StepperSetup`, found as `board.steppers[name]`.

    `lag`: so much later than the lead the pulses of this axis come at present. It grows by slips (a batch that was
    late) and by pulses that a rewound cell gives again too late, and is 0 again after a rest that is long enough.
    """

    name: str
    lag: Ns
    slips: int
    """How often a late batch moved the rest of the train, since the start."""
    slipped: Ns
    """By how much in all."""

    def tell(self, entry: MotionStarted | MotionCut | MotionEnded) -> None:
        """What the axis did, in the order in which it was drained. Nothing is sent before `Boards.commit`."""
        raise NotImplementedError

    @property
    def shaft(self) -> int:
        """Where the pulses that were told of put the shaft, sent or not; those of a train under way only as sent."""
        raise NotImplementedError

    @property
    def resting(self) -> bool:
        """Whether no pulse is to come, and the last one sent is over."""
        raise NotImplementedError

    def adopt(self, shaft: int) -> None:
        """The shaft of the axis is `shaft` now, where the firmware stands. For a stepper at rest; at the start."""
        raise NotImplementedError

    def rewind(self, shaft: int) -> None:
        """Forget every entry told so far: the firmware has stopped, and counts `shaft`.

        What the cell does from the instant on to which it was taken back is told next, beginning with the
        MotionStarted in force there, if any; pulses up to that instant are not given again. Pulses too near are
        made later (`lag` grows).
        """
        raise NotImplementedError
