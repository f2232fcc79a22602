"""What comes from the boards, and what becomes of axes when something fails: they stand until somebody says recover."""

from detent.realtime.boards.axle import Axle
from detent.realtime.boards.events import (
    CountDiffers,
    DriverFault,
    DriverSet,
    Event,
    InputChanged,
    Later,
    Lost,
    Ready,
    Recovered,
    Refusal,
    ShutDown,
    Slipped,
    Stopped,
)
from detent.realtime.boards.setup import SetupProblem
from detent.realtime.boards.states import Standing, Weight
from detent.realtime.boards.taking_back import TakingBack
from detent.ticks import NEVER, Ns, show_duration


class Mishaps(TakingBack):
    """An axis at fault is halted in the cell too, so that no counter says what no motor did."""

    def _happened(self, event: Event) -> None:
        match event:
            case InputChanged(_, name, level, at):
                self._raw[name] = int(level)
                if int(level) != self._given.get(name):
                    self._give(name, int(level), at + self._shift)
            case Stopped():
                axle = self._by_stepper[event.stepper]
                if axle.standing is Standing.DRIVEN and axle.awaits is not None:
                    self._stopped_too(axle, event)
                elif axle.standing is Standing.DRIVEN and event.input in self.plan.inputs:
                    self._stopped(event)
                elif axle.standing is Standing.DRIVEN:
                    self._fault(axle, "the board has stopped it, and does not say why")
                    self._place(axle, event.shaft)
                else:  # steps that had left when it failed have met a switch
                    axle.guard.fired()
                    self._place(axle, event.shaft)
                self._heard(event.levels)
            case Later(_, stepper, at, _):
                self._later(self._by_stepper[stepper], at)
            case Slipped(_, stepper, at, by):
                axle = self._by_stepper[stepper]
                self._later(axle, at)
                slips = axle.stepper.slips
                who = stepper if len(axle.stepper.of.axes) == 1 else axle.what.unit
                what = f"{who} slipped by {show_duration(by)}: the computer was late; no step is lost"
                self._say(Weight.WARNING, f"{what} ({slips} {'slip' if slips == 1 else 'slips'} so far)")
            case CountDiffers(_, stepper, shaft, counted):
                axle = self._by_stepper[stepper]
                if axle.standing is Standing.DRIVEN:
                    self._fault(axle, f"the board has counted {counted} where the cell has {shaft}")
                    self._place(axle, counted)
            case ShutDown(board, reason):
                self._board_failed(board, f"board {board} has shut down: {reason}", None)
            case Lost(board, reason):
                self._board_failed(board, f"board {board} is gone: {reason}", "sent")
            case Recovered():
                self._recovered(event)
            case DriverFault(_, driver, reason):
                for axle in self.axles:
                    if axle.what.driver == driver and axle.standing is not Standing.FAULT:
                        self._fault(axle, f"its driver: {reason}")
            case DriverSet(_, driver, what):
                self._say(Weight.NOTE, f"{driver}: {what}")
            case Refusal(board, item, key, text):
                problem = self.plan.problem(SetupProblem(item or board, key, text))
                self._board_failed(board, str(problem), None)
            case Ready():
                pass  # it was, before anything began

    def _later(self, axle: Axle, at: Ns) -> None:
        """Pulses from `at` on come later: so do the outputs of the unit."""
        unit = self.cell.unit(axle.what.unit)
        for out in self._outs.values():
            after = [item for item in out.levels.before(out.levels.count) if item[0] >= at]
            if out.unit == unit and after:
                self.boards.outs[out.name].rewind(at)
                for when, level in after:
                    self._set(out, level, when)

    def _board_failed(self, board: str, why: str, position: str | None) -> None:
        for axle in self.axles:
            if axle.what.board == board and axle.standing is not Standing.FAULT:
                self._fault(axle, why, known=False)
                if position is not None:
                    self._place(axle, axle.stepper.shaft)

    def _fault(self, axle: Axle, why: str, *, known: bool = True) -> None:
        """An axis does not move any more: its unit is halted, and told so whenever it tries."""
        first = axle.standing is not Standing.FAULT
        self.cell.halt(axle.what.unit)
        self._absorb()  # the stepper is told, while it still is
        axle.standing, axle.why, axle.known = Standing.FAULT, why, known and not axle.lost
        axle.guard.want({}, self.cell.now, self.cell.now)  # what has left is watched until it is over
        self.past.clear()
        if first:
            self._say(Weight.FAULT, f"{axle.name} stands: {why}; look at the machine, then recover")

    def _place(self, axle: Axle, shaft: int) -> None:
        """The motor stands at `shaft`: so the counters say, too."""
        by = shaft - axle.shaft_at(self.cell.now)
        if by:
            self.cell.displace(axle.what.unit, axle.what.axis, by)
            axle.displace(by)
            self._absorb()

    def stop(self) -> None:
        """Emergency stop: every board stops at once, and every axis stands until `recover`."""
        self.boards.emergency_stop(self._wall())
        for axle in self.axles:
            if axle.standing is Standing.DRIVEN:
                self._fault(axle, "emergency stop", known=False)

    def abandon(self, why: str) -> None:
        """The cell cannot go on: every board stops at once, for good."""
        self.boards.emergency_stop(self._wall())
        self._stores.flush(NEVER)
        for axle in self.axles:
            axle.standing, axle.why, axle.known = Standing.FAULT, why, False
            axle.guard.release()
        self.abandoned, self._pending = True, False

    def recover(self) -> list[str]:
        """Go on from where the motors stand: boards are made ready again. The axes whose board is waited for."""
        waits = []
        failed = {b for b, board in self.boards.boards.items() if board.state.value not in ("ready",)}
        for axle in self.axles:
            if axle.standing is Standing.FAULT and axle.what.board not in failed:
                self._go_on(axle, axle.shaft_at(self.cell.now))
            elif axle.standing is Standing.FAULT:
                waits.append(axle.name)
        if failed:
            self.boards.recover(self._wall())
        return waits

    def _recovered(self, event: Recovered) -> None:
        now = self.clock()
        self.boards.align(now - self._align, now - self._shift)
        for axle in self.axles:
            if axle.what.board != event.board:
                continue
            if axle.standing is not Standing.FAULT:
                self._fault(axle, f"board {event.board} began anew", known=False)
            shaft = event.shafts.get(axle.name)
            if shaft is None:
                what = f"{axle.name}: board {event.board} was restarted, and nobody knows where the motor stands"
                self._say(Weight.WARNING, f"{what}: send it home before anything else")
                axle.stepper.adopt(axle.shaft_at(self.cell.now))
                axle.lost = True
            else:
                self._place(axle, shaft)
                axle.stepper.rewind(shaft)
                what = f"{axle.name} goes on at {shaft}, as the board has counted"
                unsure = "the motor may have lost steps when it was stopped"
                if axle.lost:
                    unsure = "since the restart nobody knows where the motor stands"
                self._say(Weight.WARNING, f"{what}; {unsure}")
            self._driven_again(axle)
        for name, level in event.inputs.items():
            self._raw[name] = int(level)
            if self._given.get(name) != int(level):
                self._give(name, int(level), self.clock())
        self.past.keep()

    def _go_on(self, axle: Axle, shaft: int) -> None:
        axle.stepper.rewind(shaft)
        self._driven_again(axle)
        self._say(Weight.NOTE, f"{axle.name} goes on at {shaft}")

    def _driven_again(self, axle: Axle) -> None:
        axle.guard.release()
        axle.standing, axle.why, axle.known, axle.awaits = Standing.DRIVEN, "", not axle.lost, None
        unit = self.cell.unit(axle.what.unit)
        for out in self._outs.values():
            levels = out.levels.before(out.levels.count)
            if out.unit == unit and levels:
                self.boards.outs[out.name].now(levels[-1][1])
        self._command(axle)
        self._pending = True

    def _not_written(self, unit: str) -> None:
        what = f"the memory of {unit} could not be written, after it had answered that it was"
        self._say(Weight.WARNING, f"{what}: at the next start it has what it kept before")
