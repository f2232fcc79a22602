"""One motor with its drive and its load, in motion: the state of the equations, and what can be asked of it."""

from dataclasses import dataclass, field
from math import asin, atan2, ceil, floor, hypot, inf, pi, sqrt
from typing import Any

import numpy as np
import numpy.typing as npt

from detent.motors import engine, kernel
from detent.motors.damping import Damping, checked, given, usual
from detent.motors.drive import Drive
from detent.motors.excitation import Changes, Sequencer
from detent.motors.load import NO_LOAD, Load
from detent.motors.motor import Motor, MotorError, Shared
from detent.motors.winding import Winding
from detent.ticks import MS, SECOND, US, Ns

SUBSTEP: Ns = 20 * US
FINE: Ns = 10 * US  # for verdicts that are printed
SETTLE: Ns = 40 * MS
MOST_SWING = 600.0  # s: nothing that a step motor moves swings more slowly
SWINGS = 3  # that a heavy rotor, which swings more slowly, gets to settle

Floats = npt.NDArray[np.float64]


def limit_of(resistance: Any, inductance: Any, inertia: Any, teeth: Any, torque_constant: Any, current: float) -> Any:
    """S: a substep must be short beside the winding's time constant, and beside the rotor's swing; arrays, too."""
    swing = np.sqrt(teeth * torque_constant * sqrt(2) * current / inertia)
    swing = np.maximum(np.maximum(swing, torque_constant / np.sqrt(inertia * inductance)), 1e-9)  # ... and its EMF
    return np.minimum(0.5 * inductance / resistance, 0.1 / swing)


def swing_of(speed: Any, acceleration: Any, par: Any, current: float) -> Any:
    """The amplitude (el. rad) of the small swing that has this speed and acceleration of the shaft; arrays, too."""
    square = par[kernel.TEETH] * par[kernel.KT] * sqrt(2) * current / par[kernel.J]
    return par[kernel.TEETH] * np.hypot(speed / np.sqrt(square), acceleration / square)


@dataclass(frozen=True, slots=True, eq=False)
class Rig(Shared):
    """Motor, drive and load together, as the kernel takes them. MotorError if they do not go together."""

    motor: Motor
    drive: Drive
    load: Load = NO_LOAD
    substep: Ns = SUBSTEP
    sequences: tuple[Winding, ...] = ()  # that can be commanded, all on one grid, which is that of the drive's
    damping: Damping | None = None  # None: the motor's own, or what is usual with this drive; never None once made
    parameters: Floats = field(init=False)
    table_a: Floats = field(init=False)
    table_b: Floats = field(init=False)
    by_time: Floats = field(init=False)
    by_position: Floats = field(init=False)

    @property
    def most_current(self) -> float:
        """Amperes in a phase at standstill and full power: of a drive that only switches, what the resistance lets."""
        if self.drive.decay != "voltage":
            return self.drive.current
        return self.drive.volts / (self.motor.resistance + self.drive.resistance)

    @property
    def settle(self) -> Ns:
        """How long after the last pulse it is looked at: it has come to rest by then, or has left its place for good.

        A rotor that is too fast to be held leaves within a swing; one that swings slowly is still about its place after
        `SETTLE`, whatever becomes of it.
        """
        # a current so small that nothing is held by it has no swing to wait for
        return max(SETTLE, ceil(SWINGS * self._swing(max(self.drive.current, self.motor.current / 10)) * SECOND))

    def _swing(self, current: float) -> float:
        """Seconds of a small swing about a place with one phase on at so many amperes."""
        motor = self.motor
        return 2 * pi * sqrt((motor.rotor + self.load.inertia) / (motor.teeth * motor.torque_constant * current))

    def __post_init__(self) -> None:
        motor, drive, load = self.motor, self.drive, self.load
        drive.check(motor)
        resistance = motor.resistance + drive.resistance
        inertia = motor.rotor + load.inertia
        winding = drive.winding
        # the sheet's torque, not the current's: a motor that gets less swings more slowly
        limit = float(limit_of(resistance, motor.real_inductance, inertia, motor.teeth, motor.torque_constant,
                               motor.current))  # fmt: skip
        if limit < 1e-7:
            raise MotorError(
                f"motor {motor.name}: L / R of {motor.real_inductance / resistance:.2g} s, or the inertia of "
                f"{inertia:.2g} kg m2, is too small to be a motor's: check the units (H, kg m2)"
            )
        swing = self._swing(motor.current)
        if swing > MOST_SWING:
            raise MotorError(
                f"an inertia of {inertia:.3g} kg m2 is too large for {motor.name}, on which it swings once in "
                f"{swing:.3g} s: check the unit (1 g cm2 is 1e-7 kg m2), or give a gear"
            )
        set_ = object.__setattr__
        if self.damping is None:
            own = motor.damping
            set_(self, "damping", usual(drive.decay) if own is None else given(own, "from the motor's data"))
        assert self.damping is not None
        checked(self.damping)
        set_(self, "substep", min(self.substep, floor(limit * 1e9)))
        par = np.zeros(kernel.PARAMETERS)
        par[kernel.R], par[kernel.L] = resistance, motor.real_inductance
        par[kernel.KT], par[kernel.TEETH], par[kernel.J] = motor.torque_constant, motor.teeth, inertia
        par[kernel.B], par[kernel.TC], par[kernel.TL] = motor.viscous + load.viscous, load.friction, load.torque
        par[kernel.TD], par[kernel.VOLTS], par[kernel.AMPS] = motor.detent_torque, drive.volts, drive.current
        par[kernel.PITCH], par[kernel.OFFSET] = winding.pitch, winding.offset
        par[kernel.GAIN] = resistance
        par[kernel.T_START], par[kernel.T_STEP] = load.torque_by_time[:2]
        par[kernel.P_START], par[kernel.P_STEP] = load.torque_by_position[:2]
        par[kernel.P_START] += winding.offset / motor.teeth  # the kernel counts from electrical angle 0
        torque = motor.torque_constant * sqrt(2) * drive.current
        par[kernel.DAMPING] = 2 * self.damping.ratio * sqrt(motor.teeth * torque * motor.rotor)
        par[kernel.ROLL_OFF] = self.damping.roll_off * 2 * pi / motor.steps
        par[kernel.FALL], par[kernel.GLIDE] = drive.fall, float(drive.interpolation)
        if load.is_steady:
            par[kernel.TL] = load.at_rest()
        set_(self, "parameters", par)
        tables = [table.inaccurate(motor.accuracy) for table in self.sequences or (winding,)]
        set_(self, "table_a", np.array([table.a for table in tables]))
        set_(self, "table_b", np.array([table.b for table in tables]))
        set_(self, "by_time", np.array(load.torque_by_time.values))
        set_(self, "by_position", np.array(load.torque_by_position.values))

    def at_rest(self, place: int, level: float, now: Ns = 0) -> tuple[Floats, npt.NDArray[np.int64]]:
        """The state in which the rotor stands still under its load, current flowing.

        MotorError if the load is more than the motor can hold.
        """
        winding, motor = self.drive.winding, self.motor
        at = place % len(winding)
        ia, ib = (self.drive.current * level * table[at] for table in (winding.a, winding.b))
        s, n = np.zeros(kernel.FLOATS), np.zeros(kernel.INTEGERS, np.int64)
        s[kernel.IA], s[kernel.IB], s[kernel.LEVEL] = ia, ib, level
        field_angle = atan2(winding.b[at], winding.a[at])
        angle = winding.angle(place)
        angle += (field_angle - angle + pi) % (2 * pi) - pi  # the table's vector may point elsewhere than its place
        most = motor.torque_constant * hypot(ia, ib)
        torque, friction = self.load.at_rest(), self.load.friction
        pull = max(abs(torque) - friction, 0.0)
        if pull and pull >= most:
            raise MotorError(
                f"a load of {torque:g} Nm is more than the {most:.3g} Nm that {motor.name} holds at rest with "
                f"{self.drive.current * level:.3g} A: lower the load or raise the current"
            )
        s[kernel.X] = angle - (asin(pull / most) * (1 if torque > 0 else -1) if pull else 0.0)
        n[kernel.NOW], n[kernel.PLACE], n[kernel.MODE] = now, place, self.drive.mode
        n[kernel.LOST_PULSE] = -1
        n[kernel.PULSED], n[kernel.GAP], n[kernel.FROM] = now - kernel.LONG_AGO, kernel.LONG_AGO, place
        return s, n


