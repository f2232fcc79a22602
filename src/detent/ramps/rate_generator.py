"""The programmable rate generator: pulses N + 1 clocks apart, N replaced on the fly (Cassinis, equation 1).

A new N takes effect when the running period ends; of two loads within one period the last wins; on a clock that
has both, the pulse comes before the load. The first pulse comes N + 1 clocks after the start.

The paper writes f = Fin / (N + 1). Counter 0 of a real 8253 divides by N in its rate generator mode; we keep the
paper's formula, which is the one its tables are made with.
"""

from detent.pulses import Table

CLOCK_HZ = 2_000_000
CLOCK_NS = 500


class RateGenerator:
    """Counter 0 from its start at clock 0 on. `rows` are runs of pulses as (count, clocks of the period)."""

    __slots__ = ("at", "loaded", "pulses", "rows")

    def __init__(self, n: int) -> None:
        self.loaded = n  # taken when the running period ends
        self.at = 0  # the clock at which it does
        self.pulses = 0  # given up to and including `at`
        self.rows: list[tuple[int, int]] = []

    def load(self, clock: int, n: int) -> None:
        """At `clock`, not before the load before, load `n`."""
        if self.at <= clock:
            self._run((clock - self.at) // (self.loaded + 1) + 1)
        self.loaded = n

    def run_to(self, pulses: int) -> None:
        """Go on without a load up to pulse `pulses`, which has not been passed."""
        if pulses > self.pulses:
            self._run(pulses - self.pulses)

    def table(self) -> Table:
        """What was generated so far, as a segment that begins at its train's start."""
        counts, periods = zip(*self.rows, strict=True)
        return Table.of(0, CLOCK_NS, counts, periods)

    def _run(self, count: int) -> None:
        period = self.loaded + 1
        if self.rows and self.rows[-1][1] == period:
            self.rows[-1] = self.rows[-1][0] + count, period
        else:
            self.rows.append((count, period))
        self.pulses += count
        self.at += count * period
