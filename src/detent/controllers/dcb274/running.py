"""A program that runs: fetch, wait if need be, execute; loops, waits, the trip routine, the end.

Every wait is a `Stage` with its deadline, or with a condition that `poll` looks at again after each event.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from detent.controllers.dcb274 import commands
from detent.controllers.dcb274.commands import BRANCH, ROWS, Instruction, Op
from detent.controllers.dcb274.program import BRANCHES
from detent.controllers.dcb274.work import Work
from detent.controllers.device import Executing, Output
from detent.ticks import MS, NEVER, Ns, instants


class Stage(Enum):
    """Where the program is with its instruction."""

    IDLE = "no program"
    FETCH = "fetching"  # until `timer`
    HELD = "waiting for the completion of the action before"
    EXECUTE = "executing"  # until `timer`
    MOTION = "W: waiting for the motion"
    WAIT = "W: waiting for its time"  # until `timer`
    PORT = "L 2048: waiting for a port"
    PRINT = "printing"  # until `timer`
    LAST = "waiting for the last motion"


_WAITS = (Stage.HELD, Stage.MOTION, Stage.WAIT, Stage.PORT, Stage.LAST)


@dataclass(slots=True)
class _Saved:
    """Where the program was when it called the trip routine."""

    INSTANTS = instants(timer=0)
    stage: Stage
    address: int
    instruction: Instruction | None
    timer: Ns


class Running:
    """The program counter of one unit. `timer` says when to call `advance`; call `poll` after everything else.

    `say` prints a line of output, and returns when the line is free again.
    """

    INSTANTS = instants(timer=0)

    def __init__(self, work: Work, out: list[Output], say: Callable[[str, Ns], Ns]) -> None:
        self._work, self._out, self._say = work, out, say
        self.reset()

    def reset(self) -> None:
        """No program."""
        self.stage = Stage.IDLE
        self.timer: Ns = NEVER
        self.address = 0
        self.trace = False
        self._instruction: Instruction | None = None
        self._left: int | None = None  # rounds that the jump counter still has; None: idle
        self._saved: _Saved | None = None  # in the trip routine
        self._called = 0  # the vector of a trip that waits: for the end of an instruction, or of the trip routine
        self._stopping = False  # a soft stop was asked for

    @property
    def active(self) -> bool:
        """Whether a program runs, its last motion included."""
        return self.stage is not Stage.IDLE

    @property
    def left(self) -> int | None:
        """Rounds that the jump counter of J still has; None when it is idle."""
        return self._left

    def go(self, address: int, trace: bool, now: Ns) -> None:
        """G: start at an address, or by the ports."""
        self.reset()
        self.trace = trace
        self.address = self._branch(address)
        self._fetch(now)

    def soft_stop(self, now: Ns) -> None:
        """@ or the soft stop input: decelerate, then the program is over.

        Where an M waits for the ramp of the M before it, that ramp is completed first (page 28).
        """
        if self._speeds_pending:
            self._work.motion.soft_stop_after_ramp(now)
        else:
            self._work.motion.soft_stop(now)
        self.stage, self.timer = Stage.LAST, NEVER
        self._stopping, self._saved, self._called = True, None, 0

    @property
    def _speeds_pending(self) -> bool:
        """Whether an M is held; also while a trip routine is served in that wait."""
        held = self if self._saved is None else self._saved
        instruction = self._instruction if self._saved is None else self._saved.instruction
        return held.stage is Stage.HELD and instruction is not None and instruction.op is Op.VELOCITY

    def trip(self, vector: int, now: Ns) -> None:
        """The trip position is reached: call the routine, between two instructions or in a wait (page 49).

        While an instruction is fetched or executed that is when it is done, or begins to wait; while the routine
        runs, when that has returned ("the new trip cannot be triggered until the end of the first trip routine").
        """
        if self.active and not self._stopping:
            self._called = vector
            if self.stage in _WAITS:
                self._serve(now)

    def advance(self, at: Ns) -> None:
        """Deal with the deadline `at`."""
        self.timer = NEVER
        match self.stage:
            case Stage.FETCH:
                self._fetched(at)
            case Stage.EXECUTE:
                self._execute(at)
            case Stage.WAIT:
                self._next(at)
            case Stage.PRINT:
                self._go_on(at)

    def poll(self, now: Ns) -> None:
        """Look whether what the program waits for has come."""
        motion = self._work.motion
        match self.stage:
            case Stage.HELD:
                assert self._instruction is not None
                if self._ready(self._instruction, now):
                    self._begin(now)
            case Stage.MOTION:
                if not motion.indexing:
                    assert self._instruction is not None
                    self.stage, self.timer = Stage.WAIT, now + 10 * MS * self._instruction.values[0]
            case Stage.PORT:
                if self._port_met():
                    self._next(now)
            case Stage.LAST:
                if motion.at_rest or not (self._stopping or motion.completing(now)):
                    self.reset()

    # -- inside ------------------------------------------------------------------------------------------

    def _fetch(self, now: Ns) -> None:
        """Fetch what stands at the program counter; what is no instruction ends the program."""
        self.stage = Stage.FETCH
        self._instruction = self._work.memory.instruction(self.address)
        length = ROWS[self._instruction.op].length if self._instruction is not None else 1
        self.timer = now + max(self._work.fetching(self.address, length), 0)
        if self._instruction is None:
            # an end takes time as well: a program that is nothing but one may be started for ever
            self.timer = max(self.timer, now + self._work.time(_NOTHING))

    def _fetched(self, now: Ns) -> None:
        instruction = self._instruction
        if instruction is None:
            self._end(now)
            return
        text = commands.spell(instruction)
        self._out.append(Executing(now, self.address, text))
        printed = self._say(f"{self.address} {text}", now) if self.trace else now
        if self._ready(instruction, now):
            self._begin(printed)
        else:
            self._wait(Stage.HELD, now)

    def _ready(self, instruction: Instruction, now: Ns) -> bool:
        """As for typed commands; and O behind F waits for home, as the program on page 47 has it."""
        if instruction.op is Op.ORIGIN and self._work.motion.homing:
            return False
        return self._work.ready(instruction, now)

    def _begin(self, now: Ns) -> None:
        assert self._instruction is not None
        self.stage, self.timer = Stage.EXECUTE, now + self._work.time(self._instruction)

    def _execute(self, now: Ns) -> None:
        """The execution time is over: act."""
        instruction = self._instruction
        assert instruction is not None
        work, values = self._work, instruction.values
        match instruction.op:
            case Op.WAIT:
                self._wait(Stage.MOTION, now)
            case Op.GO:
                self.trace = bool(values[1])
                self._left = None
                self._jump(self._branch(values[0]), now)
            case Op.JUMP:
                self._left = values[1] if self._left is None else self._left
                if self._left:
                    self._left -= 1
                    self._jump(values[0], now)
                else:
                    self._left = None
                    self._next(now)
            case Op.LOOP_ON_PORT:
                if self._port_met():
                    self._next(now)
                elif values[0] == BRANCH:
                    self._wait(Stage.PORT, now)
                else:
                    self._jump(values[0], now, fetched=values[0] == self.address)
            case Op.NEXT_TRIP | Op.RESTART_TRIP:
                work.trip.special(instruction, _FIRST_SPECIAL, now)
                self._next(now)
            case Op.TERMINATE:
                if values[0] in (0, work.settings.name):
                    work.motion.halt(now)
                    self.reset()
                else:
                    self._next(now)
            case _:
                self._result(instruction, now)

    def _result(self, instruction: Instruction, now: Ns) -> None:
        try:
            text = self._work.obey(instruction, now, named=False)
        except commands.Refusal:
            text = "#"
        self._next(now, self._say(text, now) if text else now)

    def _jump(self, address: int, now: Ns, *, fetched: bool = False) -> None:
        self.address = address
        self._go_on(now, fetched=fetched)

    def _next(self, now: Ns, printed: Ns = 0) -> None:
        """On to the instruction behind this one, when what it prints has been `printed`."""
        assert self._instruction is not None
        self.address += ROWS[self._instruction.op].length
        if printed > now:
            self.stage, self.timer = Stage.PRINT, printed
        else:
            self._go_on(now)

    def _go_on(self, now: Ns, *, fetched: bool = False) -> None:
        """Between two instructions: a trip that came meanwhile is served.

        An L that jumps to itself is in hand (`fetched`): it tests every 2 to 3 ms wherever it stands (page 44).
        """
        self.stage, self.timer = Stage.FETCH, NEVER
        if self._serve(now):
            return
        if fetched:
            self._fetched(now)
        else:
            self._fetch(now)

    def _wait(self, stage: Stage, now: Ns) -> None:
        """A wait begins: a trip that came meanwhile is served."""
        self.stage = stage
        if not self._serve(now):
            self.poll(now)

    def _serve(self, now: Ns) -> bool:
        """Call the trip routine, if a trip waits for that and the routine does not run already."""
        if not self._called or self._saved is not None:
            return False
        self._saved = _Saved(self.stage, self.address, self._instruction, self.timer)
        self.address, self._called = self._called, 0
        self._fetch(now)
        return True

    def _end(self, now: Ns) -> None:
        """FFh: back from the trip routine, or the end of the program."""
        saved, self._saved = self._saved, None
        if saved is None:
            self._wait(Stage.LAST, now)
            return
        self.stage, self.address = saved.stage, saved.address
        self._instruction, self.timer = saved.instruction, saved.timer
        if self._serve(now):
            return
        if self.stage is Stage.FETCH:
            self._fetch(now)
            return
        if self.stage is Stage.WAIT:
            self.timer = max(self.timer, now)
        self.poll(now)

    def _port_met(self) -> bool:
        """Whether the condition of L is met: 2 (port - 1) for low, that is active, 1 more for high."""
        assert self._instruction is not None
        condition = self._instruction.values[1]
        return self._work.ports.port(condition // 2 + 1) is (condition % 2 == 0)

    def _branch(self, address: int) -> int:
        return BRANCHES[self._work.ports.ports()] if address == BRANCH else address


_NOTHING = Instruction(Op.RETIRED, (0,))
_FIRST_SPECIAL = 128
