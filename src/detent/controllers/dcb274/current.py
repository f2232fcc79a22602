"""What the drive is told besides steps: current, decay and step table, as data for a motor model (pages 36, 40, 52).

Nothing is simulated here.
"""

from math import cos, pi, sin
from typing import Final, NamedTuple

from detent.controllers.dcb274 import settings
from detent.controllers.dcb274.motion import SETTLING, Motion
from detent.controllers.dcb274.settings import Settings
from detent.controllers.device import Stage
from detent.ramps.timer_table import TICK
from detent.ticks import NEVER, SECOND, Ns

FULL_CURRENT: Final = 4.0  # amperes a phase at 100 (page 52)
_DECAY_UNIT: Final = 12  # full steps/s for each unit of b (within 8 % of the table on page 36)
_ALWAYS_SLOW: Final = 255
_GRID: Final = 64  # places in a full step, of `Stage`


class Phases(NamedTuple):
    """The currents of both windings at one step, as parts of the set current."""

    a: float
    b: float


class Drive(NamedTuple):
    """What the drive does at an instant.

    `percent` of 4 A is set a phase; `table` is one electrical cycle of the step table, `step` the entry in force.
    """

    percent: int
    slow_decay: bool
    table: tuple[Phases, ...]
    step: int

    @property
    def amperes(self) -> Phases:
        """The currents that the choppers aim at."""
        full = FULL_CURRENT * self.percent / 100
        phases = self.table[self.step]
        return Phases(full * phases.a, full * phases.b)


def _microsteps(count: int) -> tuple[Phases, ...]:
    return tuple(Phases(cos(2 * pi * i / count), sin(2 * pi * i / count)) for i in range(count))


_WAVE = (Phases(1, 0), Phases(0, 1), Phases(-1, 0), Phases(0, -1))
_FULL = (Phases(1, 1), Phases(-1, 1), Phases(-1, -1), Phases(1, -1))
_HALF = tuple(phases for pair in zip(_WAVE, _FULL, strict=True) for phases in pair)

TABLES: Final[tuple[tuple[Phases, ...], ...]] = (
    _microsteps(32), _microsteps(16), _HALF, _FULL, _microsteps(8), _WAVE,
)  # fmt: skip
"""The sequences of H 0 to 5, one electrical cycle (four full steps) each (page 40). (E) The manual names them and
gives no values: eighth and quarter steps follow sine and cosine; "high torque" half steps have one and two phases at
full current, full steps both phases, the "low torque" half steps sine and cosine, wave one phase."""


def threshold(decay: int, resolution: int) -> int:
    """Steps/s above which decay is fast, for a threshold b and a step table H."""
    return _DECAY_UNIT * decay * settings.RESOLUTION[resolution]


def slow_decay(motion: Motion, registers: Settings, now: Ns) -> bool:
    """Whether decay is slow: always at rest (w is, too) and with b 255, else below the threshold; 0 is fast."""
    if registers.decay == _ALWAYS_SLOW or motion.energizing(now):
        return True
    period = TICK * motion.period(now) or _external(motion, now)
    return period >= NEVER or threshold(registers.decay, registers.resolution) * period > SECOND


def _external(motion: Motion, now: Ns) -> Ns:
    """Between the last two external steps; after three such times without one the motor counts as stopped."""
    period = motion.step_period
    return period if now - motion.rested_at < 3 * period else NEVER


def percent(motion: Motion, registers: Settings, now: Ns) -> int:
    """The set current: run while moving and for the settling time, then hold (page 52)."""
    hold, run = registers.current
    return hold if motion.at_rest and now >= motion.rested_at + SETTLING else run


def drive(motion: Motion, registers: Settings, shaft: int, now: Ns) -> Drive:
    """All of it."""
    table = TABLES[registers.resolution]
    step = (shaft - motion.phase_origin) % len(table)
    return Drive(percent(motion, registers, now), slow_decay(motion, registers, now), table, step)


def stage(registers: Settings) -> Stage:
    """The same as Y, b and H command it, whatever the motion: sequences are the values of H."""
    hold, run = registers.current
    steps = settings.RESOLUTION[registers.resolution]
    limit = threshold(registers.decay, registers.resolution)
    over = 0 if registers.decay == _ALWAYS_SLOW else SECOND // limit if limit else NEVER - 1
    both = TABLES[registers.resolution] is _FULL  # its first entry lies half a step on
    return Stage(registers.resolution, _GRID // steps, _GRID // 2 if both else 0, FULL_CURRENT * run / 100,
                 FULL_CURRENT * hold / 100, SETTLING, True, over)  # fmt: skip
