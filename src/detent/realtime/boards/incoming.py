"""What comes from the boards: each event, and who deals with it."""

from detent.realtime.boards.events import (
    BY_HAND,
    CountDiffers,
    CountEnds,
    DriverFault,
    DriverSet,
    Event,
    InputChanged,
    Lost,
    OutputLate,
    Ready,
    Recovered,
    Refusal,
    ShutDown,
    Slipped,
    Stopped,
)
from detent.realtime.boards.faults import Faults
from detent.realtime.boards.outgoing import Outgoing
from detent.realtime.boards.rollback import Rollback
from detent.realtime.boards.setup import SetupProblem
from detent.realtime.boards.states import Severity, Standing
from detent.ticks import show_duration


class Incoming:
    """The events of all boards."""

    def __init__(self, outgoing: Outgoing, faults: Faults, rollback: Rollback) -> None:
        self._outgoing, self._faults, self._rollback = outgoing, faults, rollback
        self._by_stepper = outgoing.by_stepper

    def happened(self, event: Event) -> None:
        """Deal with an event."""
        match event:
            case InputChanged(_, name, level, _):
                self._found(name, level)
            case Stopped():
                ledger = self._by_stepper[event.stepper]
                if ledger.standing is Standing.DRIVEN and ledger.awaits is not None:
                    self._rollback.stopped_too(ledger, event)
                elif ledger.standing is Standing.DRIVEN and event.dry:
                    self._rollback.ran_dry(event)
                elif ledger.standing is Standing.DRIVEN and event.input in self._outgoing.plan.inputs:
                    self._rollback.stopped(event)
                elif ledger.standing is Standing.DRIVEN:
                    self._faults.fault(ledger, "the board has stopped it, and does not say why")
                    self._faults.place(ledger, event.shaft)
                else:  # steps that had left when it failed have met a switch
                    ledger.guard.fired()
                    self._faults.place(ledger, event.shaft)
                for name, level in event.levels.items():  # they were asked for, and no report tells them again
                    self._found(name, level)
            case Slipped(_, stepper, _, by):
                ledger = self._by_stepper[stepper]
                slips = ledger.stepper.slips
                who = stepper if len(ledger.stepper.of.axes) == 1 else ledger.what.unit
                what = f"{who} slipped by {show_duration(by)}: the computer was late; no step is lost"
                self._outgoing.say(Severity.WARNING, f"{what} ({slips} {'slip' if slips == 1 else 'slips'} so far)")
            case OutputLate(_, out, _, by):
                self._outgoing.say(Severity.WARNING, f"{out} changed {show_duration(by)} late: the computer was late")
            case CountDiffers(_, stepper, shaft, counted):
                ledger = self._by_stepper[stepper]
                if ledger.standing is Standing.DRIVEN:
                    self._faults.fault(ledger, f"the board has counted {counted} where the cell has {shaft}")
                    self._faults.place(ledger, counted)
            case CountEnds(board, stepper):
                ledger = self._by_stepper[stepper]
                what = f"board {board} counts no further than 2^30 steps, and was stopped there"
                remedy = "switch the board off and on, recover, and send it home"
                if ledger.standing is Standing.FAULT:
                    self._outgoing.say(
                        Severity.FAULT, f"{ledger.name}: {what}, so nobody knows where the motor stands; {remedy}"
                    )
                else:
                    self._faults.fault(ledger, f"{what}, so nobody knows where the motor stands: {remedy}", known=False)
                ledger.lost, ledger.known = True, False
            case ShutDown(board, reason):
                if reason != BY_HAND:  # `stop` has said so itself
                    self._faults.board_failed(board, f"board {board} has shut down: {reason}")
            case Lost(board, reason):
                self._faults.board_failed(board, f"board {board} is gone: {reason}", gone=True)
            case Recovered():
                self._faults.recovered(event)
            case DriverFault(_, driver, reason):
                for ledger in self._outgoing.ledgers:
                    if ledger.what.driver == driver and ledger.standing is not Standing.FAULT:
                        self._faults.fault(ledger, f"its driver: {reason}", known=False)
            case DriverSet(_, driver, what):
                self._outgoing.say(Severity.NOTE, f"{driver}: {what}")
            case Refusal(board, item, key, text):
                problem = self._outgoing.plan.problem(SetupProblem(item or board, key, text))
                self._faults.board_failed(board, str(problem))
            case Ready():
                pass  # it was, before anything began

    def _found(self, name: str, level: bool) -> None:
        """An input has this level; the cell gets it, if it has another one."""
        if self._outgoing.inputs.differs(name, int(level)):
            self._outgoing.give(name, int(level))
