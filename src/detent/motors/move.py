"""One move, judged by whether the rotor followed every pulse.

A rotor that falls more than a full electrical turn behind has lost four steps, even if it is caught again; one that
rests a turn away from its command has, too. A load angle beyond 90 degrees alone is no loss: running motors stand up
to 250 degrees behind their command (90 + atan(p w L / R), and their swing).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import degrees, pi
from typing import NamedTuple, TypeAlias

import numpy as np

from detent.motors import engine, kernel
from detent.motors.excitation import Int64, Sequencer
from detent.motors.motor import MotorError
from detent.motors.rotor import Floats, Rig, Rotor, substeps, swing_of
from detent.pulses import Train
from detent.ticks import Ns, show_duration

STILL = 0.02  # full steps: a rotor that swings by less is at rest
CHUNK = 1 << 16
MOST_SUBSTEPS = 20_000_000_000  # hours, even compiled


class Part(NamedTuple):
    """Pulses `first` to `last` (None: all) of a train, all in one direction."""

    train: Train
    direction: int = 1
    first: int = 1
    last: int | None = None


Pulses: TypeAlias = Train | Int64 | Sequence[Part]
"""A train (forward), times in ns (forward), or several trains with their directions, one after the other."""


class Verdict(NamedTuple):
    """What became of a move."""

    lost: bool
    margin: float  # 1 - largest load angle / 360 degrees; below 0 when lost on the way
    load_angle: float  # the largest, electrical degrees
    worst_pulse: int  # the pulse after which it was reached; 0: before the first
    lost_pulse: int | None  # the pulse after which the load angle passed 360 degrees
    slip: int  # whole electrical turns between command and rotor in the end; + the rotor is behind
    error: float  # command less rotor in the end, full steps
    swing: float = 0.0  # how far the rotor still swings in the end either way, full steps

    @property
    def steps_lost(self) -> int:
        """Full steps that the rotor is behind (negative: ahead) for good."""
        return 4 * self.slip

    @property
    def resting(self) -> bool:
        """Whether the rotor had come to rest in the end."""
        return self.swing < STILL

    @property
    def where_it_rests(self) -> str:
        """Where the rotor is in the end, in words."""
        if not self.resting:
            return f"still swings by {self.swing:.2g} full steps either way"
        if abs(self.error) < 0.005:
            return "rests where it shall"
        side = "behind" if self.error >= 0 else "ahead"
        return f"rests {abs(self.error):.2f} full steps {side}"

    def __str__(self) -> str:
        if not self.lost:
            return (
                f"no step lost; largest load angle {self.load_angle:.0f} of 360 degrees, after pulse {self.worst_pulse}"
            )
        # how many steps behind is not said: it hangs on the last digit of every number, and is no use to anybody
        if self.lost_pulse is not None:
            return f"steps lost: the rotor falls a whole electrical turn (4 steps) behind after pulse {self.lost_pulse}"
        return "steps lost: the rotor stops a whole electrical turn (4 steps) or more from its command"


class Energies(NamedTuple):
    """Where the energy of a run went, joule."""

    electric: float  # into the windings
    copper: float
    mechanic: float  # given to the shaft
    magnetic: float  # more in the windings at the end than at the start


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A simulated move: the verdict, and the trace if one was asked for (columns as in `kernel`)."""

    rig: Rig
    verdict: Verdict
    energies: Energies
    pulses: int
    ends: Ns  # of the last pulse
    trace: Floats

    @property
    def times(self) -> Floats:
        """S."""
        return self.trace[:, kernel.T_COLUMN] * 1e-9

    @property
    def load_angles(self) -> Floats:
        """Electrical degrees."""
        return np.degrees(self.trace[:, kernel.PHI_COLUMN] - self.trace[:, kernel.X_COLUMN])

    @property
    def rotor(self) -> Floats:
        """Where the rotor is, in full steps."""
        return (self.trace[:, kernel.X_COLUMN] - self.rig.drive.winding.offset) / (pi / 2)

    @property
    def command(self) -> Floats:
        """Where it should be, in full steps."""
        return (self.trace[:, kernel.PHI_COLUMN] - self.rig.drive.winding.offset) / (pi / 2)

    @property
    def speed(self) -> Floats:
        """Full steps/s."""
        return self.trace[:, kernel.W_COLUMN] * self.rig.motor.steps / (2 * pi)


