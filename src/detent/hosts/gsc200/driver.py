"""The driver of a GS-C200 or GS-C200S: the common face over its commands, whole programs, backups.

The module answers only F, Z and K while it is busy, so that its position cannot be asked for on the way.
"""

from collections.abc import Mapping, Sequence
from typing import NoReturn

from detent.hosts.axis import Speeds
from detent.hosts.errors import BadAnswer, Busy, DriverError, MotionFailed, NoAnswer, Refused
from detent.hosts.exchange import Asynchronous, Blocking, Progress, Steps, attempt, operation
from detent.hosts.gsc200 import language
from detent.hosts.gsc200.commands import Commands
from detent.hosts.gsc200.dialogue import LEAVING, TRIES, Again, Feedback


class GsC200(Commands):
    """A GS-C200 or GS-C200S; see `Dialogue` for what it is told when it is made.

    S, T and R cannot be read back. After `run_at` the slew speed of `set_speeds` is set again by the next move.
    """

    def forget(self) -> None:
        """The connection was lost: whatever was agreed on with the module must be agreed on again."""
        super().forget()
        self._top = 0

    fastest = 10 * language.RATES[-1]  # S and T are 10 to 10000 steps/s
    _slew = 0  # tens of steps/s that moves are wanted at; 0: as the module has it
    _top = 0  # tens of steps/s that T was last set to; 0: not known

    # -- the common face ---------------------------------------------------------------------------------

    @operation
    def move_to(self, position: int) -> Steps[None]:
        """Begin a move to `position` and return.

        Raises Refused if a homing that was stopped has taken a GS-C200's counter below 0: it reads just below ten
        million then, and the move would go that far away. `go_to` says it all the same.
        """
        self._position(position)
        self._commanded()
        yield from self.fresh()
        yield from self._above(position)
        yield from self._at_slew()
        yield from self.go_to(position)
        self._target = position

    @operation
    def move_by(self, steps: int) -> Steps[None]:
        """Begin a move by at most 999999 steps and return; by none, nothing is sent."""
        if steps:
            self._commanded()
            target = None
            if abs(steps) in language.MOVES:
                yield from self.fresh()
                yield from self._at_slew()
                here = yield from attempt(self.position())
                if isinstance(here, DriverError) and not isinstance(here, Busy):  # which the move itself is told, too
                    raise here
                target = here + steps if isinstance(here, int) else None
            yield from self.move(steps)
            self._target = target

    @operation
    def run_at(self, rate: float) -> Steps[None]:
        """Run at `rate` steps/s, rounded to tens, until told otherwise. Sets T."""
        tens = _rounded(abs(rate), "a rate to run at")
        if not rate:
            raise ValueError("a rate of 0 is no run: stop() ramps down, halt() stops at once")
        self._commanded()
        yield from self.fresh()
        if tens != self._top:
            yield from self._set_top(tens)
        yield from self.go(1 if rate > 0 else -1)

    @operation
    def stop(self) -> Steps[None]:
        """Ramp down and stand (Z); a program ends. Nothing happens if the axis stands already."""
        yield from self._stopped(self.zero_speed())

    @operation
    def halt(self) -> Steps[None]:
        """Stop at once, without a ramp (K); a program ends."""
        yield from self._stopped(self.kill())

    @operation
    def home(self, direction: int = -1) -> Steps[None]:
        """Begin homing (H): to the end of travel in `direction`, and back to HOME, which is position 0.

        At the start-stop speed. A GS-C200 clears the program in RAM, too.
        """
        if not self.programming:
            yield from self.fresh()
        yield from self.find_home(direction)

    @operation
    def wait(self, timeout: float | None = None) -> Steps[None]:
        """Wait until the module is ready, for `timeout` seconds at most (None: as long as it takes).

        Raises MotionFailed then, for an overflow, if a move ended elsewhere than it should have, and if the module was
        silent on its way to 0 or home: it does not tell that its supply was lost, and begins anew with a counter of 0.
        A stop by another thread ends the wait and is no failure.
        """
        homing = self._homing
        yield from super().wait(timeout)
        target, told = self._target, self._times_told
        if (homing or target == 0) and self._silent:
            self._target, self._silent = None, False
            raise MotionFailed(
                self.title,
                "was silent for a while on its way: if its supply was lost it has begun anew, calls the place where it "
                "stands 0, and has the speeds of power-on: home() and set_speeds() again",
            )
        if target is None:
            return
        try:
            here = yield from self.position()
        except Busy:
            if self._times_told != told:
                return  # with what it was told meanwhile
            raise
        if self._times_told != told:
            return
        self._target = None
        if here != target:
            why = "was it stopped otherwise?"
            if here == 0:
                why = "it was switched off and on, or cleared; then it has the speeds of power-on"
                self.forget()
            raise MotionFailed(self.title, f"stands at {here}, not at {target}: {why}")

    @operation
    def set_position(self, position: int) -> Steps[None]:
        """Call the place where the axis stands `position` (f).

        A GS-C200 can only call it 0 (I1, which resets the power driver, too).
        """
        self._commanded()
        if self.signed:
            yield from self.force(position)
            return
        if position:
            raise ValueError(
                f"the counter of a GS-C200 can only be cleared, not set to {position}: set_position(0), "
                "or home() where there are switches"
            )
        yield from self.initialize(outputs=False)

    @operation
    def set_speeds(self, speeds: Speeds) -> Steps[Speeds]:
        """Make moves so; returned is what the module makes of it: rates in tens, a ramp of 1 to 999 whole steps.

        With v^2 = S^2 + (T^2 - S^2) n/R a ramp of R steps takes 2 R/(S + T) seconds; T not above S has no ramp.
        """
        start = _rounded(max(speeds.start, 0), "a start-stop rate")
        slew = _rounded(speeds.slew, "a slew rate")
        if not speeds.seconds >= 0:
            raise ValueError(f"a ramp takes 0 s or longer, not {speeds.seconds:g} s")
        both = 10 * (start + slew)
        ramp = language.RAMPS[-1]
        if both * speeds.seconds < 2 * ramp:
            ramp = max(round(both * speeds.seconds / 2), language.RAMPS[0])
        self._commanded()
        for command in (f"S{start}", f"T{slew}", f"R{ramp}"):
            self.frames.frame(command)  # one that cannot be sent leaves the others as they were
        yield from self.set_start_stop(10 * start)
        yield from self._set_top(slew)
        yield from self.set_ramp(ramp)
        self._slew = slew
        return Speeds(10 * start, 10 * slew, 2 * ramp / both if slew > start else 0.0)

    def _stopped(self, told: Steps[None]) -> Steps[None]:
        """Say a stop. A module in programming mode, where nothing moves, refuses it (E4); F tells that it stands."""
        try:
            yield from told
        except Refused as error:
            if error.code != "E4" or (yield from self._asked()).busy:
                raise

    @operation
    def set_top(self, rate: int) -> Steps[None]:
        """T: the slew speed, 10 to 10000 steps/s in tens; that of moves, too, from now on."""
        if self.programming:
            yield from super().set_top(rate)
            return
        self._top = 0
        yield from super().set_top(rate)
        self._slew = self._top = rate // 10

    @operation
    def execute(self) -> Steps[None]:
        """E: start the program in RAM at its first instruction; it ends programming mode, too. It may set T."""
        self._top = 0
        yield from super().execute()

    @operation
    def feedback(self) -> Steps[Feedback]:
        """F: whether it is busy; an error that ended a program is told once, whoever started that."""
        begun = self._begun
        told = yield from super().feedback()
        if told.busy and not begun:
            self._top = 0  # a program of somebody else may set T
        return told

    def _above(self, position: int) -> Steps[None]:
        """Raise Refused where a homing that was cut off has taken the counter below 0."""
        if not self._cut:
            return
        here = yield from self.position()
        if here - position > language.POSITIONS[self.model][-1] // 2:
            raise Refused(
                self.title,
                f"homing was stopped on its way below 0, where the counter reads {here}: a move to {position} would "
                f"make {here - position} steps away from it; home() again, or set_position(0) where it stands",
                code="E5",
            )

    def _commanded(self) -> None:
        """Raise Busy in programming mode, where moves and settings would be stored."""
        if self.programming:
            way = "leave_programming() first" if self.signed else LEAVING
            raise Busy(self.title, f"would store it and not obey: {way}")

    def _set_top(self, tens: int) -> Steps[None]:
        self._top = 0
        yield from Commands.set_top(self, 10 * tens)
        self._top = tens

    def _at_slew(self) -> Steps[None]:
        """Have moves made at the slew speed that was asked for, after a run at another."""
        if self._slew and self._top != self._slew:
            yield from self._set_top(self._slew)

    # -- whole programs ----------------------------------------------------------------------------------

    @property
    def left_open(self) -> str:
        """What an operation has left behind that whoever comes next must know; "": nothing."""
        return LEAVING if self.programming and not self.signed else ""

    @operation
    def write_program(self, lines: Sequence[str]) -> Steps[None]:
        """Put a program into RAM, verified by Q; nothing is started and nothing is saved.

        A GS-C200S is in command mode afterwards. A GS-C200 stays in programming mode: only `execute` leads out, and
        starts the program; `save` may come before. Raises ValueError for a line that cannot be stored, before
        anything is sent.
        """
        program = self._sendable(lines)
        stored = yield from self._begin(program)
        for number in range(stored, len(program)):
            yield Progress(number, len(program), "instructions")
            yield from self._store(program, number)
        yield Progress(len(program), len(program), "instructions")
        there = yield from self.read_program()
        if there != program:
            raise BadAnswer(self.title, f"holds another program than was sent: {_listing(there)}")
        if self.signed:
            yield from self.leave_programming()
        elif not program:
            yield from self.execute()  # nothing is there to be started

    def _sendable(self, lines: Sequence[str]) -> list[str]:
        """The lines of a program as Q lists them. ValueError names the line that cannot be stored, or not be sent."""
        program = language.program(self.model, lines)
        for number, text in enumerate(program, 1):
            try:
                self.frames.frame(text)
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
        return program

    def _begin(self, program: list[str]) -> Steps[int]:
        """Enter programming mode; how many instructions of `program` are there already.

        P is refused by a module that is in programming mode: it was left so, or P's answer was lost.
        """
        enter = "Po" if self.signed else "P"
        try:
            yield from self.order(enter, Again.AT_ONCE)
        except Refused as error:
            if error.code != "E4":
                raise
            if self.signed:
                yield from self.leave_programming()
                yield from self.order(enter, Again.NEVER)
            else:
                there = yield from self.read_program()
                if there != program[: len(there)]:
                    text = f"{LEAVING}. It holds {_listing(there)}"
                    raise Refused(self.title, text, error.spoken, error.code) from error
                self.programming = True
                return len(there)
        return 0

    def _store(self, program: list[str], number: int) -> Steps[None]:
        """Store one instruction. Where it is not known whether it was stored, the list is asked for (Q)."""
        for left in reversed(range(TRIES)):
            try:
                yield from self.order(program[number], Again.NEVER)
                return
            except (NoAnswer, BadAnswer):
                there = yield from self.read_program()
                if there == program[: number + 1]:
                    return
                if not left or there != program[:number]:
                    raise
            except Refused as error:
                raise Refused(self.title, f"line {number + 1}: {error.what}", error.spoken, error.code) from error

    # -- backups -----------------------------------------------------------------------------------------

    @operation
    def saved(self) -> Steps[dict[str, object]]:
        """What can be read of the module: its `model`, and `program`, the instructions of the EEPROM.

        X copies the EEPROM into RAM. A GS-C200S gets its RAM back afterwards, and `ram` is its program where that is
        another. On a GS-C200 that holds a program in RAM this cannot be done without starting it: then `program` is
        that of the RAM, `memory` is ``RAM``, and nothing was changed. S, T and R cannot be read.
        """
        ram = yield from self.read_program()
        kept = yield from self._kept(ram)
        found: dict[str, object] = {"model": self.model, "memory": "EEPROM", "program": kept}
        if kept is None:
            found |= {"memory": "RAM", "program": ram}
        elif ram and ram != kept:
            found["ram"] = ram
        return found

    def _kept(self, ram: list[str]) -> Steps[list[str] | None]:
        """The program of the EEPROM; RAM holds `ram` before and after. None if it could not be given back."""
        if ram and not self.signed:
            return None
        kept = yield from attempt(self._recalled())
        if kept != ram:
            try:
                yield from self.write_program(ram)
            except DriverError as error:
                what = f"{error.what}; its RAM held {_listing(ram)}, and may hold what the EEPROM holds"
                raise DriverError(self.title, what, error.spoken) from error
        if isinstance(kept, DriverError):
            raise kept
        return kept

    def _recalled(self) -> Steps[list[str]]:
        """The program of the EEPROM, which is in RAM, too, afterwards.

        X is refused in programming mode, in which whoever was interrupted may have left the module.
        """
        try:
            yield from self.recall()
        except Refused as error:
            if error.code != "E4":
                raise
            if not self.signed:
                raise Refused(self.title, f"does not obey X now: {LEAVING}", error.spoken, error.code) from error
            yield from self.leave_programming()
            yield from self.recall()
        return (yield from self.read_program())

    @operation
    def restore(self, saved: Mapping[str, object]) -> Steps[list[str]]:
        """Put what `saved` returned back: the program into EEPROM and RAM, a GS-C200S's `ram` into RAM.

        Returned is what was written, in sentences. A GS-C200 stays in programming mode, as after `write_program`, and
        its EEPROM cannot be read back. The EEPROM is written once the whole program is in RAM and verified; if
        anything fails the error says what is where.
        """
        program, ram = self._wanted(saved)
        held = yield from self.read_program()
        # a GS-C200 loses what its RAM holds in any case
        kept = yield from (self._kept(held) if self.signed or not held else self._recalled())
        old = f"The EEPROM held {_listing(kept or [])}"
        if kept == program and ram in (None, held):
            told = ["The EEPROM holds this program already: nothing was written to it."]
            if held not in ([], kept) and ram is None:
                if self.signed:  # it had been given back
                    yield from self._recalled()
                told.append(f"The RAM held {_listing(held)}, and now holds that of the EEPROM.")
            return told
        if kept != program:
            try:
                yield from self.write_program(program)
            except DriverError as error:
                yield from self._unwritten(error, "the EEPROM was not touched", held)
            try:
                yield from self.save()
            except DriverError as error:
                yield from self._unwritten(error, f"the EEPROM may hold neither program. {old}", held)
        if not self.signed:
            return [
                f"The program of {_count(program)} is in RAM, read back and right, and was saved (M: Y).",
                f"{old}, the RAM {_listing(held)}.",
                f"The EEPROM itself cannot be read back now: {LEAVING}.",
            ]
        there = yield from self._recalled()
        if there != program:
            raise BadAnswer(self.title, f"its EEPROM holds {_listing(there)} and not what was saved. {old}")
        told = [f"The EEPROM holds the program of {_count(program)}, read back and right.", f"{old}."]
        if ram is not None:
            yield from self.write_program(ram)
            told.append(f"The RAM holds the other program of {_count(ram)}, read back and right.")
        return told

    def _wanted(self, saved: Mapping[str, object]) -> tuple[list[str], list[str] | None]:
        """The programs for EEPROM and RAM in `saved`. ValueError names the key that is wrong."""
        model = saved.get("model", self.model)
        if model != self.model:
            raise ValueError(f"model: it was saved from a {model}, this is a {self.model}, which has another language")
        programs: list[list[str]] = []
        for key in ("program", "ram"):
            lines = saved.get(key)
            if lines is None and key == "ram":
                return programs[0], None
            if not isinstance(lines, Sequence) or isinstance(lines, str):
                raise ValueError(f"{key}: it must be a list of instructions, one a line")
            try:
                programs.append(self._sendable([str(line) for line in lines]))
            except ValueError as error:
                raise ValueError(f"{key}: {error}") from None
        if not self.signed:
            raise ValueError("ram: a GS-C200 has no way to hold another program in RAM than was saved: leave it out")
        return programs[0], programs[1]

    def _unwritten(self, error: DriverError, eeprom: str, ram: list[str]) -> Steps[NoReturn]:
        """Raise `error` with what is where, after the program in RAM was given back if that can be done."""
        what = f"{error.what}; {eeprom}; "
        if not self.signed:
            what += f"the RAM held {_listing(ram)} and now holds part of the new program: {LEAVING}"
        elif isinstance((yield from attempt(self.write_program(ram))), DriverError):
            what += f"the RAM held {_listing(ram)}, which could not be given back"
        else:
            what += "the RAM holds what it held"
        raise DriverError(self.title, what, error.spoken) from error


def _rounded(rate: float, what: str) -> int:
    """`rate` in tens of steps/s, at least one. ValueError for one that the module does not have."""
    if not 0 <= rate <= 10 * language.RATES[-1]:
        raise ValueError(f"{what} is 10 to {10 * language.RATES[-1]} steps/s, not {rate:g}")
    return max(round(rate / 10), language.RATES[0])


def _count(lines: Sequence[str]) -> str:
    return f"{len(lines)} instruction{'s' if len(lines) != 1 else ''}"


def _listing(lines: Sequence[str]) -> str:
    return "the program " + " ".join(lines) if lines else "no program"


class BlockingGsC200(Blocking, GsC200):
    """A GS-C200 or GS-C200S whose operations are calls: ``BlockingGsC200(GsC200(address=2), port)``."""


class AsyncGsC200(Asynchronous, GsC200):
    """A GS-C200 or GS-C200S whose operations are coroutines."""
