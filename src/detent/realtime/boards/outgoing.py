"""What a cell does, on its way out: motions to steppers, levels to outputs, currents to drivers, words to hosts.

Everything is numbered as it is told, so that it can be taken back; and whatever moves, the firmware watches the inputs
that would cut it.
"""

from collections.abc import Callable, Mapping, Sequence

from detent.axis import Displaced, MotionCut, MotionEnded, MotionStarted
from detent.cell.cell import Cell
from detent.cell.recording import Batch
from detent.controllers.device import DriveSet, Powered, StageSet
from detent.pins import Level, PinSet
from detent.realtime.boards.axis_ledger import AxisLedger
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.cell_clock import CellClock
from detent.realtime.boards.cell_inputs import CellInputs
from detent.realtime.boards.certainty import Certainty
from detent.realtime.boards.channels import Channel
from detent.realtime.boards.currents import Currents
from detent.realtime.boards.guard import Guard
from detent.realtime.boards.past import Past
from detent.realtime.boards.plan import Plan
from detent.realtime.boards.replies import HeldLine, HeldStores
from detent.realtime.boards.states import News, Severity, Standing
from detent.realtime.pace import Pace, WallNs
from detent.ticks import MS, NEVER, Ns

KEEP: Ns = 50 * MS  # at least between two moments to which the cell can be taken back, while a stop is armed
KEEP_QUIET: Ns = 500 * MS  # where less happens than
BUSY = 32  # instants: what has to be lived through again from a moment on


class CellOutput:
    """An output pin of a unit on a board: what the cell made of it is a channel."""

    def __init__(self, name: str, unit: int) -> None:
        self.name, self.unit = name, unit
        self.levels: Channel[tuple[Ns, bool]] = Channel()

    @property
    def level(self) -> bool:
        """What it is at in the cell."""
        return self.levels.before(self.levels.count)[-1][1]


