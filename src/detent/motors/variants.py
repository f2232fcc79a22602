"""One move, many motors: the same pulses for motors, loads and supplies that differ a little."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from detent.motors import engine, kernel
from detent.motors.excitation import Changes, Sequencer, joined
from detent.motors.motor import MotorError
from detent.motors.move import SETTLE, Pulses, Verdict, chunks_of, extent_of, judged, parts_of, simulate
from detent.motors.rotor import Rig, substeps
from detent.ticks import Ns


def changed(rig: Rig, **factors: float) -> Rig:
    """The rig with some of its numbers multiplied.

    `inertia` (rotor and load), `friction` (all of it), `voltage`, `torque_constant`, `inductance`, `resistance`, `load`
    (its torque). MotorError for another name.
    """
    motor, drive, load = rig.motor, rig.drive, rig.load
    for name, factor in factors.items():
        match name:
            case "inertia":
                motor = motor.changed(inertia=motor.rotor * factor)
                load = replace(load, inertia=load.inertia * factor)
            case "friction":
                motor = motor.changed(viscous=motor.viscous * factor)
                load = replace(load, friction=load.friction * factor, viscous=load.viscous * factor)
            case "voltage":
                drive = replace(drive, supply=drive.supply * factor, drop=drive.drop * factor)
            case "torque_constant":
                motor = motor.changed(holding_torque=motor.holding_torque * factor)
            case "inductance":
                motor = motor.changed(inductance=motor.inductance * factor)
            case "resistance":
                motor = motor.changed(resistance=motor.resistance * factor)
            case "load":
                load = replace(load, torque=load.torque * factor)
            case _:
                known = "inertia, friction, voltage, torque_constant, inductance, resistance, load"
                raise MotorError(f"no variant of {name!r}; there are: {known}")
    made = Rig(motor, drive, load, rig.substep)
    # pulse width without feedback: the duty stays, whatever the winding has become
    made.parameters[kernel.GAIN] = rig.parameters[kernel.GAIN] * factors.get("voltage", 1.0)
    return made


def judge(pulses: Pulses, rigs: Sequence[Rig], *, settle: Ns = SETTLE, begin: Ns = 0) -> list[Verdict]:
    """A verdict for each rig, all given the same pulses.

    The rigs have the same stepping and decay, and step as finely as the finest of them needs. MotorError otherwise.
    """
    if not rigs:
        return []
    first = rigs[0]
    for rig in rigs:
        if rig.drive.winding != first.drive.winding or (rig.drive.decay, rig.drive.decay_threshold,
            rig.drive.currents) != (first.drive.decay, first.drive.decay_threshold, first.drive.currents) \
                or rig.motor.steps != first.motor.steps:  # fmt: skip
            raise MotorError("variants share one pulse train: stepping, decay and current profile must be the same")
    if not all(rig.load.is_steady for rig in rigs):
        raise MotorError("variants are for loads whose torque is constant: simulate the others one by one")
    substep = min(rig.substep for rig in rigs)
    parts = parts_of(pulses)
    count, ends = extent_of(parts, begin)
    engine.check_size(
        substeps(ends + settle - begin, count, substep) * len(rigs), f"{len(rigs)} moves of {count} pulses"
    )
    if not engine.fast():
        return [_alone(pulses, rig, substep, settle, begin) for rig in rigs]
    from detent.motors import lockstep

    lanes = -(-len(rigs) // lockstep.LANES) * lockstep.LANES
    par = np.zeros((kernel.PARAMETERS, lanes))
    state = np.zeros((lockstep.ROWS, lanes))
    state[lockstep.LOST_PULSE] = lockstep.NEVER_LOST
    sequencer = Sequencer(first.drive)
    for lane in range(lanes):
        rig = rigs[min(lane, len(rigs) - 1)]  # the last ones fill up
        par[:, lane] = rig.parameters
        state[: kernel.ACC, lane] = rig.at_rest(sequencer.place, sequencer.level)[0][: kernel.ACC]
    place, level, mode, pulse, now = sequencer.place, sequencer.level, sequencer.mode, 0, begin

    def go(changes: Changes, until: Ns) -> None:
        nonlocal place, level, mode, pulse, now
        now = int(lockstep.advance_all(state, par, now, place, level, 0, mode, pulse, *changes, until, first.table_a,
                                       first.table_b, substep))  # fmt: skip
        if len(changes):
            pulse += int(np.count_nonzero(np.diff(changes.places, prepend=place)))
            place, level, mode = int(changes.places[-1]), float(changes.levels[-1]), int(changes.modes[-1])

    for times, direction in chunks_of(parts):
        go(sequencer.pulses(times, direction), int(times[-1]))
    go(joined(sequencer.up_to(ends + settle)), ends + settle)
    winding = first.drive.winding
    deltas = winding.angle(place) - state[kernel.X]
    if not np.isfinite(state).all():
        raise MotorError("a rotor runs away: a load that nothing holds; check torque and inertia of the load")
    lost = np.where(state[lockstep.LOST_PULSE] < lockstep.NEVER_LOST, state[lockstep.LOST_PULSE], -1)
    return [
        judged(float(deltas[k]), float(state[lockstep.WORST, k]), int(state[lockstep.WORST_PULSE, k]), int(lost[k]))
        for k in range(len(rigs))
    ]


def _alone(pulses: Pulses, rig: Rig, substep: Ns, settle: Ns, begin: Ns) -> Verdict:
    # the rig itself, not its parts: a variant of a voltage drive keeps the duty of the original
    twin: Any = replace(rig, substep=substep)
    twin.parameters[:] = rig.parameters
    return simulate(pulses, twin, settle=settle, begin=begin).verdict
