"""Every command of the datasheet as a call, in the units of people: steps/s, seconds, steps.

In command mode a delayed command is obeyed at once; between `enter_programming` and `execute` or `leave_programming`
it is stored. Whole programs are sent by `write_program` (driver.py), which repairs what goes wrong on the way.
"""

import re
from typing import NamedTuple

from detent.hosts.errors import BadAnswer, NoAnswer, Refused
from detent.hosts.exchange import Ask, Steps, operation
from detent.hosts.gsc200 import language
from detent.hosts.gsc200.dialogue import LISTED as LISTED_LINES
from detent.hosts.gsc200.dialogue import LONGEST, TRIES, Again, Dialogue

EEPROM_SECONDS = 5.0  # the datasheet does not say how long M takes

POSITION = re.compile(r"V[+-]?\d{1,8}|B|E[1-6]")
LEVELS = re.compile(r"V[0-7][0-7]|B|E[1-6]")
LISTED = re.compile(r"B|E[1-6]|END|[ACDGIJLRSTUWfgj+-][0-9co,+-]*")


class UserPins(NamedTuple):
    """The levels of UI1 to UI3 and UO1 to UO3."""

    inputs: tuple[bool, bool, bool]
    outputs: tuple[bool, bool, bool]


class Commands(Dialogue):
    """The commands. Each raises ValueError for what the module cannot be told, Busy, Refused, NoAnswer, BadAnswer."""

    # -- user pins and waiting ---------------------------------------------------------------------------

    @operation
    def activate(self, output: int) -> Steps[None]:
        """A: set user output 1 to 3 to one."""
        yield from self.setting(f"A{_in(language.PINS, output, 'an output')}")

    @operation
    def clear(self, output: int) -> Steps[None]:
        """C: clear user output 1 to 3 to zero."""
        yield from self.setting(f"C{_in(language.PINS, output, 'an output')}")

    @operation
    def delay(self, seconds: float) -> Steps[None]:
        """D: be busy for 0.1 to 25.5 s, in tenths."""
        tenths = round(seconds * 10)
        if tenths not in language.TENTHS or abs(seconds * 10 - tenths) > 1e-6:
            raise ValueError(f"a delay is 0.1 to 25.5 s, in tenths of a second, not {seconds:g} s")
        yield from self.delayed(f"D{tenths}", Again.NEVER, begins=True)

    @operation
    def wait_for(self, input: int) -> Steps[None]:
        """W: be busy until user input 1 to 3 is one."""
        command = f"W{_in(language.PINS, input, 'an input')}"
        yield from self.delayed(command, Again.WHEN_READY, begins=True)

    @operation
    def pins(self) -> Steps[UserPins]:
        """V2: the levels of the user inputs and outputs."""
        text = yield from self.say("V2", LEVELS, Again.AT_ONCE)
        self.judge("V2", text)
        inputs, outputs = (tuple(bool(int(figure) >> bit & 1) for bit in range(3)) for figure in text[1:])
        return UserPins(inputs, outputs)  # type: ignore[arg-type]  # three each

    # -- motion ------------------------------------------------------------------------------------------

    @operation
    def set_start_stop(self, rate: int) -> Steps[None]:
        """S: the start-stop speed, 10 to 10000 steps/s in tens."""
        yield from self.setting(f"S{_tens(rate)}")

    @operation
    def set_top(self, rate: int) -> Steps[None]:
        """T: the slew speed, 10 to 10000 steps/s in tens."""
        yield from self.setting(f"T{_tens(rate)}")

    @operation
    def set_ramp(self, steps: int) -> Steps[None]:
        """R: the length of both ramps, 1 to 999 steps."""
        yield from self.setting(f"R{_in(language.RAMPS, steps, 'a ramp', 'steps')}")

    @operation
    def go_to(self, position: int) -> Steps[None]:
        """G: begin a move to a position, 0 to 9999999 (GS-C200), -8388608 to +8388607 (GS-C200S)."""
        command = f"G{self._position(position)}"
        yield from self.delayed(command, Again.WHEN_READY, begins=True)

    @operation
    def move(self, steps: int) -> Steps[None]:
        """+ or -: begin a move by 1 to 999999 steps, with their sign."""
        if abs(steps) not in language.MOVES:
            raise ValueError(f"a move has 1 to {language.MOVES[-1]} steps, not {steps}: move_to() goes further")
        yield from self.delayed(f"{steps:+d}", Again.NEVER, begins=True)

    @operation
    def go(self, direction: int, until_low: int | None = None) -> Steps[None]:
        """G+, G-, on a GS-C200S g+, g-: begin to go on in `direction` (+1 or -1).

        With `until_low` it ramps down when user input 1 to 3 is zero.
        """
        stop = "" if until_low is None else str(_in(language.PINS, until_low, "an input"))
        command = ("g" if self.signed else "G") + _sign(direction) + stop
        yield from self.delayed(command, Again.NEVER, begins=True)

    @operation
    def find_home(self, direction: int = 1) -> Steps[None]:
        """H: begin homing: to the end of travel in `direction`, then back until HOME is zero; that is position 0.

        At the start-stop speed. A GS-C200 clears the program in RAM, too.
        """
        command = f"H{_sign(direction)}"
        self.begins()
        before = self._homing, self._cut
        self._homing = True  # whoever breaks this off has begun it all the same
        try:
            yield from self.order(command, Again.NEVER)
        except Refused:
            self._homing, self._cut = before
            raise
        self._cut = False

    @operation
    def zero_speed(self) -> Steps[None]:
        """Z: ramp down, and end the program."""
        yield from self._cut_off("Z")

    @operation
    def kill(self) -> Steps[None]:
        """K: stop the pulses at once, and end the program."""
        yield from self._cut_off("K")

    def _cut_off(self, command: str) -> Steps[None]:
        """A stop ends a homing, wherever that has come to; one that is broken off may have done so, too."""
        self.otherwise()
        self._cut = self._cut or (self._homing and not self.signed)
        yield from self.order(command, Again.AT_ONCE)
        self._homing = False

    # -- the position counter ----------------------------------------------------------------------------

    @operation
    def position(self) -> Steps[int]:
        """V1: the position counter. Raises Busy while it moves: only F, Z and K are answered then."""
        text = yield from self.say("V1", POSITION, Again.AT_ONCE)
        self.judge("V1", text)
        if (text[1:2] in ("+", "-")) != self.signed:
            other = language.MODELS[not self.signed]
            raise BadAnswer(self.title, f"has the counter of a {other.upper()}: say model {other}", self._spoken)
        return int(text[1:])

    @operation
    def force(self, position: int) -> Steps[None]:
        """F (GS-C200S): make the position counter read -8388608 to +8388607."""
        self._only(True, "f", "initialize() clears the counter")
        yield from self.delayed(f"f{_in(language.POSITIONS[self.model], position, 'a position'):+d}", Again.WHEN_READY)

    @operation
    def initialize(self, *, position: bool = True, outputs: bool = True) -> Steps[None]:
        """I1, I2, I3: clear the position counter, the user outputs, or both; the position resets the driver, too."""
        which = position + 2 * outputs
        if not which:
            raise ValueError("say what to clear: position, outputs, or both")
        yield from self.delayed(f"I{which}", Again.WHEN_READY)
        if position and not self.programming:
            self._cut = False

    # -- programs ----------------------------------------------------------------------------------------

    @operation
    def enter_programming(self) -> Steps[None]:
        """P (GS-C200), Po (GS-C200S): clear the program in RAM; delayed commands are stored from here on.

        A GS-C200 leaves programming mode only by `execute`.
        """
        yield from self.order("Po" if self.signed else "P", Again.NEVER)

    @operation
    def leave_programming(self) -> Steps[None]:
        """Px (GS-C200S): back to command mode, without starting the program."""
        self._only(True, "Px", "a GS-C200 leaves programming mode only by execute(), which starts the program")
        try:
            yield from self.order("Px", Again.NEVER)
        except (NoAnswer, BadAnswer):
            try:
                yield from self.order("Px", Again.NEVER)
            except Refused as error:
                if error.code != "E4":  # which says that the first one was obeyed
                    raise
        self.programming = False

    @operation
    def execute(self) -> Steps[None]:
        """E: start the program in RAM at its first instruction; it ends programming mode, too."""
        self.begins()
        yield from self.order("E", Again.NEVER)

    @operation
    def mark(self) -> Steps[None]:
        """L0: store the start of a loop."""
        yield from self._stored("L0")

    @operation
    def loop(self, rounds: int) -> Steps[None]:
        """L: store the end of a loop that is run 1 to 255 times in all."""
        yield from self._stored(f"L{_in(language.ROUNDS, rounds, 'a loop', 'rounds')}")

    @operation
    def until(self, input: int) -> Steps[None]:
        """U: store that the program is repeated until user input 1 to 3 is zero."""
        yield from self._stored(f"U{_in(language.PINS, input, 'an input')}")

    @operation
    def jump(self, address: int) -> Steps[None]:
        """J (GS-C200S): store a jump to memory location 0 to 118."""
        self._only(True, "j", "a GS-C200 has loop() and until()")
        yield from self._stored(f"j{_in(language.ADDRESSES, address, 'an address')}")

    @operation
    def jump_if(self, inputs: int, address: int) -> Steps[None]:
        """Jc (GS-C200S): store a jump to location 0 to 118 if the user inputs (UI1 + 2 UI2 + 4 UI3) are 0 to 7."""
        self._only(True, "jc", "a GS-C200 has loop() and until()")
        value = _in(language.INPUTS, inputs, "the value of the inputs")
        yield from self._stored(f"jc{value},{_in(language.ADDRESSES, address, 'an address')}")

    @operation
    def save(self) -> Steps[None]:
        """M: keep the program of the RAM in the EEPROM. Raises Refused (E6) if the EEPROM does not take it."""
        yield from self.order("M", Again.AT_ONCE, EEPROM_SECONDS)

    @operation
    def recall(self) -> Steps[None]:
        """X: copy the program of the EEPROM into RAM; what RAM held is lost."""
        yield from self.order("X", Again.AT_ONCE)

    @operation
    def read_program(self) -> Steps[list[str]]:
        """Q: the program in RAM, an instruction a line, as `write_program` takes it."""
        for _ in range(TRIES):
            text: str | None = yield from self.say("Q", LISTED, Again.AT_ONCE)
            assert text is not None
            if text == "B" or (text.startswith("E") and text != "END"):
                self.judge("Q", text)
            lines: list[str] = []
            while text is not None and text != "END" and len(lines) < LISTED_LINES:
                lines.append(text)
                text = yield from self._next_listed()
            if text == "END":
                self._stale = False
                return [self._listed(one) for one in lines]
            yield from self._quiet(LISTED_LINES)
        raise BadAnswer(self.title, f"its list of the program was damaged {TRIES} times")

    # -- arguments ---------------------------------------------------------------------------------------

    def _next_listed(self) -> Steps[str | None]:
        """The next frame of a list; None if it does not come, or was damaged."""
        answer = yield Ask(b"", self.frames.end, self.patience + LONGEST * self._character)
        text = self.frames.text(answer.data) if answer.whole else None
        return text if text is not None and LISTED.fullmatch(text) else None

    def _listed(self, text: str) -> str:
        """A listed instruction in the one spelling that lines are compared in."""
        try:
            return language.line(self.model, text).text
        except ValueError:
            return text  # as the module has it: it is shown, not judged

    def _stored(self, command: str) -> Steps[None]:
        if not self.programming:
            raise ValueError(f"{command} stands in programs only: enter_programming() first, or write_program()")
        yield from self.order(command, Again.NEVER)

    def _position(self, position: int) -> str:
        _in(language.POSITIONS[self.model], position, "a position")
        return f"{position:+d}" if self.signed else str(position)

    def _only(self, signed: bool, command: str, instead: str) -> None:
        if self.signed != signed:
            raise ValueError(f"the {self.model.upper()} has no command {command}: {instead}")


def _in(numbers: range, number: int, what: str, unit: str = "") -> int:
    """`number`. ValueError if it is not one of `numbers`."""
    if number not in numbers:
        unit = f" {unit}" if unit else ""
        raise ValueError(f"{what} is {numbers[0]} to {numbers[-1]}{unit}, not {number}")
    return number


def _tens(rate: int) -> int:
    tens, rest = divmod(rate, 10)
    if rest or tens not in language.RATES:
        raise ValueError(f"a rate is 10 to 10000 steps/s in tens, not {rate:g}; set_speeds() rounds")
    return int(tens)


def _sign(direction: int) -> str:
    if direction not in (1, -1):
        raise ValueError(f"a direction is +1 or -1, not {direction}")
    return "+" if direction > 0 else "-"
