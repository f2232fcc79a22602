"""Movements of the SUPERSIGMA drive: a table of differences run through a rate generator, up and back.

A movement is a list of loads - at which clock which entry of the table is reached - and a number of pulses. The
pulses follow from the loads alone, so a movement that is cut short is the loads made so far and those that bring
the motor down, and agrees with every pulse given before.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from detent.pulses import Train
from detent.ramps.differences import Differences
from detent.ramps.rate_generator import RateGenerator


class Load(NamedTuple):
    """At `clock`, counted from the start, the generator gets the N behind `entry` differences."""

    clock: int
    entry: int


class Movement(NamedTuple):
    """What was planned. `train` starts at 0; `counts` are the N by entry, the low speed first.

    The ramp up ends at pulse `up` and the ramp down begins at pulse `down`, the numbers na and nd of the paper;
    both are 0 without a ramp, and `down` is `up` where a movement was cut short before.
    """

    train: Train
    counts: Sequence[int]
    loads: tuple[Load, ...]
    steps: int
    up: int = 0
    down: int = 0

    def __deepcopy__(self, _: Any) -> "Movement":
        return self


@lru_cache(maxsize=1024)
def constant(n: int, steps: int) -> Movement:
    """`steps` pulses n + 1 clocks apart."""
    generator = RateGenerator(n)
    generator.run_to(steps)
    return Movement(Train((generator.table(),)), (n,), (), steps)


@lru_cache(maxsize=1024)
def ramped(table: Differences, first: int, entries: int, steps: int, offset: int) -> Movement:
    """`steps` pulses with a ramp of the first `entries` differences from N = `first`, and the same ramp back.

    One difference is subtracted every interval; at the end of the ramp the counter is read (na). At pulse
    nd = steps - na - offset the first is added back, the others follow an interval apart; what is left then goes
    at the low speed. ValueError if steps < 2 na + offset, or if the pulses end before the table does.
    """
    counts = table.counts(first)[: entries + 1]
    if not entries:
        return constant(first, steps)
    generator = RateGenerator(first)
    loads = [Load(entry * table.interval, entry) for entry in range(1, entries + 1)]
    for clock, entry in loads:
        generator.load(clock, counts[entry])
    up = generator.pulses - 1  # the one behind them ends the period that runs at the last load
    down = steps - up - offset
    if down < up:
        raise ValueError(f"{steps} steps are too few for two ramps of {up} and the offset {offset}")
    generator.run_to(down)
    begin = generator.at if down > up else loads[-1].clock
    for i in range(entries):
        loads.append(Load(begin + i * table.interval, entries - 1 - i))
        generator.load(loads[-1].clock, counts[entries - 1 - i])
    if generator.pulses > steps:
        raise ValueError(f"the table ends at pulse {generator.pulses} of {steps}: the offset {offset} is too small")
    generator.run_to(steps)
    return Movement(Train((generator.table(),)), counts, tuple(loads), steps, up, down)


def braked(movement: Movement, clock: int, interval: int | None) -> Movement:
    """The movement cut short at `clock`: the table is run back from the entry in force then, a load every `interval`.

    With `interval` None a ramp down that has begun goes on as it is, else the interval is that of the ramp. The
    last pulse is the first that comes a whole period of low speed after the one before, or the last of the movement.
    Loads due at `clock` itself have been made. A movement without a ramp ends with its running period.
    """
    made = [load for load in movement.loads if load.clock <= clock]
    if interval is None and len(made) > len(movement.loads) // 2:
        made = list(movement.loads)
    else:
        step = movement.loads[0].clock if interval is None and made else interval or 0
        entry = made[-1].entry if made else 0
        made += [Load(clock + i * step, entry - 1 - i) for i in range(entry)]
    counts = movement.counts
    generator = RateGenerator(counts[0])
    for at, entry in made:
        generator.load(at, counts[entry])
    generator.load(max(clock, generator.at if len(made) and made[-1].clock > clock else clock), counts[0])
    low = counts[0] + 1
    if generator.rows[-1][1] != low:
        generator.run_to(generator.pulses + 1)
    steps = min(generator.pulses, movement.steps)
    train = Train((generator.table(),)).head(steps)
    return Movement(train, counts, tuple(made), steps, movement.up, movement.up)
