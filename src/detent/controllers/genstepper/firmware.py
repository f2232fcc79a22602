"""The boards with their firmware as devices: characters, and the commands.

One character follows one path: `receive` -> `link.Value` if it belongs to a number, else the method of its command
in `_OBEY` -> `prompter` answers. Motion is `motor`'s; everything else that a command acts on is the `board`'s.
"""

from collections.abc import Callable, Sequence
from typing import ClassVar

from detent.controllers.device import Refused
from detent.controllers.genstepper import commands, link, reports
from detent.controllers.genstepper.board import Board, Phase, high_byte
from detent.controllers.genstepper.commands import Op
from detent.controllers.genstepper.motor import DEFAULT_RATE, DEFAULT_SLOPE, LEAST_KEPT, Motor
from detent.controllers.genstepper.pins import AXES
from detent.controllers.powered import WithoutPrograms
from detent.ramps.tick_accumulator import UPDATES
from detent.ticks import Ns
from detent.uart import Char


class GenStepper(Board, WithoutPrograms):
    """One BS0610 or BS0710. Straps that are not named are open, JS installed; `order` are fields of `pins.Order`."""

    # -- the contract, as far as `Board` does not keep it --------------------------------------------

    def receive(self, port: str, chars: Sequence[Char], now: Ns) -> None:
        """Characters on SI that are recognised at `now`, a quarter into their stop bits."""
        self.advance(now)
        for char in chars:
            if self._phase is Phase.READY:
                self._cancel()
                if char.framing_ok and char.parity_ok:
                    self._take(chr(char.value), now)
                    self._settle(now)
            elif self._phase is not Phase.OFF and char.framing_ok and char.parity_ok:
                self._lost += chr(char.value)

    def frame(self, text: str) -> bytes:
        """Commands as they are typed: there is nothing to add."""
        return text.encode("ascii", "replace")

    def answers(self, data: bytes) -> list[str]:
        """The lines, and the prompts, in what the board sent."""
        return link.unframe(data)

    def registers(self, now: Ns) -> dict[str, str]:
        """K, P, R and O of each motor, the mark of M, where a motion leads; A and the step size (!) of both."""
        found = {"A": str(self._auto), "!": str(self._step_size)}
        for axis, motor in self._motors.items():
            found |= {f"{axis} K": str(motor.keep), f"{axis} P": str(motor.slope), f"{axis} R": str(motor.rate),
                      f"{axis} O": str(motor.mode), f"{axis} M": str(motor.mark),
                      f"{axis} G": str(motor.seen_target(now))}  # fmt: skip
        return found

    # -- characters --------------------------------------------------------------------------------------

    def _take(self, character: str, now: Ns) -> None:
        if self._value.take(character):
            return
        row = commands.row(character)
        verbose = self._verbose  # CR LF comes before the command is processed, by what V was until then (page 35)
        lines: Sequence[str] | None = ()
        if row is None:
            self._value.number()
            if character not in commands.LITTLE_SAID:
                self._out.append(Refused(now, character, "no command of GenStepper: ignored, and answered"))
        else:
            if row.blinds:
                self._direct.blind(now)
            lines = self._OBEY[row.op](self, now)
        if lines is not None:
            self._prompter.answer(link.answer(lines, verbose), now)

    def _each(self) -> list[Motor]:
        return [self._motors[axis] for axis in self._selected]

    def _movable(self, op: Op, now: Ns) -> list[Motor]:
        """The motors that a G, S or M moves: none in E mode, none whose slew key is held.

        "If button control is performed while a goto is underway the goto gets changed to a direction slew" (page 22).
        """
        if self._direct.on:
            return []
        for axis in self._selected:
            if self._held(axis).held:
                reason = f"{axis} moves as its slew keys say, as long as one is held (pages 21, 22, 60)"
                self._out.append(Refused(now, op.value, reason))
        return [motor for motor in self._each() if not self._held(motor.name).held]

    def _refuse(self, op: Op, number: int, takes: str, now: Ns) -> None:
        self._out.append(Refused(now, f"{number}{op.value}", f"{op.value} takes {takes}: nothing changes"))

    # -- commands: each returns the lines of its answer, None if it answers later --------------------------

    def _auto_rate(self, now: Ns) -> Sequence[str]:
        self._auto = high_byte(self._value.number())
        return ()

    def _select(self, axes: tuple[str, ...]) -> Sequence[str]:
        self._value.number()
        self._selected = axes
        return ()

    def _select_both(self, now: Ns) -> Sequence[str]:
        return self._select(AXES)

    def _select_x(self, now: Ns) -> Sequence[str]:
        return self._select(("X",))

    def _select_y(self, now: Ns) -> Sequence[str]:
        return self._select(("Y",))

    def _direct_mode(self, now: Ns) -> Sequence[str]:
        self._choose_direct(self._value.number() & 0xFF, now)
        return ()

    def _go(self, now: Ns) -> Sequence[str]:
        target = self._value.number()
        for motor in self._movable(Op.GO, now):
            motor.go(target, now)
        return ()

    def _half_power(self, now: Ns) -> Sequence[str]:
        self._half = self._value.number() != 0
        return ()

    def _wait_idle(self, now: Ns) -> Sequence[str] | None:
        self._value.number()
        self._waiting = self._selected
        if self._may_answer():
            self._waiting = ()
            return ()
        if self._verbose & link.CRLF_FIRST:
            self._prompter.answer(link.CRLF, now)
        return None

    def _keep(self, now: Ns) -> Sequence[str]:
        rate = _limited(self._value.number(), LEAST_KEPT)
        for motor in self._each():
            motor.set_keep(rate, now)
        return ()

    def _slope(self, now: Ns) -> Sequence[str]:
        slope = _limited(self._value.number(), DEFAULT_SLOPE)
        for motor in self._each():
            motor.set_slope(slope, now)
        return ()

    def _rate(self, now: Ns) -> Sequence[str]:
        rate = _limited(self._value.number(), DEFAULT_RATE)
        for motor in self._each():
            motor.set_rate(rate, now)
        return ()

    def _latches(self, now: Ns) -> Sequence[str]:
        self._value.number()
        return (f"L,{self._limits.report()}",)

    def _mark(self, now: Ns) -> Sequence[str]:
        number = self._value.number()
        if number == 0:
            for motor in self._each():
                motor.mark = motor.position(now)
        elif number == 1:
            for motor in self._movable(Op.MARK, now):
                motor.go(motor.mark, now)
        else:
            self._refuse(Op.MARK, number, "0 or 1", now)
        return ()

    def _mode(self, now: Ns) -> Sequence[str]:
        mode = self._value.number()
        if not 0 <= mode <= 3:
            self._refuse(Op.MODE, mode, "0 to 3", now)
            return ()
        for motor in self._each():
            motor.mode = mode
        return ()

    def _slew(self, now: Ns) -> Sequence[str]:
        direction = self._value.slew()
        steps = 0 if direction else self._value.number()
        for motor in self._movable(Op.SLEW, now):
            if direction:
                motor.slew(direction, now)
            else:
                motor.go_relative(steps, now)
        return ()

    def _limit_mask(self, now: Ns) -> Sequence[str]:
        self._limits.choose(self._value.number())
        self._look_at_limits(now)
        return ()

    def _choose_verbose(self, now: Ns) -> Sequence[str]:
        self._verbose = self._value.number() & (link.CRLF_FIRST | link.DELAYED)
        self._prompter.verbose(self._verbose)
        return ()

    def _idle_windings(self, now: Ns) -> Sequence[str]:
        choice = self._value.number()
        if not 0 <= choice <= 2:
            self._refuse(Op.WINDINGS, choice, "0 to 2", now)
            return ()
        for motor in self._each():
            motor.idle_windings = choice
        return ()

    def _stop(self, now: Ns) -> Sequence[str]:
        self._value.number()
        for motor in self._each():
            motor.stop(now)
        return ()

    def _software_reset(self, now: Ns) -> Sequence[str] | None:
        number = self._value.number()
        self._reset(min(max(number, 1), 64) if number else self._order.step_size, now)
        return None

    def _set_position(self, now: Ns) -> Sequence[str]:
        position = self._value.number()
        for motor in self._each():
            motor.set_position(position, now)
        return ()

    def _report(self, now: Ns) -> Sequence[str]:
        number = self._value.number()
        if number == commands.VERSION:
            return reports.VERSION_TEXT
        if reports.is_memory(number):
            return [f"{axis},{number},{self._memory(number, now)}" for axis in self._selected]
        number = number if reports.is_report(number) else 0
        found = []
        for motor in self._each():
            told = self._drive_of(motor.name, now)
            energised = bool(told.drive.sixteenths)  # type: ignore[attr-defined]
            found.append(reports.line(motor.name, number, reports.values(motor, energised, self._double, now)))
        return found

    _OBEY: ClassVar[dict[Op, Callable[["GenStepper", Ns], Sequence[str] | None]]] = {
        Op.AUTO: _auto_rate, Op.BOTH: _select_both, Op.DIRECT: _direct_mode, Op.GO: _go, Op.HALF: _half_power,
        Op.IDLE: _wait_idle, Op.KEEP: _keep, Op.LATCHES: _latches, Op.MARK: _mark, Op.MODE: _mode, Op.SLOPE: _slope,
        Op.RATE: _rate, Op.SLEW: _slew, Op.LIMITS: _limit_mask, Op.VERBOSE: _choose_verbose,
        Op.WINDINGS: _idle_windings, Op.X: _select_x, Op.Y: _select_y, Op.STOP: _stop, Op.RESET: _software_reset,
        Op.SET: _set_position, Op.REPORT: _report,
    }  # fmt: skip


def _limited(number: int, default: int) -> int:
    """A rate or slope as K, P and R take it: `default` for 0, no more than the ticks allow; a sign does not count."""
    return min(abs(number), UPDATES) or default
