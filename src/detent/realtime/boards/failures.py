"""What comes from the boards, and what becomes of axes when something fails: they stand until somebody says recover."""

from detent.realtime.boards.axis_ledger import AxisLedger
from detent.realtime.boards.events import (
    BY_HAND,
    CountDiffers,
    CountEnds,
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
from detent.realtime.boards.rollback import Rollback
from detent.realtime.boards.setup import SetupProblem
from detent.realtime.boards.states import Standing, Weight
from detent.ticks import NEVER, Ns, show_duration


class Failures(Rollback):
    """An axis at fault is halted in the cell too, so that no counter says what no motor did."""

    def _happened(self, event: Event) -> None:
        match event:
            case InputChanged(_, name, level, at):
                self._raw[name] = int(level)
                if int(level) != self._given.get(name):
                    self._give(name, int(level), at + self._shift)
            case Stopped():
                ledger = self._by_stepper[event.stepper]
                if ledger.standing is Standing.DRIVEN and ledger.awaits is not None:
                    self._stopped_too(ledger, event)
                elif ledger.standing is Standing.DRIVEN and event.dry:
                    self._ran_dry(event)
                elif ledger.standing is Standing.DRIVEN and event.input in self.plan.inputs:
                    self._stopped(event)
                elif ledger.standing is Standing.DRIVEN:
                    self._fault(ledger, "the board has stopped it, and does not say why")
                    self._place(ledger, event.shaft)
                else:  # steps that had left when it failed have met a switch
                    ledger.guard.fired()
                    self._place(ledger, event.shaft)
                self._heard(event.levels)
            case Later(_, stepper, at, _):
                self._later(self._by_stepper[stepper], at)
            case Slipped(_, stepper, at, by):
                ledger = self._by_stepper[stepper]
                self._later(ledger, at)
                slips = ledger.stepper.slips
                who = stepper if len(ledger.stepper.of.axes) == 1 else ledger.what.unit
                what = f"{who} slipped by {show_duration(by)}: the computer was late; no step is lost"
                self._say(Weight.WARNING, f"{what} ({slips} {'slip' if slips == 1 else 'slips'} so far)")
            case CountDiffers(_, stepper, shaft, counted):
                ledger = self._by_stepper[stepper]
                if ledger.standing is Standing.DRIVEN:
                    self._fault(ledger, f"the board has counted {counted} where the cell has {shaft}")
                    self._place(ledger, counted)
            case CountEnds(board, stepper):
                ledger = self._by_stepper[stepper]
                what = f"board {board} counts no further than 2^30 steps, and was stopped there"
                remedy = "switch the board off and on, recover, and send it home"
                if ledger.standing is Standing.FAULT:
                    self._say(Weight.FAULT, f"{ledger.name}: {what}, so nobody knows where the motor stands; {remedy}")
                else:
                    self._fault(ledger, f"{what}, so nobody knows where the motor stands: {remedy}", known=False)
                ledger.lost, ledger.known = True, False
            case ShutDown(board, reason):
                if reason != BY_HAND:  # `stop` has said so itself
                    self._board_failed(board, f"board {board} has shut down: {reason}", None)
            case Lost(board, reason):
                self._board_failed(board, f"board {board} is gone: {reason}", "sent")
            case Recovered():
                self._recovered(event)
            case DriverFault(_, driver, reason):
                for ledger in self.ledgers:
                    if ledger.what.driver == driver and ledger.standing is not Standing.FAULT:
                        self._fault(ledger, f"its driver: {reason}", known=False)
            case DriverSet(_, driver, what):
                self._say(Weight.NOTE, f"{driver}: {what}")
            case Refusal(board, item, key, text):
                problem = self.plan.problem(SetupProblem(item or board, key, text))
                self._board_failed(board, str(problem), None)
            case Ready():
                pass  # it was, before anything began

    def _later(self, ledger: AxisLedger, at: Ns) -> None:
        """Pulses from `at` on come later: so do the outputs of the unit."""
        unit = self.cell.unit(ledger.what.unit)
        for out in self._outs.values():
            after = [item for item in out.levels.before(out.levels.count) if item[0] >= at]
            if out.unit == unit and after:
                self.boards.outs[out.name].rewind(at)
                for when, level in after:
                    self._set(out, level, when)

    def _board_failed(self, board: str, why: str, position: str | None) -> None:
        mine = [ledger for ledger in self.ledgers if ledger.what.board == board]
        stood = all(ledger.standing is Standing.FAULT for ledger in mine)
        for ledger in mine:
            if ledger.standing is not Standing.FAULT:
                self._fault(ledger, why, known=False)
                if position is not None:
                    self._place(ledger, ledger.stepper.shaft)
            else:
                ledger.why, ledger.known = why, False
        if stood:  # a recovery that came to nothing, or a board that failed in another way meanwhile
            who = f"{', '.join(ledger.name for ledger in mine)} still stands: " if mine else ""
            self._say(Weight.FAULT, f"{who}{why}; mend that, then recover")

    def _fault(self, ledger: AxisLedger, why: str, *, known: bool = True) -> None:
        """An axis does not move any more: its unit is halted, and told so whenever it tries."""
        first = ledger.standing is not Standing.FAULT
        self.cell.halt(ledger.what.unit)
        self._absorb()  # the stepper is told, while it still is
        ledger.standing, ledger.why, ledger.known = Standing.FAULT, why, known and not ledger.lost
        ledger.guard.want({}, self.cell.now, self.cell.now)  # what has left is watched until it is over
        self.past.clear()
        if first:
            self._say(Weight.FAULT, f"{ledger.name} stands: {why}; look at the machine, then recover")

    def _place(self, ledger: AxisLedger, shaft: int) -> None:
        """The motor stands at `shaft`: so the counters say, too."""
        by = shaft - ledger.shaft_at(self.cell.now)
        if by:
            self.cell.displace(ledger.what.unit, ledger.what.axis, by)
            ledger.displace(by)
            self._absorb()

    def stop(self) -> None:
        """Emergency stop: every board stops at once, and every axis stands until `recover`."""
        self.boards.emergency_stop(self._wall())
        for ledger in self.ledgers:
            if ledger.standing is Standing.DRIVEN:
                self._fault(ledger, BY_HAND, known=False)

    def abandon(self, why: str) -> None:
        """The cell cannot go on: every board stops at once, for good."""
        self.boards.emergency_stop(self._wall())
        self._stores.flush(NEVER)
        for ledger in self.ledgers:
            ledger.standing, ledger.why, ledger.known = Standing.FAULT, why, False
            ledger.guard.release()
        self.abandoned, self._pending = True, False

    def recover(self) -> list[str]:
        """Go on from where the motors stand: boards are made ready again. The axes whose board is waited for."""
        waits = []
        failed = {b for b, board in self.boards.boards.items() if board.state.value not in ("ready",)}
        for ledger in self.ledgers:
            if ledger.standing is Standing.FAULT and ledger.what.board not in failed:
                self._go_on(ledger, ledger.shaft_at(self.cell.now))
            elif ledger.standing is Standing.FAULT:
                waits.append(ledger.name)
        if failed:
            self.boards.recover(self._wall())
        return waits

    def _recovered(self, event: Recovered) -> None:
        now = self.clock()
        self.boards.align(now - self._align, now - self._shift)
        for ledger in self.ledgers:
            if ledger.what.board != event.board:
                continue
            if ledger.standing is not Standing.FAULT:
                self._fault(ledger, f"board {event.board} began anew", known=False)
            shaft = event.shafts.get(ledger.name)
            if shaft is None:
                what = f"{ledger.name}: board {event.board} was restarted, and nobody knows where the motor stands"
                self._say(Weight.WARNING, f"{what}: send it home before anything else")
                ledger.stepper.adopt(ledger.shaft_at(self.cell.now))
                ledger.lost = True
            else:
                self._place(ledger, shaft)
                ledger.stepper.rewind(shaft)
                what = f"{ledger.name} goes on at {shaft}, as the board has counted"
                unsure = "the motor may have lost steps when it was stopped"
                if ledger.lost:
                    unsure = "since the restart nobody knows where the motor stands"
                self._say(Weight.WARNING, f"{what}; {unsure}")
            self._driven_again(ledger)
        for name, level in event.inputs.items():
            self._raw[name] = int(level)
            if self._given.get(name) != int(level):
                self._give(name, int(level), self.clock())
        self.past.keep()

    def _go_on(self, ledger: AxisLedger, shaft: int) -> None:
        unsure = "" if ledger.known else "; the motor may have lost steps while it stood"
        ledger.stepper.rewind(shaft)
        self._driven_again(ledger)
        self._say(Weight.WARNING if unsure else Weight.NOTE, f"{ledger.name} goes on at {shaft}{unsure}")

    def _driven_again(self, ledger: AxisLedger) -> None:
        ledger.guard.release()
        ledger.standing, ledger.why, ledger.known, ledger.awaits = Standing.DRIVEN, "", not ledger.lost, None
        unit = self.cell.unit(ledger.what.unit)
        for out in self._outs.values():
            levels = out.levels.before(out.levels.count)
            if out.unit == unit and levels:
                self.boards.outs[out.name].now(levels[-1][1])
        self._command(ledger)
        self._pending = True

    def _not_written(self, unit: str) -> None:
        what = f"the memory of {unit} could not be written, after it had answered that it was"
        self._say(Weight.WARNING, f"{what}: at the next start it has what it kept before")
