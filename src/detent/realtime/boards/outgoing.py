"""What a cell does, on its way out: motions to steppers, levels to outputs, currents to drivers, words to hosts.

Everything is numbered as it is told, so that it can be taken back; and whatever moves, the firmware watches the inputs
that would cut it.
"""

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.actions import SetPin
from detent.cell.cell import Cell
from detent.cell.recording import Batch
from detent.controllers.device import DriveSet, Powered, Stage, StageSet
from detent.pins import Level, PinSet
from detent.realtime.boards.axis_ledger import AxisLedger
from detent.realtime.boards.board import State
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.channels import Channel
from detent.realtime.boards.clock import Clock
from detent.realtime.boards.guard import Guard
from detent.realtime.boards.past import Past
from detent.realtime.boards.plan import Plan
from detent.realtime.boards.replies import HeldLine, HeldStores
from detent.realtime.boards.setup import SetupProblem
from detent.realtime.boards.states import News, Standing, Weight
from detent.realtime.pace import Pace, WallNs
from detent.ticks import MS, NEVER, Ns

CERTAIN: Ns = 5 * MS  # a stop is known so long after it happened, unless the computer was late
REPORTING: Ns = 1 * MS  # what a board takes to tell a stop, while it acknowledges something
KEEP: Ns = 50 * MS  # at least between two moments to which the cell can be taken back, while a stop is armed
KEEP_QUIET: Ns = 500 * MS  # where less happens than
BUSY = 32  # instants: what has to be lived through again from a moment on


class Out:
    """An output pin of a unit on a board: what the cell made of it is a channel."""

    def __init__(self, name: str, unit: int) -> None:
        self.name, self.unit = name, unit
        self.levels: Channel[tuple[Ns, bool]] = Channel()


