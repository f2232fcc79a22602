"""One move, many motors: the same pulses for motors, loads and supplies that differ a little.

An `Ensemble` is a rig and a row of factors for each variant; it keeps parameters in arrays, so that thousands cost no
more than the numbers they are. `judge` runs all of them to the end, `survives` stops at the first that is lost.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, floor, isfinite, pi
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from detent.motors import chance, engine, gpu, kernel
from detent.motors.excitation import NOTHING, Changes, Sequencer, joined
from detent.motors.motor import MotorError
from detent.motors.move import Pulses, Verdict, chunks_of, extent_of, judged, parts_of
from detent.motors.rotor import Floats, Rig, limit_of, substeps, swing_of
from detent.ticks import Ns

QUANTITIES = ("inertia", "voltage", "torque_constant", "inductance", "resistance", "friction", "damping", "load")
"""What varies: the columns of the factors."""
UNMET = 1 << 40
"""The number of the first draw of a seed that no search asks: those that it asked prove nothing of what it found."""
KEPT_PULSES = 1 << 22  # a train of fewer is turned into changes once, for all variants
PIECE = 20_000_000  # substeps of lanes, some tenths of a second: while a kernel runs no signal is heard
BLOCK = 200_000_000  # of what is not divided further, with work for many processors
FIRST_BLOCK = 64  # lanes that `survives` looks at first
Bools = npt.NDArray[np.bool_]


class Spread(NamedTuple):
    """The least and the greatest factor of each quantity; what has no width does not vary."""

    inertia: tuple[float, float] = (0.8, 1.2)
    voltage: tuple[float, float] = (0.9, 1.1)
    torque_constant: tuple[float, float] = (0.9, 1.1)
    inductance: tuple[float, float] = (0.85, 1.15)
    resistance: tuple[float, float] = (0.9, 1.15)
    friction: tuple[float, float] = (0.3, 2.0)
    damping: tuple[float, float] = (0.5, 2.0)
    load: tuple[float, float] = (1.0, 1.0)

    def changed(self, parts: Mapping[str, float | tuple[float, float]]) -> "Spread":
        """With other ranges: a pair of factors, or a part (0.2 is 0.8 to 1.2). MotorError for what is none."""
        found = {}
        for name, given in parts.items():
            if name not in QUANTITIES:
                raise MotorError(f"no variation of {name!r}; there are: {', '.join(QUANTITIES)}")
            low, high = given if isinstance(given, tuple) else (1 - given, 1 + given)
            if not (isfinite(low) and isfinite(high) and 0 <= low <= high <= 10) or (low == 0 and name in _POSITIVE):
                raise MotorError(
                    f"variation of {name}: {given!r}: give a part below 1, like 0.2 for 20 percent either way, or two "
                    "factors, the lesser first, at most 10"
                )
            found[name] = (float(low), float(high))
        return self._replace(**found)

    def of(self, rig: Rig) -> "Spread":
        """Without what has nothing to vary in this rig (its friction is 0)."""
        load, motor = rig.load, rig.motor
        nothing = {
            "friction": not (load.friction or load.viscous or motor.viscous),
            "damping": not rig.parameters[kernel.DAMPING],
            "load": load.is_steady and not load.torque,
        }
        return self._replace(**{name: (1.0, 1.0) for name, is_so in nothing.items() if is_so})


_POSITIVE = ("inertia", "voltage", "torque_constant", "inductance", "resistance")
SPREAD = Spread()


def corners(spread: Spread) -> Floats:
    """Factors of every corner: a row each, a column a quantity. 7 ranges have 128."""
    return chance.corners(spread)


def draws(spread: Spread, count: int, *, seed: int = 1, first: int = 0) -> Floats:
    """Factors drawn evenly and independently from the ranges: rows `first`, `first` + 1, ... of the draws of `seed`."""
    low, high = np.array(spread).T
    found: Floats = low + (high - low) * chance.uniform(seed, count, len(QUANTITIES), first)
    return found


class Outcomes(NamedTuple):
    """What became of a move, variant by variant."""

    lost: Bools
    worst: Floats  # the largest load angle, el. rad
    worst_pulses: npt.NDArray[np.int64]
    lost_pulses: npt.NDArray[np.int64]  # -1: never beyond 360 degrees
    deltas: Floats  # command less rotor in the end, rad
    swings: Floats  # amplitude left in the end, rad

    @property
    def load_angles(self) -> Floats:
        """The largest, el. degrees."""
        return np.degrees(self.worst)

    def verdict(self, k: int) -> Verdict:
        """That of variant k."""
        return judged(float(self.deltas[k]), float(self.worst[k]), int(self.worst_pulses[k]),
                      int(self.lost_pulses[k]), float(self.swings[k]))  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Ensemble:
    """A rig in variants. `factors` has a row for each, with a column for each of `QUANTITIES`."""

    rig: Rig
    factors: Floats
    parameters: Floats = field(init=False)  # a column each, as `kernel` has them

    def __post_init__(self) -> None:
        factors = np.atleast_2d(np.asarray(self.factors, np.float64))
        if factors.ndim != 2 or factors.shape[1] != len(QUANTITIES) or not np.isfinite(factors).all():
            raise MotorError(f"factors: a row for each variant, of {len(QUANTITIES)} finite numbers each")
        if (factors < 0).any() or (factors[:, :5] <= 0).any():
            raise MotorError("factors: inertia, voltage, torque constant, inductance and resistance are above 0")
        inertia, voltage, torque_constant, inductance, resistance, friction, damping, load = factors.T
        rig = self.rig
        par = np.repeat(rig.parameters[:, None], len(factors), axis=1)
        wires = rig.drive.resistance
        par[kernel.J] *= inertia
        par[kernel.VOLTS] *= voltage
        par[kernel.GAIN] *= voltage  # pulse width without feedback: the duty stays, whatever the winding has become
        par[kernel.KT] *= torque_constant
        par[kernel.L] *= inductance
        par[kernel.R] = (par[kernel.R] - wires) * resistance + wires
        par[kernel.B] *= friction
        par[kernel.TC] *= friction
        par[kernel.DAMPING] *= damping
        par[kernel.TL] *= load
        object.__setattr__(self, "factors", factors)
        object.__setattr__(self, "parameters", par)

    def __len__(self) -> int:
        return len(self.factors)

    def of(self, which: Any) -> "Ensemble":
        """Some of them: indices, a slice, or a mask."""
        return Ensemble(self.rig, self.factors[which])

    def and_(self, factors: Floats) -> "Ensemble":
        """With more of them behind."""
        return Ensemble(self.rig, np.concatenate((self.factors, np.atleast_2d(factors))))

    def rig_of(self, k: int) -> Rig:
        """Variant k alone, to be looked at."""
        return changed(self.rig, **dict(zip(QUANTITIES, map(float, self.factors[k]), strict=True)))

    def judge(self, pulses: Pulses, *, settle: Ns | None = None, begin: Ns = 0) -> Outcomes:
        """What becomes of the move in each variant, `settle` (that of the rig) after its last pulse."""
        return _outcomes(_Move(self.rig, pulses, settle, begin), self.parameters, self._lanes(), self.substep)

    def survives(self, pulses: Pulses, *, settle: Ns | None = None, begin: Ns = 0) -> int | None:
        """None if no variant loses a step; else the index of one that does, found as early as may be.

        The first variants are looked at first: put those in front that lost other moves.
        """
        move, substep, first, block = _Move(self.rig, pulses, settle, begin), self.substep, 0, FIRST_BLOCK
        lanes = self._lanes()
        each = substeps(move.until - move.begin, move.count, substep)
        while first < len(self):
            some = slice(first, first + block)
            found = _outcomes(move, self.parameters[:, some], lanes[some], substep, halt=True)
            if found.lost.any():
                return first + int(np.argmax(found.lost))
            first, block = first + block, 2 * block
            if not gpu.chosen(block):
                block = max(min(block, BLOCK // each // FIRST_BLOCK * FIRST_BLOCK), FIRST_BLOCK)
        return None

    def _lanes(self) -> Floats:
        """The factor on the load's torque where it is not steady."""
        return self.factors[:, QUANTITIES.index("load")]

    @property
    def substep(self) -> Ns:
        """The substep with which all of them are judged."""
        par = self.parameters
        limits = limit_of(par[kernel.R], par[kernel.L], par[kernel.J], par[kernel.TEETH], par[kernel.KT],
                          self.rig.motor.current)  # fmt: skip
        return min(self.rig.substep, max(floor(float(limits.min()) * 1e9), 1))


