"""What the windings of a motor get: a function of position, rate and mode, exact at every microstep.

An electrical cycle is four full steps, 256 places of 1/64 each. The stepping table (manual, page 70) energises
WA1 at 0, WB1 a full step later, then WA2, WB2; between them, in microsteps, the currents follow cosine and sine
("near constant torque"). Duties count `FULL` for a winding that is always on.
"""

from collections.abc import Sequence
from functools import cache
from math import cos, pi
from typing import NamedTuple

from detent.controllers.device import Stage
from detent.pulses.segment import Int64Array

FULL = 256  # PWM counts of full current
CYCLE = 256  # places of 1/64 step in an electrical cycle
STEP = 64  # places in a full step

SINGLE, HALF_STEP, DOUBLE, MICROSTEP = range(4)  # the values of O
OFF, ON, HALF_IDLE = range(3)  # the values of W

# page 70; WB2 WB1 WA2 WA1, one row a half step
ROWS = (0b0001, 0b0101, 0b0100, 0b0110, 0b0010, 0b1010, 0b1000, 0b1001)

_COSINE = tuple(round(FULL * cos(pi / 2 * place / STEP)) for place in range(STEP + 1))


class Duties(NamedTuple):
    """PWM counts, 0 .. FULL, of the four winding ends of a motor; one end of a winding at most is driven."""

    wa1: int
    wa2: int
    wb1: int
    wb2: int

    @property
    def pattern(self) -> int:
        """WB2 WB1 WA2 WA1 as bits, 1 where there is current."""
        return (self.wb2 > 0) << 3 | (self.wb1 > 0) << 2 | (self.wa2 > 0) << 1 | (self.wa1 > 0)


NOTHING = Duties(0, 0, 0, 0)
ENDS = tuple(name.upper() for name in Duties._fields)
POWERS = {0: "off", 4: "quarter", 8: "half", 16: "full"}


def table(mode: int, rotor: int) -> Duties:
    """The windings at full power in step mode `mode` (O), at the place `rotor` in 1/64 steps.

    Mode 0 drops the fraction of a step, 1 floors it to 0 or 0.5, 2 forces it to 0.5 (page 31).
    """
    return _TABLES[mode][rotor % CYCLE]


def _row(half_step: int) -> Duties:
    row = ROWS[half_step % len(ROWS)]
    wb2, wb1, wa2, wa1 = (FULL * (row >> bit & 1) for bit in (3, 2, 1, 0))
    return Duties(wa1, wa2, wb1, wb2)


def _micro(rotor: int) -> Duties:
    quarter, place = divmod(rotor, STEP)
    down, up = _COSINE[place], _COSINE[STEP - place]
    return (
        Duties(down, 0, up, 0),  # from WA1 to WB1
        Duties(0, up, down, 0),  # from WB1 to WA2
        Duties(0, down, 0, up),  # from WA2 to WB2
        Duties(up, 0, 0, down),  # from WB2 to WA1
    )[quarter]


_TABLES = (
    tuple(_row(rotor // STEP * 2) for rotor in range(CYCLE)),
    tuple(_row(rotor // (STEP // 2)) for rotor in range(CYCLE)),
    tuple(_row(rotor // STEP * 2 + 1) for rotor in range(CYCLE)),
    tuple(_micro(rotor) for rotor in range(CYCLE)),
)


@cache
def _arrays() -> tuple[Int64Array, ...]:
    """The tables as arrays, a row a place."""
    import numpy as np

    return tuple(np.array(rows, np.int64) for rows in _TABLES)


class Drive(NamedTuple):
    """How a motor's windings are driven, as long as nothing but its position and rate changes.

    `sixteenths` is the power, 16 for full. While the rate / 256 is greater than `auto` (in whole numbers) they get
    the table of `auto_mode` at full power instead (A command); -1: never. A place is position x `size`.
    """

    mode: int
    sixteenths: int
    size: int
    auto: int = -1
    auto_mode: int = DOUBLE

    def __deepcopy__(self, _: object) -> "Drive":
        return self

    @property
    def ends(self) -> Sequence[str]:
        """What `Duties` are the counts of."""
        return ENDS

    @property
    def power(self) -> str:
        """The part of the full power; below the auto full step rate, where there is one."""
        return POWERS.get(self.sixteenths, f"{self.sixteenths}/16")

    @property
    def stage(self) -> Stage:
        """Sequences are the values of O; a rate / 256 greater than `auto` is one of (`auto` + 1) x 256 or more."""
        fast = (self.auto + 1) * 256 if self.auto >= 0 else None
        power = self.sixteenths / 16
        return Stage(self.mode, self.size, run=power, hold=power, fast_from=fast, fast_sequence=self.auto_mode)

    def duties(self, position: int, rate: int) -> Duties:
        """The PWM counts at a position, in microsteps, and a rate, in microsteps/s."""
        place = position * self.size
        if 0 <= self.auto < rate // 256:
            return table(self.auto_mode, place)
        if self.sixteenths == 0:
            return NOTHING
        full = table(self.mode, place)
        return full if self.sixteenths == 16 else Duties(*(count * self.sixteenths // 16 for count in full))

    def duties_at(self, positions: Int64Array, rates: Int64Array) -> Int64Array:
        """`duties` for many positions and rates: a row each."""
        places = positions * self.size % CYCLE
        tables = _arrays()
        counts: Int64Array = tables[self.mode][places] * self.sixteenths // 16
        if self.auto >= 0:
            fast = rates // 256 > self.auto
            counts[fast] = tables[self.auto_mode][places[fast]]
        return counts

    def step_mode(self, rate: int) -> int:
        """The mode in force at a rate."""
        return self.auto_mode if 0 <= self.auto < rate // 256 else self.mode


def drive(
    *, mode: int, idle: int, moving: bool, forced: bool, half: bool, size: int, auto: int, auto_mode: int
) -> Drive:
    """The drive of a motor that moves or is idle. `forced` leaves the windings on as in motion (E mode)."""
    power = 8 if half else 16
    if moving:
        return Drive(mode, power, size, auto, auto_mode)
    if not forced:
        power = {OFF: 0, ON: power, HALF_IDLE: power // 2}[idle]
    return Drive(mode, power, size)
