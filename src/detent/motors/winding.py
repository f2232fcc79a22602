"""Winding tables: what the two phases get at each place of the sequence.

A table covers one electrical cycle (four full steps). Its values are in units of the drive's phase current, so that
both phases fully on are (1, 1) and a phase alone is (1, 0). `angle` is where the field points, in electrical radians:
where the rotor of an ideal motor stands.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, cos, floor, hypot, pi, sin, sqrt

from detent.motors.motor import MotorError, Shared

MOST_MICROSTEPS = 64


@dataclass(frozen=True, slots=True)
class Winding(Shared):
    """A sequence of phase currents; `steps` places a full step."""

    name: str
    steps: int
    a: tuple[float, ...]
    b: tuple[float, ...]
    offset: float = 0.0  # electrical angle of place 0

    def __len__(self) -> int:
        return len(self.a)

    @property
    def pitch(self) -> float:
        """Electrical radians from one place to the next."""
        return 2 * pi / len(self.a)

    def angle(self, place: int) -> float:
        """The electrical angle that place (of any turn) asks for."""
        return self.offset + place * self.pitch

    def inaccurate(self, part: float) -> "Winding":
        """The same sequence with its field off by up to `part` of a full step between the full steps, and not at them.

        That is how far a maker lets a motor's microsteps be from their places: one error a full step, as a sine.
        """
        if part == 0 or self.steps < 4:
            return self
        a, b = [], []
        for x, y in zip(self.a, self.b, strict=True):
            length, angle = hypot(x, y), atan2(y, x)
            angle += part * pi / 2 * sin(4 * angle)
            a.append(length * cos(angle))
            b.append(length * sin(angle))
        return Winding(self.name, self.steps, tuple(a), tuple(b), self.offset)

    def every(self, places: int) -> "Winding":
        """The same sequence with one step of so many places, which divide a full step."""
        if self.steps % places:
            raise MotorError(f"{self.name} has {self.steps} places a step, which {places} does not divide")
        return Winding(self.name, self.steps // places, self.a[::places], self.b[::places], self.offset)

    def on_grid(self, steps: int) -> "Winding":
        """The same sequence counted `steps` places to a full step: it moves on only where it has a place."""
        if steps % self.steps:
            raise MotorError(f"{self.name} has {self.steps} places a step: that does not divide {steps}")
        every = steps // self.steps
        a, b = (tuple(value for value in values for _ in range(every)) for values in (self.a, self.b))
        return Winding(self.name, steps, a, b, self.offset)


def _sampled(name: str, steps: int, offset: float, current: Callable[[int], float]) -> Winding:
    """A table whose vector at place k has the length `current(k)`. Exact zeros and ones stay exact."""
    angles = [offset + k * pi / (2 * steps) for k in range(4 * steps)]
    return Winding(name, steps,
                   tuple(_clean(current(k) * cos(angle)) for k, angle in enumerate(angles)),
                   tuple(_clean(current(k) * sin(angle)) for k, angle in enumerate(angles)), offset)  # fmt: skip


def _clean(value: float) -> float:
    near = round(value)
    return float(near) if abs(value - near) < 1e-12 else value


def microstep(n: int, *, amplitude: float = sqrt(2)) -> Winding:
    """Sine and cosine, `n` places a full step. The vector is sqrt(2) I long, as with both phases on, unless told."""
    if not 1 <= n <= MOST_MICROSTEPS:
        raise MotorError(f"microstepping divides a step by 1 to {MOST_MICROSTEPS}, not by {n}")
    return _sampled(f"1/{n}", n, 0.0, lambda _: amplitude)


FULL = _sampled("full", 1, pi / 4, lambda _: sqrt(2))  # two phases on
WAVE = _sampled("wave", 1, 0.0, lambda _: 1.0)  # one phase on
HALF = _sampled("half", 2, 0.0, lambda k: sqrt(2) if k % 2 else 1.0)
HALF_COMPENSATED = _sampled("half-compensated", 2, 0.0, lambda _: sqrt(2))


def winding(name: str) -> Winding:
    """The table of that name: full, wave, half, half-compensated, or 1/2 to 1/64. MotorError for another."""
    known = {table.name: table for table in (FULL, WAVE, HALF, HALF_COMPENSATED)}
    if name in known:
        return known[name]
    top, slash, bottom = name.partition("/")
    if slash and top.strip() == "1" and bottom.strip().isdigit():
        return microstep(int(bottom))
    raise MotorError(f"no stepping {name!r}; there are: {', '.join(known)}, and 1/2 to 1/{MOST_MICROSTEPS}")


# -- the tables of the controllers and their drives ------------------------------------------------------------


def genstepper(mode: int) -> Winding:
    """BS0610 and BS0710, the O command: 64 places a step whatever the mode.

    0 drops the fraction of a step (one winding on), 1 floors it to 0 or 1/2, 2 forces 1/2 (both windings on), 3 is
    sine and cosine of constant torque. Both phases full on are 1 in all of them.
    """
    if mode not in range(4):
        raise MotorError(f"O takes 0 to 3, not {mode}")
    grid = 64
    if mode == 3:
        return _sampled("O3", grid, 0.0, lambda _: 1.0)
    quarter = (WAVE, HALF, FULL)[mode]
    places = [floor(k * quarter.steps / grid) for k in range(4 * grid)]
    return Winding(f"O{mode}", grid, tuple(quarter.a[p] for p in places), tuple(quarter.b[p] for p in places), 0.0)


GRID = 64
"""Places in a full step of the sequences that can be commanded."""
_BOARD = tuple(genstepper(mode) for mode in range(4))
DCB_274 = (microstep(8, amplitude=1.0), microstep(4, amplitude=1.0), HALF, FULL, microstep(2, amplitude=1.0), WAVE)
"""By the number of H (manual, page 40: microsteps have low torque, half steps high, full steps the highest)."""
ANY_DRIVE = (HALF, FULL, WAVE, HALF_COMPENSATED, *(microstep(2**n) for n in range(1, 7)))
"""What the drives do that a controller with pulses and direction may be wired to, the usual one first."""
COMMANDED: dict[str, tuple[Winding, ...]] = {
    "dcb-274": tuple(table.on_grid(GRID) for table in DCB_274),  # by H
    "bs0610": _BOARD,  # by O
    "bs0710": _BOARD,
}
"""The sequences of the controllers that command their power stage, by the number in their command."""
