"""A cell that drives real pins: it stands between the loop and the cell, and between the cell and its boards.

Cell time is the board's time, and everything leaves a constant lead later. Only pulses that are certain are sent:
those of the cell's past. A stop in the firmware takes the cell back to the instant of the trigger: there it gets the
input, and lives through what follows once more. What cannot be taken back (replies, stored images) waits until it is
certain.
"""

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.cell import Cell
from detent.cell.deeds import Action, Deed, SetPin
from detent.cell.recording import Batch
from detent.controllers.device import DriveSet, Powered, Stage, StageSet
from detent.lines.line import Heard
from detent.pins import Level, PinSet
from detent.realtime.boards.axle import Axle, Motion
from detent.realtime.boards.board import State
from detent.realtime.boards.channels import Channel, alike
from detent.realtime.boards.clock import Clock
from detent.realtime.boards.events import (
    CountDiffers,
    DriverFault,
    DriverSet,
    Event,
    InputChanged,
    Lost,
    Ready,
    Recovered,
    Refusal,
    ShutDown,
    Slipped,
    Stopped,
)
from detent.realtime.boards.guard import Guard
from detent.realtime.boards.past import Moment, Past
from detent.realtime.boards.plan import Plan
from detent.realtime.boards.replies import HeldLine, HeldStores
from detent.realtime.boards.setup import SetupProblem
from detent.realtime.boards.several import COMMIT_EVERY, Boards
from detent.realtime.boards.states import AxisState, BoardState, News, Standing, Weight
from detent.realtime.pace import Pace, WallNs
from detent.ticks import MS, NEVER, Ns, show_duration
from detent.uart import Chars

CERTAIN: Ns = 5 * MS  # a stop is known so long after it happened
KEEP: Ns = 50 * MS  # between two moments to which the cell can be taken back, while a stop is armed
SLACK: Ns = 200 * MS  # a host that was stalled hears of a stop so late


class Out:
    """An output pin of a unit on a board: what the cell made of it is a channel."""

    def __init__(self, name: str, unit: int) -> None:
        self.name, self.unit = name, unit
        self.levels: Channel[tuple[Ns, bool]] = Channel()