def simulate(
    pulses: Pulses,
    rig: Rig,
    *,
    settle: Ns | None = None,
    sample: Ns | None = None,
    begin: Ns = 0,
) -> Run:
    """What the motor makes of these pulses, from rest at `begin`, to `settle` (the rig's) after the last one.

    `sample` asks for a trace with a row every so often (0: every substep). MotorError for data that do not go
    together, for a train without end, and for a job too long to be waited for.
    """
    parts = parts_of(pulses)
    count, ends = extent_of(parts, begin)
    settle = rig.settle if settle is None else settle
    work = substeps(ends + settle - begin, count, rig.substep)
    what = f"a move of {count} pulses in {show_duration(ends - begin)}"
    if work > MOST_SUBSTEPS:
        raise MotorError(f"{what} is more than can be computed: simulate a part of it")
    engine.check_size(work, what)
    trace = None
    if sample is not None:
        # events make short substeps, each of which may have a row
        rows = (work if sample < rig.substep else substeps(ends + settle - begin, 0, max(sample, 1))) + count + 2
        trace = np.zeros((min(rows, work + 2), kernel.COLUMNS))
    sequencer = Sequencer(rig.drive)
    rotor = Rotor(rig, sequencer, begin, sample or 0)
    magnetic = _magnetic(rig, rotor)
    for times, direction in chunks_of(parts):
        rotor.run(sequencer.pulses(times, direction), int(times[-1]), trace=trace)
    rotor.run(sequencer.up_to(ends + settle), ends + settle, trace=trace)
    electric, copper, mechanic = (float(rotor.s[k]) for k in (kernel.ELECTRIC, kernel.COPPER, kernel.MECHANIC))
    energies = Energies(electric, copper, mechanic, _magnetic(rig, rotor) - magnetic)
    rows_done = trace[: int(rotor.n[kernel.TRACED])] if trace is not None else np.zeros((0, kernel.COLUMNS))
    return Run(rig, verdict(rotor), energies, count, ends, rows_done)


def verdict(rotor: Rotor) -> Verdict:
    """The verdict on a rotor that has had time to settle."""
    winding, s, par = rotor.rig.drive.winding, rotor.s, rotor.rig.parameters
    delta = winding.angle(int(rotor.n[kernel.PLACE])) - rotor.angle
    worst, lost_pulse = float(s[kernel.WORST]), int(rotor.n[kernel.LOST_PULSE])
    swing = float(swing_of(s[kernel.W], s[kernel.ACC], par, rotor.rig.drive.current))
    return judged(delta, worst, int(rotor.n[kernel.WORST_PULSE]), lost_pulse, swing)


def judged(delta: float, worst: float, worst_pulse: int, lost_pulse: int, swing: float) -> Verdict:
    """The verdict from the last and the largest load angle, and the swing that is left (el. rad)."""
    slip = round(delta / (2 * pi))
    return Verdict(
        worst > 2 * pi or slip != 0, 1 - worst / (2 * pi), degrees(worst), worst_pulse,
        None if lost_pulse < 0 else lost_pulse, slip, delta / (pi / 2), swing / (pi / 2),
    )  # fmt: skip


def parts_of(pulses: Pulses) -> Sequence[Part | Int64]:
    """The pulses as parts. MotorError for times that are none."""
    if isinstance(pulses, Train):
        return [Part(pulses)]
    if isinstance(pulses, np.ndarray):
        if (
            pulses.ndim != 1
            or pulses.dtype.kind not in "iu"
            or (len(pulses) > 1 and bool((np.diff(pulses) <= 0).any()))
        ):
            raise MotorError("pulse times are whole ns in one rising array")
        return [pulses.astype(np.int64, copy=False)]
    return pulses


def extent_of(parts: Sequence[Part | Int64], begin: Ns) -> tuple[int, Ns]:
    """How many pulses, and when the last one falls."""
    count, ends = 0, begin
    for part in parts:
        if isinstance(part, Part):
            last = part.train.steps if part.last is None else part.last
            if last is None:
                raise MotorError("the move has no end: say how many of its pulses to simulate (Part with last)")
            if last < part.first:
                continue
            first_at, last_at = part.train.time_of(part.first), part.train.time_of(last)
            count += last - part.first + 1
        else:
            if not len(part):
                continue
            first_at, last_at = int(part[0]), int(part[-1])
            count += len(part)
        if first_at < ends:
            raise MotorError(f"pulses at {first_at} ns come before {ends} ns, where the part before them ends")
        ends = last_at
    return count, ends


def chunks_of(parts: Sequence[Part | Int64]) -> Iterator[tuple[Int64, int]]:
    """Times and direction of the pulses, some at a time; each array is valid until the next."""
    for part in parts:
        if isinstance(part, Part):
            last = part.train.steps if part.last is None else part.last
            if last is not None and last >= part.first:
                yield from ((chunk, part.direction) for chunk in part.train.chunks(CHUNK, part.first, last))
        elif len(part):
            yield part, 1


def _magnetic(rig: Rig, rotor: Rotor) -> float:
    """Energy in the windings, J."""
    squares = float(rotor.s[kernel.IA]) ** 2 + float(rotor.s[kernel.IB]) ** 2
    return 0.5 * float(rig.parameters[kernel.L]) * squares
