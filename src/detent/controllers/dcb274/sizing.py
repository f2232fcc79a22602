"""Current, supply and decay for a motor, as the manual advises (pages 4, 5, 11, 13, 36, 52 and 61 to 65)."""

from typing import Final, NamedTuple

from detent.controllers.dcb274 import settings
from detent.controllers.dcb274.current import FULL_CURRENT, threshold

LEAST_SUPPLY: Final = 24.0  # V (page 13)
OPERATES_FROM: Final = 12.0  # V (page 4)
MOST_SUPPLY: Final = 40.0
MOST_POWER: Final = 100.0  # VA (page 52)
RATED_TIMES: Final = 2.0  # "2 times the winding rating" is the least supply (page 64)
MORE: Final = (1.1, 1.2)  # "10 to 20%" above the least reliable current (page 64)
FULL_STEPS: Final = 200  # in a turn (page 61)


class Advice(NamedTuple):
    """What to set, and what the supply must be."""

    run: int  # of Y, percent
    hold: int
    rated_volts: float  # of a winding
    least_supply: float
    watts: float  # of both windings at the run current
    decay: int  # of b
    steps_per_s: int  # the rate of that threshold
    warnings: tuple[str, ...]


def advise(
    current: float, resistance: float, supply: float, hold: float | None, speed: float, resolution: int
) -> Advice:
    """For a motor of `current` A and `resistance` ohm a phase; decay changes at `speed` rev/min with step table H.

    `hold` is in A; None: half the run current, as the example on page 5 has it. Raises ValueError.
    """
    if not current > 0 or not resistance > 0 or not supply > 0:
        raise ValueError("current, resistance and supply must be more than 0")
    asked = current
    current = min(current, FULL_CURRENT)
    hold = current / 2 if hold is None else hold
    run = int(current * 100 / FULL_CURRENT + 1e-9)
    held = min(int(hold * 100 / FULL_CURRENT + 1e-9), 100)
    volts = asked * resistance
    least = max(LEAST_SUPPLY, RATED_TIMES * volts)
    watts = 2 * current * current * resistance
    # the least b is 1 here: 0 would be fast at every speed, 255 slow (page 36)
    unit = threshold(1, resolution)
    per_s = speed / 60 * FULL_STEPS * settings.RESOLUTION[resolution]
    decay = min(max(round(per_s / unit), 1), 254)
    warnings = []
    if asked > FULL_CURRENT:
        warnings.append(f"{asked:g} A is more than the {FULL_CURRENT:g} A of Y 100 (page 52)")
    if supply > MOST_SUPPLY:
        warnings.append(f"{supply:g} V: the supply must never exceed {MOST_SUPPLY:g} V (pages 11, 13)")
    elif supply < OPERATES_FROM:
        warnings.append(
            f"{supply:g} V: it operates from {OPERATES_FROM:g} V on, and should have {LEAST_SUPPLY:g} V (page 4)"
        )
    elif supply < LEAST_SUPPLY:
        warnings.append(f"{supply:g} V: below {LEAST_SUPPLY:g} V it runs, from 12 V on; the manual "
                        "advises against it: lower performance, more supply current (page 4)")  # fmt: skip
    if least > MOST_SUPPLY:
        warnings.append(f"no supply that the drive takes is twice the {volts:.3g} V of the winding (page 64): "
                        "connect the coils in parallel, or take half of each winding (pages 63, 64)")  # fmt: skip
    elif supply < RATED_TIMES * volts:
        warnings.append(f"the least supply is twice the {volts:.3g} V of the winding (page 64)")
    if watts > MOST_POWER:
        warnings.append(f"{watts:.3g} W in the windings: the drive gives at most {MOST_POWER:g} VA (page 52)")
    if hold > current:
        warnings.append("hold is more than run: hold current is meant to be the smaller one (page 52)")
    return Advice(run, held, volts, least, watts, decay, threshold(decay, resolution), tuple(warnings))
