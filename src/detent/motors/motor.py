"""What a motor is: its maker's numbers, checked for sense.

Units are SI throughout: ohm, H, A, Nm, kg m2, s, rad. Makers' sheets say mH, mNm and g cm2; `named` turns them once.

The current of a sheet is that of each phase with both phases on, and the holding torque is the one at that current;
so the torque constant of a phase is Th / (sqrt(2) I). For a hybrid motor that is the same number as the maker's rule
for the EMF, Th / (2 I) volts rms per rad/s (QSH4218 manual, section 5.4).
"""

from dataclasses import dataclass, field, replace
from math import inf, isfinite, pi, sqrt
from typing import Any

from detent.one_line import one_line


class MotorError(ValueError):
    """Data that no motor, drive or load can have, or that do not go together; the text has the remedy."""

    def __init__(self, text: str) -> None:
        super().__init__(one_line(text))


class Shared:
    """Never changes: copies of a cell share it."""

    __slots__ = ()

    def __copy__(self) -> "Shared":
        return self

    def __deepcopy__(self, memo: Any) -> "Shared":
        return self


def need(owner: str, least: float, below: float = inf, /, *, open_: bool = False, **values: float) -> None:
    """Raise MotorError unless every value is a finite number in [least, below], or (least, below] if `open_`."""
    for name, value in values.items():
        good = isinstance(value, (int, float)) and not isinstance(value, bool) and isfinite(value)
        if not good or value < least or value > below or (open_ and value == least):
            word = name.replace("_", " ")
            bound = f"greater than {least:g}" if open_ else f"at least {least:g}"
            most = "" if below == inf else f" and at most {below:g}"
            raise MotorError(f"{owner}: {word} is {value!r}: give a number {bound}{most}")


_WIRED = {  # resistance, inductance, current, holding torque; those in series are 1
    "series": (1.0, 1.0, 1.0, 1.0),
    "parallel": (0.25, 0.25, 2.0, 1.0),
    "unipolar": (0.5, 0.25, sqrt(2), sqrt(0.5)),
}
WIRINGS = tuple(_WIRED)


@dataclass(frozen=True, slots=True)
class Motor(Shared):
    """A two-phase hybrid or permanent-magnet step motor, one rotor and two windings.

    `inductance_factor` and `viscous` are what a fit to a measured torque curve adds to the data sheet (`fit`): by
    default the sheet is taken at its word. `viscous` is also where iron losses go: a magnetising resistance Rm is
    exactly Kt**2 / Rm of it.
    """

    name: str
    resistance: float  # ohm, of a phase
    inductance: float  # H, of a phase
    current: float  # A in each phase, both on
    holding_torque: float  # Nm at that current
    inertia: float | None = None  # kg m2, rotor; None: the maker does not say
    detent_torque: float = 0.0  # Nm, amplitude
    steps: int = 200  # full steps in a turn
    inductance_factor: float = 1.0
    viscous: float = 0.0  # Nm s/rad
    damping: float | None = None  # ratio of the bare rotor, measured; None: nobody knows
    accuracy: float = 0.0  # how far microsteps may be from their places, as a part of a full step; it does not add up
    wiring: str = ""  # series, parallel or unipolar, of a motor that can be wired otherwise
    title: str = field(default="", compare=False)
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        need(f"motor {self.name}", 0, open_=True, resistance=self.resistance, inductance=self.inductance,
             current=self.current, holding_torque=self.holding_torque)  # fmt: skip
        need(f"motor {self.name}", 0, detent_torque=self.detent_torque, viscous=self.viscous)
        need(f"motor {self.name}", 0.1, 10, inductance_factor=self.inductance_factor)
        need(f"motor {self.name}", 0, 0.25, accuracy=self.accuracy)
        if self.damping is not None:
            need(f"motor {self.name}", 0, 2, damping=self.damping)
        if self.wiring not in ("", *WIRINGS):
            raise MotorError(f"motor {self.name}: no wiring {self.wiring!r}; there are: {', '.join(WIRINGS)}")
        if self.inertia is not None:
            need(f"motor {self.name}", 0, open_=True, inertia=self.inertia)
        if not isinstance(self.steps, int) or self.steps < 4 or self.steps % 4:
            raise MotorError(
                f"motor {self.name}: {self.steps!r} steps a turn: a two-phase motor has a multiple of 4, like 200 or 48"
            )
        if self.detent_torque >= self.holding_torque:
            raise MotorError(
                f"motor {self.name}: its detent torque {self.detent_torque:g} Nm is not below its holding torque "
                f"{self.holding_torque:g} Nm: it would not turn; check the units"
            )
        constant = self.inductance * self.inductance_factor / self.resistance
        if constant > 1:
            raise MotorError(
                f"motor {self.name}: L / R is {constant:.3g} s, which "
                "no step motor has: inductance is in H (a sheet's 2.8 mH is 0.0028)"
            )

    @property
    def teeth(self) -> int:
        """Electrical cycles in a turn (rotor teeth): 50 for 1.8 degrees."""
        return self.steps // 4

    @property
    def torque_constant(self) -> float:
        """Nm per A of a phase, and V per rad/s."""
        return self.holding_torque / (sqrt(2) * self.current)

    @property
    def real_inductance(self) -> float:
        """The inductance with the factor that a fit has found."""
        return self.inductance * self.inductance_factor

    @property
    def rotor(self) -> float:
        """The rotor's inertia. MotorError if the maker does not say."""
        if self.inertia is None:
            raise MotorError(
                f"motor {self.name}: its maker gives no rotor inertia, so that its motion cannot be computed: give it"
            )
        return self.inertia

    def natural_frequency(self, inertia: float = 0.0) -> float:
        """Hz of small swings about a rest position with `inertia` on the shaft: sqrt(p Th / J) / 2 pi."""
        return sqrt(self.teeth * self.holding_torque / (self.rotor + inertia)) / (2 * pi)

    def wired(self, wiring: str) -> "Motor":
        """The same motor with its windings in ``series``, in ``parallel``, or half of each used (``unipolar``).

        With the turns in series as 1: parallel has a quarter of R and L at twice the current and the same torque;
        half a winding has half of R and a quarter of L, sqrt(2) of the current (the same heat), 1/sqrt(2) of the
        torque. MotorError for another word, and where the motor's data do not say how it is wired.
        """
        if wiring not in WIRINGS:
            raise MotorError(f"no wiring {wiring!r}; there are: {', '.join(WIRINGS)}")
        if not self.wiring:
            raise MotorError(
                f"motor {self.name}: its data do not say how its windings are connected (four leads stay as they are): "
                "give its numbers with wiring = 'series', 'parallel' or 'unipolar'"
            )
        now, then = _WIRED[self.wiring], _WIRED[wiring]
        ohms, henries, amps, torque = (b / a for a, b in zip(now, then, strict=True))
        return replace(self, name=f"{self.name} ({wiring})" if wiring != self.wiring else self.name, wiring=wiring,
                       resistance=self.resistance * ohms, inductance=self.inductance * henries,
                       current=self.current * amps, holding_torque=self.holding_torque * torque)  # fmt: skip

    def in_parallel(self) -> "Motor":
        """The windings in parallel that are in series here: R and L a quarter, twice the current, the same torque."""
        return replace(self, wiring="series").wired("parallel")

    def changed(self, **changes: Any) -> "Motor":
        """The same motor with other numbers."""
        return replace(self, **changes)
