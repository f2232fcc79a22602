"""A rotor on its way: the pulses that come, what the drive remembers, and when the rotor is at rest."""

from copy import copy
from math import ceil, inf
from typing import Any

import numpy as np

from detent.cell.power import Power
from detent.cell.recording import Log
from detent.motors import kernel
from detent.motors.excitation import NOTHING, Changes, Sequencer
from detent.motors.rotor import Floats, Rotor
from detent.ticks import MS, NEVER, US, Ns

SLICE: Ns = 20 * MS  # a rotor is asked so often whether it has come to rest, and looked ahead so far
LONGEST_SWING: Ns = 1000 * MS  # behind the last pulse; a rotor that swings on (nothing damps it) is then taken to rest
STILL = 1e-3  # rad/s: slower is at rest
SAMPLE: Ns = 50 * US  # of the trace
CHUNK = 1 << 14  # pulses in one go


class Course:
    """A rotor, the drive's memory, and the pulses that are to come: whatever changes as time goes on."""

    __slots__ = (
        "anchor",
        "direction",
        "frozen",
        "last",
        "next",
        "power",
        "rotor",
        "sequencer",
        "shaft",
        "train",
        "way",
    )

    def __init__(self, rotor: Rotor, sequencer: Sequencer) -> None:
        self.rotor, self.sequencer = rotor, sequencer
        self.train: Any = None
        self.next, self.last, self.direction = 1, 0, 1  # pulses next .. last are to come
        self.anchor: Ns = rotor.now  # the last change of excitation
        self.shaft, self.way = 0, 1  # where the axis counts to be, and which way: for who commands by its position
        self.power: Power | None = None  # how the controller has the power stage, if it commands it
        self.frozen = True  # at rest, and not computed until something happens

    def twin(self) -> "Course":
        """A copy that goes its own way."""
        made = copy(self)
        made.rotor = self.rotor.__deepcopy__({})
        made.sequencer = copy(self.sequencer)
        return made

    def __deepcopy__(self, _: object) -> "Course":
        return self.twin()

    def next_change(self) -> Ns:
        """When the next pulse falls, or the drive changes something by itself."""
        pulse = self.train.time_of(self.next) if self.next <= self.last else NEVER
        return int(min(pulse, self.sequencer.slows_at, self.sequencer.holds_at))

    def rate(self, at: Ns) -> int:
        """Of the pulses at `at`, in steps/s; 0 at rest."""
        return int(self.train.state_at(at).rate) if self.train is not None and self.next <= self.last else 0

    def go(self, until: Ns, low: float = -inf, high: float = inf, trace: "Log[Floats] | None" = None) -> bool:
        """Go on to `until`, changes of that instant included. True, somewhere before, if the rotor reaches an angle."""
        while (at := self.next_change()) <= until:
            if self._wait(at, low, high, trace):
                return True
            if self._run(self._due(at, until), low, high, trace):
                return True
        return self._wait(until, low, high, trace)

    def change(self, changes: Changes, trace: "Log[Floats] | None") -> None:
        """The excitation changes, now, for another reason than a pulse."""
        self._run(changes, -inf, inf, trace)

    def _due(self, at: Ns, until: Ns) -> Changes:
        """What changes at `at`, and the pulses that follow it closely."""
        if self.next > self.last or self.train.time_of(self.next) > at:
            return self.sequencer.up_to(at)
        end = min(self.train.steps_by(until), self.last, self.next + CHUNK - 1)
        times = self.train.times(self.next, end)
        apart = np.flatnonzero(np.diff(times) > SLICE)
        if len(apart):
            times = times[: int(apart[0]) + 1]
        self.next += len(times)
        self.shaft += self.way * len(times)
        changes = self.sequencer.pulses(times, self.direction)
        if self.power is not None:
            self.power.shape(changes, self.sequencer, self.train, self.next, times)
        return changes

    def _run(self, changes: Changes, low: float, high: float, trace: "Log[Floats] | None") -> bool:
        if self.frozen:
            begin = max(self.rotor.now, int(changes.times[0]))
            if trace is not None:
                trace.append(row_of(self.rotor, begin))
            self.rotor.n[kernel.NOW] = begin
            self.frozen = False
        self.anchor = int(changes.times[-1])
        return self._compute(changes, self.anchor, low, high, trace)

    def _wait(self, until: Ns, low: float, high: float, trace: "Log[Floats] | None") -> bool:
        """No change before `until`: slice after slice, until the rotor is at rest."""
        slice_ = SLICE // self.rotor.rig.substep * self.rotor.rig.substep  # its ends are ends of substeps
        while not self.frozen and self.rotor.now < until:
            boundary = self.anchor + ((self.rotor.now - self.anchor) // slice_ + 1) * slice_
            if self._compute(NOTHING, min(boundary, until), low, high, trace):
                return True
            if self.rotor.now < boundary:
                break  # what is left before `until` is less than a substep
            still = abs(self.rotor.speed) < STILL and abs(float(self.rotor.s[kernel.ACC])) < STILL * 1e3
            if still or boundary - self.anchor >= LONGEST_SWING:
                self.frozen = True
                self.rotor.s[kernel.W] = self.rotor.s[kernel.ACC] = 0.0
        return False

    def _compute(self, changes: Changes, until: Ns, low: float, high: float, trace: "Log[Floats] | None") -> bool:
        rows = None
        if trace is not None:
            self.rotor.n[kernel.TRACED] = 0
            rows = np.empty(((until - self.rotor.now) // SAMPLE + 2, kernel.COLUMNS))
        code = self.rotor.run(changes, until, low, high, rows)
        if trace is not None and rows is not None and (done := int(self.rotor.n[kernel.TRACED])):
            trace.append(rows[:done])
        return code == kernel.CROSSED


def row_of(rotor: Rotor, at: Ns) -> Floats:
    """A row of the trace: the state as it is, said to be that of `at`."""
    s = rotor.s
    phi = rotor.rig.drive.winding.angle(int(rotor.n[kernel.PLACE]))
    return np.array([[at, s[kernel.X], s[kernel.W], s[kernel.IA], s[kernel.IB], phi]], np.float64)


def crossing_time(rotor: Rotor, edge: float, up: bool) -> Ns:
    """When, within the substep that `advance` stopped before, the rotor reaches the edge: the first ns behind it."""
    s = rotor.s
    x0, w0, acc = float(s[kernel.X]), float(s[kernel.W]), float(s[kernel.ACC_NEXT])
    first, last = 0.0, int(rotor.n[kernel.STEP]) * 1e-9
    for _ in range(60):
        middle = (first + last) / 2
        x = x0 + rotor.rig.motor.teeth * middle * (w0 + 0.5 * acc * middle)
        if (x >= edge) if up else (x <= edge):
            last = middle
        else:
            first = middle
    return rotor.now + ceil(last * 1e9)
