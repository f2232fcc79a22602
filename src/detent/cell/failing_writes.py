"""Writes of non-volatile memory that fail, some or all."""


class FailingWrites:
    """Failures by number: of whose memory, and how many writes they still spoil."""

    def __init__(self) -> None:
        self._left: dict[int, tuple[str, int]] = {}  # -1: all

    def begin(self, number: int, unit: str, times: int) -> None:
        """The next `times` writes of a unit fail; 0: all of them."""
        self._left[number] = unit, times or -1

    def end(self, number: int) -> None:
        """The failure of this number is over."""
        del self._left[number]

    def succeeds(self, unit: str) -> bool:
        """Whether a write of the unit's memory that is made now may succeed; a failure is counted."""
        for number, (whose, left) in self._left.items():
            if whose == unit and left:
                self._left[number] = whose, left - 1 if left > 0 else left
                return False
        return True
