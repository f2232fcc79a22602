"""A stop in the firmware takes the cell back to where it happened, and the boards are told what is different since."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.actions import Action, SetPin, TimedAction
from detent.cell.recording import Batch
from detent.controllers.device import Powered
from detent.lines.line import Heard
from detent.pins import Level, PinSet
from detent.realtime.boards.axis_ledger import AxisLedger, Motion
from detent.realtime.boards.channels import alike
from detent.realtime.boards.events import (
    Stopped,
)
from detent.realtime.boards.outgoing import Out, Outgoing
from detent.realtime.boards.past import Moment
from detent.realtime.boards.states import Standing, Weight
from detent.ticks import MS, Ns

AWAITED: Ns = 100 * MS  # reports of a trigger come every 25 ms
MOST_SINGLES = 8  # pulses in a row that an input stops one by one


class Rollback(Outgoing):
    """What is done when the firmware has stopped an axis."""

    def _stopped(self, event: Stopped) -> None:
        """The firmware has stopped an axis: the cell is taken back to there."""
        began = self._wall()
        ledger = self._by_stepper[event.stepper]
        other, given = self._given_at.get(event.input, (ledger, event.at))
        if other is not ledger and event.at < given and ledger.motion is None:
            self._stopped_too(
                ledger, event
            )  # it is later than the other, and the input has stopped it in the cell already
            return
        ledger.guard.fired()
        ledger.stops += 1
        self.rewinds += 1
        unit, pin = self.plan.inputs[event.input]
        at = min(ledger.instant_of(event.shaft, event.at), self.cell.now)
        if self.past.moments:
            at = max(at, self.past.moments[0].now)
        if not self.past.reaches(at) or ledger.place_at(at) != event.shaft:
            self._fault(ledger, f"{event.input} has stopped it at {event.shaft}, and nobody knows when that was")
            self._place(ledger, event.shaft)
            return
        if self._gates(ledger, event):
            what = f"{event.input} lets every single pulse through, and on real pins each takes some milliseconds"
            self._fault(ledger, f"{what}: leave the input out, and wire the detector to the driver")
            self._place(ledger, event.shaft)
            return
        # what the switches of this axis are at was so at the stop already: it stands, and reports take their time
        switches = {(unit, other) for other in self.cell.controller(unit).switches(ledger.what.axis)}
        if (unit, pin) in switches:
            ledger.lost, ledger.known = False, True  # as far as a switch tells it
        others = {
            name: int(found)
            for name, found in event.levels.items()
            if name != event.input and self.plan.inputs[name] in switches
        }
        late = {self.plan.inputs[name] for name in (*others, event.input)}
        fresh = {(set_.unit, set_.pin) for when, set_, _ in self._reports if when > at}
        actions: list[Action] = []
        for name, found in others.items():
            place = self.plan.inputs[name]
            if place in fresh or self._given[name] != found:
                actions.append(SetPin(*place, found))
                self._raw[name] = self._given[name] = found
        self._given_at[event.input] = ledger, at
        level = int(event.level)
        actions.append(SetPin(unit, pin, level))
        drop = {(when, set_) for when, set_, _ in self._reports if when > at and (set_.unit, set_.pin) in late}
        self._reports = deque((item for item in self._reports if item[:2] not in drop), maxlen=256)
        self._take_back(ledger, at, actions, lambda action: (action.at, action.what) in drop, event)
        self._raw[event.input], self._given[event.input] = int(event.present), level
        if int(event.present) != level:
            self._give(event.input, int(event.present), self.clock())
        self._arm()
        self.commit()
        self.longest_rewind = max(self.longest_rewind, self._wall() - began)

    def _ran_dry(self, event: Stopped) -> None:
        """Pulses did not reach the board in time, and it has stopped before them: what it did not make comes later.

        The cell lives through it once more, and does the same, so that every input is armed again where it was.
        """
        ledger = self._by_stepper[event.stepper]
        found = [(ledger.instant_of(event.shaft, near), near) for near in event.dry]
        at = min(min(found, key=lambda pair: abs(pair[0] - pair[1]))[0], self.cell.now)
        guarded = ledger.guard.watched(at)
        ledger.guard.fired()
        if ledger.place_at(at) != event.shaft or (guarded and not self.past.reaches(at)):
            self._fault(ledger, f"it was late, and stands at {event.shaft}: nobody knows when that was")
            self._place(ledger, event.shaft)
            return
        if guarded:
            self._take_back(ledger, at, (), lambda action: False, event)
        else:
            ledger.stepper.rewind(event.shaft, slipped=True)
            for motion in ledger.motions_from(at):
                ledger.stepper.tell(motion)
        self._arm()
        self.commit()

    def _heard(self, levels: Mapping[str, bool]) -> None:
        """Inputs were asked for their levels, and no report tells them again: what the cell has not, it gets now."""
        for name, found in levels.items():
            self._raw[name] = int(found)
            if self._given[name] != int(found):
                self._give(name, int(found), self.clock())

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
            for place, ledger in enumerate(self.ledgers):
                ahead[place] += sum(
                    isinstance(entry, (MotionStarted, MotionCut, MotionEnded)) and entry.axis == ledger.what.axis
                    for unit, entries in batches
                    if ledger in self._of_unit.get(unit, ())
                    for entry in entries
                )
            counts.extend(ahead[: len(self.ledgers)])
            for ledger, count in zip(self.ledgers, counts, strict=True):
                before = ledger.motions.before(count)
                here = ledger.place_at(at)
                motions[ledger.name] = ledger.take_back(
                    count, _rests(before, ledger.shaft_at(at) if here is None else here)
                )
            place = len(self.ledgers)
            for out in self._outs.values():
                count = moment.counts[place] + self._levels_in(batches, out)
                levels[out.name], places[out.name] = out.levels.cut(count), count
                place += 1
            for number in range(len(self.lines)):
                heard = self.cell.lines[number].take()
                counts.append(moment.counts[place] + len(heard))
                place += 1
            self._stores.cut()
            if event.dry:  # nothing is different from there on: what was armed is armed
                met.append((at, self._cuts(stopped)))

        met: list[tuple[Ns, dict[str, Level]]] = []  # what would stop it, from when on

        def lived() -> None:
            self._take(self._batches(), tell=False)
            inputs = self._cuts(stopped)
            if not met or inputs != met[-1][1]:
                met.append((self.cell.now, inputs))

        self._stores.count = [m for m in self.past.moments if m.now <= at][-1].counts[-1]
        self.living_again = True  # inputs are armed anew only behind it
        self.past.back(at, actions, drop, arrived, lived)
        self.living_again = False
        lived()
        heard: list[list[Heard]] = [self.cell.lines[number].take() for number in range(len(self.lines))]
        for line, count, new in zip(self.lines, counts[len(self.ledgers) :], heard, strict=True):
            for wrong, right in line.rewind(count, new):
                self.escaped += 1
                instead = "" if right is None else f"; it would be {right.char.value:#04x}"
                what = f"a host heard {wrong.char.value:#04x} of {wrong.at / 1e9:.4f} s before a stop took it back"
                self._say(Weight.WARNING, what + instead)
        self._tell_ledgers(stopped, event, motions, counts)
        if stopped.standing is Standing.DRIVEN:  # before any pulse leaves; those that came and went meanwhile, too
            for when, inputs in met:
                stopped.guard.want(inputs, when, when)
        self._arm()
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
                    enables = any(ledger.what.enable == out.name for ledger in self._of_unit.get(unit, ()))
                    count += enables or not entry.on
        return count

    def _tell_ledgers(
        self, stopped: AxisLedger, event: Stopped, old: dict[str, list[Motion]], counts: Sequence[int]
    ) -> None:
        now = self.cell.now
        for ledger, count in zip(self.ledgers, counts, strict=False):
            new = ledger.motions.since(count)
            if ledger.standing is not Standing.DRIVEN:
                continue
            if ledger is not stopped:
                if new != old[ledger.name] and ledger.guard.armed.get(event.input) == int(event.level):
                    stands = ledger.stepper.stands(self._wall())
                    if stands is not None and not self.boards.stops[ledger.name].alive:
                        ledger.guard.fired()  # it has yet to be armed, and no step has left: there is nothing to stop
                        self._tell_anew(ledger, stands, count, new)
                        continue
                    ledger.awaits = event.input, self._wall()
                    ledger.stepper.halt()
                    self.boards.stops[ledger.name].now()  # what it was sent for later, when the input may be over
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

    def _tell_out(
        self, out: Out, old: list[tuple[Ns, bool]], new: list[tuple[Ns, bool]], at: Ns, stopped: AxisLedger
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

    def _stopped_too(self, ledger: AxisLedger, event: Stopped) -> None:
        """What stopped another axis stopped this one at the same instant: the cell has been there already.

        The two are looked at one after the other, and one may be later than the other: some steps may be between.
        """
        waited, ledger.awaits = ledger.awaits, None
        ledger.guard.fired()
        ledger.stops += 1
        motion, here = ledger.motion, ledger.shaft_at(self.cell.now)
        if motion is not None and event.shaft != motion.shaft:
            name = event.input or (waited[0] if waited else "an input")
            self._fault(ledger, f"{name} has stopped it, and it moves on in the cell")
            motion, here = None, ledger.shaft_at(self.cell.now)
        if motion is None and event.shaft != here:
            if abs(event.shaft - here) > 1:
                what = f"{event.shaft - here:+d} steps that had left when a stop was told are counted all the same"
                self._say(Weight.WARNING, f"{ledger.name}: {what}")
            self._place(ledger, event.shaft)
            self.past.clear()  # nobody goes back to before that
            self.past.keep()
        ledger.stepper.rewind(event.shaft)
        if motion is not None:
            ledger.stepper.tell(motion)
        self._arm()
        self._pending = True

    def _not_stopped(self) -> None:
        """An axis that should have been stopped as another was, and was not, has made what it was sent."""
        for ledger in self.ledgers:
            if ledger.awaits is None or ledger.standing is not Standing.DRIVEN:
                continue
            name, since = ledger.awaits
            if self._wall() - since > self.plan.lead + ledger.stepper.behind(self.cell.now) + AWAITED:
                ledger.awaits = None
                self._fault(ledger, f"{name} has not stopped it as it stopped another axis")
                self._place(ledger, ledger.stepper.shaft)

    def _contradicted(self, ledger: AxisLedger, stopped: AxisLedger, lost: int) -> None:
        """Pulses left that the cell did not give after all: it is told where the motor is, and the axis stands."""
        if ledger.what.unit == stopped.what.unit and ledger.motion is None:  # it is ahead of the other, which slipped
            what = f"{lost} steps that had left when a late stop of {stopped.name} was told are counted all the same"
            self._say(Weight.WARNING, f"{ledger.name}: {what}")
            self._place(ledger, ledger.stepper.shaft)
            self.past.clear()
            self.past.keep()
            return
        what = f"{lost} steps left the pins though a stop of {stopped.name} took them back"
        self._fault(ledger, f"{what}: wires of the cell make it follow too closely; the counter says where it stands")
        self._place(ledger, ledger.stepper.shaft)


def _rests(before: Sequence[Motion], shaft: int) -> int:
    """Where an axis is at rest behind these entries; `shaft` if they say nothing of it."""
    if len(before) >= 2 and not isinstance(before[-1], MotionStarted) and isinstance(before[-2], MotionStarted):
        return before[-2].shaft + before[-2].direction * before[-1].last
    return shaft
