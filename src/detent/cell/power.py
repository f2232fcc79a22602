"""The power stage as a controller commands it (`Stage`), put into the changes of excitation that a motor is given."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from detent.controllers.device import Stage
from detent.motors.drive import FAST, SLOW, Currents
from detent.motors.excitation import Changes, Int64, Sequencer, at_once
from detent.pulses import Train
from detent.pulses.rates import rates_at
from detent.ticks import NEVER, Ns

CYCLE = 256  # places of 1/64 full step in an electrical cycle
STOPPED = 3  # times the last interval without a step from outside: the motor is taken to stand


class Power(NamedTuple):
    """A stage that is in force; `factor` makes of its power a level of the drive."""

    stage: Stage
    factor: float

    def __deepcopy__(self, _: object) -> "Power":
        return self

    @property
    def run(self) -> float:
        """The level with which it moves."""
        return self.stage.run * self.factor

    def level(self, sequencer: Sequencer) -> float:
        """The level between two pulses."""
        return sequencer.own_level if self.stage.settling else self.run

    def take(self, sequencer: Sequencer, position: int, rate: int) -> None:
        """Put it in force: the sequence jumps to the nearest place that has the phase of `position`."""
        stage = self.stage
        phase = position * stage.places + stage.start
        sequencer.place += (phase - sequencer.place + CYCLE // 2) % CYCLE - CYCLE // 2
        sequencer.stride = stage.places
        currents = Currents(self.run, self.run, stage.hold * self.factor, stage.settling)
        sequencer.drive = replace(sequencer.drive, currents=currents)
        fast = stage.fast_from is not None and rate >= stage.fast_from
        sequencer.row = stage.fast_sequence if fast else stage.sequence
        sequencer.level = self.factor if fast else self.level(sequencer)
        if stage.slow_over is not None and not sequencer.moving:
            sequencer.set_mode(SLOW)

    def begins(self, sequencer: Sequencer, at: Ns, first: Ns) -> Changes:
        """A motion begins at `at`, perhaps long before its first pulse: the run current flows already."""
        sequencer.measured = at - sequencer.last if first <= at else None
        sequencer.moving = True
        if self.stage.settling:
            sequencer.run_from(max(at, first))
            sequencer.level = self.run if sequencer.on else 0.0
        return _now(sequencer, at)

    def ends(self, sequencer: Sequencer, at: Ns) -> Changes:
        """A motion ends: the settling time begins. Decay is slow, unless steps from outside are still measured."""
        sequencer.moving = False
        if self.stage.settling:
            sequencer.run_from(at)
        if self.stage.slow_over is not None and sequencer.measured is None:
            sequencer.set_mode(SLOW)
        return _now(sequencer, at)

    def shape(self, changes: Changes, sequencer: Sequencer, train: Train, following: int, times: Int64) -> None:
        """Give pulses of a train, the last of `changes`, their sequence and decay; pulse `following` is the next."""
        stage, own = self.stage, slice(len(changes) - len(times), None)
        if stage.fast_from is not None:
            fast = rates_at(train, times) >= stage.fast_from
            changes.rows[own] = np.where(fast, stage.fast_sequence, stage.sequence)
            changes.levels[own] = np.where(fast, self.factor, self.run) if sequencer.on else 0.0
            sequencer.row, sequencer.level = int(changes.rows[-1]), float(changes.levels[-1])
        if stage.slow_over is None:
            return
        if sequencer.measured is not None:
            slow = np.array([sequencer.measured > stage.slow_over])
            until = int(times[-1]) + STOPPED * min(sequencer.measured, NEVER // 8)
        else:
            more = train.steps is None or following <= train.steps
            slow = np.diff(times, append=train.time_of(following) if more else NEVER) > stage.slow_over
            until = NEVER
        changes.modes[own] = np.where(slow, SLOW, FAST)
        if slow[-1]:
            sequencer.set_mode(SLOW)
        else:
            sequencer.set_fast(until)


def _now(sequencer: Sequencer, at: Ns) -> Changes:
    return at_once(at, sequencer.place, sequencer.level, sequencer.row, sequencer.mode)