class Rotor:
    """A rig in motion. Copies go on identically."""

    __slots__ = ("n", "parameters", "rig", "s")

    def __init__(self, rig: Rig, sequencer: Sequencer, now: Ns = 0, sample: Ns = 0) -> None:
        self.rig = rig
        self.parameters = rig.parameters.copy()
        self.parameters[kernel.SAMPLE] = sample
        self.s, self.n = rig.at_rest(sequencer.place, sequencer.level, now)

    @property
    def now(self) -> Ns:
        """The time of the state."""
        return int(self.n[kernel.NOW])

    @property
    def angle(self) -> float:
        """Electrical angle, rad."""
        return float(self.s[kernel.X])

    @property
    def steps(self) -> float:
        """Where the rotor is, in places of the winding table."""
        return (self.angle - self.rig.drive.winding.offset) / self.rig.drive.winding.pitch

    @property
    def speed(self) -> float:
        """rad/s of the shaft."""
        return float(self.s[kernel.W])

    def run(
        self, changes: Changes, until: Ns, low: float = -inf, high: float = inf, trace: Floats | None = None
    ) -> int:
        """Go on through these changes to `until`; see `kernel.advance`. MotorError if the equations break."""
        rig = self.rig
        code: int = engine.advance()(
            self.s, self.n, *changes, until, rig.table_a, rig.table_b, self.parameters, rig.by_time, rig.by_position,
            low, high, _NO_TRACE if trace is None else trace, rig.substep,
        )  # fmt: skip
        if code == kernel.BROKEN:
            raise MotorError(
                f"the rotor of {rig.motor.name} runs away at {self.now / 1e9:g} s: no load and nothing that holds it; "
                "check torque and inertia of the load"
            )
        return code

    def __deepcopy__(self, memo: Any) -> "Rotor":
        twin = object.__new__(Rotor)
        twin.rig, twin.parameters, twin.s, twin.n = self.rig, self.parameters, self.s.copy(), self.n.copy()
        return twin


def load_kernel(rig: Rig) -> None:
    """Have the compiled kernel there before it is wanted: its first call takes a while, seconds if nothing is kept.

    A cell that is served has no such time in its first move, when hosts wait for answers.
    """
    if engine.fast() and not _loaded:
        _loaded.append(True)
        sequencer = Sequencer(rig.drive)
        Rotor(rig, sequencer).run(sequencer.up_to(rig.substep), rig.substep)


def substeps(span: Ns, changes: int, substep: Ns) -> int:
    """About how many substeps that takes."""
    return ceil(span / substep) + changes


_loaded: list[bool] = []
_NO_TRACE = np.zeros((0, kernel.COLUMNS))
