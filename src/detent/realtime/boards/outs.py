"""Digital outputs: levels at exact ticks, held on the host until shortly before they are due, with a watchdog."""

from detent.ticks import MS, Ns

HOLD: Ns = 8 * MS
"""A change is given to the board so long before it is due: until then it can be taken back."""


class DigitalOut:
    """An output of a board; found as `board.outs[name]`. Levels are logical."""

    name: str
    level: bool
    """The last level that was given to the board."""
    corrections: int
    """How often a change that had left was corrected, because the cell was taken back to before it."""

    def set(self, level: bool, at: Ns, lag: Ns = 0) -> None:
        """From cell time `at` on the output has `level`; it changes at `at` + lead + `lag` (of the unit's axis).

        Times do not fall. Several changes at one instant come a tick apart each. What is due already is done at once.
        """
        raise NotImplementedError

    def rewind(self, at: Ns) -> None:
        """The cell is taken back to `at`: changes behind it are forgotten; what is set next is the truth.

        Where they had been given to the board and are not set again alike, they are corrected as soon as may be.
        """
        raise NotImplementedError

    def now(self, level: bool) -> None:
        """Take `level` as soon as may be, behind what was given to the board before; what was not is forgotten."""
        raise NotImplementedError
