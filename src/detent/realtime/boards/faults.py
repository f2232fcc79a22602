"""What becomes of axes when something fails: they stand until somebody says recover."""

from detent.realtime.boards.axis_ledger import AxisLedger
from detent.realtime.boards.events import BY_HAND, Recovered
from detent.realtime.boards.outgoing import Outgoing
from detent.realtime.boards.states import Severity, Standing
from detent.ticks import NEVER


class Faults:
    """An axis at fault is halted in the cell too, so that no counter says what no motor did."""

    def __init__(self, outgoing: Outgoing) -> None:
        self._outgoing = outgoing
        self._cell, self._boards, self._ledgers = outgoing.cell, outgoing.boards, outgoing.ledgers
        self._past = outgoing.past
        self.abandoned = False  # the cell cannot go on, and so nothing is done for it any more
        outgoing.stores.failed = self._not_written
        outgoing.currents.refused = self.fault

    def board_failed(self, board: str, why: str, *, gone: bool = False) -> None:
        """All axes of a board stand. `gone`: the steps that were sent count as made."""
        mine = [ledger for ledger in self._ledgers if ledger.what.board == board]
        stood = all(ledger.standing is Standing.FAULT for ledger in mine)
        for ledger in mine:
            if ledger.standing is not Standing.FAULT:
                self.fault(ledger, why, known=False)
                if gone:
                    self.place(ledger, ledger.stepper.shaft)
            else:
                ledger.why, ledger.known = why, False
        if stood:  # a recovery that came to nothing, or a board that failed in another way meanwhile
            who = f"{', '.join(ledger.name for ledger in mine)} still stands: " if mine else ""
            self._outgoing.say(Severity.FAULT, f"{who}{why}; mend that, then recover")

    def fault(self, ledger: AxisLedger, why: str, *, known: bool = True) -> None:
        """An axis does not move any more: its unit is halted, and told so whenever it tries."""
        first = ledger.standing is not Standing.FAULT
        self._cell.halt(ledger.what.unit)
        self._outgoing.absorb()  # the stepper is told, while it still is
        ledger.standing, ledger.why, ledger.known = Standing.FAULT, why, known and not ledger.lost
        ledger.guard.want({}, self._cell.now, self._cell.now)  # what has left is watched until it is over
        ledger.barred = self._cell.now
        if first:
            self._outgoing.say(Severity.FAULT, f"{ledger.name} stands: {why}; look at the machine, then recover")

    def place(self, ledger: AxisLedger, shaft: int) -> None:
        """The motor stands at `shaft`: so the counters say, too."""
        by = shaft - ledger.shaft_at(self._cell.now)
        if by:
            self._cell.displace(ledger.what.unit, ledger.what.axis, by)
            self._outgoing.absorb()
        ledger.barred = self._cell.now

    def stop(self) -> None:
        """Emergency stop: every board stops at once, and every axis stands until `recover`.

        What waits to be sent to units is dropped: it was said before, and would be heard when they go on.
        """
        self._boards.emergency_stop(self._outgoing.wall())
        for number, line in enumerate(self._cell.lines):
            if not line.hosted:
                self._cell.discard(number)
        for ledger in self._ledgers:
            if ledger.standing is Standing.DRIVEN:
                self.fault(ledger, BY_HAND, known=False)

    def abandon(self, why: str) -> None:
        """The cell cannot go on: every board stops at once, for good."""
        self._boards.emergency_stop(self._outgoing.wall())
        self._outgoing.stores.flush(NEVER)
        for ledger in self._ledgers:
            ledger.standing, ledger.why, ledger.known = Standing.FAULT, why, False
            ledger.guard.release()
        self.abandoned, self._outgoing.pending = True, False

    def recover(self) -> list[str]:
        """Go on from where the motors stand: boards are made ready again. The axes whose board is waited for."""
        waits = []
        failed = {b for b, board in self._boards.boards.items() if board.state.value not in ("ready",)}
        for ledger in self._ledgers:
            if ledger.standing is Standing.FAULT and ledger.what.board not in failed:
                self._go_on(ledger, ledger.shaft_at(self._cell.now))
            elif ledger.standing is Standing.FAULT:
                waits.append(ledger.name)
        if failed:
            self._boards.recover(self._outgoing.wall())
        return waits

    def recovered(self, event: Recovered) -> None:
        """A board is ready again: its axes go on from where it has counted, as far as anybody knows."""
        self._outgoing.clock.join()
        for ledger in self._ledgers:
            if ledger.what.board != event.board:
                continue
            if ledger.standing is not Standing.FAULT:
                self.fault(ledger, f"board {event.board} began anew", known=False)
            shaft = event.shafts.get(ledger.name)
            if shaft is None:
                what = f"{ledger.name}: board {event.board} was restarted, and nobody knows where the motor stands"
                self._outgoing.say(Severity.WARNING, f"{what}: send it home before anything else")
                ledger.stepper.adopt(ledger.shaft_at(self._cell.now))
                ledger.lost = True
            else:
                self.place(ledger, shaft)
                ledger.stepper.rewind(shaft)
                what = f"{ledger.name} goes on at {shaft}, as the board has counted"
                unsure = "the motor may have lost steps when it was stopped"
                if ledger.lost:
                    unsure = "since the restart nobody knows where the motor stands"
                self._outgoing.say(Severity.WARNING, f"{what}; {unsure}")
            self._driven_again(ledger)
        for out in self._outgoing.outputs.values():
            if out.name in self._boards.boards[event.board].outputs:
                self._outgoing.set_now(out)
        for name, level in event.inputs.items():
            if self._outgoing.inputs.differs(name, int(level)):
                self._outgoing.give(name, int(level))
        self._past.keep()

    def _go_on(self, ledger: AxisLedger, shaft: int) -> None:
        unsure = "" if ledger.known else "; the motor may have lost steps while it stood"
        ledger.stepper.rewind(shaft)
        self._driven_again(ledger)
        self._outgoing.say(Severity.WARNING if unsure else Severity.NOTE, f"{ledger.name} goes on at {shaft}{unsure}")

    def _driven_again(self, ledger: AxisLedger) -> None:
        ledger.guard.release()
        ledger.barred = self._cell.now
        ledger.standing, ledger.why, ledger.known, ledger.awaits = Standing.DRIVEN, "", not ledger.lost, None
        for out in self._outgoing.outputs.values():
            if out.name == ledger.what.enable:  # it was withheld
                self._outgoing.set_now(out)
        self._outgoing.currents.begin_again(ledger)
        self._outgoing.pending = True

    def _not_written(self, unit: str) -> None:
        what = f"the memory of {unit} could not be written, after it had answered that it was"
        self._outgoing.say(Severity.WARNING, f"{what}: at the next start it has what it kept before")
