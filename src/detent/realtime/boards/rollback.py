"""A stop in the firmware takes the cell back to where it happened, and the boards are told what is different since."""

from collections.abc import Callable, Sequence
from typing import TypeAlias

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.actions import Action, TimedAction
from detent.cell.recording import Batch
from detent.controllers.device import DriveSet, Powered, StageSet
from detent.lines.line import Heard
from detent.pins import Level, PinSet
from detent.realtime.boards.axis_ledger import AxisLedger, Motion
from detent.realtime.boards.channels import alike
from detent.realtime.boards.events import Stopped
from detent.realtime.boards.faults import Faults
from detent.realtime.boards.outgoing import CellOutput, Outgoing
from detent.realtime.boards.past import Moment
from detent.realtime.boards.states import Severity, Standing
from detent.realtime.pace import WallNs
from detent.ticks import MS, Ns

AWAITED: Ns = 100 * MS  # reports of a trigger come every 25 ms
AxisNews: TypeAlias = Motion | StageSet | DriveSet
MOST_SINGLES = 8  # pulses in a row that an input stops one by one


class Rollback:
    """What is done when the firmware has stopped an axis. What cannot be lived through once more is a fault."""

    def __init__(self, outgoing: Outgoing, faults: Faults) -> None:
        self._outgoing, self._faults = outgoing, faults
        self._cell, self._boards, self._plan = outgoing.cell, outgoing.boards, outgoing.plan
        self._ledgers, self._past, self._wall = outgoing.ledgers, outgoing.past, outgoing.wall
        self.on_taken_back: Callable[[Ns], None] = lambda at: None  # what the cell did behind `at` did not happen
        self.escaped = 0  # characters that hosts heard though they were taken back
        self.rewinds = 0
        self.longest_rewind: WallNs = 0

    def stopped(self, event: Stopped) -> None:
        """The firmware has stopped an axis: the cell is taken back to there."""
        began = self._wall()
        ledger = self._outgoing.by_stepper[event.stepper]
        if self._stands(ledger, event.at) or (
            ledger.motion is None and self._outgoing.inputs.stopped_before(event, ledger)
        ):
            self.stopped_too(ledger, event)  # the input has stopped it in the cell already
            return
        ledger.guard.fired()
        ledger.stops += 1
        self.rewinds += 1
        at = min(ledger.instant_of(event.shaft, event.at), self._cell.now)
        if self._past.moments:
            at = max(at, ledger.barred, self._past.moments[0].now)
        if not self._past.reaches(at) or ledger.place_at(at) != event.shaft:
            self._faults.fault(ledger, f"{event.input} has stopped it at {event.shaft}, and nobody knows when that was")
            self._faults.place(ledger, event.shaft)
            return
        if self._gates(ledger, event):
            what = f"{event.input} lets every single pulse through, and on real pins each takes some milliseconds"
            self._faults.fault(ledger, f"{what}: leave the input out, and wire the detector to the driver")
            self._faults.place(ledger, event.shaft)
            return
        actions, drop = self._outgoing.inputs.taken_back(ledger, event, at)
        self._take_back(ledger, at, actions, lambda action: (action.at, action.what) in drop, event)
        if event.present is not event.level:
            self._outgoing.give(event.input, int(event.present))
        self._outgoing.arm()
        self._outgoing.commit()
        self.longest_rewind = max(self.longest_rewind, self._wall() - began)

    def ran_dry(self, event: Stopped) -> None:
        """Pulses did not reach the board in time, and it has stopped before them: what it did not make comes later.

        The cell lives through it once more, and does the same, so that every input is armed again where it was.
        """
        ledger = self._outgoing.by_stepper[event.stepper]
        if self._stands(ledger, max(event.dry)):
            self.stopped_too(ledger, event)
            return
        found = [(ledger.instant_of(event.shaft, near), near) for near in event.dry]
        at = min(min(found, key=lambda pair: abs(pair[0] - pair[1]))[0], self._cell.now)
        guarded = ledger.guard.watched(at)
        ledger.guard.fired()
        known = at >= ledger.barred and self._past.reaches(at)
        if ledger.place_at(at) != event.shaft or (guarded and not known):
            self._faults.fault(ledger, f"it was late, and stands at {event.shaft}: nobody knows when that was")
            self._faults.place(ledger, event.shaft)
            return
        if guarded:
            self._take_back(ledger, at, (), lambda action: False, event)
        else:
            ledger.stepper.rewind(event.shaft, slipped=True)
            for motion in ledger.motions_from(at):
                ledger.stepper.tell(motion)
        self._outgoing.arm()
        self._outgoing.commit()

    @staticmethod
    def _stands(ledger: AxisLedger, at: Ns) -> bool:
        """Whether an axis rests since it was placed where steps that had left would take it, behind a stop `at`."""
        return ledger.motion is None and at < ledger.barred

    def _gates(self, ledger: AxisLedger, event: Stopped) -> bool:
        """Whether an input has stopped every single pulse of late."""
        last = ledger.held
        alone = last is not None and last[:2] == (event.input, event.level) and abs(event.shaft - last[2]) <= 1
        ledger.held = event.input, event.level, event.shaft
        ledger.singles = ledger.singles + 1 if alone else 0
        return ledger.singles >= MOST_SINGLES

    def _take_back(
        self,
        stopped: AxisLedger,
        at: Ns,
        actions: Sequence[Action],
        drop: Callable[[TimedAction], bool],
        event: Stopped,
    ) -> None:
        """The cell lives on from `at`, where `actions` are done; tell the boards only what is different."""
        self.on_taken_back(at)
        at_fault = [ledger for ledger in self._ledgers if ledger.standing is Standing.FAULT]
        stood = [ledger.shaft_at(self._cell.now) for ledger in at_fault]
        motions: dict[str, list[Motion]] = {}
        levels: dict[str, list[tuple[Ns, bool]]] = {}
        counts: list[int] = []
        places: dict[str, int] = {}
        if not self._past.moments:
            self._past.keep()

        def arrived(moment: Moment) -> None:
            """The cell is at `at` again: what it did up to there was told before."""
            batches = self._outgoing.batches()
            ahead = list(moment.counts)
            for place, ledger in enumerate(self._ledgers):
                ahead[place] += self._told(batches, ledger, MotionStarted, MotionCut, MotionEnded)
            counts.extend(ahead[: len(self._ledgers)])
            for ledger, count in zip(self._ledgers, counts, strict=True):
                before = ledger.motions.before(count)
                here = ledger.place_at(at)
                motions[ledger.name] = ledger.take_back(
                    count, _rests(before, ledger.shaft_at(at) if here is None else here)
                )
            place = len(self._ledgers)
            for out in self._outgoing.outputs.values():
                count = moment.counts[place] + self._levels_in(batches, out)
                levels[out.name], places[out.name] = out.levels.cut(count), count
                place += 1
            for number in range(len(self._outgoing.lines)):
                heard = self._cell.lines[number].take()
                counts.append(moment.counts[place] + len(heard))
                place += 1
            for ledger in self._ledgers:
                ledger.stages.cut(moment.counts[place] + self._told(batches, ledger, StageSet, DriveSet))
                place += 1
            self._outgoing.stores.cut()
            if event.dry:  # nothing is different from there on: what was armed is armed
                met.append((at, self._outgoing.cuts(stopped)))

        met: list[tuple[Ns, dict[str, Level]]] = []  # what would stop it, from when on

        def lived() -> None:
            self._outgoing.take(self._outgoing.batches(), tell=False)
            inputs = self._outgoing.cuts(stopped)
            if not met or inputs != met[-1][1]:
                met.append((self._cell.now, inputs))

        self._outgoing.stores.count = [m for m in self._past.moments if m.now <= at][-1].counts[-1]
        self._outgoing.living_again = True  # inputs are armed anew only behind it
        self._past.back(at, actions, drop, arrived, lived)
        self._outgoing.living_again = False
        lived()
        heard: list[list[Heard]] = [self._cell.lines[number].take() for number in range(len(self._outgoing.lines))]
        for line, count, new in zip(self._outgoing.lines, counts[len(self._ledgers) :], heard, strict=True):
            for wrong, right in line.rewind(count, new):
                self.escaped += 1
                instead = "" if right is None else f"; it would be {right.char.value:#04x}"
                what = f"a host heard {wrong.char.value:#04x} of {wrong.at / 1e9:.4f} s before a stop took it back"
                self._outgoing.say(Severity.WARNING, what + instead)
        self._tell_ledgers(stopped, event, motions, counts)
        self._outgoing.hold()
        for ledger, shaft in zip(at_fault, stood, strict=True):
            self._faults.place(ledger, shaft)  # whatever the cell had it do: no motor did
        if stopped.standing is Standing.DRIVEN:  # before any pulse leaves; those that came and went meanwhile, too
            for when, inputs in met:
                stopped.guard.want(inputs, when, when)
        self._outgoing.arm()
        self._outgoing.commit()
        for out in self._outgoing.outputs.values():
            self._tell_out(out, levels[out.name], places[out.name], at)
        self._outgoing.pending = True

    def _told(self, batches: Sequence[Batch], ledger: AxisLedger, *kinds: type[AxisNews]) -> int:
        """How many entries of these kinds tell of an axis."""
        return sum(
            isinstance(entry, kinds) and entry.axis == ledger.what.axis
            for unit, entries in batches
            if ledger in self._outgoing.of_unit(unit)
            for entry in entries
        )

    def _levels_in(self, batches: Sequence[Batch], out: CellOutput) -> int:
        """How many items of the channel of an output these entries make."""
        count = 0
        for unit, entries in batches:
            if unit != out.unit:
                continue
            for entry in entries:
                if isinstance(entry, PinSet):
                    count += self._outgoing.outputs.get((unit, entry.pin)) is out
                elif isinstance(entry, Powered):
                    enables = any(ledger.what.enable == out.name for ledger in self._outgoing.of_unit(unit))
                    count += enables or not entry.on
        return count

    def _tell_ledgers(
        self, stopped: AxisLedger, event: Stopped, old: dict[str, list[Motion]], counts: Sequence[int]
    ) -> None:
        now = self._cell.now
        for ledger, count in zip(self._ledgers, counts, strict=False):
            new = ledger.motions.since(count)
            if ledger.standing is not Standing.DRIVEN:
                continue
            if ledger is not stopped:
                if new != old[ledger.name] and ledger.guard.armed.get(event.input) == int(event.level):
                    stands = ledger.stepper.stands(self._wall())
                    if stands is not None and not self._boards.stops[ledger.name].alive:
                        ledger.guard.fired()  # it has yet to be armed, and no step has left: there is nothing to stop
                        self._tell_anew(ledger, stands, count, new)
                        continue
                    ledger.awaits = event.input, self._wall()
                    ledger.stepper.halt()
                    self._boards.stops[ledger.name].now()  # what it was sent for later, when the input may be over
                    continue
                lost = ledger.tell_difference(old[ledger.name], new, now)
                if lost:
                    ledger.end_told(now)
                    self._contradicted(ledger, stopped, lost)
                continue
            self._tell_anew(ledger, event.shaft, count, new, slipped=bool(event.dry))

    @staticmethod
    def _tell_anew(ledger: AxisLedger, shaft: int, count: int, new: list[Motion], *, slipped: bool = False) -> None:
        """The stepper stands at `shaft`: tell it the motion in force behind its first `count` ones, and the `new`."""
        ledger.stepper.rewind(shaft, slipped=slipped)
        force = ledger.motion_after(count)
        for motion in (*([force] if force is not None else []), *new):
            ledger.stepper.tell(motion)

    def _tell_out(self, out: CellOutput, old: list[tuple[Ns, bool]], count: int, at: Ns) -> None:
        """Tell the boards what an output does behind its first `count` levels, where it did `old` before."""
        new = out.levels.since(count)
        same = alike(old, new)
        if same == len(old):
            for when, level in new[same:]:
                self._outgoing.set(out, level, when)
        else:
            self._outgoing.set_anew(out, count, at)

    def stopped_too(self, ledger: AxisLedger, event: Stopped) -> None:
        """What stopped another axis stopped this one at the same instant: the cell has been there already.

        The two are looked at one after the other, and one may be later than the other: some steps may be between.
        """
        waited, ledger.awaits = ledger.awaits, None
        ledger.guard.fired()
        ledger.stops += 1
        motion, here = ledger.motion, ledger.shaft_at(self._cell.now)
        if motion is not None and event.shaft != motion.shaft:
            name = event.input or (waited[0] if waited else "an input")
            self._faults.fault(ledger, f"{name} has stopped it, and it moves on in the cell")
            motion, here = None, ledger.shaft_at(self._cell.now)
        if motion is None and event.shaft != here:
            if abs(event.shaft - here) > 1:
                what = f"{event.shaft - here:+d} steps that had left when a stop was told are counted all the same"
                self._outgoing.say(Severity.WARNING, f"{ledger.name}: {what}")
            self._faults.place(ledger, event.shaft)
        ledger.stepper.rewind(event.shaft)
        if motion is not None:
            ledger.stepper.tell(motion)
        self._outgoing.arm()
        self._outgoing.pending = True

    def not_stopped(self) -> None:
        """An axis that should have been stopped as another was, and was not, has made what it was sent."""
        for ledger in self._ledgers:
            if ledger.awaits is None or ledger.standing is not Standing.DRIVEN:
                continue
            name, since = ledger.awaits
            if self._wall() - since > self._plan.lead + ledger.stepper.behind(self._cell.now) + AWAITED:
                ledger.awaits = None
                self._faults.fault(ledger, f"{name} has not stopped it as it stopped another axis")
                self._faults.place(ledger, ledger.stepper.shaft)

    def _contradicted(self, ledger: AxisLedger, stopped: AxisLedger, lost: int) -> None:
        """Pulses left that the cell did not give after all: it is told where the motor is, and the axis stands."""
        if ledger.what.unit == stopped.what.unit and ledger.motion is None:  # it is ahead of the other, which slipped
            what = f"{lost} steps that had left when a late stop of {stopped.name} was told are counted all the same"
            self._outgoing.say(Severity.WARNING, f"{ledger.name}: {what}")
            self._faults.place(ledger, ledger.stepper.shaft)
            return
        what = f"{lost} steps left the pins though a stop of {stopped.name} took them back"
        self._faults.fault(
            ledger, f"{what}: wires of the cell make it follow too closely; the counter says where it stands"
        )
        self._faults.place(ledger, ledger.stepper.shaft)


def _rests(before: Sequence[Motion], shaft: int) -> int:
    """Where an axis is at rest behind these entries; `shaft` if they say nothing of it."""
    if len(before) >= 2 and not isinstance(before[-1], MotionStarted) and isinstance(before[-2], MotionStarted):
        return before[-2].shaft + before[-2].direction * before[-1].last
    return shaft
