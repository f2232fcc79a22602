"""What instructions do, whether they were typed or stand in a program.

What only one of the two can do is elsewhere: programs, NV memory and listings in `desk`, jumps, waits and special
trips in `running`.
"""

from collections.abc import Callable
from typing import ClassVar, Final

from detent.controllers.dcb274 import settings
from detent.controllers.dcb274.commands import CLEARING, COMMON, ROWS, Instruction, Op, Refusal
from detent.controllers.dcb274.current import slow_decay
from detent.controllers.dcb274.memory import SIZE, Memory
from detent.controllers.dcb274.motion import Motion, wrapped
from detent.controllers.dcb274.ports import READ_PORTS, Ports
from detent.controllers.dcb274.settings import Settings
from detent.controllers.dcb274.trip import Trip
from detent.ticks import US, Ns

MODEL_NUMBER: Final = 26  # what X answers in party line (page 52)
AT_LEAST: Ns = 10 * US  # an instruction without execution times; no loop takes no time
_INDEXES: Final = (Op.PLUS, Op.MINUS, Op.INDEX_TO, Op.FIND_HOME)
_SETS_OFF: Final = (*_INDEXES, Op.VELOCITY, Op.GO)


_STOP: Final = Instruction(Op.VELOCITY, (0,))


def byte(value: int) -> str:
    """A byte-sized result: right-justified in a field of 4."""
    return f"{value:4}"


def position(value: int) -> str:
    """A position: right-justified in a field of 9."""
    return f"{value:9}"


