"""The currents of driven motors: what a controller commands of its power stage, on its way to a driver or a pin.

It counts for the steps behind it: it is told when those before have left the pins, a lead later, and at once at rest.
"""

from collections.abc import Callable, Iterable

from detent.controllers.device import Stage
from detent.realtime.boards.axis_ledger import AxisLedger
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.plan import Plan
from detent.realtime.boards.setup import SetupProblem
from detent.realtime.boards.states import Severity, Standing
from detent.ticks import MS, NEVER, Ns

SETTING: Ns = 25 * MS  # what a chip takes at most to be told of other microsteps: five registers, and a batch before


class Currents:
    """Of all driven axes. `say` tells people, `refused` is told of an axis whose driver cannot do what is commanded."""

    def __init__(
        self, boards: Boards, plan: Plan, told: Callable[[], Ns], say: Callable[[Severity, str], None]
    ) -> None:
        """`told`: the cell time up to which everything is known of the pins."""
        self._boards, self._plan, self._told, self._say = boards, plan, told, say
        self.refused: Callable[[AxisLedger, str], None] = lambda ledger, why: None
        self._stages: dict[str, Stage] = {}  # as drivers were told
        self.next: Ns = NEVER  # something else counts when the pins are at this cell time
        self._halved: dict[str, bool] = {}  # whether a plain driver is told to give half of its current

    def begin_again(self, ledger: AxisLedger) -> None:
        """Its driver has what the board gave it: whatever it was told before is told once more."""
        self._stages.pop(ledger.name, None)
        self._halved.pop(ledger.name, None)

    def follow(self, ledgers: Iterable[AxisLedger]) -> bool:
        """Tell the drivers what counts at the pins by now. Whether any was told something new."""
        told = False
        for ledger in ledgers:
            if ledger.what.driver:
                told = self._command(ledger) or told
            if ledger.what.half and ledger.standing is not Standing.FAULT:
                told = self._halve(ledger) or told
        return told

    def hold(self, ledger: AxisLedger) -> None:
        """A motion begins: it waits for its driver, where that makes other microsteps behind the steps before it."""
        if not ledger.what.driver or not ledger.stages.count:
            return
        newest, before = ledger.stages.since(0)[-1], self._stage(ledger)
        if before is not None and (newest.stage.sequence, newest.stage.places) != (before.sequence, before.places):
            ledger.stepper.wait_behind(newest.behind, SETTING)

    def look(self, ledgers: Iterable[AxisLedger]) -> None:
        """Find `next`."""
        staged = [ledger for ledger in ledgers if ledger.stages.count]
        told = self._told() if staged else 0
        self.next = min((ledger.staged_next(told) for ledger in staged), default=NEVER)

    @property
    def due(self) -> bool:
        """Whether something else counts since `look`."""
        return self.next < NEVER and self.next <= self._told()

    def _stage(self, ledger: AxisLedger) -> Stage | None:
        return ledger.stage_at(self._told()) or ledger.what.stage

    def _command(self, ledger: AxisLedger) -> bool:
        """Tell the driver chip of an axis its currents and microsteps, if they are others than before."""
        stage = self._stage(ledger)
        if stage is None or self._stages.get(ledger.name) == stage:
            return False
        self._stages[ledger.name] = stage
        driver = self._boards.drivers[ledger.what.driver]
        asked, most = max(stage.run, stage.hold), driver.setup.amperes
        if stage.chops and most is not None and asked > most and ledger.limited != asked:
            ledger.limited = asked
            what = f"{ledger.what.unit} commands {asked:g} A a phase"
            self._say(Severity.NOTE, f"{ledger.name}: {what}, and its driver gives {most:g} A (amperes)")
        try:
            driver.command(stage)
        except SetupProblem as problem:
            self.refused(ledger, str(self._plan.problem(problem)))
        return True

    def _halve(self, ledger: AxisLedger) -> bool:
        """Tell a plain driver whether half of its current is enough: from before the first step to behind the last."""
        stage, now, rested = self._stage(ledger), self._told(), ledger.rested
        over = NEVER if rested is None else ledger.stepper.leaves(rested, now)
        if stage is None:
            half = over <= now
        else:
            holds = stage.settling > 0 and over + stage.settling <= now
            full = max(stage.run, stage.hold) if stage.chops else 1.0
            half = (stage.hold if holds else stage.run) <= full / 2
        if self._halved.get(ledger.name) is half:
            return False
        self._halved[ledger.name] = half
        self._boards.outputs[ledger.what.half].now(half)
        return True