class Driven:
    """`cell` behind its pins. It is served in the cell's place, and looks after the boards between two wake-ups.

    The cell was built with `stores.save` as its store, records, and nothing has happened to it since. The boards are
    ready. `tell` is told, once each, what people should know.
    """

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
        stores.now, stores.holding, stores.failed = lambda: cell.now, lambda: self._guarded, self._not_written
        self._outs: dict[tuple[int, str], Out] = {
            (cell.unit(unit), pin): Out(name, cell.unit(unit)) for (unit, pin), name in plan.outs.items()
        }
        self.axles = [
            Axle(what, boards.steppers[what.stepper], Guard(boards.stops[what.stepper]), what.shaft)
            for what in plan.axes
        ]
        for owner, pin in plan.outs:
            cell.parts[cell.unit(owner)].watch(pin)  # of a winding, or of a pulse, every level is told
        self._by_stepper = {axle.name: axle for axle in self.axles}
        self._of_unit: dict[int, list[Axle]] = {}
        for axle in self.axles:
            self._of_unit.setdefault(cell.unit(axle.what.unit), []).append(axle)
            if axle.what.enable:
                unit = cell.unit(axle.what.unit)
                self._outs[unit, axle.what.enable] = Out(axle.what.enable, unit)
        self._input_of = {place: name for name, place in plan.inputs.items()}
        self._raw: dict[str, Level] = {}  # as the boards last said
        self._given: dict[str, Level] = {}  # as the cell was told
        self._reports: deque[tuple[Ns, SetPin, Ns]] = deque(maxlen=256)  # what inputs gave, and the board's time of it
        self._align = 0  # of `clock` at cell time 0
        self._shift = 0  # of `clock` from the master's time
        self._clock: Clock | None = None  # of the master, as it was last looked at
        self._known: tuple[WallNs, Ns] = (wall(), 0)  # the last time that the master told
        self.lines = [HeldLine(cell, number, self._horizon) for number in range(len(cell.lines))]
        self.past = Past(cell, self._counts)
        self._committed: WallNs = 0
        self._pending = True  # something was told that no commit has followed
        self._stages: dict[str, Stage] = {}
        self._half: dict[str, tuple[bool, Ns]] = {}
        self.on_moving: Callable[[bool], None] = lambda moving: None  # something begins to move, or all is at rest
        self._was_moving = False
        self.abandoned = False  # the cell cannot go on, and so nothing is done for it any more
        self.escaped = 0  # characters that hosts heard though they were taken back
        self.rewinds = 0
        self.longest_rewind: WallNs = 0

    # -- the beginning -----------------------------------------------------------------------------------

    def begin(self, pace: Pace, inputs: Mapping[str, Level]) -> None:
        """The cell's present is the boards' present; `inputs` are what the cell was built with."""
        self._raw, self._given = dict(inputs), dict(inputs)
        self.align(pace)
        for axle in self.axles:
            axle.stepper.adopt(axle.shaft_at(self.cell.now))
            axle.standing = Standing.DRIVEN
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

    # -- as it is served ---------------------------------------------------------------------------------

    @property
    def now(self) -> Ns:
        """The time of the cell."""
        return self.cell.now

    def next_event(self) -> Ns | None:
        """When something happens by itself."""
        return self.cell.next_event()

    def run_to(self, until: Ns) -> None:
        """Let everything happen up to `until`, and take note of it."""
        cell = self.cell
        while (at := cell.next_event()) is not None and at <= until:
            cell.run_to(at)
            self._absorb()
        cell.run_to(until)
        self._absorb()

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now."""
        self.cell.send(line, data)
        self._absorb()

    # -- as the boards are served ------------------------------------------------------------------------

    def reading(self) -> Sequence[int]:
        """Descriptors that may have something to read."""
        return self.boards.reading()

    def writing(self) -> Sequence[int]:
        """Descriptors that wait for room."""
        return self.boards.writing()

    def receive(self, descriptor: int) -> None:
        """Something can be read."""
        self.boards.receive(descriptor, self._wall())

    def flush(self, descriptor: int) -> None:
        """Something can be written."""
        self.boards.flush(descriptor, self._wall())

    def deadline(self) -> Ns | None:
        """When `serve` is to be called at the latest, by `clock`."""
        wall, clock = self._wall(), self.clock()
        times = [at for at in (self.boards.deadline(), self.boards.commit_at()) if at is not None]
        if self._pending:
            times.append(self._committed + COMMIT_EVERY)
        at = clock + min(times) - wall if times else None
        behind = self._behind  # what was said and stored before that is certain
        held = min((line.first for line in self.lines), default=NEVER)
        tail = min((axle.guard.next for axle in self.axles), default=NEVER)
        cell = min(tail, min(held, self._stores.first) + behind)
        if cell < NEVER:
            at = cell + self._align if at is None else min(at, cell + self._align)
        return at

    def serve(self) -> None:
        """The cell is at its present: deal with what came from the boards, and give them what is certain."""
        wall = self._wall()
        due = self.boards.deadline()
        if due is not None and due <= wall:
            self.boards.due(wall)
        if self.abandoned:
            self.boards.events()
            return
        for event in self.boards.events():
            self._happened(event)
        self._absorb()
        self._refresh()
        wanted = self.boards.commit_at()
        if (self._pending and wall - self._committed >= COMMIT_EVERY) or (wanted is not None and wanted <= wall):
            self.commit()
            for event in self.boards.events():
                self._happened(event)
        self._stores.flush(self._horizon())
        self._forget()
        moving = any(axle.motion is not None for axle in self.axles)
        if moving is not self._was_moving:
            self._was_moving = moving
            self.on_moving(moving)

    def commit(self) -> None:
        """Give the boards what is certain, at once."""
        self._committed = self._wall()
        self.boards.commit(self.cell.now, self._committed)
        self._pending = False

    @property
    def _guarded(self) -> bool:
        return any(axle.guard.armed for axle in self.axles)

    # -- what is certain ---------------------------------------------------------------------------------

    @property
    def lag(self) -> Ns:
        """How much later than the lead the pins are at present: the latest axis."""
        return max((axle.stepper.lag for axle in self.axles), default=0)

    @property
    def _behind(self) -> Ns:
        """So long after the cell said something it is certain."""
        return self.plan.lead + self.lag + CERTAIN if self.plan.held else 0

    def _horizon(self) -> Ns:
        return self.cell.now - self._behind

    def _forget(self) -> None:
        oldest = self.past.forget(self.cell.now - self.plan.lead - self.lag - CERTAIN - SLACK)
        if oldest is None:
            return
        counts = iter(oldest.counts)
        for axle in self.axles:
            axle.motions.forget(next(counts))
        for out in self._outs.values():
            out.levels.forget(next(counts))
        for _ in self.lines:
            next(counts)
        self._stores.forget(next(counts))

    def _counts(self) -> tuple[int, ...]:
        return (
            *(axle.motions.count for axle in self.axles),
            *(out.levels.count for out in self._outs.values()),
            *(line.count for line in self.lines),
            self._stores.count,
        )

    # -- what the cell does ------------------------------------------------------------------------------

    def _absorb(self) -> None:
        """Take over what the cell did, tell the boards of it, and arm what would stop it."""
        changed = self._take(self._batches(), tell=True)
        for line in self.lines:
            line.absorb()
        if not changed:
            return
        self._pending = True
        at_fault = {
            axle.what.unit for axle in self.axles if axle.standing is Standing.FAULT and axle.motion is not None
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
            axles = self._of_unit.get(unit)
            for entry in entries:
                if isinstance(entry, (MotionStarted, MotionCut, MotionEnded)):
                    for axle in axles or ():
                        if axle.what.axis == entry.axis:
                            axle.take(entry)
                            found = True
                            if tell and axle.standing is not Standing.FAULT:
                                axle.stepper.tell(entry)
                elif isinstance(entry, PinSet):
                    if (unit, entry.pin) in self._outs:
                        self._level(unit, entry.pin, bool(entry.level), entry.at, tell=tell)
                        found = True
                elif isinstance(entry, Powered):
                    self._powered(unit, entry, tell=tell)
                    found = True
                elif isinstance(entry, (StageSet, DriveSet)):
                    self._staged(unit, entry)
            found = found or axles is not None
        return found

    def _powered(self, unit: int, entry: Powered, *, tell: bool) -> None:
        for axle in self._of_unit.get(unit, ()):
            if axle.what.enable:
                self._level(unit, axle.what.enable, entry.on, entry.at, tell=tell)
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
        axles = self._of_unit.get(out.unit, ())
        if any(axle.what.enable == out.name and axle.standing is Standing.FAULT for axle in axles):
            return
        self.boards.outs[out.name].set(level, at, max((axle.stepper.lag for axle in axles), default=0))
        self._pending = True

    def _staged(self, unit: int, entry: StageSet | DriveSet) -> None:
        stage = entry.stage if isinstance(entry, StageSet) else getattr(entry.drive, "stage", None)
        for axle in self._of_unit.get(unit, ()):
            if axle.what.axis == entry.axis and stage is not None and self._stages.get(axle.name) != stage:
                self._stages[axle.name] = stage
                self._command(axle)

    def _command(self, axle: Axle) -> None:
        """Tell the driver of an axis its current."""
        stage = self._stages.get(axle.name)
        if stage is None:
            return
        if axle.what.driver:
            try:
                self.boards.drivers[axle.what.driver].command(stage)
            except SetupProblem as problem:
                self._fault(axle, str(self.plan.problem(problem)))
        if axle.what.half:
            self.boards.outs[axle.what.half].now(min(stage.run, stage.hold if stage.settling else 1.0) <= 0.5)

    # -- stops -------------------------------------------------------------------------------------------

    def _arm(self) -> None:
        """Let the firmware watch the inputs that would cut what is under way."""
        now, kept = self.cell.now, False
        for axle in self.axles:
            if axle.standing is not Standing.DRIVEN:
                continue
            motion = axle.motion
            inputs: dict[str, Level] = {}
            if motion is not None:
                controller = self.cell.controller(axle.what.unit)
                for stop in controller.cuts(now, axle.what.axis):
                    name = self._input_of.get((axle.what.unit, stop.pin))
                    if name is not None and self.plan.board_of[name] == axle.what.board:
                        inputs[name] = stop.level
            if inputs != axle.guard.wanted:
                at = motion.at if motion is not None and not axle.guard.armed else now
                axle.guard.want(inputs, at, self.plan.lead + axle.stepper.lag)
                self._pending = True
                if inputs and not kept:
                    self.past.keep()
                    kept = True
        if not kept and self._guarded and (not self.past.moments or now - self.past.moments[-1].now >= KEEP):
            self.past.keep()

    def _refresh(self) -> None:
        for axle in self.axles:
            if axle.guard.next <= self.cell.now:
                axle.guard.refresh(self.cell.now, self.cell.now)
        self._arm()

    def _give(self, name: str, level: Level, board_ns: Ns) -> None:
        """An input has another level, as far as the cell is concerned from now on."""
        unit, pin = self.plan.inputs[name]
        self._given[name] = level
        self._reports.append((self.cell.now, SetPin(unit, pin, level), board_ns))
        self.cell.set_pin(unit, pin, level)
        self._absorb()

    def _stopped(self, event: Stopped) -> None:
        """The firmware has stopped an axis: the cell is taken back to there."""
        began = self._wall()
        axle = self._by_stepper[event.stepper]
        axle.guard.fired()
        axle.stops += 1
        self.rewinds += 1
        unit, pin = self.plan.inputs[event.input]
        at = axle.instant_of(event.shaft, event.at)
        if not self.past.reaches(at):
            at = self.past.moments[0].now if self.past.moments else self.cell.now
        at = min(at, self.cell.now)
        # what the machine's other inputs are at was so at the stop already: motors stand, and reports take their time
        others = {name: int(found) for name, found in event.levels.items() if name != event.input}
        late = {self.plan.inputs[name] for name in others}
        fresh = {(set_.unit, set_.pin) for when, set_, _ in self._reports if when > at}
        deeds: list[Deed] = []
        for name, found in others.items():
            place = self.plan.inputs[name]
            if place in fresh or self._given[name] != found:
                deeds.append(SetPin(*place, found))
                self._raw[name] = self._given[name] = found
        level = int(event.level)
        deeds.append(SetPin(unit, pin, level))
        drop = {(when, set_) for when, set_, _ in self._reports if when > at and (set_.unit, set_.pin) in late}
        self._reports = deque((item for item in self._reports if item[:2] not in drop), maxlen=256)
        self._take_back(axle, at, deeds, lambda action: (action.at, action.deed) in drop, event.shaft)
        self._raw[event.input], self._given[event.input] = int(event.present), level
        if int(event.present) != level:
            self._give(event.input, int(event.present), self.clock())
        self._arm()
        self.commit()
        self.longest_rewind = max(self.longest_rewind, self._wall() - began)

    def _take_back(
        self, stopped: Axle, at: Ns, deeds: Sequence[Deed], drop: Callable[[Action], bool], shaft: int
    ) -> None:
        """The cell lives on from `at`, where `deeds` are done; tell the boards only what is different."""
        motions: dict[str, list[Motion]] = {}
        levels: dict[str, list[tuple[Ns, bool]]] = {}
        counts: list[int] = []
        places: dict[str, int] = {}
        if not self.past.moments:
            self.past.keep()

        def arrived(moment: Moment) -> None:
            """The cell is at `at` again: what it did up to there was told before."""
            batches = self._batches()
            ahead = list(moment.counts)
            for place, axle in enumerate(self.axles):
                ahead[place] += sum(
                    isinstance(entry, (MotionStarted, MotionCut, MotionEnded)) and entry.axis == axle.what.axis
                    for unit, entries in batches
                    if axle in self._of_unit.get(unit, ())
                    for entry in entries
                )
            counts.extend(ahead[: len(self.axles)])
            for axle, count in zip(self.axles, counts, strict=True):
                before = axle.motions.before(count)
                motions[axle.name] = axle.take_back(count, _rests(before, axle.shaft_at(at)))
            place = len(self.axles)
            for out in self._outs.values():
                count = moment.counts[place] + self._levels_in(batches, out)
                levels[out.name], places[out.name] = out.levels.cut(count), count
                place += 1
            for number in range(len(self.lines)):
                heard = self.cell.lines[number].take()
                counts.append(moment.counts[place] + len(heard))
                place += 1
            self._stores.cut()

        self._stores.count = [m for m in self.past.moments if m.now <= at][-1].counts[-1]
        self.past.back(at, deeds, drop, arrived)
        self._take(self._batches(), tell=False)
        heard: list[list[Heard]] = [self.cell.lines[number].take() for number in range(len(self.lines))]
        for line, count, new in zip(self.lines, counts[len(self.axles) :], heard, strict=True):
            for wrong, right in line.rewind(count, new):
                self.escaped += 1
                instead = "" if right is None else f"; it would be {right.char.value:#04x}"
                what = f"a host heard {wrong.char.value:#04x} of {wrong.at / 1e9:.4f} s before a stop took it back"
                self._say(Weight.WARNING, what + instead)
        self._tell_axles(stopped, shaft, motions, counts)
        self._arm()  # before any pulse leaves
        self.commit()
        for out in self._outs.values():
            self._tell_out(out, levels[out.name], out.levels.since(places[out.name]), at, stopped)
        self._pending = True

    def _levels_in(self, batches: Sequence[Batch], out: Out) -> int:
        """How many items of the channel of an output these entries make."""
        count = 0
        for unit, entries in batches:
            if unit != out.unit:
                continue
            for entry in entries:
                if isinstance(entry, PinSet):
                    count += self._outs.get((unit, entry.pin)) is out
                elif isinstance(entry, Powered):
                    enables = any(axle.what.enable == out.name for axle in self._of_unit.get(unit, ()))
                    count += enables or not entry.on
        return count

    def _tell_axles(self, stopped: Axle, shaft: int, old: dict[str, list[Motion]], counts: Sequence[int]) -> None:
        now = self.cell.now
        for axle, count in zip(self.axles, counts, strict=False):
            new = axle.motions.since(count)
            if axle.standing is not Standing.DRIVEN:
                continue
            if axle is not stopped:
                lost = axle.tell_difference(old[axle.name], new, now)
                if lost:
                    self._contradicted(axle, stopped, lost)
                continue
            axle.stepper.rewind(shaft)
            force = axle.motion_after(count)
            if force is not None:
                axle.stepper.tell(force)
            for motion in new:
                axle.stepper.tell(motion)

    def _tell_out(
        self, out: Out, old: list[tuple[Ns, bool]], new: list[tuple[Ns, bool]], at: Ns, stopped: Axle
    ) -> None:
        mine = out.unit == self.cell.unit(stopped.what.unit)
        same = alike(old, new)
        if not mine and same == len(old):
            for when, level in new[same:]:
                self._set(out, level, when)
            return
        self.boards.outs[out.name].rewind(at)
        for when, level in new:
            self._set(out, level, when)

    def _contradicted(self, axle: Axle, stopped: Axle, lost: int) -> None:
        """Pulses left that the cell did not give after all: it is told where the motor is, and the axis stands."""
        what = f"{lost} steps left the pins though a stop of {stopped.name} took them back"
        self._fault(axle, f"{what}: wires of the cell make it follow too closely; the counter says where it stands")
        self._place(axle, axle.stepper.shaft)

    # -- what comes from the boards ----------------------------------------------------------------------

    def _happened(self, event: Event) -> None:
        match event:
            case InputChanged(_, name, level, at):
                self._raw[name] = int(level)
                if int(level) != self._given.get(name):
                    self._give(name, int(level), at + self._shift)
            case Stopped():
                axle = self._by_stepper[event.stepper]
                if axle.standing is Standing.DRIVEN and event.input in self.plan.inputs:
                    self._stopped(event)
                elif axle.standing is Standing.DRIVEN:
                    self._fault(axle, "the board has stopped it, and does not say why")
                    self._place(axle, event.shaft)
            case Slipped(_, stepper, at, by):
                self._later(self._by_stepper[stepper], at)
                slips = self._by_stepper[stepper].stepper.slips
                what = f"{stepper} slipped by {show_duration(by)}: the computer was late; no step is lost"
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
        axle.standing, axle.why, axle.known = Standing.FAULT, why, known
        axle.guard.release()
        self.cell.halt(axle.what.unit)
        self._absorb()
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
            else:
                self._place(axle, shaft)
                axle.stepper.rewind(shaft)
                what = f"{axle.name} goes on at {shaft}, as the board has counted"
                self._say(Weight.WARNING, f"{what}; the motor may have lost steps when it was stopped")
            self._driven_again(axle)
            axle.known = shaft is not None
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
        axle.standing, axle.why, axle.known = Standing.DRIVEN, "", True
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

    def close(self) -> None:
        """Let go: what is certain is stored, drivers are switched off, and no step comes any more."""
        self._stores.flush(NEVER)
        for axle in self.axles:
            if axle.what.enable:
                self.boards.outs[axle.what.enable].now(False)
        self.boards.commit(self.cell.now, self._wall())
        self.boards.close()
        self.on_moving(False)

    # -- looking -----------------------------------------------------------------------------------------

    def _say(self, weight: Weight, text: str) -> None:
        self._tell(News(self.cell.now, weight, text))

    def axes(self) -> list[AxisState]:
        """How every driven axis stands."""
        now = self.cell.now
        return [
            AxisState(axle.what.unit, axle.what.axis, axle.what.board, axle.standing, axle.why, axle.shaft_at(now),
                      axle.known, axle.motion is not None, self.plan.lead, axle.stepper.lag, axle.stepper.slips,
                      axle.stepper.slipped, axle.stops, tuple(axle.guard.armed))
            for axle in self.axles
        ]  # fmt: skip

    def board_states(self) -> list[BoardState]:
        """How every board stands."""
        return [
            BoardState(name, board.state.value, board.firmware, board.frequency, board.move_count)
            for name, board in self.boards.boards.items()
        ]


def _rests(before: Sequence[Motion], shaft: int) -> int:
    """Where an axis is at rest behind these entries; `shaft` if they say nothing of it."""
    if len(before) >= 2 and not isinstance(before[-1], MotionStarted) and isinstance(before[-2], MotionStarted):
        return before[-2].shaft + before[-2].direction * before[-1].last
    return shaft
