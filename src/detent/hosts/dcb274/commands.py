"""Every command of the DCB-274 as a call (pages 33 to 58). Speeds are steps/s, times seconds unless said.

A speed is what the unit is told; the motor turns at it divided by D. The calls that begin an action (plus, minus,
index_to, velocity, find_home, resolution, go) wait on this side until the action before is complete, and leave the
port to others meanwhile: in its own pending period the unit hears nothing but ESC and @ (page 28), and nobody could
ask for anything.
"""

from typing import Final

from detent.hosts.dcb274.answers import Inputs, JogInputs, Ports, Settings
from detent.hosts.dcb274.ranges import LARGEST_ADDRESS, MOST_STEPS, between, place, program_address, sign, speed
from detent.hosts.dcb274.single_mode import SingleMode
from detent.hosts.dcb274.unit import CLEARING, SAVING, Unit
from detent.hosts.errors import BadAnswer, DriverError
from detent.hosts.exchange import Ask, Rest, Steps, operation

CELLS_AT_ONCE: Final = 32  # bytes of one [: the answer fits into the buffer of a SIN-10
READ_BACK: Final = 128  # the flag of l that reads, and with 1 of A
SLOWER: Final = 14  # "may increase the delay time by as much as 14 times" (page 51)


class Commands(Unit):
    """The commands of one axis."""

    # -- what the unit says ------------------------------------------------------------------------------

    @operation
    def examine(self) -> Steps[Settings]:
        """X in single mode: the working settings (page 22)."""
        if self.mode != "single":
            raise ValueError("X tells the settings in single mode only (page 52): model_number(), or read_memory()")
        return self._settings((yield from self._line("X")))

    @operation
    def model_number(self) -> Steps[int]:
        """X where lines have names: 26 is the DCB-274 (page 52)."""
        if self.mode == "single":
            raise ValueError("X tells the settings in single mode (page 52): examine()")
        return (yield from self._number("X"))

    @operation
    def position(self) -> Steps[int]:
        """Z: the position counter, steps (page 53)."""
        return (yield from self._number("Z"))

    @operation
    def follow(self, seconds: float) -> Steps[list[int]]:
        """Z 1 for so long: every position that the unit reports while it changes (page 53). Single mode only.

        Nothing else can be asked for meanwhile.
        """
        if not isinstance(self._way, SingleMode):
            raise ValueError("continuous reports are for single mode only (page 53): ask for position()")
        first = yield from self._number("Z1")
        reports = yield from self._unbroken(self._reports(self._way, seconds))
        positions = [int(report) for report in reports if report.strip().lstrip("-").isdigit()]
        return [first, *positions]

    def _reports(self, way: SingleMode, seconds: float) -> Steps[list[str]]:
        """What comes for so long; then none come any more."""
        answer = yield Ask(b"", lambda came: None, seconds)
        last = yield from way.reports_off()
        return [*answer.data.decode("latin-1").split("\r"), *last.split("\r")]

    @operation
    def moving_status(self) -> Steps[int]:
        """^: 0 at rest, 1 indexing or homing, 3 at constant speed or jogging (page 56)."""
        return (yield from self._number("^"))

    @operation
    def ports(self) -> Steps[Ports]:
        """A 129: the ports P1 to P4 (page 35)."""
        return Ports.of((yield from self._number("A129")))

    @operation
    def inputs(self) -> Steps[Inputs]:
        """] 0: limits, home and ports (page 54)."""
        return Inputs.of((yield from self._number("]0")))

    @operation
    def jog_inputs(self) -> Steps[JogInputs]:
        """] 1: the jog inputs (page 54)."""
        return JogInputs.of((yield from self._number("]1")))

    @operation
    def options(self) -> Steps[int]:
        """The option flags, by l 128 (page 45)."""
        return (yield from self._number(f"l{READ_BACK}"))

    @operation
    def read_memory(self, address: int, count: int = 1) -> Steps[bytes]:
        """[: so many bytes of NV memory (page 54), also at 128-191, where programs run from RAM."""
        between(address, 0, LARGEST_ADDRESS, "an address")
        between(count, 1, LARGEST_ADDRESS + 1 - address, f"a number of bytes from {address} on")
        data = b""
        while len(data) < count:
            first, size = address + len(data), min(CELLS_AT_ONCE, count - len(data))
            text = f"[{first} {size}"
            result = yield from self._line(text, 0.05 + 0.01 * size)
            cells = result.split()
            if len(cells) != size or not all(cell.isdigit() and int(cell) <= 255 for cell in cells):
                raise BadAnswer(self.title, f"answers {text!r} with {result!r}, not with {size} bytes")
            data += bytes(int(cell) for cell in cells)
        return data

    # -- settings ----------------------------------------------------------------------------------------

    @operation
    def initial_velocity(self, rate: float) -> Steps[None]:
        """I: the rate at which motions start and end, 40 to 36 000 steps/s (page 40)."""
        yield from self._line(f"I{speed(rate)}")

    @operation
    def slew_velocity(self, rate: float) -> Steps[None]:
        """V: the rate behind the ramp, 40 to 36 000 steps/s (page 50)."""
        yield from self._line(f"V{speed(rate)}")

    @operation
    def ramp_slope(self, up: int, down: int) -> Steps[None]:
        """K: steps at each speed of the ramps, 0 to 255; 0 is no ramp (page 41)."""
        between(up, 0, 255, "a ramp slope")
        between(down, 0, 255, "a ramp slope")
        yield from self._line(f"K{up} {down}")
        self._slope = up, down

    @operation
    def divide(self, divisor: int) -> Steps[None]:
        """D: divide all speeds by 1 to 255 (page 37). Not while moving at a speed that has a ramp."""
        yield from self._line(f"D{between(divisor, 1, 255, 'a divisor')}")
        self._divide = divisor

    @operation
    def jog_speeds(self, slow: int, fast: int) -> Steps[None]:
        """B: jog speeds in units of 30 full steps/s, 0 to 255; 0 disables (page 36)."""
        between(slow, 0, 255, "a jog speed")
        yield from self._line(f"B{slow} {between(fast, 0, 255, 'a jog speed')}")

    @operation
    def decay(self, threshold: int) -> Steps[None]:
        """The speed at which slow decay becomes fast, by b: 0 (always fast) to 255 (always slow; page 36)."""
        yield from self._line(f"b{between(threshold, 0, 255, 'a threshold')}")

    @operation
    def currents(self, hold: int, run: int) -> Steps[None]:
        """Y: hold and run current, percent of 4 A (page 52)."""
        between(hold, 0, 100, "a current in percent")
        yield from self._line(f"Y{hold} {between(run, 0, 100, 'a current in percent')}")

    @operation
    def pre_energize(self, seconds: float) -> Steps[None]:
        """The time from run current to the first step, by w: 0 to 2.55 s in steps of 10 ms (page 51)."""
        yield from self._line(f"w{between(round(100 * seconds), 0, 255, 'a time in units of 10 ms')}")

    @operation
    def set_options(self, flags: int) -> Steps[None]:
        """Option flags, by l (page 45); of 2, 4 and 16 only one at a time.

        The sum of 1 invert limits, 2 step and direction out, 4 moving out, 8 PLC, 16 P4 is an input, 32 gentle limits.
        """
        between(flags, 0, 63, "the sum of option flags")
        if (flags & 22).bit_count() > 1:
            raise ValueError(f"option flags {flags}: of 2, 4 and 16 only one at a time (pages 45 and 46)")
        yield from self._line(f"l{flags}")

    @operation
    def resolution(self, table: int) -> Steps[None]:
        """H: 0 1/8, 1 1/4, 2 half, 3 full, 4 half at low torque, 5 wave (page 40). The phases begin anew."""
        between(table, 0, 5, "a table of steps")
        yield from self._act(f"H{table}")

    @operation
    def outputs(self, flags: int) -> Steps[None]:
        """A: turn port 4 (8) and port 5 (16) on, those not named off (page 35)."""
        if flags & ~24:
            raise ValueError(f"outputs are 8 (port 4) and 16 (port 5), not {flags}; P1 to P3 are inputs (page 34)")
        yield from self._line(f"A{flags}")

    @operation
    def set_position(self, position: int) -> Steps[None]:
        """O: the counter says `position` from now on; an index under way goes on as it was (page 47)."""
        yield from self._line(f"O{place(position)}")
        self._target = None

    @operation
    def trip(self, position: int, address: int) -> Steps[None]:
        """T: a running program calls the routine at `address`, 1 to 192, at that position; 0 turns it off (page 49)."""
        yield from self._line(f"T{place(position)} {between(address, 0, 192, 'the address of a trip routine')}")

    @operation
    def save(self) -> Steps[None]:
        """S: keep the settings, and the programs of 128-191, in NV memory (page 49). Sparingly: memory wears."""
        yield from self._line("S", SAVING)

    @operation
    def clear(self, page: int) -> Steps[str]:
        """C: 1 writes factory values and erases programs below 256; 2 to 8 clear the 256 bytes of that page.

        Page 2 begins at 256. Returned is the version (page 37). C 0 is `reload`.
        """
        text = yield from self._line(f"C{between(page, 1, 8, 'a page of NV memory')}", CLEARING)
        return self._told(text)

    @operation
    def reload(self) -> Steps[str]:
        """C 0: take the settings from NV memory, as a reset does, and lose no position; the version (page 37)."""
        text = yield from self._line("C0", SAVING)
        return self._told(text)

    def _told(self, text: str) -> str:
        self._divide = self._slope = None
        self.version = text.split()[-1] if text.split() else ""
        return self.version

    @operation
    def write_memory(self, address: int, value: int) -> Steps[None]:
        r"""\: write one byte of NV memory (page 56). Settings count after `reload`; 228 is the unit's own (page 31)."""
        between(address, 0, LARGEST_ADDRESS, "an address")
        yield from self._line(f"\\{address} {between(value, 0, 255, 'a byte')}")

    # -- motion ------------------------------------------------------------------------------------------

    @operation
    def plus(self, steps: int) -> Steps[None]:
        """+: begin an index of so many steps, 0 to 16 777 215, in plus direction (page 55)."""
        self._leave(None)
        yield from self._act(f"+{between(steps, 0, MOST_STEPS, 'a number of steps')}")

    @operation
    def minus(self, steps: int) -> Steps[None]:
        """-: begin an index of so many steps, 0 to 16 777 215, in minus direction (page 55)."""
        self._leave(None)
        yield from self._act(f"-{between(steps, 0, MOST_STEPS, 'a number of steps')}")

    @operation
    def index_to(self, position: int) -> Steps[None]:
        """R: begin an index to a position (page 48)."""
        text = f"R{place(position)}"
        yield from self._act(text)
        self._leave(position)

    @operation
    def velocity(self, rate: float) -> Steps[None]:
        """M: ramp to a rate and go on, 40 to 36 000 steps/s with a sign, until told otherwise; 0 stops (page 46)."""
        text = f"M{speed(rate, signed=True)}"
        self._leave(None)
        yield from self._act(text)

    @operation
    def find_home(self, rate: float, direction: int) -> Steps[None]:
        """F: begin the search for the home switch at `rate`, in minus (-1) or plus (+1) direction (page 38).

        The counter is not set. With the switch active at the start, the axis leaves it the other way.
        """
        text = f"F{speed(rate)} {int(sign(direction) > 0)}"
        yield from self._act(text)
        self._leave(None)
        self._search = direction

    @operation
    def delay(self, seconds: float) -> Steps[None]:
        """W: wait in the unit until an index is complete, and then for 0 to 655.35 s in steps of 10 ms (page 51).

        An index is waited for on this side, where others can use the port; the time is the unit's, and until it is
        over the port is this call's alone.
        """
        count = between(round(100 * seconds), 0, 65_535, "a time in units of 10 ms")
        yield from self._act(f"W{count}", seconds * SLOWER)

    @operation
    def go(self, address: int = 0) -> Steps[None]:
        """G: start the program at `address`, 0 to 192 or 256 to 2047; 2048 branches on the ports (page 38)."""
        yield from self._start(address, trace=False)

    @operation
    def trace(self, address: int = 0, seconds: float = 60.0) -> Steps[list[str]]:
        """G with trace: run the program and return what it prints: each instruction, and its results (page 38).

        Single mode only. After about `seconds` without an end the program is left running; `wait` then.
        """
        if not isinstance(self._way, SingleMode):
            raise ValueError("programs print in single mode only: go(), wait()")
        yield from self._start(address, trace=True)
        waited = 0.0
        while waited < seconds and not (yield from self._unbroken(self._way.over())):
            yield Rest(self.poll)
            waited += self.poll + self._way.patience
        self._way.running = waited >= seconds
        return self.printed()

    @operation
    def overhear(self, seconds: float) -> Steps[None]:
        """Take what a program prints, for so many `seconds` or until a line has come: `printed` has it then."""
        if isinstance(self._way, SingleMode):
            yield from self._way.overhear(seconds)

    def printed(self) -> list[str]:
        """The lines that programs have printed and nobody has taken yet, as far as they were heard."""
        if not isinstance(self._way, SingleMode):
            return []
        lines, self._way.printed = self._way.printed, []
        return lines

    def _start(self, address: int, *, trace: bool) -> Steps[None]:
        if address != LARGEST_ADDRESS + 1:
            program_address(address)
        yield from self._act(f"G{address} 1" if trace else f"G{address}")
        self._leave(None)
        self._way.running = True

    # -- stopping ----------------------------------------------------------------------------------------

    @operation
    def stop(self) -> Steps[None]:
        """@: ramp down; a program that runs ends (page 33). Nothing happens if the axis stands."""
        yield from self._cut_in("@")

    @operation
    def terminate(self) -> Steps[None]:
        """``|``: end program and motion of this axis alone at once, without a ramp (page 57). Not in single mode."""
        if self.mode == "single":
            raise ValueError("| is for lines of several axes (page 57): abort()")
        yield from self._cut_in("|")
        self._way.running = False

    def _cut_in(self, letter: str) -> Steps[None]:
        """Whatever waits for its turn is dropped, and `letter` is said: as a line, or to a program that runs."""
        self._stops += 1
        self._leave(None)
        if isinstance(self._way, SingleMode):
            yield from self._stop_alone(self._way)
            return
        stores = self._storing or self.programming
        if self._connected and stores:
            yield from self._way.end_program_mode()
        yield from self._way.interrupt(letter.encode(), known=self._connected and not stores)
        self._takes_lines()

    def _stop_alone(self, way: SingleMode) -> Steps[None]:
        known = self._connected and not self._storing and not self.programming
        try:
            yield from way.soft_stop(known=known, signed_on=self._connected or self._broken)
        except GeneratorExit:
            self._connected, self._broken = False, True
            raise
        except DriverError:  # it may be off: whoever comes next sees whether it signs on
            self._connected = False
            raise
        way.running = False
        self._takes_lines()

    @operation
    def abort(self) -> Steps[None]:
        """ESC: every axis on the line stops at once, without a ramp, and ends its program (page 33)."""
        self._stops += 1
        self._leave(None)
        try:
            yield from self._way.escape()
        except DriverError:  # it may be off
            self._connected = False
            raise
        self._way.running = False
        self._takes_lines()