class Outgoing:
    """`cell` and its boards: all that those share who drive the one by the other.

    `ledgers` are the driven axes, `outputs` the outputs, `lines` what hosts hear, `past` the moments to which the cell
    can be taken back. See `driven.Driven` for what is given.
    """

    def __init__(
        self,
        cell: Cell,
        boards: Boards,
        plan: Plan,
        stores: HeldStores,
        wall: Callable[[], WallNs],
        tell: Callable[[News], None],
    ) -> None:
        assert cell.recording is not None
        self.cell, self.boards, self.plan, self.stores, self.wall, self._tell = cell, boards, plan, stores, wall, tell
        self.outputs: dict[tuple[int, str], CellOutput] = {
            (cell.unit(unit), pin): CellOutput(name, cell.unit(unit)) for (unit, pin), name in plan.outputs.items()
        }
        self.ledgers = [
            AxisLedger(what, boards.steppers[what.stepper], Guard(boards.stops[what.stepper]), what.shaft)
            for what in plan.axes
        ]
        for owner, pin in plan.outputs:
            cell.parts[cell.unit(owner)].watch(pin)  # of a winding, or of a pulse, every level is told
        self.by_stepper = {ledger.name: ledger for ledger in self.ledgers}
        self._of_unit: dict[int, list[AxisLedger]] = {}
        for ledger in self.ledgers:
            self._of_unit.setdefault(cell.unit(ledger.what.unit), []).append(ledger)
            if ledger.what.enable:
                unit = cell.unit(ledger.what.unit)
                self.outputs[unit, ledger.what.enable] = CellOutput(ledger.what.enable, unit)
        self.clock = CellClock(boards, wall)
        self.inputs = CellInputs(cell, plan)
        self.certainty = Certainty(cell, boards, plan, self.ledgers, wall)
        self.currents = Currents(boards, plan, self.certainty.told, self.say)
        self.lines = [HeldLine(cell, number, self._telling) for number in range(len(cell.lines))]
        self.past = Past(cell, self._counts)
        self.committed: WallNs = 0
        self.pending = True  # something was told that no commit has followed
        self.instants = 0  # eventful ones since the last moment was kept
        self.living_again = False
        stores.now, stores.holding = lambda: cell.now, lambda: self.living_again or self.certainty.may_stop()

    def begin(self, pace: Pace, levels: Mapping[str, Level]) -> None:
        """The cell's present is the boards' present; `levels` are those of the inputs that it was built with."""
        self.inputs.begin(levels)
        self.clock.align(pace, self.cell.now)
        for ledger in self.ledgers:
            ledger.stepper.adopt(ledger.shaft_at(self.cell.now))
            ledger.standing = Standing.DRIVEN
        for unit, pin in self.outputs:
            self._level(unit, pin, False, self.cell.now, tell=False)  # until the recording tells better
        self.absorb()
        for out in self.outputs.values():
            if out.levels.count == 1:  # it has nothing to tell
                self.set(out, False, self.cell.now, fresh=True)
        self.past.keep()

    def commit(self) -> None:
        """Give the boards what is certain, at once."""
        self.currents.follow(self.ledgers)  # steps that need it leave now, and nobody knows when this goes on
        self.committed = self.wall()
        self.boards.commit(self.cell.now, self.committed, self.wall)
        self.pending = False

    def say(self, severity: Severity, text: str) -> None:
        """Tell people, once."""
        self._tell(News(self.cell.now, severity, text))

    @property
    def held_since(self) -> Ns:
        """When the cell said the first word, or stored the first image, that waits until it is certain; NEVER: none."""
        return min(self.stores.first, *(line.first for line in self.lines), NEVER)

    def _telling(self) -> Ns:
        """What the cell said up to then may leave: nothing that was said behind an image which has yet to be stored."""
        return min(self.certainty.horizon(), self.stores.first - 1)

    def _counts(self) -> tuple[int, ...]:
        return (
            *(ledger.motions.count for ledger in self.ledgers),
            *(out.levels.count for out in self.outputs.values()),
            *(line.count for line in self.lines),
            *(ledger.stages.count for ledger in self.ledgers),
            self.stores.count,
        )

    def absorb(self) -> None:
        """Take over what the cell did, tell the boards of it, and arm what would stop it."""
        changed = self.take(self.batches(), tell=True)
        for line in self.lines:
            line.absorb()
        if not changed:
            return
        self.pending = True
        self.hold()
        self.arm()

    def hold(self) -> None:
        """No axis at fault moves: its unit is halted."""
        at_fault = {
            ledger.what.unit
            for ledger in self.ledgers
            if ledger.standing is Standing.FAULT and ledger.motion is not None
        }
        for unit in at_fault:
            self.cell.halt(unit)
        if at_fault:
            self.take(self.batches(), tell=True)

    def batches(self) -> Sequence[Batch]:
        """What the cell has recorded since the last call."""
        assert self.cell.recording is not None
        return self.cell.recording.take()

    def take(self, batches: Sequence[Batch], *, tell: bool) -> bool:
        """Note what the units did, and tell the boards. Whether anything that concerns them is among it."""
        found = False
        for unit, entries in batches:
            ledgers = self._of_unit.get(unit)
            for entry in entries:
                if isinstance(entry, (MotionStarted, MotionCut, MotionEnded)):
                    for ledger in ledgers or ():
                        if ledger.what.axis == entry.axis:
                            ledger.take(entry)
                            found = True
                            if tell and ledger.standing is not Standing.FAULT:
                                ledger.stepper.tell(entry)
                                if isinstance(entry, MotionStarted) and entry.first == 1:
                                    self.currents.hold(ledger)
                elif isinstance(entry, Displaced):
                    for ledger in ledgers or ():
                        if ledger.what.axis == entry.axis:
                            ledger.displace(entry.shaft - ledger.shaft_at(entry.at))
                elif isinstance(entry, PinSet):
                    if (unit, entry.pin) in self.outputs:
                        self._level(unit, entry.pin, bool(entry.level), entry.at, tell=tell)
                        found = True
                elif isinstance(entry, Powered):
                    self._powered(unit, entry, tell=tell)
                    found = True
                elif isinstance(entry, (StageSet, DriveSet)):
                    for ledger in ledgers or ():
                        if ledger.what.axis == entry.axis:
                            ledger.staged(entry.at, entry.stage)
            found = found or ledgers is not None
        return found

    def _powered(self, unit: int, entry: Powered, *, tell: bool) -> None:
        for ledger in self.of_unit(unit):
            if ledger.what.enable:
                self._level(unit, ledger.what.enable, entry.on, entry.at, tell=tell)
        if not entry.on:
            controller = self.cell.parts[unit]
            rests = {pin.name: pin for pin in controller.pins}
            for place, pin in list(self.outputs):
                if place == unit and pin in rests:
                    self._level(unit, pin, self._off(out=self.outputs[unit, pin]), entry.at, tell=tell)

    def _off(self, out: CellOutput) -> bool:
        for setup, _ in self.plan.setups:
            for each in setup.outputs:
                if each.name == out.name:
                    return each.off
        return False

    def _level(self, unit: int, pin: str, level: bool, at: Ns, *, tell: bool = True) -> None:
        out = self.outputs[unit, pin]
        out.levels.append((at, level))
        if tell:
            self.set(out, level, at, fresh=True)

    def set(self, out: CellOutput, level: bool, at: Ns, *, fresh: bool = False) -> None:
        """An output takes a level at cell time `at`; where that is late, and `fresh`, a late computer is to blame."""
        if self._withheld(out):
            return
        ledgers = self._of_unit.get(out.unit)
        lag = ledgers[0].stepper.of.changed(at) if ledgers else 0
        self.boards.outputs[out.name].set(level, at, lag, fresh=fresh)
        self.pending = True

    def set_anew(self, out: CellOutput, count: int, at: Ns) -> None:
        """The board has an output as it was at `at`, behind its first `count` levels, and is told of those since."""
        if self._withheld(out):
            return
        self.boards.outputs[out.name].rewind(at, out.levels.before(count)[-1][1])
        for when, level in out.levels.since(count):
            self.set(out, level, when)

    def set_now(self, out: CellOutput) -> None:
        """An output takes the level that it has in the cell, as soon as may be: nobody knows which one it had."""
        if not self._withheld(out):
            self.boards.outputs[out.name].now(out.level)
            self.pending = True

    def _withheld(self, out: CellOutput) -> bool:
        """Whether an output is not changed, whatever the cell says: it enables the driver of an axis at fault."""
        ledgers = self._of_unit.get(out.unit, ())
        return any(ledger.what.enable == out.name and ledger.standing is Standing.FAULT for ledger in ledgers)

    def arm(self) -> None:
        """Let the firmware watch the inputs that would cut what is under way."""
        now, kept = self.cell.now, False
        for ledger in self.ledgers:
            if ledger.standing is not Standing.DRIVEN:
                continue
            motion, inputs = ledger.motion, self.cuts(ledger)
            if inputs != ledger.guard.wanted:
                at = motion.at if motion is not None and not ledger.guard.armed else now
                ledger.guard.want(inputs, at, now)
                self.pending = True
                kept = kept or bool(inputs)
        if kept or (self.certainty.guarded and self._worn(now)):
            self.past.keep()
            self.instants = 0

    def _worn(self, now: Ns) -> bool:
        """Whether the newest moment that was kept is too long ago to live on from quickly."""
        if self.past.worn:
            return True
        away = now - self.past.moments[-1].now
        return away >= (KEEP if self.instants >= BUSY else KEEP_QUIET)

    def cuts(self, ledger: AxisLedger) -> dict[str, Level]:
        """The inputs of its board that would cut what an axis does now."""
        inputs: dict[str, Level] = {}
        if ledger.motion is not None:
            for stop in self.cell.controller(ledger.what.unit).cuts(self.cell.now, ledger.what.axis):
                name = self.inputs.name_of.get((ledger.what.unit, stop.pin))
                if name is not None and self.plan.board_of[name] == ledger.what.board:
                    inputs[name] = stop.level
        return inputs

    def refresh(self) -> None:
        """Let go what watched pulses that have left, and arm what would cut what is under way."""
        for ledger in self.ledgers:
            if ledger.guard.next < self.certainty.left(ledger):
                ledger.guard.refresh(self.certainty.left(ledger), self.cell.now)
        self.arm()

    def give(self, name: str, level: Level) -> None:
        """An input has another level, as far as the cell is concerned from now on."""
        self.inputs.give(name, level)
        self.absorb()

    def of_unit(self, unit: int) -> Sequence[AxisLedger]:
        """The driven axes of a unit."""
        return self._of_unit.get(unit, ())