class LossRate(NamedTuple):
    """How many of the variants lose a step: of all corners of the spread, and of fresh draws with their bound."""

    lost: int
    tried: int
    corners_lost: int
    corners: int
    seed: int
    looks: int = 1

    @property
    def bound(self) -> float:
        """The rate is below this, with 95 % confidence."""
        return chance.bound(self.lost, self.tried, looks=self.looks)

    def __str__(self) -> str:
        looks = "" if self.looks == 1 else f", {self.looks} looks counted"
        return (
            f"lost by {self.lost} of {self.tried} variants (below {percent(self.bound)} at 95 % confidence{looks}) and "
            f"by {self.corners_lost} of {self.corners} corners"
        )


def percent(part: float) -> str:
    """A bound in words, rounded up to two digits: 0.0015 is 0.15 %."""
    value = part * 100
    if value >= 10:
        return f"{min(np.ceil(value), 100):.0f} %"
    scale = 10.0 ** (1 - floor(np.log10(value))) if value > 0 else 1.0
    return f"{np.ceil(value * scale - 1e-9) / scale:g} %"


def loss_rate(
    pulses: Pulses, rig: Rig, *, spread: Spread = SPREAD, tried: int = 512, seed: int = 1, settle: Ns | None = None,
    first: int = UNMET, looks: int = 1,
) -> LossRate:  # fmt: skip
    """How often the move is lost by variants of the rig: `tried` draws from `first` on, and all corners."""
    spread = spread.of(rig)
    at_corners, drawn = corners(spread), draws(spread, tried, seed=seed, first=first)
    lost = Ensemble(rig, np.concatenate((at_corners, drawn))).judge(pulses, settle=settle).lost
    of_corners, of_draws = int(lost[: len(at_corners)].sum()), int(lost[len(at_corners) :].sum())
    return LossRate(of_draws, tried, of_corners, len(at_corners), seed, looks)


