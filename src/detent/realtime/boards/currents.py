"""The currents of driven motors: what a controller commands of its power stage, on its way to a driver or a pin."""

from collections.abc import Callable, Iterable

from detent.cell.cell import Cell
from detent.controllers.device import DriveSet, Stage, StageSet
from detent.realtime.boards.axis_ledger import AxisLedger
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.plan import Plan
from detent.realtime.boards.setup import SetupProblem
from detent.realtime.boards.states import Standing, Weight


class Currents:
    """Of all driven axes. `say` tells people, `refused` is told of an axis whose driver cannot do what is commanded."""

    def __init__(self, cell: Cell, boards: Boards, plan: Plan, say: Callable[[Weight, str], None]) -> None:
        self._cell, self._boards, self._plan, self._say = cell, boards, plan, say
        self.refused: Callable[[AxisLedger, str], None] = lambda ledger, why: None
        self._stages: dict[str, Stage] = {}
        self._halved: dict[str, bool] = {}  # whether a plain driver is told to give half of its current

    def begin(self, ledger: AxisLedger) -> None:
        """Its driver has what the cell file says."""
        if ledger.what.stage is not None:
            self._stages[ledger.name] = ledger.what.stage
            self.command(ledger)

    def staged(self, ledgers: Iterable[AxisLedger], entry: StageSet | DriveSet) -> None:
        """A unit, whose axes are `ledgers`, has commanded something of a power stage."""
        stage = entry.stage if isinstance(entry, StageSet) else getattr(entry.drive, "stage", None)
        for ledger in ledgers:
            if ledger.what.axis == entry.axis and stage is not None and self._stages.get(ledger.name) != stage:
                self._stages[ledger.name] = stage
                self.command(ledger)

    def command(self, ledger: AxisLedger) -> None:
        """Tell the driver of an axis its current, whatever it was told before."""
        self._halved.pop(ledger.name, None)
        stage = self._stages.get(ledger.name)
        if stage is None or not ledger.what.driver:
            return
        driver = self._boards.drivers[ledger.what.driver]
        asked, most = max(stage.run, stage.hold), driver.setup.amperes
        if stage.chops and most is not None and asked > most and ledger.limited != asked:
            ledger.limited = asked
            what = f"{ledger.what.unit} commands {asked:g} A a phase"
            self._say(Weight.NOTE, f"{ledger.name}: {what}, and its driver gives {most:g} A (amperes)")
        try:
            driver.command(stage)
        except SetupProblem as problem:
            self.refused(ledger, str(self._plan.problem(problem)))

    def halve(self, ledgers: Iterable[AxisLedger]) -> bool:
        """Tell plain drivers whether half of the current is enough: from before the first step to behind the last.

        Whether any was told something new.
        """
        now, told = self._cell.now, False
        for ledger in ledgers:
            if not ledger.what.half or ledger.standing is Standing.FAULT:
                continue
            stage = self._stages.get(ledger.name)
            over = ledger.rested is not None and now >= ledger.rested + self._plan.lead + ledger.stepper.behind(now)
            if stage is None:
                half = over
            else:
                holds = (
                    over and stage.settling > 0 and ledger.rested is not None and now >= ledger.rested + stage.settling
                )
                full = max(stage.run, stage.hold) if stage.chops else 1.0
                half = (stage.hold if holds else stage.run) <= full / 2
            if self._halved.get(ledger.name) is not half:
                self._halved[ledger.name] = half
                self._boards.outs[ledger.what.half].now(half)
                told = True
        return told
