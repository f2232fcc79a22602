"""Every command character of GenStepper 2.18 as a call, in microsteps, microsteps/s and microsteps/s/s.

X and Y stand before every exchange, B in `go_both` and `stop_both`. What a report can confirm is read back in the same
exchange, as nothing else on this line tells a damaged number from a sound one.
"""

import re
from collections.abc import Collection
from typing import Final, NamedTuple

from detent.hosts.errors import BadAnswer
from detent.hosts.exchange import Steps, operation
from detent.hosts.genstepper.dialogue import ACTION, SIGN_ON, Action, Dialogue

LARGEST: Final = 2_147_483_647  # a position, either way
RATES: Final = range(1, 62_501)  # microsteps/s, and microsteps/s/s
MICROSTEPS: Final = range(1, 65)  # sixty-fourths of a full step
STEP_MODES: Final = range(4)
INPUTS: Final = ("Y-", "Y+", "X-", "X+")  # bits 0 to 3 of L, T and memory 5; bits 4 to 7 of E
PAGE_RATE = 256  # A is kept in units of that many microsteps/s

TARGET, SLOPE, STEP_MODE, RUN_RATE, STOP_RATE, VERSION = -4, -3, -9, -10, -11, -12
POSITION = -1
LIMITS, AUTO_RATE, STEP_SIZE = 5, 252, 253  # memory locations
RESET_SECONDS = 1.0  # deaf for 250 ms, then the sign-on

LATCHED = re.compile(rb"L,(\d+)(?:\r\n)?\*")
PROMPT = re.compile(rb"\*")


class Reports(NamedTuple):
    """Reports -1 to -11 of a motor (pages 40 to 43): microsteps, microsteps/s, microsteps/s/s."""

    position: int
    speed: int
    slope: int
    target: int
    target_speed: int
    windings: int
    idle_windings: int
    action: int
    step_mode: int
    run_rate: int
    stop_rate: int


class Latches(NamedTuple):
    """What L has kept (page 30): the limits met during a motion towards them, as ``X+``, and a reset."""

    limits: frozenset[str]
    reset: bool