class Outgoing:
    """`cell` and its boards. See `driven.Driven`, which is made of this and what stands on it."""

    def __init__(
        self,
        cell: Cell,
        boards: Boards,
        plan: Plan,
        stores: HeldStores,
        *,
        wall: Callable[[], WallNs] = time.monotonic_ns,
        tell: Callable[[News], None] = lambda news: None,
    ) -> None:
        assert cell.recording is not None
        self.cell, self.boards, self.plan, self._wall, self._tell = cell, boards, plan, wall, tell
        self._stores = stores
        stores.now, stores.holding, stores.failed = lambda: cell.now, self._may_stop, self._not_written
        self._outs: dict[tuple[int, str], Out] = {
            (cell.unit(unit), pin): Out(name, cell.unit(unit)) for (unit, pin), name in plan.outs.items()
        }
        self.ledgers = [
            AxisLedger(what, boards.steppers[what.stepper], Guard(boards.stops[what.stepper]), what.shaft)
            for what in plan.axes
        ]
        for owner, pin in plan.outs:
            cell.parts[cell.unit(owner)].watch(pin)  # of a winding, or of a pulse, every level is told
        self._given_at: dict[str, tuple[AxisLedger, Ns]] = {}  # which axis an input stopped last, and when
        self._by_stepper = {ledger.name: ledger for ledger in self.ledgers}
        self._of_unit: dict[int, list[AxisLedger]] = {}
        for ledger in self.ledgers:
            self._of_unit.setdefault(cell.unit(ledger.what.unit), []).append(ledger)
            if ledger.what.enable:
                unit = cell.unit(ledger.what.unit)
                self._outs[unit, ledger.what.enable] = Out(ledger.what.enable, unit)
        self._input_of = {place: name for name, place in plan.inputs.items()}
        self._raw: dict[str, Level] = {}  # as the boards last said
        self._given: dict[str, Level] = {}  # as the cell was told
        self._reports: deque[tuple[Ns, SetPin, Ns]] = deque(maxlen=256)  # what inputs gave, and the board's time of it
        self._align = 0  # of `clock` at cell time 0
        self._shift = 0  # of `clock` from the master's time
        self._clock: Clock | None = None  # of the master, as it was last looked at
        self._known: tuple[WallNs, Ns] = (wall(), 0)  # the last time that the master told
        self.lines = [HeldLine(cell, number, self._telling) for number in range(len(cell.lines))]
        self.past = Past(cell, self._counts)
        self._committed: WallNs = 0
        self._looked: WallNs = 0
        self._due: WallNs | None = 0  # when the boards want to be looked after, as the loop was told
        self._instants = 0  # eventful ones since the last moment was kept
        self._forgotten: Ns = 0
        self._pending = True  # something was told that no commit has followed
        self._stages: dict[str, Stage] = {}
        self._halved: dict[str, bool] = {}  # whether a plain driver is told to give half of its current
        self.on_moving: Callable[[bool], None] = lambda moving: None  # something begins to move, or all is at rest
        self.on_taken_back: Callable[[Ns], None] = lambda at: None  # what the cell did behind `at` did not happen
        self._was_moving = False
        self._stepped_by_pins: set[str] = set()  # units that are stepped by pulses on inputs with pins
        self.abandoned = False  # the cell cannot go on, and so nothing is done for it any more
        self.cut_short: frozenset[str] = frozenset()  # axes that moved when the end came
        self._over: WallNs | None = None  # since when their last steps have left
        self.escaped = 0  # characters that hosts heard though they were taken back
        self.rewinds = 0
        self.longest_rewind: WallNs = 0
        self.living_again = False

    def begin(self, pace: Pace, inputs: Mapping[str, Level]) -> None:
        """The cell's present is the boards' present; `inputs` are what the cell was built with."""
        self._raw, self._given = dict(inputs), dict(inputs)
        self.align(pace)
        for ledger in self.ledgers:
            ledger.stepper.adopt(ledger.shaft_at(self.cell.now))
            ledger.standing = Standing.DRIVEN
            if ledger.what.stage is not None:
                self._stages[ledger.name] = ledger.what.stage
                self._command(ledger)
        for unit, pin in self._outs:
            self._level(unit, pin, False, self.cell.now)  # until the recording tells better
        self._absorb()
        self.past.keep()

    def align(self, pace: Pace) -> None:
        """The cell's present is now."""
        pace.restart(self.cell.now)
        began = pace.due(self.cell.now)
        assert began is not None
        self._align = began - self.cell.now
        self.boards.align(self.cell.now, began - self._shift)

    def clock(self) -> Ns:
        """The time of the master board, for the pace of the cell; without it, the host's from there on.

        A board that comes back counts from elsewhere: its time is joined on to the one that went on meanwhile.
        """
        wall, master = self._wall(), self.boards.master
        now = self._known[1] + wall - self._known[0]
        if master.state in (State.READY, State.SHUT_DOWN):
            if master.core.clock is not self._clock:
                raw = self.boards.ns_at(wall)
                if self._clock is not None:
                    self._shift = now - raw
                    self.boards.align(now - self._align, raw)
                self._clock = master.core.clock
            now = self.boards.ns_at(wall) + self._shift
            self._known = wall, now
        return now

    def commit(self) -> None:
        """Give the boards what is certain, at once."""
        self._committed = self._wall()
        self.boards.commit(self.cell.now, self._committed, self._wall)
        self._pending = False

    @property
    def _guarded(self) -> bool:
        return any(ledger.guard.armed for ledger in self.ledgers)

    @property
    def lag(self) -> Ns:
        """How much later than the lead the pins are at present: the latest axis."""
        return max((ledger.stepper.behind(self.cell.now) for ledger in self.ledgers), default=0)

    @property
    def _behind(self) -> Ns:
        """So long after the cell said something it is certain."""
        return self.plan.lead + self.lag + CERTAIN if self.plan.held else 0

    def _horizon(self) -> Ns:
        """What the cell said up to then may leave."""
        return self._certain() if self.plan.held else self.cell.now

    def _telling(self) -> Ns:
        """What the cell said up to then may leave: nothing that was said behind an image which has yet to be stored."""
        return min(self._horizon(), self._stores.first - 1)

    def _certain(self) -> Ns:
        """What the cell did up to then is certain: no stop can be earlier that is not known."""
        left = min((self._left(ledger) for ledger in self.ledgers), default=self.cell.now - self.plan.lead)
        return left - max(CERTAIN, self._unheard())

    def _unheard(self) -> Ns:
        """How long ago a stop may have happened of which nothing was heard: what a late computer has yet to read."""
        heard = self.boards.heard()
        return 0 if heard is None else self._wall() - heard + REPORTING

    def _may_stop(self) -> bool:
        """Whether a stop may yet take back what the cell does now."""
        return self.living_again or self._guarded or self.boards.heard() is not None

    def _inquire(self) -> None:
        """Hear of what the boards did lately, where words or images wait for nothing else."""
        if not self.plan.held:
            return
        first = min(self._stores.first, *(line.first for line in self.lines), NEVER)
        if first < NEVER and first <= self.cell.now - self._behind and first > self._horizon():
            self.boards.inquire(self._wall())

    def _counts(self) -> tuple[int, ...]:
        return (
            *(ledger.motions.count for ledger in self.ledgers),
            *(out.levels.count for out in self._outs.values()),
            *(line.count for line in self.lines),
            self._stores.count,
        )

    def _absorb(self) -> None:
        """Take over what the cell did, tell the boards of it, and arm what would stop it."""
        changed = self._take(self._batches(), tell=True)
        for line in self.lines:
            line.absorb()
        if not changed:
            return
        self._pending = True
        at_fault = {
            ledger.what.unit
            for ledger in self.ledgers
            if ledger.standing is Standing.FAULT and ledger.motion is not None
        }
        for unit in at_fault:
            self.cell.halt(unit)
        if at_fault:
            self._take(self._batches(), tell=True)
        self._arm()

    def _batches(self) -> Sequence[Batch]:
        assert self.cell.recording is not None
        return self.cell.recording.take()

    def _take(self, batches: Sequence[Batch], *, tell: bool) -> bool:
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
                elif isinstance(entry, PinSet):
                    if (unit, entry.pin) in self._outs:
                        self._level(unit, entry.pin, bool(entry.level), entry.at, tell=tell)
                        found = True
                elif isinstance(entry, Powered):
                    self._powered(unit, entry, tell=tell)
                    found = True
                elif isinstance(entry, (StageSet, DriveSet)):
                    self._staged(unit, entry)
            found = found or ledgers is not None
        return found

    def _powered(self, unit: int, entry: Powered, *, tell: bool) -> None:
        for ledger in self._of_unit.get(unit, ()):
            if ledger.what.enable:
                self._level(unit, ledger.what.enable, entry.on, entry.at, tell=tell)
        if not entry.on:
            controller = self.cell.parts[unit]
            rests = {pin.name: pin for pin in controller.pins}
            for place, pin in list(self._outs):
                if place == unit and pin in rests:
                    self._level(unit, pin, self._off(out=self._outs[unit, pin]), entry.at, tell=tell)

    def _off(self, out: Out) -> bool:
        for setup, _ in self.plan.setups:
            for each in setup.outs:
                if each.name == out.name:
                    return each.off
        return False

    def _level(self, unit: int, pin: str, level: bool, at: Ns, *, tell: bool = True) -> None:
        out = self._outs[unit, pin]
        out.levels.append((at, level))
        if tell:
            self._set(out, level, at)

    def _set(self, out: Out, level: bool, at: Ns) -> None:
        ledgers = self._of_unit.get(out.unit, ())
        if any(ledger.what.enable == out.name and ledger.standing is Standing.FAULT for ledger in ledgers):
            return
        self.boards.outs[out.name].set(level, at, max((ledger.stepper.lag for ledger in ledgers), default=0))
        self._pending = True

    def _staged(self, unit: int, entry: StageSet | DriveSet) -> None:
        stage = entry.stage if isinstance(entry, StageSet) else getattr(entry.drive, "stage", None)
        for ledger in self._of_unit.get(unit, ()):
            if ledger.what.axis == entry.axis and stage is not None and self._stages.get(ledger.name) != stage:
                self._stages[ledger.name] = stage
                self._command(ledger)

    def _command(self, ledger: AxisLedger) -> None:
        """Tell the driver of an axis its current."""
        stage = self._stages.get(ledger.name)
        if stage is None:
            return
        if ledger.what.driver:
            driver = self.boards.drivers[ledger.what.driver]
            asked, most = max(stage.run, stage.hold), driver.setup.amperes
            if stage.chops and most is not None and asked > most and ledger.limited != asked:
                ledger.limited = asked
                what = f"{ledger.what.unit} commands {asked:g} A a phase"
                self._say(Weight.NOTE, f"{ledger.name}: {what}, and its driver gives {most:g} A (amperes)")
            try:
                driver.command(stage)
            except SetupProblem as problem:
                self._fault(ledger, str(self.plan.problem(problem)))

    def _currents(self) -> None:
        """Tell plain drivers whether half of the current is enough: from before the first step to behind the last."""
        now = self.cell.now
        for ledger in self.ledgers:
            if not ledger.what.half or ledger.standing is Standing.FAULT:
                continue
            stage = self._stages.get(ledger.name)
            over = ledger.rested is not None and now >= ledger.rested + self.plan.lead + ledger.stepper.behind(now)
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
                self.boards.outs[ledger.what.half].now(half)
                self._pending = True

    def _arm(self) -> None:
        """Let the firmware watch the inputs that would cut what is under way."""
        now, kept = self.cell.now, False
        for ledger in self.ledgers:
            if ledger.standing is not Standing.DRIVEN:
                continue
            motion, inputs = ledger.motion, self._cuts(ledger)
            if inputs != ledger.guard.wanted:
                at = motion.at if motion is not None and not ledger.guard.armed else now
                ledger.guard.want(inputs, at, now)
                self._pending = True
                kept = kept or bool(inputs)
        if kept or (self._guarded and self._worn(now)):
            self.past.keep()
            self._instants = 0

    def _worn(self, now: Ns) -> bool:
        """Whether the newest moment that was kept is too long ago to live on from quickly."""
        if not self.past.moments:
            return True
        away = now - self.past.moments[-1].now
        return away >= (KEEP if self._instants >= BUSY else KEEP_QUIET)

    def _cuts(self, ledger: AxisLedger) -> dict[str, Level]:
        """The inputs of its board that would cut what an axis does now."""
        inputs: dict[str, Level] = {}
        if ledger.motion is not None:
            for stop in self.cell.controller(ledger.what.unit).cuts(self.cell.now, ledger.what.axis):
                name = self._input_of.get((ledger.what.unit, stop.pin))
                if name is not None and self.plan.board_of[name] == ledger.what.board:
                    inputs[name] = stop.level
        return inputs

    def _left(self, ledger: AxisLedger) -> Ns:
        """The cell time up to which every pulse of an axis has left the pins: sent, and a lead and its lag ago."""
        due = ledger.stepper.next_pulse()
        sent = self.cell.now if due is None else min(due - 1, self.cell.now)
        return sent - self.plan.lead - ledger.stepper.behind(self.cell.now)

    def _refresh(self) -> None:
        for ledger in self.ledgers:
            if ledger.guard.next < self._left(ledger):
                ledger.guard.refresh(self._left(ledger), self.cell.now)
        self._arm()

    def _give(self, name: str, level: Level, board_ns: Ns) -> None:
        """An input has another level, as far as the cell is concerned from now on."""
        unit, pin = self.plan.inputs[name]
        self._given[name] = level
        self._reports.append((self.cell.now, SetPin(unit, pin, level), board_ns))
        self.cell.set_pin(unit, pin, level)
        self._absorb()

    def _say(self, weight: Weight, text: str) -> None:
        self._tell(News(self.cell.now, weight, text))

    def _fault(self, ledger: AxisLedger, why: str, *, known: bool = True) -> None:
        """An axis does not move any more."""
        raise NotImplementedError

    def _place(self, ledger: AxisLedger, shaft: int) -> None:
        """The motor of an axis stands at `shaft`."""
        raise NotImplementedError

    def _not_written(self, unit: str) -> None:
        """An image could not be stored after all."""
        raise NotImplementedError
