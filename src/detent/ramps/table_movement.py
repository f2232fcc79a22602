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

    `interval` is the one between the loads of the ramp down. The ramp up ends at pulse `up`, the ramp down begins
    at pulse `down`: na and nd of the paper, both 0 without ramps and for a movement that was cut short.
    """

    train: Train
    counts: Sequence[int]
    loads: tuple[Load, ...]
    steps: int
    clocks: int  # of the last pulse
    interval: int = 0
    up: int = 0
    down: int = 0

    def __deepcopy__(self, _: Any) -> "Movement":
        return self


@lru_cache(maxsize=1024)
def constant(n: int, steps: int) -> Movement:
    """`steps` pulses n + 1 clocks apart."""
    generator = RateGenerator(n)
    generator.run_to(steps)
    return Movement(Train((generator.table(),)), (n,), (), steps, generator.at)


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
    return Movement(Train((generator.table(),)), counts, tuple(loads), steps, generator.at, table.interval, up, down)


def braked(movement: Movement, clock: int, interval: int) -> Movement:
    """The movement cut short at `clock`: the table is run back from the entry in force then, a load every `interval`.

    A ramp down that has begun with an interval no longer than that goes on as it is. The last pulse is the first
    after `clock` that comes a whole period of low speed after the one before it, or the last of the movement; without
    a ramp, it is the pulse that ends the running period. A load due at `clock` itself has been made.
    """
    counts = movement.counts
    made = [load for load in movement.loads if load.clock <= clock]
    if len(made) > len(movement.loads) // 2 and interval >= movement.interval:
        made, interval = list(movement.loads), movement.interval
    else:
        entry = made[-1].entry if made else 0
        made += [Load(clock + i * interval, entry - 1 - i) for i in range(entry)]
    generator = RateGenerator(counts[0])
    for at, entry in made:
        generator.load(at, counts[entry])
    generator.load(clock, counts[0])
    if generator.rows[-1][1] != counts[0] + 1:
        generator.run_to(generator.pulses + 1)
    if generator.pulses >= movement.steps:
        return movement
    return Movement(Train((generator.table(),)), counts, tuple(made), generator.pulses, generator.at, interval)
