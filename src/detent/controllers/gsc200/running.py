"""What runs while the module is busy: a program, a single delayed command, homing.

An instruction acts when the program reaches it, through the method of its `Op`; when it is done, the next is
reached one instruction time later. What it waits for is explicit: `_timer`, a user input, the end of a move.
"""

from collections.abc import Callable
from typing import ClassVar

from detent.controllers.device import Cautioned, Executing, Finished, Output, Stop
from detent.controllers.gsc200.commands import Instruction, Op
from detent.controllers.gsc200.counter import PositionCounter
from detent.controllers.gsc200.flow import Flow
from detent.controllers.gsc200.motion import Course, Motion
from detent.controllers.gsc200.program import Program, Step
from detent.pins import HIGH, LOW, Level, PinDriver
from detent.ticks import MS, NEVER, Ns, instants

TENTH_OF_A_SECOND: Ns = 100 * MS
USER_INPUTS = ("", "UI1", "UI2", "UI3")
USER_OUTPUTS = ("", "UO1", "UO2", "UO3")


class Running:
    """The busy side of one module. `deadline` says when to call `advance`."""

    INSTANTS = instants(timer=0)

    def __init__(
        self,
        motion: Motion,
        counter: PositionCounter,
        pins: PinDriver,
        inputs: dict[str, Level],
        out: list[Output],
        instruction_time: Ns,
    ) -> None:
        self._motion, self._counter, self._pins, self._inputs, self._out = motion, counter, pins, inputs, out
        self._instruction_time = instruction_time
        self.busy = False
        self.error = 0  # kept for the next F
        self.after_homing: Program | None = None  # to be run behind the homing at power-on
        self._program: Program | None = None
        self._flow = Flow()
        self.timer: Ns = NEVER  # when the next instruction is reached
        self._waiting = ""  # the user input that a W waits for, or that ends a velocity move
        self._stopping = False  # Z was given: the program ends with the move
        self._endless = False  # a velocity move, which on the GS-C200 meets the end of the counter

    @property
    def deadline(self) -> Ns:
        """When something happens by itself."""
        timer, motion = self.timer, self._motion.deadline
        return timer if timer < motion else motion

    @property
    def homing(self) -> bool:
        """Whether the axis seeks the end of travel or home."""
        return self._motion.course in (Course.SEEK_EOT, Course.SEEK_HOME)

    @property
    def only_its_timer(self) -> bool:
        """Whether a program runs and waits for nothing but the next instruction, at rest; RESET may be low."""
        return self.timer < NEVER and self._motion.only_reset

    def postpone(self, by: Ns) -> None:
        """The next instruction is reached so much later, and RESET rises so much later."""
        self.timer += by
        self._motion.postpone(by)

    def rounds(self) -> list[tuple[int, int]]:
        """The loops that the program is in, outermost first: the address of the L, and which round it is."""
        return self._flow.rounds() if self.busy else []

    def run(self, program: Program, now: Ns) -> None:
        """Start `program` at its first instruction. An empty one is done at once. An error of the last one is over."""
        self.error = 0
        self._program = program
        self._flow.restart()
        if program.size:
            self._begin(now)
            self._fetch(now)
        else:
            self._end(now)

    def home(self, direction: int, now: Ns) -> bool:
        """H. True if it is done already: both switches were closed, not a step was made. An error of before is over."""
        self.error = 0
        self._motion.home(direction, now)
        if self._motion.at_rest:
            self._homed(now)
            return True
        self._begin(now)
        return False

    def kill(self, now: Ns) -> None:
        """K: pulses and program stop at once."""
        self._motion.halt(now)
        self._end(now)

    def zero(self, now: Ns) -> None:
        """Z: ramp down, then the program ends; without a move it ends at once."""
        if self._motion.course is not Course.MOVE:
            self.kill(now)
            return
        self._stopping = True
        self._motion.decelerate(now)
        if self._motion.at_rest:
            self._moved(now)

    def input_changed(self, pin: str, level: Level, now: Ns) -> bool:
        """An input takes a level. True if that completed a homing."""
        if self._motion.input_changed(pin, level, now):
            self._homed(now)
            return True
        if pin != self._waiting:
            return False
        if self._motion.course is Course.MOVE:
            if level == LOW:
                self._motion.decelerate(now)
                if self._motion.at_rest:
                    self._moved(now)
        elif level == HIGH:
            self._waiting = ""
            self.timer = now + self._instruction_time
        return False

    def cuts(self) -> list[Stop]:
        """What stops the motion at once: the driver's inputs; the input of a velocity move without a ramp."""
        found = self._motion.cuts()
        if found and self._waiting and self._motion.stops_at_once and self._inputs[self._waiting] == HIGH:
            found.append(Stop(self._waiting, LOW))
        return found

    def advance(self, at: Ns) -> None:
        """Deal with the deadline `at`; within one instant pulses come first."""
        if self._motion.deadline <= at:
            if self._motion.advance(at):
                self._moved(at)
        else:
            self.timer = NEVER
            self._fetch(at)

    def initialize(self, which: int, now: Ns) -> None:
        """I1 clears the position counter, I2 the user outputs, I3 both; 1 and 3 reset the driver, too."""
        if which & 1:
            self.error = 0
            self._counter.preset(0, now)
            self._motion.pulse_reset(now)
        if which & 2:
            for pin in USER_OUTPUTS[1:]:
                self._pins.set(pin, LOW, now)

    def user_inputs(self) -> int:
        """UI1, UI2, UI3 with the weights 1, 2, 4."""
        inputs = self._inputs
        return inputs["UI1"] | inputs["UI2"] << 1 | inputs["UI3"] << 2

    def user_outputs(self) -> int:
        """UO1, UO2, UO3 with the weights 1, 2, 4."""
        levels = self._pins.levels
        return levels["UO1"] | levels["UO2"] << 1 | levels["UO3"] << 2

    # -- begin and end -----------------------------------------------------------------------------------

    def _begin(self, now: Ns) -> None:
        self.busy = True
        self._pins.set("RDY", LOW, now)

    def _end(self, now: Ns, error: int = 0) -> None:
        """The program, the move or the homing is over; an error waits for the next F."""
        if self.busy:
            self._out.append(Finished(now))
        self.busy = self._stopping = self._endless = False
        self.error = error or self.error
        self.after_homing = None
        self.timer = NEVER
        self._waiting = ""
        self._pins.set("RDY", HIGH, now)

    def _homed(self, now: Ns) -> None:
        self._counter.preset(0, now)
        program = self.after_homing
        if program is not None:
            self.after_homing = None
            self.run(program, now)
        else:
            self._end(now)

    # -- instructions ------------------------------------------------------------------------------------

    def _fetch(self, now: Ns) -> None:
        """Execute the instruction the program has come to, or end it."""
        flow, program = self._flow, self._program
        assert program is not None
        step = program.at(flow.address)
        if step is not None:
            flow.jumped = False
            self._out.append(Executing(now, step.address, step.text))
            self._DO[step.instruction.op](self, step, now)
        elif flow.jumped:
            self._end(now, error=4)  # into the middle of an instruction, or behind the program
        elif flow.guard and self._inputs[USER_INPUTS[flow.guard]] == HIGH:
            flow.restart()
            self._fetch(now)
        else:
            self._end(now)

    def _go_on(self, step: Step, done: Ns) -> None:
        """The instruction is done at `done`; the next is reached one instruction time later."""
        self._flow.address = step.next
        self.timer = done + self._instruction_time

    def _activate(self, step: Step, now: Ns) -> None:
        self._pins.set(USER_OUTPUTS[step.instruction.value], HIGH, now)
        self._go_on(step, now)

    def _clear(self, step: Step, now: Ns) -> None:
        self._pins.set(USER_OUTPUTS[step.instruction.value], LOW, now)
        self._go_on(step, now)

    def _delay(self, step: Step, now: Ns) -> None:
        self._go_on(step, now + step.instruction.value * TENTH_OF_A_SECOND)

    def _force(self, step: Step, now: Ns) -> None:
        self._counter.preset(step.instruction.value, now)
        self._go_on(step, now)

    def _initialize(self, step: Step, now: Ns) -> None:
        self.initialize(step.instruction.value, now)
        self._go_on(step, now)

    def _start_stop(self, step: Step, now: Ns) -> None:
        self._motion.start_stop = step.instruction.value
        self._go_on(step, now)

    def _top(self, step: Step, now: Ns) -> None:
        self._motion.slew = step.instruction.value
        self._go_on(step, now)

    def _ramp(self, step: Step, now: Ns) -> None:
        self._motion.ramp = step.instruction.value
        self._go_on(step, now)

    def _branch(self, step: Step, now: Ns) -> None:
        self._flow.follow(step, self.user_inputs())
        self.timer = now + self._instruction_time

    def _wait(self, step: Step, now: Ns) -> None:
        pin = USER_INPUTS[step.instruction.value]
        if self._inputs[pin] == HIGH:
            self._go_on(step, now)
        else:
            self._flow.address = step.next
            self._waiting = pin

    def _move(self, step: Step, now: Ns) -> None:
        instruction = step.instruction
        if self._refused(instruction, now):
            return
        distance = instruction.value
        if instruction.op is Op.GOTO:
            distance -= self._counter.read(now)
        if distance:
            if instruction.op is Op.GOTO and self._counter.below(now):
                self._out.append(Cautioned(now, step.text, _below(self._counter.read(now), step.text, distance)))
            self._flow.address = step.next
            self._motion.begin(abs(distance), 1 if distance > 0 else -1, now)
        else:
            self._go_on(step, now)

    def _velocity(self, step: Step, now: Ns) -> None:
        direction = step.instruction.value
        if self._stopped(step.instruction):
            self._go_on(step, now)
        elif not self._refused(step.instruction, now):
            self._flow.address = step.next
            self._waiting = USER_INPUTS[step.instruction.other]
            self._endless = True
            self._motion.begin(self._counter.room(direction, now), direction, now)

    def refuses(self, instruction: Instruction, now: Ns) -> bool:
        """Whether the move would carry the counter off its ruler. Where the input is 0 already there is no move."""
        if instruction.op is Op.VELOCITY and self._stopped(instruction):
            return False
        return self._counter.refuses(instruction, now)

    def _stopped(self, instruction: Instruction) -> bool:
        """Whether the input that ends a velocity move is 0 already."""
        stop = USER_INPUTS[instruction.other]
        return bool(stop) and self._inputs[stop] == LOW

    def _refused(self, instruction: Instruction, now: Ns) -> bool:
        """Whether the move would leave the counter: it takes its time, and the program ends with error 5."""
        if not self.refuses(instruction, now):
            return False
        assert self._program is not None
        self.error = 5
        self._flow.restart()  # no guard starts it again
        self._flow.address = self._program.size
        self.timer = now + self._instruction_time
        return True

    def _moved(self, now: Ns) -> None:
        """A move is over: the next instruction, or the end (Z, or the end of the counter)."""
        at_the_end = self._endless and self._counter.room(self._motion.direction, now) == 0
        self._endless = False
        self._waiting = ""
        if at_the_end:
            self._end(now, error=5)
        elif self._stopping:
            self._end(now)
        else:
            self.timer = now + self._instruction_time

    _DO: ClassVar[dict[Op, Callable[["Running", Step, Ns], None]]] = {
        Op.ACTIVATE: _activate,
        Op.CLEAR: _clear,
        Op.DELAY: _delay,
        Op.FORCE: _force,
        Op.INITIALIZE: _initialize,
        Op.START_STOP: _start_stop,
        Op.TOP: _top,
        Op.RAMP: _ramp,
        Op.LOOP: _branch,
        Op.JUMP: _branch,
        Op.JUMP_IF: _branch,
        Op.UNTIL: _branch,
        Op.WAIT: _wait,
        Op.MOVE: _move,
        Op.GOTO: _move,
        Op.VELOCITY: _velocity,
    }


def _below(position: int, text: str, distance: int) -> str:
    """What is unexpected of a goto where a homing was cut off below 0."""
    way = "plus" if distance > 0 else "minus"
    return (
        f"a homing that was cut off has taken the counter below 0, where it reads {position}: {text} makes "
        f"{abs(distance)} steps in direction {way}; H finds home, I1 clears the counter"
    )
