"""Trip positions: T with its routine, k and i in real time (pages 41 to 43, 49).

There is one trip position. T gives it a vector, the address of a routine that the running program calls between
instructions; k gives it the special trip counter, at which a k or an i is looked for at the exact step.
"""

from detent.controllers.dcb274.commands import Instruction, Op
from detent.controllers.dcb274.memory import Memory
from detent.controllers.dcb274.motion import Motion
from detent.controllers.dcb274.ports import Ports
from detent.controllers.dcb274.program import SHADOW
from detent.controllers.dcb274.settings import SPECIAL, Settings
from detent.ticks import Ns

_LENGTH = 5  # of k and i


class Trip:
    """The trip of one unit. The registers that S keeps are in `Settings`."""

    def __init__(self, motion: Motion, ports: Ports, memory: Memory, registers: Settings) -> None:
        self._motion, self._ports, self._memory, self._settings = motion, ports, memory, registers
        self.counter = SHADOW.start  # where the special trip looks

    def reset(self, now: Ns) -> None:
        """The trip as the registers have it."""
        self.counter = SHADOW.start
        self._arm(now)

    def set(self, position: int, vector: int, now: Ns) -> None:
        """T: at this position call the routine at `vector`; 0 turns the trip off."""
        self._settings.trip, self._settings.trip_vector = position, vector
        self._arm(now)

    def special(self, instruction: Instruction, counter: int, now: Ns) -> None:
        """Execute k or i: the outputs now, the next position, and the place of the instruction that is to run there."""
        position, data = instruction.values
        if instruction.op is Op.RESTART_TRIP:
            self._motion.set_origin(0, now)
            counter = SHADOW.start
        self._ports.write(data, now)
        self.counter = counter
        self._settings.trip, self._settings.trip_data = position, data
        self._settings.trip_vector = SPECIAL
        self._arm(now)

    def reached(self, now: Ns) -> int:
        """The position is reached. The vector of the routine to be called; 0 if there is none."""
        vector = self._settings.trip_vector
        if vector != SPECIAL:
            return vector
        instruction = self._memory.instruction(self.counter)
        if instruction is not None and instruction.op in (Op.NEXT_TRIP, Op.RESTART_TRIP):
            self.special(instruction, self.counter + _LENGTH, now)
        else:
            self.set(self._settings.trip, 0, now)
        return 0

    def _arm(self, now: Ns) -> None:
        self._motion.set_trip(self._settings.trip if self._settings.trip_vector else None, now)