class Commands(Dialogue):
    """The commands. Each raises ValueError for what the board cannot be told, NoAnswer, BadAnswer."""

    active_high: frozenset[str] = frozenset()
    """Which limit inputs (LX+: ``X+``) mean a limit when high: as T was last set by this driver, else none."""

    # -- motion ------------------------------------------------------------------------------------------

    @operation
    def go_to(self, position: int) -> Steps[None]:
        """G: begin to go to a position; a motor that moves stops first."""
        yield from self.order(f"{as_position(position)}G")

    @operation
    def go_by(self, steps: int) -> Steps[None]:
        """S with a number: begin to go so far, from the target of a running go, else from where it is (page 33)."""
        yield from self.order(f"{as_position(steps)}S", again=False)

    @operation
    def slew(self, direction: int) -> Steps[None]:
        """S with a sign alone: go on in `direction` (+1 or -1) until told otherwise, or to a limit."""
        if direction not in (1, -1):
            raise ValueError(f"a direction is +1 or -1, not {direction}")
        yield from self.order("+S" if direction > 0 else "-S")

    @operation
    def go_both(self, position: int) -> Steps[None]:
        """B, G: begin to go to a position with both motors at once."""
        yield from self.order(f"B{as_position(position)}G{self.motor}")

    @operation
    def stop_both(self) -> Steps[None]:
        """B, Z: ramp down both motors."""
        yield from self.order(f"BZ{self.motor}")

    @operation
    def stop_both_at_once(self) -> Steps[None]:
        """1E, 0E: stop both motors without a ramp (page 20); gears may be damaged."""
        yield from self.order("1E0E")

    @operation
    def mark(self) -> Steps[None]:
        """0M: mark the position where the motor is."""
        yield from self.order("0M", again=False)

    @operation
    def go_to_mark(self) -> Steps[None]:
        """1M: begin to go to the marked position."""
        yield from self.order("1M")

    @operation
    def wait_idle(self, timeout: float) -> Steps[None]:
        """I: wait for the board's word that the motor is idle; `wait` leaves the port to others meanwhile.

        Raises NoAnswer after `timeout` seconds.
        """
        yield from self.order("")  # selects the motor: behind it one prompt comes, that of I
        yield from self.exchange("I", PROMPT, more=timeout)

    @operation
    def position(self) -> Steps[int]:
        """-1?: where the motor is, in microsteps."""
        return (yield from self.ask("", POSITION))[0]

    @operation
    def set_position(self, position: int) -> Steps[None]:
        """=: call the place where the motor is `position`; a motor that moves stops."""
        yield from self.order(f"{as_position(position)}=", again=False)

    # -- rates -------------------------------------------------------------------------------------------

    @operation
    def set_stop_rate(self, rate: int) -> Steps[None]:
        """K: the rate at which motion may start and stop, 1 to 62500 microsteps/s."""
        yield from self._confirmed(f"{_rate(rate)}K", STOP_RATE, rate)

    @operation
    def set_run_rate(self, rate: int) -> Steps[None]:
        """R: the rate of moves and slews, 1 to 62500 microsteps/s; a slew follows at once."""
        yield from self._confirmed(f"{_rate(rate)}R", RUN_RATE, rate)

    @operation
    def set_slope(self, slope: int) -> Steps[None]:
        """P: how steep the ramps are, 1 to 62500 microsteps/s/s. Not during a go: its end would be too sudden."""
        yield from self.order(f"{_rate(slope)}P")

    @operation
    def set_auto_full_step(self, rate: int) -> Steps[None]:
        """A: above which rate, 0 to 62500 microsteps/s in units of 256, both motors make full steps at full power."""
        if rate != 0:
            _rate(rate)
        yield from self._confirmed(f"{rate}A", AUTO_RATE, rate // PAGE_RATE)

    # -- windings ----------------------------------------------------------------------------------------

    @operation
    def set_step_mode(self, mode: int) -> Steps[None]:
        """O: 0 one winding, 1 half step, 2 two windings, 3 microstep. With double current 4 more is reported."""
        (told,) = yield from self.ask(f"{_choice(mode, STEP_MODES, 'a step mode')}O", STEP_MODE)
        self._check("O", mode, told % len(STEP_MODES))

    @operation
    def set_idle_windings(self, level: int) -> Steps[None]:
        """W: the windings of an idle motor, 0 off, 1 on, 2 half power."""
        yield from self.order(f"{_choice(level, range(3), 'a level of idle windings')}W")

    @operation
    def set_half_power(self, half: bool) -> Steps[None]:
        """H: both motors at half power, or at full power."""
        yield from self.order(f"{int(half)}H")

    # -- inputs ------------------------------------------------------------------------------------------

    @operation
    def set_limit_switches(self, *, blocked: Collection[str] = (), active_high: Collection[str] = ()) -> Steps[None]:
        """T: which limit inputs (``X-``, ``X+``, ``Y-``, ``Y+``) do nothing, and which mean a limit when high."""
        yield from self.order(f"{_bits(blocked) + 16 * _bits(active_high)}T")
        self.active_high = frozenset(active_high)

    @operation
    def set_direct(self, mode: int, *, inverted: Collection[str] = (), current_by_limits: bool = False) -> Steps[None]:
        """E: both motors step by pulses on the slew inputs: 1 a line each way, 2 step and direction; 0 ends it.

        `inverted` inputs (``X-``, ``X+``, ``Y-``, ``Y+``) count high as low; with `current_by_limits` the limit inputs
        switch currents. Both motors stop at once.
        """
        bits = _choice(mode, range(3), "a mode of direct pulse control")
        if not mode and (inverted or current_by_limits):
            raise ValueError("mode 0 ends direct pulse control and takes nothing else; choose mode 1 or 2")
        yield from self.order(f"{bits + 4 * current_by_limits + 16 * _bits(inverted)}E")

    @operation
    def latches(self) -> Steps[Latches]:
        """L: the limits of both motors that were met, and whether there was a reset, since it was last asked."""
        found = yield from self.exchange("L", LATCHED)
        bits = int(found[1])
        return Latches(_names(bits), bool(bits & 16))

    # -- the board ---------------------------------------------------------------------------------------

    @operation
    def set_verbose(self, *, first: bool = True, delayed: bool = False) -> Steps[None]:
        """V: CR LF before and behind the text of an answer; answers later, and their characters slower."""
        yield from self.order(f"{first + 2 * delayed}V")

    @operation
    def reset(self, microstep: int = 4) -> Steps[str]:
        """!: reset the board, with microsteps of 1 to 64 sixty-fourths of a full step; returns the firmware's version.

        Both motors stop at once, where they are is forgotten, and everything is as after power-on (page 37).
        """
        found = yield from self.exchange(
            f"{_choice(microstep, MICROSTEPS, 'a microstep')}!", SIGN_ON, more=RESET_SECONDS
        )
        self.forget()
        self._stale = False
        return found[1].decode("ascii")

    @operation
    def version(self) -> Steps[str]:
        """-12?: the firmware's version."""
        found = yield from self.exchange(f"{VERSION}?", SIGN_ON, again=True)
        return found[1].decode("ascii")

    @operation
    def report(self, number: int) -> Steps[int]:
        """?: report -1 to -11 of the motor, as the manual numbers them."""
        if not -11 <= number <= -1:
            raise ValueError(f"a report is -1 to -11, not {number}; reports() has all, memory() reads a location")
        return (yield from self.ask("", number))[0]

    @operation
    def reports(self) -> Steps[Reports]:
        """0?: all reports of the motor."""
        return Reports(*(yield from self.ask("", 0)))

    @operation
    def memory(self, address: int) -> Steps[int]:
        """?: what memory location 1 to 255 holds (page 39)."""
        return (yield from self.ask("", _choice(address, range(1, 256), "a memory location")))[0]

    @operation
    def action(self) -> Steps[Action]:
        """-8?: what the motor does."""
        return Action((yield from self.ask("", ACTION))[0])

    def forget(self) -> None:
        """The connection was lost, or the board was reset: limits are active low."""
        super().forget()
        self.active_high = frozenset()

    # -- what is confirmed -------------------------------------------------------------------------------

    def _confirmed(self, command: str, number: int, wanted: int) -> Steps[None]:
        (told,) = yield from self.ask(command, number)
        self._check(command[-1], wanted, told)

    def _check(self, command: str, wanted: int, told: int) -> None:
        if told != wanted:
            raise BadAnswer(self.title, f"was given {wanted} by {command} and has {told}: say it again")


def as_position(position: int) -> str:
    """`position` as a command has it. Raises ValueError."""
    if not -LARGEST <= position <= LARGEST:
        raise ValueError(f"a position is {-LARGEST} to {LARGEST} microsteps, not {position}")
    return str(position)


def _rate(rate: int) -> int:
    if rate not in RATES:
        raise ValueError(f"a rate is {RATES[0]} to {RATES[-1]} microsteps/s, a slope that many /s/s, not {rate}")
    return rate


def _choice(number: int, numbers: range, what: str) -> int:
    if number not in numbers:
        raise ValueError(f"{what} is {numbers[0]} to {numbers[-1]}, not {number}")
    return number


def _bits(inputs: Collection[str]) -> int:
    for name in inputs:
        if name not in INPUTS:
            raise ValueError(f"an input is one of {', '.join(INPUTS)}, not {name!r}")
    return sum(1 << place for place, name in enumerate(INPUTS) if name in inputs)


def _names(bits: int) -> frozenset[str]:
    return frozenset(name for place, name in enumerate(INPUTS) if bits >> place & 1)
