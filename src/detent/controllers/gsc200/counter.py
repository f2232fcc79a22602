"""The position counters of the two models (datasheet, "The S.I.M.P.L.E. command interpreter").

The GS-C200 counts 0 to 9 999 999 and refuses moves that would leave that ruler; the GS-C200S counts in 24-bit
two's complement and wraps. Both are the shaft less an origin, so they count only pulses that were given.
"""

from detent.axis import Axis, Leeway
from detent.controllers.gsc200.commands import GS_C200S, Instruction, Op
from detent.ticks import Ns

POSITIONS = 10_000_000  # GS-C200: 0 to 9 999 999
WRAP = 1 << 24  # GS-C200S: -8 388 608 to +8 388 607


class PositionCounter:
    """The position counter of one module."""

    __slots__ = ("_axis", "_origin", "_wraps", "leeway")
    PLACES = ("_origin",)

    def __init__(self, axis: Axis, model: str) -> None:
        self._axis = axis
        self._wraps = model == GS_C200S
        self._origin = axis.shaft
        self.leeway = Leeway()

    def read(self, now: Ns) -> int:
        """The count. In homing, the one way past its ends, the GS-C200's goes on modulo ten million (our choice)."""
        self.leeway.exactly()
        return self._read(now)

    def _read(self, now: Ns) -> int:
        count = self._axis.shaft_at(now) - self._origin
        return (count + WRAP // 2) % WRAP - WRAP // 2 if self._wraps else count % POSITIONS

    def below(self, now: Ns) -> bool:
        """Whether a homing that was cut off has taken the GS-C200's counter below 0: it reads nearly ten million."""
        self.leeway.exactly()
        return not self._wraps and self._axis.shaft_at(now) < self._origin

    def preset(self, position: int, now: Ns) -> None:
        """Call the present place `position`."""
        self._origin = self._axis.shaft_at(now) - position

    def shown(self, now: Ns) -> str:
        """As V1 answers it: the GS-C200S always with its sign, the GS-C200 without."""
        return f"{self.read(now):+d}" if self._wraps else str(self.read(now))

    def room(self, direction: int, now: Ns) -> int | None:
        """Steps that a move without end may make in `direction`; None: no end."""
        if self._wraps:
            return None
        position = self.read(now)
        return POSITIONS - 1 - position if direction > 0 else position

    def refuses(self, instruction: Instruction, now: Ns) -> bool:
        """Whether the move would carry the GS-C200's counter off its ruler (error 5)."""
        match instruction.op:
            case Op.MOVE:
                if self._wraps:
                    return False
                count, end = self._read(now), self._read(now) + instruction.value
                if not 0 <= end < POSITIONS:
                    self.leeway.exactly()
                    return True
                self.leeway.within(count, 0, POSITIONS - 1)
                self.leeway.within(end, 0, POSITIONS - 1)
                return False
            case Op.VELOCITY:
                return self.room(instruction.value, now) == 0
        return False
