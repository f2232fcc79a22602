"""A second GS-C200 step generator, slow and plain: one pulse after the other, written from the specification only.

Rates are in steps/s, instants in seconds as decimals of fifty figures. It knows no trains and no axis, only
intervals: of the ramp by its law v**2 = S**2 + (T**2 - S**2) n / R, of the slew, of the odd step at a peak.
"""

from collections.abc import Iterable
from decimal import ROUND_HALF_UP, Context, Decimal, localcontext
from typing import NamedTuple

CONTEXT = Context(prec=50, rounding=ROUND_HALF_UP)
SECOND = Decimal(10**9)


class Event(NamedTuple):
    """At a nanosecond: Z, K, ENABLE or the input of a velocity move ("stop") takes a level."""

    at: int
    kind: str  # "Z", "K", "ENABLE", "stop"
    level: int = 0


class Move(NamedTuple):
    """What is to be done: `steps` None goes on without end."""

    start_stop: int
    slew: int
    ramp: int
    steps: int | None
    has_stop: bool = False


class Told(NamedTuple):
    """What the model gave: exact pulse times in ns, and the edges of MOV and RAMP as (ns, pulses given, level)."""

    pulses: list[Decimal]
    mov: list[tuple[int, int, int]]
    ramp: list[tuple[int, int, int]]


class Generator:
    """One move on its way."""

    def __init__(self, move: Move, start: int, enabled: bool) -> None:
        self.move, self.steps = move, move.steps
        self.enabled, self.held = enabled, False
        self.base = Decimal(start)  # ns: the last pulse, or the start
        self.told = Told([], [], [])
        self.over = False
        self.show(start)

    @property
    def given(self) -> int:
        return len(self.told.pulses)

    @property
    def ramps(self) -> bool:
        return self.move.slew > self.move.start_stop

    @property
    def up(self) -> int:
        """Steps of either ramp."""
        if not self.ramps:
            return 0
        return self.move.ramp if self.steps is None else min(self.move.ramp, self.steps // 2)

    def speed(self, steps: int) -> Decimal:
        """After so many steps of the ramp."""
        s, t, r = self.move.start_stop, self.move.slew, self.move.ramp
        return (s * s + Decimal((t * t - s * s) * steps) / r).sqrt()

    def climb(self, steps: int) -> Decimal:
        """The time of the ramp's step from `steps` - 1 to `steps`: twice the distance by the sum of the speeds."""
        return 2 / (self.speed(steps - 1) + self.speed(steps))

    def interval(self, pulse: int) -> Decimal:
        """The time before pulse number `pulse`, in seconds."""
        up = self.up
        if pulse <= up:
            return self.climb(pulse)
        if self.steps is not None and pulse > self.steps - up:
            return self.climb(self.steps - pulse + 1)
        if self.ramps and up < self.move.ramp:
            return 1 / self.speed(up)
        return Decimal(1) / self.move.slew

    def due(self) -> Decimal:
        """When the next pulse comes, in ns."""
        return self.base + self.interval(self.given + 1) * SECOND

    def show(self, at: int) -> None:
        """Note changes of MOV and RAMP."""
        n, steps, r = self.given, self.steps, self.move.ramp
        block = steps is not None and steps <= 2 * r
        ramping = self.up > 0 and (block or n < r or (steps is not None and n >= steps - r))
        for edges, level in ((self.told.ramp, int(ramping and not self.over)), (self.told.mov, int(not self.over))):
            if level != (edges[-1][2] if edges else 0):
                edges.append((at, n, level))

    def give(self, exact: Decimal) -> None:
        self.told.pulses.append(exact)
        self.base, self.held = exact, False
        self.over = self.given == self.steps
        self.show(nearest(exact))

    def end(self, at: int) -> None:
        self.over = True
        self.show(at)

    def run_to(self, instant: int) -> None:
        """Give all pulses whose nanosecond is not after `instant`."""
        while not self.over and not self.held and nearest(due := self.due()) <= instant:
            if self.enabled:
                self.give(due)
            else:
                self.held = True

    def slow_down(self, at: int) -> None:
        if not self.ramps:
            self.end(at)
            return
        n, up = self.given, self.up
        if n < up:
            steps = 2 * (n + 1)
        elif self.steps is None or n < self.steps - up:
            steps = n + 1 + self.move.ramp
        else:
            return
        self.steps = steps if self.steps is None else min(self.steps, steps)
        self.show(at)

    def take(self, event: Event) -> None:
        self.run_to(event.at)
        if event.kind == "ENABLE":
            self.enabled = event.level == 1
            if self.enabled and self.held and not self.over:
                self.give(Decimal(event.at))
        elif self.over:
            return
        elif event.kind == "K":
            self.end(event.at)
        elif event.kind == "Z" or (event.kind == "stop" and self.move.has_stop and event.level == 0):
            self.slow_down(event.at)


def nearest(exact: Decimal) -> int:
    """The nanosecond, half up."""
    # a root that is cut short by 50 digits must not lose a tie
    return int((exact + Decimal("1e-30")).to_integral_value(ROUND_HALF_UP))


def play(move: Move, start: int, events: Iterable[Event], until: int, *, enabled: bool = True) -> Told:
    """All pulses of `move`, begun at `start`, up to and including `until`."""
    with localcontext(CONTEXT):
        generator = Generator(move, start, enabled)
        for event in events:
            generator.take(event)
        generator.run_to(until)
        return generator.told