def changed(rig: Rig, **factors: float) -> Rig:
    """The rig with some of its numbers multiplied.

    `inertia` (rotor and load), `friction` (all of it), `voltage`, `torque_constant`, `inductance`, `resistance`,
    `damping`, `load` (its torque). MotorError for another name.
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
            case "damping":
                pass  # the torque itself, below
            case "load":
                load = load.pulled(factor)
            case _:
                raise MotorError(f"no variant of {name!r}; there are: {', '.join(QUANTITIES)}")
    made = Rig(motor, drive, load, rig.substep, damping=rig.damping)
    # pulse width without feedback: the duty stays, whatever the winding has become
    made.parameters[kernel.GAIN] = rig.parameters[kernel.GAIN] * factors.get("voltage", 1.0)
    made.parameters[kernel.DAMPING] = rig.parameters[kernel.DAMPING] * factors.get("damping", 1.0)
    return made


def judge(pulses: Pulses, rigs: Sequence[Rig], *, settle: Ns | None = None, begin: Ns = 0) -> list[Verdict]:
    """A verdict for each rig, all given the same pulses.

    The rigs have the same stepping, decay and profile of the load, and step as finely as the finest of them needs.
    MotorError otherwise.
    """
    if not rigs:
        return []
    first = rigs[0]
    for rig in rigs:
        if _shared(rig) != _shared(first):
            raise MotorError(
                "variants share one pulse train: stepping, decay, current profile and how the load changes must be the "
                "same"
            )
    par = np.array([rig.parameters for rig in rigs]).T
    substep = min(rig.substep for rig in rigs)
    settle = max(rig.settle for rig in rigs) if settle is None else settle
    found = _outcomes(_Move(first, pulses, settle, begin), par, np.ones(len(rigs)), substep)
    return [found.verdict(k) for k in range(len(rigs))]


def _shared(rig: Rig) -> tuple[Any, ...]:
    drive, load = rig.drive, rig.load
    profile = None if load.is_steady else (load.torque_by_time, load.torque_by_position)
    assert rig.damping is not None
    return (drive.winding, drive.decay, drive.decay_threshold, drive.currents, drive.fall, drive.interpolation,
            rig.motor.steps, rig.damping.roll_off, profile)  # fmt: skip


# -- one pulse train for many ---------------------------------------------------------------------------------


class _Move:
    """The changes of a pulse train for the drive of a rig; made once where it is short enough to be kept."""

    def __init__(self, rig: Rig, pulses: Pulses, settle: Ns | None, begin: Ns) -> None:
        self.rig, self.begin = rig, begin
        self.parts = parts_of(pulses)
        self.count, ends = extent_of(self.parts, begin)
        self.until = ends + (rig.settle if settle is None else settle)
        self.start = Sequencer(rig.drive)
        self._kept = list(self._made()) if self.count <= KEPT_PULSES else None

    def changes(self) -> Iterable[tuple[Changes, Ns]]:
        """The changes, and until when each lot goes."""
        return self._kept if self._kept is not None else self._made()

    def _made(self) -> Iterator[tuple[Changes, Ns]]:
        sequencer = Sequencer(self.rig.drive)
        for times, direction in chunks_of(self.parts):
            copy = times.copy() if self.count <= KEPT_PULSES else times
            yield sequencer.pulses(copy, direction), int(times[-1])
        yield joined(sequencer.up_to(self.until)), self.until


def _outcomes(move: _Move, par: Floats, loads: Floats, substep: Ns, *, halt: bool = False) -> Outcomes:
    """The variants whose parameters are the columns of `par`; see `Ensemble`."""
    count = par.shape[1]
    engine.check_size(
        substeps(move.until - move.begin, move.count, substep) * count, f"{count} moves of {move.count} pulses"
    )
    rig, start = move.rig, move.start
    place, level = start.place, start.level
    rest = _rest(rig, par, loads, place, level)
    there = _on_gpu_if_chosen(move, par, rest, loads, substep, halt)
    if there is not None:
        state, place = there
    elif rig.load.is_steady and engine.fast():
        state, place = _abreast(move, par, rest, substep, halt)
    else:
        state, place = _one_by_one(move, par, rest, loads, substep, halt)
    deltas = rig.drive.winding.angle(place) - state[0]
    if not np.isfinite(state).all():
        raise MotorError("a rotor runs away: a load that nothing holds; check torque and inertia of the load")
    worst, lost_pulses = state[5], state[7].astype(np.int64)
    lost = worst > kernel.TWO_PI
    if not (halt and lost.any()):  # else nobody has come to the end
        lost |= np.round(deltas / (2 * pi)) != 0
    swings = swing_of(state[1], state[4], par, rig.drive.current)
    return Outcomes(lost, worst, state[6].astype(np.int64), lost_pulses, deltas, swings)


def _rest(rig: Rig, par: Floats, loads: Floats, place: int, level: float) -> Floats:
    """Rows x, w, ia, ib, acc: each stands still under its load, at the edge of its torque if that is too much."""
    winding = rig.drive.winding
    at = place % len(winding)
    ia, ib = (par[kernel.AMPS] * level * table[at] for table in (winding.a, winding.b))
    field_angle = atan2(winding.b[at], winding.a[at])
    angle = winding.angle(place)
    angle += (field_angle - angle + pi) % (2 * pi) - pi
    most = par[kernel.KT] * np.hypot(ia, ib)
    torque = par[kernel.TL] if rig.load.is_steady else rig.load.at_rest() * loads
    pull = np.maximum(np.abs(torque) - par[kernel.TC], 0.0)
    part = np.clip(np.divide(pull, most, out=np.zeros_like(pull), where=most > 0), 0.0, 1.0)
    none = np.zeros_like(pull)
    return np.array([angle - np.arcsin(part) * np.sign(torque), none, ia, ib, none])


def pieces(lots: Iterable[tuple[Changes, Ns]], begin: Ns, substep: Ns, most: int) -> Iterator[tuple[Changes, Ns]]:
    """The same changes in pieces of at most `most` substeps, each with its end.

    They end at a change, or at a whole substep behind the last. So the substeps are the same (decision 9).
    """
    now, limit = begin, most * substep
    for changes, until in lots:
        done = 0
        while until - now > limit or len(changes) - done > most:
            end = min(int(np.searchsorted(changes.times, now + limit, "right")), done + most)
            if end > done:
                end = int(np.searchsorted(changes.times, changes.times[end - 1], "right"))  # those of one instant
                now = int(changes.times[end - 1])
                yield changes.between(done, end), now
                done = end
            else:
                now += limit
                yield NOTHING, now
        yield changes.between(done, len(changes)), until
        now = until


def _abreast(move: _Move, par: Floats, rest: Floats, substep: Ns, halt: bool) -> tuple[Floats, int]:
    from detent.motors import lockstep

    rig, start, count = move.rig, move.start, par.shape[1]
    lanes = -(-count // lockstep.LANES) * lockstep.LANES
    filled = np.minimum(np.arange(lanes), count - 1)  # the last ones fill up
    par, state = np.ascontiguousarray(par[:, filled]), np.zeros((lockstep.ROWS, lanes))
    state[: len(rest)] = rest[:, filled]
    state[lockstep.LOST_PULSE] = lockstep.NEVER_LOST
    place, level, mode, pulse, now = start.place, start.level, start.mode, 0, move.begin
    pulsed, gap, previous = move.begin - kernel.LONG_AGO, kernel.LONG_AGO, place
    most = 1 << 62 if halt else max(PIECE // lanes, 1)  # halted, which of them are lost by then hangs on the lots
    for changes, until in pieces(move.changes(), move.begin, substep, most):
        now = int(lockstep.advance_all(
            state, par, now, place, level, 0, mode, pulse, pulsed, gap, previous, *changes, until, rig.table_a,
            rig.table_b, substep, halt,
        ))  # fmt: skip
        if halt and (state[lockstep.LOST_PULSE] < lockstep.NEVER_LOST).any():
            break
        if len(changes):
            before = np.concatenate(([place], changes.places[:-1]))
            moved = np.flatnonzero(changes.places != before)
            if len(moved):
                pulse += len(moved)
                last = int(moved[-1])
                earlier = int(changes.times[moved[-2]]) if len(moved) > 1 else pulsed
                pulsed, previous = int(changes.times[last]), int(before[last])
                gap = pulsed - earlier
            place, level, mode = int(changes.places[-1]), float(changes.levels[-1]), int(changes.modes[-1])
    state = state[:, :count]
    state[lockstep.LOST_PULSE] = np.where(state[lockstep.LOST_PULSE] < lockstep.NEVER_LOST,
                                          state[lockstep.LOST_PULSE], -1.0)  # fmt: skip
    return state, place


def _one_by_one(move: _Move, par: Floats, rest: Floats, loads: Floats, substep: Ns, halt: bool) -> tuple[Floats, int]:
    """The scalar kernel: for loads that change with time or place, and without numba."""
    rig, start = move.rig, move.start
    found = np.zeros((8, par.shape[1]))
    found[7] = -1
    place, advance = start.place, engine.advance()
    for k in range(par.shape[1]):
        s, n = np.zeros(kernel.FLOATS), np.zeros(kernel.INTEGERS, np.int64)
        s[: len(rest)], s[kernel.LEVEL] = rest[:, k], start.level
        n[kernel.NOW], n[kernel.PLACE], n[kernel.MODE], n[kernel.LOST_PULSE] = move.begin, start.place, start.mode, -1
        n[kernel.PULSED], n[kernel.GAP] = move.begin - kernel.LONG_AGO, kernel.LONG_AGO
        n[kernel.FROM] = start.place
        by_time, by_position = rig.by_time * loads[k], rig.by_position * loads[k]
        for changes, until in pieces(move.changes(), move.begin, substep, PIECE):
            code = advance(s, n, *changes, until, rig.table_a, rig.table_b, par[:, k], by_time, by_position,
                           -np.inf, np.inf, _NO_TRACE, substep)  # fmt: skip
            if code == kernel.BROKEN:
                raise MotorError("a rotor runs away: a load that nothing holds; check torque and inertia of the load")
        found[:, k] = (*s[: kernel.LEVEL], s[kernel.WORST], n[kernel.WORST_PULSE], n[kernel.LOST_PULSE])
        place = int(n[kernel.PLACE])
        if halt and found[7, k] >= 0:
            break
    return found, place


def _on_gpu_if_chosen(
    move: _Move, par: Floats, rest: Floats, loads: Floats, substep: Ns, halt: bool
) -> tuple[Floats, int] | None:
    """What a GPU makes of it; None where a processor shall do it, as the GPU is not wanted, or does not work."""
    if not gpu.chosen(par.shape[1]):
        return None
    try:
        found = _on_gpu(move, par, rest, loads, substep, halt)
    except MotorError:
        raise
    except Exception:  # of a driver: out of memory, a compiler that does not know this GPU
        if gpu.failed():
            return None
        raise
    gpu.worked()
    return found


def _on_gpu(move: _Move, par: Floats, rest: Floats, loads: Floats, substep: Ns, halt: bool) -> tuple[Floats, int]:
    """The scalar kernel, a thread for each variant."""
    from detent.motors.gpu_threads import Threads

    rig, start, count = move.rig, move.start, par.shape[1]
    s, n = np.zeros((count, kernel.FLOATS)), np.zeros((count, kernel.INTEGERS), np.int64)
    s[:, : len(rest)], s[:, kernel.LEVEL] = rest.T, start.level
    n[:, kernel.NOW], n[:, kernel.PLACE], n[:, kernel.MODE] = move.begin, start.place, start.mode
    n[:, kernel.PULSED], n[:, kernel.GAP] = move.begin - kernel.LONG_AGO, kernel.LONG_AGO
    n[:, kernel.FROM], n[:, kernel.LOST_PULSE] = start.place, -1
    by_time, by_position = (loads[:, None] * profile for profile in (rig.by_time, rig.by_position))
    threads = Threads(s, n, par.T, by_time, by_position, (rig.table_a, rig.table_b))
    for changes, until in move.changes():
        threads.advance(changes, until, substep)
        if halt and (threads.state()[1][:, kernel.LOST_PULSE] >= 0).any():
            break
    s, n = threads.state()
    found = np.vstack((s[:, : kernel.LEVEL].T, s[:, kernel.WORST], n[:, kernel.WORST_PULSE], n[:, kernel.LOST_PULSE]))
    return found, int(n[0, kernel.PLACE])


_NO_TRACE = np.zeros((0, kernel.COLUMNS))