class Work:
    """The hands of one unit: everything an instruction acts upon."""

    def __init__(
        self, motion: Motion, ports: Ports, memory: Memory, registers: Settings, trip: Trip, *, times: bool
    ) -> None:
        self.motion, self.ports, self.memory, self.settings, self.trip = motion, ports, memory, registers, trip
        self._times = times

    def time(self, instruction: Instruction) -> Ns:
        """How long the instruction executes (page 29)."""
        if not self._times:
            return AT_LEAST
        if instruction.op is Op.CLEAR and instruction.values[0]:
            return CLEARING
        return ROWS[instruction.op].time

    def fetching(self, address: int, length: int) -> Ns:
        """How long it takes to fetch an instruction: 1 ms for each byte in NV memory (page 32)."""
        return 1_000 * US * self.memory.nv_bytes(address, length) if self._times else 0

    def storing(self, address: int, length: int) -> Ns:
        """How long program mode takes for an instruction: a write for each byte in NV memory."""
        if not self._times:
            return AT_LEAST
        return COMMON + ROWS[Op.WRITE_MEMORY].time * self.memory.nv_bytes(address, length)

    def moves(self, instruction: Instruction) -> bool:
        """Whether an instruction sets the axis in motion, or a program going; M 0 stops."""
        return instruction.op in _SETS_OFF and instruction != _STOP

    def ready(self, instruction: Instruction, now: Ns) -> bool:
        """Whether an instruction may execute now.

        An action waits for the completion of the one before (page 27); an index or F after M waits for the ramp to
        rest that this begins.
        """
        if not ROWS[instruction.op].action:
            return True
        if self.motion.completing(now):
            return False
        return instruction.op not in _INDEXES or self.motion.ready_to_index(now)

    def obey(self, instruction: Instruction, now: Ns, *, named: bool) -> str:
        """Do it; return its result, padded as it is printed. `named`: in party line or daisy chain.

        Raises Refusal, and then nothing has changed.
        """
        return self._DO[instruction.op](self, *instruction.values, now=now, named=named)

    # -- motion ------------------------------------------------------------------------------------------

    def _soft_stop(self, *, now: Ns, named: bool) -> str:
        self.motion.soft_stop(now)
        return ""

    def _plus(self, steps: int, *, now: Ns, named: bool) -> str:
        self.motion.index(steps, 1, now)
        return ""

    def _minus(self, steps: int, *, now: Ns, named: bool) -> str:
        self.motion.index(steps, -1, now)
        return ""

    def _index_to(self, target: int, *, now: Ns, named: bool) -> str:
        distance = target - self.motion.position(now)
        self.motion.index(abs(distance), 1 if distance > 0 else -1, now)
        return ""

    def _velocity(self, count: int, *, now: Ns, named: bool) -> str:
        self.motion.velocity(count, now)
        return ""

    def _find_home(self, count: int, direction: int, *, now: Ns, named: bool) -> str:
        self.motion.home(count, 1 if direction else -1, now)
        return ""

    def _origin(self, value: int, *, now: Ns, named: bool) -> str:
        self.motion.set_origin(wrapped(value), now)
        return ""

    def _trip(self, value: int, vector: int, *, now: Ns, named: bool) -> str:
        self.trip.set(value, vector, now)
        return ""

    # -- registers ---------------------------------------------------------------------------------------

    def _jog_speeds(self, slow: int, fast: int, *, now: Ns, named: bool) -> str:
        self.settings.jog = slow, fast
        return ""

    def _decay(self, value: int, *, now: Ns, named: bool) -> str:
        self.settings.decay = value
        return ""

    def _divide(self, value: int, *, now: Ns, named: bool) -> str:
        self.settings.divide = value
        return ""

    def _resolution(self, value: int, *, now: Ns, named: bool) -> str:
        self.settings.resolution = value
        self.motion.reset_phase(now)
        return ""

    def _initial(self, count: int, *, now: Ns, named: bool) -> str:
        self.settings.initial = count
        return ""

    def _slew(self, count: int, *, now: Ns, named: bool) -> str:
        self.settings.slew = count
        return ""

    def _ramp(self, up: int, down: int, *, now: Ns, named: bool) -> str:
        self.settings.ramp = up, down
        return ""

    def _pre_energize(self, value: int, *, now: Ns, named: bool) -> str:
        self.settings.pre_energize = value
        return ""

    def _current(self, hold: int, run: int, *, now: Ns, named: bool) -> str:
        self.settings.current = hold, run
        return ""

    def _options(self, flags: int, *, now: Ns, named: bool) -> str:
        if flags & settings.READ_BACK:
            return byte(self.settings.flags)
        if settings.conflict(flags):
            raise Refusal(f"l {flags}: of the options 2, 4 and 16 only one at a time")
        self.settings.options, self.settings.plc_for_now = flags, False
        self.ports.show(now)
        self.motion.options_changed(now)
        return ""

    def _retired(self, value: int, *, now: Ns, named: bool) -> str:
        return ""

    # -- reading -----------------------------------------------------------------------------------------

    def _port(self, flags: int, *, now: Ns, named: bool) -> str:
        if flags == READ_PORTS:
            return byte(self.ports.ports())
        self.ports.write(flags, now)
        return ""

    def _inputs(self, which: int, *, now: Ns, named: bool) -> str:
        return byte(self.ports.jogs() if which else self.ports.switches())

    def _moving(self, *, now: Ns, named: bool) -> str:
        return byte(self.motion.status)

    def _position(self, continuous: int, *, now: Ns, named: bool) -> str:
        self.settings.readout = continuous
        return position(self.motion.position(now))

    def _examine(self, *, now: Ns, named: bool) -> str:
        if named:
            return byte(MODEL_NUMBER)
        return self.settings.shown(slow_decay(self.motion, self.settings, now))

    def _read_memory(self, address: int, count: int, *, now: Ns, named: bool) -> str:
        count = max(count, 1)
        if address + count > SIZE:
            raise Refusal(f"[: there are no {count} bytes from {address} on")
        return "".join(byte(value) for value in self.memory.nv[address : address + count])

    _DO: ClassVar[dict[Op, Callable[..., str]]] = {
        Op.SOFT_STOP: _soft_stop,
        Op.PLUS: _plus,
        Op.MINUS: _minus,
        Op.INDEX_TO: _index_to,
        Op.VELOCITY: _velocity,
        Op.FIND_HOME: _find_home,
        Op.ORIGIN: _origin,
        Op.TRIP: _trip,
        Op.JOG_SPEEDS: _jog_speeds,
        Op.DECAY: _decay,
        Op.DIVIDE: _divide,
        Op.RESOLUTION: _resolution,
        Op.INITIAL: _initial,
        Op.SLEW: _slew,
        Op.RAMP: _ramp,
        Op.PRE_ENERGIZE: _pre_energize,
        Op.CURRENT: _current,
        Op.OPTIONS: _options,
        Op.RETIRED: _retired,
        Op.PORT: _port,
        Op.READ_INPUTS: _inputs,
        Op.MOVING: _moving,
        Op.POSITION: _position,
        Op.EXAMINE: _examine,
        Op.READ_MEMORY: _read_memory,
    }
